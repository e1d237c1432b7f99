//! The page of a run.

use std::fs;
use std::path::Path;

use willmore::jobs::Progress;
use willmore::prelude::{
    FlowOptions, Interrupt, Job, RunDirectory, Silent, Watcher, run_in_folder,
};

use crate::common::{files, outcome, run, text};

const RUN: [&str; 8] = [
    "flow",
    "builtin:cube",
    "--cells",
    "40",
    "--steps",
    "3",
    "--frames",
    "2",
];

fn with<'a>(options: &[&'a str]) -> Vec<&'a str> {
    [&RUN[..], options].concat()
}

fn page(folder: &Path, run: &str) -> String {
    fs::read_to_string(folder.join(run).join("index.html")).unwrap()
}

#[test]
fn a_run_in_space_has_a_page_with_a_surface_to_turn() {
    let folder = tempfile::tempdir().unwrap();
    // Also where the mesh is kept without normals.
    let fair = ["fair", "builtin:cube", "--cells", "40", "--steps", "3"];
    let stl = ["--format", "stl", "--output", "stl"];
    outcome(folder.path(), &with(&["--output", "ply"]));
    outcome(folder.path(), &[&fair[..], &stl].concat());
    // With frames they are shown between the beginning and the end.
    for (name, labels) in [
        ("ply", &["before", "step 2", "after"][..]),
        ("stl", &["before", "after"]),
    ] {
        let html = page(folder.path(), name);
        assert_eq!(html.matches("class=\"viewer\"").count(), 1, "{name}");
        assert_eq!(
            html.matches("data-vertices=").count(),
            labels.len(),
            "{name}"
        );
        for label in labels {
            let surface = format!("<script type=\"text/plain\" data-label=\"{label}\"");
            assert!(html.contains(&surface), "{name}: {label}");
        }
        // All is inside: the text of a page names no address but that of SVG itself.
        assert!(!html.contains("src=\"http") && !html.contains("href=\"http"));
        assert!(html.contains("Willmore energy") && html.contains("builtin:cube"));
        assert!(html.contains("How far the surface has gone"), "{name}");
        assert_numbers_have_words(&html);
        assert!(
            html.contains(">time step<") && !html.contains(">hvp<"),
            "{name}"
        );
    }
}

/// What there is of a run that was interrupted is shown.
#[test]
fn a_run_that_is_not_finished_shows_its_surface() {
    #[derive(Clone)]
    struct Impatient(Interrupt);

    impl Progress for Impatient {
        fn reach(&self, steps: u64) {
            if steps > 0 {
                self.0.request();
            }
        }

        fn advance(&self) {}
    }

    impl Watcher for Impatient {
        fn begins(&self, _: &str, _: u64) -> Box<dyn Progress> {
            Box::new(self.clone())
        }

        fn interrupt(&self) -> Result<Interrupt, willmore::runs::Error> {
            Ok(self.0.clone())
        }
    }

    let folder = tempfile::tempdir().unwrap();
    let mut options = FlowOptions::of("builtin:torus");
    options.input.cells = Some(40);
    (options.run.steps, options.run.frames) = (Some(3), Some(1));
    options.run.output = Some(folder.path().join("run"));
    let watcher = Impatient(Interrupt::never());
    let outcome = run_in_folder(Job::Flow(options), &watcher).unwrap();
    assert!(outcome.summary.is_none() && outcome.steps == 1);
    let html = page(folder.path(), "run");
    assert!(html.contains("Not finished: 1 step"));
    for label in ["before", "step 1"] {
        assert!(html.contains(&format!("data-label=\"{label}\"")), "{label}");
    }
}

/// As Ctrl-C does, before the first of its further steps is over.
#[test]
fn a_run_that_goes_on_is_interrupted_at_once_and_has_its_page() {
    struct Interrupted(Interrupt);

    impl Watcher for Interrupted {
        fn interrupt(&self) -> Result<Interrupt, willmore::runs::Error> {
            self.0.request();
            Ok(self.0.clone())
        }
    }

    let folder = tempfile::tempdir().unwrap();
    let disc = ["flow", "builtin:disc", "--cells", "16", "--steps", "1"];
    outcome(folder.path(), &[&disc[..], &["--output", "run"]].concat());
    let resume = |more: Option<usize>, watcher: &dyn Watcher| {
        let stored = RunDirectory::open(folder.path().join("run")).unwrap();
        let job = willmore::jobs::settings::job_of(&stored).unwrap();
        willmore::jobs::resume(job, stored, more, watcher).unwrap()
    };
    for more in [Some(3), None] {
        let outcome = resume(more, &Interrupted(Interrupt::never()));
        assert!(outcome.summary.is_none() && outcome.steps == 1);
        let html = page(folder.path(), "run");
        assert!(html.contains("Not finished: 1 step"), "{more:?}");
        assert!(html.contains("Steps as a table"), "{more:?}");
    }
    let outcome = resume(None, &Silent);
    assert!(outcome.summary.is_some() && outcome.steps == 3);
}

/// Keys are for programs: no entry begins with one.
fn assert_numbers_have_words(html: &str) {
    let names = html.split("<dt>").skip(1);
    let names: Vec<&str> = names
        .map(|name| name.split("</dt>").next().unwrap())
        .collect();
    assert!(names.len() > 20);
    for name in names {
        let key = name.split(' ').next().unwrap();
        assert!(
            !key.contains('_') && name.starts_with(char::is_uppercase),
            "{name}"
        );
    }
}

/// Noise is taken off: nothing grows, and no room is left for it.
#[test]
fn a_mesh_that_is_faired_fills_its_pictures_before_and_after() {
    let folder = tempfile::tempdir().unwrap();
    let sample = [
        "sample",
        "builtin:torus",
        "--cells",
        "32",
        "--noise",
        "0.01",
    ];
    outcome(
        folder.path(),
        &[&sample[..], &["--save", "noisy.obj"]].concat(),
    );
    let fair = [
        "fair",
        "noisy.obj",
        "--cells",
        "48",
        "--steps",
        "1",
        "--output",
        "fair",
    ];
    outcome(folder.path(), &fair);
    let html = page(folder.path(), "fair");
    assert_numbers_have_words(&html);
    assert!(html.contains("<dt>How far the vertices of the mesh have gone, root mean square, in units of the input</dt>"));
    assert_eq!(html.matches("src=\"data:image/png;").count(), 2);
    for label in ["before", "after"] {
        assert!(html.contains(&format!("<span>{label}</span>")), "{label}");
    }
    let path = folder.path().join("fair/final.png");
    let picture = images::colours(&path, &fs::read(&path).unwrap()).unwrap();
    let [width, height] = picture.size();
    let is_drawn = |x: u32, y: u32| picture.pixel(x, y) != [255; 4];
    let columns = (0..width)
        .filter(|&x| (0..height).any(|y| is_drawn(x, y)))
        .count();
    let rows = (0..height)
        .filter(|&y| (0..width).any(|x| is_drawn(x, y)))
        .count();
    assert!(
        columns.max(rows) > 9 * width as usize / 10,
        "{columns} x {rows}"
    );
}

/// Most OBJ files have y up; every other axis can be chosen, and a run that is resumed keeps it.
#[test]
fn the_axis_that_points_up_is_that_of_the_format_or_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let cut = ["--without", "box:-0.5,-0.5,0.1,0.5,0.5,0.5"];
    for (file, up) in [("box.obj", "1"), ("box.ply", "2")] {
        let sample = ["sample", "builtin:cube", "--cells", "24", "--save", file];
        outcome(folder.path(), &[&sample[..], &cut].concat());
        if file == "box.obj" {
            // What other programs write does not name it.
            let text = fs::read_to_string(folder.path().join(file)).unwrap();
            fs::write(folder.path().join(file), text.replace("# up z\n", "")).unwrap();
        }
        let flow = ["flow", file, "--cells", "24", "--steps", "1", "--output"];
        for (chosen, up) in [(&[][..], up), (&["--up", "x"], "0")] {
            let name = format!("{file}-{up}");
            outcome(folder.path(), &[&flow[..], &[&name], chosen].concat());
            let expected = format!("data-up=\"{up}\"");
            assert!(page(folder.path(), &name).contains(&expected), "{name}");
        }
    }
    let picture = |run: &str| fs::read(folder.path().join(run).join("final.png")).unwrap();
    assert_ne!(picture("box.obj-1"), picture("box.obj-0"));
    fs::remove_file(folder.path().join("box.obj-1/index.html")).unwrap();
    outcome(folder.path(), &["resume", "box.obj-1"]);
    assert!(page(folder.path(), "box.obj-1").contains("data-up=\"1\""));
}

/// Meshes keep their coordinates in every format, and name the axis where it is not the usual one.
#[test]
fn a_mesh_that_was_an_obj_file_stands_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let cut = ["--without", "box:-0.5,-0.5,0.1,0.5,0.5,0.5"];
    let sample = |from: &str, to: &str, more: &[&str]| {
        outcome(
            folder.path(),
            &[&["sample", from, "--save", to], more].concat(),
        );
    };
    sample(
        "builtin:cube",
        "z.obj",
        &[&["--cells", "24"], &cut[..]].concat(),
    );
    let text = fs::read_to_string(at("z.obj")).unwrap();
    // What other programs write does not name it.
    fs::write(at("box.obj"), text.replace("# up z\n", "")).unwrap();
    for (from, to, up) in [
        ("box.obj", "box.ply", "y"),
        ("box.obj", "box.stl", "y"),
        ("box.ply", "back.obj", "y"),
        ("box.stl", "again.ply", "y"),
        ("z.obj", "z.ply", "z"),
    ] {
        sample(from, to, &[]);
        assert_eq!(surfaces::up_axis(at(to)).unwrap().to_string(), up, "{to}");
    }
    for (file, up) in [("box.ply", 1), ("box.stl", 1), ("z.obj", 2)] {
        let flow = ["flow", file, "--cells", "24", "--steps", "1", "--output"];
        let name = format!("run-{file}");
        outcome(folder.path(), &[&flow[..], &[&name]].concat());
        let expected = format!("data-up=\"{up}\"");
        assert!(page(folder.path(), &name).contains(&expected), "{name}");
        for mesh in ["start.ply", "final.ply"] {
            let written = surfaces::up_axis(at(&name).join(mesh)).unwrap();
            assert_eq!(written.index(), up, "{name}/{mesh}");
        }
    }
}

#[test]
fn a_run_in_the_plane_has_a_page_with_drawings() {
    let folder = tempfile::tempdir().unwrap();
    let mcf = ["mcf", "builtin:ring", "--cells", "32", "--steps", "2"];
    let frames = ["--frames", "1", "--output", "ring"];
    outcome(folder.path(), &[&mcf[..], &frames[..]].concat());
    let html = page(folder.path(), "ring");
    // These and the plot of the steps.
    assert_eq!(html.matches("data:image/svg+xml").count(), 4);
    for label in ["before", "step 1", "after"] {
        let frame = format!("class=\"frame\" data-label=\"{label}\"");
        assert!(html.contains(&frame), "{label}");
    }
    assert_numbers_have_words(&html);
    let rows = html.split("<tbody>").nth(1).unwrap();
    assert_eq!(
        rows.split("</tbody>")
            .next()
            .unwrap()
            .matches("<tr>")
            .count(),
        2
    );
}

/// The page is none of the files of the run.
#[test]
fn a_page_may_go_and_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    outcome(folder.path(), &with(&["--output", "run"]));
    let (path, before) = (
        folder.path().join("run/index.html"),
        page(folder.path(), "run"),
    );
    let checkpoint = folder.path().join("run/checkpoints/step-00000003.ckpt");
    let listed = text(&fs::read(checkpoint).unwrap());
    assert!(listed.contains("final.ply") && !listed.contains("index.html"));
    fs::remove_file(&path).unwrap();
    for damage in [None, Some("half a page")] {
        if let Some(damage) = damage {
            fs::write(&path, damage).unwrap();
        }
        let resumed = run(folder.path(), &["resume", "run"]);
        assert!(resumed.status.success(), "{}", text(&resumed.stderr));
        assert_eq!(page(folder.path(), "run"), before);
    }
}

#[test]
fn a_run_without_a_page_stays_without() {
    let folder = tempfile::tempdir().unwrap();
    outcome(folder.path(), &with(&["--output", "with"]));
    outcome(folder.path(), &with(&["--no-page", "--output", "without"]));
    outcome(folder.path(), &["resume", "without"]);
    let names = |run: &str| {
        files(&folder.path().join(run))
            .into_keys()
            .collect::<Vec<_>>()
    };
    let mut expected = names("with");
    expected.retain(|name| name != Path::new("index.html"));
    assert_eq!(names("without"), expected);
}

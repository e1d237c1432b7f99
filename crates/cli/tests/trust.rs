//! What a person can rely on: nothing is lost, everything is in the units of the input, and what cannot be done is said.

use std::f64::consts::PI;
use std::fs;
use std::path::Path;

use geometry::shapes::{Ball, Cuboid};
use geometry::{SignedDistance, SignedDistanceExt};
use images::{Frame, drawing};
use render::{Picture, Rgb};

use crate::common::{outcome, program, run, text};

/// A quick run in the folder that follows.
const DISC: [&str; 7] = [
    "flow",
    "builtin:disc",
    "--cells",
    "16",
    "--steps",
    "1",
    "--output",
];

fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    text(&output.stderr)
}

/// A drawing of so many pixels a side.
fn draw(path: &Path, pixels: u32, shape: &impl SignedDistance<2>) {
    let frame = Frame::new([pixels; 2], [0.0, f64::from(pixels)], 1.0).unwrap();
    let drawn = drawing(&frame, shape, Some(Rgb::WHITE)).unwrap();
    drawn.write_png(path).unwrap();
}

fn disc(centre: [f64; 2], radius: f64) -> impl SignedDistance<2> {
    Ball::new(centre, radius).unwrap()
}

#[test]
fn nothing_is_written_over_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    draw(&at("disc.png"), 64, &disc([32.0; 2], 20.0));
    outcome(
        folder.path(),
        &[
            "sample",
            "builtin:lever",
            "--cells",
            "32",
            "--save",
            "lever.ply",
        ],
    );
    let quick = [
        "--cells",
        "32",
        "--steps",
        "1",
        "--no-page",
        "--output",
        "run",
    ];
    let commands: [(&[&str], &str); 6] = [
        (
            &["sample", "builtin:disc", "--save", "mine.png"],
            "mine.png",
        ),
        (&["flow", "disc.png", "--save", "mine.svg"], "mine.svg"),
        (&["flow", "builtin:cube", "--save", "mine.stl"], "mine.stl"),
        (
            &[
                "inpaint",
                "disc.png",
                "--mask",
                "ball:50,32,6",
                "--save",
                "disc.png",
            ],
            "disc.png",
        ),
        (&["fair", "lever.ply", "--save", "lever.ply"], "lever.ply"),
        (&["mcf", "builtin:disc", "--save", "mine.png"], "mine.png"),
    ];
    for (command, file) in commands {
        if !at(file).exists() {
            fs::write(at(file), "mine").unwrap();
        }
        let before = fs::read(at(file)).unwrap();
        let runs = command[0] != "sample";
        let all = [command, if runs { &quick[..] } else { &[] }].concat();
        let line = refused(folder.path(), &all);
        assert!(
            line.contains(file) && line.contains("--force"),
            "{command:?}: {line}"
        );
        assert_eq!(fs::read(at(file)).unwrap(), before, "{command:?}");
        assert!(!at("run").exists(), "{command:?}");
        outcome(folder.path(), &[&all[..], &["--force"]].concat());
        assert_ne!(fs::read(at(file)).unwrap(), before, "{command:?}");
        if runs {
            fs::remove_dir_all(at("run")).unwrap();
        }
    }
    // A run gives way to another one on demand only, and what is no run never does.
    outcome(folder.path(), &[&DISC[..], &["run"]].concat());
    assert!(
        refused(folder.path(), &[&DISC[..], &["run"]].concat())
            .contains("cannot start a run in run")
    );
    outcome(folder.path(), &[&DISC[..], &["run", "--force"]].concat());
    // Also in the folder that the program works in, which cannot be removed itself.
    outcome(&at("run"), &[&DISC[..], &[".", "--force"]].concat());
    fs::create_dir(at("own")).unwrap();
    fs::write(at("own/thesis.txt"), "years").unwrap();
    let line = refused(folder.path(), &[&DISC[..], &["own", "--force"]].concat());
    assert!(line.contains("holds thesis.txt"), "{line}");
    assert!(at("own/thesis.txt").exists());
    // Nor what somebody has put beside a run, also under a name that other runs have.
    fs::create_dir(at("run/frames")).unwrap();
    for (name, steps) in [
        ("thesis.txt", "2"),
        ("final.stl", "3"),
        ("frames/a.png", "4"),
    ] {
        let file = at("run").join(name);
        fs::write(&file, "years").unwrap();
        let line = refused(folder.path(), &[&DISC[..], &["run", "--force"]].concat());
        assert!(
            line.contains(&format!("{name} is not of the run")),
            "{line}"
        );
        outcome(folder.path(), &["resume", "run", "--steps", steps]);
        assert_eq!(fs::read(&file).unwrap(), b"years");
        fs::remove_file(file).unwrap();
    }
    // Nor a folder with the input.
    let again = ["flow", "run/final.npy", "--output", "run", "--force"];
    let line = refused(folder.path(), &again);
    assert!(line.contains("is in the folder of --output"), "{line}");
    assert!(at("run/final.npy").exists());
}

/// Under the name of a file of the run, the saved file would damage it.
#[test]
fn nothing_is_saved_among_the_files_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("run");
    fs::create_dir(&own).unwrap();
    for (place, output, save) in [
        (folder.path(), "run", "run/start.svg"),
        (folder.path(), "run", "run/mine.png"),
        (&*own, ".", "final.svg"),
    ] {
        let line = refused(place, &[&DISC[..], &[output, "--save", save]].concat());
        assert!(line.contains("in the folder of --output"), "{line}");
        assert_eq!(fs::read_dir(&own).unwrap().count(), 0, "{save}");
    }
    let beside = ["run", "--save", "start.svg"];
    outcome(folder.path(), &[&DISC[..], &beside].concat());
}

/// There is no length that fits.
#[test]
fn a_box_without_room_is_refused_with_what_helps() {
    let folder = tempfile::tempdir().unwrap();
    let flow = "flow builtin:disc --box-side 0.375 --steps 1 --no-page --cells";
    let with_cells = |cells| -> Vec<&str> { flow.split(' ').chain([cells]).collect() };
    let line = refused(folder.path(), &with_cells("8"));
    assert!(
        line.contains("use more --cells or a larger --box-side") && !line.contains("--side-length"),
        "{line}"
    );
    outcome(folder.path(), &with_cells("64"));
}

/// Nobody may listen to what is told, which changes nothing else.
#[test]
fn a_closed_standard_error_is_no_failure() {
    let folder = tempfile::tempdir().unwrap();
    let flow = ["flow", "builtin:disc", "--cells", "16", "--steps", "1"];
    for (arguments, code) in [(&flow[..], 0), (&["flow", "missing.obj"], 2)] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut command = program(folder.path());
        let output = command.args(arguments).stderr(writer).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}");
    }
}

/// A ring of radii 150 and 75 pixels has the energy `pi / 150 + pi / 75`.
#[test]
fn energies_lengths_and_areas_of_images_are_those_of_their_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let ring = disc([250.0; 2], 150.0).difference(disc([250.0; 2], 75.0));
    draw(&folder.path().join("ring.png"), 500, &ring);
    let flow = [
        "flow", "ring.png", "--steps", "1", "--tau", "1", "--output", "run",
    ];
    let outcome = outcome(folder.path(), &flow);
    for (name, expected, tolerance) in [
        ("first_energy", PI / 150.0 + PI / 75.0, 0.08),
        ("energy", PI / 150.0 + PI / 75.0, 0.08),
        ("length", 450.0 * PI, 0.005),
        ("area", PI * (150.0 * 150.0 - 75.0 * 75.0), 0.005),
    ] {
        let found = outcome[name].as_f64().unwrap();
        assert!(
            (found / expected - 1.0).abs() < tolerance,
            "{name}: {found}, not {expected}"
        );
    }
    assert_eq!(outcome["time"], 1.0);
    assert!((outcome["grid"]["spacing"].as_f64().unwrap() - 500.0 / 1.2 / 128.0).abs() < 1e-9);
}

/// A sphere about (3, -5, 40) of radius 7.
#[test]
fn meshes_and_fields_lie_where_their_input_lay() {
    let folder = tempfile::tempdir().unwrap();
    let grid = geometry::Grid::<3>::new(24, 20.0).unwrap();
    let grid = grid.with_origin([-7.0, -15.0, 30.0]).unwrap();
    let ball = Ball::new([3.0, -5.0, 40.0], 7.0).unwrap();
    let distance = geometry::Field::from_fn(grid, |x| ball.signed_distance(x));
    let mesh = surfaces::isosurface(&distance).unwrap();
    surfaces::write(folder.path().join("ball.stl"), &mesh).unwrap();
    let flow = [
        "flow", "ball.stl", "--cells", "48", "--steps", "2", "--frames", "1",
    ];
    let found = outcome(folder.path(), &[&flow[..], &["--output", "run"]].concat());
    for (name, expected) in [
        ("area", 4.0 * PI * 49.0),
        ("volume", 4.0 / 3.0 * PI * 343.0),
        ("energy", 8.0 * PI),
        ("energy_over_8_pi", 1.0),
    ] {
        let value = found[name].as_f64().unwrap();
        assert!(
            (value / expected - 1.0).abs() < 0.03,
            "{name}: {value}, not {expected}"
        );
    }
    // The place is in the file for ParaView, the values are beside it.
    let text = fs::read(folder.path().join("run/final.vti")).unwrap();
    let text = String::from_utf8_lossy(&text);
    let numbers = |name: &str| -> Vec<f64> {
        let (_, rest) = text.split_once(&format!("{name}=\"")).unwrap();
        let words = rest.split_once('"').unwrap().0.split(' ');
        words.map(|word| word.parse().unwrap()).collect()
    };
    let (origin, spacing) = (numbers("Origin"), numbers("Spacing"));
    let u = geometry::npy::read(folder.path().join("run/final.npy"), |cells| {
        let grid = geometry::Grid::<3>::new(cells, spacing[0] * cells as f64)?;
        grid.with_origin(origin.try_into().unwrap())
    })
    .unwrap();
    let bounds = geometry::measure::bounding_box(&u).unwrap();
    let centre = bounds.centre();
    for (found, expected) in centre.iter().zip([3.0, -5.0, 40.0]) {
        assert!((found - expected).abs() < 0.3, "{centre:?}");
    }
    let series = fs::read_to_string(folder.path().join("run/frames.pvd")).unwrap();
    assert_eq!(series.matches("<DataSet").count(), 3, "{series}");
    for part in series.split("file=\"").skip(1) {
        let name = part.split_once('"').unwrap().0;
        assert!(folder.path().join("run").join(name).is_file(), "{name}");
    }
}

/// A blue disc on yellow paper of which a part is missing, and a red mark that is not to change.
#[test]
fn inpainting_copies_the_pixels_outside_of_the_mask_in_their_colours() {
    let folder = tempfile::tempdir().unwrap();
    let (ink, paper, mark) = (
        [20, 30, 200, 255],
        [250, 240, 150, 255],
        [200, 190, 120, 255],
    );
    let pixel = |k: usize| {
        let [x, y] = [k % 160, k / 160].map(|i| i as f64 + 0.5);
        if (x - 80.0).hypot(y - 80.0) < 50.0 && (x - 125.0).hypot(y - 80.0) > 14.0 {
            ink
        } else if x < 10.0 && y < 12.0 {
            mark
        } else {
            paper
        }
    };
    let picture = Picture::new([160, 160], (0..160 * 160).map(pixel).collect()).unwrap();
    picture.write_png(folder.path().join("disc.png")).unwrap();
    let inpaint = [
        "inpaint",
        "disc.png",
        "--mask",
        "ball:125,80,18",
        "--steps",
        "16",
    ];
    outcome(
        folder.path(),
        &[&inpaint[..], &["--save", "whole.png", "--output", "run"]].concat(),
    );
    let read = |name: &str| {
        let path = folder.path().join(name);
        images::colours(&path, &fs::read(&path).unwrap()).unwrap()
    };
    let repaired = read("whole.png");
    assert_eq!(read("run/final.png").pixels(), repaired.pixels());
    let mut changed = 0;
    for (k, (before, after)) in picture.pixels().iter().zip(repaired.pixels()).enumerate() {
        let [x, y] = [k % 160, k / 160].map(|i| i as f64 + 0.5);
        if (x - 125.0).hypot(y - 80.0) >= 18.0 {
            assert_eq!(before, after, "pixel {x}, {y}");
        }
        changed += usize::from(before != after);
    }
    // The bite is filled with ink, up to where the disc ends.
    assert!(changed > 250, "{changed}");
    assert_eq!(repaired.pixel(118, 80), ink);
    assert_eq!(repaired.pixel(140, 80), paper);
}

/// A red disc on transparent ground: at its edge it is less opaque, and not darker.
#[test]
fn inpainting_keeps_the_colours_of_what_is_half_transparent() {
    let folder = tempfile::tempdir().unwrap();
    let pixel = |k: usize| {
        let [x, y] = [k % 64, k / 64].map(|i| i as f64 - 31.5);
        let inside = x.hypot(y) < 20.0;
        if inside { [255, 0, 0, 255] } else { [0; 4] }
    };
    let picture = Picture::new([64; 2], (0..64 * 64).map(pixel).collect()).unwrap();
    picture.write_png(folder.path().join("disc.png")).unwrap();
    let inpaint = ["inpaint", "disc.png", "--mask", "ball:52,32,10"];
    let options = ["--cells", "32", "--steps", "1", "--output", "run"];
    outcome(folder.path(), &[&inpaint[..], &options].concat());
    let path = folder.path().join("run/final.png");
    let repaired = images::colours(&path, &fs::read(&path).unwrap()).unwrap();
    let opaque = repaired.pixels().iter().filter(|pixel| pixel[3] > 0);
    let opaque: Vec<_> = opaque.collect();
    assert!(opaque.iter().any(|pixel| pixel[3] < 255));
    assert!(opaque.iter().all(|pixel| pixel[..3] == [255, 0, 0]));
}

#[test]
fn photographs_are_refused_until_it_is_said_what_is_inside() {
    let folder = tempfile::tempdir().unwrap();
    let shade = |k: usize| {
        let [x, y] = [k % 120, k / 120].map(|i| i as f64 / 120.0);
        let v = (255.0 * (0.5 + 0.3 * (7.0 * x).sin() * (5.0 * y).cos() + 0.2 * x)) as u8;
        [v, v, v, 255]
    };
    let picture = Picture::new([120, 120], (0..120 * 120).map(shade).collect()).unwrap();
    picture.write_png(folder.path().join("photo.png")).unwrap();
    for command in ["flow", "inpaint", "mcf"] {
        let mask: &[&str] = if command == "inpaint" {
            &["--mask", "ball:60,60,20"]
        } else {
            &[]
        };
        let quick = [
            "photo.png",
            "--cells",
            "48",
            "--steps",
            "1",
            "--output",
            command,
        ];
        let all = [&[command], &quick[..], mask].concat();
        let line = refused(folder.path(), &all);
        assert!(
            line.contains("continuous tones") && line.contains("--threshold 0."),
            "{line}"
        );
        outcome(folder.path(), &[&all[..], &["--threshold", "0.5"]].concat());
    }
}

/// Strokes of 5 pixels of 500: with 128 cells per unit length a pixel is a third of a cell.
#[test]
fn thin_strokes_get_the_cells_that_they_need_or_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let stroke = |half: f64| {
        let shape = Cuboid::new([150.0, half])
            .unwrap()
            .translated([250.0, 250.0]);
        draw(&folder.path().join("stroke.png"), 500, &shape);
    };
    let flow = ["flow", "stroke.png", "--steps", "3", "--output"];
    stroke(3.5);
    let found = outcome(folder.path(), &[&flow[..], &["fine"]].concat());
    assert!(
        found["grid"]["spacing"].as_f64().unwrap() < 500.0 / 1.2 / 150.0,
        "{found}"
    );
    assert_eq!(found["components"], 1, "{found}");
    stroke(0.8);
    let line = refused(folder.path(), &[&flow[..], &["hair"]].concat());
    assert!(
        line.contains("% of the boundary") && line.contains("512 cells per unit length"),
        "{line}"
    );
    let warned = run(
        folder.path(),
        &[&flow[..], &["coarse", "--cells", "128"]].concat(),
    );
    assert!(
        text(&warned.stderr).contains("will not last"),
        "{}",
        text(&warned.stderr)
    );
}

#[test]
fn a_finished_run_goes_on_to_more_steps() {
    let folder = tempfile::tempdir().unwrap();
    let flow = [
        "flow",
        "builtin:cross",
        "--cells",
        "32",
        "--frames",
        "2",
        "--tau",
        "1e-6",
    ];
    let four = ["--steps", "4", "--output", "run", "--save", "cross.png"];
    outcome(folder.path(), &[&flow[..], &four].concat());
    let again = program(folder.path())
        .args(["resume", "run"])
        .output()
        .unwrap();
    assert_eq!(again.status.code(), Some(0));
    let told = text(&again.stdout);
    assert!(
        told.contains("4 steps are made; willmore resume run --steps N"),
        "{told}"
    );
    let saved = folder.path().join("cross.png");
    let before = fs::read(&saved).unwrap();
    let line = refused(folder.path(), &["resume", "run", "--steps", "3"]);
    assert!(line.contains("cannot go on: 4 steps are made"), "{line}");
    let more = outcome(folder.path(), &["resume", "run", "--steps", "8"]);
    assert_eq!(more["steps"], 8, "{more}");
    assert_ne!(fs::read(&saved).unwrap(), before);
    let whole = outcome(
        folder.path(),
        &[&flow[..], &["--steps", "8", "--output", "whole"]].concat(),
    );
    assert_eq!(more["energy"], whole["energy"]);
    for name in [
        "final.npy",
        "metrics.csv",
        "animation.png",
        "frames.pvd",
        "summary.json",
    ] {
        let [a, b] =
            ["run", "whole"].map(|run| fs::read(folder.path().join(run).join(name)).unwrap());
        assert!(a == b, "{name}");
    }
    assert_eq!(
        outcome(folder.path(), &["resume", "run", "--steps", "10"])["steps"],
        10
    );
}

#[test]
fn a_run_goes_on_without_the_folder_of_its_saved_file() {
    let folder = tempfile::tempdir().unwrap();
    let there = folder.path().join("there");
    fs::create_dir(&there).unwrap();
    outcome(
        folder.path(),
        &[&DISC[..], &["run", "--save", "there/disc.png"]].concat(),
    );
    fs::remove_dir_all(there).unwrap();
    let output = run(folder.path(), &["resume", "run", "--steps", "2"]);
    let told = text(&output.stderr);
    assert!(output.status.success(), "{told}");
    assert!(told.contains("its folder is gone"), "{told}");
}

#[test]
fn long_steps_are_shortened_and_the_shape_stays() {
    let folder = tempfile::tempdir().unwrap();
    let cube = [
        "flow",
        "builtin:cube",
        "--cells",
        "48",
        "--tau",
        "doubling:1e-6",
        "--steps",
        "16",
    ];
    let found = outcome(
        folder.path(),
        &[&cube[..], &["--no-page", "--output", "run"]].concat(),
    );
    let energy = found["energy_over_8_pi"].as_f64().unwrap();
    assert!((energy - 1.0).abs() < 0.05, "{found}");
    assert_eq!(found["components"], 1);
    assert!(
        found["ended"]
            .as_str()
            .unwrap()
            .contains("near to its own periodic image"),
        "{found}"
    );
    assert!(found["shortened_steps"].as_u64().unwrap() > 0, "{found}");
}

/// A lever whose hole and arms are about as wide as the interface.
#[test]
fn parts_and_holes_that_a_flow_loses_at_the_beginning_are_said_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let lever = surfaces::samples::lever(48).unwrap();
    surfaces::write(folder.path().join("lever.ply"), lever.mesh()).unwrap();
    let flow = ["flow", "lever.ply", "--steps", "1", "--side-length", "0.1"];
    let line = refused(folder.path(), &[&flow[..], &["--output", "run"]].concat());
    assert!(line.contains("larger --side-length"), "{line}");
    let coarse = ["--cells", "48", "--no-page", "--output", "coarse"];
    let output = run(folder.path(), &[&flow[..], &coarse].concat());
    let said = text(&output.stderr);
    assert!(
        said.contains("the mesh has 1 closed part of Euler characteristic 0, the grid"),
        "{said}"
    );
    let outcome: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(outcome["same_topology"], false, "{outcome}");
}

/// An open scan with noise becomes a new mesh with the volume that it had when it was closed.
#[test]
fn an_open_mesh_is_repaired_and_its_noise_taken_off_in_one_go() {
    let folder = tempfile::tempdir().unwrap();
    let mut mesh = surfaces::samples::lever(64).unwrap().into_mesh();
    mesh.roughen(0.003, 7);
    mesh.normals = None;
    mesh.faces.drain(..3);
    surfaces::write(folder.path().join("open.obj"), &mesh).unwrap();
    let fair = ["fair", "open.obj", "--repair", "--remesh", "--cells", "64"];
    let outcome = outcome(folder.path(), &[&fair[..], &["--output", "run"]].concat());
    let of = |name: &str| outcome["mesh"][name].as_f64().unwrap();
    assert!(of("noise") > 0.0 && of("volume_change_percent").abs() < 1e-6);
    assert!(of("displacement_rms_percent") < 1.0, "{outcome}");
    assert_eq!(outcome["same_topology"], true, "{outcome}");
    let made = surfaces::read(folder.path().join("run/final.obj")).unwrap();
    assert!(surfaces::ClosedMesh::new(made).is_ok());
}

#[test]
fn meshes_are_converted_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mesh = surfaces::samples::lever(48).unwrap().into_mesh();
    surfaces::write(at("lever.obj"), &mesh).unwrap();
    outcome(
        folder.path(),
        &["sample", "lever.obj", "--save", "lever.ply"],
    );
    let converted = surfaces::read(at("lever.ply")).unwrap();
    assert_eq!(
        converted.faces,
        surfaces::read(at("lever.obj")).unwrap().faces
    );
    outcome(
        folder.path(),
        &[
            "sample",
            "lever.obj",
            "--resample",
            "--cells",
            "32",
            "--save",
            "new.ply",
        ],
    );
    assert_ne!(
        surfaces::read(at("new.ply")).unwrap().faces.len(),
        mesh.faces.len()
    );
    // Every face with vertices of its own: noise leaves no gaps between them.
    let corners = mesh.faces.iter().flatten();
    let soup = surfaces::TriangleMesh {
        vertices: corners.map(|v| mesh.vertices[*v as usize]).collect(),
        faces: (0..mesh.faces.len() as u32)
            .map(|face| [3 * face, 3 * face + 1, 3 * face + 2])
            .collect(),
        normals: None,
    };
    surfaces::write(at("soup.ply"), &soup).unwrap();
    for file in ["soup", "lever"] {
        let (from, to) = (format!("{file}.ply"), format!("{file}-noisy.ply"));
        let sample = ["sample", &from, "--noise", "0.002", "--save", &to];
        outcome(folder.path(), &sample);
        let noisy = surfaces::read(at(&to)).unwrap();
        assert_ne!(noisy.vertices, surfaces::read(at(&from)).unwrap().vertices);
        surfaces::ClosedMesh::new(noisy).unwrap();
    }
}

/// A box without its lid.
#[test]
fn open_meshes_are_refused_and_repaired_on_demand() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut mesh = surfaces::samples::lever(48).unwrap().into_mesh();
    mesh.normals = None;
    let highest = mesh.faces.iter().max_by(|a, b| {
        let z = |face: &[u32; 3]| mesh.vertices[face[0] as usize][2];
        z(a).total_cmp(&z(b))
    });
    let highest = *highest.unwrap();
    mesh.faces
        .retain(|face| !face.iter().any(|v| highest.contains(v)));
    surfaces::write(at("open.obj"), &mesh).unwrap();
    let flow = [
        "flow", "open.obj", "--cells", "32", "--steps", "1", "--output", "run",
    ];
    assert!(refused(folder.path(), &flow).contains("--repair"));
    let fair = ["fair", "open.obj", "--repair", "--output", "run"];
    assert!(refused(folder.path(), &fair).contains("willmore sample --repair"));
    let output = run(
        folder.path(),
        &["sample", "open.obj", "--repair", "--save", "whole.ply"],
    );
    assert!(text(&output.stderr).contains("of the new surface closes holes"));
    let (whole, _) = surfaces::ClosedMesh::new(surfaces::read(at("whole.ply")).unwrap()).unwrap();
    let lever = surfaces::samples::lever(48).unwrap();
    assert_eq!(whole.euler_characteristic(), lever.euler_characteristic());
    assert!((whole.volume() / lever.volume() - 1.0).abs() < 0.02);
    outcome(folder.path(), &[&flow[..], &["--repair"]].concat());
    // A closed mesh of which a face has its corners on a line.
    let mut mesh = lever.into_mesh();
    let [a, b, c] = mesh.faces[100].map(|v| v as usize);
    mesh.vertices[c] = [0, 1, 2].map(|i| 0.5 * (mesh.vertices[a][i] + mesh.vertices[b][i]));
    mesh.normals = None;
    surfaces::write(at("line.ply"), &mesh).unwrap();
    let checked = run(folder.path(), &["check", "line.ply"]);
    assert!(checked.status.success());
    assert!(text(&checked.stderr).contains("warning"));
    outcome(
        folder.path(),
        &["sample", "line.ply", "--repair", "--save", "flat.ply"],
    );
    surfaces::ClosedMesh::new(surfaces::read(at("flat.ply")).unwrap()).unwrap();
}

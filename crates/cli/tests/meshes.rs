//! Meshes as they come: with trifling faults, open, thin, in several parts.

use std::fs;
use std::path::Path;

use surfaces::TriangleMesh;

use crate::common::{outcome, run, text};

/// A ball of radius 10 with noise, and its faces about the top, which may be left out.
fn ball(folder: &Path) -> TriangleMesh {
    let sample = "sample builtin:sphere --cells 40 --noise 0.004 --save ball.ply";
    outcome(folder, &sample.split(' ').collect::<Vec<_>>());
    let mut mesh = surfaces::read(folder.join("ball.ply")).unwrap();
    for x in mesh.vertices.as_flattened_mut() {
        *x *= 40.0;
    }
    mesh.normals = None;
    mesh
}

fn middle(mesh: &TriangleMesh, face: [u32; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| {
        face.iter()
            .map(|&v| mesh.vertices[v as usize][i])
            .sum::<f64>()
            / 3.0
    })
}

/// What is left out or turned for the flow is in the file afterwards.
#[test]
fn trifles_are_mended_for_the_flow_and_kept_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let whole = ball(folder.path());
    let mut twice = whole.clone();
    twice.faces.extend([whole.faces[9], whole.faces[9]]);
    twice.faces[20].swap(0, 1);
    surfaces::write(folder.path().join("twice.ply"), &twice).unwrap();
    let arguments = "fair twice.ply --cells 32 --save out.ply";
    let output = run(folder.path(), &arguments.split(' ').collect::<Vec<_>>());
    let said = text(&output.stderr);
    assert!(output.status.success(), "{said}");
    for told in [
        "2 faces that are there twice were left out",
        "1 faces were turned round",
    ] {
        assert!(
            said.contains(told) && said.contains("for the flow"),
            "{said}"
        );
    }
    let faired = surfaces::read(folder.path().join("out.ply")).unwrap();
    assert_eq!(faired.faces, twice.faces);
    assert_ne!(faired.vertices, twice.vertices);
    // The same as without the trifles, but for those.
    surfaces::write(folder.path().join("whole.ply"), &whole).unwrap();
    let arguments = "fair whole.ply --cells 32 --save clean.ply";
    outcome(folder.path(), &arguments.split(' ').collect::<Vec<_>>());
    let clean = surfaces::read(folder.path().join("clean.ply")).unwrap();
    for (a, b) in faired.vertices.iter().zip(&clean.vertices) {
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-6), "{a:?} {b:?}");
    }
}

#[test]
fn the_boundary_of_an_open_surface_stays() {
    let folder = tempfile::tempdir().unwrap();
    let mut open = ball(folder.path());
    let whole = open.clone();
    open.faces.retain(|face| middle(&whole, *face)[2] < 8.5);
    assert!(open.faces.len() < whole.faces.len());
    surfaces::write(folder.path().join("open.ply"), &open).unwrap();
    let arguments = "fair open.ply --cells 32 --save out.ply";
    let made = outcome(folder.path(), &arguments.split(' ').collect::<Vec<_>>());
    assert_eq!(made["mesh"]["is_open"], true);
    let faired = surfaces::read(folder.path().join("out.ply")).unwrap();
    assert_eq!(faired.faces, open.faces);
    let mut sides = std::collections::HashMap::new();
    for face in &open.faces {
        for i in 0..3 {
            let (a, b) = (face[i], face[(i + 1) % 3]);
            *sides.entry([a.min(b), a.max(b)]).or_insert(0) += 1;
        }
    }
    let rim: Vec<u32> = (sides.iter().filter(|(_, count)| **count == 1))
        .flat_map(|(edge, _)| *edge)
        .collect();
    assert!(rim.len() > 20);
    for &v in &rim {
        let [now, before] =
            [&faired, &open].map(|mesh| mesh.vertices[v as usize].map(f64::to_bits));
        assert_eq!(now, before);
    }
    let off = |mesh: &TriangleMesh| -> f64 {
        let used = mesh
            .faces
            .as_flattened()
            .iter()
            .map(|&v| mesh.vertices[v as usize]);
        let off: Vec<f64> = used
            .map(|x| x.iter().map(|x| x * x).sum::<f64>().sqrt())
            .collect();
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        (off.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / off.len() as f64).sqrt()
    };
    assert!(
        off(&faired) < 0.6 * off(&open),
        "{} {}",
        off(&faired),
        off(&open)
    );
    // A lid on a sheet would lie on it. A plate takes its place for the flow, and moves the sheet by less than the noise.
    let sheet = TriangleMesh {
        faces: whole
            .faces
            .iter()
            .copied()
            .filter(|face| middle(&whole, *face)[2] > 9.0)
            .collect(),
        vertices: whole.vertices.iter().map(|x| [x[0], x[1], 0.0]).collect(),
        normals: None,
    };
    surfaces::write(folder.path().join("sheet.ply"), &sheet).unwrap();
    let flat = "fair sheet.ply --noise 0.1 --save flat.ply";
    let output = run(folder.path(), &flat.split(' ').collect::<Vec<_>>());
    let error = text(&output.stderr);
    assert!(output.status.success(), "{error}");
    assert!(
        error.contains("1 open parts, which no lids close, were made plates for the flow"),
        "{error}"
    );
    let flat = surfaces::read(folder.path().join("flat.ply")).unwrap();
    let height = flat.vertices.iter().map(|x| x[2].abs());
    let height = height.fold(0.0, f64::max);
    assert!(height < 0.1, "{height}");
}

#[test]
fn bodies_that_overlap_are_faired_as_one_or_made_one() {
    let folder = tempfile::tempdir().unwrap();
    let one = ball(folder.path());
    let mut both = one.clone();
    let count = one.vertices.len() as u32;
    both.vertices
        .extend(one.vertices.iter().map(|x| [x[0] + 12.0, x[1], x[2]]));
    both.faces
        .extend(one.faces.iter().map(|face| face.map(|v| v + count)));
    surfaces::write(folder.path().join("both.ply"), &both).unwrap();
    let arguments = "fair both.ply --cells 48 --save faired.ply";
    let output = run(folder.path(), &arguments.split(' ').collect::<Vec<_>>());
    let said = text(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("2 parts that overlap are seen as one body"));
    let faired = surfaces::read(folder.path().join("faired.ply")).unwrap();
    assert_eq!(faired.faces, both.faces);
    let count_crossing = |mesh: &TriangleMesh| {
        let crosses = mesh.crossing_faces().into_iter();
        crosses.filter(|crosses| *crosses).count()
    };
    assert!(count_crossing(&faired) <= count_crossing(&both));
    let mut moved = 0;
    for (x, from) in faired.vertices.iter().zip(&both.vertices) {
        // What is within the other ball stays, and nothing goes farther than noise does.
        let is_moved = x.iter().zip(from).any(|(a, b)| (a - b).abs() > 1e-5);
        let within = |centre: f64| (from[0] - centre).hypot(from[1]).hypot(from[2]) < 9.5;
        assert!(!(is_moved && (within(0.0) || within(12.0))), "{from:?}");
        let way = x
            .iter()
            .zip(from)
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f64>();
        assert!(way.sqrt() < 0.6, "{way}");
        moved += usize::from(is_moved);
    }
    assert!(2 * moved > both.vertices.len(), "{moved}");
    // A new mesh is made of bodies that are apart only.
    let refused = run(folder.path(), &["fair", "both.ply", "--remesh"]);
    let error = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{error}");
    assert!(error.contains("2 parts overlap"), "{error}");
    let arguments = "fair both.ply --remesh --repair --noise 0.1 --cells 48 --save one.ply";
    let output = run(folder.path(), &arguments.split(' ').collect::<Vec<_>>());
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("1 bodies that cross or touch each other were united"));
}

/// A sheet that is far thinner than a cell.
#[test]
fn what_is_thin_all_over_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut sheet = ball(folder.path());
    for x in &mut sheet.vertices {
        x[2] *= 0.002;
    }
    surfaces::write(folder.path().join("sheet.ply"), &sheet).unwrap();
    let refused = run(folder.path(), &["fair", "sheet.ply", "--noise", "0.005"]);
    let error = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{error}");
    assert!(
        error.contains("of the boundary is at parts or gaps thinner than"),
        "{error}"
    );
    let arguments = "fair sheet.ply --noise 0.005 --allow-loss --steps 2 --save out.ply";
    let output = run(folder.path(), &arguments.split(' ').collect::<Vec<_>>());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let crossing = |mesh: &TriangleMesh| mesh.crossing_faces().iter().filter(|c| **c).count();
    let out = surfaces::read(folder.path().join("out.ply")).unwrap();
    assert!(
        crossing(&out) <= crossing(&sheet),
        "{} {}",
        crossing(&out),
        crossing(&sheet)
    );
}

/// The first refusal says what the second one would.
#[test]
fn a_drawing_is_not_faired_whatever_else_is_said() {
    let folder = tempfile::tempdir().unwrap();
    outcome(
        folder.path(),
        &[
            "sample",
            "builtin:disc",
            "--cells",
            "32",
            "--save",
            "disc.png",
        ],
    );
    for more in [&[][..], &["--energy-ratio", "0.5"], &["--noise", "1"]] {
        let refused = run(folder.path(), &[&["fair", "disc.png"], more].concat());
        let error = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(2), "{error}");
        assert!(error.contains("there is `willmore flow`"), "{error}");
    }
}

/// What the grid does not resolve grows, which is said.
#[test]
fn a_ball_that_grows_and_a_stroke_that_swells_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let ball = "flow ball:0,0,0,0.3 --cells 32 --steps 40";
    let said = outcome_text(folder.path(), ball);
    assert!(
        said.contains("the energy has fallen below that of a sphere"),
        "{said}"
    );
    let mut rows = vec![[255_u8; 3]; 200 * 60];
    for (k, pixel) in rows.iter_mut().enumerate() {
        let (x, y) = ((k % 200) as f64, (k / 200) as f64);
        let near = (y - 30.0 - 12.0 * (x / 18.0).sin()).abs() < 2.5;
        if near && (10.0..190.0).contains(&x) {
            *pixel = [0; 3];
        }
    }
    let opaque = rows.into_iter().map(|[r, g, b]| [r, g, b, 255]).collect();
    let picture = render::Picture::new([200, 60], opaque).unwrap();
    fs::write(folder.path().join("sign.png"), picture.to_png().unwrap()).unwrap();
    let said = outcome_text(folder.path(), "flow sign.png --steps 1");
    assert!(
        said.contains("the enclosed area has changed by more than half"),
        "{said}"
    );
}

/// What is said at the end of a run can be done, and is not said of what does not help.
#[test]
fn advice_at_the_end_of_a_run_can_be_followed() {
    let folder = tempfile::tempdir().unwrap();
    let told = |arguments: &str| outcome_text(folder.path(), arguments);
    // A region has coordinates of its own, and a field its own box.
    let ball = "flow ball:0,0,0.97 --cells 24 --steps 1 --tau 1e-5";
    let said = told(&format!("{ball} --output ball"));
    assert!(said.contains("a larger --box-side gives it room"), "{said}");
    let page = fs::read_to_string(folder.path().join("ball/index.html")).unwrap();
    assert!(page.contains("a larger `box_side` gives it room"));
    let said = told(&format!("{ball} --box-side 3"));
    assert!(!said.contains("gives it room"), "{said}");
    let said = told("flow ball/final.npy --steps 1 --tau 1e-5");
    assert!(said.contains("a field in a larger box gives it"), "{said}");

    let disc = "flow builtin:disc --cells 24 --tau 1e-5 --energy 0.1";
    let said = told(&format!("{disc} --steps 1 --output disc"));
    assert!(said.contains("goes on with more --steps"), "{said}");
    told("resume disc --steps 2");
    let said = told(&format!("{disc} --time 2e-5"));
    assert!(said.contains("energy asked for was not reached"), "{said}");
    assert!(!said.contains("goes on"), "{said}");

    let said = told("mcf builtin:disc --cells 32 --side-length 0.4 --steps 12");
    assert!(said.contains("a shorter --time keeps more"), "{said}");
    assert!(!said.contains("--area"), "{said}");
}

/// The flow ends with the first energy that is reached.
#[test]
fn one_of_two_energies_is_enough() {
    let folder = tempfile::tempdir().unwrap();
    let fair = "fair builtin:cube --cells 24 --energy 31 --energy-ratio 0.99 --no-page";
    let ended = outcome(folder.path(), &fair.split(' ').collect::<Vec<_>>());
    assert!(ended["energy"].as_f64().unwrap() > 31.0, "{ended}");
    assert_eq!(ended["energy_reached"], true, "{ended}");
}

/// Surfaces before and after a flow are made alike, also at edges, where the volume of the zero set does not hold. Their triangles differ at edges.
#[test]
fn a_surface_that_stays_is_said_to_stay() {
    let folder = tempfile::tempdir().unwrap();
    let flow = "flow builtin:cube --cells 24 --steps 1 --tau 1e-12 --no-page";
    let ended = outcome(folder.path(), &flow.split(' ').collect::<Vec<_>>());
    for name in ["volume_change_percent", "area_change_percent"] {
        let percent = ended["mesh"][name].as_f64().unwrap();
        assert!(percent.abs() < 0.01, "{name}: {ended}");
    }
}

/// What a run prints for people.
fn outcome_text(folder: &Path, arguments: &str) -> String {
    let mut command = crate::common::program(folder);
    let output = command.args(arguments.split(' ')).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    text(&output.stdout)
}

/// A drawing of a few bytes whose outline is a million pixels long is refused in seconds.
#[test]
fn a_drawing_of_stripes_is_refused_before_it_takes_long() {
    let folder = tempfile::tempdir().unwrap();
    let stripes = (0..1024 * 1024).map(|k| {
        if (k / 1024) % 2 == 0 {
            [0, 0, 0, 255]
        } else {
            [255; 4]
        }
    });
    let picture = render::Picture::new([1024, 1024], stripes.collect()).unwrap();
    fs::write(folder.path().join("stripes.png"), picture.to_png().unwrap()).unwrap();
    let clock = std::time::Instant::now();
    let refused = run(folder.path(), &["sample", "stripes.png", "--save", "o.png"]);
    let error = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{error}");
    assert!(
        error.contains("of the boundary is at parts or gaps thinner than"),
        "{error}"
    );
    assert!(clock.elapsed().as_secs() < 30);
}

/// A bound on the distance may keep the energy above a target: the flow ends where nothing moves any more.
#[test]
fn an_energy_out_of_reach_ends_at_rest() {
    let folder = tempfile::tempdir().unwrap();
    let sample = "sample builtin:lever --cells 24 --save lever.ply";
    outcome_text(folder.path(), sample);
    let fair = "fair lever.ply --cells 36 --energy-ratio 0.6 --max-distance 0.01 --no-page";
    let ended = outcome(folder.path(), &fair.split(' ').collect::<Vec<_>>());
    assert_eq!(ended["energy_reached"], false, "{ended}");
    assert!(ended["steps"].as_u64().unwrap() < 100, "{ended}");
}

/// Far from the origin, single precision is coarse.
#[test]
fn stl_files_far_from_the_origin_are_told() {
    let folder = tempfile::tempdir().unwrap();
    outcome_text(
        folder.path(),
        "sample builtin:sphere --cells 16 --noise 0.005 --save near.obj",
    );
    let near = std::fs::read_to_string(folder.path().join("near.obj")).unwrap();
    let moved = near.lines().map(|line| match line.strip_prefix("v ") {
        Some(rest) => {
            let place = rest.split(' ').map(|x| x.parse::<f64>().unwrap() + 5e5);
            let place: Vec<String> = place.map(|x| x.to_string()).collect();
            format!("v {}\n", place.join(" "))
        }
        None => format!("{line}\n"),
    });
    std::fs::write(folder.path().join("far.obj"), moved.collect::<String>()).unwrap();
    for (input, is_told) in [("near", false), ("far", true)] {
        let mut command = crate::common::program(folder.path());
        let fair =
            format!("fair {input}.obj --cells 24 --noise 0.005 --no-page --save {input}.stl");
        let output = command.args(fair.split(' ')).output().unwrap();
        let said = text(&output.stderr);
        assert!(output.status.success(), "{said}");
        assert_eq!(said.contains("in single precision"), is_told, "{said}");
    }
}

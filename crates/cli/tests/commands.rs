//! What the commands make.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use crate::common::{self, outcome};
use chacha20::ChaCha8Rng;
use geometry::shapes::{Ball, Cuboid};
use geometry::{Field, Grid, npy, phase_field};
use images::{Frame, drawing};
use rand::{RngExt, SeedableRng};
use render::Rgb;
use surfaces::ClosedMesh;

const EIGHT_PI: f64 = 8.0 * std::f64::consts::PI;

/// A sphere about (3, -5, 40) whose vertices are moved by noise.
fn noisy_sphere(path: &Path, radius: f64, noise: f64) {
    let grid = Grid::<3>::centred(24, 1.0).unwrap();
    let distance = Field::from_fn(grid, |x| x.iter().map(|x| x * x).sum::<f64>().sqrt() - 0.4);
    let mut mesh = surfaces::isosurface(&distance).unwrap();
    mesh.normals = None;
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for x in &mut mesh.vertices {
        let factor = radius / 0.4 * (1.0 + noise * rng.random_range(-1.7..1.7));
        *x = [
            3.0 + factor * x[0],
            -5.0 + factor * x[1],
            40.0 + factor * x[2],
        ];
    }
    surfaces::write(path, &mesh).unwrap();
}

/// Distances from (3, -5, 40): their mean, and the root of the mean square of what they are off it.
fn radii(path: &Path) -> (f64, f64) {
    let (mesh, _) = ClosedMesh::new(surfaces::read(path).unwrap()).unwrap();
    assert_eq!((mesh.components(), mesh.genus()), (1, 0));
    let radius = |x: &[f64; 3]| (x[0] - 3.0).hypot(x[1] + 5.0).hypot(x[2] - 40.0);
    let all: Vec<f64> = mesh.mesh().vertices.iter().map(radius).collect();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    let off = all.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / all.len() as f64;
    (mean, off.sqrt())
}

#[test]
fn the_noise_of_a_sphere_is_taken_off_and_all_else_of_its_file_stays() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    noisy_sphere(&at("noisy.obj"), 7.0, 0.02);
    let text = fs::read_to_string(at("noisy.obj")).unwrap();
    let with_groups = text.replacen("\nf ", "\ng skin\nusemtl red\nf ", 1);
    fs::write(at("noisy.obj"), &with_groups).unwrap();
    let arguments = [
        "fair",
        "noisy.obj",
        "--cells",
        "48",
        "--save",
        "smooth.stl",
        "--output",
        "run",
    ];
    let outcome = outcome(folder.path(), &arguments);
    let mesh = &outcome["mesh"];
    let number = |name: &str| mesh[name].as_f64().unwrap();
    let noise = 0.02 * 7.0 * 1.7 / 3.0_f64.sqrt();
    assert!((number("noise") / noise - 1.0).abs() < 0.25, "{mesh}");
    assert!(number("volume_change_percent").abs() < 1e-6, "{mesh}");
    assert!(
        number("displacement_rms") < 1.5 * noise && number("left_behind_percent") < 1e-9,
        "{mesh}"
    );
    assert_eq!(outcome["same_topology"], true);
    let (_, before) = radii(&at("noisy.obj"));
    for name in ["smooth.stl", "run/final.obj"] {
        let (mean, off) = radii(&at(name));
        assert!(
            (mean / 7.0 - 1.0).abs() < 0.01 && off < 0.4 * before,
            "{name}: {mean} {off}"
        );
    }
    let faired = fs::read_to_string(at("run/final.obj")).unwrap();
    let lines = |text: &str| -> Vec<String> {
        let other = |line: &&str| !line.starts_with("v ");
        text.lines().filter(other).map(str::to_owned).collect()
    };
    assert_eq!(lines(&faired), lines(&with_groups));
    assert_eq!(
        fs::read(at("run/input.obj")).unwrap(),
        with_groups.as_bytes()
    );
    // The other half stays where it is.
    let keep = "box:-10,-20,40,20,20,60";
    let arguments = [
        "fair",
        "noisy.obj",
        "--cells",
        "48",
        "--keep",
        keep,
        "--output",
        "half",
    ];
    common::outcome(folder.path(), &arguments);
    let [noisy, half] =
        ["noisy.obj", "half/final.obj"].map(|name| surfaces::read(at(name)).unwrap());
    let mut moved = 0;
    for (a, b) in noisy.vertices.iter().zip(&half.vertices) {
        let stays = a.map(f64::to_bits) == b.map(f64::to_bits);
        assert!(stays || a[2] < 40.0, "{a:?} {b:?}");
        moved += usize::from(!stays);
    }
    assert!(moved > noisy.vertices.len() / 3, "{moved}");
}

#[test]
fn a_new_mesh_is_made_on_demand_and_the_energy_falls_by_the_ratio() {
    let folder = tempfile::tempdir().unwrap();
    noisy_sphere(&folder.path().join("noisy.ply"), 7.0, 0.02);
    let arguments = [
        "fair",
        "noisy.ply",
        "--cells",
        "40",
        "--energy-ratio",
        "0.7",
        "--remesh",
        "--format",
        "obj",
    ];
    let outcome = outcome(
        folder.path(),
        &[&arguments[..], &["--output", "run"]].concat(),
    );
    let number = |name: &str| outcome[name].as_f64().unwrap();
    assert!(
        number("energy") <= 0.7 * number("first_energy"),
        "{outcome}"
    );
    assert!(number("energy") > 0.98 * EIGHT_PI, "{outcome}");
    // It is reached by small steps, and nothing of the shape is jumped over.
    assert!(number("energy") > 0.5 * number("first_energy"), "{outcome}");
    let moved = &outcome["mesh"];
    assert!(moved["displacement_rms_percent"].as_f64().unwrap() < 2.0);
    assert!(moved["hausdorff_distance"].as_f64().unwrap() < 0.5);
    let (mean, _) = radii(&folder.path().join("run/final.obj"));
    assert!((mean / 7.0 - 1.0).abs() < 0.05, "{mean}");
}

/// Two plates with less than a cell between them.
#[test]
fn a_mesh_that_no_grid_holds_is_refused_with_numbers_unless_losses_are_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::new();
    // The gap is nowhere near a node.
    for (plate, [low, high]) in [[0.0, 0.05], [0.0505, 0.13]].into_iter().enumerate() {
        for bits in 0..8 {
            let [x, y, z] = [4, 2, 1].map(|bit| f64::from(u8::from(bits & bit > 0)));
            let _ = writeln!(text, "v {x} {y} {}", low + (high - low) * z);
        }
        for [a, b, c, d] in [
            [0, 1, 3, 2],
            [4, 6, 7, 5],
            [0, 4, 5, 1],
            [2, 3, 7, 6],
            [0, 2, 6, 4],
            [1, 5, 7, 3],
        ] {
            let [a, b, c, d] = [a, b, c, d].map(|v| v + 8 * plate + 1);
            let _ = writeln!(text, "f {a} {b} {c} {d}");
        }
    }
    fs::write(folder.path().join("plates.obj"), text).unwrap();
    let arguments = [
        "fair",
        "plates.obj",
        "--noise",
        "1e-4",
        "--cells",
        "48",
        "--output",
        "run",
    ];
    let refused = common::run(folder.path(), &arguments);
    let message = common::text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{message}");
    assert!(
        message.contains("2 closed parts")
            && message.contains("from that of the mesh")
            && message.contains("--allow-loss"),
        "{message}"
    );
    let outcome = outcome(folder.path(), &[&arguments[..], &["--allow-loss"]].concat());
    assert_eq!(outcome["same_topology"], false, "{outcome}");
    let drawn = folder.path().join("run/final.displacement.svg");
    let drawn = fs::read_to_string(drawn).unwrap();
    assert!(drawn.contains("% of the vertices, at parts or gaps"));
}

#[test]
fn inpainting_keeps_what_is_outside_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let grid = Grid::<2>::centred(64, 1.0).unwrap();
    let eps = 2.0 * grid.spacing();
    let ball = Ball::new([0.0, 0.0], 0.3).unwrap();
    let field = phase_field(grid, &ball, eps).unwrap();
    npy::write(folder.path().join("disc.npy"), &field).unwrap();
    let mask = ["--mask", "box:0.1,0.1,0.45,0.45", "--ansatz", "empty"];
    let arguments = [
        "inpaint",
        "disc.npy",
        "--box-side",
        "1",
        "--steps",
        "16",
        "--output",
        "run",
    ];
    outcome(folder.path(), &[&arguments[..], &mask].concat());
    let after = npy::read(folder.path().join("run/final.npy"), |_| Ok(grid)).unwrap();
    let inside = |x: [f64; 2]| x.iter().all(|x| 0.1 < *x && *x < 0.45);
    let mut moved = 0;
    for (node, (a, b)) in field.values().iter().zip(after.values()).enumerate() {
        if inside(grid.node(node)) {
            // The region was empty at first.
            moved += usize::from(*b > 0.5);
        } else {
            assert_eq!(a.to_bits(), b.to_bits(), "{:?}", grid.node(node));
        }
    }
    assert!(moved > 10, "{moved}");
}

#[test]
fn inpainting_in_space_keeps_what_is_outside_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let grid = Grid::<3>::centred(32, 1.0).unwrap();
    let field = phase_field(grid, &Cuboid::new([0.25; 3]).unwrap(), 2.0 * grid.spacing()).unwrap();
    npy::write(folder.path().join("cube.npy"), &field).unwrap();
    let arguments = [
        "inpaint",
        "cube.npy",
        "--mask",
        "ball:0.25,0.25,0.25,0.12",
        "--steps",
        "14",
        "--output",
        "run",
    ];
    outcome(folder.path(), &arguments);
    let after = npy::read(folder.path().join("run/final.npy"), |_| Ok(grid)).unwrap();
    let corner = Ball::new([0.25; 3], 0.12).unwrap();
    let mut moved = 0;
    for (node, (a, b)) in field.values().iter().zip(after.values()).enumerate() {
        if geometry::SignedDistance::signed_distance(&corner, grid.node(node)) < 0.0 {
            moved += usize::from((a - b).abs() > 0.01);
        } else {
            assert_eq!(a.to_bits(), b.to_bits(), "{:?}", grid.node(node));
        }
    }
    assert!(moved > 10, "{moved}");
}

#[test]
fn drawings_flow_in_their_own_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let frame = Frame::new([90, 60], [0.0, 60.0], 1.0).unwrap();
    let square =
        geometry::SignedDistanceExt::translated(Cuboid::new([15.0, 15.0]).unwrap(), [30.0, 30.0]);
    let drawn = drawing(&frame, &square, Some(Rgb::WHITE)).unwrap();
    drawn.write_png(folder.path().join("square.png")).unwrap();
    let arguments = [
        "flow",
        "square.png",
        "--cells",
        "64",
        "--steps",
        "6",
        "--frames",
        "3",
        "--output",
        "run",
    ];
    let outcome = outcome(folder.path(), &arguments);
    assert!(
        outcome["energy"].as_f64() < outcome["first_energy"].as_f64(),
        "{outcome}"
    );
    let area = outcome["area"].as_f64().unwrap();
    assert!((area / 900.0 - 1.0).abs() < 0.1, "{outcome}");
    let after = images::read(folder.path().join("run/final.png")).unwrap();
    assert_eq!(after.size(), [90, 60]);
    assert!(after.grey()[30 * 90 + 30] < 100 && after.grey()[30 * 90 + 60] > 60_000);
    for name in [
        "final.svg",
        "final.npy",
        "final.vti",
        "animation.png",
        "frames/step-000006.png",
        "metrics.csv",
    ] {
        assert!(folder.path().join("run").join(name).exists(), "{name}");
    }
    let metrics = std::fs::read_to_string(folder.path().join("run/metrics.csv")).unwrap();
    assert_eq!(metrics.lines().count(), 7);
}

/// The area of a disc shrinks by 2 pi per unit of time under mean curvature flow.
#[test]
fn discs_shrink_by_every_method() {
    let folder = tempfile::tempdir().unwrap();
    for method in ["network", "fe-implicit", "fe-semi"] {
        let arguments = [
            "mcf",
            "builtin:disc",
            "--cells",
            "64",
            "--method",
            method,
            "--steps",
            "40",
            "--output",
            method,
        ];
        let outcome = outcome(folder.path(), &arguments);
        let number = |name: &str| outcome[name].as_f64().unwrap();
        let lost = std::f64::consts::PI * 0.36 - number("area");
        let expected = std::f64::consts::TAU * number("time");
        assert!(
            (lost / expected - 1.0).abs() < 0.1,
            "{method}: {lost}, expected {expected}"
        );
    }
}

#[test]
fn a_shape_that_vanishes_ends_its_run() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "mcf",
        "builtin:disc",
        "--cells",
        "32",
        "--side-length",
        "0.4",
        "--steps",
        "500",
        "--output",
        "run",
        "--save",
        "gone.png",
    ];
    let output = common::run(folder.path(), &arguments);
    let warning = common::text(&output.stderr);
    assert!(warning.contains("nothing is saved"), "{warning}");
    let outcome: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(outcome["components"], 0, "{outcome}");
    assert_eq!(outcome["ended"], "the shape has vanished");
    assert!(outcome["steps"].as_u64().unwrap() < 200, "{outcome}");
    assert!(folder.path().join("run/final.npy").exists());
}

#[test]
fn time_and_energy_end_runs() {
    let folder = tempfile::tempdir().unwrap();
    let timed = outcome(
        folder.path(),
        &[
            "flow",
            "builtin:disc",
            "--cells",
            "32",
            "--time",
            "1e-3",
            "--tau",
            "3e-4",
            "--output",
            "a",
        ],
    );
    assert_eq!(timed["steps"], 4);
    assert_eq!(timed["ended"], "the time 1e-3 is reached");
    assert!((timed["time"].as_f64().unwrap() - 1e-3).abs() < 1e-15);
    let sphere = outcome(
        folder.path(),
        &[
            "flow",
            "builtin:sphere",
            "--cells",
            "48",
            "--steps",
            "100",
            "--output",
            "b",
        ],
    );
    // It is stationary, and larger and larger steps would not change that.
    assert!(sphere["steps"].as_u64().unwrap() < 40, "{sphere}");
    assert_eq!(sphere["ended"], "the energy is stationary");
    assert!(
        (sphere["energy"].as_f64().unwrap() / EIGHT_PI - 1.0).abs() < 0.01,
        "{sphere}"
    );
}

#[test]
fn derivatives_are_right_on_own_input() {
    let folder = tempfile::tempdir().unwrap();
    let outcome = outcome(folder.path(), &["check", "builtin:cross", "--cells", "32"]);
    let checks = outcome["checks"].as_array().unwrap();
    assert!(checks.len() >= 3);
    assert!(
        checks.iter().all(|check| check["passed"] == true),
        "{outcome}"
    );
}

#[test]
fn trained_networks_serve_other_ratios() {
    let folder = tempfile::tempdir().unwrap();
    let train = [
        "train",
        "--dimension",
        "2",
        "--width",
        "13",
        "--eps-over-h",
        "1.5",
        "--quick",
        "--save",
        "mine.safetensors",
    ];
    outcome(folder.path(), &train);
    let about = outcome(folder.path(), &["networks", "show", "mine.safetensors"]);
    assert_eq!(about["ratios"]["width"], 13);
    let flow = [
        "flow",
        "builtin:disc",
        "--cells",
        "32",
        "--eps-over-h",
        "1.5",
        "--network",
        "mine.safetensors",
        "--steps",
        "2",
        "--output",
        "run",
    ];
    let outcome = outcome(folder.path(), &flow);
    assert!(outcome["energy"].as_f64().unwrap() > 0.0);
}

#[test]
fn lists_are_complete() {
    let folder = tempfile::tempdir().unwrap();
    let networks = outcome(folder.path(), &["networks"]);
    assert!(networks.as_array().unwrap().len() >= 11);
    let info = outcome(folder.path(), &["info"]);
    assert_eq!(info["devices"].as_array().unwrap().len(), 4);
    for (arguments, expected) in [
        (&["completions", "bash"][..], "_willmore"),
        (&["man"], ".TH"),
    ] {
        let output = common::program(folder.path())
            .args(arguments)
            .output()
            .unwrap();
        assert!(
            common::text(&output.stdout).contains(expected),
            "{arguments:?}"
        );
    }
}

/// A JPEG file is a drawing as a PNG file is; the region of a mask may be one too.
#[test]
fn photographs_are_drawings_too() {
    let folder = tempfile::tempdir().unwrap();
    let pixels: u16 = 64;
    let square: Vec<u8> = (0..pixels)
        .flat_map(|y| (0..pixels).map(move |x| (16..48).contains(&x) && (16..48).contains(&y)))
        .map(|inside| if inside { 20 } else { 235 })
        .collect();
    for name in ["square.jpg", "mask.JPEG"] {
        let path = folder.path().join(name);
        let encoder = jpeg_encoder::Encoder::new_file(path, 95).unwrap();
        let colour = jpeg_encoder::ColorType::Luma;
        encoder.encode(&square, pixels, pixels, colour).unwrap();
    }
    let common = ["--cells", "48", "--steps", "1", "--tau", "1e-2", "--output"];
    for (output, command) in [
        ("flow", &["flow", "square.jpg"][..]),
        ("inpaint", &["inpaint", "square.jpg", "--mask", "mask.JPEG"]),
    ] {
        let outcome = outcome(folder.path(), &[command, &common, &[output]].concat());
        let area = outcome["area"].as_f64().unwrap();
        assert!((area / 1024.0 - 1.0).abs() < 0.03, "{outcome}");
        let after = images::read(folder.path().join(output).join("final.png")).unwrap();
        assert_eq!(after.size(), [64, 64]);
    }
    // Half of a file is refused in one line, which names it.
    let bytes = std::fs::read(folder.path().join("square.jpg")).unwrap();
    std::fs::write(folder.path().join("half.jpg"), &bytes[..bytes.len() / 2]).unwrap();
    let refused = common::run(folder.path(), &["flow", "half.jpg"]);
    let line = common::text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{line}");
    assert!(
        line.contains("half.jpg") && line.lines().count() == 1,
        "{line}"
    );
}

#[test]
fn samples_are_inputs() {
    let folder = tempfile::tempdir().unwrap();
    for (input, files) in [
        ("builtin:ring", &["ring.png", "ring.npy"][..]),
        (
            "box:-0.3,-0.2,-0.3,0.3,0.2,0.3",
            &["box.ply", "box.stl", "box.npy"],
        ),
    ] {
        for file in files {
            outcome(
                folder.path(),
                &["sample", input, "--cells", "32", "--save", file],
            );
            let run = [
                "flow",
                file,
                "--steps",
                "1",
                "--output",
                &format!("run-{file}"),
            ];
            outcome(folder.path(), &run);
        }
    }
    // Files for ParaView and drawings of curves are written alone.
    for (file, beginning) in [("r.vti", "<?xml"), ("r.svg", "<svg")] {
        let written = ["sample", "builtin:ring", "--cells", "32", "--save", file];
        outcome(folder.path(), &written);
        let content = std::fs::read(folder.path().join(file)).unwrap();
        assert!(content.starts_with(beginning.as_bytes()), "{file}");
    }
    // A ball of radius 0.2 whose vertices move by up to 0.01.
    let noisy = |file: &str, seed: &str| {
        let ball = [
            "sample",
            "ball:0.1,0,0,0.2",
            "--cells",
            "32",
            "--noise",
            "0.01",
        ];
        let saved = ["--seed", seed, "--save", file];
        outcome(folder.path(), &[&ball[..], &saved].concat());
        surfaces::read(folder.path().join(file)).unwrap()
    };
    let mesh = noisy("ball.ply", "1");
    let errors = mesh
        .vertices
        .iter()
        .map(|x| (x[0] - 0.1).hypot(x[1]).hypot(x[2]) - 0.2);
    let (low, high) = errors.fold((0.0, 0.0), |(low, high), e: f64| (e.min(low), e.max(high)));
    assert!(low < -0.008 && high > 0.008, "{low} {high}");
    assert!(low > -0.011 && high < 0.011, "{low} {high}");
    assert_eq!(noisy("same.ply", "1").vertices, mesh.vertices);
    assert_ne!(noisy("other.ply", "2").vertices, mesh.vertices);
    // A quarter of a disc.
    let cut = ["--without", "box:-1,-1,0,1", "--without", "box:-1,-1,1,0"];
    let disc = [
        "sample",
        "builtin:disc",
        "--cells",
        "64",
        "--save",
        "quarter.npy",
    ];
    outcome(folder.path(), &[&disc[..], &cut].concat());
    let quarter = npy::read(folder.path().join("quarter.npy"), |n| {
        Grid::<2>::centred(n, 2.0)
    })
    .unwrap();
    let area = geometry::measure::zero_set_volume(&quarter);
    let expected = 0.25 * std::f64::consts::PI * 0.36;
    assert!((area / expected - 1.0).abs() < 0.02, "{area}");
}

/// The bytes of a name need not be text.
#[cfg(target_os = "linux")]
#[test]
fn samples_have_any_name() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let name = std::ffi::OsStr::from_bytes(b"caf\xe9.png");
    let mut sample = common::program(folder.path());
    sample.args(["sample", "builtin:disc", "--cells", "32", "--save"]);
    let output = sample.arg(name).output().unwrap();
    let error = common::text(&output.stderr);
    assert!(output.status.success(), "{error}");
    assert!(folder.path().join(name).exists());
}

/// The mask has the pixels of the input, and the region is where its dark pixels are.
#[test]
fn images_are_masks_too() {
    let folder = tempfile::tempdir().unwrap();
    let frame = Frame::new([60, 60], [0.0, 60.0], 1.0).unwrap();
    let disc = Ball::new([30.0, 30.0], 20.0).unwrap();
    let spot = Ball::new([50.0, 30.0], 10.0).unwrap();
    for (name, shape) in [("disc.png", &disc), ("spot.png", &spot)] {
        let drawn = drawing(&frame, shape, Some(Rgb::WHITE)).unwrap();
        drawn.write_png(folder.path().join(name)).unwrap();
    }
    let arguments = [
        "--cells", "64", "--steps", "1", "--tau", "1e-5", "--ansatz", "empty", "--output", "run",
    ];
    let inpaint = ["inpaint", "disc.png", "--mask", "spot.png"];
    outcome(folder.path(), &[&inpaint[..], &arguments].concat());
    let grid = Grid::<2>::centred(128, 2.0).unwrap();
    let u = npy::read(folder.path().join("run/final.npy"), |_| Ok(grid)).unwrap();
    // 60 pixels are 1.2: the spot reaches from 40 to 60 pixels, the disc from 10 to 50.
    let at = |pixels: f64| u.interpolate([0.02 * (pixels - 30.0), 0.0]);
    assert!(
        at(20.0) > 0.9 && at(36.0) > 0.9,
        "{} {}",
        at(20.0),
        at(36.0)
    );
    assert!(at(45.0) < -0.5, "{}", at(45.0));
}

#[test]
fn a_handle_that_is_not_resolved_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let coarse = [
        "flow",
        "builtin:lever",
        "--cells",
        "32",
        "--side-length",
        "0.4",
        "--steps",
        "6",
        "--output",
        "run",
    ];
    let outcome = outcome(folder.path(), &coarse);
    assert_eq!(outcome["same_topology"], false, "{outcome}");
    let torus = [
        "flow",
        "builtin:torus",
        "--side-length",
        "0.8",
        "--steps",
        "3",
        "--output",
        "torus",
    ];
    let outcome = common::outcome(folder.path(), &torus);
    assert_eq!(outcome["same_topology"], true, "{outcome}");
    assert_eq!(outcome["euler_characteristic"], 0);
}

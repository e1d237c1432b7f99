//! Every command line of `--help` and of the readme, on small inputs, with a look at what comes out.

use std::path::Path;

use geometry::shapes::Ball;
use geometry::{SignedDistance, SignedDistanceExt};
use images::{Frame, drawing};
use render::Rgb;
use serde_json::Value;
use volumes::Volume;

use crate::common::{program, run, text};

const COMMANDS: [&str; 12] = [
    "train",
    "sample",
    "flow",
    "fair",
    "inpaint",
    "mcf",
    "resume",
    "networks",
    "info",
    "check",
    "completions",
    "man",
];

/// What makes a command quick.
fn quick(command: &str, line: &str) -> &'static [&'static str] {
    match command {
        "fair" if line.contains(".nii") => &["--cells", "32"],
        "flow" | "mcf" | "inpaint" => &["--cells", "48", "--steps", "3"],
        "fair" => &["--cells", "48"],
        "check" => &["--cells", "24"],
        "sample" => &["--force"],
        "train" => &["--quick", "--force"],
        _ => &[],
    }
}

fn draw(path: &Path, shape: &impl SignedDistance<2>) {
    let frame = Frame::new([200, 200], [0.0, 200.0], 1.0).unwrap();
    let drawn = drawing(&frame, shape, Some(Rgb::WHITE)).unwrap();
    drawn.write_png(path).unwrap();
}

/// The files that the examples name.
fn inputs(folder: &Path) {
    let at = |name: &str| folder.join(name);
    let disc = |x: f64, radius: f64| Ball::new([x, 100.0], radius).unwrap();
    for name in ["logo.png", "drawing.png", "photo.png"] {
        draw(&at(name), &disc(100.0, 80.0).difference(disc(100.0, 35.0)));
    }
    draw(&at("damage.png"), &disc(160.0, 20.0));
    let figure = surfaces::samples::figure(48).unwrap().into_mesh();
    surfaces::write(at("bunny.ply"), &figure).unwrap();
    let mut scan = surfaces::samples::lever(48).unwrap().into_mesh();
    let side = scan.bounding_box().unwrap().longest_side();
    for x in scan.vertices.iter_mut().flatten() {
        *x *= 10.0 / side;
    }
    scan.roughen(0.05, 3);
    let ball = |voxel: usize, x: f64, radius: f64| {
        let index = [voxel % 40, voxel / 40 % 24, voxel / (40 * 24)].map(|i| i as f64);
        let offset = [index[0] - x, index[1] - 11.5, index[2] - 11.5];
        u8::from(offset.iter().map(|v| v * v).sum::<f64>() < radius * radius)
    };
    let label = |voxel| 3 * ball(voxel, 11.0, 8.0) + 7 * ball(voxel, 29.0, 7.0);
    let labels = (0..40 * 24 * 24).map(label).collect();
    let organs = Volume::of_labels([40, 24, 24], [0.0; 3], [1.0; 3], labels).unwrap();
    volumes::write(at("organs.nii.gz"), &organs).unwrap();
    for name in ["scan.obj", "scan.stl", "scan.ply"] {
        surfaces::write(at(name), &scan).unwrap();
    }
}

/// The lines of the help of a command that are commands themselves.
fn examples(folder: &Path, command: &str) -> Vec<String> {
    let help = program(folder).args([command, "--help"]).output().unwrap();
    let lines = text(&help.stdout);
    let lines = lines
        .lines()
        .filter_map(|line| line.strip_prefix("  willmore "));
    lines.map(str::to_owned).collect()
}

fn readme() -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../README.md");
    let text = std::fs::read_to_string(path).unwrap();
    let lines = text
        .lines()
        .filter_map(|line| line.strip_prefix("willmore "));
    lines.map(str::to_owned).collect()
}

/// Fails unless the outcome of a run is what a person wants: a shape with its parts, smoother than before, and no ball.
fn assert_sensible(line: &str, outcome: &Value) {
    if line.contains("--shared") {
        for label in outcome["labels"].as_array().unwrap() {
            let volume = |name: &str| label[name].as_f64().unwrap();
            let change = volume("volume_after") / volume("volume_before") - 1.0;
            assert!(change.abs() < 0.003, "{line}: {outcome}");
        }
        return;
    }
    assert_eq!(outcome["finished"], true, "{line}: {outcome}");
    assert!(
        outcome["components"].as_u64().unwrap() > 0,
        "{line}: {outcome}"
    );
    let number = |name: &str| outcome[name].as_f64();
    if let (Some(first), Some(energy)) = (number("first_energy"), number("energy")) {
        assert!(energy < 1.05 * first, "{line}: {outcome}");
    }
    if let Some(spheres) = number("energy_over_8_pi") {
        assert!(spheres > 0.95, "{line}: {outcome}");
    }
    if line.starts_with("fair") && !line.contains(".nii") {
        assert_eq!(outcome["same_topology"], true, "{line}: {outcome}");
    }
    if line.starts_with("fair") && !line.contains("--remesh") && !line.contains(".nii") {
        let of = |name: &str| outcome["mesh"][name].as_f64().unwrap();
        assert!(
            of("displacement_largest_percent") < 4.0,
            "{line}: {outcome}"
        );
        assert!(of("volume_change_percent").abs() < 0.1, "{line}: {outcome}");
    }
}

#[test]
fn every_example_does_what_a_person_wants() {
    let folder = tempfile::tempdir().unwrap();
    inputs(folder.path());
    let own = COMMANDS
        .iter()
        .flat_map(|command| examples(folder.path(), command));
    let mut lines: Vec<String> = own.chain(readme()).collect();
    // No other device is compiled in.
    lines.retain(|line| !line.contains("--device"));
    assert!(lines.len() > 25, "{lines:?}");
    for line in &lines {
        let typed = line.split(['>', '#']).next().unwrap();
        let mut words: Vec<&str> = typed.split_whitespace().collect();
        let command = words[0];
        words.extend(quick(command, line));
        if command == "resume" && line.contains("--steps") {
            words.extend(["--steps", "5"]);
        }
        let output = run(folder.path(), &words);
        let error = text(&output.stderr);
        assert!(output.status.success(), "{words:?}: {error}");
        if ["flow", "fair", "inpaint", "mcf"].contains(&command) {
            for outcome in serde_json::Deserializer::from_slice(&output.stdout).into_iter() {
                assert_sensible(line, &outcome.unwrap());
            }
        }
    }
    // What is saved is there.
    for name in [
        "smooth.stl",
        "smooth.svg",
        "whole.ply",
        "mask.png",
        "mine.safetensors",
        "organ.stl",
        "walls.ply",
        "organ-label3.stl",
        "organ-label7.stl",
    ] {
        assert!(folder.path().join(name).is_file(), "{name}");
    }
}

//! Sizes that are held, and energies with spontaneous curvature, tension and pressure.

use std::fs;
use std::path::Path;

use crate::common::{column, outcome, program, text};
use geometry::shapes::{Ball, Cuboid, Ellipse};
use geometry::{Grid, SignedDistance, npy, phase_field};
use serde_json::Value;

/// A time step that is short against the shapes here.
const TAU: &str = "6e-5";

fn write(path: &Path, shape: &impl SignedDistance<2>) {
    let grid = Grid::<2>::centred(96, 0.75).unwrap();
    let field = phase_field(grid, shape, 2.0 * grid.spacing()).unwrap();
    npy::write(path, &field).unwrap();
}

/// Runs a command on a field in a box of side 3/4.
fn of_field(folder: &Path, [command, field, run]: [&str; 3], options: &[&str]) -> Value {
    let box_side = ["--box-side", "0.75", "--output", run];
    let arguments = [&[command, field][..], &box_side, options].concat();
    outcome(folder, &arguments)
}

#[test]
fn sizes_are_kept_and_driven() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write(&at("ellipse.npy"), &Ellipse::new([0.25, 0.17]).unwrap());
    let run = |name: &str, options: &[&str]| {
        let common = ["--tau", TAU, "--ramp", "3"];
        of_field(
            folder.path(),
            ["flow", "ellipse.npy", name],
            &[options, &common].concat(),
        )
    };
    run(
        "kept",
        &["--area", "keep", "--length", "keep", "--steps", "2"],
    );
    for (name, multiplier) in [("area", "pressure"), ("length", "tension")] {
        let sizes = column(&at("kept"), name);
        assert!((sizes[1] / sizes[0] - 1.0).abs() < 1e-9, "{sizes:?}");
        let multipliers = column(&at("kept"), multiplier);
        assert!(multipliers.iter().all(|value| value.is_finite()));
    }
    // In the plane the volume is another word for the area.
    run("smaller", &["--volume", "94%", "--steps", "4"]);
    let areas = column(&at("smaller"), "area");
    assert!(
        (areas[0] / areas[2] - 0.98 / 0.94).abs() < 1e-9,
        "{areas:?}"
    );
    assert!((areas[3] / areas[2] - 1.0).abs() < 1e-9, "{areas:?}");

    let reduced = ["--reduced-volume", "0.9"];
    let ended = run("reduced", &[&reduced[..], &["--steps", "4"]].concat());
    let number = |name: &str| ended[name].as_f64().unwrap();
    assert!((number("reduced_volume") - 0.9).abs() < 1e-9, "{ended}");
    let turned = number("integrated_mean_curvature");
    assert!(
        (turned / std::f64::consts::TAU - 1.0).abs() < 2e-3,
        "{ended}"
    );

    // Stopped inside the ramp, and continued.
    run("stopped", &[&reduced[..], &["--steps", "2"]].concat());
    outcome(folder.path(), &["resume", "stopped", "--steps", "4"]);
    let last = |run: &str| fs::read(at(run).join("final.npy")).unwrap();
    assert!(last("stopped") == last("reduced"));
}

/// Edges sharper than the interface cannot keep their area: they become round before, and the area comes back.
#[test]
fn edges_become_round_where_both_sizes_are_held() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write(&at("rectangle.npy"), &Cuboid::new([0.25, 0.15]).unwrap());
    let run = |name: &str, options: &[&str]| {
        let both = ["--area", "keep", "--length", "keep", "--ramp", "4"];
        let options = [&both[..], options].concat();
        of_field(folder.path(), ["flow", "rectangle.npy", name], &options)
    };
    run("kept", &["--steps", "9"]);
    let (lengths, areas) = (column(&at("kept"), "length"), column(&at("kept"), "area"));
    assert!((lengths[8] / 1.6 - 1.0).abs() < 5e-3, "{lengths:?}");
    assert!((areas[8] / 0.15 - 1.0).abs() < 5e-3, "{areas:?}");
    assert!(lengths[0] < 0.995 * lengths[8], "{lengths:?}");
    for held in [&lengths[7..], &areas] {
        let change = held[held.len() - 1] / held[0] - 1.0;
        assert!(change.abs() < 1e-9, "{held:?}");
    }
    let halvings = column(&at("kept"), "halvings");
    assert!(halvings.iter().sum::<f64>() <= 4.0, "{halvings:?}");

    run("stopped", &["--steps", "2"]);
    outcome(folder.path(), &["resume", "stopped", "--steps", "9"]);
    let last = |run: &str| fs::read(at(run).join("final.npy")).unwrap();
    assert!(last("stopped") == last("kept"));

    write(&at("thin.npy"), &Cuboid::new([0.25, 0.012]).unwrap());
    let arguments = ["flow", "thin.npy", "--area", "keep", "--length", "keep"];
    let refused = program(folder.path()).args(arguments).output().unwrap();
    assert!(!refused.status.success());
    let message = text(&refused.stderr);
    assert!(
        message.contains("length and area cannot both be held"),
        "{message}"
    );
    // The area held the length in the plane once.
    let holds = "--area holds the area of the inside; --length holds the length of the curve\n";
    assert!(message.starts_with(holds), "{message}");
}

/// The speed of a disc is `1/(2 R^3) - c0^2/(2 R) - sigma/R - p`.
#[test]
fn discs_move_as_their_energies_say() {
    let folder = tempfile::tempdir().unwrap();
    let radius = 0.25_f64;
    let disc = Ball::new([0.0; 2], radius).unwrap();
    write(&folder.path().join("disc.npy"), &disc);
    for (option, value, speed) in [
        ("--spontaneous-curvature", "-6", -36.0 / (2.0 * radius)),
        ("--tension", "16", -16.0 / radius),
        ("--pressure", "64", -64.0),
    ] {
        let options = [option, value, "--tau", TAU, "--steps", "3"];
        let ended = of_field(
            folder.path(),
            ["flow", "disc.npy", option.trim_start_matches('-')],
            &options,
        );
        let number = |name: &str| ended[name].as_f64().unwrap();
        let moved = (number("area") / std::f64::consts::PI).sqrt() - radius;
        let expected = number("time") * (0.5 / radius.powi(3) + speed);
        // The speed changes by some percent on the way.
        assert!(
            (moved / expected - 1.0).abs() < 0.15,
            "{option}: {moved} {expected}"
        );
        assert!(ended["energy_terms"].is_object(), "{ended}");
    }
    let mask = [
        "--mask",
        "box:0.1,-0.1,0.35,0.1",
        "--tension",
        "16",
        "--volume",
        "keep",
    ];
    let options = [&mask[..], &["--steps", "2", "--tau", TAU]].concat();
    let ended = of_field(folder.path(), ["inpaint", "disc.npy", "filled"], &options);
    let area = ended["area"].as_f64().unwrap();
    assert!(
        (area / (std::f64::consts::PI * radius * radius) - 1.0).abs() < 1e-4,
        "{ended}"
    );
}

/// In pixels, a disc of radius 50 rests at the tension `1/(2 R^2)`, under which it would grow by a seventh otherwise.
#[test]
fn tensions_are_in_the_units_of_the_input() {
    let folder = tempfile::tempdir().unwrap();
    let pixel = |k: i32| {
        let (x, y) = (k % 200 - 100, k / 200 - 100);
        let value = if x * x + y * y < 2500 { 0 } else { 255 };
        [value, value, value, 255]
    };
    let picture = render::Picture::new([200, 200], (0..40_000).map(pixel).collect()).unwrap();
    picture.write_png(folder.path().join("disc.png")).unwrap();
    let area = |run: &str, options: &[&str]| {
        let common = [
            "flow", "disc.png", "--cells", "64", "--time", "1e6", "--output", run,
        ];
        let ended = outcome(folder.path(), &[&common[..], options].concat());
        ended["area"].as_f64().unwrap() / (std::f64::consts::PI * 2500.0)
    };
    let (free, taut) = (area("free", &[]), area("taut", &["--tension", "2e-4"]));
    assert!((free - 1.32_f64.sqrt()).abs() < 0.02, "{free}");
    assert!((taut - 1.0).abs() < 0.02, "{taut}");
}

/// A size that goes to its target much faster than the shape can follow.
#[test]
fn sizes_that_change_too_fast_need_a_longer_ramp() {
    let folder = tempfile::tempdir().unwrap();
    let flow = "flow builtin:rectangle --length 50% --area 30% --cells 32 --tau 1e-14 --no-page";
    let refused = (program(folder.path()).args(flow.split(' ')).output()).unwrap();
    let said = text(&refused.stderr);
    assert!(said.contains("give a larger --ramp"), "{said}");
}

/// The steps of the ramp come before those that are made without targets.
#[test]
fn sizes_reach_their_targets_or_are_said_not_to() {
    let folder = tempfile::tempdir().unwrap();
    let run = |more: &str| {
        let flow = format!("flow builtin:disc --cells 24 --area 90% --no-page {more}");
        let output = program(folder.path())
            .args(flow.trim().split(' '))
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let said = run("");
    assert!(said.contains("(-10.00 %)"), "{said}");
    assert!(!said.contains("targets"), "{said}");
    let said = run("--steps 3");
    let advice = "the sizes have not reached their targets: `willmore resume` goes on";
    assert!(said.contains(advice), "{said}");
}

/// What the grid cannot hold is said, and what has vanished has no size.
#[test]
fn forces_that_are_too_much_for_the_grid_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let disc = |terms: &str| {
        let flow = format!("flow builtin:disc --cells 24 --no-page {terms}");
        outcome(folder.path(), &flow.split(' ').collect::<Vec<_>>())
    };
    let lost = disc("--tension=-100 --area keep --steps 100");
    assert!(
        (lost["interface_slope"].as_f64().unwrap() - 1.0).abs() > 0.4,
        "{lost}"
    );
    let gone = disc("--pressure 1e6");
    assert_eq!(gone["ended"], "the shape has vanished", "{gone}");
    assert_eq!((&gone["length"], &gone["area"]), (&0.0.into(), &0.0.into()));
}

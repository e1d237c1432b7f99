//! Single options: what they change, and what they leave as it is.

use std::path::Path;

use geometry::shapes::{Ball, Ellipse};
use geometry::{Field, Grid, SignedDistance, npy, phase_field};
use serde_json::Value;

use crate::common::{column, outcome, program, text};

fn number(outcome: &Value, path: &str) -> f64 {
    let found = outcome.pointer(path).and_then(Value::as_f64);
    found.unwrap_or_else(|| panic!("no {path} in {outcome}"))
}

/// The phase field of an ellipse on 96 cells a side.
fn write_ellipse(path: &Path) {
    let grid = Grid::<2>::centred(96, 0.75).unwrap();
    let ellipse = Ellipse::new([0.25, 0.15]).unwrap();
    npy::write(
        path,
        &phase_field(grid, &ellipse, 2.0 * grid.spacing()).unwrap(),
    )
    .unwrap();
}

/// Tolerances of controlled steps are lengths in the units of the input: a smaller one makes more steps of a smaller estimated error, and the
/// same shape in another unit, here a power of two, has the same run.
#[test]
fn tolerances_are_lengths_in_the_units_of_the_input() {
    let folder = tempfile::tempdir().unwrap();
    write_ellipse(&folder.path().join("ellipse.npy"));
    let flow = |name: &str, unit: f64, tolerance: f64| {
        let options = [
            ("--box-side", 0.75 * unit),
            ("--tolerance", tolerance * unit),
            ("--time", 2e-3 * unit.powi(4)),
        ];
        let values = options.map(|(_, value)| value.to_string());
        let options = options.iter().zip(&values);
        let options = options.flat_map(|((option, _), value)| [*option, value.as_str()]);
        let run = ["flow", "ellipse.npy", "--output", name];
        outcome(
            folder.path(),
            &run.into_iter().chain(options).collect::<Vec<_>>(),
        )
    };
    let loose = flow("loose", 1.0, 1e-3);
    let tight = flow("tight", 1.0, 1e-5);
    let error = |outcome: &Value| number(outcome, "/time_steps/estimated_error");
    assert!(error(&loose) < 1e-3, "{loose}");
    assert!(error(&tight) < 0.9 * error(&loose), "{loose} {tight}");
    assert!(
        number(&tight, "/steps") > number(&loose, "/steps"),
        "{loose} {tight}"
    );

    let other = flow("other", 128.0, 1e-3);
    assert_eq!(other["steps"], loose["steps"]);
    let last = |name: &str| std::fs::read(folder.path().join(name).join("final.npy")).unwrap();
    assert!(last("other") == last("loose"));
    let ratio = error(&other) / error(&loose);
    assert!((ratio / 128.0 - 1.0).abs() < 1e-9, "{other}");
}

/// Direct steps reach the state of minimizing ones, and say what they cost and that nothing guarantees their energy.
#[test]
fn direct_steps_reach_the_same_shape_and_say_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    write_ellipse(&folder.path().join("ellipse.npy"));
    let flow = |name: &str, options: &[&str]| {
        let run = [
            "flow",
            "ellipse.npy",
            "--box-side",
            "0.75",
            "--time",
            "1e-4",
            "--output",
            name,
        ];
        outcome(folder.path(), &[&run[..], options].concat())
    };
    let direct = flow("direct", &["--stepper", "direct"]);
    let minimizing = flow("minimizing", &[]);
    let area = |outcome: &Value| number(outcome, "/area");
    assert!(
        (area(&direct) / area(&minimizing) - 1.0).abs() < 1e-3,
        "{direct} {minimizing}"
    );
    let convolutions = column(&folder.path().join("direct"), "convolutions");
    let all = number(&direct, "/direct_steps/convolutions");
    assert!(
        (convolutions.iter().sum::<f64>() - all).abs() < 0.5 && all > 10.0,
        "{direct}"
    );
    assert!(
        number(&direct, "/direct_steps/run_distance") < 1e-3,
        "{direct}"
    );
    assert_eq!(direct["direct_steps"]["energy_increases"], 0, "{direct}");
    assert!(number(&direct, "/direct_steps/reach_in_cells") > 8.0);
    let error = number(&minimizing, "/time_steps/estimated_error");
    assert!(
        error > 0.0 && minimizing.get("direct_steps").is_none(),
        "{minimizing}"
    );
}

/// The disc grows until it is near to its own image.
#[test]
fn direct_steps_that_are_too_long_for_the_grid_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let flow = "flow builtin:disc --cells 24 --stepper direct --no-page";
    let output = program(folder.path())
        .args(flow.split(' '))
        .output()
        .unwrap();
    let said = text(&output.stdout);
    assert!(said.contains("within 8 cells: use more --cells"), "{said}");
}

/// From a corner controlled steps are made again until their error is what it may be, which is nothing to tell.
#[test]
fn controlled_steps_are_not_said_to_be_shortened() {
    let folder = tempfile::tempdir().unwrap();
    let flow = ["flow", "builtin:cross", "--cells", "32", "--steps", "5"];
    let options = ["--tolerance", "0.001%", "--output", "run"];
    let ended = outcome(folder.path(), &[&flow[..], &options].concat());
    let halvings = column(&folder.path().join("run"), "halvings");
    assert!(halvings.iter().any(|times| *times > 0.0), "{halvings:?}");
    assert_eq!(ended["shortened_steps"], 0, "{ended}");
}

/// Bricks hold a part of the grid, and the flow on them is that on all of it.
#[test]
fn what_is_stored_changes_the_cost_and_not_the_flow() {
    let folder = tempfile::tempdir().unwrap();
    let flow = |storage: &str| {
        let shape = [
            "flow",
            "builtin:torus",
            "--cells",
            "64",
            "--steps",
            "1",
            "--tau",
            "1e-6",
        ];
        let options = ["--storage", storage, "--output", storage];
        outcome(folder.path(), &[&shape[..], &options].concat())
    };
    let [dense, bricks] = ["dense", "bricks"].map(flow);
    assert_eq!(dense["grid"]["stored_cells"], 64 * 64 * 64);
    assert!(
        number(&bricks, "/grid/stored_cells") < 0.8 * 64_f64.powi(3),
        "{bricks}"
    );
    for name in ["/energy", "/area", "/volume"] {
        let [whole, part] = [&dense, &bricks].map(|outcome| number(outcome, name));
        assert!((part / whole - 1.0).abs() < 1e-5, "{name}: {whole} {part}");
    }
}

/// A field of signed distances is the shape whose phase field it would have.
#[test]
fn distances_and_phase_fields_are_the_same_shape() {
    let folder = tempfile::tempdir().unwrap();
    let grid = Grid::<2>::centred(64, 1.0).unwrap();
    let eps = 2.0 * grid.spacing();
    let disc = Ball::new([0.03, 0.01], 0.3).unwrap();
    let distances = Field::from_fn(grid, |x| disc.signed_distance(x));
    npy::write(folder.path().join("distance.npy"), &distances).unwrap();
    npy::write(
        folder.path().join("phase-field.npy"),
        &phase_field(grid, &disc, eps).unwrap(),
    )
    .unwrap();
    let areas = ["distance", "phase-field"].map(|kind| {
        let input = format!("{kind}.npy");
        let run = ["flow", &input, "--holds", kind, "--output", kind];
        let options = ["--box-side", "1", "--steps", "1", "--tau", "1e-7"];
        number(
            &outcome(folder.path(), &[&run[..], &options].concat()),
            "/area",
        )
    });
    assert!((areas[0] / areas[1] - 1.0).abs() < 1e-9, "{areas:?}");
}

/// A flow ends with the first step whose energy is no more than what is asked for.
#[test]
fn flows_end_at_an_energy() {
    let folder = tempfile::tempdir().unwrap();
    write_ellipse(&folder.path().join("ellipse.npy"));
    let options = [
        "--box-side",
        "0.75",
        "--energy",
        "16.5",
        "--tau",
        "6e-5",
        "--output",
        "run",
    ];
    let ended = outcome(
        folder.path(),
        &[&["flow", "ellipse.npy"][..], &options].concat(),
    );
    assert_eq!(ended["energy_reached"], true);
    let energies = column(&folder.path().join("run"), "willmore_energy");
    let (last, before) = energies.split_last().unwrap();
    assert!(
        *last <= 16.5 && !before.is_empty() && before.iter().all(|energy| *energy > 16.5),
        "{energies:?}"
    );
}

/// Each scheme has an energy of its own for a disc that is small against the interface; the exact one is `pi / R`.
#[test]
fn schemes_are_different_operators() {
    let folder = tempfile::tempdir().unwrap();
    let errors = ["accurate", "calibrated", "paper"].map(|scheme| {
        let flow = ["flow", "builtin:disc", "--cells", "32", "--steps", "1"];
        let options = ["--tau", "1e-9", "--scheme", scheme, "--output", scheme];
        let ended = outcome(folder.path(), &[&flow[..], &options].concat());
        let radius = number(&ended, "/length") / std::f64::consts::TAU;
        number(&ended, "/energy") * radius / std::f64::consts::PI - 1.0
    });
    assert!(errors.iter().all(|error| error.abs() < 0.04), "{errors:?}");
    for [one, other] in [[0, 1], [1, 2], [0, 2]] {
        assert!((errors[one] - errors[other]).abs() > 1e-3, "{errors:?}");
    }
}

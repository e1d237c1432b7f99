//! Surfaces: the programs, and what their flows must satisfy.

use std::fs;

use crate::common::{finished, read_summary, refused, run};
use engine::{Case, Formulation, Record, Run, StepRule, energy_increases};
use experiments::networks::Chosen;
use experiments::surfaces::{centred_box, needed_network, scales};
use geometry::measure::{l2_distance, zero_set_volume};
use geometry::shapes::{Ball, Capsule};
use geometry::{Field, SignedDistanceExt, npy, phase_field};
use operators::ComputeDevice;
use runs::Interrupt;

const ARMADILLO: &str = "armadillo";
const DISK_AND_CUBE: &str = "disk_and_cube";
const INPAINTING: &str = "inpainting_3d";
const MESH_DISTANCE: &str = "mesh_distance";
const ROCKER_ARM: &str = "rocker_arm";
const SPHERES: &str = "spheres";

const TAU: f64 = 1.0 / 262_144.0;

#[test]
fn built_in_shapes_flow_without_any_file() {
    let root = tempfile::tempdir().unwrap();
    let arguments = ["--quick", "--quiet", "--procedural", "--output", "out"];
    let summary = finished(ARMADILLO, root.path(), &arguments);
    let metric = |name: &str| *summary.get(name).unwrap_or_else(|| panic!("no {name}"));
    assert!(metric("armadillo.w.step2") < metric("armadillo.w.step0"));
    assert!(metric("armadillo.energy_increases") <= 0.0);
    for file in [
        "surfaces.png",
        "surfaces.svg",
        "energies.md",
        "steps.csv",
        "meshes/armadillo_hybrid_step000.ply",
        "pictures/armadillo_hybrid_step002.png",
    ] {
        assert!(root.path().join("out").join(file).exists(), "{file}");
    }
    let summary = finished(ROCKER_ARM, root.path(), &arguments);
    let metric = |name: &str| *summary.get(name).unwrap_or_else(|| panic!("no {name}"));
    assert!(metric("rocker_arm.w.step2") < metric("rocker_arm.w.step0"));
    assert!(metric("rocker_arm.energy_increases") <= 0.0);
    // A torus fits better than nothing does: against the empty box the phase field is 2 wrong inside and nothing outside.
    let empty = 2.0 * metric("rocker_arm.volume.step2").sqrt();
    let l2 = metric("rocker_arm.clifford_l2");
    assert!(l2 < 0.5 * empty, "{l2} of {empty}");
    let w = metric("rocker_arm.clifford_w") / (4.0 * std::f64::consts::PI.powi(2));
    assert!((w - 1.0).abs() < 0.2, "{w}");
}

#[test]
fn cube_and_disk_come_near_their_finite_element_runs() {
    let root = tempfile::tempdir().unwrap();
    let arguments = ["--quick", "--quiet", "--output", "out"];
    let summary = finished(DISK_AND_CUBE, root.path(), &arguments);
    let metric = |name: &str| *summary.get(name).unwrap_or_else(|| panic!("no {name}"));
    for key in ["cube", "disk"] {
        assert!(metric(&format!("{key}.w.step2")) < metric(&format!("{key}.w.step0")));
        assert!(metric(&format!("{key}.energy_increases")) <= 0.0);
        let l2 = metric(&format!("{key}.l2_to_fe.step2"));
        assert!(l2 > 0.0 && l2 < 0.02, "{key}: {l2}");
    }
}

#[test]
fn quick_inpainting_changes_nothing_outside() {
    let root = tempfile::tempdir().unwrap();
    let arguments = ["--quick", "--quiet", "--output", "out"];
    let summary = finished(INPAINTING, root.path(), &arguments);
    let metric = |name: &str| *summary.get(name).unwrap_or_else(|| panic!("no {name}"));
    for (key, last) in [("ball", 5), ("tubes", 8)] {
        assert!(metric(&format!("{key}.changed_outside")) <= 0.0);
        assert!(metric(&format!("{key}.energy_increases")) <= 0.0);
        assert!(metric(&format!("{key}.w.step{last}")) < metric(&format!("{key}.w.step0")));
        let euler = metric(&format!("{key}.euler_characteristic.step{last}"));
        assert!((euler - 2.0).abs() < 0.5, "{key}: {euler}");
        let frames = format!("out/{key}_frames.png");
        assert!(root.path().join(frames).exists());
    }
    let distance = |step: usize| metric(&format!("ball.distance.step{step}"));
    assert!(distance(5) < distance(1) && distance(1) < distance(0));
    // The distance of the tubes is that to their beginning, from which they move away.
    let distance = |step: usize| metric(&format!("tubes.distance.step{step}"));
    assert!(distance(0) <= 0.0 && distance(8) > distance(4) && distance(4) > distance(1));
    let many = ["--quick", "--extra-steps", "100"];
    refused(INPAINTING, root.path(), &many, &["--extra-steps 100", "24"]);
    let device = ["--quick", "--device", "abacus"];
    refused(INPAINTING, root.path(), &device, &["abacus"]);
}

#[test]
fn quick_spheres_keep_their_radius() {
    let root = tempfile::tempdir().unwrap();
    let summary = finished(
        SPHERES,
        root.path(),
        &["--quick", "--quiet", "--output", "out"],
    );
    let change = summary["spheres.r025.radius_change_over_h"];
    assert!(change.abs() < 0.25, "{change}");
}

#[test]
fn meshes_that_are_missing_or_not_closed() {
    let root = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(root.path().join(name), text).unwrap();
    for program in [ARMADILLO, ROCKER_ARM] {
        refused(
            program,
            root.path(),
            &["--quick"],
            &["scripts/fetch_meshes", "WORKBENCH_MESHES", "--procedural"],
        );
    }
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
    write(
        "open.obj",
        &format!("{vertices}f 1 3 2\nf 1 2 4\nf 2 3 4\n"),
    );
    write("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write("mesh.txt", "nothing");
    for (file, part) in [
        ("open.obj", "open"),
        ("nan.obj", "nan"),
        ("mesh.txt", "mesh.txt"),
        ("missing.ply", "missing.ply"),
    ] {
        let arguments = ["--quick", "--mesh", file];
        refused(ARMADILLO, root.path(), &arguments, &[part]);
        let arguments = ["--mesh", file, "--output", "s.npy"];
        refused(MESH_DISTANCE, root.path(), &arguments, &[part]);
    }
    write(
        "good.obj",
        &format!("{vertices}f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"),
    );
    let too_large = [
        "--mesh",
        "good.obj",
        "--side-length",
        "1.5",
        "--output",
        "s.npy",
    ];
    refused(MESH_DISTANCE, root.path(), &too_large, &["1.5", "fit"]);
    let unknown = ["--mesh", "good.obj", "--output", "s.raw"];
    refused(MESH_DISTANCE, root.path(), &unknown, &[".npy", ".vti"]);
}

/// A mesh says nothing about which way is up: its format has to, or the user.
#[test]
fn pictures_of_unknown_meshes_are_upright_by_format_or_by_option() {
    let root = tempfile::tempdir().unwrap();
    let path = |name: &str| root.path().join(name);
    fs::write(path("box.obj"), cuboid([2, 6, 3])).unwrap();
    surfaces::write(path("box.ply"), &surfaces::read(path("box.obj")).unwrap()).unwrap();
    let picture = |mesh: &str, up: &[&str]| {
        let quick = "--quick --quiet --cells 24 --steps 1 --scheme paper --output out --mesh";
        let arguments: Vec<&str> = quick.split(' ').chain([mesh]).chain(up.to_vec()).collect();
        let output = run(ARMADILLO, root.path(), &arguments);
        assert!(output.status.success(), "{output:?}");
        fs::read(path("out/pictures/armadillo_hybrid_step000.png")).unwrap()
    };
    let [x, y, z] = ["x", "y", "z"].map(|axis| picture("box.obj", &["--up", axis]));
    assert!(x != y && y != z && z != x);
    assert_eq!(picture("box.obj", &[]), y);
    assert_eq!(picture("box.ply", &[]), z);
    assert_eq!(picture("box.ply", &["--up", "x"]), x);
}

/// A box with these sides as an OBJ file.
fn cuboid([a, b, c]: [u32; 3]) -> String {
    let corners = [[0, 0], [a, 0], [a, b], [0, b]];
    let vertices = [0, c].map(|z| corners.map(|[x, y]| format!("v {x} {y} {z}\n")).concat());
    let faces = "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    vertices.concat() + faces
}

#[test]
fn the_distance_of_a_mesh_is_written_on_any_grid() {
    let root = tempfile::tempdir().unwrap();
    fs::write(root.path().join("cube.obj"), cuboid([2; 3])).unwrap();
    let arguments = [
        "--mesh",
        "cube.obj",
        "--cells",
        "20",
        "--side-length",
        "0.5",
        "--output",
        "s.npy",
        "--quiet",
    ];
    let output = run(MESH_DISTANCE, root.path(), &arguments);
    assert!(output.status.success() && output.stderr.is_empty());
    let grid = centred_box(20, 1.0).unwrap();
    let field: Field<3> = npy::read(root.path().join("s.npy"), |_| Ok(grid)).unwrap();
    let exact = geometry::shapes::Cuboid::new([0.25; 3])
        .unwrap()
        .translated([0.5; 3]);
    for (i, &value) in field.values().iter().enumerate() {
        let expected = geometry::SignedDistance::signed_distance(&exact, grid.node(i));
        assert!((value - expected).abs() < 1e-14, "{i}: {value} {expected}");
    }
}

#[test]
fn a_volume_flows_like_the_shape_it_was_made_from() {
    let root = tempfile::tempdir().unwrap();
    let u = blob(32);
    npy::write(root.path().join("u.npy"), &u).unwrap();
    let s = u.map(|u| geometry::distance_from_phase_field(u, scales(32).eps));
    npy::write(root.path().join("s.npy"), &s).unwrap();
    let common = ["--quick", "--quiet", "--output"];
    let w = |folder: &str, arguments: &[&str]| {
        let arguments = [&common[..], &[folder], arguments].concat();
        let output = run(ARMADILLO, root.path(), &arguments);
        assert!(output.status.success(), "{output:?}");
        read_summary(&root.path().join(folder))["armadillo.w.step2"]
    };
    let phase_field = w("a", &["--volume", "u.npy", "--volume-holds", "phase-field"]);
    let distance = w("b", &["--volume", "s.npy"]);
    assert!(
        (phase_field - distance).abs() < 1e-3 * distance,
        "{phase_field} {distance}"
    );
    let arguments = ["--cells", "24", "--volume", "u.npy"];
    refused(ARMADILLO, root.path(), &arguments, &["32", "24"]);
    let arguments = [
        "--quick",
        "--volume",
        "s.npy",
        "--volume-holds",
        "phase-field",
    ];
    let doubled = s.map(|s| 40.0 * s);
    npy::write(root.path().join("s.npy"), &doubled).unwrap();
    refused(ARMADILLO, root.path(), &arguments, &["signed distances"]);
}

fn flow(initial: &Field<3>, n: usize, steps: usize) -> (Field<3>, Vec<Record>) {
    let device = ComputeDevice::default_compiled().unwrap();
    let operator = Chosen::default().learned(Formulation::Paper, &needed_network());
    let (initial, operator) = (initial.clone(), operator.unwrap());
    let rule = StepRule::Constant(TAU);
    let case = Case::willmore("shape", initial, operator, scales(n), rule, steps);
    let mut run = Run::new(case, &device).unwrap();
    run.advance(None, &mut [], &Interrupt::never()).unwrap();
    (run.field().clone(), run.records().to_vec())
}

#[test]
fn spheres_have_the_energy_of_spheres_and_stay() {
    let n = 64;
    for radius in [0.15, 0.4] {
        let ball = Ball::new([0.5; 3], radius).unwrap();
        let initial = phase_field(centred_box(n, 1.0).unwrap(), &ball, scales(n).eps).unwrap();
        let w = fem::FiniteElementStep::implicit(initial.grid(), scales(n).eps, scales(n).mcf_step)
            .unwrap()
            .willmore_energy(&initial)
            .unwrap();
        let exact = 8.0 * std::f64::consts::PI;
        assert!((w / exact - 1.0).abs() < 0.03, "r = {radius}: w = {w}");
        let (last, records) = flow(&initial, n, 20);
        assert_eq!((records.len(), energy_increases(&records)), (20, 0));
        let radius_of = |u: &Field<3>| (0.75 * zero_set_volume(u) / std::f64::consts::PI).cbrt();
        let change = (radius_of(&last) - radius_of(&initial)) * n as f64;
        assert!(change.abs() < 0.25, "r = {radius}: {change} h");
    }
}

/// A shape without symmetry, small enough for shifts.
fn blob(n: usize) -> Field<3> {
    let arm = Capsule::new([0.3, 0.42, 0.45], [0.62, 0.5, 0.6], 0.12).unwrap();
    let shape = Ball::new([0.5, 0.6, 0.45], 0.17).unwrap().union(arm);
    phase_field(centred_box(n, 1.0).unwrap(), &shape, scales(n).eps).unwrap()
}

/// The field whose value at `i` is that of `u` at `from(i)`.
fn moved(u: &Field<3>, from: impl Fn([usize; 3]) -> [usize; 3]) -> Field<3> {
    let grid = *u.grid();
    let values = (0..grid.len())
        .map(|node| u.values()[grid.index(from(grid.multi_index(node)))])
        .collect();
    Field::from_values(grid, values).unwrap()
}

#[test]
fn moving_the_input_by_symmetries_of_the_grid_moves_the_result() {
    let n = 32;
    let u = blob(n);
    let (result, _) = flow(&u, n, 2);
    let motion = l2_distance(&u, &result).unwrap();
    let shift = |[i, j, k]: [usize; 3]| [i + 3, j + n - 5, k + 7];
    // A quarter turn about the first axis through the origin.
    let turn = |[i, j, k]: [usize; 3]| [i, (n - k) % n, j];
    let mirror = |[i, j, k]: [usize; 3]| [(n - i) % n, j, k];
    let check = |what: &str, from: &dyn Fn([usize; 3]) -> [usize; 3]| {
        let (other, _) = flow(&moved(&u, from), n, 2);
        let difference = l2_distance(&other, &moved(&result, from)).unwrap();
        assert!(
            difference < 0.01 * motion,
            "{what}: {difference} of {motion}"
        );
    };
    check("shift", &shift);
    check("turn", &turn);
    check("mirror", &mirror);
}

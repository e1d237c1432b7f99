//! The compiled programs: what they refuse, and their quick runs.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{Summary, finished, read_summary, refused, run};
use engine::{Record, Run};
use experiments::experiment::Experiment;
use experiments::networks::{Chosen, PAPERS};
use experiments::programs::EXPERIMENTS;
use experiments::segmentations::BODIES;
use experiments::timing;
use model::Shipped;
use operators::ComputeDevice;

const CALIBRATION: &str = "calibration";
const CIRCLES: &str = "circle_convergence";
const DENOISING: &str = "denoising";
const DIRECT_LEARNING: &str = "direct_learning";
const ELASTICA: &str = "elastica";
const INPAINTING: &str = "inpainting_2d";
const LEARNED: &str = "learned_networks";
const CROSS: &str = "cross";
const MCF_CROSS: &str = "mcf_cross";
const PERFORMANCE: &str = "performance";
const RECTANGLE: &str = "rectangle";
const TIMING: &str = "timing_tables";
const TRAIN: &str = "train_networks";
const UNSHRINKING: &str = "unshrinking";
const VESICLES: &str = "vesicles";

/// The experiments that have quick runs, with the options of those.
fn quick_runs() -> impl Iterator<Item = (&'static Experiment, Vec<&'static str>)> {
    EXPERIMENTS.iter().filter_map(|experiment| {
        let options = [&["--quick"], experiment.quick?].concat();
        Some((*experiment, options))
    })
}

#[test]
#[ignore = "the quick runs of all experiments: see scripts/test_long"]
fn every_quick_run_writes_its_figures_and_metrics_that_are_explained() {
    for (experiment, options) in quick_runs() {
        let root = tempfile::tempdir().unwrap();
        let options = [&options[..], &["--quiet", "--output", "out"]].concat();
        finished(experiment.name, root.path(), &options);
    }
}

#[test]
fn devices_that_are_unknown_or_not_compiled_in() {
    let root = tempfile::tempdir().unwrap();
    let kinds = operators::DeviceKind::ALL.into_iter();
    let not_compiled = kinds.filter(|kind| !kind.is_compiled());
    let names: Vec<_> = not_compiled.map(operators::DeviceKind::name).collect();
    for (experiment, options) in quick_runs() {
        for device in ["abacus"].iter().chain(&names) {
            let options = [&options[..], &["--device", device]].concat();
            refused(experiment.name, root.path(), &options, &[device]);
        }
    }
}

#[test]
fn weights_that_are_missing_damaged_or_of_another_run() {
    let root = tempfile::tempdir().unwrap();
    let networks = Shipped::Paper.all().unwrap();
    let with_width = |width: usize| {
        let mut all = networks.iter().map(|(_, network)| network);
        all.find(|network| network.ratios().dimension == 2 && network.ratios().width == width)
            .unwrap()
    };
    let good = with_width(17).to_bytes().unwrap();
    let write = |name: &str, data: &[u8]| fs::write(root.path().join(name), data).unwrap();
    write("truncated.safetensors", &good[..good.len() - 100]);
    write("empty.safetensors", &[]);
    let mut flipped = good.clone();
    // A bit of the length of the header.
    flipped[2] ^= 0x40;
    write("flipped.safetensors", &flipped);
    let mut nan = good.clone();
    let end = nan.len();
    nan[end - 8..].copy_from_slice(&f64::NAN.to_le_bytes());
    write("nan.safetensors", &nan);
    write("other.safetensors", &with_width(33).to_bytes().unwrap());
    for program in [CIRCLES, LEARNED] {
        let name = "missing.safetensors";
        refused(
            program,
            root.path(),
            &["--quick", "--network", name],
            &[name],
        );
        for name in ["truncated", "empty", "flipped", "nan"] {
            let file = format!("{name}.safetensors");
            refused(
                program,
                root.path(),
                &["--quick", "--network", &file],
                &[&file],
            );
        }
        let arguments = ["--quick", "--network", "other.safetensors"];
        refused(program, root.path(), &arguments, &["n_K = 33", "n_K = 17"]);
    }
    // The accurate recipe has always the shipped ones.
    let unused: &[&str] = &["--network", "other.safetensors"];
    refused(VESICLES, root.path(), unused, &["leave it out"]);
    let accurate = [unused, &["--scheme", "accurate"]].concat();
    refused(CIRCLES, root.path(), &accurate, &["leave it out"]);
}

#[test]
fn resolutions_names_and_outputs_that_cannot_be() {
    let root = tempfile::tempdir().unwrap();
    refused(
        CIRCLES,
        root.path(),
        &["--cells", "100"],
        &["100", "multiple of 16"],
    );
    for count in ["0", "31"] {
        refused(CIRCLES, root.path(), &["--circles", count], &["1 to 30"]);
    }
    // No network was trained for this one.
    refused(CIRCLES, root.path(), &["--cells", "192"], &["n_K = 25"]);
    for name in ["n128", "mcf.n77"] {
        let without = ["--quick", "--without", name];
        refused(CIRCLES, root.path(), &without, &[name, "nothing"]);
    }
    // The cross has no variants of the other flow.
    let without = ["--quick", "--without", "mcf.n128"];
    refused("cross", root.path(), &without, &["mcf.n128", "nothing"]);
    refused(TRAIN, root.path(), &["--only", "n2048"], &["n2048", "n128"]);
    for program in [CROSS, MCF_CROSS, RECTANGLE] {
        refused(
            program,
            root.path(),
            &["--cells", "128,256", "--reference-n", "384"],
            &["384", "multiple", "256"],
        );
        refused(program, root.path(), &["--steps", "0"], &["--steps"]);
    }
    refused(TIMING, root.path(), &["--budget", "0"], &["--budget"]);
    fs::write(root.path().join("results"), "a file of the user").unwrap();
    for (experiment, options) in quick_runs() {
        let program = experiment.name;
        refused(program, root.path(), &options, &["results"]);
        let options = [&options[..], &["--output", "results"]].concat();
        refused(program, root.path(), &options, &["results"]);
    }
}

#[test]
#[ignore = "a whole quick run: see scripts/test_long"]
fn the_quick_convergence_test_is_accurate_and_reproducible() {
    let root = tempfile::tempdir().unwrap();
    let results: Vec<PathBuf> = ["first", "second"]
        .iter()
        .map(|name| {
            let output = run(CIRCLES, root.path(), &["--quick", "--output", name]);
            let message = String::from_utf8(output.stderr).unwrap();
            assert!(output.status.success() && message.is_empty(), "{message}");
            assert!(
                String::from_utf8(output.stdout)
                    .unwrap()
                    .contains("quick run")
            );
            root.path().join(name)
        })
        .collect();
    let read = |folder: &Path, name: &str| fs::read_to_string(folder.join(name)).unwrap();

    for name in ["convergence", "error_over_radius", "work_per_step"] {
        assert!(read(&results[0], &format!("{name}.svg")).contains("quick run"));
        assert!(results[0].join(format!("{name}.png")).exists());
    }
    for name in ["curves.csv", "steps.csv", "errors.md"] {
        assert!(results[0].join(name).exists(), "{name}");
    }
    assert!(!results[0].join("partial").exists());
    assert!(read(&results[0], "manifest.json").contains("\"quick\": true"));

    let summary = read_summary(&results[0]);
    let metric = |name: &str| {
        *summary
            .get(name)
            .unwrap_or_else(|| panic!("no metric {name}"))
    };
    assert!(metric("mcf.n128.hybrid.l2.step1") > 0.0);
    assert!(metric("mcf.n128.hybrid.l2.step8") <= 0.0008);
    assert!(metric("willmore.n128.hybrid.l2.step8") <= 0.021);
    assert!(metric("willmore.n128.hybrid.energy_increases") <= 0.0);
    assert!(metric("willmore.n128.hybrid_calibrated.l2.step8") <= 0.0025);
    assert!(metric("willmore.n128.hybrid_calibrated.energy_increases") <= 0.0);
    assert!(!summary.contains_key("mcf.n128.hybrid_calibrated.l2.step8"));
    assert!(metric("willmore.n128.hybrid.hvp_per_step") >= 1.0);
    assert!(metric("willmore.n128.hybrid.newton_per_step") >= 1.0);
    assert!(metric("willmore.scale") > 5.0 * metric("mcf.n128.hybrid.l2.step8"));
    reproduced(&results[0], &results[1]);
}

/// All but the wall times is the same: the last column of the steps, the lines of seconds in the summary.
fn reproduced(first: &Path, second: &Path) {
    let read = |folder: &Path, name: &str| fs::read_to_string(folder.join(name)).unwrap();
    for name in ["curves.csv", "circles.csv", "errors.csv", "convergence.svg"] {
        assert_eq!(read(first, name), read(second, name), "{name}");
    }
    let without_times = |folder: &Path, name: &str, end: &str| -> Vec<String> {
        let cut = |line: &str| {
            line.rsplit_once(end)
                .map_or(line, |(rest, _)| rest)
                .to_owned()
        };
        read(folder, name).lines().map(cut).collect()
    };
    for (name, end) in [("steps.csv", ","), ("summary.json", "seconds")] {
        let lines = without_times(first, name, end);
        assert!(lines.len() > 5);
        assert_eq!(lines, without_times(second, name, end), "{name}");
    }
}

/// The sample of the quick runs: one circle, which grows from the smallest radius.
#[test]
fn one_circle_is_accurate_and_reproducible_and_not_computed_again() {
    let root = tempfile::tempdir().unwrap();
    let arguments = |folder: &'static str| {
        [
            "--quick",
            "--quiet",
            "--circles",
            "1",
            "--methods",
            "hybrid",
            "--output",
            folder,
        ]
    };
    let runs = ["first", "second"].map(|folder| {
        let output = run(CIRCLES, root.path(), &arguments(folder));
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success() && message.is_empty(), "{message}");
        root.path().join(folder)
    });
    reproduced(&runs[0], &runs[1]);
    let summary = read_summary(&runs[0]);
    let error = |scheme: &str| summary[&format!("willmore.n128.hybrid{scheme}.l2.step8")];
    assert!(
        error("_accurate") < 0.004 && error("_calibrated") < 0.004,
        "{summary:?}"
    );
    assert!(
        error("") < 0.03 && error("") > error("_calibrated"),
        "{summary:?}"
    );
    // The wall times of the first run can only come back from its stored parts, which a failure at the end leaves.
    let again = root.path().join("again");
    fs::create_dir_all(again.join("errors.md")).unwrap();
    let failed = run(CIRCLES, root.path(), &arguments("again"));
    assert_eq!(failed.status.code(), Some(2));
    let steps = fs::read(again.join("steps.csv")).unwrap();
    fs::remove_dir(again.join("errors.md")).unwrap();
    assert!(
        run(CIRCLES, root.path(), &arguments("again"))
            .status
            .success()
    );
    assert_eq!(fs::read(again.join("steps.csv")).unwrap(), steps);
    assert!(!again.join("partial").exists());
}

#[test]
#[ignore = "a whole quick run: see scripts/test_long"]
fn one_scheme_alone_gives_the_same_numbers() {
    let root = tempfile::tempdir().unwrap();
    let summary = |options: &[&str], folder: &str| {
        let mut arguments = vec!["--quick", "--quiet", "--output", folder];
        arguments.extend(options);
        assert!(run(CIRCLES, root.path(), &arguments).status.success());
        read_summary(&root.path().join(folder))
    };
    let both = summary(&["--methods", "hybrid"], "both");
    for (scheme, own, other) in [
        ("paper", "hybrid", "hybrid_calibrated"),
        ("calibrated", "hybrid_calibrated", "hybrid"),
    ] {
        let one = summary(&["--methods", "hybrid", "--scheme", scheme], scheme);
        let key = |name: &str| format!("willmore.n128.{name}.l2.step8");
        let bits = |summary: &Summary| summary[&key(own)].to_bits();
        assert_eq!(bits(&one), bits(&both), "{scheme}");
        assert!(!one.contains_key(&key(other)), "{scheme}");
    }
}

#[test]
#[ignore = "a whole quick run: see scripts/test_long"]
fn the_quick_calibration_predicts_the_energies_and_installs_the_network() {
    let root = tempfile::tempdir().unwrap();
    let arguments = ["--quick", "--output", "out", "--install", "networks"];
    let output = run(CALIBRATION, root.path(), &arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && message.is_empty(), "{message}");
    let folder = root.path().join("out");
    for name in ["calibration.md", "discs.svg", "discs.csv", "manifest.json"] {
        assert!(folder.join(name).exists(), "{name}");
    }
    let summary = read_summary(&folder);
    let c = summary["d2_k17_eps2_step1.energy"];
    assert!((c - 0.932).abs() < 0.002, "{c}");
    let discs = fs::read_to_string(folder.join("discs.csv")).unwrap();
    let mut discs = discs.lines().map(|line| line.split(','));
    let names: Vec<&str> = discs.next().unwrap().collect();
    let discs: Vec<BTreeMap<_, _>> = discs
        .map(|row| names.iter().copied().zip(row).collect())
        .collect();
    assert_eq!(discs.len(), 8);
    for disc in &discs {
        let number = |name: &str| disc[name].parse::<f64>().unwrap();
        let ratio = number("w R/π") / number("predicted");
        assert!((ratio - 1.0).abs() < 0.008, "{disc:?}");
        if disc["F"] == "odd part" {
            assert!((number("calibrated w R/π") - 1.0).abs() < 0.01, "{disc:?}");
        }
    }
    let name = "networks/d2_k17_eps2_step1.safetensors";
    let installed = model::Network::load(&root.path().join(name)).unwrap();
    assert!(installed.calibration.is_some());
    refused(
        CALIBRATION,
        root.path(),
        &["--quick", "--network", "missing.safetensors"],
        &["missing.safetensors"],
    );
}

#[test]
#[ignore = "two whole quick runs: see scripts/test_long"]
fn the_quick_learning_teaches_what_it_is_given_and_is_reproducible() {
    let runs = ["first", "second"].map(|name| {
        let root = tempfile::tempdir().unwrap();
        let arguments = ["--quick", "--quiet", "--output", "out"];
        let summary = finished(DIRECT_LEARNING, root.path(), &arguments);
        let file = |name: &str| fs::read_to_string(root.path().join("out").join(name)).unwrap();
        let files = ["errors.csv", "rollouts.csv", "multipliers.svg"].map(file);
        assert!(files.iter().all(|text| text.lines().count() > 1), "{name}");
        (summary, files)
    });
    assert_eq!(runs[0].1, runs[1].1);
    let summary = &runs[0].0;
    for network in ["curvature", "geometry", "filters"] {
        let loss = |end: &str| summary[&format!("{network}.loss_{end}")];
        assert!(loss("after") < 0.5 * loss("before"), "{network}");
    }
    let circles = |network: &str| summary[&format!("training_circles.tau0.001.{network}.rms")];
    assert!(circles("curvature") < 0.2 * circles("derived"));
    // A derived step is near to the flow, and its small waves do not grow.
    assert!(summary["ellipse.tau0.001.derived.rms"] < 0.1);
    assert!(summary["derived.multiplier"] < 1.0 && summary["derived.fast_multiplier"] > 0.5);
}

#[test]
#[ignore = "a whole quick run: see scripts/test_long"]
fn the_quick_inpainting_changes_nothing_outside() {
    let root = tempfile::tempdir().unwrap();
    let output = run(INPAINTING, root.path(), &["--quick", "--output", "out"]);
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && message.is_empty(), "{message}");
    let folder = root.path().join("out");
    for name in [
        "disk_frames.svg",
        "cross_frames.png",
        "energies.svg",
        "steps.csv",
        "manifest.json",
    ] {
        assert!(folder.join(name).exists(), "{name}");
    }
    let summary = read_summary(&folder);
    for picture in ["disk", "cross"] {
        let metric = |name: &str| summary[&format!("{picture}.{name}")];
        assert!(metric("changed_outside") <= 0.0);
        assert!(metric("energy_increases") <= 0.0);
    }
    // Round again, and the rest of the steps is not made.
    assert!(summary["disk.distance.step0"] > 0.2);
    assert!(summary["disk.distance.step1"] < 0.02);
    assert!(summary["disk.still_from"] < 5.0);
    assert!(summary["disk.parts_of_step1"] > 4.0);
    // As printed, tautilde is beyond what the scheme allows at the paper's resolution.
    refused(
        INPAINTING,
        root.path(),
        &["--printed-tautilde", "--cells", "1024"],
        &["tautilde"],
    );
}

#[test]
#[ignore = "a whole quick run: see scripts/test_long"]
fn the_accurate_recipe_trains_a_network() {
    let root = tempfile::tempdir().unwrap();
    let arguments = [
        "--quick", "--recipe", "accurate", "--only", "n64", "--output", "out",
    ];
    let output = run(TRAIN, root.path(), &arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && message.is_empty(), "{message}");
    let name = "out/networks/accurate_d2_k9_eps1_step0.25.safetensors";
    let network = model::Network::load(&root.path().join(name)).unwrap();
    assert!(network.provenance.recipe.contains("least squares"));
    let paper = ["--quick", "--only", "n64"];
    refused(TRAIN, root.path(), &paper, &["n64", "n128"]);
}

#[test]
#[ignore = "a whole quick run: see scripts/test_long"]
fn finished_circles_are_not_computed_again() {
    let root = tempfile::tempdir().unwrap();
    let arguments = ["--quick", "--quiet", "--output", "out"];
    assert!(run(CIRCLES, root.path(), &arguments).status.success());
    let reference = fs::read(root.path().join("out/steps.csv")).unwrap();
    // The wall times of the first run can only come back from its stored parts, which a failure at the end leaves.
    let again = tempfile::tempdir().unwrap();
    fs::create_dir_all(again.path().join("out/errors.md")).unwrap();
    assert_eq!(
        run(CIRCLES, again.path(), &arguments).status.code(),
        Some(2)
    );
    assert!(again.path().join("out/partial").exists());
    let first = fs::read(again.path().join("out/steps.csv")).unwrap();
    fs::remove_dir(again.path().join("out/errors.md")).unwrap();
    assert!(run(CIRCLES, again.path(), &arguments).status.success());
    let second = fs::read(again.path().join("out/steps.csv")).unwrap();
    assert!(first == second && first != reference);
    assert!(!again.path().join("out/partial").exists());
}

/// Mean curvature flow of the cross: the methods agree on the shape to a small part of the interface width.
#[test]
#[ignore = "a whole quick run: see scripts/test_long"]
fn the_quick_cross_compares_all_methods() {
    let root = tempfile::tempdir().unwrap();
    let arguments = ["--quick", "--quiet", "--output", "out"];
    let output = run(MCF_CROSS, root.path(), &arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && message.is_empty(), "{message}");
    let folder = root.path().join("out");
    for name in ["errors", "shapes"] {
        let text = fs::read_to_string(folder.join(format!("{name}.svg"))).unwrap();
        assert!(text.contains("quick run"));
    }
    for name in ["error_table.md", "errors.csv", "steps.csv", "manifest.json"] {
        assert!(folder.join(name).exists(), "{name}");
    }
    let summary = read_summary(&folder);
    let metric = |name: &str| *summary.get(name).unwrap_or_else(|| panic!("no {name}"));
    for method in ["hybrid", "fe_implicit", "fe_semi"] {
        let key = format!("mcf_cross.n128.{method}");
        assert!(metric(&format!("{key}.l2.step0")) <= 0.0);
        let error = metric(&format!("{key}.l2.step2"));
        assert!(error > 0.0 && error < 0.01, "{method}: {error}");
        let tip = metric(&format!("{key}.tip.step2"));
        assert!((tip - 0.8).abs() < 0.01, "{tip}");
        assert!(
            metric(&format!("{key}.perimeter.step2")) < metric(&format!("{key}.perimeter.step0"))
        );
    }
    // A second run finds everything and gives the same bytes.
    let before = fs::read(folder.join("errors.csv")).unwrap();
    let steps = fs::read(folder.join("steps.csv")).unwrap();
    assert!(run(MCF_CROSS, root.path(), &arguments).status.success());
    assert_eq!(fs::read(folder.join("errors.csv")).unwrap(), before);
    assert_eq!(fs::read(folder.join("steps.csv")).unwrap(), steps);
}

#[test]
#[ignore = "a whole quick run: see scripts/test_long"]
fn the_quick_timing_table_has_a_row_for_every_method() {
    let root = tempfile::tempdir().unwrap();
    let output = run(
        TIMING,
        root.path(),
        &["--quick", "--quiet", "--procedural", "--output", "out"],
    );
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && message.is_empty(), "{message}");
    let table = fs::read_to_string(root.path().join("out/timing.md")).unwrap();
    assert!(table.contains("extrapolated from") && table.contains("FE implicit, Cholesky inside"));
    let summary = read_summary(&root.path().join("out"));
    // Wall times are whatever the machine makes of them; the work is not.
    let metric = |key: &str| summary[&format!("timing.{key}")];
    for row in ["hybrid", "fe_implicit", "fe_semi"] {
        let steps = metric(&format!("n128.{row}.measured_steps"));
        assert!((3.0..128.0).contains(&steps), "{row}: {steps}");
        let (newton, hvp) = (
            metric(&format!("n128.{row}.newton_per_step")),
            metric(&format!("n128.{row}.hvp_per_step")),
        );
        assert!(newton >= 1.0 && hvp >= newton, "{row}: {newton}, {hvp}");
    }
    assert!(metric("n128.hybrid.inner_cg_per_step") <= 0.0);
    assert!(metric("n128.fe_implicit_direct.inner_cg_per_step") <= 0.0);
    assert!(metric("n128.fe_implicit.inner_cg_per_step") > metric("n128.fe_implicit.hvp_per_step"));
    let seconds = fs::read_to_string(root.path().join("out/timing.json")).unwrap();
    let rows: Vec<serde_json::Value> = serde_json::from_str(&seconds).unwrap();
    assert_eq!(rows.len(), 5);
    for row in &rows {
        let number = |name: &str| row["numbers"][name].as_f64().unwrap();
        assert!(number("seconds") >= number("measured_seconds"), "{row}");
    }
    assert!(metric("armadillo.hybrid.hvp") >= 1.0 && metric("armadillo.fe_implicit.hvp") >= 1.0);
}

#[test]
fn an_elastic_curve_keeps_its_length_and_area_and_has_the_exact_energy() {
    let root = tempfile::tempdir().unwrap();
    let summary = quick_summary(ELASTICA, root.path());
    let metric = |name: &str| summary[&format!("elastica.q0.95.{name}")];
    let close = |name: &str, exact: &str, tolerance: f64| {
        let (value, exact) = (metric(name), metric(exact));
        assert!(
            (value / exact - 1.0).abs() < tolerance,
            "{name}: {value}, exact {exact}"
        );
    };
    close("w_over_circle", "exact", 1e-3);
    close("tension", "exact_tension", 0.02);
    close("pressure", "exact_pressure", 0.02);
    assert!(metric("length_drift") < 1e-9 && metric("area_drift") < 1e-9);
}

#[test]
#[ignore = "a whole quick run: see scripts/test_long"]
fn the_quick_vesicle_keeps_its_area_and_volume() {
    let root = tempfile::tempdir().unwrap();
    let summary = quick_summary(VESICLES, root.path());
    assert!(summary["vesicles.prolate.v0.95.w_over_8pi"] < 1.3);
}

/// The metrics of a quick run into the folder `out`.
fn quick_summary(program: &str, root: &Path) -> Summary {
    finished(program, root, &["--quick", "--quiet", "--output", "out"])
}

#[test]
#[ignore = "a whole quick run: see scripts/test_long"]
fn the_quick_denoising_takes_off_noise_and_keeps_the_volume() {
    let root = tempfile::tempdir().unwrap();
    let summary = quick_summary(DENOISING, root.path());
    for mesh in ["figure", "lever"] {
        let metric = |name: &str| summary[&format!("{mesh}.noise0.3.{name}")];
        assert!(
            metric("fair.rms") < 0.5 * metric("noisy.rms"),
            "{summary:?}"
        );
        assert!(
            metric("fair.normals") < 0.5 * metric("noisy.normals"),
            "{summary:?}"
        );
        assert!(
            (metric("fair.volume") - metric("noisy.volume")).abs() < 1e-6,
            "{summary:?}"
        );
    }
}

#[test]
#[ignore = "a whole quick run: see scripts/test_long"]
fn the_quick_segmentations_keep_their_volume() {
    let root = tempfile::tempdir().unwrap();
    let summary = quick_summary(UNSHRINKING, root.path());
    for (body, _) in BODIES {
        let metric = |name: &str| summary[&format!("unshrinking.{body}.{name}")];
        assert!(metric("fair.volume").abs() < 0.5, "{summary:?}");
        let [fair, voxels] = ["fair.normals", "voxels.normals"].map(metric);
        assert!(fair < voxels, "{summary:?}");
    }
    let metric = |name: &str| summary[&format!("unshrinking.sectors.fair.{name}")];
    assert_eq!(
        [metric("gaps"), metric("overlaps")].map(f64::to_bits),
        [0; 2]
    );
}

#[test]
#[ignore = "a whole quick run: see scripts/test_long"]
fn the_quick_performance_run_measures_planes_and_solids() {
    let root = tempfile::tempdir().unwrap();
    refused(PERFORMANCE, root.path(), &["--turns", "0"], &["--turns"]);
    let summary = quick_summary(PERFORMANCE, root.path());
    let metric = |name: &str| summary[name];
    // The work is that of the same flow by the library.
    let operator = Chosen::default().operator(PAPERS, 128).unwrap();
    let case = timing::plane(&operator, 128, 2, true).unwrap();
    let mut flow = Run::new(case, &ComputeDevice::default_compiled().unwrap()).unwrap();
    while flow.step().unwrap().is_some() {}
    let hvp = flow.records().iter().filter_map(Record::hvp).sum::<f64>() / 2.0;
    assert!((metric("disc.n128.hvp_per_step") - hvp).abs() < 1e-12);
    let distance = metric("disc.n128.distance_to_tighter");
    assert!(distance > 0.0 && distance < 0.02, "{distance}");
    let all = fs::read_to_string(root.path().join("out/performance.json")).unwrap();
    let all: Vec<serde_json::Value> = serde_json::from_str(&all).unwrap();
    let grids = [vec![96; 2], vec![24; 3], vec![32; 3]];
    assert_eq!(all.len(), grids.len());
    for (row, grid) in all.iter().zip(grids) {
        assert_eq!(row["cells"], serde_json::json!(grid));
        let steps = |name: &str| row["steps"][name].as_f64().unwrap();
        assert!(steps("hvp_per_step") >= 1.0);
        // No part is negative, and together they are the whole.
        let parts = row["parts"].as_array().unwrap().iter();
        let parts: Vec<f64> = parts.map(|part| part[1].as_f64().unwrap()).collect();
        let (sum, mean) = (parts.iter().sum::<f64>(), steps("seconds") / steps("steps"));
        assert!(
            parts.iter().all(|part| *part >= 0.0) && (sum / mean - 1.0).abs() < 1e-9,
            "{row}"
        );
    }
    let table = fs::read_to_string(root.path().join("out/steps.md")).unwrap();
    assert!(table.contains("cube, n = 24"));
    // Both storages make the same flow.
    for n in [32, 64] {
        let [dense, bricks] = ["dense", "bricks"].map(|storage| {
            let name = |name: &str| metric(&format!("armadillo.n{n}.{storage}.{name}"));
            let share = name("active_cells") / f64::from(n).powi(3);
            assert!(share < 1.0 || storage == "dense" || n == 32, "{n}: {share}");
            assert!(share <= 1.0 && (name("active_share") - share).abs() < 1e-12);
            (name("w"), name("hvp_per_step"))
        });
        assert!((dense.0 / bricks.0 - 1.0).abs() < 1e-5 && dense.1 > 0.0 && bricks.1 > 0.0);
    }
    let ms = |storage: &str| metric(&format!("armadillo.n64.{storage}.ms_per_product"));
    let ratio = metric("hvp.armadillo.n64.bricks_over_dense");
    assert!((ratio * ms("dense") / ms("bricks") - 1.0).abs() < 1e-12);
    // The parts of the time of each flow, and of `fair`, are the whole.
    let apart = tempfile::tempdir().unwrap();
    let shares = ["--quick", "--quiet", "--shares", "--output", "out"];
    assert!(run(PERFORMANCE, apart.path(), &shares).status.success());
    let shares = read_summary(&apart.path().join("out"));
    let mut sums: BTreeMap<&str, f64> = BTreeMap::new();
    for (name, share) in &shares {
        match name.split_once(".share.") {
            Some((case, part)) if part != "new_pages" => *sums.entry(case).or_default() += share,
            _ => {}
        }
    }
    assert!(sums.len() > 2, "{shares:?}");
    assert!(
        sums.values().all(|sum| (sum - 1.0).abs() < 1e-9),
        "{sums:?}"
    );
    let odd = ["--surface-cells", "100"];
    refused(PERFORMANCE, root.path(), &odd, &["multiples of 8"]);
}

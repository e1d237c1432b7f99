//! The library makes the same bytes as the program with the same choices: the examples of `willmore`.
#![allow(dead_code)] // `main` of an example takes files from the command line, which is that of the tests here

use std::fs;
use std::path::Path;

use jobs::{CheckOptions, Refusal, TrainOptions};
use willmore::prelude::*;

use crate::common::outcome;

#[path = "../../willmore/examples/fair.rs"]
mod fair;
#[path = "../../willmore/examples/flow_with_frames.rs"]
mod flow_with_frames;
#[path = "../../willmore/examples/inpaint.rs"]
mod inpaint;
#[path = "../../willmore/examples/segmentation.rs"]
mod segmentation;
#[path = "../../willmore/examples/vesicle.rs"]
mod vesicle;

/// Runs the program with these arguments, separated by blanks.
fn program(folder: &Path, arguments: &str) -> serde_json::Value {
    let arguments: Vec<&str> = arguments.split_whitespace().collect();
    outcome(folder, &arguments)
}

#[test]
fn fair_is_that_of_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    program(
        folder.path(),
        "sample builtin:lever --cells 40 --noise 0.005 --save scan.obj",
    );
    let moved = fair::take_off_noise(&at("scan.obj"), &at("smooth.obj")).unwrap();
    let made = program(
        folder.path(),
        "fair scan.obj --cells 48 --no-page --output run --save same.obj",
    );
    assert!(fs::read(at("smooth.obj")).unwrap() == fs::read(at("same.obj")).unwrap());
    assert!(
        moved > 0.0 && made["mesh"]["displacement_rms"] == moved,
        "{made}"
    );
}

#[test]
fn surfaces_of_labels_are_those_of_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let organs = segmentation::organs().unwrap();
    volumes::write(at("organs.nii"), &organs).unwrap();
    let surfaces = segmentation::smooth_surfaces(Input::volume("organs", organs)).unwrap();
    let labels: Vec<i64> = surfaces.iter().map(|surface| surface.label).collect();
    assert_eq!(labels, [1, 2]);
    let all = "fair organs.nii --label all --cells 32 --no-page --output run --save organ.ply";
    let status = crate::common::program(folder.path())
        .args(all.split(' '))
        .status();
    assert!(status.unwrap().success());
    for LabelSurface { label, made } in surfaces {
        let of_program = fs::read(at(&format!("organ-label{label}.ply"))).unwrap();
        assert!(made.shape.unwrap().encode("ply").unwrap() == of_program);
    }
}

#[test]
fn a_vesicle_is_that_of_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let results = vesicle::vesicle().unwrap();
    program(
        folder.path(),
        "flow builtin:coin --reduced-volume 0.8 --ramp 3 --tau 1e-5 --cells 40 --box-side 1.2 --side-length 0.7 --steps 3 --no-page \
         --output run --save vesicle.ply",
    );
    let mesh = fs::read(folder.path().join("vesicle.ply")).unwrap();
    assert!(results.shape().unwrap().encode("ply").unwrap() == mesh);
    // The summary is that of the folder, with the same digits.
    let summary = fs::read(folder.path().join("run/summary.json")).unwrap();
    let summary: Summary = serde_json::from_slice(&summary).unwrap();
    assert_eq!(summary.to_json(), results.summary().to_json());
}

#[test]
fn inpainting_is_that_of_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    program(
        folder.path(),
        "sample builtin:ring --cells 32 --without ball:0.52,0.3,0.14 --save ring.png",
    );
    let mask = "ball:389,333,60";
    inpaint::fill(&at("ring.png"), mask, &at("filled.png")).unwrap();
    let same = format!(
        "inpaint ring.png --mask {mask} --cells 32 --steps 6 --no-page --output run --save same.png"
    );
    program(folder.path(), &same);
    assert!(fs::read(at("filled.png")).unwrap() == fs::read(at("same.png")).unwrap());
}

#[test]
fn a_run_with_frames_is_that_of_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let outcome = flow_with_frames::run(&at("library")).unwrap();
    assert!(outcome.summary.is_some() && outcome.page.is_some());
    program(
        folder.path(),
        "flow builtin:cross --cells 32 --steps 4 --frames 2 --output program",
    );
    let [library, program] = ["library", "program"].map(|run| crate::common::files(&at(run)));
    assert_eq!(
        library.keys().collect::<Vec<_>>(),
        program.keys().collect::<Vec<_>>()
    );
    for (name, bytes) in &program {
        // Records in checkpoints have wall times.
        if name.extension().is_none_or(|extension| extension != "ckpt") {
            assert!(library[name] == *bytes, "{} differs", name.display());
        }
    }
}

#[test]
fn checks_are_those_of_the_program() {
    let mut options = CheckOptions::of("builtin:cross");
    options.input.cells = Some(32);
    let checked = jobs::check(options, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let printed = program(folder.path(), "check builtin:cross --cells 32");
    assert_eq!(printed["device"], checked.device.name());
    let printed = printed["checks"].as_array().unwrap();
    assert_eq!(printed.len(), checked.findings.len());
    for (printed, finding) in printed.iter().zip(&checked.findings) {
        assert_eq!(printed["name"], finding.check.name());
        assert_eq!(printed["found"].as_f64(), finding.found);
        assert!(finding.passed && printed["passed"] == true, "{finding}");
    }
}

#[test]
fn refusals_carry_their_numbers() {
    let mut options = FlowOptions::of("builtin:disc");
    options.willmore.ramp = Some(3);
    let refused = flow(options, &Silent);
    assert!(matches!(refused, Err(JobError::Refused(Refusal::Ramp(3)))));
    let mut options = FairOptions::of("builtin:sphere");
    options.energy_ratio = Some(2.0);
    let refused = fair(options, &Silent);
    assert!(matches!(
        refused,
        Err(JobError::Refused(Refusal::EnergyRatio(2.0)))
    ));
    let refused = jobs::train(TrainOptions::default(), &Silent);
    assert!(matches!(
        refused,
        Err(JobError::Refused(Refusal::TrainNeeds {
            option: "eps_over_h"
        }))
    ));
}

//! The cross under mean curvature flow.

use std::process::ExitCode;

use clap::Parser;
use experiments::circles::Flow;
use experiments::comparison::{self, ComparisonOptions, Setting};
use experiments::harness;

const SETTING: Setting = Setting {
    program: "mcf_cross",
    key: "mcf_cross",
    title: "Mean curvature flow of a cross",
    shape: "cross [-.8,.8] x [-.27,.27]",
    initial: comparison::cross,
    flow: Flow::MeanCurvature,
    side: 2.0,
    steps: 128,
    shown: &[0, 64, 128],
    reference_ratio: 4,
    window: 0.95,
};

/// Mean curvature flow of a non-convex cross, eps = 2^-6, tautilde = 2^-14, until t = 2^-7, by all methods and resolutions:
/// L2 distance to a finer implicit finite-element run with time step 2^-16, and the shapes.
///
/// Runs are kept in the folder `fields` of the output; an interrupted one continues.
#[derive(Parser, Debug)]
#[command(name = SETTING.program, version)]
struct Options {
    #[command(flatten)]
    comparison: ComparisonOptions,
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| comparison::run(&SETTING, &options.comparison))
}

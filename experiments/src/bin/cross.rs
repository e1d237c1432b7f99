//! The cross under Willmore flow.

use std::process::ExitCode;

use clap::Parser;
use experiments::circles::Flow;
use experiments::comparison::{self, ComparisonOptions, Setting};
use experiments::harness;

const SETTING: Setting = Setting {
    program: "cross",
    key: "cross",
    title: "Willmore flow of a cross",
    shape: "cross [-.8,.8] x [-.27,.27]",
    initial: comparison::cross,
    flow: Flow::Willmore,
    side: 2.0,
    steps: 128,
    shown: &[0, 32, 64, 96, 128],
    reference_ratio: 1,
    window: 0.95,
};

/// Willmore flow of a non-convex cross, eps = 2^-6, tau = tautilde = 2^-14, until t = 2^-7, by all methods and resolutions:
/// L2 distance to a finer implicit finite-element run over time, and the shapes.
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

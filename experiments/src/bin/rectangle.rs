//! The rectangle under Willmore flow.

use std::process::ExitCode;

use clap::Parser;
use experiments::circles::Flow;
use experiments::comparison::{self, ComparisonOptions, Setting};
use experiments::{Error, harness};
use geometry::shapes::Cuboid;
use geometry::{Field, Grid, phase_field};

const SETTING: Setting = Setting {
    program: "rectangle",
    key: "rectangle",
    title: "Willmore flow of a rectangle",
    shape: "rectangle 0.4 x 0.2",
    initial: rectangle,
    flow: Flow::Willmore,
    // The shape ends within 0.36 of the origin; the profile's tails are below 1e-12 at the boundary.
    side: 1.5,
    steps: 128,
    shown: &[0, 32, 64, 96, 128],
    reference_ratio: 1,
    window: 0.5,
};

fn rectangle(grid: Grid<2>, eps: f64) -> Result<Field<2>, Error> {
    Ok(phase_field(grid, &Cuboid::new([0.2, 0.1])?, eps)?)
}

/// Willmore flow of a rectangle with sides 0.4 and 0.2, eps = 2^-6, tau = tautilde = 2^-14, until t = 2^-7, by all methods and
/// resolutions: L2 distance to a finer implicit finite-element run over time, and the shapes.
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

//! Willmore flow of an ellipse, which becomes a circle and grows.

use engine::{Case, ErrorControl, Formulation, Measure, Operator, Run, Scales, Stop, TimeSteps};
use geometry::{Grid, ZeroSet, phase_field, shapes::Ellipse};
use model::Networks;
use operators::ComputeDevice;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let grid = Grid::<2>::per_unit(64, 1.25)?;
    let scales = Scales::of_grid(grid.spacing(), 2.0);
    let needed = scales.needs(2, grid.spacing());
    let network = Networks::default().find(Formulation::Accurate.shipped(), &needed)?;
    let initial = phase_field(grid, &Ellipse::new([0.3, 0.2])?, scales.eps)?;
    let operator = Operator::learned(Formulation::Accurate, network)?;
    let steps = TimeSteps::controlled(ErrorControl::default());
    let case = Case {
        stops: vec![Stop::Time(0.002)],
        measures: Measure::crossings(0.0),
        ..Case::willmore("ellipse", initial, operator, scales, steps, 0)
    };
    let mut run = Run::new(case, &ComputeDevice::default_compiled()?)?;
    println!("       t        tau    length      area    energy");
    while let Some(record) = run.step()?.cloned() {
        let curve = ZeroSet::of(&run.current(), scales.eps)?;
        println!(
            "{:8.2e}   {:8.2e}   {:.5}   {:.5}   {:.5}",
            record.time, record.tau, curve.perimeter, curve.volume, curve.willmore_energy
        );
    }
    Ok(())
}

//! A vesicle: the area of its membrane stays, and its volume goes to a reduced volume of 0.8, under Willmore flow.

use willmore::prelude::*;

/// The vesicle from a coin.
///
/// # Errors
/// Those of the job.
pub fn vesicle() -> Result<Results, JobError> {
    let mut options = FlowOptions::of("builtin:coin");
    options.willmore.reduced_volume = Some(0.8);
    options.willmore.ramp = Some(3);
    options.willmore.tau = Some(StepRule::Constant(1e-5));
    options.input.cells = Some(40);
    options.input.box_side = Some(1.2);
    options.input.side_length = Some(0.7);
    options.run.steps = Some(3);
    flow(options, &Silent)
}

/// Runs the example.
///
/// # Errors
/// Those of the job.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let results = vesicle()?;
    for record in results.records() {
        let [area, reduced] = ["area", "reduced_volume"].map(|name| record.measure(name));
        println!(
            "step {}: area {:.4}, reduced volume {:.3}",
            record.step,
            area.unwrap_or_default(),
            reduced.unwrap_or_default()
        );
    }
    Ok(())
}

//! Wall times, work and memory.

use crate::prelude::*;
use crate::{surfaces, truth};

/// The middle value; 0 for none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// The exponent of the power law through the first and the last point; none unless they are two.
pub fn exponent(points: &[[f64; 2]]) -> Option<f64> {
    let (first, last) = (points.first()?, points.last()?);
    (last[0] > first[0]).then(|| (last[1] / first[1]).ln() / (last[0] / first[0]).ln())
}

/// The device and the threads that compute, as a note below a figure says it.
pub fn machine(device: &ComputeDevice) -> String {
    let threads = format!("{} threads", rayon::current_num_threads());
    if device.kind().is_cpu() {
        return threads;
    }
    let (kind, dtype) = (device.kind(), device.dtype());
    format!("{kind} ({dtype:?}) and {threads} of the host")
}

/// The networks of the convergence tests at some resolutions, and that of surfaces.
pub fn networks(options: &NetworkOptions, cells: &[usize]) -> Result<Chosen> {
    let needs = cells.iter().map(|&n| convergence_network(n));
    let needs = needs.chain([Ok(surfaces::needed_network())]);
    options.load(&needs.collect::<Result<Vec<_>, _>>()?)
}

/// What is timed in the plane: the cross in steps of `2^-14`, or for a smoke test a disc on a small box.
pub fn plane(operator: &Operator<2>, n: usize, steps: usize, quick: bool) -> Result<Case<2>> {
    let (shape, initial) = if quick {
        let disc = Ball::new([0.0, 0.0], 0.2)?;
        ("disc", phase_field(Grid::per_unit(n, 0.75)?, &disc, EPS)?)
    } else {
        let grid = Grid::per_unit(n, truth::CROSS.side)?;
        ("cross", (truth::CROSS.initial)(grid, EPS)?)
    };
    let flow = Flow::Willmore;
    Ok(planar_flow(flow, operator, shape, initial, STEP, steps))
}

/// Wall times of the minimizations in seconds.
pub fn seconds<const D: usize>(run: &Run<D>) -> Vec<f64> {
    let made = minimizations(run.records());
    made.map(|made| made.seconds).collect()
}

/// Mean over the minimizations; 0 without any.
pub fn mean<const D: usize>(run: &Run<D>, of: impl Fn(&StepRecord) -> f64) -> f64 {
    study::mean(minimizations(run.records()), of).unwrap_or(0.0)
}

/// Time and work of the steps; products on coarser grids count by their shares of the unknowns. On a GPU, which computes while the host goes
/// on, the time of a product is not known.
pub fn numbers<const D: usize>(run: &Run<D>, device: &ComputeDevice) -> Numbers {
    let (seconds, products) = (seconds(run), mean(run, |r| r.newton.hvp as f64));
    let ms = 1e3 * mean(run, |r| r.times.products);
    let mut numbers = Numbers::from([
        ("steps", seconds.len() as f64),
        ("seconds", seconds.iter().sum()),
        ("seconds_per_step", median(seconds)),
        ("newton_per_step", mean(run, |r| r.newton.newton as f64)),
        ("hvp_per_step", mean(run, StepRecord::hvp)),
        ("hvp_on_this_grid", products),
        ("hvp_on_coarser_grids", mean(run, |r| r.start.hvp)),
    ]);
    if device.kind().is_cpu() {
        numbers.insert("ms_per_product", ms / products.max(1.0));
    }
    numbers
}

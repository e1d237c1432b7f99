//! The order of convergence of Willmore flow of an ellipse in h and in tau, against its own finest run.

use crate::orders::{chart, refinements};
use crate::prelude::*;

const TITLE: &str = "Willmore flow of an ellipse, each h with its network";
const HALF_AXES: [f64; 2] = [0.3, 0.2];
const SIDE: f64 = 1.25;
/// Steps of `2^-14`, and how little the minimizations leave: much less than the errors.
const STEPS: usize = 16;
const TOLERANCE: f64 = 1e-4;
/// Cells per unit length at `tau = 2^-14`, and parts of that at `n = 128`.
const CELLS: [usize; 4] = [64, 128, 256, 512];
const PARTS: [usize; 5] = [1, 2, 4, 8, 16];

/// Willmore flow of the ellipse with half axes 0.3 and 0.2 by the calibrated scheme with the accurate network, eps = 2^-6, tautilde =
/// 2^-14, until t = 2^-10: L2 distances between runs with h and tau halved, and the orders of convergence.
#[derive(Parser, Debug)]
#[command(name = "ellipse_orders", version)]
pub struct Options {
    #[command(flatten)]
    run: RunOptions,
}

pub fn program(Options { run: options }: &Options) -> Result<()> {
    let (used, steps) = if options.quick { (3, 2) } else { (4, STEPS) };
    let parameters =
        json!({ "half_axes": HALF_AXES, "side": SIDE, "steps": steps, "tolerance": TOLERANCE });
    let mut session = Session::open("ellipse_orders", options, parameters)?;
    let mut run = |size: f64, n: usize, parts: usize| {
        let operator = Chosen::default().operator(ACCURATE, n)?;
        let initial = phase_field(Grid::per_unit(n, SIDE)?, &Ellipse::new(HALF_AXES)?, EPS)?;
        let time = (STEP / parts as f64, steps * parts);
        let mut case = planar_flow((Flow::Willmore, &operator), "ellipse", initial, time);
        case.scales.newton.tolerance = TOLERANCE;
        let name = format!("n{n}-{parts}");
        let end = session.trajectory(&name, case, &name, &Samples::every(time.1))?;
        Ok::<_, Error>((size, end))
    };
    let in_h = CELLS[..used].iter().map(|&n| run(1.0 / n as f64, n, 1));
    let h = refinements("h", &in_h.collect::<Result<Vec<_>, _>>()?)?;
    let in_tau = PARTS[..=used].iter().map(|&k| run(STEP / k as f64, 128, k));
    let tau = refinements("tau", &in_tau.collect::<Result<Vec<_>, _>>()?)?;
    let figure = Figure::new(format!("{TITLE}: convergence"), 2)
        .with_panels([chart(&h), chart(&tau)])
        .with_shared_legend();
    session.figure(figure, "orders")?;
    let rows = [h, tau].concat();
    let sheet = Sheet::of(&rows)
        .keyed(|row, name| format!("ellipse.{name}.{}.pair{}", row.refined, row.pair))
        .text("refined", |row| row.refined)
        .column("size", Scientific(2), |row| row.size)
        .column("to the finest", Scientific(2), |row| row.to_finest)
        .measure("to_next", ("to the next", Scientific(2)), |row| row.to_next)
        .measure("order", ("order", Fixed(2)), |row| row.order);
    session.sheet(sheet, "orders")?;
    session.finish(&format!("{TITLE}: orders of convergence"))
}

//! Closed elastic curves: length and area held.

use crate::equilibria::{self, AtRest, Equilibrium, Exact};
use crate::prelude::*;
use crate::surfaces::{accurate_operator, willmore_flow};
use reference::equilibria::{Elastica, elastica};

const TITLE: &str = "Closed elastic curves with given length and area";
/// Isoperimetric quotients `4 pi area / length^2`.
const QUOTIENTS: [f64; 6] = [0.95, 0.9, 0.8, 0.7, 0.6, 0.5];
/// The length is that of a circle of this radius.
const RADIUS: f64 = 0.25;
const SIDE: f64 = 1.0;
const CELLS: usize = 128;

/// Willmore flow of ellipses with length and area held until rest, by the accurate operator, n = 128, eps = 2h: energies and shapes against
/// exact elastic curves, for several isoperimetric quotients.
#[derive(Parser, Debug)]
#[command(name = "elastica", version)]
pub struct Options {
    #[command(flatten)]
    run: RunOptions,
}

pub fn program(Options { run: options }: &Options) -> Result<(), Error> {
    let count = if options.quick { 1 } else { QUOTIENTS.len() };
    let parameters = json!({ "n": CELLS, "eps_over_h": 2, "quotients": QUOTIENTS[..count], "radius": RADIUS, "side": SIDE });
    let device = options.open_device()?;
    let mut session = Session::open("elastica", options, device, parameters)?;
    let exact = session.phase("exact curves", |_| Ok(elastica(&QUOTIENTS[..count])?))?;
    let grid = Grid::<2>::per_unit(CELLS, SIDE)?;
    let scales = Scales::of_grid(grid.spacing(), 2.0);
    let operator = accurate_operator(&grid, &scales)?;
    let mut all = Vec::new();
    for (&ratio, exact) in QUOTIENTS.iter().zip(&exact) {
        let equilibrium = Equilibrium {
            key: format!("elastica.q{ratio:.2}"),
            title: format!("4πA/L² = {ratio:.2}"),
            radius: RADIUS,
            ratio,
            prolate: false,
            exact: Exact {
                energy: exact.curve.energy() / RADIUS,
                tension: exact.tension / RADIUS.powi(2),
                pressure: -exact.pressure / RADIUS.powi(3),
            },
        };
        let initial = equilibrium.start(grid, scales.eps, 0.0)?;
        let rule = (StepRule::ByEnergy(None), 1);
        let case = willmore_flow("ellipse", initial, operator.clone(), scales, rule);
        all.push(equilibrium.relax(&mut session, case, None)?);
    }
    session.figure(figure(&all, &exact), "shapes")?;
    session.sheet(equilibria::sheet(&all), "energies")?;
    session.finish(TITLE)
}

fn figure(all: &[AtRest<2>], exact: &[Elastica]) -> Figure {
    let half = 1.6 * RADIUS;
    let panels = all.iter().zip(exact).map(|(one, exact)| {
        let w = one.zero_set.willmore_energy * RADIUS / PI;
        let caption = format!("w / (π/R) = {w:.4}\nexact {:.4}", exact.curve.energy() / PI);
        let points = exact.curve.points().into_iter();
        let points: Vec<_> = points.map(|p| p.map(|x| RADIUS * x)).collect();
        Shapes::new(caption)
            .with_window([-half, half], [-half, half])
            .with_curve(look::outline(&one.field).filled(Colour::LightGrey))
            .with_curve(Curve::new([points]).with_colour(0).with_width(1.0))
    });
    Figure::new(TITLE, all.len())
        .with_column_labels(all.iter().map(|one| one.equilibrium.title.clone()))
        .with_panels(panels)
        .with_note("Grey: at rest, n = 128, ε = 2h. Blue: the exact curve. R: radius of the circle with the same length.")
}

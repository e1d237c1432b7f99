use crate::equilibria::{self, Equilibrium};
use crate::prelude::*;
use reference::equilibria::elastica;

pub const EXPERIMENT: Experiment = Experiment {
    name: "elastica",
    summary: "Closed elastic curves: length and area held.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "elastica",
        title: "Elastic curves",
        description: "Not in the paper: closed curves of least bending energy with given length and area, against exact \
                 ones.",
        figures: &[("shapes", "Curves at rest; blue: the exact curve.")],
        options: Some(""),
    }],
    metrics: &[&equilibria::METRICS],
    words: &[],
};

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
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,
}

fn program(Options { run: options }: &Options) -> Result<()> {
    let count = if options.quick { 1 } else { QUOTIENTS.len() };
    let parameters = json!({ "n": CELLS, "eps_over_h": 2, "quotients": QUOTIENTS[..count], "radius": RADIUS, "side": SIDE });
    let mut session = Session::open(EXPERIMENT.name, options, parameters)?;
    let exact = session.phase("exact curves", |_| Ok(elastica(&QUOTIENTS[..count])?))?;
    let grid = Grid::<2>::per_unit(CELLS, SIDE)?;
    let scales = Scales::of_grid(grid.spacing(), 2.0);
    let operator = operator(ACCURATE, &grid, &scales)?;
    let mut all = Vec::new();
    for (ratio, exact) in QUOTIENTS.into_iter().zip(exact) {
        let equilibrium = Equilibrium {
            key: format!("elastica.q{ratio:.2}"),
            title: format!("4πA/L² = {ratio:.2}"),
            radius: RADIUS,
            ratio,
            branch: None,
            energy: exact.curve.energy() / RADIUS,
            tension: exact.tension / RADIUS.powi(2),
            pressure: exact.pressure / RADIUS.powi(3),
            curve: exact.curve,
        };
        let initial = equilibrium.start(grid, scales.eps, 0.0)?;
        let (session, operator) = (&mut session, operator.clone());
        all.push(equilibrium.relax(session, "ellipse", initial, operator, scales, None)?);
    }
    let panels = all.iter().map(|one| {
        let (w, exact) = (one.energy(), one.exact_energy());
        let caption = format!("w / (π/R) = {w:.4}\nexact {exact:.4}");
        one.panel(caption, &one.field, 1.6)
    });
    let figure = Figure::new(TITLE, all.len())
        .with_column_labels(all.iter().map(|one| one.equilibrium.title.clone()))
        .with_panels(panels)
        .with_note("Grey: at rest, n = 128, ε = 2h. Blue: the exact curve. R: radius of the circle with the same length.");
    session.figure(figure, "shapes")?;
    session.sheet(equilibria::sheet(&all), "energies")?;
    session.finish(TITLE)
}

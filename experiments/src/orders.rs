//! Orders of convergence of runs against the finest of them.

use crate::prelude::*;

/// Writes what the sequences of runs say, each with the name of the size that is halved from one run to the next: a figure, a table, and
/// the orders as metrics `KEY.order.SIZE.pairK`, from the coarsest pair of runs.
pub fn finish<const D: usize>(
    mut session: Session<'_>,
    key: &str,
    title: &str,
    sequences: &[(&'static str, Vec<(f64, Trajectory<D>)>)],
) -> Result<(), Error> {
    let mut sizes = Vec::new();
    for (name, runs) in sequences {
        sizes.push((*name, refinements(runs)?));
    }
    let figure = Figure::new(format!("{title}: convergence"), 2)
        .with_panels(sizes.iter().map(|(name, rows)| chart(name, rows)));
    session.figure(figure.with_shared_legend(), "orders")?;
    let rows: Vec<(&str, usize, Refinement)> = (sizes.iter())
        .flat_map(|(name, rows)| (1..).zip(rows).map(|(k, row)| (*name, k, *row)))
        .collect();
    let (order, next) = (("order", Fixed(2)), ("to the next", Scientific(2)));
    let sheet = Sheet::of(&rows)
        .keyed(|(size, k, _), name| format!("{key}.{name}.{size}.pair{k}"))
        .text("refined", |(name, ..)| *name)
        .column("size", Scientific(2), |(.., row)| row.size)
        .column("to the finest", Scientific(2), |(.., row)| row.to_finest)
        .measure("to_next", next, |(.., row)| row.to_next)
        .measure("order", order, |(.., row)| row.order);
    session.sheet(sheet, "orders")?;
    session.finish(&format!("{title}: orders of convergence"))
}

/// A run in a sequence in which a size, `h` or `tau`, is halved from one to the next.
#[derive(Clone, Copy, Debug)]
struct Refinement {
    size: f64,
    /// `L2` distance of its end to that of the finest run, which is small only as long as the finest run is much finer,
    to_finest: f64,
    /// and to that of the next one, which is of the order of the error whatever the finest run is.
    to_next: f64,
    /// The order `p` as the distances to the next fall like `size^p` up to the next run; none for the last.
    order: Option<f64>,
}

/// What the runs say, coarsest first; the finest one has no row.
fn refinements<const D: usize>(runs: &[(f64, Trajectory<D>)]) -> Result<Vec<Refinement>, Error> {
    let distance = |(_, coarse): &(f64, Trajectory<D>), (_, fine): &(f64, Trajectory<D>)| {
        coarse.distance(coarse.steps(), fine, fine.steps())
    };
    let mut rows: Vec<Refinement> = Vec::new();
    for pair in runs.windows(2) {
        rows.push(Refinement {
            size: pair[0].0,
            to_finest: distance(&pair[0], &runs[runs.len() - 1])?,
            to_next: distance(&pair[0], &pair[1])?,
            order: None,
        });
    }
    for k in 1..rows.len() {
        rows[k - 1].order = Some((rows[k - 1].to_next / rows[k].to_next).log2());
    }
    Ok(rows)
}

/// The refinements of a size as a chart, with slopes 1 and 2 for comparison.
fn chart(name: &str, rows: &[Refinement]) -> LineChart {
    let (first, last) = (rows[0], rows[rows.len() - 1]);
    let guide = |slope: i32| {
        let line = [first, last].map(|row| {
            [
                row.size,
                first.to_next * (row.size / first.size).powi(slope),
            ]
        });
        Series::new(format!("slope {slope}"), line).with_colour(Colour::Grey)
    };
    LineChart::new("", Axis::log(name), Axis::log("L² distance at the end")).with_curves([
        Series::of("to the next finer run", rows, |row| [row.size, row.to_next])
            .with_marker(Marker::Circle),
        Series::of("to the finest run", rows, |row| [row.size, row.to_finest])
            .with_colour(1)
            .with_marker(Marker::Square),
        guide(1).with_style(LineStyle::Dashed),
        guide(2).with_style(LineStyle::Dotted),
    ])
}

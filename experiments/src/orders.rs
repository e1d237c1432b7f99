//! Orders of convergence of runs against the finest of them.

use crate::prelude::*;

/// A run in a sequence in which a size, `h` or `tau`, is halved from one to the next.
#[derive(Clone, Copy)]
pub struct Refinement {
    pub refined: &'static str,
    /// Its number in the sequence, from 1, the coarsest.
    pub pair: usize,
    pub size: f64,
    /// `L2` distance of its end to that of the finest run, which is small only as long as the finest run is much finer,
    pub to_finest: f64,
    /// and to that of the next one, which is of the order of the error whatever the finest run is.
    pub to_next: f64,
    /// The order `p` as the distances to the next fall like `size^p` up to the next run; none for the last.
    pub order: Option<f64>,
}

/// What the runs say, coarsest first; the finest one has no row.
pub fn refinements(
    refined: &'static str,
    runs: &[(f64, Trajectory<2>)],
) -> Result<Vec<Refinement>> {
    let distance = |coarse: &Trajectory<2>, fine: &Trajectory<2>| {
        coarse.distance(coarse.steps(), fine, fine.steps())
    };
    let finest = &runs[runs.len() - 1].1;
    let mut rows: Vec<Refinement> = Vec::new();
    for (k, pair) in runs.windows(2).enumerate() {
        rows.push(Refinement {
            refined,
            pair: k + 1,
            size: pair[0].0,
            to_finest: distance(&pair[0].1, finest)?,
            to_next: distance(&pair[0].1, &pair[1].1)?,
            order: None,
        });
    }
    for k in 1..rows.len() {
        rows[k - 1].order = Some((rows[k - 1].to_next / rows[k].to_next).log2());
    }
    Ok(rows)
}

/// The refinements of a size as a chart, with slopes 1 and 2 for comparison.
pub fn chart(rows: &[Refinement]) -> LineChart {
    let (first, last) = (rows[0], rows[rows.len() - 1]);
    let guide = |slope: i32, style| {
        let power = |size: f64| first.to_next * (size / first.size).powi(slope);
        let line = [first, last].map(|row| [row.size, power(row.size)]);
        let guide = Series::new(format!("slope {slope}"), line).with_colour(Colour::Grey);
        guide.with_style(style)
    };
    let next = Series::of("to the next finer run", rows, |row| [row.size, row.to_next]);
    let finest = Series::of("to the finest run", rows, |row| [row.size, row.to_finest]);
    let distance = Axis::log("L² distance at the end");
    LineChart::new("", Axis::log(first.refined), distance).with_curves([
        next.with_marker(Marker::Circle),
        finest.with_colour(1).with_marker(Marker::Square),
        guide(1, LineStyle::Dashed),
        guide(2, LineStyle::Dotted),
    ])
}

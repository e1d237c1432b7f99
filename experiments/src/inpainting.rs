//! Inpainting, in any dimension: Willmore flow of the values in a region, the rest held.

use geometry::measure::l2_distance;
use geometry::{Field, Grid};
use render::{Rgb, Tube};
use report::{Axis, Column, Figure, Format, LineChart, Series, Summary, Table};
use serde::Serialize;

use crate::Error;
use crate::evolution::{Division, NamedRegion, Trajectory};
use crate::options::RunOptions;

/// A shape stands still once it moves by less than this part of the way it has come per step.
pub const STILL: f64 = 1e-5;
/// The first part of the first step, in units of `eps^4`: the time in which a corner becomes about as round as the interface is wide.
const FIRST_PART: f64 = 32.0;

/// A region `D` with sides along the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window<const D: usize> {
    /// The corner with the smallest coordinates.
    pub low: [f64; D],
    /// The corner with the largest.
    pub high: [f64; D],
}

impl<const D: usize> Window<D> {
    /// The nodes inside.
    pub fn nodes(&self, grid: &Grid<D>) -> NamedRegion {
        let Self { low, high } = self;
        let inside = |node: usize| {
            let x = grid.node(node);
            (0..D).all(|axis| low[axis] < x[axis] && x[axis] < high[axis])
        };
        NamedRegion {
            name: format!("{low:?} to {high:?}"),
            nodes: (0..grid.len()).map(inside).collect(),
        }
    }
}

impl Window<3> {
    /// Its edges, to be drawn in pictures.
    pub fn edges(&self, radius: f64, colour: Rgb) -> Vec<Tube> {
        (Tube::edges_of_box(self.low, self.high, radius).into_iter())
            .map(|edge| edge.with_colour(colour))
            .collect()
    }
}

/// How the first step is divided; fields are kept after `tau / 2^k` for these `k`.
pub fn division(eps: f64, kept: &[u32]) -> Division {
    Division {
        first: FIRST_PART * eps.powi(4),
        kept: kept.to_vec(),
    }
}

/// What became of a shape.
pub struct Inpainted<'a, const D: usize> {
    /// Prefix of its metrics.
    pub key: &'static str,
    /// Name in titles and tables.
    pub title: &'static str,
    /// The paper's time step.
    pub tau: f64,
    /// How it went.
    pub trajectory: &'a Trajectory<D>,
    /// The distance to what it should become, or to the beginning, at the steps that are shown and at the last one.
    pub distances: Vec<(usize, f64)>,
    /// Nodes outside the region whose bits changed.
    pub changed_outside: usize,
}

/// One step, or a part of one.
#[derive(Serialize)]
struct Row {
    shape: &'static str,
    /// In units of the paper's step.
    step: f64,
    time: f64,
    tau: f64,
    willmore_energy: f64,
    energy: f64,
    energy_before: f64,
    volume: f64,
    newton: usize,
    hvp: usize,
    seconds: f64,
}

impl<'a, const D: usize> Inpainted<'a, D> {
    /// Measures a run in which only the values at the marked `nodes` should have moved; `whole` is what it should become, if that is
    /// known.
    ///
    /// # Errors
    /// [`Error::Geometry`] if a stored phase field cannot be read.
    pub fn measure(
        (key, title): (&'static str, &'static str),
        trajectory: &'a Trajectory<D>,
        nodes: &[bool],
        shown: &[usize],
        whole: Option<&Field<D>>,
    ) -> Result<Self, Error> {
        let initial = trajectory.field(0)?;
        let goal = whole.unwrap_or(&initial);
        let steps = trajectory.steps();
        let distances = (shown.iter().copied().filter(|&k| k < steps))
            .chain([steps])
            .map(|k| Ok((k, l2_distance(&trajectory.field(k)?, goal)?)))
            .collect::<Result<Vec<_>, Error>>()?;
        let last = trajectory.field(steps)?;
        let changed_outside = (last.values().iter().zip(initial.values()).zip(nodes))
            .filter(|((u, start), inside)| !**inside && u.to_bits() != start.to_bits())
            .count();
        Ok(Self {
            key,
            title,
            tau: trajectory.evolution.tau.size(1),
            trajectory,
            distances,
            changed_outside,
        })
    }

    /// The time in the paper's steps from which on the shape stands still, if it does.
    pub fn still_from(&self) -> Option<f64> {
        self.trajectory.still?;
        let last = self.trajectory.records.last()?;
        Some((last.time - last.tau) / self.tau)
    }

    fn rows(&self) -> impl Iterator<Item = Row> + '_ {
        let trajectory = self.trajectory;
        (trajectory.records.iter().zip(&trajectory.measures[1..])).map(|(r, m)| Row {
            shape: self.key,
            step: r.time / self.tau,
            time: r.time,
            tau: r.tau,
            willmore_energy: r.willmore_energy,
            energy: r.energy,
            energy_before: r.energy_before,
            volume: m.volume,
            newton: r.newton.newton,
            hvp: r.newton.hvp,
            seconds: r.seconds,
        })
    }

    /// Adds the metrics of this run.
    ///
    /// # Errors
    /// [`Error::Report`] for a value that is not finite.
    pub fn summarize(&self, summary: &mut Summary) -> Result<(), Error> {
        let name = |metric: &str| format!("{}.{metric}", self.key);
        for &(k, distance) in &self.distances {
            summary.insert(&name(&format!("distance.step{k}")), distance)?;
        }
        let records = &self.trajectory.records;
        let (first, count) = (self.trajectory.parts(1), records.len());
        // Where nothing moves any more, the energy stays.
        let rises = records.iter().filter(|r| r.energy > r.energy_before);
        summary.insert_count(&name("energy_increases"), rises.count())?;
        summary.insert_count(&name("changed_outside"), self.changed_outside)?;
        summary.insert_count(&name("steps"), self.trajectory.steps())?;
        summary.insert_count(&name("parts_of_step1"), first.len())?;
        if let Some(still) = self.still_from() {
            summary.insert(&name("still_from"), still)?;
        }
        let hvp: usize = records.iter().map(|r| r.newton.hvp).sum();
        summary.insert(&name("hvp_per_part"), hvp as f64 / count.max(1) as f64)?;
        summary.insert(&name("seconds"), self.trajectory.seconds)?;
        Ok(())
    }
}

/// The records of all steps and parts, as CSV.
///
/// # Errors
/// [`Error::Report`].
pub fn steps_csv<const D: usize>(all: &[Inpainted<'_, D>]) -> Result<String, Error> {
    let rows: Vec<Row> = all.iter().flat_map(Inpainted::rows).collect();
    Ok(report::data::to_csv(&rows)?)
}

/// Distances and energies at the steps that are shown.
///
/// # Errors
/// [`Error::Report`] for a value that is not finite.
pub fn table<const D: usize>(all: &[Inpainted<'_, D>]) -> Result<Table, Error> {
    let mut table = Table::new([
        Column::text("shape"),
        Column::number("step", Format::Shortest),
        Column::number("time in steps", Format::Shortest),
        Column::number(
            "L² distance to the whole, or to the start",
            Format::Fixed(5),
        ),
        Column::number("Willmore energy", Format::Fixed(3)),
    ]);
    for one in all {
        for &(k, distance) in &one.distances {
            let record = one.trajectory.record(k);
            table.push([
                one.title.into(),
                k.into(),
                record.map_or(0.0, |r| r.time / one.tau).into(),
                distance.into(),
                record.map(|r| r.willmore_energy).into(),
            ])?;
        }
    }
    Ok(table)
}

/// The energies over time.
pub fn energies<const D: usize>(run: &RunOptions, all: &[Inpainted<'_, D>]) -> Figure {
    let mut figure = Figure::new(run.title("Willmore energy while inpainting"), 2);
    for one in all {
        let points: Vec<[f64; 2]> = (one.trajectory.records.iter())
            .map(|r| [r.time, r.willmore_energy])
            .collect();
        figure = figure.with_panel(
            LineChart::new(
                one.title,
                Axis::log("time t"),
                Axis::linear("Willmore energy w"),
            )
            .with_series(Series::new("w", points)),
        );
    }
    figure
}

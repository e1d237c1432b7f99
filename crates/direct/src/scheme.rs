//! Direct steps as a scheme.

use std::time::Instant;

use geometry::{
    Field, Grid, NodeSet, PhaseField, Stored, ZeroSet, distance_from_phase_field, optimal_profile,
    parallel,
};
use serde::{Deserialize, Serialize};
use solver::{
    Cancel, Candidate, DirectRecord, Error, Memory, Problem, Scheme, State, StepRecord, StepSize,
};

use crate::step::{DirectSteps, Needed};

/// Fields and numbers in the memory of a state.
const WHOLE: &str = "direct whole steps";
const HALF: &str = "direct half steps";
const REACH: &str = "reach";
const ENERGY: &str = "energy of the zero level";

/// How long the parts of direct steps are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DirectParams {
    /// The longest part of a step, over the fourth power of the [reach](geometry::Redistanced::reach) of the interface: so kernels see little of its
    /// curvature and next to nothing of its other parts. Errors are of second order in it; above `4e-3` they are not small.
    pub longest: f64,
}

impl Default for DirectParams {
    fn default() -> Self {
        Self { longest: 1e-3 }
    }
}

/// Direct steps of second order, made of two runs of first order.
///
/// One run makes steps of a size, the other one two steps of half the size for each of these. The flow is what they extrapolate to, `2 s_half - s_whole`
/// for their signed distances `s`. A time step is divided into parts whose length follows the [reach](DirectParams::longest) of the
/// interface. A part is not shorter than `17 h^4`, so that the grid resolves its kernel. Each part takes three convolutions.
///
/// The phase field is stored on the whole grid. The energy is that of bending, and nothing is held. It is measured on the zero level
/// ([`geometry::ZeroSet`]). Nothing guarantees that it falls. In the record, `energy_before` and `energy` are `2 tau w` of the energies before and
/// after the step, and `direct` says what was done.
#[derive(Default)]
pub struct Direct<const D: usize> {
    params: DirectParams,
    steps: Option<DirectSteps<D>>,
}

/// The distances of both runs, and the reach of the interface.
struct Runs {
    whole: Vec<f64>,
    half: Vec<f64>,
    reach: f64,
}

/// What holds for all parts of a step.
#[derive(Clone, Copy)]
struct Parts<'a> {
    /// The longest, over the fourth power of the reach.
    longest: f64,
    free: Free<'a>,
    cancel: &'a Cancel,
}

/// Where distances may change; all others stay.
#[derive(Clone, Copy)]
struct Free<'a>(Option<&'a NodeSet>);

impl Free<'_> {
    fn of(self, new: Vec<f64>, old: &[f64]) -> Vec<f64> {
        let Some(region) = self.0 else {
            return new;
        };
        let kept = region.iter().zip(new).zip(old);
        kept.map(|((free, new), old)| if free { new } else { *old })
            .collect()
    }
}

impl<const D: usize> Direct<D> {
    /// The scheme, before it has prepared anything.
    pub fn new() -> Self {
        Self::default()
    }

    /// The same with parts of another length.
    ///
    /// # Errors
    /// [`geometry::Error`] unless it is positive.
    pub fn with(params: DirectParams) -> Result<Self, geometry::Error> {
        geometry::positive("longest part of a direct step", params.longest)?;
        Ok(Self {
            params,
            steps: None,
        })
    }

    /// Refuses what direct steps cannot do.
    ///
    /// # Errors
    /// [`Error::NotDirect`] for held sizes, terms of the energy besides bending, bounds on the displacement, and active bricks.
    pub fn check(problem: &Problem<D>, from: &State<D>) -> Result<(), Error> {
        let what = if !problem.held.is_empty() {
            "held sizes"
        } else if !problem.terms.is_empty() {
            "terms of the energy besides bending"
        } else if problem.bounds.is_some() {
            "bounds on the displacement"
        } else if from.field.nodes().bricks().is_some() {
            "active bricks"
        } else {
            return Ok(());
        };
        Err(Error::NotDirect { what })
    }

    /// The steps on a grid, with what is prepared for them.
    fn steps(&mut self, grid: Grid<D>) -> &mut DirectSteps<D> {
        self.steps.take_if(|steps| *steps.grid() != grid);
        self.steps.get_or_insert_with(|| DirectSteps::new(grid))
    }
}

impl<const D: usize> DirectSteps<D> {
    /// Both runs at the start of a flow.
    fn start(&self, u: &Stored<D>, eps: f64, free: Free<'_>) -> Runs {
        let distances = distances(u.values(), eps);
        let made = self.level(&distances);
        let reach = made.reach();
        let whole = free.of(made.distances, &distances);
        Runs {
            half: whole.clone(),
            whole,
            reach,
        }
    }

    /// Both runs after a part of a step.
    fn both(
        &mut self,
        runs: &Runs,
        tau: f64,
        parts: Parts<'_>,
        needed: Needed,
    ) -> Result<Runs, Error> {
        let Parts { free, cancel, .. } = parts;
        cancel.check()?;
        let whole = self.step_as(&runs.whole, tau, needed);
        cancel.check()?;
        let middle = self.step_as(&runs.half, 0.5 * tau, Needed::Near);
        let middle = free.of(middle.distances, &runs.half);
        cancel.check()?;
        // All distances, for the reach.
        let half = self.step(&middle, 0.5 * tau);
        Ok(Runs {
            reach: half.reach(),
            whole: free.of(whole.distances, &runs.whole),
            half: free.of(half.distances, &runs.half),
        })
    }

    /// Both runs after a time step, and in how many parts it was made.
    fn advance(
        &mut self,
        mut runs: Runs,
        tau: f64,
        parts: Parts<'_>,
    ) -> Result<(Runs, usize), Error> {
        let (mut left, mut count) = (tau, 0);
        while left > 0.0 {
            let longest = (parts.longest * runs.reach.powi(4)).max(self.shortest());
            let part = left / (left / longest).ceil().max(1.0);
            // The last part is all that is left, whatever rounding says.
            left = if part < left { left - part } else { 0.0 };
            let needed = if left > 0.0 {
                Needed::Near
            } else {
                Needed::All
            };
            runs = self.both(&runs, part, parts, needed)?;
            count += 1;
        }
        Ok((runs, count))
    }
}

impl Runs {
    /// What the runs extrapolate to; where one has no zero level, the run of half parts.
    fn extrapolated(&self) -> Vec<f64> {
        let (whole, half) = (&self.whole, &self.half);
        parallel::values(whole.len(), |node| {
            let (whole, half) = (whole[node], half[node]);
            if whole.is_finite() && half.is_finite() {
                2.0 * half - whole
            } else {
                half
            }
        })
    }

    /// The largest distance of the two runs, at nodes within a spacing of the zero level.
    fn distance(&self, spacing: f64) -> f64 {
        let near = self.half.iter().zip(&self.whole);
        let near = near.filter(|(half, _)| half.abs() <= spacing);
        near.map(|(half, whole)| (half - whole).abs())
            .fold(0.0, f64::max)
    }
}

/// The distances of a phase field.
fn distances(values: &[f64], eps: f64) -> Vec<f64> {
    parallel::values(values.len(), |node| {
        distance_from_phase_field(values[node], eps)
    })
}

/// The phase field of distances.
fn phase_field<const D: usize>(
    problem: &Problem<D>,
    distances: &[f64],
    free: Free<'_>,
    fixed: &[f64],
) -> Result<Stored<D>, geometry::Error> {
    let eps = problem.params.eps;
    let values = parallel::values(distances.len(), |node| {
        optimal_profile(distances[node], eps)
    });
    let field = Field::from_values(problem.grid, free.of(values, fixed))?;
    Ok(Stored::whole(field))
}

/// The runs that a state remembers.
fn remembered<const D: usize>(from: &State<D>, eps: f64) -> Result<Option<Runs>, Error> {
    let Memory { fields, numbers } = &from.memory;
    let (Some(whole), Some(half)) = (fields.get(WHOLE), fields.get(HALF)) else {
        return Ok(None);
    };
    Ok(Some(Runs {
        whole: distances(whole.stored()?.values(), eps),
        half: distances(half.stored()?.values(), eps),
        reach: numbers.get(REACH).copied().unwrap_or(f64::INFINITY),
    }))
}

/// What a state remembers of runs that end with an energy.
fn memory<const D: usize>(
    problem: &Problem<D>,
    runs: &Runs,
    energy: f64,
) -> Result<Memory<D>, geometry::Error> {
    let mut memory = Memory::default();
    for (name, distances) in [(WHOLE, &runs.whole), (HALF, &runs.half)] {
        let field = problem.upload(&phase_field(problem, distances, Free(None), &[])?);
        memory.fields.insert(name.to_owned(), field);
    }
    for (name, number) in [(REACH, runs.reach), (ENERGY, energy)] {
        memory.numbers.insert(name.to_owned(), number);
    }
    Ok(memory)
}

/// The Willmore energies of the zero level before and after a step; the former may be known.
fn energies<const D: usize>(
    from: &State<D>,
    before: &Stored<D>,
    after: &Stored<D>,
    eps: f64,
) -> Result<[f64; 2], Error> {
    let energy = |u: &Stored<D>| -> Result<f64, Error> { Ok(ZeroSet::of(u, eps)?.willmore_energy) };
    let known = from.memory.numbers.get(ENERGY).copied();
    Ok([known.map_or_else(|| energy(before), Ok)?, energy(after)?])
}

impl<const D: usize> Scheme<D> for Direct<D> {
    fn step(
        &mut self,
        problem: &Problem<D>,
        from: &State<D>,
        size: StepSize,
    ) -> Result<Candidate<D>, Error> {
        let clock = Instant::now();
        Self::check(problem, from)?;
        let (eps, free) = (problem.params.eps, Free(problem.region.as_deref()));
        let parts = Parts {
            longest: self.params.longest,
            free,
            cancel: &problem.cancel,
        };
        let before = from.stored()?;
        let steps = self.steps(problem.grid);
        let runs = match remembered(from, eps)? {
            Some(runs) => runs,
            None => steps.start(&before, eps, free),
        };
        let (runs, parts) = steps.advance(runs, size.tau, parts)?;
        let level = steps.level(&runs.extrapolated());

        let not_finite = |_| Error::NonFinite {
            step: from.step + 1,
            field: "phase field",
        };
        let now = phase_field(problem, &level.distances, free, before.values());
        let now = now.map_err(not_finite)?;
        let [energy_before, willmore_energy] = energies(from, &before, &now, eps)?;
        let memory = memory(problem, &runs, willmore_energy).map_err(not_finite)?;
        let state = from.after(size, problem.upload(&now), memory);
        let record = StepRecord {
            step: state.step,
            time: state.time,
            tau: size.tau,
            energy_before: 2.0 * size.tau * energy_before,
            energy: 2.0 * size.tau * willmore_energy,
            willmore_energy,
            direct: Some(DirectRecord {
                parts,
                convolutions: 3 * parts,
                reach: runs.reach,
                run_distance: runs.distance(problem.grid.spacing()),
            }),
            seconds: clock.elapsed().as_secs_f64(),
            ..StepRecord::default()
        };
        Ok(Candidate {
            state,
            tau: size.tau,
            record: Some(record),
        })
    }

    fn name(&self) -> &'static str {
        "direct"
    }
}

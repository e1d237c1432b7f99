//! Where the minimization of an implicit Euler step begins.

use std::collections::BTreeMap;

use burn::tensor::{Slice, Tensor};
use geometry::Field;
use operators::{extrapolate, inner_product, squared_distance};

use crate::euler::{Euler, StepTo};
use crate::{DeviceField, Error, Memory, Problem, Start, StartKind, State};

/// The phase field one step ago, in the [memory](Memory) of a state,
pub(crate) const PREVIOUS: &str = "previous";
/// and the size of that step.
pub(crate) const PREVIOUS_TAU: &str = "previous_tau";

/// Where a minimization begins.
pub(crate) struct Started<const D: usize> {
    pub(crate) field: DeviceField<D>,
    pub(crate) origin: Start,
    /// The motions on the coarser grids, to be remembered.
    pub(crate) half_motions: BTreeMap<String, DeviceField<D>>,
}

/// The name of the last motion on the grid that is so many times coarser by half, the half grid being 0.
fn half_motion(level: usize) -> String {
    format!("half_motion_{level}")
}

/// The start of a step of a scheme from a state.
pub(crate) fn of<const D: usize>(
    scheme: &mut Euler<D>,
    problem: &Problem<D>,
    from: &State<D>,
    to: StepTo,
) -> Result<Started<D>, Error> {
    let (current, memory) = (from.field.values(), &from.memory);
    let previous = memory.fields.get(PREVIOUS).map(DeviceField::values);
    if let Some(half) = on_half_grid(scheme, problem, from, to)? {
        let before = match memory.fields.get(&half_motion(0)) {
            Some(before) => Some(before.field()?),
            None => None,
        };
        let start = match (before, previous) {
            // The half grid also moves the profile from the one that fits this grid to its own, in every step alike: what it
            // moves more than in the last step comes on top of the last motion here.
            (Some(before), Some(previous)) if from.step > 1 => {
                let change = half.motion.zip_map(&before, |new, old| new - old)?;
                current.clone() * 2.0 - previous.clone() + refined(&change, problem)?
            }
            _ => current.clone() + refined(&half.motion, problem)?,
        };
        let kind = StartKind::HalfGrid;
        return Ok(Started {
            field: from.field.with(start),
            origin: Start {
                kind,
                hvp: half.hvp,
            },
            half_motions: half.motions,
        });
    }
    let last = memory.numbers.get(PREVIOUS_TAU);
    let (start, kind) = match previous.zip(last) {
        // The first step also relaxes the initial profile, which is nothing to extrapolate.
        Some((previous, last)) if from.step > 1 && moved_little(&from.field, previous)? => {
            let factor = (to.size.tau / last).min(2.0);
            (
                extrapolate(current, previous, factor),
                StartKind::Extrapolated,
            )
        }
        _ => (current.clone(), StartKind::Rest),
    };
    Ok(Started {
        field: from.field.with(start),
        origin: Start { kind, hvp: 0.0 },
        half_motions: BTreeMap::new(),
    })
}

/// Whether the interface moved by less than half its width, `4 eps/3` in root mean square, since `previous`. After longer
/// moves an extrapolation can end in the valley of another minimizer, even close a hole.
fn moved_little<const D: usize>(now: &DeviceField<D>, previous: &Tensor<D>) -> Result<bool, Error> {
    const FAR: f64 = 0.5;
    let (current, device) = (now.values(), now.device());
    // A displacement d is the motion (1 - u^2) 3 d / (4 eps).
    let motion = device.scalar(squared_distance(current, previous))?;
    let profile = (current.clone() * current.clone()).neg() + 1.0;
    let profile = device.scalar(inner_product(&profile, &profile))?;
    Ok(motion < FAR * FAR * profile)
}

/// A field on the half grid, interpolated on that of the problem.
fn refined<const D: usize>(coarse: &Field<D>, problem: &Problem<D>) -> Result<Tensor<D>, Error> {
    let fine = coarse.refined()?;
    Ok(problem.device.tensor(fine.values(), problem.grid.shape()))
}

/// What the half grid moves in a step.
struct OnHalfGrid<const D: usize> {
    motion: Field<D>,
    /// That motion and those below it, by their names.
    motions: BTreeMap<String, DeviceField<D>>,
    /// Products, in units of those on the whole grid.
    hvp: f64,
}

/// The step on the half grid; none if the problem has no half grid, or the step is too long for that.
fn on_half_grid<const D: usize>(
    scheme: &mut Euler<D>,
    problem: &Problem<D>,
    from: &State<D>,
    StepTo { size, targets }: StepTo,
) -> Result<Option<OnHalfGrid<D>>, Error> {
    // Bricks follow the interface, which the half grid would not.
    let on_bricks = from.field.nodes().bricks().is_some();
    let Some(half) = problem.half.as_ref().filter(|_| !on_bricks) else {
        return Ok(None);
    };
    let start = half_state(half, from);
    let targets = if targets.is_empty() {
        targets
    } else {
        let (here, there) = (from.field.field()?, start.field.field()?);
        targets.carried(&here, &there, problem.params.eps)?
    };
    let below = scheme.half.get_or_insert_default();
    let candidate = match below.step_to(half, &start, StepTo { size, targets }) {
        Err(Error::Rushed { .. }) => return Ok(None),
        Err(error) if error.shorter_step_may_succeed() => return Ok(None),
        candidate => candidate?,
    };
    let made = candidate
        .record
        .expect("a step of Euler's method has a record");
    let moved = candidate.state.field.values().clone() - start.field.values().clone();
    let moved = start.field.with(moved);
    let mut motions: BTreeMap<String, DeviceField<D>> = BTreeMap::new();
    let memory = candidate.state.memory.fields;
    for level in 0.. {
        let Some(motion) = memory.get(&half_motion(level)) else {
            break;
        };
        motions.insert(half_motion(level + 1), motion.clone());
    }
    motions.insert(half_motion(0), moved.clone());
    let share = half.grid.len() as f64 / problem.grid.len() as f64;
    Ok(Some(OnHalfGrid {
        motion: moved.field()?,
        motions,
        hvp: share * made.hvp(),
    }))
}

/// A state in every other node, with the motions that belong to the grids below.
fn half_state<const D: usize>(half: &Problem<D>, from: &State<D>) -> State<D> {
    let every_other = |field: &DeviceField<D>| {
        let values = field.values().clone();
        half.on_whole_grid(values.slice([Slice::with_step(0, None, 2); D]))
    };
    let mut memory = Memory {
        numbers: from.memory.numbers.clone(),
        ..Memory::default()
    };
    if let Some(previous) = from.memory.fields.get(PREVIOUS) {
        (memory.fields).insert(PREVIOUS.to_owned(), every_other(previous));
    }
    for level in 0.. {
        let Some(motion) = from.memory.fields.get(&half_motion(level + 1)) else {
            break;
        };
        memory.fields.insert(half_motion(level), motion.clone());
    }
    State {
        field: every_other(&from.field),
        memory,
        ..from.clone()
    }
}

//! The phase field of a run between two steps.

use std::ops::Deref;
use std::sync::OnceLock;

use geometry::{Field, Nodes, PhaseField};
use solver::Stored;

use crate::Case;

/// The current phase field of a run, as it is stored ([`PhaseField`]), or, as a [`Field`], on the whole grid, which is made of it when it is
/// first asked for.
pub struct Current<'a, const D: usize> {
    pub(crate) case: &'a Case<D>,
    /// Nothing before the first step.
    pub(crate) stored: Option<&'a Stored<D>>,
    pub(crate) whole: &'a OnceLock<Field<D>>,
}

impl<'a, const D: usize> Current<'a, D> {
    /// It on the whole grid.
    pub(crate) fn field(&self) -> &'a Field<D> {
        let Current {
            case,
            stored,
            whole,
        } = *self;
        let Some(stored) = stored else {
            return &case.initial;
        };
        whole.get_or_init(|| {
            let read = |start: usize, part: &mut [f64]| read(case, Some(stored), start, part);
            Field::read_from(*case.grid(), &read).expect("stored values are finite")
        })
    }

    /// What is stored says all, but for the values outside of a region where bricks are missing.
    fn is_stored(&self) -> Option<&'a Stored<D>> {
        self.stored.filter(|_| self.case.region.is_none())
    }
}

impl<const D: usize> Deref for Current<'_, D> {
    type Target = Field<D>;

    fn deref(&self) -> &Field<D> {
        self.field()
    }
}

impl<const D: usize> PhaseField<D> for Current<'_, D> {
    fn nodes(&self) -> Nodes<D> {
        (self.is_stored()).map_or_else(|| PhaseField::nodes(self.field()), PhaseField::nodes)
    }

    fn values(&self) -> &[f64] {
        (self.is_stored()).map_or_else(|| self.field().values(), PhaseField::values)
    }

    fn rests(&self) -> [f64; 2] {
        (self.is_stored()).map_or_else(|| self.field().rests(), PhaseField::rests)
    }
}

/// Writes values of a phase field from a node on, whole rows of bricks: those that are stored, or the initial ones, which it keeps outside of
/// the region.
pub(crate) fn read<const D: usize>(
    case: &Case<D>,
    stored: Option<&Stored<D>>,
    start: usize,
    part: &mut [f64],
) {
    let initial = &case.initial.values()[start..][..part.len()];
    let Some(stored) = stored else {
        part.copy_from_slice(initial);
        return;
    };
    stored.read(start, part);
    if let Some(region) = &case.region {
        let kept = initial.iter().zip(&region[start..]);
        for (value, (initial, moves)) in part.iter_mut().zip(kept) {
            if !moves {
                *value = *initial;
            }
        }
    }
}

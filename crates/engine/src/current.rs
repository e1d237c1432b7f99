//! The phase field of a run between two steps.

use std::sync::OnceLock;

use geometry::{Field, NodeSet, Nodes, PhaseField, Stored};

/// The current phase field of a run, as it is stored ([`PhaseField`]), or, as a [`Field`], on the whole grid, which is made of it when it is
/// first asked for. Outside of a region that has the initial values, also where the former has those of the pure phases since nothing is stored.
pub struct Current<'a, const D: usize> {
    /// The initial one before the first step.
    pub(crate) stored: &'a Stored<D>,
    /// Its values are kept outside of the region, if there is one.
    pub(crate) initial: &'a Stored<D>,
    pub(crate) region: Option<&'a NodeSet>,
    pub(crate) whole: &'a OnceLock<Field<D>>,
}

impl<'a, const D: usize> Current<'a, D> {
    /// It on the whole grid, which takes the memory of all of it.
    pub fn field(&self) -> &'a Field<D> {
        self.whole.get_or_init(|| {
            Field::read_from(*self.stored.grid(), &|start, part| self.read(start, part))
                .expect("stored values are finite")
        })
    }
}

impl<const D: usize> PhaseField<D> for Current<'_, D> {
    fn nodes(&self) -> &Nodes<D> {
        self.stored.nodes()
    }

    fn values(&self) -> &[f64] {
        self.stored.values()
    }

    fn phase_values(&self) -> [f64; 2] {
        self.stored.phase_values()
    }

    fn at(&self, place: [usize; D]) -> f64 {
        let keeps = |region: &NodeSet| !region.contains(self.stored.grid().index(place));
        if self.region.is_some_and(keeps) {
            self.initial.at(place)
        } else {
            self.stored.at(place)
        }
    }

    /// The values that are stored, and outside of the region the initial ones, which it keeps even where nothing is stored.
    fn read(&self, start: usize, part: &mut [f64]) {
        self.stored.read(start, part);
        if let Some(region) = self.region {
            let moved = part.to_vec();
            self.initial.read(start, part);
            for range in region.within(start, moved.len()) {
                part[range.clone()].copy_from_slice(&moved[range]);
            }
        }
    }
}

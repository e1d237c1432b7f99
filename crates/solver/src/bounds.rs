//! Bounds on how far an interface may go.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::{Nodes, Stored, distance_from_phase_field, optimal_profile, positive};
use operators::ComputeDevice;

use crate::Error;
use crate::region::Region;

/// Values beyond a bound by less than this are rounding.
const ROUNDING: f64 = 1e-9;
/// No value of a phase field is as large as this one, which bounds nothing.
const NONE: f64 = 1e3;

/// The least and the largest value that a phase field may have at each node, so that its interface stays within a distance of another one.
///
/// With the signed distance `s` of the other interface these are the values `q(s + d)` and `q(s - d)` of the optimal profile `q`, displaced by the
/// distance `d` to either side. They are set where an interface at this distance has its neighbouring nodes: for `|s|` up to `d` and the larger one of
/// `eps` and two cells. Elsewhere the profile is free to be another one than the optimal one.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds<const D: usize> {
    least: Stored<D>,
    most: Stored<D>,
}

impl<const D: usize> Bounds<D> {
    /// For interfaces of width `eps` within this distance of the interface of a phase field.
    ///
    /// # Errors
    /// [`Error::Geometry`] unless both lengths are positive.
    pub fn within(distance: f64, of: &Stored<D>, eps: f64) -> Result<Self, Error> {
        positive("eps", eps)?;
        positive("distance", distance)?;
        let near = distance + eps.max(2.0 * of.grid().spacing());
        let bound = |u: f64, to: f64| {
            let s = distance_from_phase_field(u, eps);
            if s.abs() <= near {
                optimal_profile(s + to * distance, eps)
            } else {
                -to * NONE
            }
        };
        Ok(Self {
            least: of.map(|u| bound(u, 1.0)),
            most: of.map(|u| bound(u, -1.0)),
        })
    }

    /// The least values, far below the phases where there is no bound.
    pub fn least(&self) -> &Stored<D> {
        &self.least
    }

    /// The largest values, far above the phases where there is no bound.
    pub fn most(&self) -> &Stored<D> {
        &self.most
    }

    /// At the nodes at which a phase field is stored.
    pub(crate) fn on(&self, nodes: &Nodes<D>) -> Arc<BoundsOn> {
        let values = |bound: &Stored<D>| bound.on(nodes).into_values();
        Arc::new(BoundsOn {
            least: values(&self.least),
            most: values(&self.most),
        })
    }
}

/// The least and the largest value at each node that is stored.
pub(crate) struct BoundsOn {
    least: Vec<f64>,
    most: Vec<f64>,
}

/// Where a node is.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    Free,
    AtLeast,
    AtMost,
}

/// The nodes that are held at their bounds: an active set.
pub(crate) struct Active {
    bounds: Arc<BoundsOn>,
    places: Vec<Place>,
}

impl Active {
    /// None of them.
    pub(crate) fn none(bounds: Arc<BoundsOn>) -> Self {
        let places = vec![Place::Free; bounds.least.len()];
        Self { bounds, places }
    }

    /// Holds the nodes that are beyond their bounds, and lets those go which a gradient pulls back from them. Says whether there were any.
    pub(crate) fn update(&mut self, u: &[f64], gradient: Option<&[f64]>) -> bool {
        let mut changed = false;
        for node in 0..self.places.len() {
            let place = self.places[node];
            let slope = gradient.map_or(0.0, |gradient| gradient[node]);
            let next = match place {
                Place::AtLeast if slope < 0.0 => Place::Free,
                Place::AtMost if slope > 0.0 => Place::Free,
                Place::Free if u[node] < self.bounds.least[node] - ROUNDING => Place::AtLeast,
                Place::Free if u[node] > self.bounds.most[node] + ROUNDING => Place::AtMost,
                same => same,
            };
            changed |= next != place;
            self.places[node] = next;
        }
        changed
    }

    /// Whether no node is held.
    pub(crate) fn is_empty(&self) -> bool {
        self.places.iter().all(|place| *place == Place::Free)
    }

    /// The nodes of a region that are not held.
    pub(crate) fn region<const D: usize>(
        &self,
        region: Option<&Region<D>>,
        shape: [usize; D],
        device: &ComputeDevice,
    ) -> Region<D> {
        let moves = |node: usize| region.is_none_or(|region| region.marks[node]);
        let marks = self
            .places
            .iter()
            .enumerate()
            .map(|(node, place)| moves(node) && *place == Place::Free);
        Region::marked(marks.collect(), shape, device)
    }

    /// Values within the bounds.
    pub(crate) fn clamped<const D: usize>(
        &self,
        u: &[f64],
        shape: [usize; D],
        device: &ComputeDevice,
    ) -> Tensor<D> {
        let BoundsOn { least, most } = &*self.bounds;
        let bounds = least.iter().zip(most);
        let values = u.iter().zip(bounds).map(|(u, (&a, &b))| u.clamp(a, b));
        device.tensor(&values.collect::<Vec<_>>(), shape)
    }
}

//! What is measured after every step.

use std::fmt;
use std::sync::Arc;

use geometry::contour::ray_crossing;
use geometry::measure::{l2_distance, perimeter, zero_set_volume};
use geometry::{Field, Grid};

use crate::Error;

/// The name of a measure of how far the surface has gone since the beginning, a length in the box.
pub const DISPLACEMENT: &str = "displacement";

type Function<const D: usize> =
    dyn Fn(&Field<D>, f64) -> Result<Option<f64>, geometry::Error> + Send + Sync;

/// A number that is measured on the phase field after every step, under a name.
#[derive(Clone)]
pub struct Measure<const D: usize> {
    name: String,
    of: Arc<Function<D>>,
}

impl<const D: usize> Measure<D> {
    /// A function of the phase field and the time; nothing where the shape does not have it.
    pub fn new(
        name: impl Into<String>,
        of: impl Fn(&Field<D>, f64) -> Result<Option<f64>, geometry::Error> + Send + Sync + 'static,
    ) -> Self {
        Self {
            name: name.into(),
            of: Arc::new(of),
        }
    }

    /// Perimeter `P_eps`, the length of a curve or the area of a surface, as `perimeter`; area or volume of `{u > 0}`, as `volume`.
    pub fn size(eps: f64) -> Vec<Self> {
        vec![
            Self::new("perimeter", move |u, _| perimeter(u, eps).map(Some)),
            Self::new("volume", |u, _| Ok(Some(zero_set_volume(u)))),
        ]
    }

    /// Distances from a point to the zero crossings on the ray along the first axis, as `tip`, and on the diagonal, as `diagonal`.
    pub fn crossings(centre: f64) -> Vec<Self> {
        let along = |name: &str, direction: [f64; D]| {
            Self::new(name, move |u, _| ray_crossing(u, [centre; D], direction))
        };
        let first = std::array::from_fn(|axis| if axis == 0 { 1.0 } else { 0.0 });
        vec![along("tip", first), along("diagonal", [1.0; D])]
    }

    /// `L2` distance to a phase field that depends on grid and time, as `l2`.
    pub fn distance_to(
        exact: impl Fn(Grid<D>, f64) -> Result<Field<D>, geometry::Error> + Send + Sync + 'static,
    ) -> Self {
        Self::new("l2", move |u, time| {
            l2_distance(u, &exact(*u.grid(), time)?).map(Some)
        })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its value.
    pub fn of(&self, field: &Field<D>, time: f64) -> Result<Option<f64>, Error> {
        Ok((self.of)(field, time)?)
    }
}

impl<const D: usize> fmt::Debug for Measure<D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

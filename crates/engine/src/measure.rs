//! What is measured after every step.

use std::sync::Arc;

use geometry::contour::ray_crossing;
use geometry::measure::{has_interface, l2_distance, perimeter, zero_set_volume};
use geometry::zero_set::reduced_volume;
use geometry::{Field, Grid, PhaseField, ZeroSet, distance_from_phase_field};

use crate::{Current, Error, Held, Values};

/// The name of a measure of how far the surface has gone since the beginning, a length in the box.
pub const DISPLACEMENT: &str = "displacement";

/// Nodes within so many spacings are near the zero set.
const NEAR: f64 = 2.0;

type Function<const D: usize> =
    dyn Fn(&Current<'_, D>, f64) -> Result<Vec<Option<f64>>, geometry::Error> + Send + Sync;

/// Numbers that are measured together on the phase field after every step, each under a name.
#[derive(Clone, derive_more::Debug)]
#[debug("{}", names.join(", "))]
pub struct Measure<const D: usize> {
    names: Vec<String>,
    of: Arc<Function<D>>,
}

impl<const D: usize> Measure<D> {
    /// A function of the phase field and the time; nothing where the shape does not have it. What is not finite stops the run.
    pub fn new(
        name: impl Into<String>,
        of: impl Fn(&Current<'_, D>, f64) -> Result<Option<f64>, geometry::Error>
        + Send
        + Sync
        + 'static,
    ) -> Self {
        Self {
            names: vec![name.into()],
            of: Arc::new(move |u, time| Ok(vec![of(u, time)?])),
        }
    }

    /// Sizes of the zero set ([`ZeroSet`]): `length` and `area` in 2D, `area` and `volume` in 3D, `reduced_volume`, and
    /// `integrated_mean_curvature`. Without a zero set the first is 0, and the second 0 or that of the box. Where it bends too sharply for them the
    /// sizes are those of the phase field, unless some are held, and the last is absent.
    pub fn zero_set(eps: f64, held: &Held) -> Self {
        let hold = !held.is_empty();
        let [boundary, inside] = match D {
            2 => ["length", "area"],
            _ => ["area", "volume"],
        };
        let names = [
            boundary,
            inside,
            "reduced_volume",
            "integrated_mean_curvature",
        ];
        Self {
            names: names.map(str::to_owned).to_vec(),
            of: Arc::new(move |u, _| {
                if !has_interface(u) {
                    return Ok(vec![Some(0.0), Some(zero_set_volume(u)), None, None]);
                }
                let zero_set = ZeroSet::of(u, eps)?;
                let (boundary, inside) = if hold || zero_set.sizes_hold() {
                    (zero_set.perimeter, zero_set.volume)
                } else {
                    (perimeter(u, eps)?, zero_set_volume(u))
                };
                let reduced = (boundary > 0.0).then(|| reduced_volume(D, boundary, inside));
                let curvature = zero_set.mean_curvature;
                let curvature = zero_set.curvatures_hold().then_some(curvature);
                Ok(vec![Some(boundary), Some(inside), reduced, curvature])
            }),
        }
    }

    /// Perimeter `P_eps`, the length of a curve or the area of a surface, as `perimeter`; area or volume of `{u > 0}`, as `volume`.
    pub fn size(eps: f64) -> Vec<Self> {
        vec![
            Self::new("perimeter", move |u, _| perimeter(u, eps).map(Some)),
            Self::new("volume", |u, _| Ok(Some(zero_set_volume(u)))),
        ]
    }

    /// How far the zero set has gone from that of `start`, along its normals, root of the mean square over it, as [`DISPLACEMENT`]: by
    /// how much the distances `-(4 eps/3) atanh u` have changed at the nodes near it.
    pub fn displacement(start: &impl PhaseField<D>, eps: f64) -> Self {
        let nodes = start.nodes();
        let spacing = nodes.grid().spacing();
        let distances = (start.values().iter()).map(|&u| distance_from_phase_field(u, eps));
        let near: Vec<([usize; D], f64)> = distances
            .enumerate()
            .filter(|(_, distance)| distance.abs() < NEAR * spacing)
            .map(|(node, distance)| (nodes.multi_index(node), distance))
            .collect();
        Self::new(DISPLACEMENT, move |u, _| {
            let (mut weights, mut squares) = (0.0, 0.0);
            for &(place, before) in &near {
                let weight = (-(before / spacing).powi(2)).exp();
                let gone = distance_from_phase_field(u.at(place), eps) - before;
                weights += weight;
                squares += weight * gone * gone;
            }
            Ok((weights > 0.0).then(|| (squares / weights).sqrt()))
        })
    }

    /// Distances from a point to the zero crossings on the ray along the first axis, as `tip`, and on the diagonal, as `diagonal`.
    pub fn crossings(centre: f64) -> Vec<Self> {
        let along = |name: &str, direction: [f64; D]| {
            Self::new(name, move |u, _| {
                ray_crossing(u.field(), [centre; D], direction)
            })
        };
        let first = std::array::from_fn(|axis| if axis == 0 { 1.0 } else { 0.0 });
        vec![along("tip", first), along("diagonal", [1.0; D])]
    }

    /// `L2` distance to a phase field that depends on grid and time, as `l2`.
    pub fn distance_to(
        exact: impl Fn(Grid<D>, f64) -> Result<Field<D>, geometry::Error> + Send + Sync + 'static,
    ) -> Self {
        Self::new("l2", move |u, time| {
            l2_distance(u, &exact(*u.nodes().grid(), time)?).map(Some)
        })
    }

    /// Their names.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.names.iter().map(String::as_str)
    }

    /// The values of all those that the shape has, at a time.
    pub(crate) fn values(
        measures: &[Self],
        now: &Current<'_, D>,
        time: f64,
    ) -> Result<Values, Error> {
        let mut values = Values::new();
        for measure in measures {
            let measured = measure.names.iter().cloned().zip((measure.of)(now, time)?);
            values.extend(measured.filter_map(|(name, value)| Some((name, value?))));
        }
        match values.iter().find(|(_, value)| !value.is_finite()) {
            Some((name, &value)) => {
                let name = name.clone();
                Err(Error::NonFinite { name, value, time })
            }
            None => Ok(values),
        }
    }
}

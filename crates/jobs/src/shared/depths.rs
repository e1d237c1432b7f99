//! How deep points are in smooth labels.

use geometry::distances_from_phase_field;
use rayon::prelude::*;
use surfaces::{BACKGROUND, LabelLattice};

use crate::prelude::*;
use crate::session::Flowed;

/// Beyond so many cells from its surface, a distance is that of the nearest node.
const FAR: f64 = 4.0;
/// Labels whose voxels are so far from all labels as one, in voxels, are no part of it.
const APART: f64 = 0.25;

/// A smooth label: the zero level set of its flow, with the parts that did not flow.
struct Smooth {
    /// Negative inside.
    distance: Stored<3>,
    resting: Option<MeshDistance>,
    bounds: BoundingBox<3>,
    /// The depth of what is far away.
    outside: f64,
}

impl Smooth {
    fn of(flowed: &Flowed) -> Result<Self> {
        let distance = distances_from_phase_field(&flowed.field, flowed.eps)?;
        let grid = *distance.grid();
        let [lower, upper] =
            [0, grid.cells() - 1].map(|i| [0, 1, 2].map(|axis| grid.coordinate(axis, i)));
        let outside = -distance.phase_values()[0].abs();
        // What has vanished in the flow is as it was.
        let vanished = !has_interface(&flowed.field);
        let resting = if vanished {
            Some(MeshDistance::new(flowed.voxels.surface()))
        } else {
            flowed.voxels.resting().as_ref().map(MeshDistance::new)
        };
        Ok(Self {
            distance,
            resting,
            bounds: BoundingBox { lower, upper },
            outside,
        })
    }

    fn contains(&self, x: [f64; 3]) -> bool {
        let BoundingBox { lower, upper } = &self.bounds;
        (0..3).all(|axis| (lower[axis]..=upper[axis]).contains(&x[axis]))
    }

    /// The depth and its gradient.
    fn at(&self, x: [f64; 3]) -> (f64, [f64; 3]) {
        if !self.contains(x) {
            return (self.outside, [0.0; 3]);
        }
        let (value, gradient) = self.distance.spline(x);
        self.or_resting(x, (-value, gradient.map(|slope| -slope)))
    }

    /// The depth alone.
    fn depth(&self, x: [f64; 3]) -> f64 {
        if !self.contains(x) {
            return self.outside;
        }
        let grid = self.distance.grid();
        let near = [0, 1, 2].map(|axis| {
            let place = (x[axis] - grid.origin()[axis]) / grid.spacing();
            (place.round() as usize).min(grid.cells() - 1)
        });
        let near = -self.distance.at(near);
        if near.abs() < FAR * grid.spacing() {
            return self.at(x).0;
        }
        self.or_resting(x, (near, [0.0; 3])).0
    }

    fn or_resting(&self, x: [f64; 3], flowing: (f64, [f64; 3])) -> (f64, [f64; 3]) {
        let Some(resting) = &self.resting else {
            return flowing;
        };
        let offset = resting.offsets(&[x])[0];
        let depth = -resting.signed_distance(x);
        if depth <= flowing.0 {
            return flowing;
        }
        // Away from the nearest point, if it is inside.
        (depth, offset.map(|way| way / depth))
    }
}

/// All labels of a segmentation, each as deep as it is smooth, and moved by a length of its own.
///
/// The background is what is outside of all labels together and of those that are apart, so that the edge at which two labels meet it does not become
/// a groove. Elsewhere a point belongs to the label in which it is deepest.
pub struct Depths {
    labels: Vec<Smooth>,
    /// All labels as one, if there are several.
    all: Option<Smooth>,
    /// Labels that are apart from it, since they are so small that it has no part for them.
    alone: Vec<usize>,
    /// What is added to the depth of each label; the first is that of the background, which stays 0.
    pub offsets: Vec<f64>,
}

impl Depths {
    pub fn new(labels: &[Flowed], all: Option<&Flowed>) -> Result<Self> {
        let all = all.map(Smooth::of).transpose()?;
        let is_apart = |flowed: &Flowed, all: &Smooth| {
            let surface = flowed.voxels.surface().mesh();
            let mut vertices = surface.vertices.iter();
            vertices.all(|&x| all.at(x).0 < -APART * flowed.voxels.side)
        };
        let alone = all.iter().flat_map(|all| {
            let numbers = 0..labels.len();
            numbers.filter(|&number| is_apart(&labels[number], all))
        });
        Ok(Self {
            offsets: vec![0.0; labels.len() + 1],
            alone: alone.collect(),
            labels: labels.iter().map(Smooth::of).collect::<Result<_>>()?,
            all,
        })
    }

    fn all(&self) -> &Smooth {
        self.all.as_ref().unwrap_or(&self.labels[0])
    }

    /// The labels apart in whose grids a point is.
    fn alone(&self, x: [f64; 3]) -> impl Iterator<Item = &Smooth> {
        let labels = self.alone.iter().map(|&number| &self.labels[number]);
        labels.filter(move |label| label.contains(x))
    }

    /// The depth in all labels together, with its gradient.
    fn in_all(&self, x: [f64; 3]) -> (f64, [f64; 3]) {
        let deepest = self.all().at(x);
        self.alone(x)
            .map(|label| label.at(x))
            .fold(deepest, |a, b| if b.0 > a.0 { b } else { a })
    }

    /// By how much a point is deeper in the first of two labels than in the second, with the gradient. The wall between them moves by half of the
    /// difference of what is added to their depths, also that of the background.
    pub fn between(&self, [a, b]: [u32; 2], x: [f64; 3]) -> (f64, [f64; 3]) {
        let added = self.offsets[a as usize] - self.offsets[b as usize];
        let ((depth, slope), factor) = match [a, b] {
            [BACKGROUND, _] => (self.in_all(x), -2.0),
            [_, BACKGROUND] => (self.in_all(x), 2.0),
            [a, b] => {
                let [(a, slope_a), (b, slope_b)] =
                    [a, b].map(|l| self.labels[l as usize - 1].at(x));
                let slope = [0, 1, 2].map(|axis| slope_a[axis] - slope_b[axis]);
                ((a - b, slope), 1.0)
            }
        };
        (factor * depth + added, slope.map(|slope| factor * slope))
    }

    /// The label of a point.
    pub fn label(&self, x: [f64; 3]) -> u32 {
        let alone = self.alone(x).map(|label| label.depth(x));
        let depth = 2.0 * alone.fold(self.all().depth(x), f64::max);
        let far = self.all().distance.grid().spacing();
        if depth < -FAR * far {
            return BACKGROUND;
        }
        let mut deepest = (BACKGROUND, f64::NEG_INFINITY);
        for (number, label) in (1..).zip(&self.labels) {
            if label.contains(x) {
                let depth = label.depth(x) + self.offsets[number as usize];
                if depth > deepest.1 {
                    deepest = (number, depth);
                }
            }
        }
        let (label, _) = deepest;
        if depth + self.offsets[label as usize] > 0.0 {
            label
        } else {
            BACKGROUND
        }
    }

    /// The labels of the nodes of a lattice.
    pub fn on(&self, lattice: &LabelLattice) -> LabelLattice {
        let [layers, rows, columns] = lattice.size;
        let nodes = (0..layers * rows * columns).into_par_iter();
        let labels = nodes.map(|node| {
            let place = [
                node / (rows * columns),
                node / columns % rows,
                node % columns,
            ];
            self.label(lattice.position(place))
        });
        LabelLattice {
            labels: labels.collect(),
            ..lattice.clone()
        }
    }
}

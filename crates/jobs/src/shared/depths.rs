//! How deep points are in smooth labels.

use geometry::distances_from_phase_field;
use rayon::prelude::*;
use surfaces::{BACKGROUND, LabelLattice};

use crate::prelude::*;
use crate::session::Flowed;

/// Beyond so many cells from its surface, a distance is that of the nearest node.
const FAR: f64 = 4.0;

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
pub struct Depths {
    labels: Vec<Smooth>,
    /// All labels as one, if there are several; less its depth is that of the background.
    all: Option<Smooth>,
    /// What is added to the depth of each label, and of the background, which is the first.
    pub offsets: Vec<f64>,
}

impl Depths {
    pub fn new(labels: &[Flowed], all: Option<&Flowed>) -> Result<Self> {
        Ok(Self {
            offsets: vec![0.0; labels.len() + 1],
            labels: labels.iter().map(Smooth::of).collect::<Result<_>>()?,
            all: all.map(Smooth::of).transpose()?,
        })
    }

    /// Of one label, with the gradient.
    pub fn at(&self, label: u32, x: [f64; 3]) -> (f64, [f64; 3]) {
        let (depth, slope) = if label == BACKGROUND {
            let (depth, slope) = self.all.as_ref().unwrap_or(&self.labels[0]).at(x);
            (-depth, slope.map(|slope| -slope))
        } else {
            self.labels[label as usize - 1].at(x)
        };
        (depth + self.offsets[label as usize], slope)
    }

    /// The label in which a point is deepest; of several the first.
    pub fn deepest(&self, x: [f64; 3]) -> u32 {
        let background = -self.all.as_ref().unwrap_or(&self.labels[0]).depth(x);
        let mut deepest = (BACKGROUND, background + self.offsets[0]);
        for (number, label) in (1..).zip(&self.labels) {
            if label.contains(x) {
                let depth = label.depth(x) + self.offsets[number as usize];
                if depth > deepest.1 {
                    deepest = (number, depth);
                }
            }
        }
        deepest.0
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
            self.deepest(lattice.position(place))
        });
        LabelLattice {
            labels: labels.collect(),
            ..lattice.clone()
        }
    }
}

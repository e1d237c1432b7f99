//! Segmentations of known shapes, and how near surfaces are to these.

use chacha20::ChaCha8Rng;
use geometry::shapes::{Capsule, Torus};
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use surfaces::{isosurface, samples};
use volumes::{Inside, Values, Volume};

use crate::prelude::*;

/// Layers of voxels around a body.
const MARGIN: f64 = 3.0;
/// Within a voxel of its surface, this part of the labels of the ball is wrong.
pub const WRONG: f64 = 0.15;
/// Cells of the grid on which the area of a shape is measured.
const AREA_CELLS: usize = 96;
/// Points along a voxel at which volumes of places, gaps and overlaps are counted.
const POINTS: usize = 2;

type Shape = Box<dyn SignedDistance<3>>;

/// Known shapes as voxels. Lengths are in millimetres, and the volume of a voxel is one cubic millimetre.
pub struct Segmentation {
    pub name: &'static str,
    /// The shape of each label, which are 1, 2 and so on.
    pub shapes: Vec<Shape>,
    pub volume: Volume,
    pub up: UpAxis,
    /// Where a thin part of the body begins that ends at the side of the volume: its coordinates along the first axis are less.
    pub thin_below: Option<f64>,
    areas: Vec<f64>,
}

/// Names of the bodies, with voxels along the longest side in quick runs and usually.
pub const BODIES: [(&str, [usize; 2]); 6] = [
    ("ball", [16, 32]),
    ("figure", [24, 48]),
    ("vessel", [20, 40]),
    ("torus", [16, 32]),
    ("cortex", [24, 48]),
    ("sectors", [16, 36]),
];

/// A sheet of three voxels about a folded sphere.
struct Sheet {
    middle: MeshDistance,
}

const HALF_SHEET: f64 = 1.5;

impl SignedDistance<3> for Sheet {
    fn signed_distance(&self, x: [f64; 3]) -> f64 {
        self.middle.signed_distance(x).abs() - HALF_SHEET
    }
}

impl Sheet {
    /// Folds as deep as four voxels and some twelve wide.
    fn new(centre: [f64; 3], radius: f64) -> Result<Self> {
        let folds = (radius / 2.0).round();
        let depth = 2.0;
        let grid = Grid::<3>::new(96, 2.5 * radius)?;
        let grid = grid.with_origin(centre.map(|x| x - 1.25 * radius))?;
        let folded = Field::from_fn(grid, |x| {
            let [x, y, z] = [0, 1, 2].map(|i| x[i] - centre[i]);
            let across = x.hypot(y);
            let away = across.hypot(z).max(1e-9);
            let turn = (0.5 * folds * y.atan2(x)).cos() * (across / away).powi(2);
            let height = (0.5 * folds * z.atan2(across)).cos();
            away - (radius - HALF_SHEET - depth) - depth * turn * height
        });
        let (middle, _) = ClosedMesh::new(isosurface(&folded)?)?;
        Ok(Self {
            middle: MeshDistance::new(&middle),
        })
    }
}

/// A third of a ball.
struct Sector {
    ball: Ball<3>,
    centre: [f64; 3],
    number: usize,
}

impl SignedDistance<3> for Sector {
    fn signed_distance(&self, x: [f64; 3]) -> f64 {
        let turn = |number: usize| 0.2 + 2.0 * PI / 3.0 * number as f64;
        let [dx, dy] = [x[0] - self.centre[0], x[1] - self.centre[1]];
        let beyond = |angle: f64| dx * angle.sin() - dy * angle.cos();
        let (first, second) = (beyond(turn(self.number)), -beyond(turn(self.number + 1)));
        // The wedge between two half planes.
        self.ball.signed_distance(x).max(first).max(second)
    }
}

/// Moved and scaled.
struct Placed<S> {
    shape: S,
    centre: [f64; 3],
}

impl<S: SignedDistance<3>> SignedDistance<3> for Placed<S> {
    fn signed_distance(&self, x: [f64; 3]) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|i| x[i] - self.centre[i]);
        // Turned, so that no axis is one of the voxels.
        let (c, s) = (0.6_f64.cos(), 0.6_f64.sin());
        self.shape
            .signed_distance([x, c * y + s * z, c * z - s * y])
    }
}

impl Segmentation {
    pub fn new(name: &'static str, voxels: usize, seed: u64) -> Result<Self> {
        let side = voxels as f64;
        let centre = [0.5 * side + MARGIN + 0.2; 3];
        let mut sides = [1.0; 3];
        let mut up = UpAxis::Z;
        let (mut wrong, mut thin_below) = (0.0, None);
        let shapes: Vec<Shape> = match name {
            "ball" => {
                wrong = WRONG;
                vec![Box::new(Ball::new(centre, 0.5 * side)?)]
            }
            "figure" => {
                up = UpAxis::Y;
                let figure = samples::figure(96)?;
                let bounds = figure.bounding_box();
                let scale = side / bounds.longest_side();
                let corner = std::array::from_fn(|i| bounds.centre()[i] - centre[i] / scale);
                let placed = figure.placed(&Placement::about(corner, scale)?);
                vec![Box::new(MeshDistance::new(&placed))]
            }
            "vessel" => {
                let at =
                    |along: f64| [centre[0] + along * side, centre[1] - 0.23 * side, centre[2]];
                let tube = Capsule::new(at(-0.42), at(0.42), 0.075 * side)?;
                let sac = Ball::new(centre.map(|x| x + 0.02 * side), 0.21 * side)?;
                thin_below = Some(centre[0] - 0.25 * side);
                vec![Box::new(tube.union(sac))]
            }
            "torus" => {
                sides = [0.7, 0.7, 0.49_f64.recip()];
                let shape = Torus::new(0.34 * side, 0.15 * side)?;
                vec![Box::new(Placed { shape, centre })]
            }
            "cortex" => vec![Box::new(Sheet::new(centre, 0.5 * side)?)],
            _ => {
                let ball = Ball::new(centre, 0.5 * side)?;
                let sector = |number| -> Shape {
                    Box::new(Sector {
                        ball,
                        centre,
                        number,
                    })
                };
                (0..3).map(sector).collect()
            }
        };
        let size = sides.map(|voxel| ((side + 2.0 * MARGIN) / voxel).ceil() as usize + 1);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let labels = (0..size.iter().product()).map(|voxel: usize| {
            let index = [
                voxel % size[0],
                voxel / size[0] % size[1],
                voxel / (size[0] * size[1]),
            ];
            let x = std::array::from_fn(|i| index[i] as f64 * sides[i]);
            let inside = shapes
                .iter()
                .position(|shape| shape.signed_distance(x) < 0.0);
            let is_wrong = wrong > 0.0
                && shapes[0].signed_distance(x).abs() < 1.0
                && rng.random::<f64>() < wrong;
            match (inside, is_wrong) {
                (Some(number), false) => number as u8 + 1,
                (None, true) => 1,
                _ => 0,
            }
        });
        let volume = Volume::of_labels(size, [0.0; 3], sides, labels.collect())?;
        let box_side = side + 2.0 * MARGIN;
        let grid =
            Grid::new(AREA_CELLS, box_side)?.with_origin(centre.map(|x| x - 0.5 * box_side))?;
        let area = |shape: &Shape| -> Result<f64> {
            let field = Field::from_fn(grid, |x| shape.signed_distance(x));
            Ok(ClosedMesh::new(isosurface(&field)?)?.0.area())
        };
        Ok(Self {
            name,
            areas: shapes.iter().map(area).collect::<Result<_>>()?,
            shapes,
            volume,
            up,
            thin_below,
        })
    }

    /// The voxels of one label alone, as 1.
    pub fn mask(&self, label: usize) -> Result<Volume> {
        let is_it = |value: f64| u8::from(value.round() as usize == label);
        let mask = self.volume.values().map(is_it).collect();
        Ok(self.volume.with_values(&Values::U8(mask))?)
    }

    /// The surface between the voxels of a label by marching tetrahedra, without specks.
    pub fn marched(&self, label: usize) -> Result<ClosedMesh> {
        let body = self.mask(label)?.body(Inside::Above(0.5))?;
        Ok(body.surface.without_small_parts(8.0)?)
    }

    fn voxels(&self, label: usize) -> f64 {
        let counts = self.volume.labels().unwrap_or_default();
        let found = counts.iter().find(|(value, _)| *value as usize == label);
        found.map_or(0.0, |(_, count)| *count as f64) * self.volume.voxel_volume()
    }

    /// How near the surfaces of all labels are to their shapes: worst values over the labels, but means of distances and angles.
    pub fn measured(&self, meshes: &[TriangleMesh]) -> Result<Numbers> {
        let all: Vec<Numbers> = (meshes.iter().enumerate())
            .map(|(number, mesh)| self.measured_label(number, mesh))
            .collect();
        let mean = |name: &str| all.iter().map(|one| one[name]).sum::<f64>() / all.len() as f64;
        let worst = |name: &str| {
            let values = all.iter().map(|one| one[name]);
            values
                .max_by(|a, b| a.abs().total_cmp(&b.abs()))
                .unwrap_or_default()
        };
        let mut numbers = Numbers::from([
            ("rms", mean("rms")),
            ("largest", worst("largest")),
            ("normals", mean("normals")),
            ("area", worst("area")),
            ("volume", worst("volume")),
        ]);
        let closed: Option<Vec<MeshDistance>> = (meshes.iter())
            .map(|mesh| {
                ClosedMesh::new(mesh.clone())
                    .ok()
                    .map(|(mesh, _)| MeshDistance::new(&mesh))
            })
            .collect();
        if let Some(distances) = closed {
            if let Some(below) = self.thin_below {
                numbers.insert("thin", self.thin_change(&distances[0], below));
            }
            if meshes.len() > 1 {
                let [gaps, overlaps] = self.misfits(&distances);
                numbers.insert("gaps", gaps);
                numbers.insert("overlaps", overlaps);
            }
        }
        Ok(numbers)
    }

    /// The root of the mean square distance of the surfaces to their shapes, a mean over the labels.
    pub fn distance(&self, meshes: &[TriangleMesh]) -> f64 {
        let pairs = meshes.iter().zip(&self.shapes);
        let all = pairs.map(|(mesh, shape)| Nearness::of(mesh, &**shape).rms());
        all.sum::<f64>() / meshes.len() as f64
    }

    fn measured_label(&self, number: usize, mesh: &TriangleMesh) -> Numbers {
        let shape = &*self.shapes[number];
        let nearness = Nearness::of(mesh, shape);
        let angles = mesh.faces.par_iter().map(|face| {
            let middle = middle(mesh, *face);
            let (a, b) = (mesh.face_normal(*face), normal(shape, middle));
            let cosine: f64 = (0..3).map(|i| a[i] * b[i]).sum();
            area(mesh, *face) * cosine.clamp(-1.0, 1.0).acos().to_degrees()
        });
        let angles: Vec<f64> = angles.collect();
        let voxels = self.voxels(number + 1);
        Numbers::from([
            ("rms", nearness.rms()),
            ("largest", nearness.largest),
            ("normals", angles.iter().sum::<f64>() / nearness.area),
            ("area", 100.0 * (nearness.area / self.areas[number] - 1.0)),
            ("volume", 100.0 * (mesh.volume() / voxels - 1.0)),
        ])
    }

    /// The points of a lattice finer than the voxels where something holds.
    fn points(&self, holds: impl Fn([f64; 3]) -> bool) -> Vec<[f64; 3]> {
        let size = self.volume.size().map(|n| n * POINTS);
        let place = |point: usize| {
            let index = [
                point % size[0],
                point / size[0] % size[1],
                point / (size[0] * size[1]),
            ];
            self.volume
                .position(index.map(|i| (i as f64 + 0.5) / POINTS as f64 - 0.5))
        };
        let points = (0..size.iter().product()).map(place);
        points.filter(|x| holds(*x)).collect()
    }

    /// The change of the volume of a thin part, in percent.
    fn thin_change(&self, distance: &MeshDistance, below: f64) -> f64 {
        let points = self.points(|x| x[0] < below);
        let inside = distance.signed_distances(&points);
        let found = inside.into_iter().filter(|s| *s < 0.0).count() as f64;
        // As many points around each voxel.
        let voxel = |x: [f64; 3]| {
            let index = x.map(|v| v.round().max(0.0) as usize);
            self.volume.value(std::array::from_fn(|i| {
                index[i].min(self.volume.size()[i] - 1)
            }))
        };
        let expected = points.iter().filter(|x| voxel(**x) > 0.5).count() as f64;
        100.0 * (found / expected - 1.0)
    }

    /// The volumes of what is deeper than a voxel in all shapes together and belongs to no label, and of what belongs to several, in percent of this.
    fn misfits(&self, distances: &[MeshDistance]) -> [f64; 2] {
        let depth = |x: [f64; 3]| {
            let depths = self.shapes.iter().map(|shape| shape.signed_distance(x));
            depths.fold(f64::INFINITY, f64::min)
        };
        // Near a wall all depths are small: what counts is that points around it are inside.
        let near = |x: [f64; 3], axis: usize, by: f64| {
            let mut x = x;
            x[axis] += by;
            depth(x) < 0.0
        };
        let is_within = |x: [f64; 3]| {
            (0..3).all(|axis| near(x, axis, 2.0) && near(x, axis, -2.0)) && near(x, 0, 0.01)
        };
        let points = self.points(is_within);
        let mut owners = vec![0_usize; points.len()];
        for distance in distances {
            for (owner, s) in owners.iter_mut().zip(distance.signed_distances(&points)) {
                *owner += usize::from(s < 0.0);
            }
        }
        let percent = |count: usize| 100.0 * count as f64 / points.len() as f64;
        let gaps = owners.iter().filter(|count| **count == 0).count();
        let overlaps = owners.iter().filter(|count| **count > 1).count();
        [gaps, overlaps].map(percent)
    }
}

/// The distances of a surface to a shape.
struct Nearness {
    area: f64,
    /// Integral of the squares.
    squares: f64,
    largest: f64,
}

impl Nearness {
    fn of(mesh: &TriangleMesh, shape: &dyn SignedDistance<3>) -> Self {
        let at = mesh.vertices.par_iter().map(|&x| shape.signed_distance(x));
        let at: Vec<f64> = at.collect();
        let faces = mesh.faces.par_iter().map(|&face| {
            let corners = face
                .map(|vertex| at[vertex as usize].powi(2))
                .iter()
                .sum::<f64>();
            let middle = shape.signed_distance(middle(mesh, face)).powi(2);
            // Exact for quadratic functions.
            let area = area(mesh, face);
            [area, area * (corners / 12.0 + 0.75 * middle)]
        });
        let faces: Vec<[f64; 2]> = faces.collect();
        Self {
            area: faces.iter().map(|face| face[0]).sum(),
            squares: faces.iter().map(|face| face[1]).sum(),
            largest: at.into_iter().map(f64::abs).fold(0.0, f64::max),
        }
    }

    fn rms(&self) -> f64 {
        (self.squares / self.area).sqrt()
    }
}

fn middle(mesh: &TriangleMesh, face: [u32; 3]) -> [f64; 3] {
    let corners = face.map(|vertex| mesh.vertices[vertex as usize]);
    std::array::from_fn(|i| corners.iter().map(|x| x[i]).sum::<f64>() / 3.0)
}

fn area(mesh: &TriangleMesh, face: [u32; 3]) -> f64 {
    let corners = face.map(|vertex| mesh.vertices[vertex as usize]);
    let [u, v] = [1, 2].map(|k: usize| [0, 1, 2].map(|i| corners[k][i] - corners[0][i]));
    let cross = [0, 1, 2].map(|i: usize| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        u[j] * v[k] - u[k] * v[j]
    });
    0.5 * cross.iter().map(|c| c * c).sum::<f64>().sqrt()
}

/// The direction in which the distance grows.
fn normal(shape: &dyn SignedDistance<3>, x: [f64; 3]) -> [f64; 3] {
    const STEP: f64 = 1e-3;
    let along = |axis: usize| {
        let at = |by: f64| {
            let mut x = x;
            x[axis] += by;
            shape.signed_distance(x)
        };
        at(STEP) - at(-STEP)
    };
    let gradient = [0, 1, 2].map(along);
    let length = gradient.iter().map(|v| v * v).sum::<f64>().sqrt();
    gradient.map(|v| v / length.max(1e-12))
}

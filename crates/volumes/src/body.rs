//! Bodies in volumes, and their surfaces.

use std::collections::BTreeMap;

use derive_more::Display;
use glam::DVec3;
use surfaces::{Cells, ClosedMesh, Filling, Parts, TriangleMesh, lattice_surface};

use crate::volume::label_tolerance;
use crate::{Error, Values, Volume};

/// More values than this are no labels.
const MOST_LABELS: usize = 4096;
/// Layers of voxels around a body that its surface depends on.
const MARGIN: usize = 2;
/// Rounds in which the steps of labels are taken off,
const ROUNDS: usize = 30;
/// and how far vertices may go, as a part of the way to the centres of the voxels on both sides; less where sheets would cross.
const REACHES: [f64; 3] = [0.9, 0.45, 0.0];
/// Parts whose surface, by marching tetrahedra, encloses fewer voxels are specks.
const SPECK: f64 = 8.0;
/// Waves that are longer than some five times so many voxels are those of the voxels.
const LONG: f64 = 3.0;

/// Which voxels are inside.
#[derive(Clone, Copy, Debug, PartialEq, Display)]
pub enum Inside {
    /// Those of this value, up to rounding.
    #[display("labelled {_0}")]
    Label(f64),
    /// Those of larger values; the surface is where the values, interpolated, are this one.
    #[display("above {_0}")]
    Above(f64),
}

impl Inside {
    fn holds(self, value: f64) -> bool {
        match self {
            Self::Label(label) => (value - label).abs() <= label_tolerance(label),
            Self::Above(threshold) => value > threshold,
        }
    }
}

/// What is inside, in the coordinates of the volume.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its surface, around the volume of its voxels without the specks, or through where values pass the threshold.
    pub surface: ClosedMesh,
    /// The side of a cube as large as a voxel.
    pub voxel: f64,
    /// The parts and holes that are left out.
    pub specks: Vec<Speck>,
}

/// A part or hole of few voxels that is left out of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speck {
    /// How many voxels leaving it out adds: those of a hole, or less those of a part.
    pub filled: isize,
    /// Its centre of mass.
    pub place: [f64; 3],
}

impl Volume {
    /// The values in ascending order, each with the number of its voxels, if they can be labels: there are no more than 4096, all of
    /// them whole, up to the rounding of a scale. NaN is none of them.
    pub fn labels(&self) -> Option<Vec<(f64, usize)>> {
        let mut counts: BTreeMap<i64, usize> = BTreeMap::new();
        let mut values = self.values().peekable();
        // Neighbours are mostly alike.
        while let Some(value) = values.next() {
            let mut run = 1;
            while (values.next_if(|next| next.to_bits() == value.to_bits())).is_some() {
                run += 1;
            }
            if value.is_nan() {
                continue;
            }
            let value = self.rounded(value);
            if value.fract() != 0.0 || value.abs() > 2_f64.powi(53) {
                return None;
            }
            *counts.entry(value as i64).or_default() += run;
            if counts.len() > MOST_LABELS {
                return None;
            }
        }
        let counts = counts.into_iter();
        Some(counts.map(|(value, count)| (value as f64, count)).collect())
    }

    /// The same voxels with the value 1 for all labels but 0, and 0 for all others. Voxels that are not a number are outside, as of each label.
    ///
    /// # Errors
    /// As [`Volume::with_values`].
    pub fn labels_as_one(&self) -> Result<Self, Error> {
        let is_labelled = |value: f64| !value.is_nan() && self.rounded(value) != 0.0;
        let inside = self.values().map(|value| u8::from(is_labelled(value)));
        self.with_values(&Values::U8(inside.collect()))
    }

    /// The least and the largest value.
    pub fn range(&self) -> [f64; 2] {
        let all = [f64::INFINITY, f64::NEG_INFINITY];
        self.values()
            .fold(all, |[low, high], v| [low.min(v), high.max(v)])
    }

    /// The body that some voxels are, of which there must be one, as a closed surface. Outside of the volume is outside, and so are voxels
    /// that are not a number.
    ///
    /// The surface of labels is that by marching tetrahedra without its steps, which tell of the voxels and not of the body: vertices
    /// move towards the middle of their neighbours again and again while every part and cavity keeps the volume of its voxels, but each
    /// vertex stays between the centres of the voxels whose difference put it there. (S. F. F. Gibson: Constrained elastic surface nets.
    /// MICCAI 1998.) This makes places thinner that bend more. So each place gets the volume of its voxels back, on the average over three
    /// voxels ([`TriangleMesh::with_filling`]). Parts and holes inside whose surface there are fewer than eight voxels are taken for noise
    /// and left out, if there are larger ones: their voxels do not count.
    pub fn body(&self, inside: Inside) -> Result<Body, Error> {
        let part = Part::of(self, inside)?;
        let (lattice, _) = ClosedMesh::new(part.surface(self, inside)?)?;
        let voxel = self.voxel_volume().cbrt();
        let Inside::Label(_) = inside else {
            return Ok(Body {
                surface: ClosedMesh::new(self.placed(lattice.mesh()))?.0,
                voxel,
                specks: Vec::new(),
            });
        };
        let large = lattice.without_small_parts(SPECK)?;
        let specks = if large.components() < lattice.components() {
            self.specks(&lattice, inside)
        } else {
            Vec::new()
        };
        Ok(Body {
            surface: self.without_steps(&large, inside)?,
            voxel,
            specks,
        })
    }

    /// The small parts of a surface in voxels.
    fn specks(&self, lattice: &ClosedMesh, inside: Inside) -> Vec<Speck> {
        let (parts, mesh) = (lattice.parts(), lattice.mesh());
        let voxels = self.voxels_within(mesh, &parts, inside).into_iter();
        let all = voxels.zip(parts.volumes(mesh)).zip(parts.centroids(mesh));
        let small = all.filter(|((_, volume), _)| volume.abs() < SPECK);
        let speck = |((voxels, _), centre): ((f64, f64), [f64; 3])| Speck {
            filled: -voxels as isize,
            place: self.position(centre),
        };
        small.map(speck).collect()
    }

    /// Where the surface of a label crosses rows of voxels along the last axis: there it has a vertex half-way between two voxels of which one is
    /// inside. The voxel before it, and whether that is the one.
    fn crossings(
        &self,
        lattice: &TriangleMesh,
        inside: Inside,
    ) -> impl Iterator<Item = (usize, [i64; 3], bool)> {
        let between = |x: &[f64; 3]| x.map(is_half) == [false, false, true];
        let vertices = lattice.vertices.iter().enumerate();
        vertices
            .filter(move |(_, x)| between(x))
            .map(move |(vertex, x)| {
                let before = [x[0].round(), x[1].round(), x[2].floor()].map(|v| v as isize);
                let is_inside = self.depth(before, inside) > 0.0;
                (vertex, before.map(|i| i as i64), is_inside)
            })
    }

    /// The number of voxels within each part of the surface of a label: the sum of the places where it crosses rows of voxels, those where rows
    /// enter it taken as negative.
    fn voxels_within(&self, lattice: &TriangleMesh, parts: &Parts, inside: Inside) -> Vec<f64> {
        let mut voxels = vec![0.0; parts.count()];
        for (vertex, before, is_inside) in self.crossings(lattice, inside) {
            let place = before[2] as f64 + 0.5;
            voxels[parts.of_vertices()[vertex] as usize] += if is_inside { place } else { -place };
        }
        voxels
    }

    /// Positive inside and negative outside, also outside of the volume.
    fn depth(&self, voxel: [isize; 3], inside: Inside) -> f64 {
        let size = self.size();
        let nearest = [0, 1, 2].map(|axis| voxel[axis].clamp(0, size[axis] as isize - 1));
        let value = self.value(nearest.map(|i| i as usize));
        let depth = match inside {
            Inside::Label(_) if inside.holds(value) => 0.5,
            Inside::Label(_) => -0.5,
            Inside::Above(threshold) if value.is_nan() => {
                self.depth_without_number(nearest, threshold)
            }
            Inside::Above(threshold) => value - threshold,
        };
        if nearest == voxel {
            depth
        } else {
            -depth.abs()
        }
    }

    /// The depth of a voxel that is not a number: the surface is half-way between it and those inside around it, as at the side of the volume.
    fn depth_without_number(&self, voxel: [isize; 3], threshold: f64) -> f64 {
        let size = self.size();
        let around = (0..27).map(|n| [n % 3, n / 3 % 3, n / 9]);
        let around = around.map(|step| [0, 1, 2].map(|axis| voxel[axis] + step[axis] - 1));
        let exist = |x: &[isize; 3]| (0..3).all(|axis| (0..size[axis] as isize).contains(&x[axis]));
        let depths = around.filter(exist);
        let depths = depths.map(|x| self.value(x.map(|i| i as usize)) - threshold);
        let inside = depths.filter(|&depth| depth > 0.0);
        let (sum, count) = inside.fold((0.0, 0), |(sum, n), depth| (sum + depth, n + 1));
        // Without any of them, nothing depends on how far outside it is.
        if count == 0 {
            -1.0
        } else {
            -sum / f64::from(count)
        }
    }

    /// A surface in voxels, in the coordinates of the volume.
    fn placed(&self, lattice: &TriangleMesh) -> TriangleMesh {
        let vertices = lattice.vertices.iter().map(|&x| self.position(x));
        let turned = |&[a, b, c]: &[u32; 3]| [a, c, b];
        TriangleMesh {
            vertices: vertices.collect(),
            // Where the axes are left-handed.
            faces: if self.frame.matrix3.determinant() < 0.0 {
                lattice.faces.iter().map(turned).collect()
            } else {
                lattice.faces.clone()
            },
            normals: None,
        }
    }

    /// The surface of a label, from that in voxels.
    fn without_steps(&self, lattice: &ClosedMesh, inside: Inside) -> Result<ClosedMesh, Error> {
        let (parts, marched) = (lattice.parts(), lattice.mesh());
        let voxels = self.voxels_within(marched, &parts, inside).into_iter();
        let volumes: Vec<f64> = voxels.map(|count| count * self.voxel_volume()).collect();
        let rows = self.crossings(marched, inside);
        let filling = Filling::of_rows(self.cells(), rows.map(|(_, cell, ends)| (cell, ends)));
        let width = LONG * self.voxel_volume().cbrt();
        let mesh = self.placed(marched);
        let to_voxels = self.frame.matrix3.inverse();
        // A vertex is in the middle of an edge along one axis or more, where its coordinates are halves.
        let halves = |x: &[f64; 3]| x.iter().filter(|v| is_half(**v)).count();
        let to_centres: Vec<f64> = (marched.vertices.iter())
            .map(|x| 0.5 * (halves(x) as f64).sqrt())
            .collect();
        let relaxed = |reach: f64| {
            let relaxed = mesh.relaxed(ROUNDS, &parts, &volumes, |vertex, way| {
                (reach * to_centres[vertex] / (to_voxels * DVec3::from_array(way)).length())
                    .min(1.0)
            });
            let filled = relaxed.with_filling(&filling, width);
            filled.with_volumes(&parts, &volumes)
        };
        let mut surfaces = REACHES
            .into_iter()
            .map(|reach| ClosedMesh::new(relaxed(reach)));
        match surfaces.find_map(Result::ok) {
            Some((surface, _)) => Ok(surface),
            None => Ok(ClosedMesh::new(mesh)?.0),
        }
    }

    /// The voxels as cells.
    fn cells(&self) -> Cells {
        let [a, b, c] = self.frame.matrix3.to_cols_array_2d();
        Cells::new(self.position([0.0; 3]), [a, b, c])
    }
}

/// Half-way between two voxels, up to rounding.
fn is_half(coordinate: f64) -> bool {
    (coordinate.fract().abs() - 0.5).abs() < 0.25
}

/// The part of a volume where something is inside.
struct Part {
    /// The first voxel inside along each axis, less the margin,
    first: [isize; 3],
    /// and the number of voxels up to the last one, with the margin.
    size: [usize; 3],
}

impl Part {
    fn of(volume: &Volume, inside: Inside) -> Result<Self, Error> {
        let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
        let found = volume.values().enumerate();
        for (voxel, _) in found.filter(|(_, value)| inside.holds(*value)) {
            let index = volume.index(voxel);
            for axis in 0..3 {
                low[axis] = low[axis].min(index[axis]);
                high[axis] = high[axis].max(index[axis]);
            }
        }
        if low[0] == usize::MAX {
            let [low, high] = volume.range();
            return Err(Error::NothingInside {
                what: inside.to_string(),
                low,
                high,
            });
        }
        Ok(Self {
            first: low.map(|i| i as isize - MARGIN as isize),
            size: [0, 1, 2].map(|axis| high[axis] - low[axis] + 1 + 2 * MARGIN),
        })
    }

    /// The surface by marching tetrahedra, in voxels of the volume.
    fn surface(&self, volume: &Volume, inside: Inside) -> Result<TriangleMesh, Error> {
        // Negative inside, the last axis fastest.
        let [_, ny, nz] = self.size;
        let value = |node: usize| {
            let offset = [node / (ny * nz), node / nz % ny, node % nz];
            let voxel = [0, 1, 2].map(|axis| self.first[axis] + offset[axis] as isize);
            -volume.depth(voxel, inside)
        };
        let nodes = 0..self.size.iter().product();
        let values: Vec<f64> = nodes.map(value).collect();
        let mut mesh = lattice_surface(self.size, &values)?;
        for x in &mut mesh.vertices {
            *x = std::array::from_fn(|axis| x[axis] + self.first[axis] as f64);
        }
        Ok(mesh)
    }
}

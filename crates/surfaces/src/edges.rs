//! Sharp edges of noisy meshes.

use derive_more::Display;
use geometry::parallel;
use serde::{Deserialize, Serialize};

use crate::half_edges::HalfEdges;
use crate::joined::Joined;
use crate::smoothing::{CHUNK, TAUBIN, Umbrellas};
use crate::vector::{Vector, scaled_normal};
use crate::{ClosedMesh, TriangleMesh};

/// Rounds of Taubin's smoothing before normals are filtered: faces whose noise is as large as they are have none.
const FIRST: usize = 3;
/// Rounds in which normals are averaged,
const NORMALS: usize = 20;
/// and in which vertices follow them.
const VERTICES: usize = 15;
/// Normals that differ by much more than this are those of different sides.
const DIFFERENCE: f64 = 0.25;
/// Between sides that meet in a sharp edge, filtered normals turn by more than this many degrees.
const SHARP: f64 = 30.0;
/// Sharp edges of the mesh that hang together are an edge of the shape if there are at least so many.
const CHAIN: usize = 8;

/// Whether the sharp edges of a noisy mesh stay sharp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Display, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[display(rename_all = "lowercase")]
#[serde(rename_all = "lowercase")]
pub enum Edges {
    /// Where the evidence for sides that meet in edges is clear for a whole part of the mesh
    #[default]
    Auto,
    /// Wherever there is some evidence near edges
    Keep,
    /// Nowhere
    Round,
}

/// The sharp edges that a smoothing has kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KeptEdges {
    /// How many edges of the mesh they have.
    pub count: usize,
    /// Their length, in the units of the mesh.
    pub length: f64,
}

/// The faces of a mesh that share a vertex with each face, itself not among them.
pub(crate) struct Sides<'a> {
    umbrellas: &'a Umbrellas,
    half_edges: HalfEdges,
    /// Where the faces around each vertex begin, and the end of all.
    starts: Vec<usize>,
    faces: Vec<u32>,
    /// The faces around each face.
    around: Rows<u32>,
}

/// Rows of numbers, one after the other.
struct Rows<T> {
    /// Where each row begins, and the end of all.
    starts: Vec<usize>,
    values: Vec<T>,
}

impl<T: Copy + Send> Rows<T> {
    /// So many, of which `push` adds the numbers of each.
    fn of(count: usize, push: &(dyn Fn(usize, &mut Vec<T>) + Sync)) -> Self {
        let parts = parallel::map(count.div_ceil(CHUNK), 1, &|chunk| {
            let (mut ends, mut values) = (Vec::with_capacity(CHUNK), Vec::new());
            for row in chunk * CHUNK..count.min((chunk + 1) * CHUNK) {
                push(row, &mut values);
                ends.push(values.len());
            }
            (ends, values)
        });
        let mut rows = Self {
            starts: Vec::with_capacity(count + 1),
            values: Vec::with_capacity(parts.iter().map(|(_, values)| values.len()).sum()),
        };
        rows.starts.push(0);
        for (ends, values) in parts {
            let first = rows.values.len();
            rows.starts.extend(ends.into_iter().map(|end| first + end));
            rows.values.extend(values);
        }
        rows
    }

    fn of_row(&self, row: usize) -> &[T] {
        &self.values[self.starts[row]..self.starts[row + 1]]
    }
}

/// A smoothing with sharp edges.
pub(crate) struct Sharpened {
    pub(crate) mesh: TriangleMesh,
    /// The ends of the sharp edges that hang together.
    pub(crate) edges: Vec<[u32; 2]>,
}

impl<'a> Sides<'a> {
    pub(crate) fn of(mesh: &ClosedMesh, umbrellas: &'a Umbrellas) -> Self {
        let triangles = &mesh.mesh().faces;
        let mut starts = vec![0; mesh.mesh().vertices.len() + 1];
        for &vertex in triangles.as_flattened() {
            starts[vertex as usize + 1] += 1;
        }
        for vertex in 1..starts.len() {
            starts[vertex] += starts[vertex - 1];
        }
        let (mut places, mut faces) = (starts.clone(), vec![0; 3 * triangles.len()]);
        for (number, &vertex) in (0..).zip(triangles.as_flattened()) {
            let place = &mut places[vertex as usize];
            faces[*place] = number / 3;
            *place += 1;
        }
        let around = Rows::of(triangles.len(), &|face, all| {
            let corners = triangles[face].iter().map(|&vertex| vertex as usize);
            let near = corners.flat_map(|v| &faces[starts[v]..starts[v + 1]]);
            let mut near: Vec<u32> = near.copied().filter(|&f| f as usize != face).collect();
            near.sort_unstable();
            near.dedup();
            all.extend(near);
        });
        Self {
            half_edges: HalfEdges::new(mesh.mesh()).expect("the mesh is closed"),
            umbrellas,
            starts,
            faces,
            around,
        }
    }

    /// A mesh with these faces smoothed, but for its sharp edges.
    ///
    /// Each normal of a face becomes the mean of those around it, with weights that fall with the distance of the centres and with the difference of the
    /// normals, again and again; so sides that meet in an edge do not mix. Then the vertices move so that the faces get these normals.
    ///
    /// Y. Zheng, H. Fu, O. K.-C. Au, C.-L. Tai: Bilateral normal filtering for mesh denoising. IEEE Trans. Vis. Comput. Graph. 17 (2011). X. Sun, P. L.
    /// Rosin, R. R. Martin, F. C. Langbein: Fast and effective feature-preserving mesh denoising. IEEE Trans. Vis. Comput. Graph. 13 (2007).
    pub(crate) fn sharpened(&self, rough: &TriangleMesh) -> Sharpened {
        let start = rough.smoothed_by(self.umbrellas, FIRST, TAUBIN);
        let normals = self.filtered_normals(&start);
        let mesh = self.with_normals(start, &normals);
        let edges = self.chains(&normals);
        Sharpened { mesh, edges }
    }

    fn filtered_normals(&self, mesh: &TriangleMesh) -> Vec<Vector> {
        let corners = mesh.faces.iter().map(|&face| mesh.corners(face));
        let scaled: Vec<Vector> = corners.clone().map(scaled_normal).collect();
        let centres: Vec<Vector> = corners.map(|[a, b, c]| (a + b + c) / 3.0).collect();
        let range = self.mean_distance(&centres);
        let weight = |face: usize, near: u32| {
            let squared = centres[face].distance_squared(centres[near as usize]);
            scaled[near as usize].length() * (-0.5 * squared / (range * range)).exp()
        };
        let weights = Rows::of(centres.len(), &|face, all| {
            let near = self.around.of_row(face).iter();
            all.extend(near.map(|&near| weight(face, near)));
        });
        let own: Vec<f64> = scaled.iter().map(|normal| normal.length()).collect();
        let mut normals: Vec<Vector> = scaled.iter().map(|n| n.normalize_or_zero()).collect();
        for _ in 0..NORMALS {
            normals = parallel::table(normals.len(), CHUNK, Vector::ZERO, &|face| {
                let here = normals[face];
                let pairs = self.around.of_row(face).iter().zip(weights.of_row(face));
                let sum = pairs.map(|(&near, weight)| {
                    let there = normals[near as usize];
                    let squared = here.distance_squared(there);
                    weight * (-0.5 * squared / (DIFFERENCE * DIFFERENCE)).exp() * there
                });
                (own[face] * here + sum.sum::<Vector>()).normalize_or(here)
            });
        }
        normals
    }

    /// Of the centres of faces that share an edge.
    fn mean_distance(&self, centres: &[Vector]) -> f64 {
        let pairs = self
            .edges()
            .map(|(_, [a, b])| centres[a].distance(centres[b]));
        let (sum, count) = pairs.fold((0.0, 0), |(sum, count), far| (sum + far, count + 1));
        sum / f64::from(count.max(1))
    }

    /// The ends of each edge, and its two faces.
    fn edges(&self) -> impl Iterator<Item = ([u32; 2], [usize; 2])> {
        let all = (0..self.half_edges.len()).filter(|&h| self.half_edges.leads(h));
        all.map(|h| {
            let ends = [self.half_edges.from(h), self.half_edges.to(h)];
            (ends, [h, self.half_edges.twin(h)].map(|h| h as usize / 3))
        })
    }

    fn with_normals(&self, mut mesh: TriangleMesh, normals: &[Vector]) -> TriangleMesh {
        for _ in 0..VERTICES {
            let centre = |face: u32| {
                let corners = mesh.corners(mesh.faces[face as usize]);
                corners.into_iter().sum::<Vector>() / 3.0
            };
            let points = mesh.points();
            let moved = parallel::table(points.len(), CHUNK, Vector::ZERO, &|vertex| {
                let faces = &self.faces[self.starts[vertex]..self.starts[vertex + 1]];
                let ways = faces.iter().map(|&face| {
                    let normal = normals[face as usize];
                    normal * normal.dot(centre(face) - points[vertex])
                });
                points[vertex] + ways.sum::<Vector>() / faces.len().max(1) as f64
            });
            mesh = mesh.on(&moved);
        }
        mesh
    }

    /// The sharp edges in chains that are long enough.
    fn chains(&self, normals: &[Vector]) -> Vec<[u32; 2]> {
        let least = SHARP.to_radians().cos();
        let sharp = self
            .edges()
            .filter(|(_, [a, b])| normals[*a].dot(normals[*b]) < least);
        let sharp: Vec<[u32; 2]> = sharp.map(|(ends, _)| ends).collect();
        let mut chains = Joined::new(self.starts.len());
        for [a, b] in &sharp {
            chains.join(*a as usize, *b as usize);
        }
        let mut lengths = vec![0; self.starts.len()];
        for [a, _] in &sharp {
            lengths[chains.root(*a as usize)] += 1;
        }
        let is_long = |[a, _]: &[u32; 2]| lengths[chains.root(*a as usize)] >= CHAIN;
        sharp.into_iter().filter(is_long).collect()
    }
}

impl Sharpened {
    /// The edges whose both ends are kept, in a mesh.
    pub(crate) fn kept(&self, mesh: &TriangleMesh, is_kept: impl Fn(u32) -> bool) -> KeptEdges {
        let kept = self
            .edges
            .iter()
            .filter(|ends| ends.iter().all(|&v| is_kept(v)));
        let lengths = kept.map(|ends| {
            let [a, b] = ends.map(|vertex| Vector::from_array(mesh.vertices[vertex as usize]));
            a.distance(b)
        });
        lengths.fold(KeptEdges::default(), |sum, length| KeptEdges {
            count: sum.count + 1,
            length: sum.length + length,
        })
    }
}

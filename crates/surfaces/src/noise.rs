//! How much of a mesh is noise.

use std::collections::HashMap;

use geometry::parallel;

use crate::TriangleMesh;
use crate::mesh::PlaceHasher;
use crate::smoothing::{TAUBIN, Umbrellas};
use crate::vector::{Vector, scaled_normal};

/// Rounds in which the squares of noise are averaged over neighbours, some forty of them,
const AVERAGING: usize = 12;
/// and the root of the median of these means over that of the mean, of independent normally distributed numbers at regular vertices.
const MEDIAN_OF_MEANS: f64 = 0.99;
/// Vertices whose weights are summed one after the other.
const IN_ROW: usize = 1 << 16;

/// An estimate of the noise of a mesh by its vertices alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseEstimate {
    /// The standard deviation of the vertices along their normals, in the units of the mesh, as far as it is independent from vertex to vertex.
    ///
    /// It is the root of the median over the vertices of means over their neighbours of `(n . L L x)^2`, each divided by the sum of the
    /// squares of its coefficients: twice the Laplacian `L` takes away what varies slowly, the mean is the variance whatever the
    /// distribution, and the median takes away what bends in few places, such as edges. A surface without noise has a
    /// small one, by its curvature. Zero for a mesh without faces.
    pub deviation: f64,
    /// Whether the deviation is that of the shape, of which a mesh without noise has some.
    ///
    /// Two signs tell the shape. Where it is smooth, and its polygons are few, the Laplacian `L` takes away most of it a second time, and nothing of noise:
    /// the estimate by `n . L L x` is far below that by `n . L x`. Where it has edges between sides that are flat, half of the vertices have next to no
    /// `n . L x`, and the mean over neighbours is that of the edges. Where sides and bands are cut into triangles, many neighbours lie in a plane, which noise
    /// never leaves there. And a few vertices tell nothing.
    pub is_shape: bool,
    /// The part of the vertices at which `|n . L L x|`, scaled as for the deviation and with their own normals, is at most a ten-thousandth
    /// of it: these lie in a plane with their neighbours and the neighbours of those. Of a noisy mesh it is some ten-thousandth, and
    /// large where flat sides meet in sharp edges.
    pub flat_part: f64,
}

impl TriangleMesh {
    /// The noise of the mesh.
    pub fn noise(&self) -> NoiseEstimate {
        self.noise_of_first(self.vertices.len())
    }

    /// The same of the first vertices alone, where others belong to lids.
    pub fn noise_of_first(&self, count: usize) -> NoiseEstimate {
        Differences::of(self, count).estimate()
    }

    /// [`NoiseEstimate::deviation`] alone.
    pub(crate) fn deviation_of_first(&self, count: usize) -> f64 {
        let differences = Differences::of(self, count);
        let squares = differences.squares(&differences.smooth_normals());
        differences.deviation(&squares)
    }
}

/// `(n . L L x)^2` at each vertex with the normal `n`, divided by the sum of the squares of its coefficients, and its mean over neighbours.
struct Squares {
    /// None where there are too few neighbours.
    own: Vec<Option<f64>>,
    means: Vec<f64>,
}

/// What Laplacians leave of the first vertices of a mesh.
struct Differences<'a> {
    mesh: &'a TriangleMesh,
    count: usize,
    umbrellas: Umbrellas,
    once: Vec<Vector>,
    twice: Vec<Vector>,
    /// The sum of the squares of the coefficients of `L L x`; none where there are too few neighbours.
    weights: Vec<Option<f64>>,
}

impl<'a> Differences<'a> {
    fn of(mesh: &'a TriangleMesh, count: usize) -> Self {
        let umbrellas = Umbrellas::of(mesh);
        let once = umbrellas.laplacian(&mesh.points());
        Self {
            mesh,
            count: count.min(mesh.vertices.len()),
            twice: umbrellas.laplacian(&once),
            once,
            weights: weights_of_two_laplacians(&umbrellas),
            umbrellas,
        }
    }

    fn estimate(&self) -> NoiseEstimate {
        let normals = self.smooth_normals();
        let squares = self.squares(&normals);
        let deviation = self.deviation(&squares);
        NoiseEstimate {
            deviation,
            is_shape: self.is_shape(&normals, &squares.means, deviation),
            flat_part: self.flat_part(deviation),
        }
    }

    /// Normals of the smoothed mesh: noise turns those of the mesh itself, towards the plane of their neighbours.
    fn smooth_normals(&self) -> Vec<[f64; 3]> {
        let smooth = self.mesh.smoothed_by(&self.umbrellas, 12, TAUBIN);
        smooth.vertex_normals()
    }

    fn squares(&self, normals: &[[f64; 3]]) -> Squares {
        let own = self.squares_of_twice(normals);
        let means = self.averaged(own.iter().map(|square| square.unwrap_or(0.0)));
        Squares { own, means }
    }

    fn deviation(&self, Squares { own, means }: &Squares) -> f64 {
        let of_surface = means.iter().zip(own).take(self.count);
        let inner = of_surface.filter(|(_, square)| square.is_some());
        median(inner.map(|(mean, _)| *mean)).sqrt() / MEDIAN_OF_MEANS
    }

    fn squares_of_twice(&self, normals: &[[f64; 3]]) -> Vec<Option<f64>> {
        let rows = self.twice.iter().zip(normals).zip(&self.weights);
        rows.map(|((way, normal), weight)| {
            weight.map(|weight| way.dot(Vector::from_array(*normal)).powi(2) / weight)
        })
        .collect()
    }

    /// `(n . L x)^2` likewise.
    fn squares_of_once(&self, normals: &[[f64; 3]]) -> Vec<f64> {
        let rows = self.once.iter().zip(normals).enumerate();
        rows.map(|(vertex, (way, normal))| {
            // One, and as many equal parts of one as there are neighbours.
            let neighbours = self.umbrellas.around(vertex).len();
            let weight = 1.0 + 1.0 / neighbours.max(1) as f64;
            way.dot(Vector::from_array(*normal)).powi(2) / weight
        })
        .collect()
    }

    /// Means over neighbours.
    fn averaged(&self, squares: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut means: Vec<f64> = squares.collect();
        self.umbrellas.smooth(&mut means, AVERAGING, [0.5, 0.0]);
        means
    }

    fn is_shape(&self, normals: &[[f64; 3]], twice: &[f64], deviation: f64) -> bool {
        /// The fewest vertices that tell noise from a shape,
        const FEWEST: usize = 50;
        /// the part of the edges whose faces lie in a plane that a shape made of flat pieces has,
        const FLAT: f64 = 0.25;
        /// and the part of the noise that is none.
        const NOTHING: f64 = 1e-3;
        /// The least part of the one estimate in the other, which is 0.1 and less for smooth shapes without noise,
        const ROUGH: f64 = 0.2;
        /// and of the root of the median of squares in that of normal numbers, which is 0.13 and less for shapes with edges.
        const EVERYWHERE: f64 = 0.2;
        /// The median of the square of a normal number.
        const MEDIAN: f64 = 0.455;
        if self.count < FEWEST || self.flat_edges(NOTHING * deviation) > FLAT {
            return true;
        }
        let of_surface = |values: &[f64]| median(values[..self.count].iter().copied());
        let squares = self.squares_of_once(normals);
        let means = self.averaged(squares.iter().copied());
        let [single, once, twice] = [&squares, &means, twice].map(of_surface);
        let is_rough = (twice / once).sqrt() >= ROUGH;
        let is_everywhere = (single / (MEDIAN * once)).sqrt() >= EVERYWHERE;
        !(is_rough && is_everywhere)
    }

    /// The part of the edges between the first vertices that both faces there lie in a plane, to this height.
    fn flat_edges(&self, height: f64) -> f64 {
        let mesh = self.mesh;
        let most = 3 * mesh.faces.len();
        let mut corners: HashMap<[u32; 2], Vector, PlaceHasher> =
            HashMap::with_capacity_and_hasher(most / 2, PlaceHasher::default());
        let (mut flat, mut all) = (0_usize, 0_usize);
        let is_first = |face: &&[u32; 3]| face.iter().all(|&v| (v as usize) < self.count);
        for face in mesh.faces.iter().filter(is_first) {
            let points = mesh.corners(*face);
            let normal = scaled_normal(points).normalize_or_zero();
            for i in 0..3 {
                let edge = [face[i], face[(i + 1) % 3]];
                if let Some(across) = corners.remove(&[edge[1], edge[0]]) {
                    all += 1;
                    flat += usize::from(normal.dot(across - points[i]).abs() <= height);
                } else {
                    corners.insert(edge, points[(i + 2) % 3]);
                }
            }
        }
        flat as f64 / all.max(1) as f64
    }

    fn flat_part(&self, deviation: f64) -> f64 {
        let squares = self.squares_of_twice(&self.mesh.vertex_normals());
        let of_surface = squares[..self.count].iter().flatten();
        let flat = of_surface.filter(|&&square| square.sqrt() <= 1e-4 * deviation);
        flat.count() as f64 / self.count.max(1) as f64
    }
}

/// Zero without any values.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Sum of the squares of the coefficients of `L L x` at every vertex with more than two neighbours.
fn weights_of_two_laplacians(umbrellas: &Umbrellas) -> Vec<Option<f64>> {
    let count = umbrellas.count();
    let parts = parallel::map(count.div_ceil(IN_ROW), 1, &|part| {
        let mut weights = Weights::none(count);
        let row = part * IN_ROW..count.min((part + 1) * IN_ROW);
        let of_vertex = |vertex| weights.of_two_laplacians(umbrellas, vertex);
        row.map(of_vertex).collect::<Vec<_>>()
    });
    parts.concat()
}

/// Weights of vertices, of which most are zero.
struct Weights {
    of_vertices: Vec<f64>,
    /// Those that are not zero.
    known: Vec<u32>,
}

impl Weights {
    fn none(vertices: usize) -> Self {
        Self {
            of_vertices: vec![0.0; vertices],
            known: Vec::new(),
        }
    }

    fn add(&mut self, vertex: u32, weight: f64) {
        let sum = &mut self.of_vertices[vertex as usize];
        if *sum == 0.0 {
            self.known.push(vertex);
        }
        *sum += weight;
    }

    /// The sum of their squares; none are left.
    fn take_squares(&mut self) -> f64 {
        let all = self.known.drain(..);
        all.map(|vertex| std::mem::take(&mut self.of_vertices[vertex as usize]).powi(2))
            .sum()
    }

    /// The sum of the squares of the coefficients of `L L x` at a vertex; none if it has too few neighbours.
    fn of_two_laplacians(&mut self, umbrellas: &Umbrellas, vertex: usize) -> Option<f64> {
        let around = umbrellas.around(vertex);
        if around.len() < 3 {
            return None;
        }
        self.add(vertex as u32, 1.0);
        let share = 1.0 / around.len() as f64;
        for &near in around {
            self.add(near, -2.0 * share);
            let next = umbrellas.around(near as usize);
            let part = share / next.len() as f64;
            for &far in next {
                self.add(far, part);
            }
        }
        Some(self.take_squares())
    }
}

#[cfg(test)]
mod tests {
    use super::{Umbrellas, weights_of_two_laplacians};
    use crate::samples;

    /// Against the coefficients of `L L x` for every basis vector.
    #[test]
    fn weights_of_two_laplacians_are_summed() {
        let mesh = samples::figure(48).unwrap();
        let umbrellas = Umbrellas::of(mesh.mesh());
        let count = mesh.mesh().vertices.len();
        let weights = weights_of_two_laplacians(&umbrellas);
        for vertex in (0..count).step_by(count / 5) {
            let mut squares = 0.0;
            for other in 0..count {
                let mut unit = vec![0.0; count];
                unit[other] = 1.0;
                // Far from both, nothing arrives.
                let is_near = umbrellas.around(vertex).iter().any(|&near| {
                    near as usize == other
                        || umbrellas.around(near as usize).contains(&(other as u32))
                });
                if is_near || other == vertex {
                    let once: Vec<f64> = (0..count)
                        .map(|v| umbrellas.laplacian_at(&unit, v))
                        .collect();
                    squares += umbrellas.laplacian_at(&once, vertex).powi(2);
                }
            }
            let found = weights[vertex].unwrap();
            assert!((found - squares).abs() < 1e-14, "{found} for {squares}");
        }
    }
}

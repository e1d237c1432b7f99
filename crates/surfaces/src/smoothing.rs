//! Smoothing of meshes by their edges, and the noise that there is to smooth.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::ops::{Add, Div, Mul, Sub};

use geometry::parallel;

use crate::vector::{Vector, scaled_normal};
use crate::{Parts, TriangleMesh};

/// Rounds in which the squares of noise are averaged over neighbours, some forty of them,
const AVERAGING: usize = 12;
/// and the root of the median of these means over that of the mean, of independent normally distributed numbers at regular vertices.
const MEDIAN_OF_MEANS: f64 = 0.99;

/// The usual factors of Taubin's smoothing of a mesh.
pub const TAUBIN: [f64; 2] = [0.5, -0.53];
/// Those of fields on a mesh.
const FACTORS: [f64; 2] = [0.5, -0.47];

/// Vertices are worked on in pieces of this many.
pub(crate) const CHUNK: usize = 1 << 12;

/// Terms of a series that add up to less than this part of what is smoothed are left out.
const NEGLIGIBLE: f64 = 1e-12;
/// A volume is reached when it is wrong by less than this part, which is some of its rounding.
const REACHED: f64 = 1e-13;

/// The neighbours of every vertex along edges, in ascending order.
#[derive(Debug)]
pub(crate) struct Umbrellas {
    /// Where those of each vertex begin, and the end of all.
    starts: Vec<usize>,
    neighbours: Vec<u32>,
}

/// What is smoothed on a mesh.
pub(crate) trait Smoothed:
    Copy
    + Default
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
{
}

impl Smoothed for f64 {}
impl Smoothed for Vector {}

impl Umbrellas {
    pub(crate) fn of(mesh: &TriangleMesh) -> Self {
        let sides = |[a, b, c]: [u32; 3]| [(a, b), (a, c), (b, c), (b, a), (c, a), (c, b)];
        let mut ends = vec![0; mesh.vertices.len()];
        let all = || mesh.faces.iter().copied().flat_map(sides);
        all().for_each(|(vertex, _)| ends[vertex as usize] += 1);
        let mut end = 0;
        for count in &mut ends {
            // Its neighbours are written from here on.
            end += std::mem::replace(count, end);
        }
        let mut neighbours = vec![0; end];
        for (vertex, near) in all() {
            let place = &mut ends[vertex as usize];
            neighbours[*place] = near;
            *place += 1;
        }
        let (mut starts, mut first, mut kept) = (vec![0], 0, 0);
        for end in ends {
            neighbours[first..end].sort_unstable();
            for place in first..end {
                // Two faces share an edge.
                if place == first || neighbours[place] != neighbours[place - 1] {
                    neighbours[kept] = neighbours[place];
                    kept += 1;
                }
            }
            starts.push(kept);
            first = end;
        }
        neighbours.truncate(kept);
        Self { starts, neighbours }
    }

    /// The neighbours of a vertex.
    fn around(&self, vertex: usize) -> &[u32] {
        &self.neighbours[self.starts[vertex]..self.starts[vertex + 1]]
    }

    /// `M x`, the mean of the neighbours, at a vertex; its own value where there are none.
    fn mean_at<T: Smoothed>(&self, x: &[T], vertex: usize) -> T {
        let around = self.around(vertex);
        if around.is_empty() {
            return x[vertex];
        }
        let near = around.iter().map(|&n| x[n as usize]);
        near.fold(T::default(), T::add) / around.len() as f64
    }

    /// `L x = x - M x` at a vertex.
    fn laplacian_at<T: Smoothed>(&self, x: &[T], vertex: usize) -> T {
        x[vertex] - self.mean_at(x, vertex)
    }

    fn laplacian(&self, x: &[Vector]) -> Vec<Vector> {
        parallel::table(x.len(), CHUNK, Vector::ZERO, &|vertex| {
            self.laplacian_at(x, vertex)
        })
    }

    /// Taubin's smoothing of a field on the vertices.
    pub(crate) fn smooth<T: Smoothed>(&self, x: &mut Vec<T>, iterations: usize, factors: [f64; 2]) {
        let mut next = x.clone();
        for factor in std::iter::repeat_n(factors, iterations).flatten() {
            if factor != 0.0 {
                parallel::over_chunks(&mut next, CHUNK, &|first, part| {
                    for (next, vertex) in part.iter_mut().zip(first..) {
                        *next = x[vertex] - self.laplacian_at(x, vertex) * factor;
                    }
                });
                std::mem::swap(x, &mut next);
            }
        }
    }

    /// A number at each vertex, averaged over its neighbours: waves of some ten edges and more stay, and of independent noise 0.36 of its
    /// standard deviation.
    pub(crate) fn averaged(&self, numbers: &[f64]) -> Vec<f64> {
        const ROUNDS: usize = 8;
        let mut x = numbers.to_vec();
        self.smooth(&mut x, ROUNDS, FACTORS);
        x
    }

    /// What [`Self::smooth`] makes of a field in many rounds, up to [`NEGLIGIBLE`], in a number of passes that is as the root of theirs: the
    /// [`Series`] of its polynomial of the mean, summed by Clenshaw's recurrence.
    fn smooth_much<T: Smoothed>(&self, x: &[T], rounds: usize, factors: [f64; 2]) -> Vec<T> {
        let Series(coefficients) = Series::of_taubin(rounds, factors);
        let zero = || vec![T::default(); x.len()];
        let (mut last, mut before) = (zero(), zero());
        for (order, coefficient) in coefficients.into_iter().enumerate().rev() {
            let factor = if order == 0 { 1.0 } else { 2.0 };
            parallel::over_chunks(&mut before, CHUNK, &|first, part| {
                for (next, vertex) in part.iter_mut().zip(first..) {
                    *next = x[vertex] * coefficient + self.mean_at(&last, vertex) * factor - *next;
                }
            });
            std::mem::swap(&mut last, &mut before);
        }
        last
    }

    /// Sum of the squares of the coefficients of `L L x` at a vertex.
    fn squared_weights(&self, vertex: usize, weights: &mut Weights) -> f64 {
        weights.add(vertex as u32, 1.0);
        let around = self.around(vertex);
        let share = 1.0 / around.len() as f64;
        for &near in around {
            weights.add(near, -2.0 * share);
            let next = self.around(near as usize);
            let part = share / next.len() as f64;
            for &far in next {
                weights.add(far, part);
            }
        }
        weights.take_squares()
    }
}

/// The coefficients of a polynomial in Chebyshev's polynomials `T_k`.
struct Series(Vec<f64>);

impl Series {
    /// Taubin's smoothing in so many rounds, `((1 - lambda (1 - M)) (1 - mu (1 - M)))^rounds`.
    ///
    /// The mean `M` over neighbours has real eigenvalues between -1 and 1, since neighbours are mutual, and there every `T_k` is at most one: what is
    /// left out of the series is at most the sum of its coefficients.
    fn of_taubin(rounds: usize, factors: [f64; 2]) -> Self {
        // As many as there are coefficients, so that these are exact.
        let nodes = 2 * rounds + 1;
        let angles = (0..4 * nodes).map(|k| PI * k as f64 / (2 * nodes) as f64);
        let cosines: Vec<f64> = angles.map(f64::cos).collect();
        let at_node = |node: usize| {
            let eigenvalue = 1.0 - cosines[2 * node + 1];
            let round: f64 = factors.iter().map(|f| 1.0 - f * eigenvalue).product();
            round.powi(rounds as i32)
        };
        let values: Vec<f64> = (0..nodes).map(at_node).collect();
        let coefficient = |order: usize| {
            let pairs = values.iter().enumerate();
            let terms = pairs.map(|(node, v)| v * cosines[order * (2 * node + 1) % (4 * nodes)]);
            let weight = if order == 0 { 1.0 } else { 2.0 };
            weight * terms.sum::<f64>() / nodes as f64
        };
        let mut coefficients: Vec<f64> = (0..nodes).map(coefficient).collect();
        let mut left_out = 0.0;
        while let Some(last) = coefficients.last() {
            left_out += last.abs();
            if left_out > NEGLIGIBLE {
                break;
            }
            coefficients.pop();
        }
        Self(coefficients)
    }
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
}

impl TriangleMesh {
    /// Taubin's smoothing: so many times a step `x - lambda L x` that shrinks, and one `x - mu L x` with `mu < -lambda < 0` that
    /// inflates, where `L x` is a vertex less the mean of its neighbours.
    ///
    /// With `mu = 0` it is Laplacian smoothing. G. Taubin: A signal processing approach to fair surface design. SIGGRAPH (1995).
    pub fn smoothed(&self, iterations: usize, lambda: f64, mu: f64) -> Self {
        self.smoothed_by(&Umbrellas::of(self), iterations, [lambda, mu])
    }

    /// The same, where the neighbours of its vertices are known.
    pub(crate) fn smoothed_by(
        &self,
        umbrellas: &Umbrellas,
        iterations: usize,
        factors: [f64; 2],
    ) -> Self {
        let mut x = self.points();
        umbrellas.smooth(&mut x, iterations, factors);
        self.on(&x)
    }

    /// The smooth surface with what it is off the rough one on the average over neighbours: `x + A (y - x)` with the vertices `y` of
    /// `rough`, where `A` is Taubin's smoothing of a field on the edges, which lets half of waves of length `wavelength` pass, and
    /// in no case those shorter than some four edges.
    ///
    /// Every smoothing takes something of the long waves along; what `y - x` has of these is it, while noise averages out. What is
    /// wrong in the end is the product of two small errors, `(1 - A)(y - x)`; J. W. Tukey called this twicing.
    pub fn with_long_waves_of(&self, rough: &Self, wavelength: f64) -> Self {
        self.with_long_waves_by(&Umbrellas::of(self), rough, wavelength)
    }

    /// The same, where the neighbours of its vertices are known.
    pub(crate) fn with_long_waves_by(
        &self,
        umbrellas: &Umbrellas,
        rough: &Self,
        wavelength: f64,
    ) -> Self {
        const ROUNDS: [f64; 2] = [12.0, 400.0];
        // On a lattice of equilateral triangles a wave has the eigenvalue (wave number times edge)^2 / 4.
        let wave = std::f64::consts::TAU / wavelength * self.mean_edge();
        let eigenvalue = 0.25 * wave * wave;
        let round: f64 = FACTORS.iter().map(|f| 1.0 - f * eigenvalue).product();
        // Edges too long for such waves have none of these, and get the fewest rounds.
        let rounds = (0.5_f64.ln() / round.max(0.0).ln())
            .clamp(ROUNDS[0], ROUNDS[1])
            .round() as usize;
        let pairs = self.points().into_iter().zip(rough.points());
        let offset: Vec<Vector> = pairs.map(|(x, y)| y - x).collect();
        self.moved_by(&umbrellas.smooth_much(&offset, rounds, FACTORS))
    }

    /// All vertices that may move moved along their normals by the same length, so that the closed surface encloses `volume`.
    pub fn with_volume(&self, volume: f64, moves: impl Fn(usize) -> bool) -> Self {
        /// Newton steps; the volume is a polynomial of third degree in the length, nearly linear.
        const STEPS: usize = 4;
        let mut moved = self.clone();
        for _ in 0..STEPS {
            let missing = volume - moved.volume();
            if missing.abs() <= REACHED * volume.abs() {
                break;
            }
            moved = moved.grown_by(missing, &moves);
        }
        Self {
            normals: self.normals.clone(),
            ..moved
        }
    }

    /// The normals of the vertices, zero for those that may not move.
    pub(crate) fn moving_normals(&self, moves: impl Fn(usize) -> bool) -> Vec<Vector> {
        let normals = self.vertex_normals().into_iter().enumerate();
        normals
            .map(|(v, n)| if moves(v) { n.into() } else { Vector::ZERO })
            .collect()
    }

    /// One step of Newton's method towards a volume that is larger by this.
    fn grown_by(&self, missing: f64, moves: impl Fn(usize) -> bool) -> Self {
        let normals = self.moving_normals(moves);
        let derivative = self.volume_derivative(&normals);
        if derivative == 0.0 {
            return self.clone();
        }
        let length = missing / derivative;
        let offset: Vec<_> = normals.into_iter().map(|n| length * n).collect();
        self.moved_by(&offset)
    }

    /// The closed surface as small as it becomes in some rounds in which every vertex moves halfway to the middle of its neighbours, then
    /// those of each part along their normals so that it encloses its volume, and none further from where it was than `shortened` allows,
    /// which says of a vertex and its way how much of it may be gone. In the end each part encloses its volume.
    pub fn relaxed(
        &self,
        rounds: usize,
        parts: &Parts,
        volumes: &[f64],
        shortened: impl Fn(usize, [f64; 3]) -> f64,
    ) -> Self {
        let (umbrellas, original) = (Umbrellas::of(self), self.points());
        let mut moved = self.clone();
        for _ in 0..rounds {
            let mut x = moved.points();
            umbrellas.smooth(&mut x, 1, [0.5, 0.0]);
            let mut x = self
                .on(&x)
                .towards_volumes(parts, volumes, |_| true)
                .points();
            for (vertex, (x, &from)) in x.iter_mut().zip(&original).enumerate() {
                let way = *x - from;
                *x = from + shortened(vertex, way.to_array()) * way;
            }
            moved = self.on(&x);
        }
        moved.with_volumes(parts, volumes)
    }

    /// The derivative of the enclosed volume for velocities of the vertices.
    fn volume_derivative(&self, velocities: &[Vector]) -> f64 {
        // From a point close by, so that far-away meshes do not lose digits.
        let origin = self.vertices.first().copied().unwrap_or_default();
        let sixths = self.faces.iter().map(|&face| {
            let [a, b, c] = self.corners(face).map(|x| x - Vector::from_array(origin));
            let [u, v, w] = face.map(|vertex| velocities[vertex as usize]);
            u.dot(b.cross(c)) + v.dot(c.cross(a)) + w.dot(a.cross(b))
        });
        sixths.sum::<f64>() / 6.0
    }

    /// Mean length of the edges, each as often as it has faces.
    pub(crate) fn mean_edge(&self) -> f64 {
        let edges = self.faces.iter().flat_map(|&face| {
            let [a, b, c] = self.corners(face);
            [a.distance(b), b.distance(c), c.distance(a)]
        });
        edges.sum::<f64>() / (3 * self.faces.len()).max(1) as f64
    }

    pub(crate) fn moved_by(&self, offset: &[Vector]) -> Self {
        let pairs = self.points().into_iter().zip(offset);
        self.on(&pairs.map(|(x, &by)| x + by).collect::<Vec<_>>())
    }

    /// The standard deviation of the noise of the vertices along their normals, as far as it is independent from vertex to vertex.
    ///
    /// It is the root of the median over the vertices of means over their neighbours of `(n . L L x)^2`, each divided by the sum of the
    /// squares of its coefficients: twice the Laplacian `L` takes away what varies slowly, the mean is the variance whatever the
    /// distribution, and the median takes away what bends in few places, such as edges. A surface without noise has a
    /// small one, by its curvature. Zero for a mesh without faces.
    pub fn noise(&self) -> f64 {
        self.noise_of_first(self.vertices.len())
    }

    /// The same of the first vertices alone, where others belong to lids.
    pub(crate) fn noise_of_first(&self, count: usize) -> f64 {
        let umbrellas = Umbrellas::of(self);
        // Normals of the smoothed mesh: noise turns those of the mesh itself, towards the plane of their neighbours.
        let normals = self.smoothed_by(&umbrellas, 12, TAUBIN).vertex_normals();
        let found = self.squared_noise(&umbrellas, &normals);
        let mut squares: Vec<f64> = found.iter().map(|square| square.unwrap_or(0.0)).collect();
        umbrellas.smooth(&mut squares, AVERAGING, [0.5, 0.0]);
        let means = squares.iter().zip(&found).take(count);
        let means = means.filter(|(_, at)| at.is_some());
        let mut means: Vec<f64> = means.map(|(mean, _)| *mean).collect();
        if means.is_empty() {
            return 0.0;
        }
        let middle = means.len() / 2;
        let (_, median, _) = means.select_nth_unstable_by(middle, f64::total_cmp);
        median.sqrt() / MEDIAN_OF_MEANS
    }

    /// Whether the [noise](Self::noise) of the first `count` vertices is noise, and not the shape, of which a mesh without noise has some.
    ///
    /// Two signs tell the shape. Where it is smooth, and its polygons are few, the Laplacian `L` takes away most of it a second time, and nothing of noise:
    /// the estimate by `n . L L x` is far below that by `n . L x`. Where it has edges between sides that are flat, half of the vertices have next to no
    /// `n . L x`, and the mean over neighbours is that of the edges. Where sides and bands are cut into triangles, many neighbours lie in a plane, which noise
    /// never leaves there. And a few vertices tell nothing.
    pub fn shows_noise(&self, count: usize) -> bool {
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
        if count.min(self.vertices.len()) < FEWEST {
            return false;
        }
        let noise = self.noise_of_first(count);
        if self.flat_edges(count, NOTHING * noise) > FLAT {
            return false;
        }
        let umbrellas = Umbrellas::of(self);
        let normals = self.smoothed_by(&umbrellas, 12, TAUBIN).vertex_normals();
        let median = |mut values: Vec<f64>| -> f64 {
            if values.is_empty() {
                return 0.0;
            }
            let middle = values.len() / 2;
            *values.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        let of_order = |order: usize| {
            let squares = self.squared_order(&umbrellas, &normals, order);
            let mut means = squares.clone();
            umbrellas.smooth(&mut means, AVERAGING, [0.5, 0.0]);
            let of_surface = squares.len().min(count);
            let of_first = |values: &[f64]| median(values[..of_surface].to_vec());
            (of_first(&squares), of_first(&means))
        };
        let ((single, once), (_, twice)) = (of_order(1), of_order(2));
        (twice / once).sqrt() >= ROUGH && (single / (MEDIAN * once)).sqrt() >= EVERYWHERE
    }

    /// The part of the edges between the first `count` vertices that both faces there lie in a plane, to this height.
    fn flat_edges(&self, count: usize, height: f64) -> f64 {
        let mut corners: HashMap<[u32; 2], Vector> = HashMap::with_capacity(3 * self.faces.len());
        let (mut flat, mut all) = (0_usize, 0_usize);
        for face in &self.faces {
            if face.iter().any(|&v| v as usize >= count) {
                continue;
            }
            let points = self.corners(*face);
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

    /// `(n . L^k x)^2` at each vertex, divided by the sum of the squares of its coefficients, for one or two Laplacians.
    fn squared_order(&self, umbrellas: &Umbrellas, normals: &[[f64; 3]], order: usize) -> Vec<f64> {
        if order == 2 {
            let found = self.squared_noise(umbrellas, normals);
            return found
                .into_iter()
                .map(|square| square.unwrap_or(0.0))
                .collect();
        }
        let once = umbrellas.laplacian(&self.points());
        let at = |(vertex, way): (usize, &Vector)| {
            let along = way.dot(Vector::from_array(normals[vertex]));
            // One, and as many equal parts of one as there are neighbours.
            let weights = 1.0 + 1.0 / umbrellas.around(vertex).len().max(1) as f64;
            along * along / weights
        };
        once.iter().enumerate().map(at).collect()
    }

    /// The part of the vertices at which `|n . L L x|`, scaled as for [`Self::noise`] and with their own normals, is at most a ten-thousandth
    /// of `noise`: these lie in a plane with their neighbours and the neighbours of those. Of a noisy mesh it is some ten-thousandth, and
    /// large where flat sides meet in sharp edges.
    pub fn flat_part(&self, noise: f64) -> f64 {
        let found = self.squared_noise(&Umbrellas::of(self), &self.vertex_normals());
        let flat = found
            .iter()
            .flatten()
            .filter(|&&square| square.sqrt() <= 1e-4 * noise);
        flat.count() as f64 / found.len().max(1) as f64
    }

    /// `(n . L L x)^2` at each vertex with the normal `n`, divided by the sum of the squares of its coefficients; none where there are too
    /// few neighbours.
    fn squared_noise(&self, umbrellas: &Umbrellas, normals: &[[f64; 3]]) -> Vec<Option<f64>> {
        let twice = umbrellas.laplacian(&umbrellas.laplacian(&self.points()));
        let mut weights = Weights::none(normals.len());
        let mut at = |v: usize| {
            let along = twice[v].dot(Vector::from_array(normals[v]));
            along * along / umbrellas.squared_weights(v, &mut weights)
        };
        let inner = (0..normals.len()).map(|v| umbrellas.around(v).len() > 2);
        (inner.enumerate().map(|(v, inner)| inner.then(|| at(v)))).collect()
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::{FACTORS, NEGLIGIBLE, Series, TAUBIN, Umbrellas};
    use crate::samples;
    use crate::vector::Vector;

    /// Long waves are what a constant is here.
    #[test]
    fn averages_keep_long_waves_and_a_known_part_of_noise() {
        let mesh = samples::figure(48).unwrap();
        let count = mesh.mesh().vertices.len();
        let umbrellas = Umbrellas::of(mesh.mesh());
        let averaged = |numbers: &[f64]| umbrellas.averaged(numbers);
        assert!((averaged(&vec![2.0; count]).iter()).all(|x| (x - 2.0).abs() < 1e-12));
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(1);
        let noise: Vec<f64> = (0..count).map(|_| rng.random::<f64>() - 0.5).collect();
        let squares = |numbers: &[f64]| numbers.iter().map(|x| x * x).sum::<f64>();
        let part = (squares(&averaged(&noise)) / squares(&noise)).sqrt();
        assert!((0.34..0.38).contains(&part), "{part}");
    }

    #[test]
    fn a_few_terms_of_the_series_are_many_rounds() {
        let mesh = samples::figure(48).unwrap();
        let umbrellas = Umbrellas::of(mesh.mesh());
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(2);
        let mut number = || rng.random::<f64>() - 0.5;
        let count = mesh.mesh().vertices.len();
        let field: Vec<Vector> = (0..count)
            .map(|_| Vector::new(number(), number(), number()))
            .collect();
        for (rounds, factors, most) in [(3, TAUBIN, 7), (12, FACTORS, 25), (400, FACTORS, 80)] {
            let mut expected = field.clone();
            umbrellas.smooth(&mut expected, rounds, factors);
            let found = umbrellas.smooth_much(&field, rounds, factors);
            let far = found.iter().zip(&expected).map(|(a, b)| a.distance(*b));
            let far = far.fold(0.0, f64::max);
            assert!(far < 20.0 * NEGLIGIBLE, "{rounds} rounds: {far}");
            let terms = Series::of_taubin(rounds, factors).0.len();
            assert!(terms <= most, "{rounds} rounds: {terms} terms");
        }
    }

    /// Against the coefficients of `L L x` for every basis vector.
    #[test]
    fn weights_of_two_laplacians_are_summed() {
        let mesh = samples::figure(48).unwrap();
        let umbrellas = Umbrellas::of(mesh.mesh());
        let count = mesh.mesh().vertices.len();
        let mut weights = super::Weights::none(count);
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
            let found = umbrellas.squared_weights(vertex, &mut weights);
            assert!((found - squares).abs() < 1e-14, "{found} for {squares}");
        }
    }
}

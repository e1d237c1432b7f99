//! Smoothing of meshes by their edges.

use std::f64::consts::PI;
use std::ops::{Add, Div, Mul, Sub};

use geometry::parallel;

use crate::vector::Vector;
use crate::{Parts, TriangleMesh};

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

    /// How many vertices there are.
    pub(crate) fn count(&self) -> usize {
        self.starts.len() - 1
    }

    /// The neighbours of a vertex.
    pub(crate) fn around(&self, vertex: usize) -> &[u32] {
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
    pub(crate) fn laplacian_at<T: Smoothed>(&self, x: &[T], vertex: usize) -> T {
        x[vertex] - self.mean_at(x, vertex)
    }

    pub(crate) fn laplacian(&self, x: &[Vector]) -> Vec<Vector> {
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

    /// By how much single precision, as in STL files, rounds the largest coordinate at most, over the mean length of the edges.
    pub fn single_rounding(&self) -> f64 {
        let coordinates = self.vertices.as_flattened().iter();
        let largest = coordinates.fold(0.0, |most: f64, x| most.max(x.abs()));
        0.5 * f64::from(f32::EPSILON) * largest / self.mean_edge()
    }

    pub(crate) fn moved_by(&self, offset: &[Vector]) -> Self {
        let pairs = self.points().into_iter().zip(offset);
        self.on(&pairs.map(|(x, &by)| x + by).collect::<Vec<_>>())
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
}

//! The volumes of labels.

use super::LabelMesh;
use crate::vector::{Vector, scaled_normal};

/// Newton steps to volumes, which are nearly linear in the lengths.
const STEPS: usize = 4;
/// Steps of conjugate gradients for each label, at most, and the part of the residual that may be left.
const SEARCHES: usize = 4;
const TOLERANCE: f64 = 1e-13;

impl LabelMesh {
    /// The volumes of labels from 0 to `count - 1`. That of the background is less those of all others.
    pub fn volumes(&self, count: usize) -> Vec<f64> {
        // From a point close by, so that far-away meshes do not lose digits.
        let origin = self.mesh.vertices.first().copied().unwrap_or_default();
        let mut volumes = vec![0.0; count];
        for (&face, &[behind, before]) in self.mesh.faces.iter().zip(&self.sides) {
            let [a, b, c] = (self.mesh.corners(face)).map(|x| x - Vector::from_array(origin));
            let sixth = a.dot(b.cross(c)) / 6.0;
            volumes[behind as usize] += sixth;
            volumes[before as usize] -= sixth;
        }
        volumes
    }

    /// Walls moved so that all labels but the background have these volumes: a wall moves along its normal by the difference of two lengths, one for the
    /// label on either side. Only those vertices move of which `moves` says so. Labels that nothing can move stay as they are.
    pub fn with_volumes(&self, volumes: &[f64], moves: impl Fn(usize) -> bool) -> Self {
        let mut moved = self.clone();
        for _ in 0..STEPS {
            let slopes = moved.slopes(&moves);
            let now = moved.volumes(volumes.len()).into_iter();
            let missing = volumes.iter().zip(now).map(|(to, now)| to - now).collect();
            let lengths = solve(&Response::new(&slopes, volumes.len()), missing);
            let mut ways = vec![Vector::ZERO; moved.mesh.vertices.len()];
            for (way, at) in ways.iter_mut().zip(&slopes) {
                *way = at.way(&lengths);
            }
            moved = moved.with_mesh(moved.mesh.moved_by(&ways));
        }
        moved
    }

    /// How far each label has to grow along its normals so that it has so much more volume, to first order. That of the background is not asked for,
    /// and it does not grow.
    pub fn lengths(&self, missing: Vec<f64>) -> Vec<f64> {
        let slopes = self.slopes(&|_| true);
        solve(&Response::new(&slopes, missing.len()), missing)
    }

    /// The derivatives of all volumes at every vertex.
    fn slopes(&self, moves: &impl Fn(usize) -> bool) -> Vec<Slopes> {
        let mut slopes = vec![Slopes::default(); self.mesh.vertices.len()];
        for (face, sides) in self.mesh.faces.iter().zip(&self.sides) {
            let third = scaled_normal(self.mesh.corners(*face)) / 6.0;
            for &vertex in face.iter().filter(|&&vertex| moves(vertex as usize)) {
                let at = &mut slopes[vertex as usize];
                at.area += third.length();
                at.add(sides[0], third);
                at.add(sides[1], -third);
            }
        }
        slopes
    }
}

/// The derivatives of volumes for a movement of a vertex.
#[derive(Clone, Default)]
struct Slopes {
    /// A third of the area of the faces there.
    area: f64,
    /// Of each label there, without the background.
    of_labels: Vec<(u32, Vector)>,
}

impl Slopes {
    fn add(&mut self, label: u32, slope: Vector) {
        match self.of_labels.iter_mut().find(|(of, _)| *of == label) {
            _ if label == super::BACKGROUND => (),
            Some((_, sum)) => *sum += slope,
            None => self.of_labels.push((label, slope)),
        }
    }

    /// How the vertex moves where labels grow by these lengths.
    fn way(&self, lengths: &[f64]) -> Vector {
        if self.area == 0.0 {
            return Vector::ZERO;
        }
        let of_labels = self.of_labels.iter();
        let sum: Vector = of_labels
            .map(|(label, slope)| lengths[*label as usize] * *slope)
            .sum();
        sum / self.area
    }
}

/// How volumes change with the lengths by which labels grow: a symmetric matrix, positive semidefinite.
struct Response {
    /// For every label the numbers of others, and the entries.
    rows: Vec<Vec<(u32, f64)>>,
}

impl Response {
    fn new(slopes: &[Slopes], count: usize) -> Self {
        let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); count];
        for at in slopes.iter().filter(|at| at.area > 0.0) {
            for (row, a) in &at.of_labels {
                for (column, b) in &at.of_labels {
                    let (entry, row) = (a.dot(*b) / at.area, &mut rows[*row as usize]);
                    match row.iter_mut().find(|(of, _)| of == column) {
                        Some((_, sum)) => *sum += entry,
                        None => row.push((*column, entry)),
                    }
                }
            }
        }
        Self { rows }
    }

    fn times(&self, x: &[f64]) -> Vec<f64> {
        let row = |row: &Vec<(u32, f64)>| row.iter().map(|(j, a)| a * x[*j as usize]).sum();
        self.rows.iter().map(row).collect()
    }
}

/// The lengths that change the volumes by so much, by conjugate gradients; zero for labels that do not move.
fn solve(response: &Response, mut residual: Vec<f64>) -> Vec<f64> {
    for (missing, row) in residual.iter_mut().zip(&response.rows) {
        if row.is_empty() {
            *missing = 0.0;
        }
    }
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut lengths = vec![0.0; residual.len()];
    let mut direction = residual.clone();
    let mut squared = dot(&residual, &residual);
    let enough = TOLERANCE * TOLERANCE * squared;
    for _ in 0..SEARCHES * residual.len() {
        if squared <= enough {
            break;
        }
        let image = response.times(&direction);
        let curvature = dot(&direction, &image);
        if curvature <= 0.0 {
            break;
        }
        let step = squared / curvature;
        for k in 0..lengths.len() {
            lengths[k] += step * direction[k];
            residual[k] -= step * image[k];
        }
        let next = dot(&residual, &residual);
        for (direction, residual) in direction.iter_mut().zip(&residual) {
            *direction = residual + next / squared * *direction;
        }
        squared = next;
    }
    lengths
}

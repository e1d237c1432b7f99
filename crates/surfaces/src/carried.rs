//! The vertices of a mesh that follow a level set.

use geometry::Field;
use rayon::prelude::*;

use crate::{Error, LevelSet};

/// Points of a surface that was sampled on a grid, to be carried along as its level set moves.
///
/// A vertex goes to the zero level set, except for what the grid did not see of it: at the beginning the distance `s` of a vertex
/// to the zero level set is small where the grid resolves the mesh; where it is not, the vertex keeps that distance. In between
/// the level is `s` times a factor that rises from 0 at `|s| = own` to 1 at `|s| = 2 own`.
#[derive(Clone, Debug)]
pub struct CarriedVertices {
    vertices: Vec<[f64; 3]>,
    /// The level that each of them keeps.
    levels: Vec<f64>,
    reach: f64,
}

impl CarriedVertices {
    /// The vertices of a mesh in the box of the grid on which it begins as the phase field `start`; distances up to `own` are noise
    /// or the error of the grid.
    ///
    /// # Errors
    /// As [`LevelSet::new`].
    pub fn new(
        vertices: Vec<[f64; 3]>,
        start: &Field<3>,
        eps: f64,
        own: f64,
    ) -> Result<Self, Error> {
        let levels = LevelSet::new(start, eps)?.values(&vertices);
        let kept = |s: f64| {
            let t = (s.abs() / own - 1.0).clamp(0.0, 1.0);
            s * t * t * (3.0 - 2.0 * t)
        };
        Ok(Self {
            vertices,
            levels: levels.into_iter().map(kept).collect(),
            // A level set that has gone further than it could be followed has left the vertex behind.
            reach: 4.0 * eps,
        })
    }

    /// The part of the vertices that keep a distance, since the grid does not resolve the mesh there.
    pub fn unresolved(&self) -> f64 {
        let kept = self.levels.iter().filter(|&&level| level != 0.0).count();
        kept as f64 / self.levels.len().max(1) as f64
    }

    /// Where they are, when the phase field is `u`.
    ///
    /// # Errors
    /// As [`LevelSet::new`].
    pub fn at(&self, u: &Field<3>, eps: f64) -> Result<Vec<[f64; 3]>, Error> {
        let now = LevelSet::new(u, eps)?;
        let pairs = self.vertices.par_iter().zip(&self.levels);
        Ok(pairs
            .map(|(&x, &level)| now.project(x, level, self.reach))
            .collect())
    }

    /// The root of the mean square of their displacements so far.
    ///
    /// # Errors
    /// As [`LevelSet::new`].
    pub fn displacement(&self, u: &Field<3>, eps: f64) -> Result<f64, Error> {
        let squares: f64 = (self.at(u, eps)?.iter().zip(&self.vertices))
            .map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>())
            .sum();
        Ok((squares / self.vertices.len().max(1) as f64).sqrt())
    }
}

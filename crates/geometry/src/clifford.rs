//! The Clifford torus nearest to a phase field.

use std::f64::consts::{PI, SQRT_2};

use serde::Serialize;

use crate::measure::l2_distance;
use crate::shapes::Torus;
use crate::vector::{dot, norm, sub};
use crate::{Error, Field, Grid, SignedDistance, optimal_profile};

/// Finer grids are searched on at most so many cells a side first.
const MOST_CELLS: usize = 96;
/// Searches end where distances differ by so much in a box of side 1.
const TOLERANCE: f64 = 1e-9;

/// A Clifford torus in space, fitted to a phase field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CliffordTorus {
    /// Its centre.
    pub centre: [f64; 3],
    /// Unit vector along its axis.
    pub axis: [f64; 3],
    /// Radius of its outer equator.
    pub outer_radius: f64,
    /// `L2` distance of the two phase fields.
    pub l2: f64,
}

impl CliffordTorus {
    /// The torus whose phase field is nearest to `u` in `L2`: the best of three simplex searches over centre, axis and radius, from
    /// the centre of mass, the volume and each of the coordinate axes. On fine grids they use every second node, third node, and so on, and one
    /// more search on the whole grid begins where they end.
    ///
    /// # Errors
    /// [`Error::NoCliffordTorus`] if there is no volume inside or the search fails.
    pub fn nearest(u: &Field<3>, eps: f64) -> Result<Self, Error> {
        Self::nearest_after(coarsened(u, MOST_CELLS)?.as_ref(), u, eps)
    }

    /// The same, by searches on a coarser grid first if there is one.
    fn nearest_after(coarse: Option<&Field<3>>, u: &Field<3>, eps: f64) -> Result<Self, Error> {
        let inside = |u: f64| 0.5 * (1.0 + u.clamp(-1.0, 1.0));
        let sum: f64 = u.values().iter().map(|&u| inside(u)).sum();
        if sum <= 0.0 {
            return Err(Error::NoCliffordTorus("the phase field has no inside"));
        }
        let mut centre = [0.0; 3];
        for (i, &value) in u.values().iter().enumerate() {
            for (c, x) in centre.iter_mut().zip(u.grid().node(i)) {
                *c += inside(value) * x / sum;
            }
        }
        // 2 pi^2 R r^2 with R = sqrt(2) r.
        let minor = (sum * u.grid().cell_volume() / (2.0 * SQRT_2 * PI.powi(2))).cbrt();
        let radius = minor * (1.0 + SQRT_2);
        let [c0, c1, c2] = centre;
        let start = [c0, c1, c2, 0.0, 0.0, radius];
        let search = |u: &Field<3>, along: usize, start: [f64; 6], part: f64| {
            let (length, tilt) = (0.1 * part * radius, 0.2 * part);
            let steps = [length, length, length, tilt, tilt, length];
            let distance = |parameters: &[f64; 6]| {
                let torus = Self::near_axis(along, parameters).phase_field(u.grid(), eps)?;
                l2_distance(u, &torus)
            };
            // Beyond the positive radii there is no torus, which is no reason to stop.
            let cost = |parameters: &[f64; 6]| distance(parameters).unwrap_or(f64::INFINITY);
            // In the unit of the distance.
            let tolerance = TOLERANCE * u.grid().side().powf(1.5);
            nelder_mead(cost, start, steps, tolerance)
        };
        let found = [0, 1, 2].map(|along| (along, search(coarse.unwrap_or(u), along, start, 1.0)));
        let fits = found.into_iter().filter(|(_, (l2, _))| l2.is_finite());
        let best = fits.min_by(|(_, a), (_, b)| a.0.total_cmp(&b.0));
        let (along, mut best) = best.ok_or(Error::NoCliffordTorus("the search found none"))?;
        if coarse.is_some() {
            best = search(u, along, best.1, 0.1);
        }
        Ok(Self {
            l2: best.0,
            ..Self::near_axis(along, &best.1)
        })
    }

    /// A torus by its centre, the tilt of its axis from a coordinate axis towards the two others, and its outer radius.
    fn near_axis(along: usize, parameters: &[f64; 6]) -> Self {
        let [c0, c1, c2, a, b, outer_radius] = *parameters;
        let mut axis = [1.0, a, b];
        axis.rotate_right(along);
        Self {
            centre: [c0, c1, c2],
            axis: normalized(axis),
            outer_radius,
            l2: f64::INFINITY,
        }
    }

    /// The phase field of the torus.
    ///
    /// # Errors
    /// A radius that is not positive.
    pub fn phase_field(&self, grid: &Grid<3>, eps: f64) -> Result<Field<3>, Error> {
        let torus = Torus::clifford(self.outer_radius)?;
        Ok(Field::from_fn(*grid, |x| {
            let x = sub(x, self.centre);
            let height = dot(x, self.axis);
            let across: [f64; 3] = std::array::from_fn(|i| x[i] - height * self.axis[i]);
            let in_its_frame = [norm(across), 0.0, height];
            optimal_profile(torus.signed_distance(in_its_frame), eps)
        }))
    }

    /// Circles around the tube, as closed polylines.
    ///
    /// # Errors
    /// A radius that is not positive.
    pub fn minor_circles(&self, count: usize, points: usize) -> Result<Vec<Vec<[f64; 3]>>, Error> {
        let torus = Torus::clifford(self.outer_radius)?;
        let [axis, e, f] = frame_of(self.axis);
        let angle = |k: usize, of: usize| 2.0 * PI * k as f64 / of as f64;
        let circle = |k: usize| {
            let (sin, cos) = angle(k, count).sin_cos();
            let outward: [f64; 3] = std::array::from_fn(|i| cos * e[i] + sin * f[i]);
            let point = |j: usize| {
                let (up, out) = angle(j, points).sin_cos();
                let radius = torus.major() + torus.minor() * out;
                let height = torus.minor() * up;
                std::array::from_fn(|i| self.centre[i] + radius * outward[i] + height * axis[i])
            };
            (0..points).map(point).collect()
        };
        Ok((0..count).map(circle).collect())
    }
}

/// The values at every k-th node along each axis, with the smallest k that leaves at most so many; none where all are left, or too few.
fn coarsened(u: &Field<3>, most_cells: usize) -> Result<Option<Field<3>>, Error> {
    let cells = u.grid().cells();
    let every = (1..=cells).find(|k| cells.is_multiple_of(*k) && cells / k <= most_cells);
    // Too few say nothing.
    let every = every.filter(|every| *every > 1 && 4 * (cells / every) > most_cells);
    every.map(|every| u.thinned(every)).transpose()
}

/// The best vertex and its cost after a search by the simplex method of Nelder and Mead, from the simplex of a point and its displacements
/// along the axes, until the standard deviation of the costs in the simplex is below the tolerance.
fn nelder_mead<const N: usize>(
    cost: impl Fn(&[f64; N]) -> f64,
    start: [f64; N],
    steps: [f64; N],
    tolerance: f64,
) -> (f64, [f64; N]) {
    const ITERATIONS: usize = 1000;
    let vertex = |x: [f64; N]| (cost(&x), x);
    let along = |from: &[f64; N], to: &[f64; N], t: f64| -> [f64; N] {
        std::array::from_fn(|i| from[i] + (to[i] - from[i]) * t)
    };
    type Vertex<const N: usize> = (f64, [f64; N]);
    let better = |a: Vertex<N>, b: Vertex<N>| if a.0 < b.0 { a } else { b };
    let mut simplex = vec![vertex(start)];
    for axis in 0..N {
        let mut x = start;
        x[axis] += steps[axis];
        simplex.push(vertex(x));
    }
    for _ in 0..ITERATIONS {
        simplex.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let mean = simplex.iter().map(|(cost, _)| cost).sum::<f64>() / (N + 1) as f64;
        let squares: f64 = simplex.iter().map(|(cost, _)| (cost - mean).powi(2)).sum();
        if (squares / N as f64).sqrt() < tolerance {
            break;
        }
        let (best, second_worst, worst) = (simplex[0], simplex[N - 1], simplex[N]);
        let centroid: [f64; N] = std::array::from_fn(|i| {
            simplex[..N].iter().map(|(_, x)| x[i]).sum::<f64>() * (1.0 / N as f64)
        });
        let reflected = vertex(along(&centroid, &worst.1, -1.0));
        if reflected.0 < best.0 {
            let expanded = vertex(along(&centroid, &reflected.1, 2.0));
            simplex[N] = better(expanded, reflected);
        } else if reflected.0 < second_worst.0 {
            simplex[N] = reflected;
        } else {
            let nearer = better(reflected, worst);
            let contracted = vertex(along(&centroid, &nearer.1, 0.5));
            if contracted.0 < nearer.0 {
                simplex[N] = contracted;
            } else {
                for other in &mut simplex[1..] {
                    *other = vertex(along(&best.1, &other.1, 0.5));
                }
            }
        }
    }
    simplex.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    simplex[0]
}

fn normalized(a: [f64; 3]) -> [f64; 3] {
    let length = norm(a);
    a.map(|a| a / length)
}

/// An orthonormal basis that begins with the given direction.
fn frame_of(axis: [f64; 3]) -> [[f64; 3]; 3] {
    let axis = normalized(axis);
    // The coordinate direction that is farthest from the axis.
    let k = (0..3)
        .min_by(|&i, &j| axis[i].abs().total_cmp(&axis[j].abs()))
        .unwrap_or(0);
    let mut e = [0.0; 3];
    e[k] = 1.0;
    let along = dot(e, axis);
    let e = normalized(std::array::from_fn(|i| e[i] - along * axis[i]));
    let f = [
        axis[1] * e[2] - axis[2] * e[1],
        axis[2] * e[0] - axis[0] * e[2],
        axis[0] * e[1] - axis[1] * e[0],
    ];
    [axis, e, f]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clifford_torus_is_found_in_any_position() {
        // In any unit of length.
        for (axis, unit) in [([0.3, -0.5, 1.0], 1.0), ([1.0, 1.0, -1.0], 1e-6_f64)] {
            let grid = Grid::<3>::new(32, unit).unwrap();
            let eps = 2.0 * grid.spacing();
            let torus = CliffordTorus {
                centre: [0.52, 0.47, 0.5].map(|x| x * unit),
                axis: normalized(axis),
                outer_radius: 0.36 * unit,
                l2: 0.0,
            };
            let u = torus.phase_field(&grid, eps).unwrap();
            let coarse = coarsened(&u, 16).unwrap().unwrap();
            assert_eq!(coarse.grid().cells(), 16);
            let after = CliffordTorus::nearest_after(Some(&coarse), &u, eps).unwrap();
            let found = CliffordTorus::nearest(&u, eps).unwrap();
            let l2 = 1e-4 * unit.powf(1.5);
            assert!(found.l2 < l2 && after.l2 < l2, "{found:?} {after:?}");
            assert!((found.outer_radius / unit - 0.36).abs() < 1e-4, "{found:?}");
            assert!(dot(found.axis, torus.axis).abs() > 1.0 - 1e-6, "{found:?}");
            for (a, b) in found.centre.iter().zip(torus.centre) {
                assert!((a - b).abs() < 1e-4 * unit, "{found:?}");
            }
            for circle in found.minor_circles(3, 16).unwrap() {
                for x in circle {
                    let x: [f64; 3] = std::array::from_fn(|i| x[i] - found.centre[i]);
                    let height = dot(x, found.axis);
                    let across = (dot(x, x) - height * height).sqrt();
                    let shape = Torus::clifford(found.outer_radius).unwrap();
                    assert!(shape.signed_distance([across, 0.0, height]).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn nothing_fits_an_empty_field() {
        let grid = Grid::<3>::new(8, 1.0).unwrap();
        assert!(CliffordTorus::nearest(&Field::constant(grid, -1.0), 0.1).is_err());
    }
}

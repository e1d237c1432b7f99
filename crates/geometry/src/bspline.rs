//! The interpolating quintic spline of a field, with its derivatives.

use std::array::from_fn;

use crate::{Grid, parallel};

/// Coefficients along an axis that a point sees.
const SUPPORT: usize = 6;
/// The poles of the inverse of the filter `(1, 26, 66, 26, 1) / 120`, which takes coefficients to values at the nodes (Unser, Aldroubi and Eden, IEEE
/// Trans. Signal Process. 41, 1993).
const POLES: [f64; 2] = [-0.430_575_347_099_973_8, -0.043_096_288_203_264_65];
/// Rows in a task.
const ROWS: usize = 16;

/// The periodic quintic spline through the values of a field at the nodes: four times continuously differentiable, and of sixth order where the field
/// is smooth.
#[derive(Clone, Debug)]
pub struct BSpline<const D: usize> {
    grid: Grid<D>,
    coefficients: Vec<f64>,
}

/// A function at a point, with its first and second derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet<const D: usize> {
    /// The value.
    pub value: f64,
    /// The gradient.
    pub gradient: [f64; D],
    /// The matrix of second derivatives.
    pub hessian: [[f64; D]; D],
}

/// Weights of the coefficients around a point of an axis for the value and both derivatives, in spacings of the grid.
type Weights = [[f64; SUPPORT]; 3];

impl<const D: usize> BSpline<D> {
    /// The spline through these values.
    ///
    /// # Panics
    /// Unless there is a value for each node.
    pub fn through(grid: Grid<D>, mut values: Vec<f64>) -> Self {
        assert_eq!(values.len(), grid.len(), "a value for each node");
        for axis in 0..D {
            filter_along(&grid, axis, &mut values);
        }
        Self {
            grid,
            coefficients: values,
        }
    }

    /// The grid.
    pub fn grid(&self) -> &Grid<D> {
        &self.grid
    }

    /// The spline at a point, which may lie outside of the box.
    pub fn at(&self, x: [f64; D]) -> Jet<D> {
        let (cells, h) = (self.grid.cells(), self.grid.spacing());
        let (mut nodes, mut weights) = ([[0; SUPPORT]; D], [[[0.0; SUPPORT]; 3]; D]);
        for axis in 0..D {
            let position = (x[axis] - self.grid.origin()[axis]) / h;
            let floor = position.floor();
            weights[axis] = quintic(position - floor);
            // Two nodes before the cell.
            let first = floor.rem_euclid(cells as f64) as usize + cells - 2;
            nodes[axis] = from_fn(|i| (first + i) % cells);
        }
        let mut sums = Sums::default();
        self.sum(&nodes, &weights, &mut sums);
        sums.jet(h)
    }

    /// Adds up the rows of coefficients along the last axis around a point.
    fn sum(&self, nodes: &[[usize; SUPPORT]; D], weights: &[Weights; D], sums: &mut Sums<D>) {
        let last = D - 1;
        for row in 0..SUPPORT.pow(last as u32) {
            let (mut place, mut rest, mut start) = ([0; D], row, 0);
            for axis in (0..last).rev() {
                place[axis] = rest % SUPPORT;
                rest /= SUPPORT;
            }
            for axis in 0..last {
                start = (start + nodes[axis][place[axis]]) * self.grid.cells();
            }
            let mut line = [0.0; 3];
            for (k, node) in nodes[last].iter().enumerate() {
                let coefficient = self.coefficients[start + node];
                for (sum, weights) in line.iter_mut().zip(&weights[last]) {
                    *sum += weights[k] * coefficient;
                }
            }
            // The product of the weights along the other axes, each derived so many times.
            let factor = |orders: [usize; D]| -> f64 {
                let factors = (0..last).map(|axis| weights[axis][orders[axis]][place[axis]]);
                factors.product::<f64>() * line[orders[last]]
            };
            sums.add(factor);
        }
    }
}

/// A [`Jet`] in spacings of the grid, of which only half of the symmetric matrix is summed.
struct Sums<const D: usize>(Jet<D>);

impl<const D: usize> Default for Sums<D> {
    fn default() -> Self {
        Self(Jet {
            value: 0.0,
            gradient: [0.0; D],
            hessian: [[0.0; D]; D],
        })
    }
}

impl<const D: usize> Sums<D> {
    /// Adds a term, given by its derivatives of some orders along the axes.
    fn add(&mut self, term: impl Fn([usize; D]) -> f64) {
        let Self(jet) = self;
        jet.value += term([0; D]);
        for a in 0..D {
            let mut orders = [0; D];
            orders[a] = 1;
            jet.gradient[a] += term(orders);
            for b in 0..=a {
                let mut orders = [0; D];
                orders[a] += 1;
                orders[b] += 1;
                jet.hessian[a][b] += term(orders);
            }
        }
    }

    fn jet(self, h: f64) -> Jet<D> {
        let Self(jet) = self;
        Jet {
            value: jet.value,
            gradient: jet.gradient.map(|slope| slope / h),
            hessian: from_fn(|a| from_fn(|b| jet.hessian[a.max(b)][a.min(b)] / (h * h))),
        }
    }
}

/// Weights of six coefficients in a row for a point `t` behind the third of them, and their derivatives.
fn quintic(t: f64) -> Weights {
    let derivatives = |x: f64| -> [f64; 3] {
        // The basis spline of degree five at distance x from its centre, from its truncated powers.
        let powers = |p: i32, scale: f64| {
            let part = |shift: f64| (shift - x).max(0.0).powi(p);
            scale * (part(3.0) - 6.0 * part(2.0) + 15.0 * part(1.0))
        };
        [
            powers(5, 1.0 / 120.0),
            powers(4, -1.0 / 24.0),
            powers(3, 1.0 / 6.0),
        ]
    };
    let of_node = |k: usize| {
        let x = t + 2.0 - k as f64;
        let [value, slope, bend] = derivatives(x.abs());
        // The slope is odd.
        [value, if x < 0.0 { -slope } else { slope }, bend]
    };
    let of_nodes: [[f64; 3]; SUPPORT] = from_fn(of_node);
    from_fn(|order| of_nodes.map(|of_node| of_node[order]))
}

/// Takes values at the nodes to coefficients along an axis.
fn filter_along<const D: usize>(grid: &Grid<D>, axis: usize, values: &mut [f64]) {
    let (cells, stride) = (grid.cells(), grid.stride(axis));
    let block = cells * stride;
    if stride == 1 {
        parallel::over_chunks(values, block * ROWS, &|_, rows| {
            rows.chunks_mut(block).for_each(filter);
        });
        return;
    }
    parallel::over_chunks(values, block, &|_, block| {
        let mut row = vec![0.0; cells];
        for first in 0..stride {
            for (i, value) in row.iter_mut().enumerate() {
                *value = block[first + i * stride];
            }
            filter(&mut row);
            for (i, value) in row.iter().enumerate() {
                block[first + i * stride] = *value;
            }
        }
    });
}

/// The inverse of the filter `(1, 26, 66, 26, 1) / 120` on a periodic row, by a recursion forth and back for each pole.
fn filter(row: &mut [f64]) {
    for pole in POLES {
        let gain = (1.0 - pole) * (1.0 - pole.recip());
        // Both recursions have gone around the period before they begin.
        let periods = (1.0 - pole.powi(row.len() as i32)).recip();
        let mut last = periods * row.iter().fold(0.0, |sum, value| pole * sum + value);
        for value in row.iter_mut() {
            last = pole * last + *value;
            *value = last;
        }
        let mut next =
            -pole * periods * row.iter().rev().fold(0.0, |sum, value| pole * sum + value);
        for value in row.iter_mut().rev() {
            next = pole * (next - *value);
            *value = next;
        }
        for value in row.iter_mut() {
            *value *= gain;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// The largest errors of value, gradient and second derivatives of a wave between the nodes.
    fn errors<const D: usize>(cells: usize) -> [f64; 3] {
        let grid = Grid::<D>::centred(cells, 1.0).unwrap();
        let waves: [f64; D] = from_fn(|axis| TAU * (axis + 1) as f64);
        let phase = |x: [f64; D]| (0..D).map(|axis| waves[axis] * x[axis]).sum::<f64>();
        let values = parallel::values(grid.len(), |node| phase(grid.node(node)).sin());
        let spline = BSpline::through(grid, values.clone());
        let mut errors = [0.0_f64; 3];
        for k in 0..200 {
            let x = from_fn(|axis| {
                f64::fract(f64::from(k) * 0.754_877 / (axis + 1) as f64) * 3.0 - 1.5
            });
            let (jet, sin, cos) = (spline.at(x), phase(x).sin(), phase(x).cos());
            errors[0] = errors[0].max((jet.value - sin).abs());
            for a in 0..D {
                errors[1] = errors[1].max((jet.gradient[a] - waves[a] * cos).abs());
                for b in 0..D {
                    errors[2] =
                        errors[2].max((jet.hessian[a][b] + waves[a] * waves[b] * sin).abs());
                }
            }
        }
        for node in (0..grid.len()).step_by(7) {
            assert!((spline.at(grid.node(node)).value - values[node]).abs() < 1e-13);
        }
        errors
    }

    #[test]
    fn splines_are_of_sixth_order_and_their_derivatives_of_fifth_and_fourth() {
        fn orders<const D: usize>(cells: usize) {
            let [coarse, fine] = [cells, 2 * cells].map(errors::<D>);
            for (k, order) in [6.0, 5.0, 4.0].into_iter().enumerate() {
                let observed = (coarse[k] / fine[k]).log2();
                assert!(
                    observed > order - 0.3,
                    "{k}: {observed} {coarse:?} {fine:?}"
                );
            }
        }
        orders::<2>(24);
        orders::<3>(18);
    }
}

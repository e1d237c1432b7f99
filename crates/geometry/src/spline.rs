//! Fields between their nodes, with continuous gradients.

use crate::{PhaseField, Stored};

impl<const D: usize> Stored<D> {
    /// Value and gradient at `x` of the tensor product of Catmull-Rom splines through the nodal values: continuously differentiable, of
    /// third order where the field is smooth, and periodic as the grid.
    pub fn spline(&self, x: [f64; D]) -> (f64, [f64; D]) {
        let grid = self.grid();
        let cells = grid.cells();
        let (mut nodes, mut weights, mut slopes) = ([[0; 4]; D], [[0.0; 4]; D], [[0.0; 4]; D]);
        for axis in 0..D {
            let position = (x[axis] - grid.origin()[axis]) / grid.spacing();
            let floor = position.floor();
            (weights[axis], slopes[axis]) = catmull_rom(position - floor);
            // One node before the cell.
            let first = floor.rem_euclid(cells as f64) as usize + cells - 1;
            nodes[axis] = [0, 1, 2, 3].map(|i| (first + i) % cells);
        }
        let last = D - 1;
        let (mut value, mut gradient) = (0.0, [0.0; D]);
        for row in 0..4_usize.pow(last as u32) {
            // Which of the four nodes along the other axes, of which the last one runs fastest.
            let place = |axis: usize| row >> (2 * (last - 1 - axis)) & 3;
            let mut first = [0; D];
            for axis in 0..last {
                first[axis] = nodes[axis][place(axis)];
            }
            let (mut line, mut slope) = (0.0, 0.0);
            for (k, node) in nodes[last].into_iter().enumerate() {
                first[last] = node;
                let value = self.at(first);
                line += weights[last][k] * value;
                slope += slopes[last][k] * value;
            }
            // Of the other axes, one of which may be derived along.
            let factor = |derived: usize| -> f64 {
                let factors = (0..last).map(|axis| {
                    let factors = if axis == derived { slopes } else { weights };
                    factors[axis][place(axis)]
                });
                factors.product()
            };
            value += factor(last) * line;
            for (axis, sum) in gradient.iter_mut().enumerate() {
                *sum += factor(axis) * if axis == last { slope } else { line };
            }
        }
        (value, gradient.map(|sum| sum / grid.spacing()))
    }
}

/// Weights of four nodes in a row for a point `t` behind the second of them, and their derivatives.
fn catmull_rom(t: f64) -> ([f64; 4], [f64; 4]) {
    let (t2, t3) = (t * t, t * t * t);
    let weights = [
        -t + 2.0 * t2 - t3,
        2.0 - 5.0 * t2 + 3.0 * t3,
        t + 4.0 * t2 - 3.0 * t3,
        t3 - t2,
    ];
    let slopes = [
        -1.0 + 4.0 * t - 3.0 * t2,
        -10.0 * t + 9.0 * t2,
        1.0 + 8.0 * t - 9.0 * t2,
        3.0 * t2 - 2.0 * t,
    ];
    (weights.map(|w| 0.5 * w), slopes.map(|s| 0.5 * s))
}

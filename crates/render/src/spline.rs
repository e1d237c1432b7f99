//! Cubic B-splines on a lattice.

use rayon::prelude::*;

/// Values at the nodes of the spline whose coefficients are given: means with the weights 1/6, 2/3
/// and 1/6 along every axis. At the ends the last value is repeated.
pub(crate) fn nodal(coefficients: &[f32], size: usize) -> Vec<f32> {
    (0..3).fold(coefficients.to_vec(), |values, axis| {
        let stride = size.pow(2 - axis);
        (0..values.len())
            .into_par_iter()
            .map(|at| {
                let i = at / stride % size;
                let before = if i == 0 { at } else { at - stride };
                let after = if i + 1 == size { at } else { at + stride };
                (values[before] + 4.0 * values[at] + values[after]) / 6.0
            })
            .collect()
    })
}

/// The four basis functions at `t` in `[0, 1]` and their derivatives.
fn weights(t: f32) -> ([f32; 4], [f32; 4]) {
    let s = 1.0 - t;
    let (t2, s2) = (t * t, s * s);
    let value = [
        s2 * s / 6.0,
        2.0 / 3.0 - 0.5 * t2 * (2.0 - t),
        2.0 / 3.0 - 0.5 * s2 * (2.0 - s),
        t2 * t / 6.0,
    ];
    let slope = [-0.5 * s2, 1.5 * t2 - 2.0 * t, 2.0 * s - 1.5 * s2, 0.5 * t2];
    (value, slope)
}

/// The value of the spline in the cell `cell`, at `local` in `[0, 1]^3` from its lower corner.
pub(crate) fn value(coefficients: &[f32], size: usize, cell: [usize; 3], local: [f32; 3]) -> f32 {
    let [wx, wy, wz] = local.map(|t| weights(t).0);
    let mut sum = 0.0;
    for (i, a) in wx.into_iter().enumerate() {
        for (j, b) in wy.into_iter().enumerate() {
            let start = ((cell[0] + i - 1) * size + cell[1] + j - 1) * size + cell[2] - 1;
            let c: &[f32; 4] = coefficients[start..]
                .first_chunk()
                .expect("inside the lattice");
            sum += a * b * (c[0] * wz[0] + c[1] * wz[1] + c[2] * wz[2] + c[3] * wz[3]);
        }
    }
    sum
}

/// The gradient of the spline, likewise.
pub(crate) fn gradient(
    coefficients: &[f32],
    size: usize,
    cell: [usize; 3],
    local: [f32; 3],
) -> [f32; 3] {
    let [(wx, dx), (wy, dy), (wz, dz)] = local.map(weights);
    let mut sum = [0.0; 3];
    for i in 0..4 {
        for j in 0..4 {
            let start = ((cell[0] + i - 1) * size + cell[1] + j - 1) * size + cell[2] - 1;
            let c: &[f32; 4] = coefficients[start..]
                .first_chunk()
                .expect("inside the lattice");
            let along = c[0] * wz[0] + c[1] * wz[1] + c[2] * wz[2] + c[3] * wz[3];
            let slope = c[0] * dz[0] + c[1] * dz[1] + c[2] * dz[2] + c[3] * dz[3];
            sum[0] += dx[i] * wy[j] * along;
            sum[1] += wx[i] * dy[j] * along;
            sum[2] += wx[i] * wy[j] * slope;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: usize = 24;

    fn smooth([x, y, z]: [f32; 3]) -> f32 {
        (0.3 * x).sin() + (0.2 * y + 0.1 * z).cos() * (0.25 * z).sin()
    }

    fn sampled() -> Vec<f32> {
        (0..SIZE * SIZE * SIZE)
            .map(|k| smooth([k / SIZE / SIZE, k / SIZE % SIZE, k % SIZE].map(|i| i as f32)))
            .collect()
    }

    #[test]
    fn the_spline_smooths_a_little_and_passes_through_its_nodal_values() {
        let samples = sampled();
        let nodal = nodal(&samples, SIZE);
        for cell in [[8, 9, 10], [12, 5, 14], [6, 17, 11]] {
            let at = cell.map(|c| c as f32);
            let there = value(&samples, SIZE, cell, [0.0; 3]);
            let index = (cell[0] * SIZE + cell[1]) * SIZE + cell[2];
            assert!((there - nodal[index]).abs() < 1e-6, "{cell:?}");
            // The leading error is a sixth of the Laplacian, here at most 0.19.
            let error = there - smooth(at);
            assert!(
                (1e-4..0.19 / 6.0).contains(&error.abs()),
                "{cell:?}: {error}"
            );
        }
    }

    #[test]
    fn linear_functions_are_reproduced() {
        let plane = |[x, y, z]: [f32; 3]| 0.5 * x - 0.25 * y + z - 3.0;
        let samples: Vec<f32> = (0..SIZE * SIZE * SIZE)
            .map(|k| plane([k / SIZE / SIZE, k / SIZE % SIZE, k % SIZE].map(|i| i as f32)))
            .collect();
        let (cell, local) = ([4, 5, 6], [0.3, 0.8, 0.45]);
        let at = std::array::from_fn(|k| cell[k] as f32 + local[k]);
        assert!((value(&samples, SIZE, cell, local) - plane(at)).abs() < 1e-5);
        let slopes = gradient(&samples, SIZE, cell, local);
        assert!((slopes[0] - 0.5).abs() < 1e-5 && (slopes[1] + 0.25).abs() < 1e-5);
    }

    #[test]
    fn the_gradient_is_that_of_the_value() {
        let coefficients = sampled();
        let (cell, local, step) = ([10, 11, 12], [0.4, 0.5, 0.6], 0.02);
        let slopes = gradient(&coefficients, SIZE, cell, local);
        for axis in 0..3 {
            let moved = |by: f32| {
                let mut local = local;
                local[axis] += by;
                value(&coefficients, SIZE, cell, local)
            };
            let quotient = (moved(step) - moved(-step)) / (2.0 * step);
            assert!((slopes[axis] - quotient).abs() < 1e-3, "axis {axis}");
        }
    }
}

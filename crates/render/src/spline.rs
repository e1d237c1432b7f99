//! Cubic B-splines on a lattice.

use rayon::prelude::*;

/// The pole of the cubic B-spline filter, `sqrt(3) - 2`.
const POLE: f32 = -0.267_949_2;
/// The influence of the boundary falls below single precision after this many nodes.
const HORIZON: usize = 14;

/// Turns `size^3` samples into the coefficients of the cubic spline that interpolates them, with
/// mirrored ends (M. Unser, A. Aldroubi, M. Eden: B-spline signal processing, part II, IEEE
/// Trans. Signal Processing 41, 1993).
pub(crate) fn prefilter(values: &mut [f32], size: usize) {
    let plane = size * size;
    // Rows along the last axis, then along the middle one, are contiguous in one slab of axis 0.
    values.par_chunks_mut(plane).for_each(|slab| {
        for row in slab.chunks_mut(size) {
            filter(row, 1, size);
        }
        filter(slab, size, size);
    });
    // Along axis 0, `plane` interleaved rows: each thread copies some of them out and back.
    let columns: Vec<Vec<f32>> = (0..size)
        .into_par_iter()
        .map(|j| {
            let mut block: Vec<f32> = (0..size)
                .flat_map(|i| &values[i * plane + j * size..][..size])
                .copied()
                .collect();
            filter(&mut block, size, size);
            block
        })
        .collect();
    values
        .par_chunks_mut(plane)
        .enumerate()
        .for_each(|(i, slab)| {
            for (row, block) in slab.chunks_mut(size).zip(&columns) {
                row.copy_from_slice(&block[i * size..][..size]);
            }
        });
}

/// Filters `width` interleaved rows of `size` samples in place.
fn filter(rows: &mut [f32], width: usize, size: usize) {
    let horizon = HORIZON.min(size);
    for lane in 0..width {
        let mut power = 1.0;
        let mut first = 0.0;
        for k in 0..horizon {
            first += power * rows[k * width + lane];
            power *= POLE;
        }
        rows[lane] = first;
    }
    for at in width..size * width {
        rows[at] += POLE * rows[at - width];
    }
    let last = (size - 1) * width;
    for at in last..last + width {
        rows[at] = POLE / (POLE * POLE - 1.0) * (rows[at] + POLE * rows[at - width]);
    }
    for at in (0..last).rev() {
        rows[at] = POLE * (rows[at + width] - rows[at]);
    }
    // The gain of the recursion, (1 - z)(1 - 1/z) = 6.
    for value in rows {
        *value *= 6.0;
    }
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
    let slope = [
        -0.5 * s2,
        1.5 * t2 - 2.0 * t,
        2.0 * s - 1.5 * s2,
        0.5 * t2,
    ];
    (value, slope)
}

/// The value of the spline in the cell `cell`, at `local` in `[0, 1]^3` from its lower corner.
pub(crate) fn value(
    coefficients: &[f32],
    size: usize,
    cell: [usize; 3],
    local: [f32; 3],
) -> f32 {
    let [wx, wy, wz] = local.map(|t| weights(t).0);
    let mut sum = 0.0;
    for (i, a) in wx.into_iter().enumerate() {
        for (j, b) in wy.into_iter().enumerate() {
            let start = ((cell[0] + i - 1) * size + cell[1] + j - 1) * size + cell[2] - 1;
            let c: &[f32; 4] = coefficients[start..].first_chunk().expect("inside the lattice");
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
            let c: &[f32; 4] = coefficients[start..].first_chunk().expect("inside the lattice");
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
    fn the_spline_interpolates_its_samples_and_converges_between_them() {
        let mut coefficients = sampled();
        prefilter(&mut coefficients, SIZE);
        for cell in [[8, 9, 10], [12, 5, 14], [6, 17, 11]] {
            for (local, tolerance) in [([0.0; 3], 2e-6), ([0.5, 0.25, 0.75], 2e-4)] {
                let at = std::array::from_fn(|k| cell[k] as f32 + local[k]);
                let error = value(&coefficients, SIZE, cell, local) - smooth(at);
                assert!(error.abs() < tolerance, "{cell:?} {local:?}: {error}");
            }
        }
    }

    #[test]
    fn the_gradient_is_that_of_the_value() {
        let mut coefficients = sampled();
        prefilter(&mut coefficients, SIZE);
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

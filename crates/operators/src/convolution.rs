//! Circular convolution on the host: `(K*u)_a = sum_b K_b u_{a+b}` with periodic `u`.

use std::sync::Arc;

use rayon::prelude::*;
use rustfft::num_complex::Complex;

use crate::fft::{CachedSymbol, Real, Transform, lock};

/// Symbols of this many (kernel, grid) pairs are kept; a flow uses one, training one per batch.
const CACHED_SYMBOLS: usize = 16;

/// `F[K]` such that `K*u = F^-1[symbol F[u]]` with [`Transform::filter`], including its normalisation.
///
/// `kernel` has `width^D` entries, row-major, its centre at `width / 2` on every axis. A kernel wider than the
/// grid is wrapped around it, as the sum over all integers says.
pub fn kernel_symbol<T: Real>(shape: &[usize], kernel: &[T], width: usize) -> Arc<Vec<Complex<T>>> {
    let cache = &T::shared().symbols;
    let mut entries = lock(cache);
    if let Some(i) = entries
        .iter()
        .position(|e| e.shape == shape && e.width == width && e.kernel == kernel)
    {
        let entry = entries.remove(i);
        let symbol = entry.symbol.clone();
        entries.push(entry);
        return symbol;
    }
    drop(entries);
    let plan = Transform::<T>::of_shape(shape);
    let scale = T::of(1.0 / plan.len() as f64);
    // The kernel placed on the grid with its centre at the origin.
    let mut grid = vec![T::zero(); plan.len()];
    for (i, &value) in kernel.iter().enumerate() {
        let j = wrapped_index(shape, i, width);
        grid[j] = grid[j] + value;
    }
    let mut symbol = plan.forward(&grid);
    for value in &mut symbol {
        *value = value.conj().scale(scale);
    }
    let symbol = Arc::new(symbol);
    entries = lock(cache);
    if entries.len() >= CACHED_SYMBOLS {
        entries.remove(0);
    }
    entries.push(CachedSymbol {
        shape: shape.to_vec(),
        width,
        kernel: kernel.to_vec(),
        symbol: symbol.clone(),
    });
    symbol
}

/// Grid index of the `i`-th kernel entry's offset.
fn wrapped_index(shape: &[usize], i: usize, width: usize) -> usize {
    let mut rest = i;
    let mut stride = 1;
    let mut index = 0;
    for &n in shape.iter().rev() {
        let offset = (rest % width) as isize - (width / 2) as isize;
        index += offset.rem_euclid(n as isize) as usize * stride;
        stride *= n;
        rest /= width;
    }
    index
}

/// Convolves every grid in `x` (leading batch axes allowed) with the kernel, or with its transpose.
pub(crate) fn convolve<T: Real>(
    x: &[T],
    shape: &[usize],
    kernel: &[T],
    width: usize,
    adjoint: bool,
) -> Vec<T> {
    let symbol = kernel_symbol(shape, kernel, width);
    let plan = Transform::<T>::of_shape(shape);
    // Batches run side by side, single grids are split inside the transform.
    if x.len() == plan.len() {
        return plan.filter(x, &symbol, adjoint);
    }
    let grids = x.par_chunks_exact(plan.len());
    let parts: Vec<Vec<T>> = grids.map(|x| plan.filter(x, &symbol, adjoint)).collect();
    parts.concat()
}

/// `c_b = sum_a g_a x_{a+b}` for `|b| <= width / 2`, summed over the batch: the kernel's gradient.
pub(crate) fn correlate<T: Real>(x: &[T], g: &[T], shape: &[usize], width: usize) -> Vec<T> {
    let plan = Transform::<T>::of_shape(shape);
    let len = plan.len();
    let products: Vec<Vec<Complex<T>>> = x
        .par_chunks_exact(len)
        .zip(g.par_chunks_exact(len))
        .map(|(x, g)| {
            let mut product = plan.forward(x);
            for (value, factor) in product.iter_mut().zip(plan.forward(g)) {
                *value = *value * factor.conj();
            }
            product
        })
        .collect();
    // Summed in the order of the batch, so that the result does not depend on the number of threads.
    let mut products = products.into_iter();
    let mut total = products.next().unwrap_or_default();
    for product in products {
        for (sum, value) in total.iter_mut().zip(product) {
            *sum = *sum + value;
        }
    }
    let scale = T::of(1.0 / len as f64);
    let correlation = plan.inverse(&total);
    (0..width.pow(shape.len() as u32))
        .map(|i| correlation[wrapped_index(shape, i, width)] * scale)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise;

    /// The definition, as a sum.
    fn direct(x: &[f64], shape: &[usize], kernel: &[f64], width: usize, sign: isize) -> Vec<f64> {
        let unravel = |mut i: usize, dims: &[usize]| {
            let mut index = vec![0; dims.len()];
            for (axis, &n) in dims.iter().enumerate().rev() {
                index[axis] = i % n;
                i /= n;
            }
            index
        };
        (0..x.len())
            .map(|a| {
                let a = unravel(a, shape);
                (0..kernel.len())
                    .map(|b| {
                        let b = unravel(b, &vec![width; shape.len()]);
                        let mut flat = 0;
                        let mut flat_kernel = 0;
                        for axis in 0..shape.len() {
                            let offset = sign * (b[axis] as isize - (width / 2) as isize);
                            let i = (a[axis] as isize + offset).rem_euclid(shape[axis] as isize);
                            flat = flat * shape[axis] + i as usize;
                            flat_kernel = flat_kernel * width + b[axis];
                        }
                        kernel[flat_kernel] * x[flat]
                    })
                    .sum()
            })
            .collect()
    }

    fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
        assert_eq!(a.len(), b.len());
        // NaN if there is one.
        let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        differences.max_by(f64::total_cmp).unwrap_or(0.0)
    }

    #[test]
    fn equals_the_defining_sum_on_any_shape() {
        for (shape, width) in [
            (vec![12, 12], 5),
            (vec![7, 10], 3),
            (vec![9, 15], 7),
            (vec![6, 5, 8], 3),
            (vec![5, 7, 9], 5),
            (vec![33, 32], 17),
        ] {
            let n: usize = shape.iter().product();
            let x = noise(n, 1);
            let kernel = noise(usize::pow(width, shape.len() as u32), 2);
            for (adjoint, sign) in [(false, 1), (true, -1)] {
                let fast = convolve(&x, &shape, &kernel, width, adjoint);
                let slow = direct(&x, &shape, &kernel, width, sign);
                let error = largest_difference(&fast, &slow);
                assert!(
                    error < 1e-13 * kernel.len() as f64,
                    "{shape:?} {width}: {error:e}"
                );
            }
        }
    }

    #[test]
    fn large_grids_use_the_parallel_path_and_agree() {
        let shape = [190, 211];
        let x = noise(190 * 211, 3);
        let kernel = noise(9, 4);
        let fast = convolve(&x, &shape, &kernel, 3, false);
        assert!(largest_difference(&fast, &direct(&x, &shape, &kernel, 3, 1)) < 1e-13);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1);
        let one = one.build().unwrap();
        let serial = one.install(|| convolve(&x, &shape, &kernel, 3, false));
        assert_eq!(fast, serial, "the number of threads must not change a bit");
    }

    #[test]
    fn correlation_is_the_adjoint_in_the_kernel() {
        for shape in [vec![10, 13], vec![6, 7, 5]] {
            let n: usize = shape.iter().product();
            let width = 3;
            let (x, g) = (noise(2 * n, 5), noise(2 * n, 6));
            let kernel = noise(usize::pow(width, shape.len() as u32), 7);
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let left = dot(&convolve(&x, &shape, &kernel, width, false), &g);
            let right = dot(&correlate(&x, &g, &shape, width), &kernel);
            assert!(
                (left - right).abs() < 1e-12 * left.abs().max(1.0),
                "{left} {right}"
            );
        }
    }

    #[test]
    fn single_precision_agrees_to_its_accuracy() {
        let shape = [24, 20];
        let x = noise(480, 8);
        let kernel = noise(25, 9);
        let single = |v: &[f64]| v.iter().map(|&v| v as f32).collect::<Vec<_>>();
        let fast = convolve(&single(&x), &shape, &single(&kernel), 5, true);
        let fast: Vec<f64> = fast.into_iter().map(f64::from).collect();
        assert!(largest_difference(&fast, &direct(&x, &shape, &kernel, 5, -1)) < 1e-5);
    }
}

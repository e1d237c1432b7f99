//! Real discrete Fourier transforms of periodic grids of any shape and size.
//!
//! A circular convolution is `inverse(symbol * forward(x))`. [`Transform::filter`] does all of it in three
//! passes over memory: the first axis is transformed, multiplied by the symbol and transformed back while a
//! block of its columns lies in cache. Every pass runs on all cores when the grid is large enough.

use std::any::TypeId;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use fourier::{Planned, Plans};
use rayon::prelude::*;
use rustfft::num_complex::Complex;
use rustfft::num_traits::Float;

use crate::lanes::Lanes;

/// Columns of the first axis that are transformed together: two cache lines of complex doubles.
const BLOCK: usize = 8;
/// Below this number of grid points one thread is faster than two.
const PARALLEL_FROM: usize = 1 << 15;

/// Floating-point type of a grid: `f64` or `f32`.
pub trait Real: Planned + Float + Lanes + bytemuck::Pod + Default {
    /// Conversion from a double, rounding if needed.
    fn of(value: f64) -> Self;
    /// The value as a double, exactly.
    fn double(self) -> f64;
    /// The value towards zero, as an index: 0 for NaN and below.
    fn truncated(self) -> usize;
    /// The process-wide plans and kernel symbols of this type.
    fn shared() -> &'static Shared<Self>;
}

/// Plans by grid shape, the symbols of the kernels used last, and memory that is used again.
pub struct Shared<T: Real> {
    plans: Mutex<BTreeMap<Vec<usize>, Arc<Transform<T>>>>,
    pub(crate) symbols: Mutex<Vec<CachedSymbol<T>>>,
    /// A vector for intermediate results, while nobody uses it.
    pub(crate) scratch: Mutex<Vec<T>>,
}

/// The spectrum of a kernel on a grid, normalized, with the data it was made from.
pub(crate) struct CachedSymbol<T: Real> {
    pub shape: Vec<usize>,
    pub width: usize,
    pub kernel: Vec<T>,
    pub symbol: Arc<Vec<Complex<T>>>,
}

macro_rules! real {
    ($type:ty) => {
        impl Real for $type {
            #[inline(always)]
            fn of(value: f64) -> Self {
                value as $type
            }
            #[inline(always)]
            fn double(self) -> f64 {
                self.into()
            }
            #[inline(always)]
            fn truncated(self) -> usize {
                // A 32-bit conversion is one instruction, a 64-bit unsigned one is not.
                (self as i32).max(0) as usize
            }
            fn shared() -> &'static Shared<Self> {
                static SHARED: Shared<$type> = Shared {
                    plans: Mutex::new(BTreeMap::new()),
                    symbols: Mutex::new(Vec::new()),
                    scratch: Mutex::new(Vec::new()),
                };
                &SHARED
            }
        }
    };
}
real!(f32);
real!(f64);

impl<T: Real> Shared<T> {
    /// Forgets all that is kept here; what is in use stays with its users, and the rest is made again when it is needed.
    pub(crate) fn clear(&self) {
        lock(&self.plans).clear();
        lock(&self.symbols).clear();
        *lock(&self.scratch) = Vec::new();
    }
}

/// A plan for the real transform of grids of one shape.
///
/// Spectra are stored column by column of the first axis: entry `(c, k0)` at `c * n0 + k0`, where `c` runs over
/// the (row-major) half spectrum of the remaining axes. Nothing is normalized: `inverse(forward(x)) = N x`, with
/// `N` the number of grid points.
pub struct Transform<T: Real> {
    shape: Vec<usize>,
    /// Complex numbers per slab (one index of the first axis) after the transform of the remaining axes.
    columns: usize,
    half: usize,
    plans: Plans<T>,
    pool: Mutex<Vec<Vec<Complex<T>>>>,
}

/// Buffers of one worker.
struct Work<T: Real> {
    row: Vec<T>,
    slab: Vec<Complex<T>>,
    columns: Vec<Complex<T>>,
    scratch: Vec<Complex<T>>,
}

impl<T: Real> Transform<T> {
    /// The shared plan for `shape` (at least two axes, none empty), made at the first request.
    pub fn of_shape(shape: &[usize]) -> Arc<Self> {
        let mut plans = lock(&T::shared().plans);
        if let Some(plan) = plans.get(shape) {
            return plan.clone();
        }
        let plan = Arc::new(Self::new(shape));
        plans.insert(shape.to_vec(), plan.clone());
        plan
    }

    fn new(shape: &[usize]) -> Self {
        assert!(
            shape.len() >= 2 && shape.iter().all(|&n| n > 0),
            "periodic transforms need at least two non-empty axes, got {shape:?}"
        );
        let last = shape[shape.len() - 1];
        let half = last / 2 + 1;
        let columns = shape[1..shape.len() - 1].iter().product::<usize>() * half;
        Self {
            shape: shape.to_vec(),
            columns,
            half,
            plans: T::plans(shape),
            pool: Mutex::new(Vec::new()),
        }
    }

    /// Number of grid points.
    #[allow(clippy::len_without_is_empty, reason = "a grid is never empty")]
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Number of complex numbers in a spectrum.
    pub fn spectrum_len(&self) -> usize {
        self.columns * self.shape[0]
    }

    /// The half spectrum of `x`, not normalized.
    pub fn forward(&self, x: &[T]) -> Vec<Complex<T>> {
        let rows = self.slabs_forward(x);
        let n0 = self.shape[0];
        let mut spectrum = vec![Complex::default(); self.spectrum_len()];
        self.over_blocks(&mut spectrum, &|work, first, chunk| {
            gather(&rows, self.columns, first, n0, chunk);
            self.plans.complex[0][0].process_with_scratch(chunk, &mut work.scratch);
        });
        self.give_back(rows);
        spectrum
    }

    /// The real grid with this half spectrum, not normalized.
    pub fn inverse(&self, spectrum: &[Complex<T>]) -> Vec<T> {
        let mut blocks = self.take();
        self.over_blocks(&mut blocks, &|work, first, chunk| {
            let n0 = self.shape[0];
            let columns = &mut work.columns[..chunk.len()];
            columns.copy_from_slice(&spectrum[first * n0..][..chunk.len()]);
            self.plans.complex[0][1].process_with_scratch(columns, &mut work.scratch);
            scatter(columns, n0, chunk);
        });
        let result = self.slabs_inverse(&blocks);
        self.give_back(blocks);
        result
    }

    /// `inverse(symbol * forward(x))`, the symbol conjugated if asked: a circulant matrix or its transpose.
    pub fn filter(&self, x: &[T], symbol: &[Complex<T>], conjugate: bool) -> Vec<T> {
        if conjugate {
            self.filter_with(x, symbol, |value, factor| value * factor.conj())
        } else {
            self.filter_with(x, symbol, |value, factor| value * factor)
        }
    }

    /// `inverse(symbol * forward(x))` with a real symbol: a symmetric circulant matrix.
    pub fn filter_real(&self, x: &[T], symbol: &[T]) -> Vec<T> {
        self.filter_with(x, symbol, |value, factor| value.scale(factor))
    }

    fn filter_with<F: Copy + Sync>(
        &self,
        x: &[T],
        symbol: &[F],
        multiply: impl Fn(Complex<T>, F) -> Complex<T> + Sync,
    ) -> Vec<T> {
        let n0 = self.shape[0];
        let rows = self.slabs_forward(x);
        let mut blocks = self.take();
        self.over_blocks(&mut blocks, &|work, first, chunk| {
            let columns = &mut work.columns[..chunk.len()];
            gather(&rows, self.columns, first, n0, columns);
            self.plans.complex[0][0].process_with_scratch(columns, &mut work.scratch);
            for (value, factor) in columns.iter_mut().zip(&symbol[first * n0..]) {
                *value = multiply(*value, *factor);
            }
            self.plans.complex[0][1].process_with_scratch(columns, &mut work.scratch);
            scatter(columns, n0, chunk);
        });
        self.give_back(rows);
        let result = self.slabs_inverse(&blocks);
        self.give_back(blocks);
        result
    }

    /// Transforms all axes but the first; the result is row-major `[n0, columns]`.
    fn slabs_forward(&self, x: &[T]) -> Vec<Complex<T>> {
        assert_eq!(x.len(), self.len(), "grid of shape {:?}", self.shape);
        let points = self.len() / self.shape[0];
        let last = self.shape[self.shape.len() - 1];
        let real = &self.plans.real;
        let mut rows = self.take();
        self.over_chunks(&mut rows, self.columns, &|work, index, slab| {
            let lines = x[index * points..][..points].chunks_exact(last);
            for (line, out) in lines.zip(slab.chunks_exact_mut(self.half)) {
                work.row.copy_from_slice(line);
                let scratch = &mut work.scratch[..real.get_scratch_len()];
                real.process_with_scratch(&mut work.row, out, scratch)
                    .expect("row and spectrum have the plan's lengths");
            }
            self.inner_axes(slab, work, 0);
        });
        rows
    }

    /// Complex transforms (`direction` 0 forward, 1 inverse) of the axes between the first and the last.
    fn inner_axes(&self, slab: &mut [Complex<T>], work: &mut Work<T>, direction: usize) {
        let mut trailing = self.half;
        for axis in (1..self.shape.len() - 1).rev() {
            let n = self.shape[axis];
            let fft = &self.plans.complex[axis][direction];
            for matrix in slab.chunks_exact_mut(n * trailing) {
                for first in (0..trailing).step_by(BLOCK) {
                    let width = BLOCK.min(trailing - first);
                    let columns = &mut work.columns[..width * n];
                    gather(matrix, trailing, first, n, columns);
                    fft.process_with_scratch(columns, &mut work.scratch);
                    for (column, values) in columns.chunks_exact(n).enumerate() {
                        for (row, value) in values.iter().enumerate() {
                            matrix[row * trailing + first + column] = *value;
                        }
                    }
                }
            }
            trailing *= n;
        }
    }

    /// Inverse of [`Self::slabs_forward`], from columns stored block by block (see [`scatter`]).
    fn slabs_inverse(&self, blocks: &[Complex<T>]) -> Vec<T> {
        let n0 = self.shape[0];
        let points = self.len() / n0;
        let last = self.shape[self.shape.len() - 1];
        let real = &self.plans.real_inverse;
        let mut result = vec![T::zero(); self.len()];
        self.over_chunks(&mut result, points, &|work, index, out| {
            let mut slab = std::mem::take(&mut work.slab);
            for (block, part) in slab.chunks_mut(BLOCK).enumerate() {
                let start = block * BLOCK * n0 + index * part.len();
                part.copy_from_slice(&blocks[start..start + part.len()]);
            }
            self.inner_axes(&mut slab, work, 1);
            let lines = slab.chunks_exact_mut(self.half);
            for (line, out) in lines.zip(out.chunks_exact_mut(last)) {
                line[0].im = T::zero();
                if last.is_multiple_of(2) {
                    line[self.half - 1].im = T::zero();
                }
                let scratch = &mut work.scratch[..real.get_scratch_len()];
                real.process_with_scratch(line, out, scratch)
                    .expect("row and spectrum have the plan's lengths");
            }
            work.slab = slab;
        });
        result
    }

    /// Runs `f(work, first column, columns)` on every block of columns of the first axis.
    fn over_blocks(
        &self,
        data: &mut [Complex<T>],
        f: &(dyn Fn(&mut Work<T>, usize, &mut [Complex<T>]) + Sync),
    ) {
        self.over_chunks(data, BLOCK * self.shape[0], &|work, block, chunk| {
            f(work, block * BLOCK, chunk);
        });
    }

    fn over_chunks<E: Send>(
        &self,
        data: &mut [E],
        chunk: usize,
        f: &(dyn Fn(&mut Work<T>, usize, &mut [E]) + Sync),
    ) {
        if self.len() >= PARALLEL_FROM && rayon::current_num_threads() > 1 {
            let tasks = data.len().div_ceil(chunk);
            let per_task = tasks.div_ceil(4 * rayon::current_num_threads());
            data.par_chunks_mut(chunk * per_task)
                .enumerate()
                .for_each_init(
                    || self.work(),
                    |work, (task, data)| {
                        for (i, part) in data.chunks_mut(chunk).enumerate() {
                            f(work, task * per_task + i, part);
                        }
                    },
                );
        } else {
            let mut work = self.work();
            for (i, part) in data.chunks_mut(chunk).enumerate() {
                f(&mut work, i, part);
            }
        }
    }

    fn work(&self) -> Work<T> {
        let (last, others) = self.shape.split_last().expect("a grid has axes");
        let Plans {
            real,
            real_inverse,
            complex,
        } = &self.plans;
        let inplace = complex.iter().flatten();
        let scratch = inplace
            .map(|fft| fft.get_inplace_scratch_len())
            .chain([real.get_scratch_len(), real_inverse.get_scratch_len()]);
        let longest = others.iter().copied();
        Work {
            row: vec![T::zero(); *last],
            slab: vec![Complex::default(); self.columns],
            columns: vec![Complex::default(); BLOCK * longest.fold(0, usize::max)],
            scratch: vec![Complex::default(); scratch.fold(0, usize::max)],
        }
    }

    fn take(&self) -> Vec<Complex<T>> {
        lock(&self.pool)
            .pop()
            .unwrap_or_else(|| vec![Complex::default(); self.spectrum_len()])
    }

    fn give_back(&self, buffer: Vec<Complex<T>>) {
        let mut pool = lock(&self.pool);
        // Two buffers per concurrent convolution; more would only pin memory.
        if pool.len() < 2 * rayon::current_num_threads() {
            pool.push(buffer);
        }
    }
}

/// Columns `first..` of the row-major matrix `[n, stride]`, one after the other.
fn gather<T: Real>(
    matrix: &[Complex<T>],
    stride: usize,
    first: usize,
    n: usize,
    columns: &mut [Complex<T>],
) {
    let width = columns.len() / n;
    for row in 0..n {
        let line = &matrix[row * stride + first..][..width];
        for (column, value) in line.iter().enumerate() {
            columns[column * n + row] = *value;
        }
    }
}

/// Stores a block of columns row by row, so that a row's part of it is contiguous.
fn scatter<T: Real>(columns: &[Complex<T>], n: usize, block: &mut [Complex<T>]) {
    let width = columns.len() / n;
    for (row, line) in block.chunks_exact_mut(width).enumerate() {
        for (column, value) in line.iter_mut().enumerate() {
            *value = columns[column * n + row];
        }
    }
}

/// Locks a mutex whose data is valid at every point where a panic could poison it.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// The floating-point type as a run-time value.
pub(crate) fn is_f64<T: 'static>() -> bool {
    TypeId::of::<T>() == TypeId::of::<f64>()
}

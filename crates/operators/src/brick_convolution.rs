//! Separable convolution on active bricks, on the host: one pass along each axis.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions that were detected"
)]

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::fft::{Real, lock};
use crate::fresh::filled;
use crate::lanes::{dispatch, has_more_registers};
use crate::ops::Passes;

/// Bricks per task: new ones are zeroed before they are computed, and stay in the fastest cache.
const GROUP: usize = 4;
/// Cells along the axis of a pass that are computed from the same window of values.
const ROWS: usize = 4;
/// The side of a brick is a multiple of the numbers in a register.
const MOST_LANES: usize = 8;

/// What constant values outside of active bricks, `phase_values` in the negative and in the positive phase, add to the convolution of a field with
/// `taps` along each axis: [`crate::brick_convolution`] itself takes them as zero. The bricks are cubes of `side^D` cells; `neighbours` is
/// their table.
pub fn convolution_of_outside<const D: usize>(
    side: usize,
    neighbours: &[f64],
    taps: &[f64],
    phase_values: [f64; 2],
) -> Vec<f64> {
    of_outside::<D>(side, neighbours, taps, None, phase_values)
}

/// What these constants add to a [`crate::brick_pass`] along an axis.
pub fn pass_of_outside<const D: usize>(
    side: usize,
    neighbours: &[f64],
    taps: &[f64],
    axis: usize,
    phase_values: [f64; 2],
) -> Vec<f64> {
    of_outside::<D>(side, neighbours, taps, Some(axis), phase_values)
}

fn of_outside<const D: usize>(
    side: usize,
    neighbours: &[f64],
    taps: &[f64],
    axis: Option<usize>,
    phase_values: [f64; 2],
) -> Vec<f64> {
    let bricks = neighbours.len() / (2 * D);
    let zeros = vec![0.0; bricks * side.pow(D as u32)];
    let passes = Passes {
        axis,
        adjoint: false,
    };
    convolve(&zeros, (side, D), neighbours, taps, passes, phase_values)
}

/// `sum_b t_b .. t_c x_{a+(b,..,c)}` by passes along the last axis, the one before it, and so on, or by one pass; where no brick is active they see
/// `phase_values`, constants in the negative and in the positive phase. The adjoint takes the passes in the opposite order with mirrored taps,
/// which is the transpose although passes that are cut at the edge of the bricks do not commute.
///
/// `bricks` are cubes of `side^axes` cells, `neighbours` is the table of `geometry::Bricks::neighbours`, and the taps are no more
/// than `2 side + 1`.
pub(crate) fn convolve<T: Real>(
    x: &[T],
    (side, axes): (usize, usize),
    neighbours: &[T],
    taps: &[T],
    passes: Passes,
    phase_values: [f64; 2],
) -> Vec<T> {
    let reach = taps.len() / 2;
    debug_assert!(taps.len() % 2 == 1 && reach <= side && side.is_multiple_of(MOST_LANES));
    let mut weights = vec![T::zero(); ROWS - 1];
    weights.extend_from_slice(taps);
    if passes.adjoint {
        weights[ROWS - 1..].reverse();
    }
    weights.resize(weights.len() + ROWS - 1, T::zero());
    let volume = side.pow(axes as u32);
    let mut phase_values = phase_values.map(T::of);
    let sum = taps.iter().fold(T::zero(), |sum, tap| sum + *tap);
    // Passes write by turns to a vector that is kept and to the one that is returned, to which the last one does.
    let mut kept = std::mem::take(&mut *lock(&T::shared().scratch));
    kept.resize(x.len(), T::zero());
    let mut result = Vec::new();
    let order = passes.order(axes);
    for (pass, &axis) in order.iter().enumerate() {
        let constants = phase_values.map(|rest| vec![rest; volume]);
        let to_kept = (order.len() - pass).is_multiple_of(2);
        let (from, to) = if to_kept {
            (&result, &mut kept)
        } else {
            (&kept, &mut result)
        };
        let pass = Pass {
            x: if pass == 0 { x } else { from },
            neighbours,
            constants: &constants,
            weights: &weights,
            reach,
            side,
            columns: (2 * axes, 2 * axis),
            stride: side.pow((axes - 1 - axis) as u32),
            volume,
        };
        if to.is_empty() {
            *to = pass.made(x.len());
        } else {
            pass.run(to);
        }
        // A constant outside is smoothed like the values inside.
        phase_values = phase_values.map(|rest| rest * sum);
    }
    *lock(&T::shared().scratch) = kept;
    result
}

/// A pass along one axis.
struct Pass<'a, T> {
    x: &'a [T],
    neighbours: &'a [T],
    /// Bricks of ghosts, of the negative and of the positive phase.
    constants: &'a [Vec<T>; 2],
    /// The taps between zeros, so that a few cells along the axis can be computed from the same window.
    weights: &'a [T],
    reach: usize,
    side: usize,
    /// How many there are in the table of neighbours, and that of the brick before along this axis.
    columns: (usize, usize),
    /// Distance in memory of cells along the axis.
    stride: usize,
    volume: usize,
}

impl<T: Real> Pass<'_, T> {
    fn run(&self, result: &mut [T]) {
        let arch = Arch::new();
        let groups = result.par_chunks_mut(GROUP * self.volume).enumerate();
        groups.for_each(|(group, result)| self.group(arch, group, result));
    }

    /// The result in a new vector.
    fn made(&self, len: usize) -> Vec<T> {
        let arch = Arch::new();
        filled(len, GROUP * self.volume, |group, result| {
            self.group(arch, group, result);
        })
    }

    fn group(&self, arch: Arch, group: usize, result: &mut [T]) {
        let group = Group {
            pass: self,
            first: group * GROUP,
            result,
            more_registers: has_more_registers(arch),
        };
        dispatch(arch, group);
    }

    /// The brick itself, the one before and the one after.
    #[inline(always)]
    fn bricks(&self, brick: usize) -> [&[T]; 3] {
        let (count, column) = self.columns;
        let neighbour = |offset: usize| {
            let number = self.neighbours[brick * count + column + offset];
            if number >= T::zero() {
                &self.x[number.truncated() * self.volume..][..self.volume]
            } else {
                &self.constants[usize::from(number > T::of(-1.5))][..]
            }
        };
        let own = &self.x[brick * self.volume..][..self.volume];
        [neighbour(0), own, neighbour(1)]
    }

    /// Along an axis that is not the last: `COLUMNS` registers of lines at once. `SIDE` is the side of a brick, or 0 if it is not known when this is
    /// compiled.
    #[inline(always)]
    fn across<S: Simd, const SIDE: usize, const COLUMNS: usize>(
        &self,
        simd: S,
        bricks: [&[T]; 3],
        result: &mut [T],
    ) {
        let (side, reach) = (self.side::<SIDE>(), self.reach);
        let [before, own, after] = bricks.map(T::registers::<S>);
        let lanes = size_of::<T::Register<S>>() / size_of::<T>();
        let result = T::registers_mut::<S>(result);
        let stride = self.stride / lanes;
        for column in (0..result.len() / side).step_by(COLUMNS) {
            let starts: [usize; COLUMNS] = std::array::from_fn(|c| {
                let column = column + c;
                column / stride * stride * side + column % stride
            });
            let last = (side - 1) * stride;
            for first in (0..side).step_by(ROWS) {
                // The cells from `first - reach` to `first + ROWS - 1 + reach`, brick by brick.
                let end = first + ROWS + reach;
                let parts = [
                    (before, (side + first).saturating_sub(reach).min(side)..side),
                    (own, first.saturating_sub(reach)..end.min(side)),
                    (after, 0..end.saturating_sub(side)),
                ];
                let mut sums = [[T::splat(simd, T::zero()); COLUMNS]; ROWS];
                let mut windows = self.weights.windows(ROWS);
                for (brick, cells) in parts {
                    let lines = starts.map(|start| &brick[start..][..=last]);
                    for (at, window) in cells.zip(&mut windows) {
                        let values = lines.map(|line| line[at * stride]);
                        for (sums, weight) in sums.iter_mut().zip(window.iter().rev()) {
                            let weight = T::splat(simd, *weight);
                            for (sum, value) in sums.iter_mut().zip(values) {
                                *sum = T::multiply_add(simd, weight, value, *sum);
                            }
                        }
                    }
                }
                for (c, start) in starts.into_iter().enumerate() {
                    let line = &mut result[start + first * stride..][..=(ROWS - 1) * stride];
                    for (q, sums) in sums.iter().enumerate() {
                        line[q * stride] = sums[c];
                    }
                }
            }
        }
    }

    /// Along the last axis, in `LINES` lines at once: each value by its taps for the cells of a register.
    #[inline(always)]
    fn along<S: Simd, const SIDE: usize, const LINES: usize>(
        &self,
        simd: S,
        bricks: [&[T]; 3],
        spread: &[T::Register<S>],
        result: &mut [T],
    ) {
        let (side, reach) = (self.side::<SIDE>(), self.reach);
        let lanes = Self::lanes::<S>();
        let result = T::registers_mut::<S>(result);
        let blocks = result.chunks_exact_mut(LINES * side / lanes).enumerate();
        for (block, result) in blocks {
            let lines = bricks.map(|brick| &brick[block * LINES * side..][..LINES * side]);
            for register in 0..side / lanes {
                let mut sums = [T::splat(simd, T::zero()); LINES];
                let mut taps = spread.iter();
                let first = side + register * lanes - reach;
                for (part, lines) in lines.into_iter().enumerate() {
                    let from = first.saturating_sub(part * side).min(side);
                    let to = (first + spread.len()).saturating_sub(part * side).min(side);
                    for (at, taps) in (from..to).zip(&mut taps) {
                        for (line, sum) in lines.chunks_exact(side).zip(&mut sums) {
                            let value = T::splat(simd, line[at]);
                            *sum = T::multiply_add(simd, *taps, value, *sum);
                        }
                    }
                }
                for (line, sum) in result.chunks_exact_mut(side / lanes).zip(sums) {
                    line[register] = sum;
                }
            }
        }
    }

    /// How many numbers there are in a register.
    #[inline(always)]
    fn lanes<S: Simd>() -> usize {
        size_of::<T::Register<S>>() / size_of::<T>()
    }

    /// For every value that the cells of a register see: by which tap each of them does.
    #[inline(always)]
    fn spread<S: Simd>(&self) -> Vec<T::Register<S>> {
        let lanes = Self::lanes::<S>();
        let taps = &self.weights[ROWS - 1..][..=2 * self.reach];
        let mut spread = vec![T::zero(); (taps.len() + lanes - 1) * lanes];
        for (value, taps_of) in spread.chunks_exact_mut(lanes).enumerate() {
            for (cell, tap_of) in taps_of.iter_mut().enumerate() {
                let tap = value.checked_sub(cell).and_then(|tap| taps.get(tap));
                *tap_of = tap.copied().unwrap_or_default();
            }
        }
        T::registers::<S>(&spread).to_vec()
    }

    /// The side of a brick.
    #[inline(always)]
    fn side<const SIDE: usize>(&self) -> usize {
        if SIDE > 0 { SIDE } else { self.side }
    }
}

/// A few bricks of a pass: what one thread computes with the best instructions that the processor has.
struct Group<'a, T> {
    pass: &'a Pass<'a, T>,
    first: usize,
    result: &'a mut [T],
    /// Whether there are more than 16 registers.
    more_registers: bool,
}

impl<T: Real> Group<'_, T> {
    #[inline(always)]
    fn run<S: Simd, const SIDE: usize>(self, simd: S) {
        let pass = self.pass;
        // Closures around vector instructions would be compiled without them.
        let spread = match pass.stride {
            1 => pass.spread::<S>(),
            _ => Vec::new(),
        };
        for (i, result) in self.result.chunks_exact_mut(pass.volume).enumerate() {
            let bricks = pass.bricks(self.first + i);
            if pass.stride == 1 {
                let lines = pass.volume / pass.side;
                if self.more_registers && lines.is_multiple_of(16) {
                    pass.along::<S, SIDE, 16>(simd, bricks, &spread, result);
                } else {
                    pass.along::<S, SIDE, 8>(simd, bricks, &spread, result);
                }
                continue;
            }
            let columns = T::registers::<S>(bricks[0]).len() / pass.side;
            if self.more_registers && columns.is_multiple_of(4) {
                pass.across::<S, SIDE, 4>(simd, bricks, result);
            } else if columns.is_multiple_of(2) {
                pass.across::<S, SIDE, 2>(simd, bricks, result);
            } else {
                pass.across::<S, SIDE, 1>(simd, bricks, result);
            }
        }
    }
}

impl<T: Real> WithSimd for Group<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // The usual sides are compiled for themselves.
        match self.pass.side {
            8 => self.run::<S, 8>(simd),
            16 => self.run::<S, 16>(simd),
            _ => self.run::<S, 0>(simd),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convolution::convolve as circular;
    use crate::noise;
    use geometry::Bricks;

    fn dot(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    fn assert_near(a: &[f64], b: &[f64], tolerance: f64) {
        assert_eq!(a.len(), b.len());
        // NaN if there is one.
        let errors = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        let error = errors.max_by(f64::total_cmp).unwrap_or(0.0);
        assert!(error < tolerance, "{error:e}");
    }

    /// Bricks with holes, at the periodic boundary too.
    fn some<const D: usize>(cells: usize, side: usize) -> Bricks<D> {
        let active = |place: [usize; D]| (place.iter().sum::<usize>() * 7) % 5 < 3;
        Bricks::new(cells, side, active, |place| place[0] % 2 == 0).unwrap()
    }

    const ALL: Passes = Passes {
        axis: None,
        adjoint: false,
    };

    fn on<const D: usize>(bricks: &Bricks<D>, x: &[f64], taps: &[f64], passes: Passes) -> Vec<f64> {
        let shape = (bricks.side(), D);
        convolve(x, shape, &bricks.neighbours(), taps, passes, [0.0; 2])
    }

    /// All passes, and each of them alone.
    fn choices<const D: usize>() -> impl Iterator<Item = Passes> {
        let alone = (0..D).map(|axis| Passes {
            axis: Some(axis),
            ..ALL
        });
        std::iter::once(ALL).chain(alone)
    }

    /// The definition on the whole grid: after every pass what is not active is `phase_values`, times what a pass makes of constants.
    fn by_passes<const D: usize>(
        bricks: &Bricks<D>,
        x: &[f64],
        taps: &[f64],
        passes: Passes,
        mut phase_values: [f64; 2],
    ) -> Vec<f64> {
        let (cells, reach) = (bricks.cells(), taps.len() / 2);
        let mut dense = bricks.scatter(x, phase_values);
        for axis in passes.order(D) {
            let stride = cells.pow((D - 1 - axis) as u32);
            let passed: Vec<f64> = (0..dense.len())
                .map(|i| {
                    let at = i / stride % cells;
                    let taps = taps.iter().enumerate();
                    taps.map(|(k, tap)| {
                        let from = (at + cells + k - reach) % cells;
                        tap * dense[i + from * stride - at * stride]
                    })
                    .sum()
                })
                .collect();
            phase_values = phase_values.map(|rest| rest * taps.iter().sum::<f64>());
            dense = bricks.scatter(&bricks.gather(&passed), phase_values);
        }
        bricks.gather(&dense)
    }

    fn equals_the_definition<const D: usize>(cells: usize, side: usize, reach: usize) {
        let bricks = some::<D>(cells, side);
        let x = noise(bricks.len(), 1);
        let taps = noise(2 * reach + 1, 2);
        let phase_values = [-0.9, 1.1];
        for passes in choices::<D>() {
            let (table, axis) = (bricks.neighbours(), passes.axis);
            let outside = of_outside::<D>(side, &table, &taps, axis, phase_values);
            let linear = on(&bricks, &x, &taps, passes);
            let both: Vec<f64> = linear.iter().zip(&outside).map(|(a, b)| a + b).collect();
            let exact = |phase_values| by_passes(&bricks, &x, &taps, passes, phase_values);
            assert_near(&linear, &exact([0.0; 2]), 1e-13);
            assert_near(&both, &exact(phase_values), 1e-13);
        }
    }

    #[test]
    fn equals_passes_over_the_whole_grid() {
        equals_the_definition::<2>(64, 16, 5);
        equals_the_definition::<2>(48, 16, 16);
        equals_the_definition::<2>(64, 32, 29);
        equals_the_definition::<3>(32, 8, 8);
        equals_the_definition::<3>(24, 8, 3);
    }

    #[test]
    fn the_adjoint_is_the_transpose_to_rounding() {
        fn check<const D: usize>(cells: usize, side: usize, reach: usize) {
            let bricks = some::<D>(cells, side);
            let (x, y) = (noise(bricks.len(), 3), noise(bricks.len(), 4));
            let taps = noise(2 * reach + 1, 5);
            for passes in choices::<D>() {
                let image = on(&bricks, &x, &taps, passes);
                let left = dot(&image, &y);
                let right = dot(&x, &on(&bricks, &y, &taps, passes.transposed()));
                let scale = (dot(&image, &image) * dot(&y, &y)).sqrt();
                assert!((left - right).abs() < 1e-14 * scale, "{left} {right}");
            }
        }
        check::<2>(64, 16, 8);
        check::<3>(32, 8, 8);
    }

    #[test]
    fn inside_a_wide_enough_set_it_is_the_circular_convolution() {
        let (cells, reach) = (48, 7);
        let taps = noise(2 * reach + 1, 6);
        let width = taps.len();
        let kernel: Vec<f64> = (0..width * width)
            .map(|k| taps[k / width] * taps[k % width])
            .collect();
        let all = Bricks::<2>::new(cells, 16, |_| true, |_| true).unwrap();
        let dense = noise(cells * cells, 7);
        for adjoint in [false, true] {
            let expected = circular(&dense, &[cells; 2], &kernel, width, adjoint);
            let passes = Passes { adjoint, ..ALL };
            let found = on(&all, &all.gather(&dense), &taps, passes);
            assert_near(&all.scatter(&found, [0.0; 2]), &expected, 1e-13);
        }
    }

    #[test]
    fn single_precision_and_one_thread_agree() {
        let bricks = some::<3>(32, 8);
        let (x, taps) = (noise(bricks.len(), 8), noise(17, 9));
        let passes = ALL.transposed();
        let double = on(&bricks, &x, &taps, passes);
        let single = |x: &[f64]| -> Vec<f32> { x.iter().map(|&x| x as f32).collect() };
        let table = bricks.neighbours();
        let run = || {
            let (x, table, taps) = (single(&x), single(&table), single(&taps));
            convolve(&x, (8, 3), &table, &taps, passes, [0.0; 2])
        };
        let found: Vec<f64> = run().into_iter().map(f64::from).collect();
        assert_near(&found, &double, 1e-5);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1);
        let one = one.build().unwrap();
        assert_eq!(run(), one.install(run));
        assert_eq!(double, one.install(|| on(&bricks, &x, &taps, passes)));
    }
}

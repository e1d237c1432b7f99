//! Integrals of multilinear (Q1) finite elements on a periodic grid.
//!
//! Everything is divided by `h^D`, so that the mass matrix maps the constant 1 to itself. Products of up to four basis
//! functions have degree 4 along each axis; three Gauss points integrate them exactly.

use rayon::prelude::*;

/// Nodes of the three-point Gauss rule on `[0, 1]`: `1/2 -+ sqrt(3/5)/2`, `1/2`.
const GAUSS_NODES: [f64; 3] = [0.112_701_665_379_258_3, 0.5, 0.887_298_334_620_741_7];
const GAUSS_WEIGHTS: [f64; 3] = [5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0];
/// Below this number of nodes one thread is faster than two.
const PARALLEL_FROM: usize = 1 << 14;

/// Gauss points of the cell `[0, 1]^axes`: their weights, and the values of the basis functions of its corners there. Bit `a` of a
/// corner says which side of axis `a` it is on.
pub(crate) fn gauss_points(axes: usize) -> Vec<(f64, Vec<f64>)> {
    (0..3_usize.pow(axes as u32))
        .map(|mut q| {
            let mut weight = 1.0;
            let mut values = vec![1.0; 1 << axes];
            for axis in 0..axes {
                let s = GAUSS_NODES[q % 3];
                weight *= GAUSS_WEIGHTS[q % 3];
                for (corner, value) in values.iter_mut().enumerate() {
                    *value *= if corner >> axis & 1 == 1 { s } else { 1.0 - s };
                }
                q /= 3;
            }
            (weight, values)
        })
        .collect()
}

/// Runs `f(first slab, slabs)` on chunks of slabs of the first axis; `per_slab` values belong to each.
fn over_slabs<T: Send>(
    data: &mut [T],
    per_slab: usize,
    parallel: bool,
    f: &(dyn Fn(usize, &mut [T]) + Sync),
) {
    if parallel && rayon::current_num_threads() > 1 {
        let slabs = data.len() / per_slab;
        let chunk = slabs.div_ceil(4 * rayon::current_num_threads());
        data.par_chunks_mut(chunk * per_slab)
            .enumerate()
            .for_each(|(task, data)| f(task * chunk, data));
    } else {
        f(0, data);
    }
}

/// `sum_c weights_c x[line_c]` with the first entry repeated at the end.
fn interpolate(lines: &[&[f64]], weights: &[f64], out: &mut [f64]) {
    let n = lines[0].len();
    for (value, x) in out[..n].iter_mut().zip(lines[0]) {
        *value = weights[0] * x;
    }
    for (line, &weight) in lines.iter().zip(weights).skip(1) {
        for (value, x) in out[..n].iter_mut().zip(*line) {
            *value += weight * x;
        }
    }
    out[n] = out[0];
}

/// Buffers for one row of cells.
struct Work {
    lines: [Vec<f64>; 3],
    low: Vec<f64>,
    high: Vec<f64>,
    mixed: Vec<f64>,
}

impl Work {
    fn new(cells: usize) -> Self {
        let line = || vec![0.0; cells + 1];
        Self {
            lines: [line(), line(), line()],
            low: line(),
            high: line(),
            mixed: line(),
        }
    }

    /// Integrals of the product of the three interpolated lines with the left (`low`) and the right (`high`) basis
    /// function of every cell of the row.
    fn product_along_row(&mut self, cells: usize) {
        let [a, b, c] = &self.lines;
        let (a, b, c) = (&a[..=cells], &b[..=cells], &c[..=cells]);
        let (low, high) = (&mut self.low[..cells], &mut self.high[..cells]);
        for i in 0..cells {
            let (mut left, mut right) = (0.0, 0.0);
            for (s, w) in GAUSS_NODES.into_iter().zip(GAUSS_WEIGHTS) {
                let at = |x: &[f64]| x[i] + s * (x[i + 1] - x[i]);
                let value = w * at(a) * at(b) * at(c);
                left += (1.0 - s) * value;
                right += s * value;
            }
            low[i] = left;
            high[i] = right;
        }
    }

    /// Entries of the local mass matrix weighted with the square of the first interpolated line: left-left (`low`),
    /// left-right (`mixed`), right-right (`high`).
    fn mass_along_row(&mut self, cells: usize) {
        let a = &self.lines[0][..=cells];
        let (low, high) = (&mut self.low[..cells], &mut self.high[..cells]);
        let mixed = &mut self.mixed[..cells];
        for i in 0..cells {
            let (mut ll, mut lr, mut rr) = (0.0, 0.0, 0.0);
            for (s, w) in GAUSS_NODES.into_iter().zip(GAUSS_WEIGHTS) {
                let at = a[i] + s * (a[i + 1] - a[i]);
                let value = w * at * at;
                ll += (1.0 - s) * (1.0 - s) * value;
                lr += s * (1.0 - s) * value;
                rr += s * s * value;
            }
            low[i] = ll;
            mixed[i] = lr;
            high[i] = rr;
        }
    }
}

/// One of the lines along the last axis that bound the row of cells `row` in a slab `[s, s+1]` of the first axis, in which a row is
/// `[j, j+1] x .. x (all of the last axis)`: on which side of the slab it is, and its number inside.
fn bounding_line<const D: usize>(cells: usize, row: usize, corner: usize) -> (usize, usize) {
    let (mut rest, mut stride, mut inside) = (row, 1, 0);
    for axis in (1..D - 1).rev() {
        inside += (rest % cells + (corner >> axis & 1)) % cells * stride;
        stride *= cells;
        rest /= cells;
    }
    (corner & 1, inside)
}

/// A Gauss point of the first `D - 1` axes in a row of cells.
struct RowPoint<'a> {
    weight: f64,
    /// Interpolation weights of the lines that bound the row.
    at: &'a [f64],
    /// Where the nodes of these lines begin in a chunk of results, if they are in it.
    places: &'a [Option<usize>],
}

/// Calls `add(work, point, results)` at every Gauss point of every row of cells, with the lines there of some fields in `work`. Of the results
/// `per_node` belong to each node, slab by slab of the first axis.
fn over_rows<const D: usize>(
    cells: usize,
    results: &mut [f64],
    per_node: usize,
    fields: &[&[f64]],
    add: &(dyn Fn(&mut Work, RowPoint, &mut [f64]) + Sync),
) {
    let points = gauss_points(D - 1);
    let slab = cells.pow(D as u32 - 1);
    let parallel = fields[0].len() >= PARALLEL_FROM;
    over_slabs(results, per_node * slab, parallel, &|first, out| {
        let mut work = Work::new(cells);
        let count = out.len() / (per_node * slab);
        // A node gets contributions of the slabs of cells on both sides: the one below the first node is done here, too.
        for k in 0..=count {
            let below = (first + cells + k - 1) % cells;
            for row in 0..slab / cells {
                let corners = 0..1 << (D - 1);
                let lines: Vec<(usize, usize)> = corners
                    .map(|corner| bounding_line::<D>(cells, row, corner))
                    .collect();
                let place = |&(side, line): &(usize, usize)| {
                    let target = (k + side).checked_sub(1).filter(|target| *target < count);
                    target.map(|target| target * per_node * slab + line * cells)
                };
                let places: Vec<Option<usize>> = lines.iter().map(place).collect();
                let start = |(side, line)| (below + side) % cells * slab + line * cells;
                let starts: Vec<usize> = lines.into_iter().map(start).collect();
                let nodes: Vec<Vec<&[f64]>> = (fields.iter())
                    .map(|x| starts.iter().map(|i| &x[*i..][..cells]).collect())
                    .collect();
                for (weight, at) in &points {
                    for (nodes, line) in nodes.iter().zip(&mut work.lines) {
                        interpolate(nodes, at, line);
                    }
                    let (weight, places) = (*weight, &places[..]);
                    add(&mut work, RowPoint { weight, at, places }, out);
                }
            }
        }
    });
}

/// `int a b c phi_i` for every basis function, divided by `h^D`: symmetric and linear in each argument.
///
/// The arguments are nodal values, `cells^D` each, row-major.
pub fn product<const D: usize>(cells: usize, a: &[f64], b: &[f64], c: &[f64]) -> Vec<f64> {
    let mut result = vec![0.0; a.len()];
    over_rows::<D>(cells, &mut result, 1, &[a, b, c], &|work, point, out| {
        work.product_along_row(cells);
        for (place, at) in point.places.iter().zip(point.at) {
            let Some(place) = *place else { continue };
            let out = &mut out[place..][..cells];
            let factor = point.weight * at;
            out[0] += factor * (work.low[0] + work.high[cells - 1]);
            let ends = work.low[1..cells].iter().zip(&work.high[..cells - 1]);
            for (value, (low, high)) in out[1..].iter_mut().zip(ends) {
                *value += factor * (low + high);
            }
        }
    });
    result
}

/// A symmetric matrix that couples each node with its `3^D` neighbours: the diagonal and the couplings to the
/// lexicographically later half of them.
#[derive(Clone, Debug)]
pub struct Stencil<const D: usize> {
    cells: usize,
    /// Offsets of the later half, the centre first.
    offsets: Vec<[isize; D]>,
    /// Coupling of every node with its neighbour at that offset.
    weights: Vec<Vec<f64>>,
}

/// The zero offset and the lexicographically positive half of `{-1, 0, 1}^D`.
fn half_offsets<const D: usize>() -> Vec<[isize; D]> {
    (0..3_usize.pow(D as u32))
        .map(|mut code| {
            let mut offset = [0; D];
            for axis in (0..D).rev() {
                offset[axis] = (code % 3) as isize - 1;
                code /= 3;
            }
            offset
        })
        .filter(|offset| *offset >= [0; D])
        .collect()
}

/// Entry of the mass matrix `int phi_i phi_j / h^D` for nodes at this offset.
fn mass_entry<const D: usize>(offset: &[isize; D]) -> f64 {
    offset
        .iter()
        .map(|o| if *o == 0 { 2.0 / 3.0 } else { 1.0 / 6.0 })
        .product()
}

/// Entry of the stiffness matrix `int grad phi_i . grad phi_j / h^(D-2)` for nodes at this offset.
fn stiffness_entry<const D: usize>(offset: &[isize; D]) -> f64 {
    (0..D)
        .map(|axis| {
            let mut others = *offset;
            others[axis] = 0;
            let along = if offset[axis] == 0 { 2.0 } else { -1.0 };
            along * mass_entry(&others) * 1.5
        })
        .sum()
}

impl<const D: usize> Stencil<D> {
    /// `mass * M + stiffness * S`, `S` with grid spacing 1.
    pub fn constant(cells: usize, mass: f64, stiffness: f64) -> Self {
        let offsets = half_offsets::<D>();
        let points = cells.pow(D as u32);
        let weights = offsets
            .iter()
            .map(|o| vec![mass * mass_entry(o) + stiffness * stiffness_entry(o); points])
            .collect();
        Self {
            cells,
            offsets,
            weights,
        }
    }

    /// `mass * M + stiffness * S + weight * int v^2 phi_i phi_j`.
    pub fn with_square(cells: usize, mass: f64, stiffness: f64, weight: f64, v: &[f64]) -> Self {
        let mut result = Self::constant(cells, mass, stiffness);
        let (offsets, slab) = (&result.offsets, cells.pow(D as u32 - 1));
        let count = offsets.len();
        // Pairs of bounding lines, the earlier first, with the position of their offset (.., 0), which is between (.., -1) and (.., 1).
        let mut pairs = Vec::new();
        for first in 0..1_usize << (D - 1) {
            for second in 0..1_usize << (D - 1) {
                let mut offset = [0; D];
                for (axis, o) in offset.iter_mut().enumerate().take(D - 1) {
                    *o = (second >> axis & 1) as isize - (first >> axis & 1) as isize;
                }
                if let Some(position) = offsets.iter().position(|o| *o == offset) {
                    pairs.push((first, second, position));
                }
            }
        }
        // Slab by slab: the weights of all offsets of one slab of nodes lie together while they are summed.
        let mut together = vec![0.0; count * v.len()];
        over_rows::<D>(cells, &mut together, count, &[v], &|work, point, out| {
            work.mass_along_row(cells);
            for &(one, two, position) in &pairs {
                let Some(base) = point.places[one] else {
                    continue;
                };
                let factor = weight * point.weight * point.at[one] * point.at[two];
                let mut entry = |offset: usize, shift: usize, values: &[f64]| {
                    let out = &mut out[base + offset * slab..][..cells];
                    let (head, tail) = out.split_at_mut(shift);
                    let split = cells - shift;
                    for (o, x) in tail.iter_mut().zip(&values[..split]) {
                        *o += factor * x;
                    }
                    for (o, x) in head.iter_mut().zip(&values[split..cells]) {
                        *o += factor * x;
                    }
                };
                // Node i of a line is the left end of cell i and the right end of cell i - 1.
                entry(position, 0, &work.low);
                entry(position, 1, &work.high);
                entry(position + 1, 0, &work.mixed);
                if one != two {
                    entry(position - 1, 1, &work.mixed);
                }
            }
        });
        let parallel = v.len() >= PARALLEL_FROM;
        for (offset, weights) in result.weights.iter_mut().enumerate() {
            over_slabs(weights, slab, parallel, &|first, out| {
                for (k, out) in out.chunks_exact_mut(slab).enumerate() {
                    let from = &together[((first + k) * count + offset) * slab..][..slab];
                    for (o, x) in out.iter_mut().zip(from) {
                        *o += x;
                    }
                }
            });
        }
        result
    }

    /// The matrix times a vector.
    pub fn apply(&self, x: &[f64]) -> Vec<f64> {
        let cells = self.cells;
        let mut result = vec![0.0; x.len()];
        let parallel = x.len() >= PARALLEL_FROM;
        over_slabs(&mut result, cells, parallel, &|first, out| {
            for (k, out) in out.chunks_exact_mut(cells).enumerate() {
                let line = first + k;
                for (offset, weights) in self.offsets.iter().zip(&self.weights) {
                    let shift = offset[D - 1];
                    let here = &weights[line * cells..][..cells];
                    let later = self.neighbour(line, offset, 1);
                    let x_later = &x[later * cells..][..cells];
                    add_shifted(out, shift, |i, j| here[i] * x_later[j]);
                    if offset.iter().any(|o| *o != 0) {
                        let earlier = self.neighbour(line, offset, -1);
                        let there = &weights[earlier * cells..][..cells];
                        let x_earlier = &x[earlier * cells..][..cells];
                        add_shifted(out, -shift, |_, j| there[j] * x_earlier[j]);
                    }
                }
            }
        });
        result
    }

    /// The line at `sign * offset` (its first `D - 1` axes) from `line`.
    fn neighbour(&self, line: usize, offset: &[isize; D], sign: isize) -> usize {
        let n = self.cells as isize;
        let (mut rest, mut stride, mut result) = (line, 1, 0);
        for axis in (0..D - 1).rev() {
            let i = (rest % self.cells) as isize + sign * offset[axis];
            result += i.rem_euclid(n) as usize * stride;
            stride *= self.cells;
            rest /= self.cells;
        }
        result
    }

    /// Every entry `(row, column, value)` with `column <= row`.
    pub fn lower_entries(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        let cells = self.cells as isize;
        self.offsets
            .iter()
            .zip(&self.weights)
            .flat_map(move |(offset, weights)| {
                weights.iter().enumerate().map(move |(node, &value)| {
                    let (line, i) = (node / self.cells, (node % self.cells) as isize);
                    let other = self.neighbour(line, offset, 1) * self.cells
                        + (i + offset[D - 1]).rem_euclid(cells) as usize;
                    (node.max(other), node.min(other), value)
                })
            })
    }

    /// The diagonal.
    pub fn diagonal(&self) -> &[f64] {
        &self.weights[0]
    }
}

/// `out[i] += f(i, i + shift)`, indices modulo the length, `|shift| <= 1`.
fn add_shifted(out: &mut [f64], shift: isize, f: impl Fn(usize, usize) -> f64) {
    let n = out.len();
    match shift {
        0 => {
            for (i, value) in out.iter_mut().enumerate() {
                *value += f(i, i);
            }
        }
        1 => {
            for (i, value) in out[..n - 1].iter_mut().enumerate() {
                *value += f(i, i + 1);
            }
            out[n - 1] += f(n - 1, 0);
        }
        _ => {
            out[0] += f(0, n - 1);
            for (i, value) in out[1..].iter_mut().enumerate() {
                *value += f(i + 1, i);
            }
        }
    }
}

/// The mass matrix times a vector, one axis after the other.
pub fn mass<const D: usize>(cells: usize, x: &[f64]) -> Vec<f64> {
    let parallel = x.len() >= PARALLEL_FROM;
    let mut values = vec![0.0; x.len()];
    over_slabs(&mut values, cells, parallel, &|first, out| {
        for (k, out) in out.chunks_exact_mut(cells).enumerate() {
            let line = &x[(first + k) * cells..][..cells];
            out[0] = (4.0 * line[0] + line[1] + line[cells - 1]) / 6.0;
            out[cells - 1] = (4.0 * line[cells - 1] + line[0] + line[cells - 2]) / 6.0;
            for (o, w) in out[1..].iter_mut().zip(line.windows(3)) {
                *o = (4.0 * w[1] + w[0] + w[2]) / 6.0;
            }
        }
    });
    let mut stride = cells;
    for _ in 1..D {
        let from = values.clone();
        let period = stride * cells;
        over_slabs(&mut values, stride, parallel, &|first, out| {
            for (k, out) in out.chunks_exact_mut(stride).enumerate() {
                let start = (first + k) * stride;
                let block = start / period * period;
                let (before, after) = (
                    block + (start - block + period - stride) % period,
                    block + (start - block + stride) % period,
                );
                let neighbours = from[before..][..stride]
                    .iter()
                    .zip(&from[after..][..stride]);
                for ((o, here), (a, b)) in out.iter_mut().zip(&from[start..]).zip(neighbours) {
                    *o = (4.0 * here + a + b) / 6.0;
                }
            }
        });
        stride = period;
    }
    values
}

/// Symbols of the mass matrix and of the stiffness matrix (grid spacing 1) at a frequency, `theta` per axis.
pub fn symbols(theta: &[f64]) -> (f64, f64) {
    let masses: Vec<f64> = theta.iter().map(|t| (2.0 + t.cos()) / 3.0).collect();
    let stiffness = (0..theta.len())
        .map(|axis| {
            let others: f64 = (0..theta.len())
                .filter(|a| *a != axis)
                .map(|a| masses[a])
                .product();
            (2.0 - 2.0 * theta[axis].cos()) * others
        })
        .sum();
    (masses.iter().product(), stiffness)
}

#[cfg(test)]
mod tests {
    use super::*;
    use chacha20::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    fn noise(n: usize, seed: u64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..n).map(|_| rng.random_range(-0.5..0.5)).collect()
    }

    fn close(a: &[f64], b: &[f64]) {
        let largest = b.iter().fold(1e-3, |m: f64, x| m.max(x.abs()));
        for (i, (a, b)) in a.iter().zip(b).enumerate() {
            assert!((a - b).abs() < 1e-13 * largest, "{i}: {a} {b}");
        }
    }

    /// `int a b c phi_i / h^D` cell by cell with four Gauss points per axis, straight from the definition.
    fn product_by_definition<const D: usize>(
        n: usize,
        a: &[f64],
        b: &[f64],
        c: &[f64],
    ) -> Vec<f64> {
        let (x, y) = (0.339_981_043_584_856_26, 0.861_136_311_594_052_6);
        let (v, w) = (0.652_145_154_862_546_1, 0.347_854_845_137_453_85);
        let rule = [(-y, w), (-x, v), (x, v), (y, w)].map(|(s, w)| (0.5 + 0.5 * s, 0.5 * w));
        let mut result = vec![0.0; a.len()];
        for cell in 0..a.len() {
            let corner = |bits: usize| {
                let (mut rest, mut stride, mut index) = (cell, 1, 0);
                for axis in (0..D).rev() {
                    index += (rest % n + (bits >> axis & 1)) % n * stride;
                    stride *= n;
                    rest /= n;
                }
                index
            };
            for point in 0..4_usize.pow(D as u32) {
                let digit = |axis: usize| rule[point / 4_usize.pow(axis as u32) % 4];
                let basis = |bits: usize| -> f64 {
                    (0..D)
                        .map(|axis| {
                            let s = digit(axis).0;
                            if bits >> axis & 1 == 1 { s } else { 1.0 - s }
                        })
                        .product()
                };
                let weight: f64 = (0..D).map(|axis| digit(axis).1).product();
                let at = |x: &[f64]| -> f64 {
                    (0..1 << D).map(|bits| basis(bits) * x[corner(bits)]).sum()
                };
                let value = weight * at(a) * at(b) * at(c);
                for bits in 0..1 << D {
                    result[corner(bits)] += value * basis(bits);
                }
            }
        }
        result
    }

    fn products_are_exact<const D: usize>(n: usize) {
        let len = n.pow(D as u32);
        let [a, b, c] = [1, 2, 3].map(|seed| noise(len, seed));
        let fast = product::<D>(n, &a, &b, &c);
        close(&fast, &product_by_definition::<D>(n, &a, &b, &c));
        let one = vec![1.0; len];
        close(&product::<D>(n, &one, &a, &one), &mass::<D>(n, &a));
        let weighted = Stencil::<D>::with_square(n, 0.3, 0.7, 1.9, &a);
        let mut expected = Stencil::<D>::constant(n, 0.3, 0.7).apply(&b);
        for (e, x) in expected.iter_mut().zip(product::<D>(n, &a, &a, &b)) {
            *e += 1.9 * x;
        }
        close(&weighted.apply(&b), &expected);
        let mut by_entries = vec![0.0; len];
        for (row, column, value) in weighted.lower_entries() {
            by_entries[row] += value * b[column];
            if row != column {
                by_entries[column] += value * b[row];
            }
        }
        close(&by_entries, &expected);
    }

    #[test]
    fn products_and_matrices_are_exact_integrals() {
        products_are_exact::<2>(5);
        products_are_exact::<2>(12);
        products_are_exact::<3>(4);
        products_are_exact::<3>(7);
    }

    #[test]
    fn the_number_of_threads_does_not_change_a_bit() {
        let n = 150;
        let [a, b, c] = [1, 2, 3].map(|seed| noise(n * n, seed));
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| {
                let matrix = Stencil::<2>::with_square(n, 1.0, 1.0, 1.0, &a);
                (
                    product::<2>(n, &a, &b, &c),
                    mass::<2>(n, &a),
                    matrix.apply(&b),
                )
            })
        };
        assert_eq!(run(1), run(3));
    }

    fn symbols_are_eigenvalues<const D: usize>(n: usize) {
        let len = n.pow(D as u32);
        let frequency = [1.0, 3.0, 2.0];
        let theta: Vec<f64> = frequency[..D]
            .iter()
            .map(|k| std::f64::consts::TAU * k / n as f64)
            .collect();
        let wave: Vec<f64> = (0..len)
            .map(|i| {
                let mut rest = i;
                let mut phase = 0.0;
                for axis in (0..D).rev() {
                    phase += theta[axis] * (rest % n) as f64;
                    rest /= n;
                }
                phase.cos()
            })
            .collect();
        let (m, s) = symbols(&theta);
        let scaled = |factor: f64| wave.iter().map(|x| factor * x).collect::<Vec<_>>();
        close(&mass::<D>(n, &wave), &scaled(m));
        close(
            &Stencil::<D>::constant(n, 1.0, 0.0).apply(&wave),
            &scaled(m),
        );
        close(
            &Stencil::<D>::constant(n, 0.0, 1.0).apply(&wave),
            &scaled(s),
        );
    }

    #[test]
    fn symbols_are_eigenvalues_of_the_matrices() {
        symbols_are_eigenvalues::<2>(12);
        symbols_are_eigenvalues::<3>(8);
    }
}

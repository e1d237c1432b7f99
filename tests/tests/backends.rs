//! One suite for all backends: operations against their definitions, derivatives against independent ones, and a step
//! of the flow against double precision on the CPU.

mod support;

use std::sync::Arc;

use burn::tensor::Tensor;
use fem::FiniteElementStep;
use geometry::{Bricks, Field, Grid, Nodes, measure::l2_distance, phase_field, shapes::Ball};
use linearize::dual::{self, Dual};
use linearize::taylor::{halvings, remainder};
use model::{MeanCurvatureOperator, Network, Shipped};
use operators::{
    COEFFICIENTS, ComputeDevice, HermiteTable, HostUpdate, Interpolation, Real, SharedUpdate,
    SpectralFilter, TableRange, add_scaled, brick_convolution, brick_pass, circular_convolution,
    combined, extrapolate, inner_product, retract, scaled, spectral_filter, tabulated,
    update_on_host,
};
use solver::{
    Exit, FlowParams, MeanCurvatureStep, MinimizingMovement, NewtonParams, Objective, Problem,
    State, StepRecord, Stepper,
};
use support::{
    Backend, backends, convolution, correlation, dot, noise, relative_distance, splitting_network,
};

/// Kernel width of the networks here.
const WIDTH: usize = 9;
/// `c = tau / tautilde^2`.
const STIFFNESS: f64 = 300.0;

fn close(backend: &Backend, found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    let difference = relative_distance(found, expected);
    assert!(
        difference <= tolerance,
        "{}: {what} differs by {difference:.1e}, more than {tolerance:.0e}",
        backend.name
    );
}

/// `c_b = sum_a g_a x_{a+b}`: the gradient of `sum_a g_a (K * x)_a` in the kernel `K`.
fn correlated<const R: usize, const K: usize>(
    x: Tensor<R>,
    g: Tensor<R>,
    width: usize,
) -> Tensor<K> {
    let kernel = Tensor::<K>::zeros([width; K], (&x.device(), x.dtype()));
    let leaf = kernel.autodiff().require_grad();
    let y = circular_convolution(x.autodiff(), leaf.clone(), false);
    let gradients = (y * g.autodiff()).sum().backward();
    leaf.grad(&gradients).unwrap()
}

/// `K` axes of a grid behind `R - K` of a batch.
fn convolution_case<const R: usize, const K: usize>(
    backend: &Backend,
    shape: [usize; R],
    width: usize,
) {
    let device = &backend.device;
    let (x, kernel) = (
        noise(shape.iter().product(), 1),
        noise(width.pow(K as u32), 2),
    );
    let tolerance = backend.tolerance(1e-12, 1e-5);
    for adjoint in [false, true] {
        let found = circular_convolution::<R, K>(
            device.tensor(&x, shape),
            device.tensor(&kernel, [width; K]),
            adjoint,
        );
        let expected = convolution(&x, &shape[R - K..], &kernel, width, adjoint);
        let what = format!("convolution {shape:?} * {width}^{K}, adjoint: {adjoint}");
        assert_eq!(found.dims(), shape);
        close(
            backend,
            &device.values(found).unwrap(),
            &expected,
            tolerance,
            &what,
        );
    }
    let g = noise(x.len(), 3);
    let found: Tensor<K> = correlated(device.tensor(&x, shape), device.tensor(&g, shape), width);
    let expected = correlation(&x, &g, &shape[R - K..], width);
    assert_eq!(found.dims(), [width; K]);
    let what = format!("correlation {shape:?}, {width}^{K}");
    close(
        backend,
        &device.values(found).unwrap(),
        &expected,
        tolerance,
        &what,
    );
}

#[test]
fn convolutions_and_correlations_are_their_sums() {
    for backend in &backends() {
        convolution_case::<2, 2>(backend, [12, 12], 5);
        convolution_case::<2, 2>(backend, [9, 15], 7);
        convolution_case::<2, 2>(backend, [33, 26], 17);
        convolution_case::<3, 2>(backend, [3, 7, 10], 3);
        convolution_case::<4, 2>(backend, [2, 3, 8, 5], 5);
        convolution_case::<3, 3>(backend, [6, 5, 8], 3);
        convolution_case::<4, 3>(backend, [2, 5, 7, 9], 5);
    }
}

/// GPUs keep the spectra of kernels.
#[test]
fn kernels_are_told_apart() {
    let width = 3;
    let (values, x, y) = (noise(20, 1), noise(54, 2), noise(54, 3));
    for backend in &backends() {
        let device = &backend.device;
        let tolerance = backend.tolerance(1e-12, 1e-5);
        // In one memory.
        let whole: Tensor<1> = device.tensor(&values, [values.len()]);
        for _ in 0..2 {
            for from in [0, 1, 11] {
                let kernel = &values[from..from + 9];
                let sliced: Tensor<2> = whole.clone().slice([from..from + 9]).reshape([width; 2]);
                for (shape, x) in [([6, 9], &x), ([9, 6], &y)] {
                    for adjoint in [false, true] {
                        let input = device.tensor(x, shape);
                        let found = circular_convolution(input, sliced.clone(), adjoint);
                        let expected = convolution(x, &shape, kernel, width, adjoint);
                        let found = device.values(found).unwrap();
                        let what = format!("{shape:?} by a kernel from {from}");
                        close(backend, &found, &expected, tolerance, &what);
                    }
                }
            }
        }
    }
}

#[test]
fn convolutions_have_adjoint_gradients() {
    for backend in &backends() {
        let device = &backend.device;
        let (shape, width) = ([10, 13], 5);
        let (x, kernel, g) = (noise(130, 1), noise(25, 2), noise(130, 3));
        let leaf_x = device.tensor(&x, shape).autodiff().require_grad();
        let leaf_k = device.tensor(&kernel, [width; 2]).autodiff().require_grad();
        let weights = device.tensor(&g, shape).autodiff();
        let y: Tensor<2> = circular_convolution(leaf_x.clone(), leaf_k.clone(), false);
        let gradients = (y * weights).sum().backward();
        let tolerance = backend.tolerance(1e-12, 1e-5);
        for (found, expected, what) in [
            (
                leaf_x.grad(&gradients).unwrap(),
                convolution(&g, &shape, &kernel, width, true),
                "gradient in the grid",
            ),
            (
                leaf_k.grad(&gradients).unwrap(),
                correlation(&x, &g, &shape, width),
                "gradient in the kernel",
            ),
        ] {
            close(
                backend,
                &device.values(found).unwrap(),
                &expected,
                tolerance,
                what,
            );
        }
    }
}

/// The sine from -2 to 2.
fn sine_table(cells: usize) -> HermiteTable {
    let range = TableRange {
        low: -2.0,
        high: 2.0,
        cells,
    };
    HermiteTable::new(range, |w| [w.sin(), w.cos(), -w.sin()]).unwrap()
}

#[test]
fn tables_give_a_function_and_its_derivatives() {
    let table = sine_table(256);
    let range = table.range();
    // Inside, at the ends and beyond them.
    let mut w: Vec<f64> = noise(300, 4).iter().map(|w| 2.4 * w).collect();
    w.extend([-2.0, 2.0, 0.0, -2.5, 2.5, 1.0]);
    let inside: Vec<usize> = (0..w.len()).filter(|&i| w[i].abs() <= 2.0).collect();
    for backend in &backends() {
        let device = &backend.device;
        let coefficients = device.tensor(table.coefficients(), [range.cells, COEFFICIENTS]);
        for order in 0..=3 {
            let input = device.tensor(&w, [2, w.len() / 2]);
            let found = tabulated(input, coefficients.clone(), range, order);
            let found = device.values(found).unwrap();
            let expected: Vec<f64> = w.iter().map(|&w| table.derivative(w, order)).collect();
            let single = [1e-6, 1e-5, 1e-4, 1e-3][order];
            let tolerance = backend.tolerance(1e-13, single);
            close(
                backend,
                &found,
                &expected,
                tolerance,
                &format!("table, order {order}"),
            );
            let shift = order as f64 * std::f64::consts::FRAC_PI_2;
            let pick = |v: &dyn Fn(usize) -> f64| inside.iter().map(|&i| v(i)).collect::<Vec<_>>();
            let (found, exact) = (pick(&|i| found[i]), pick(&|i| (w[i] + shift).sin()));
            let double: f64 = [1e-13, 1e-11, 1e-8, 1e-5][order];
            let tolerance = double.max(backend.tolerance(0.0, single));
            close(
                backend,
                &found,
                &exact,
                tolerance,
                &format!("sine, order {order}"),
            );
        }
    }
}

/// So that a run in which something is not finite is stopped. (Of higher derivatives GPUs do not promise it.)
#[test]
fn a_table_of_what_is_not_a_number_is_not_one_either() {
    let table = sine_table(256);
    let range = table.range();
    for backend in &backends() {
        let device = &backend.device;
        let coefficients = device.tensor(table.coefficients(), [range.cells, COEFFICIENTS]);
        for order in [0, 1] {
            let w = device.tensor::<1>(&[0.5, f64::NAN], [2]);
            let found = tabulated(w, coefficients.clone(), range, order);
            let found = device.values(found).unwrap();
            assert!(found[0].is_finite(), "{}, order {order}", backend.name);
            assert!(found[1].is_nan(), "{}, order {order}", backend.name);
        }
    }
}

fn filter_case<const D: usize>(backend: &Backend, shape: [usize; D], width: usize) {
    let device = &backend.device;
    let x = noise(shape.iter().product(), 5);
    let kernel = noise(width.pow(D as u32), 6);
    // |k|^2 is the kernel's convolution followed by its transpose.
    let filter = SpectralFilter::from_kernel(&shape, &kernel, width, |k| k.norm_sqr());
    let found = device
        .values(spectral_filter(device.tensor(&x, shape), &filter))
        .unwrap();
    let once = convolution(&x, &shape, &kernel, width, false);
    let expected = convolution(&once, &shape, &kernel, width, true);
    let tolerance = backend.tolerance(1e-12, 1e-5);
    close(
        backend,
        &found,
        &expected,
        tolerance,
        &format!("spectral filter {shape:?}"),
    );
}

#[test]
fn spectral_filters_multiply_spectra() {
    for backend in &backends() {
        filter_case(backend, [12, 12], 5);
        filter_case(backend, [9, 14], 3);
        filter_case(backend, [6, 5, 7], 3);
    }
}

/// Slices share the memory of the tensor they are cut from.
#[test]
fn operations_take_slices_for_what_they_are() {
    let (grid, width) = ([6, 9], 3);
    let (x, kernel) = (noise(54, 1), noise(9, 2));
    let expected = convolution(&x, &grid, &kernel, width, false);
    let table = sine_table(512);
    for backend in &backends() {
        let device = &backend.device;
        let tolerance = backend.tolerance(1e-12, 1e-5);
        // The values with others before and behind them.
        let cut = |values: &[f64]| -> Tensor<1> {
            let longer = [&noise(5, 3), values, &noise(7, 4)].concat();
            let whole: Tensor<1> = device.tensor(&longer, [longer.len()]);
            whole.slice([5..5 + values.len()])
        };
        let grid_of = |values: &[f64]| -> Tensor<2> { cut(values).reshape(grid) };
        let values = |x: Tensor<2>| device.values(x).unwrap();
        let check = |found: &[f64], expected: &[f64], what| {
            close(
                backend,
                found,
                expected,
                tolerance,
                &format!("{what} of slices"),
            );
        };
        let sliced: Tensor<2> = cut(&kernel).reshape([width; 2]);
        let found = circular_convolution(grid_of(&x), sliced, false);
        check(&values(found), &expected, "convolution");
        let g = noise(54, 6);
        let found: Tensor<2> = correlated(grid_of(&x), grid_of(&g), width);
        check(
            &values(found),
            &correlation(&x, &g, &grid, width),
            "correlation",
        );
        let coefficients: Tensor<2> = cut(table.coefficients()).reshape([512, COEFFICIENTS]);
        let found = tabulated(grid_of(&x), coefficients, table.range(), 0);
        let sine: Vec<f64> = x.iter().map(|x| x.sin()).collect();
        check(&values(found), &sine, "table");
        let filter = SpectralFilter::from_kernel(&grid, &[1.0], 1, |_| 2.0);
        let twice: Vec<f64> = x.iter().map(|x| 2.0 * x).collect();
        check(
            &values(spectral_filter(grid_of(&x), &filter)),
            &twice,
            "filter",
        );
        let sum: Vec<f64> = x.iter().zip(&g).map(|(x, g)| x + 3.0 * g).collect();
        check(
            &values(add_scaled(grid_of(&x), &grid_of(&g), 3.0)),
            &sum,
            "sum",
        );
        let combination = combined(scaled(&grid_of(&x), 0.5), 2.0, &grid_of(&g), 3.0);
        check(&values(combination), &sum, "combination");
        let update = SharedUpdate::new(AddThrice);
        let updated = update_on_host(&grid_of(&g), grid_of(&x), &update);
        check(&values(updated), &sum, "update");
        let product = device
            .scalar(inner_product(&grid_of(&x), &grid_of(&g)))
            .unwrap();
        check(&[product], &[dot(&x, &g)], "inner product");
    }
}

/// Passes along these axes with values outside of the bricks as zero, from their definition.
fn passes<const D: usize>(
    nodes: &Nodes<D>,
    x: &[f64],
    taps: &[f64],
    axes: &[usize],
    adjoint: bool,
) -> Vec<f64> {
    let (cells, reach) = (nodes.grid().cells(), taps.len() / 2);
    let mut x = x.to_vec();
    for &axis in axes {
        let at = |node: usize, k: usize| {
            let mut place = nodes.multi_index(node);
            place[axis] = (place[axis] + cells + k - reach) % cells;
            nodes.at(place).stored().map_or(0.0, |node| x[node])
        };
        let tap = |k: usize| taps[if adjoint { taps.len() - 1 - k } else { k }];
        let sum = |node| (0..taps.len()).map(|k| tap(k) * at(node, k)).sum();
        x = (0..x.len()).map(sum).collect();
    }
    x
}

fn brick_case<const D: usize>(side: usize, reach: usize) {
    let active = |place: [usize; D]| place.iter().sum::<usize>() % 3 != 1;
    let bricks = Bricks::<D>::new(3 * side, side, active, |_| true).unwrap();
    let (x, taps) = (noise(bricks.len(), 1), noise(2 * reach + 1, 2));
    let grid = Grid::centred(3 * side, 1.0).unwrap();
    let nodes = Nodes::on_bricks(grid, Arc::new(bricks.clone()));
    let count = bricks.places().len();
    for backend in &backends() {
        let device = &backend.device;
        let field = device.tensor::<D>(&x, bricks.shape());
        let weights = device.tensor(&taps, [taps.len()]);
        let neighbours = device.tensor::<2>(&bricks.neighbours(), [count, 2 * D]);
        let check = |found: Tensor<D>, axes: &[usize], adjoint: bool| {
            let expected = passes(&nodes, &x, &taps, axes, adjoint);
            let tolerance = backend.tolerance(1e-13, 1e-6);
            let what = format!("passes over bricks of {side}^{D}, {axes:?}, adjoint: {adjoint}");
            let found = device.values(found).unwrap();
            close(backend, &found, &expected, tolerance, &what);
        };
        let mut axes: Vec<usize> = (0..D).collect();
        for adjoint in [true, false] {
            let (x, taps) = (field.clone(), weights.clone());
            let found = brick_convolution(x, taps, neighbours.clone(), adjoint);
            check(found, &axes, adjoint);
            axes.reverse();
        }
        for axis in 0..D {
            let pass = |x| brick_pass(x, weights.clone(), neighbours.clone(), axis);
            check(pass(field.clone()), &[axis], false);
            // The derivative of `sum y pass(x)` by `x` is the transpose of the pass, at `y`.
            let variable = field.clone().autodiff().require_grad();
            let y = field.clone().autodiff();
            let (taps, table) = (weights.clone().autodiff(), neighbours.clone().autodiff());
            let image = brick_pass(variable.clone(), taps, table, axis);
            let gradients = (image * y).sum().backward();
            check(variable.grad(&gradients).unwrap(), &[axis], true);
        }
    }
}

#[test]
fn passes_over_bricks_are_their_sums() {
    brick_case::<2>(16, 5);
    brick_case::<3>(8, 8);
}

/// `z += Z S Z^T x` with samples at noisy places of cells in a row, where `S` couples each corner with the next one.
struct Interpolated {
    axes: usize,
    starts: Vec<u32>,
    entries: Vec<u32>,
    places: Vec<f64>,
}

impl Interpolated {
    /// Cells with more and fewer samples, also with none; every other entry of the vector is one.
    fn new(axes: usize) -> Self {
        let counts = [3, 0, 40, 1, 17];
        let mut starts = vec![0];
        starts.extend(counts.iter().scan(0, |end, count| {
            *end += count;
            Some(*end)
        }));
        let samples = *starts.last().unwrap();
        let places = noise(samples as usize * (axes + 1), 7);
        Self {
            axes,
            starts,
            entries: (0..samples).map(|i| 2 * ((7 * i) % samples)).collect(),
            places: places.iter().map(|x| x.abs().fract()).collect(),
        }
    }

    /// Entries of the vector with their values of the functions of the corners, cell by cell.
    fn samples(&self, cell: usize) -> impl Iterator<Item = (usize, Vec<f64>)> {
        (self.starts[cell]..self.starts[cell + 1]).map(|sample| {
            let from = sample as usize * (self.axes + 1);
            let place = &self.places[from..=from + self.axes];
            let hat = |corner: usize| -> f64 {
                let along = place[1..].iter().enumerate().map(|(axis, place)| {
                    let upper = corner >> axis & 1 == 1;
                    if upper { *place } else { 1.0 - place }
                });
                place[0] * along.product::<f64>()
            };
            let hats = (0..1 << self.axes).map(hat).collect();
            (self.entries[sample as usize] as usize, hats)
        })
    }
}

impl HostUpdate for Interpolated {
    fn update<T: Real>(&self, x: &[T], z: &mut [T]) {
        let corners = 1 << self.axes;
        let mut sums = vec![0.0; (self.starts.len() - 1) * corners];
        for (cell, sums) in sums.chunks_mut(corners).enumerate() {
            for (entry, hats) in self.samples(cell) {
                for (sum, hat) in sums.iter_mut().zip(hats) {
                    *sum += hat * x[entry].double();
                }
            }
        }
        self.at_corners(&mut sums);
        for (cell, values) in sums.chunks(corners).enumerate() {
            for (entry, hats) in self.samples(cell) {
                z[entry] = z[entry] + T::of(dot(&hats, values));
            }
        }
    }

    fn interpolation(&self) -> Option<Interpolation> {
        Some(Interpolation {
            axes: self.axes,
            starts: self.starts.clone(),
            entries: self.entries.clone(),
            places: self.places.clone(),
        })
    }

    fn at_corners(&self, sums: &mut [f64]) {
        let before = sums.to_vec();
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum += 0.5 * before[(i + 1) % before.len()];
        }
    }
}

/// On a GPU only the values at corners visit the host.
#[test]
fn interpolated_updates_are_those_of_whole_vectors() {
    for axes in [2, 3] {
        let lattice = Interpolated::new(axes);
        let count = 2 * lattice.entries.len();
        let (x, z) = (noise(count, 3), noise(count, 4));
        let mut expected = z.clone();
        lattice.update(&x, &mut expected);
        let update = SharedUpdate::new(lattice);
        for backend in &backends() {
            let device = &backend.device;
            let tensor = |x: &[f64]| -> Tensor<2> { device.tensor(x, [2, count / 2]) };
            let kept = tensor(&z);
            // Twice, since arrays on a device are kept.
            for _ in 0..2 {
                let found = update_on_host(&tensor(&x), kept.clone(), &update);
                let found = device.values(found).unwrap();
                let tolerance = backend.tolerance(1e-14, 1e-6);
                close(backend, &found, &expected, tolerance, "interpolated update");
            }
            let in_place = update_on_host(&tensor(&x), tensor(&z), &update);
            let in_place = device.values(in_place).unwrap();
            let tolerance = backend.tolerance(1e-14, 1e-6);
            close(backend, &in_place, &expected, tolerance, "update in place");
            let kept = device.values(kept).unwrap();
            close(
                backend,
                &kept,
                &z,
                backend.tolerance(1e-15, 1e-7),
                "what was updated",
            );
        }
    }
}

/// Adds three times the first vector.
struct AddThrice;

impl HostUpdate for AddThrice {
    fn update<T: Real>(&self, x: &[T], z: &mut [T]) {
        z.iter_mut()
            .zip(x)
            .for_each(|(z, x)| *z = *z + T::of(3.0) * *x);
    }
}

#[test]
fn vector_operations_are_their_formulas() {
    // Long enough for several threads.
    let shape = [210, 200];
    let count = 210 * 200;
    let (a, b) = (noise(count, 1), noise(count, 2));
    let phase: Vec<f64> = a.iter().map(|a| (4.0 * a).tanh()).collect();
    let before: Vec<f64> = phase.iter().zip(&b).map(|(u, b)| u - 0.1 * b).collect();
    let zip = |x: &[f64], y: &[f64], f: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
        x.iter().zip(y).map(|(x, y)| f(*x, *y)).collect()
    };
    let sum = zip(&a, &b, &|a, b| a + 3.0 * b);
    // In the variable atanh u, both motions are shifts.
    let atanh = |u: f64| u.clamp(-0.99999, 0.99999).atanh();
    let retracted = zip(&phase, &b, &|u, p| {
        let q = 1.0 - u * u;
        let shift = (-0.3 * p * q / (q * q + 0.0025)).clamp(-1.5, 1.5);
        (atanh(u) + shift).tanh() - atanh(u).tanh() + u - 0.3 * p - q * shift
    });
    let extrapolated = zip(&phase, &before, &|u, v| {
        let q = 1.0 - u * u;
        let s = (2.0 * (atanh(u) - atanh(v)).tanh()).clamp(-0.9, 0.9);
        let s = s * q * q / (q * q + 0.0025);
        let moved = (atanh(u) + s.atanh()).tanh();
        u + moved - atanh(u).tanh()
    });
    for backend in &backends() {
        let device = &backend.device;
        let tensor = |x: &[f64]| -> Tensor<2> { device.tensor(x, shape) };
        let values = |x: Tensor<2>| device.values(x).unwrap();
        let product = device
            .scalar(inner_product(&tensor(&a), &tensor(&b)))
            .unwrap();
        let scale = (dot(&a, &a) * dot(&b, &b)).sqrt();
        let error = (product - dot(&a, &b)).abs() / scale;
        assert!(error < backend.tolerance(1e-14, 1e-6), "{error:e}");
        let kept = tensor(&a);
        let moved = add_scaled(kept.clone(), &tensor(&b), 3.0);
        let tolerance = backend.tolerance(1e-9, 1e-5);
        close(backend, &values(moved), &sum, tolerance, "x + 3 y");
        close(backend, &values(kept), &a, tolerance, "x after x + 3 y");
        let updated = update_on_host(&tensor(&b), tensor(&a), &SharedUpdate::new(AddThrice));
        close(
            backend,
            &values(updated),
            &sum,
            tolerance,
            "update on the host",
        );
        let moved = retract(&tensor(&phase), &tensor(&b), -0.3);
        close(backend, &values(moved), &retracted, tolerance, "retraction");
        let moved = extrapolate(&tensor(&phase), &tensor(&before), 2.0);
        close(
            backend,
            &values(moved),
            &extrapolated,
            tolerance,
            "extrapolation",
        );
    }
}

/// The energy of a step at one point, and directions, in `D` dimensions.
struct Case<const D: usize> {
    network: Network,
    cells: usize,
    u: Vec<f64>,
    previous: Vec<f64>,
    p: Vec<f64>,
    q: Vec<f64>,
}

impl<const D: usize> Case<D> {
    fn new(cells: usize) -> Self {
        let grid = Grid::<D>::centred(cells, 1.0).unwrap();
        let rough = |radius: f64, seed: u64| -> Vec<f64> {
            let field = ball(grid, radius);
            let noise = noise(grid.len(), seed);
            (field.values().iter().zip(noise))
                .map(|(u, noise)| u + 0.05 * noise)
                .collect()
        };
        Self {
            network: splitting_network(D, WIDTH).unwrap(),
            cells,
            u: rough(0.3, 1),
            previous: rough(0.28, 2),
            p: noise(grid.len(), 3),
            q: noise(grid.len(), 4),
        }
    }

    fn tensor(&self, backend: &Backend, values: &[f64]) -> Tensor<D> {
        backend.device.tensor(values, [self.cells; D])
    }

    fn energy(&self, backend: &Backend) -> MinimizingMovement<D> {
        let operator = MeanCurvatureOperator::new(&self.network, &backend.device).unwrap();
        let mut energy =
            MinimizingMovement::new(Arc::new(operator.clone()), self.cells, &backend.device)
                .unwrap();
        let previous = self.tensor(backend, &self.previous);
        energy.set(&previous, STIFFNESS).unwrap();
        energy
    }

    /// Energy, gradient and Hessian times `p`, from their formulas on the host.
    fn by_hand(&self) -> (f64, Vec<f64>, Vec<f64>) {
        let table = self.network.table().unwrap();
        let shape = [self.cells; D];
        let convolve =
            |x: &[f64], adjoint| convolution(x, &shape, self.network.kernel(), WIDTH, adjoint);
        let zip = |a: &[f64], b: &[f64], f: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
            a.iter().zip(b).map(|(a, b)| f(*a, *b)).collect()
        };
        let w = convolve(&self.u, false);
        let residual = zip(&w, &self.u, &|w, u| table.derivative(w, 0) - u);
        let motion = zip(&self.u, &self.previous, &|a, b| a - b);
        let energy = 0.5 * (dot(&motion, &motion) + STIFFNESS * dot(&residual, &residual));
        let slope: Vec<f64> = w.iter().map(|&w| table.derivative(w, 1)).collect();
        let weighted = zip(&slope, &residual, &|a, b| a * b);
        let curvature = zip(&convolve(&weighted, true), &residual, &|a, b| a - b);
        let gradient = zip(&motion, &curvature, &|m, c| m + STIFFNESS * c);
        let dw = convolve(&self.p, false);
        let defect: Vec<f64> = zip(&zip(&slope, &dw, &|a, b| a * b), &self.p, &|a, b| a - b);
        let bend: Vec<f64> = zip(&w, &residual, &|w, r| table.derivative(w, 2) * r);
        let inner = zip(
            &zip(&slope, &defect, &|a, b| a * b),
            &zip(&bend, &dw, &|a, b| a * b),
            &|a, b| a + b,
        );
        let curvature = zip(&convolve(&inner, true), &defect, &|a, b| a - b);
        let product = zip(&self.p, &curvature, &|p, c| p + STIFFNESS * c);
        (energy, gradient, product)
    }

    /// The same energy with dual numbers.
    fn dual_energy(&self, backend: &Backend, u: Dual<D>) -> Dual<1> {
        let device = &backend.device;
        let table = self.network.table().unwrap();
        let range = table.range();
        let coefficients = device.tensor(table.coefficients(), [range.cells, COEFFICIENTS]);
        let coefficients = coefficients.autodiff();
        let kernel: Tensor<D> = device.tensor(self.network.kernel(), [WIDTH; D]);
        let kernel = kernel.autodiff();
        let previous = self.tensor(backend, &self.previous).autodiff();
        let w = u
            .clone()
            .linear(|x| circular_convolution(x, kernel.clone(), false));
        let at = |order| tabulated(w.primal.clone(), coefficients.clone(), range, order);
        let step = w.clone().pointwise(at(0), at(1));
        let residual = step - u.clone();
        let motion = u - previous;
        ((motion.clone() * motion).sum() + (residual.clone() * residual).sum() * STIFFNESS) * 0.5
    }

    fn derivatives(&self, backend: &Backend) {
        let device = &backend.device;
        let mut energy = self.energy(backend);
        let u = self.tensor(backend, &self.u);
        let (value, gradient) = energy.evaluate(&u).unwrap();
        let gradient = device.values(gradient).unwrap();
        let (exact_value, exact_gradient, exact_product) = self.by_hand();
        let tolerance = backend.tolerance(1e-11, 3e-5);
        close(backend, &[value], &[exact_value], tolerance, "energy");
        close(backend, &gradient, &exact_gradient, tolerance, "gradient");

        let mut apply = |p: &[f64]| {
            let product = energy
                .hessian_vector_product(&self.tensor(backend, p))
                .unwrap();
            device.values(product).unwrap()
        };
        let (hp, hq) = (apply(&self.p), apply(&self.q));
        close(
            backend,
            &hp,
            &exact_product,
            backend.tolerance(1e-11, 3e-5),
            "product by hand",
        );
        let independent = dual::hessian_vector_product(&u, &self.tensor(backend, &self.p), |u| {
            self.dual_energy(backend, u)
        });
        let independent = device.values(independent).unwrap();
        close(
            backend,
            &hp,
            &independent,
            backend.tolerance(1e-10, 3e-5),
            "reverse over forward",
        );
        // Rounding is relative to the lengths, not to the inner product.
        let scale = (dot(&hp, &hp) * dot(&self.q, &self.q)).sqrt();
        let asymmetry = (dot(&hp, &self.q) - dot(&self.p, &hq)).abs() / scale;
        assert!(
            asymmetry < backend.tolerance(1e-14, 1e-6),
            "{}: {asymmetry:e}",
            backend.name
        );

        if backend.is_double() {
            let mut at = |t: f64| {
                let moved: Vec<f64> = self.u.iter().zip(&self.p).map(|(u, p)| u + t * p).collect();
                energy.value(&self.tensor(backend, &moved)).unwrap()
            };
            let t = 1e-5;
            let difference = (at(t) - at(-t)) / (2.0 * t);
            let slope = dot(&gradient, &self.p);
            assert!(
                (difference / slope - 1.0).abs() < 1e-6,
                "{difference} {slope}"
            );
        }
    }

    fn taylor(&self, backend: &Backend) {
        let device = &backend.device;
        let mut energy = self.energy(backend);
        let (u, p) = (self.tensor(backend, &self.u), self.tensor(backend, &self.p));
        let (_, gradient) = energy.evaluate(&u).unwrap();
        let product = energy.hessian_vector_product(&p).unwrap();
        let along = |v: Tensor<D>| dot(&device.values(v).unwrap(), &self.p);
        let derivatives = [along(gradient), along(product)];
        let steps = halvings(0.1, 14);
        let mut value = |t: f64| energy.value(&(u.clone() + p.clone() * t)).unwrap();
        let mut check = |order: usize, derivatives: &[f64]| {
            let found = remainder(&mut value, &derivatives[..order], &steps, device.epsilon());
            (found.rate(), found.is_consistent(0.2), found)
        };
        for order in [1, 2] {
            let (rate, consistent, found) = check(order, &derivatives);
            assert!(consistent, "{}: {found:?}", backend.name);
            if backend.is_double() {
                let rate = rate.expect("double precision resolves several steps");
                assert!((rate - (order + 1) as f64).abs() < 0.2, "{rate} {found:?}");
            }
        }
        let wrong = [derivatives[0], 1.1 * derivatives[1]];
        assert!(
            !check(2, &wrong).1,
            "{}: a wrong Hessian passes",
            backend.name
        );
    }
}

#[test]
fn derivatives_of_the_energy_agree_with_independent_ones() {
    let (flat, solid) = (Case::<2>::new(20), Case::<3>::new(11));
    for backend in &backends() {
        flat.derivatives(backend);
        solid.derivatives(backend);
    }
}

#[test]
fn taylor_remainders_decay_with_rates_two_and_three() {
    let (flat, solid) = (Case::<2>::new(20), Case::<3>::new(11));
    for backend in &backends() {
        flat.taylor(backend);
        solid.taylor(backend);
    }
}

fn ball<const D: usize>(grid: Grid<D>, radius: f64) -> Field<D> {
    let ball = Ball::new([0.0; D], radius).unwrap();
    phase_field(grid, &ball, 2.0 * grid.spacing()).unwrap()
}

fn params<const D: usize>(grid: &Grid<D>) -> FlowParams {
    FlowParams {
        eps: 2.0 * grid.spacing(),
        mcf_step: grid.spacing().powi(2),
        newton: NewtonParams {
            tolerance: 1e-3,
            cg_tolerance: 1e-2,
            ..NewtonParams::default()
        },
        calibration: solver::Factors::PAPER,
    }
}

/// Willmore flow with a learned operator.
fn learned<const D: usize>(
    network: &Network,
    grid: &Grid<D>,
    params: FlowParams,
    device: &ComputeDevice,
) -> Problem<D> {
    let step = MeanCurvatureOperator::new(network, device).unwrap();
    Problem::new(step, grid, params, device).unwrap()
}

/// Two steps, so that the second starts from the extrapolation.
fn flow<const D: usize>(backend: &Backend, grid: Grid<D>) -> (Field<D>, [StepRecord; 2]) {
    let params = params(&grid);
    let network = splitting_network(D, WIDTH).unwrap();
    let start = ball(grid, 0.3);
    let problem = learned(&network, &grid, params, &backend.device);
    let start = problem.start(&start).unwrap();
    let mut flow = Stepper::new(problem, start);
    let records = [(); 2].map(|()| flow.step(params.mcf_step).unwrap());
    (flow.field().unwrap(), records)
}

fn flow_case<const D: usize>(cells: usize) {
    let grid = Grid::<D>::centred(cells, 1.0).unwrap();
    let backends = backends();
    let reference = backends.iter().find(|backend| backend.is_double());
    let reference = reference.map(|backend| flow(backend, grid).0);
    for backend in &backends {
        let (field, records) = flow(backend, grid);
        for record in records {
            let name = &backend.name;
            assert!(record.energy < record.energy_before, "{name}: {record:?}");
            assert!(matches!(
                record.newton.exit,
                Exit::Converged | Exit::Precision
            ));
            assert!(
                record.newton.exit == Exit::Converged || !backend.is_double(),
                "{record:?}"
            );
        }
        if let Some(reference) = &reference {
            let motion = l2_distance(reference, &ball(grid, 0.3)).unwrap();
            let difference = l2_distance(&field, reference).unwrap() / motion;
            // CPUs sum in the same order. Elsewhere conjugate gradients amplify the difference: after a change of 1e-15 of the start the
            // result is 4e-7 of the motion away on a CPU, too. In f32 the energy is known to some 1e-3 of the motion.
            let is_cpu = backend.device.kind().is_cpu();
            let tolerance = backend.tolerance(if is_cpu { 1e-9 } else { 2e-6 }, 1e-2);
            assert!(
                difference <= tolerance,
                "{}: {difference:.1e} of the motion {motion:.1e}",
                backend.name
            );
        }
    }
}

#[test]
fn steps_of_the_flow_agree_in_two_dimensions() {
    flow_case::<2>(64);
}

#[test]
fn steps_of_the_flow_agree_in_three_dimensions() {
    flow_case::<3>(24);
}

#[test]
fn steps_on_bricks_are_those_on_the_whole_grid() {
    let grid = Grid::<2>::centred(96, 1.0).unwrap();
    let params = params(&grid);
    let network = Shipped::Accurate.find(params.ratios(&grid, 17)).unwrap();
    let start = ball(grid, 0.3);
    for backend in &backends() {
        let device = &backend.device;
        let problem = learned(&network, &grid, params, device);
        let whole = problem.start(&start).unwrap();
        let bricks = problem.start_on_bricks(&start).unwrap();
        assert!(bricks.field.nodes().len() < grid.len());
        let step = |start: State<2>| {
            let mut flow = Stepper::new(problem.clone(), start);
            flow.step(params.mcf_step).unwrap();
            flow.field().unwrap()
        };
        let (whole, bricks) = (step(whole), step(bricks));
        let motion = l2_distance(&whole, &start).unwrap();
        let difference = l2_distance(&bricks, &whole).unwrap() / motion;
        // Both are minimized to 1e-3; in f32 the energy is known to some 1e-3 of the motion.
        let tolerance = backend.tolerance(2e-3, 2e-2);
        let name = &backend.name;
        assert!(
            difference <= tolerance,
            "{name}: {difference:.1e} of the motion {motion:.1e}"
        );
    }
}

/// Finite elements are solved on the host; their tensors and the derivatives of the nested energy live on the backend.
fn finite_elements<const D: usize>(cells: usize) {
    let grid = Grid::<D>::centred(cells, 1.0).unwrap();
    let (eps, size) = (2.0 * grid.spacing(), grid.spacing().powi(2));
    let start = ball(grid, 0.3);
    let p = noise(grid.len(), 3);
    let steps = [
        FiniteElementStep::implicit(&grid, eps, size).unwrap(),
        FiniteElementStep::semi_implicit(&grid, eps, size).unwrap(),
    ];
    for (step, backend) in steps
        .iter()
        .flat_map(|step| backends().into_iter().map(move |backend| (step, backend)))
    {
        let device = &backend.device;
        let tensor = |x: &[f64]| -> Tensor<D> { device.tensor(x, grid.shape()) };
        let u = tensor(start.values());
        let moved = device.values(step.apply(u.clone())).unwrap();
        let expected = step.step(&start).unwrap();
        let tolerance = backend.tolerance(1e-14, 1e-6);
        close(&backend, &moved, expected.values(), tolerance, "step");

        let mut energy = MinimizingMovement::new(Arc::new(step.clone()), cells, device).unwrap();
        let previous: Vec<f64> = start.values().iter().map(|u| 0.9 * u).collect();
        energy.set(&tensor(&previous), 1.0).unwrap();
        energy.evaluate(&u).unwrap();
        let product = energy.hessian_vector_product(&tensor(&p)).unwrap();
        let independent = dual::hessian_vector_product(&u, &tensor(&p), |u| {
            let v = step.apply(u.primal.clone());
            let dv = step.derivative(u.primal.clone(), v.clone(), u.tangent.clone());
            let residual = Dual::new(v, dv) - u.clone();
            let motion = u - tensor(&previous).autodiff();
            let square = |x: Dual<D>| (x.clone() * x.linear(|x| step.mass(x))).sum();
            (square(motion) + square(residual)) * 0.5
        });
        let [found, expected] = [product, independent].map(|x| device.values(x).unwrap());
        let tolerance = backend.tolerance(1e-9, 3e-5);
        close(&backend, &found, &expected, tolerance, "product");
    }
}

#[test]
fn finite_element_steps_have_their_derivatives() {
    finite_elements::<2>(20);
    finite_elements::<3>(9);
}

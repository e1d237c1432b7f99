//! Hessian-vector products of the minimizing-movement energy, through Burn and by hand: see [`experiments::products`]. The program
//! `performance` writes the same comparison as a table, with ratios taken within turns.

use divan::Bencher;
use experiments::products::candidates;
use geometry::{Grid, phase_field, shapes::Ball};
use model::{Ratios, Shipped};
use operators::ComputeDevice;

const CELLS: [usize; 3] = [256, 512, 1024];
const SOLID: [usize; 2] = [64, 128];

fn bench<const D: usize>(bencher: Bencher<'_, '_>, cells: usize, name: &str) {
    let device = ComputeDevice::default_compiled().expect("a device");
    let network = Shipped::Paper.find(Ratios {
        dimension: D,
        width: 17,
        eps_over_h: 2.0,
        step_over_h2: 1.0,
    });
    let grid = Grid::<D>::centred(cells, 1.0).expect("a grid");
    let ball = Ball::new([0.0; D], 0.3).expect("a ball");
    let u = phase_field(grid, &ball, 2.0 * grid.spacing()).expect("a phase field");
    let all = candidates(&network.expect("shipped"), &u, &device).expect("equal products");
    let (_, work) = (all.into_iter())
        .find(|(found, _)| *found == name)
        .expect("a candidate");
    bencher.bench_local(work);
}

/// The product through Burn in double precision.
#[divan::bench(args = CELLS)]
fn burn_2d(bencher: Bencher<'_, '_>, cells: usize) {
    bench::<2>(bencher, cells, "ms");
}

/// The product through Burn in single precision.
#[divan::bench(args = CELLS)]
fn burn_single_2d(bencher: Bencher<'_, '_>, cells: usize) {
    bench::<2>(bencher, cells, "single_ms");
}

/// The product by hand.
#[divan::bench(args = CELLS)]
fn by_hand_2d(bencher: Bencher<'_, '_>, cells: usize) {
    bench::<2>(bencher, cells, "by_hand_ms");
}

/// Energy and gradient.
#[divan::bench(args = CELLS)]
fn evaluate_2d(bencher: Bencher<'_, '_>, cells: usize) {
    bench::<2>(bencher, cells, "evaluate_ms");
}

/// The product through Burn in double precision.
#[divan::bench(args = SOLID)]
fn burn_3d(bencher: Bencher<'_, '_>, cells: usize) {
    bench::<3>(bencher, cells, "ms");
}

/// The product by hand.
#[divan::bench(args = SOLID)]
fn by_hand_3d(bencher: Bencher<'_, '_>, cells: usize) {
    bench::<3>(bencher, cells, "by_hand_ms");
}

fn main() {
    divan::main();
}

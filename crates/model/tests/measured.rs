//! What is measured of learned operators against what is known of them.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::{Bricks, Grid, Nodes};
use mean_curvature::{Calibration, Factors, MeanCurvatureStep, PhaseInverse, StepScales, measured};
use model::{Error, MeanCurvatureOperator, Network, Ratios, Shipped};
use operators::ComputeDevice;

fn device() -> ComputeDevice {
    ComputeDevice::default_compiled().unwrap()
}

fn network(shipped: Shipped, dimension: usize) -> Network {
    let ratios = Ratios::of_run(dimension, 17, 1.0, 2.0, 1.0);
    shipped.find(ratios).unwrap()
}

/// An impulse, a wave and a constant in one: the inverse as a matrix would have all of them.
fn mixture(count: usize) -> Vec<f64> {
    let wave = (0..count).map(|i| (0.7 * i as f64).sin() + 0.3);
    let mut values: Vec<f64> = wave.collect();
    values[count / 2] += 20.0;
    values
}

/// The largest relative difference of two inverses applied to that.
fn difference<const D: usize>([found, known]: [&PhaseInverse<D>; 2], shape: [usize; D]) -> f64 {
    let device = device();
    let x: Tensor<D> = device.tensor(&mixture(shape.iter().product()), shape);
    let [found, known] = [found, known].map(|inverse| device.values(inverse(&x)).unwrap());
    let rest: f64 = found.iter().zip(&known).map(|(a, b)| (a - b).powi(2)).sum();
    (rest / known.iter().map(|k| k * k).sum::<f64>()).sqrt()
}

#[test]
fn inverses_in_the_pure_phases_are_the_known_ones() {
    fn check<const D: usize>(shipped: Shipped, cells: usize) {
        let operator = MeanCurvatureOperator::<D>::new(&network(shipped, D), &device()).unwrap();
        let grid = Grid::<D>::new(cells, cells as f64).unwrap();
        let known = operator.phase_inverses(&grid.into(), &device()).unwrap();
        let found = measured::phase_inverses(&operator, &grid.into(), &device()).unwrap();
        for stiffness in [1.0, 100.0] {
            let pair = [&found(stiffness), &known(stiffness)];
            let error = difference(pair, grid.shape());
            // The known one takes the derivative at -1 and 1, the measured one where the operator rests.
            println!("{D}D {shipped:?}, c = {stiffness}: {error:.1e}");
            assert!(error < 2e-3, "{D}D {shipped:?} {stiffness}: {error:e}");
        }
    }
    for shipped in [Shipped::Paper, Shipped::Accurate] {
        check::<2>(shipped, 40);
        check::<3>(shipped, 24);
    }
}

#[test]
fn inverses_on_bricks_are_near_the_known_ones() {
    let network = network(Shipped::Accurate, 3);
    let operator = MeanCurvatureOperator::<3>::new(&network, &device()).unwrap();
    let side = operator.brick_side().unwrap();
    let bricks = Bricks::<3>::new(4 * side, side, |[i, ..]| i < 3, |_| false).unwrap();
    let shape = bricks.shape();
    let grid = Grid::<3>::new(4 * side, 1.0).unwrap();
    let nodes = Nodes::on_bricks(grid, Arc::new(bricks));
    let known = operator.phase_inverses(&nodes, &device()).unwrap();
    let found = measured::phase_inverses(&operator, &nodes, &device()).unwrap();
    for stiffness in [1.0, 10.0, 100.0] {
        let error = difference([&found(stiffness), &known(stiffness)], shape);
        println!("c = {stiffness}: {error:.1e}");
        assert!(error < 0.05, "{stiffness}: {error:e}");
    }
}

#[test]
fn calibrations_are_the_stored_ones() {
    fn check<const D: usize>(shipped: Shipped, cells: usize) {
        let network = network(shipped, D);
        let operator = MeanCurvatureOperator::<D>::new(&network, &device()).unwrap();
        let scales = StepScales {
            cells,
            spacing: 1.0,
            eps: 2.0,
            mcf_step: 1.0,
        };
        let known = network.calibration().unwrap();
        let found = measured::calibrate(&operator, &scales, &device()).unwrap();
        let numbers = |c: &Calibration| {
            let Factors { energy, metric } = c.factors;
            [energy, metric, c.response(), c.displacement, c.alignment]
        };
        let pairs = numbers(&found).into_iter().zip(numbers(&known));
        let errors: Vec<f64> = pairs.map(|(a, b)| a / b - 1.0).collect();
        println!("{D}D {shipped:?}: c, m, response, displacement, alignment off by {errors:?}");
        assert!(errors.iter().all(|e| e.abs() < 1e-3), "{found:?} {known:?}");
        let shift = found.spontaneous_curvature - known.spontaneous_curvature;
        assert!(shift.abs() < 1e-4, "{found:?} {known:?}");
    }
    for shipped in [Shipped::Paper, Shipped::Accurate] {
        check::<2>(shipped, 128);
        check::<3>(shipped, 64);
    }
}

#[test]
fn operators_say_on_what_they_work() {
    let paper = MeanCurvatureOperator::<2>::new(&network(Shipped::Paper, 2), &device()).unwrap();
    assert_eq!(paper.brick_side(), None);
    let bricks = Arc::new(Bricks::<2>::new(64, 16, |_| true, |_| true).unwrap());
    let nodes = Nodes::on_bricks(Grid::new(64, 1.0).unwrap(), bricks);
    let error = paper.on(&nodes).err().unwrap();
    let found = error.downcast_ref::<Arc<Error>>();
    let reason = found.is_some_and(|error| matches!(**error, Error::NotSeparable { .. }));
    assert!(reason, "{error}");

    let accurate = network(Shipped::Accurate, 2);
    let operator = MeanCurvatureOperator::<2>::new(&accurate, &device()).unwrap();
    assert_eq!(operator.brick_side(), Some(16));
    let on_bricks = operator.on(&nodes).unwrap();
    assert_eq!(on_bricks.identity(), operator.identity());
    let bits = |phase_values: [f64; 2]| phase_values.map(f64::to_bits);
    assert_eq!(
        bits(on_bricks.phase_values()),
        bits(operator.phase_values())
    );
    assert_ne!(operator.identity(), paper.identity());
    let small = Grid::<2>::new(12, 1.0).unwrap();
    assert!(operator.on(&small.into()).is_err());
}

//! What is measured of a step against what is known of it.

use std::sync::Arc;

use burn::tensor::{DType, Tensor};
use geometry::{Bricks, Grid, Nodes};
use mean_curvature::{Error, Identity, MeanCurvatureStep, PhaseInverse, StepScales, measured};
use operators::SpectralFilter;

use crate::common::{Explicit, Splitting, device};

fn noise(count: usize, seed: u64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    (0..count)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            2.0 * (state >> 11) as f64 / (1_u64 << 53) as f64 - 1.0
        })
        .collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    let rest: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    dot(&rest, &rest).sqrt()
}

/// The inverse applied to values, in the precision of the device and in single precision.
fn applied<const D: usize>(
    inverse: &PhaseInverse<D>,
    x: &[f64],
    shape: [usize; D],
) -> [Vec<f64>; 2] {
    let device = device();
    let x: Tensor<D> = device.tensor(x, shape);
    let single = inverse(&x.clone().cast(DType::F32));
    assert_eq!(single.dtype(), DType::F32);
    [inverse(&x), single].map(|z| device.values(z).unwrap())
}

#[test]
fn inverses_are_those_of_the_known_symbol() {
    let step = Explicit {
        eps: 3.0,
        mcf_step: 0.2,
        moves: false,
    };
    let grid = Grid::<2>::new(30, 30.0).unwrap();
    let x = noise(grid.len(), 5);
    let inverses = step.phase_inverses(&grid.into(), &device()).unwrap();
    for stiffness in [0.0, 3.0, 400.0] {
        let known = SpectralFilter::from_symbol(&grid.shape(), |angles| {
            1.0 / (1.0 + stiffness * (1.0 - step.symbol(angles)).powi(2))
        });
        let known = known.apply(&x);
        let found = applied(&inverses(stiffness), &x, grid.shape());
        for (found, tolerance) in found.iter().zip([1e-10, 1e-5]) {
            let error = distance(found, &known) / dot(&known, &known).sqrt();
            assert!(error < tolerance, "{stiffness}: {error:e}");
        }
    }
}

#[test]
fn inverses_on_bricks_are_symmetric_positive_and_near_those_of_the_symbol() {
    let (step, device) = (Splitting::<3>::new(2.0, 0.3), device());
    let grid = Grid::<3>::new(48, 48.0).unwrap();
    // A ball of bricks in the negative phase, and the positive one inside.
    let from_centre = |place: [usize; 3]| -> f64 {
        let squares = place.map(|at| (at as f64 - 2.5).powi(2));
        squares.iter().sum::<f64>().sqrt()
    };
    let active = |place| (1.0..3.0).contains(&from_centre(place));
    let bricks = Bricks::<3>::new(48, 8, active, |place| from_centre(place) < 1.0).unwrap();
    let (shape, count) = (bricks.shape(), bricks.len());
    let bricks = Arc::new(bricks);
    let nodes = Nodes::on_bricks(grid, bricks.clone());
    // The step and what it is on bricks measure the same.
    let on_bricks = step.on(&nodes).unwrap();
    let inverses = [
        step.phase_inverses(&nodes, &device).unwrap(),
        on_bricks.phase_inverses(&nodes, &device).unwrap(),
    ];
    let (x, y) = (noise(count, 3), noise(count, 4));
    let stiffness = 8.0;
    let [of_step, of_bricks] = inverses.map(|inverses| inverses(stiffness));
    let [z, single] = applied(&of_step, &x, shape);
    assert_eq!(z, applied(&of_bricks, &x, shape)[0]);
    assert!(distance(&z, &single) < 1e-5 * dot(&z, &z).sqrt());
    // Passes over the bricks are cut at their edge.
    let asymmetry = dot(&z, &y) - dot(&x, &applied(&of_step, &y, shape)[0]);
    let scale = (dot(&z, &z) * dot(&y, &y)).sqrt();
    assert!(asymmetry.abs() < 1e-2 * scale, "{:e}", asymmetry / scale);
    assert!(dot(&x, &z) > 0.0);
    // Of the exact inverse it is off by no more than what a polynomial of degree one leaves.
    let exact = SpectralFilter::from_symbol(&grid.shape(), |angles| {
        1.0 / (1.0 + stiffness * (1.0 - step.symbol(angles)).powi(2))
    });
    let exact = bricks.gather(&exact.apply(&bricks.scatter(&x, [0.0; 2])));
    let error = distance(&z, &exact) / dot(&exact, &exact).sqrt();
    assert!(error < 0.1, "{error}");
}

#[test]
fn steps_that_do_not_say_how_are_refused_on_bricks_by_their_name() {
    struct Plain;
    impl MeanCurvatureStep<2> for Plain {
        fn apply(&self, u: Tensor<2>) -> Tensor<2> {
            u * 0.5
        }
        fn identity(&self) -> Identity {
            Identity::new("halving", serde_json::Value::Null)
        }
    }
    let bricks = Arc::new(Bricks::<2>::new(32, 8, |_| true, |_| true).unwrap());
    let nodes = Nodes::on_bricks(Grid::new(32, 1.0).unwrap(), bricks);
    let error = Plain.on(&nodes).err().unwrap();
    let found = error.downcast_ref::<Error>();
    assert!(
        matches!(found, Some(Error::WholeGridOnly { .. })),
        "{error}"
    );
    assert!(error.to_string().starts_with("halving works"), "{error}");
    assert!(Plain.phase_inverses(&nodes, &device()).is_err());
}

#[test]
fn responses_that_are_not_finite_are_refused_by_the_name_of_the_step() {
    struct Logarithm;
    impl MeanCurvatureStep<2> for Logarithm {
        fn apply(&self, u: Tensor<2>) -> Tensor<2> {
            u.log()
        }
        fn identity(&self) -> Identity {
            Identity::new("logarithm", serde_json::Value::Null)
        }
        fn phase_values(&self) -> [f64; 2] {
            [0.0, 1.0]
        }
    }
    let grid = Grid::<2>::new(8, 1.0).unwrap();
    let error = Logarithm
        .phase_inverses(&grid.into(), &device())
        .err()
        .unwrap();
    let found = error.downcast_ref::<Error>();
    assert!(matches!(found, Some(Error::NoResponse { .. })), "{error}");
    assert!(error.to_string().starts_with("logarithm"), "{error}");
}

/// The derivative of an explicit step is symmetric and its response to bending is `-tautilde w'`, but for what the grid adds.
#[test]
fn an_explicit_step_has_the_factors_of_its_profile() {
    fn check<const D: usize>(cells: usize, moves: bool) {
        let (eps, mcf_step) = (if D == 2 { 2.5 } else { 1.5 }, 0.15);
        let step = Explicit {
            eps,
            mcf_step,
            moves,
        };
        let scales = StepScales {
            cells,
            spacing: 1.0,
            eps,
            mcf_step,
        };
        let found = MeanCurvatureStep::<D>::calibrate(&step, &scales, &device()).unwrap();
        let ratio = found.factors.speed() / found.displacement.powi(2);
        assert!((found.alignment - 1.0).abs() < 1e-4, "{found:?}");
        assert!((ratio - 1.0).abs() < 3e-3, "{found:?}");
        assert!((found.displacement - 1.0).abs() < 3e-2, "{found:?}");
        assert!((found.factors.energy - 1.0).abs() < 0.1, "{found:?}");
        assert!(found.spontaneous_curvature.abs() < 1e-4, "{found:?}");
    }
    check::<2>(132, false);
    check::<2>(300, true);
    check::<3>(300, true);
}

#[test]
fn boxes_without_room_for_two_interfaces_are_refused() {
    let step = Explicit {
        eps: 2.0,
        mcf_step: 0.15,
        moves: false,
    };
    let scales = StepScales {
        cells: 24,
        spacing: 1.0,
        eps: 2.0,
        mcf_step: 0.15,
    };
    let error = MeanCurvatureStep::<2>::calibrate(&step, &scales, &device()).unwrap_err();
    let found = error.downcast_ref::<Error>();
    let least = matches!(found, Some(Error::BoxTooSmall { least: 32, .. }));
    assert!(least, "{error}");
}

#[test]
fn steps_without_an_interface_at_rest_are_refused() {
    // Smoothing alone: no profile stays.
    let step = Splitting::<2>::new(2.0, 0.0);
    let scales = StepScales {
        cells: 64,
        spacing: 1.0,
        eps: 2.0,
        mcf_step: 1.0,
    };
    let error = measured::calibrate(&step, &scales, &device()).unwrap_err();
    assert!(matches!(error, Error::Calibration { .. }), "{error}");
}

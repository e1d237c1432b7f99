//! Calibrated flows against exact solutions, and the factors against what the scheme does.

use std::f64::consts::PI;

use crate::common::flow::Flow;
use crate::common::{accurate, ball, device, network, params, ratios};
use geometry::measure::{l2_distance, zero_set_volume};
use geometry::{Field, Grid, exact};
use mean_curvature::Calibration;
use model::{Network, Shipped};
use solver::{Error, Factors, FlowParams};

/// A radius of the reference experiment, `2^-4 pi`.
const RADIUS: f64 = 0.19635;
/// Its time step, `h^2` on the grid of `n = 128`.
const TAU: f64 = 6.103_515_625e-5;
const EPS: f64 = 1.0 / 64.0;

/// A box for a disc, `n = 128`.
fn grid(radius: f64) -> Grid<2> {
    let half = ((radius + 0.25) * 128.0).ceil();
    Grid::centred(2 * half as usize, half / 64.0).unwrap()
}

fn flow(network: &Network, start: &Field<2>, calibration: Factors) -> Flow<2> {
    let params = FlowParams {
        calibration,
        ..params(start.grid())
    };
    Flow::with_network(network, start, params, &device()).unwrap()
}

/// L2 errors after 1, 8, 16, 32 and 64 steps from a disc (`phase = 1`) or its complement (`-1`).
fn errors(network: &Network, radius: f64, phase: f64, calibration: Factors) -> Vec<f64> {
    let last = exact::willmore_radius(radius, 64.0 * TAU, 2);
    let grid = grid(last);
    let disc = |radius| ball(grid, radius).map(|u| phase * u);
    let mut flow = flow(network, &disc(radius), calibration);
    let mut errors = Vec::new();
    for step in 1..=64 {
        flow.advance(TAU).unwrap();
        if [1, 8, 16, 32, 64].contains(&step) {
            let exact = disc(exact::willmore_radius(radius, flow.time(), 2));
            errors.push(l2_distance(&flow.field().unwrap(), &exact).unwrap());
        }
    }
    errors
}

#[test]
fn the_same_network_flows_along_the_exact_solution_once_calibrated() {
    let network = network();
    let factors = network.calibration().unwrap().factors;
    let bounds = [0.0012, 0.0019, 0.0029, 0.0030, 0.0035];
    let plain = errors(&network, RADIUS, 1.0, Factors::PAPER);
    assert!(plain[4] > 0.04, "{plain:?}");
    for phase in [1.0, -1.0] {
        for network in [&network, &network.odd_part()] {
            let found = errors(network, RADIUS, phase, factors);
            println!("r = {RADIUS}, phase {phase}: {found:.5?}, without calibration {plain:.5?}");
            for (error, bound) in found.iter().zip(bounds) {
                assert!(*error <= bound, "{phase}: {found:?}");
            }
        }
    }
}

#[test]
fn the_accurate_operator_keeps_to_a_circle_within_twelve_ten_thousandths() {
    let network = accurate(2);
    let factors = network.calibration().unwrap().factors;
    for phase in [1.0, -1.0] {
        let found = errors(&network, RADIUS, phase, factors);
        println!("r = {RADIUS}, phase {phase}: {found:.5?}");
        // Steps 8, 16, 32 and 64; nested finite elements have .0053 .0087 .0138 .0201.
        assert!(found[1..].iter().all(|e| *e <= 0.0012), "{found:?}");
    }
}

#[test]
fn calibrated_circles_of_the_convergence_test_stay_within_six_thousandths() {
    let network = network();
    let factors = network.calibration().unwrap().factors;
    // The smallest, one in the middle, and the largest.
    for index in [0, 15, 29] {
        let radius = 0.05 * PI + 0.15 * PI * f64::from(index) / 30.0;
        let found = errors(&network.odd_part(), radius, 1.0, factors);
        println!("r = {radius:.4}: {found:.5?}");
        assert!(found[4] <= 0.006, "{radius}: {found:?}");
    }
}

/// The area of a disc (`phase = 1`) or of the hole that its complement leaves (`-1`).
fn area(flow: &Flow<2>, phase: f64) -> f64 {
    let u = flow.field().unwrap();
    let inside = zero_set_volume(&u);
    if phase > 0.0 {
        inside
    } else {
        u.grid().side().powi(2) - inside
    }
}

/// Willmore energy over `pi / R` of a relaxed disc, with its radius, after a step so small that it hardly moves.
fn energy(network: &Network, radius: f64, phase: f64, calibration: Factors) -> (f64, f64) {
    let grid = grid(radius);
    let start = ball(grid, radius).map(|u| phase * u);
    let mut flow = flow(network, &start, calibration);
    let record = flow.advance(TAU / 8.0).unwrap();
    let radius = (area(&flow, phase) / PI).sqrt();
    (record.willmore_energy * radius / PI, radius)
}

#[test]
fn reported_energies_are_those_of_the_circles_for_both_phases() {
    let odd = network().odd_part();
    let factors = network().calibration().unwrap().factors;
    for radius in [0.15, 0.2, 0.3, 0.45, 0.6] {
        for phase in [1.0, -1.0] {
            let (ratio, _) = energy(&odd, radius, phase, factors);
            assert!((ratio - 1.0).abs() < 0.01, "{radius} {phase}: {ratio}");
        }
    }
}

#[test]
fn energies_without_calibration_are_as_predicted_spontaneous_curvature_included() {
    let network = network();
    let Calibration {
        factors,
        spontaneous_curvature,
        ..
    } = network.calibration().unwrap();
    for (radius, tolerance) in [(0.2, 0.005), (0.4, 0.0015), (0.6, 0.001)] {
        for phase in [1.0, -1.0] {
            let (measured, radius) = energy(&network, radius, phase, Factors::PAPER);
            let flat = phase * spontaneous_curvature / EPS;
            let predicted = factors.energy * (1.0 - flat * radius).powi(2);
            assert!(
                (measured / predicted - 1.0).abs() < tolerance,
                "{radius} {phase}: {measured} {predicted}"
            );
        }
    }
}

#[test]
fn circles_without_calibration_move_at_the_predicted_speed() {
    let network = network();
    let factors = network.calibration().unwrap().factors;
    for radius in [0.3, 0.5] {
        for phase in [1.0, -1.0] {
            // R^4 grows by 2 c/m t. Steps that are small, and long enough to be measured.
            let tau = TAU * (radius / 0.2_f64).powi(4);
            let start = ball(grid(radius + 0.1), radius).map(|u| phase * u);
            let mut flow = flow(&network, &start, Factors::PAPER);
            let quartic = |flow: &Flow<2>| (area(flow, phase) / PI).powi(2);
            flow.advance(tau).unwrap();
            let before = quartic(&flow);
            for _ in 0..4 {
                flow.advance(tau / 4.0).unwrap();
            }
            let speed = (quartic(&flow) - before) / (2.0 * tau);
            println!(
                "R = {radius}, phase {phase}: speed {speed:.4}, predicted {:.4}",
                factors.speed()
            );
            assert!(
                (speed / factors.speed() - 1.0).abs() < 0.02,
                "{radius} {phase}: {speed} {factors:?}"
            );
        }
    }
}

#[test]
fn energies_of_spheres_are_as_predicted() {
    let network = Shipped::Paper.find(ratios(3)).unwrap();
    let calibration = network.calibration().unwrap();
    let grid = Grid::<3>::centred(64, 1.0).unwrap();
    for (calibration, expected) in [
        (Factors::PAPER, calibration.factors.energy),
        (calibration.factors, 1.0),
    ] {
        let params = FlowParams {
            calibration,
            ..params(&grid)
        };
        let start = ball(grid, 0.34);
        let odd = network.odd_part();
        let mut flow = Flow::with_network(&odd, &start, params, &device()).unwrap();
        let record = flow.advance(params.mcf_step / 64.0).unwrap();
        let ratio = record.willmore_energy / (8.0 * PI);
        println!("sphere: {ratio:.4}, predicted {expected:.4}");
        assert!((ratio / expected - 1.0).abs() < 0.02, "{ratio} {expected}");
    }
}

#[test]
fn factors_enter_the_record_and_bad_ones_are_refused() {
    let start = ball(grid(RADIUS), RADIUS);
    let factors = Factors {
        energy: 0.9,
        metric: 1.1,
    };
    let mut calibrated = flow(&network(), &start, factors);
    let record = calibrated.advance(TAU).unwrap();
    // The same minimizer as with another time step, up to the tolerance, and the record in other units.
    let tau = TAU / factors.speed();
    let mut papers = flow(&network(), &start, Factors::PAPER);
    let plain = papers.advance(tau).unwrap();
    let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-3;
    assert!(close(
        record.willmore_energy,
        plain.willmore_energy / factors.energy
    ));
    assert!(close(record.energy, plain.energy / factors.metric));
    let [area, plain_area] = [&calibrated, &papers].map(|f| zero_set_volume(&f.field().unwrap()));
    assert!(close(area, plain_area));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        for (energy, metric) in [(bad, 1.0), (1.0, bad)] {
            let params = FlowParams {
                calibration: Factors { energy, metric },
                ..params(start.grid())
            };
            let flow = Flow::with_network(&network(), &start, params, &device());
            let error = flow.err().expect("a bad factor");
            assert!(matches!(error, Error::Geometry(_)), "{error}");
            assert!(error.to_string().contains("calibration."), "{error}");
        }
    }
}

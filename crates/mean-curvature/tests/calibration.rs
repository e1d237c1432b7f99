//! Calibrations against steps on planes whose factors are known.

use faer::{Col, Mat};
use mean_curvature::calibration::{PlanarScales, solve};
use mean_curvature::{Error, PlanarStep, calibrate};

/// An explicit step of the Allen-Cahn equation along an axis, `u + t (u'' - Psi'(u) / (2 eps^2))`, with the mobility and the
/// forcing of choice. Its derivative is symmetric, so that `psi = w'`, and it takes the curvature `force / mobility` for flat.
#[derive(Clone, Copy)]
struct Explicit {
    eps: f64,
    mobility: f64,
    force: f64,
}

const TIME_STEP: f64 = 0.1;

impl PlanarStep for Explicit {
    fn scales(&self) -> PlanarScales {
        PlanarScales {
            eps: self.eps,
            mcf_step: TIME_STEP,
            spacing: 1.0,
        }
    }

    fn linearize(&self, w: &Col<f64>) -> Result<(Col<f64>, Mat<f64>), Error> {
        let n = w.nrows();
        let t = self.mobility * TIME_STEP;
        let reaction = 1.125 / (self.eps * self.eps);
        let at = |i: usize| w[i.min(n - 1)];
        let value = Col::from_fn(n, |i| {
            let second = at(i + 1) - 2.0 * at(i) + at(i.saturating_sub(1));
            let force = self.force * TIME_STEP * 0.75 / self.eps * (1.0 - at(i).powi(2));
            at(i) + t * (second + reaction * (at(i) - at(i).powi(3))) + force
        });
        let mut jacobian = Mat::zeros(n, n);
        for i in 0..n {
            let force = -self.force * TIME_STEP * 1.5 / self.eps * w[i];
            jacobian[(i, i)] += 1.0 - 2.0 * t + t * reaction * (1.0 - 3.0 * w[i] * w[i]) + force;
            jacobian[(i, i.saturating_sub(1))] += t;
            jacobian[(i, (i + 1).min(n - 1))] += t;
        }
        Ok((value, jacobian))
    }

    /// The Laplacian of a bent interface is `w'' - kappa w'`.
    fn bending(&self, _: &Col<f64>, slope: &Col<f64>) -> Col<f64> {
        Col::from_fn(slope.nrows(), |i| -self.mobility * TIME_STEP * slope[i])
    }
}

fn explicit(eps: f64) -> Explicit {
    Explicit {
        eps,
        mobility: 1.0,
        force: 0.0,
    }
}

#[test]
fn a_symmetric_step_has_the_factors_of_its_profile_and_they_converge_to_one() {
    let mut errors = Vec::new();
    for eps in [2.0, 4.0, 8.0] {
        let interface = solve(&explicit(eps), 0.3).unwrap();
        assert!((interface.alignment - 1.0).abs() < 1e-9, "{interface:?}");
        assert!((interface.displacement - 1.0).abs() < 1e-9, "{interface:?}");
        assert!((interface.energy / interface.metric - 1.0).abs() < 1e-9);
        // Up to what the grid holds on to.
        assert!(
            interface.spontaneous_curvature.abs() < 1e-5,
            "{interface:?}"
        );
        assert!((interface.eigenvalue - 1.0).abs() < 1e-6);
        errors.push((interface.energy - 1.0).abs());
    }
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.3, "{errors:?}");
    }
}

#[test]
fn a_step_that_is_too_fast_or_forced_is_told_apart() {
    let base = solve(&explicit(4.0), 0.3).unwrap();
    let mut fast = explicit(4.0);
    fast.mobility = 1.1;
    let found = solve(&fast, 0.3).unwrap();
    assert!(
        (found.energy / base.energy - 1.21).abs() < 1e-8,
        "{found:?}"
    );
    assert!((found.metric - base.metric).abs() < 1e-9);
    // An interface is at rest where kappa = force: u = 1 gains, so the force bends outwards.
    let mut forced = explicit(4.0);
    forced.force = 1e-3;
    let found = solve(&forced, 0.3).unwrap();
    let expected = 4.0 * 1e-3;
    assert!(
        (found.spontaneous_curvature / expected - 1.0).abs() < 0.02,
        "{found:?}"
    );
    assert!((found.energy / base.energy - 1.0).abs() < 1e-4, "{found:?}");
}

#[test]
fn steps_without_an_interface_at_rest_are_refused_with_the_eigenvalue() {
    // Far too explicit: the profile is unstable, no Newton iteration helps.
    let mut broken = explicit(0.3);
    broken.mobility = -4.0;
    broken.force = 9.0;
    match calibrate(&[(&[1, 0], 1.0)], |_| broken) {
        Err(Error::Calibration { reason, .. }) => assert!(!reason.is_empty()),
        other => panic!("{other:?}"),
    }
    for eps in [f64::NAN, 1e9] {
        let error = solve(&explicit(eps), 0.3).unwrap_err();
        assert!(matches!(error, Error::Calibration { .. }), "{error}");
    }
}

//! The kernel of a direct step.

use std::array::from_fn;
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

use crate::profile::Profile;

/// Times of the heat kernels over `sqrt(tau / STRENGTH)`: near each other, so that the kernel is narrow.
const TIMES: [f64; 4] = [0.75, 0.9, 1.08, 1.3];
/// With it the multipliers of waves are in (-0.89, 1]; with 0.9 steps are unstable.
const STRENGTH: f64 = 0.83;

/// A heat kernel `exp(-r^2 / 4t)` in the sum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeatKernel {
    /// `t`, the square of a length.
    pub time: f64,
    /// Its weight `b` in the multiplier of waves.
    pub weight: f64,
    /// `sqrt(4 pi t) / P`, which makes up for the profile: `P` is its mean under the kernel.
    height: f64,
    /// Width of the profile.
    width: f64,
    /// Second moment of the profile under the kernel, over its mean.
    variance: f64,
}

impl HeatKernel {
    /// Its spectrum `sqrt(4 pi t) / P(t) exp(-t |k|^2)` at the squared wave number, without its weight.
    pub fn symbol(&self, square: f64) -> f64 {
        self.height * (-self.time * square).exp()
    }

    /// What its convolution with the profile is at a distance from a flat interface, and the derivative of that, which is 2 at the interface.
    pub fn flat(&self, distance: f64) -> [f64; 2] {
        let square = self.width * self.width;
        let variance = square + 2.0 * self.time;
        let x = distance / variance.sqrt();
        let density = (-0.5 * x * x).exp() / (TAU * variance).sqrt();
        let value = libm::erf(x * FRAC_1_SQRT_2) + square * distance / variance * density;
        let slope = (2.0 + square / variance * (1.0 - x * x)) * density;
        [self.height * value, self.height * slope]
    }
}

/// The kernel `K` of a step of size `tau`, by its spectrum `sum_i b_i sqrt(4 pi t_i) / P(t_i) exp(-t_i |k|^2)`, which is the same in the plane and in
/// space.
///
/// With `sum b = 1`, `sum b t = 0`, `sum b t^2 = -2 tau` and `sum b t^3 = 0`, the zero level of `K * q(s)` is that of `s`, displaced by `tau` times the
/// velocity of Willmore flow, up to terms of second order in `tau`. See `docs/direct.md`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel {
    tau: f64,
    parts: [HeatKernel; 4],
}

impl Kernel {
    /// The kernel for a grid of spacing `h`, at which the profile has its width.
    pub fn new(spacing: f64, tau: f64) -> Self {
        let (profile, scale) = (Profile { width: spacing }, (tau / STRENGTH).sqrt());
        let part = |i: usize| {
            let time = TIMES[i] * scale;
            let [mean, second] = profile.moments(time);
            HeatKernel {
                time,
                weight: weight(i),
                width: spacing,
                height: (4.0 * PI * time).sqrt() / mean,
                variance: second / mean,
            }
        };
        Self {
            tau,
            parts: from_fn(part),
        }
    }

    /// The spectrum at the squared wave number `|k|^2`.
    pub fn symbol(&self, square: f64) -> f64 {
        let part = |part: &HeatKernel| part.weight * part.height * (-part.time * square).exp();
        self.parts.iter().map(part).sum()
    }

    /// The factor of a small wave of wave number `k` on a flat interface in one step; that of Willmore flow is `exp(-tau k^4)`.
    pub fn multiplier(&self, k: f64) -> f64 {
        let part = |part: &HeatKernel| part.weight * (-part.time * k * k).exp();
        self.parts.iter().map(part).sum()
    }

    /// By which part the nonlinear terms of the velocity, `kappa^3 / 2` in the plane and `H (k1 - k2)^2 / 2` in space with the sum `H` of the principal curvatures, come out too large:
    /// `-sum b t v / 4 tau` with the second moments `v` of the profile.
    pub fn excess(&self) -> f64 {
        let part = |part: &HeatKernel| part.weight * part.time * part.variance;
        -self.parts.iter().map(part).sum::<f64>() / (4.0 * self.tau)
    }

    /// The heat kernels, by increasing time.
    pub fn heat_kernels(&self) -> &[HeatKernel; 4] {
        &self.parts
    }
}

/// `b_i`: the value of the functional `1, t, t^2, t^3 -> 1, 0, -2 STRENGTH, 0` at the polynomial that is one at the time of number `i` and zero at the others.
fn weight(i: usize) -> f64 {
    let (mut product, mut sum, mut gaps) = (1.0, 0.0, 1.0);
    for other in (0..4).filter(|j| *j != i).map(|j| TIMES[j]) {
        product *= other;
        sum += other;
        gaps *= TIMES[i] - other;
    }
    (2.0 * STRENGTH * sum - product) / gaps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weights_have_their_moments() {
        let kernel = Kernel::new(0.01, 2e-5);
        for (power, expected) in [1.0, 0.0, -4e-5, 0.0].into_iter().enumerate() {
            let part = |part: &HeatKernel| part.weight * part.time.powi(power as i32);
            let moment: f64 = kernel.parts.iter().map(part).sum();
            let scale = 2e-5_f64.powf(0.5 * power as f64);
            assert!(
                (moment - expected).abs() < 1e-10 * scale,
                "{power}: {moment}"
            );
        }
    }

    /// By quadrature of the profile on a line.
    #[test]
    fn flat_interfaces_are_as_the_convolution_has_them() {
        let (profile, step) = (Profile { width: 0.1 }, 1e-3);
        for kernel in Kernel::new(0.1, 2e-3).heat_kernels() {
            let variance = 2.0 * kernel.time;
            let convolved = |x: f64| -> f64 {
                let part = |k: i32| {
                    let y = f64::from(k) * step;
                    profile.of(x - y) * (-0.5 * y * y / variance).exp()
                };
                let sum: f64 = (-4000..=4000).map(part).sum();
                kernel.height * step * sum / (TAU * variance).sqrt()
            };
            for x in [-0.7, 0.0, 0.1, 0.3] {
                let [value, slope] = kernel.flat(x);
                assert!((value - convolved(x)).abs() < 1e-6, "{x}: {value}");
                let difference = (convolved(x + step) - convolved(x - step)) / (2.0 * step);
                assert!((slope - difference).abs() < 1e-4, "{x}: {slope}");
            }
            assert!((kernel.flat(0.0)[1] - 2.0).abs() < 1e-12);
        }
    }

    #[test]
    fn waves_are_damped_as_the_flow_damps_them() {
        let tau: f64 = 3e-6;
        let kernel = Kernel::new(0.01, tau);
        let mut least = 1.0_f64;
        for step in 0..4000 {
            let k = f64::from(step) * 0.002 * tau.powf(-0.25);
            let multiplier = kernel.multiplier(k);
            assert!(multiplier.abs() <= 1.0, "{k}: {multiplier}");
            least = least.min(multiplier);
            let passed = tau * k.powi(4);
            let error = multiplier - (-passed).exp();
            if passed < 0.01 {
                assert!(
                    error.abs() < 0.05 * passed * passed + 1e-11,
                    "{passed}: {error}"
                );
            }
        }
        assert!(least > -0.89, "{least}");
    }

    /// Why the runs of whole and of half steps go side by side.
    #[test]
    fn extrapolation_in_each_step_would_be_unstable() {
        let tau: f64 = 3e-6;
        let [whole, half] = [tau, 0.5 * tau].map(|tau| Kernel::new(0.01, tau));
        let extrapolated = |step: u32| {
            let k = f64::from(step) * 0.002 * tau.powf(-0.25);
            2.0 * half.multiplier(k).powi(2) - whole.multiplier(k)
        };
        let largest = (0..4000).map(extrapolated).fold(0.0, f64::max);
        assert!((2.0..2.3).contains(&largest), "{largest}");
    }
}

//! The profile that a direct step convolves.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// The profile `q(s) = erf(x / sqrt 2) + x / sqrt(2 pi) exp(-x^2 / 2)` with `x = s / width`, from -1 inside to 1 outside: the sign function under the
/// kernel `p = (3/2 - x^2/2) exp(-x^2/2) / (width sqrt(2 pi))`, whose second moment vanishes.
///
/// A phase field is a mixture of the parallel surfaces of its zero level. Those outside of a surface move at other rates than those inside, and with a
/// positive density the mean of the rates is off by the second moment. This profile has none, so that results do not depend on its width, which is
/// one spacing of the grid. Its spectrum is below `1e-7` at the frequencies that a grid takes for constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Profile {
    pub(crate) width: f64,
}

impl Profile {
    /// Distances beyond which the profile is -1 or 1 to `1e-8`, in widths.
    pub(crate) const PURE: f64 = 6.5;

    pub(crate) fn of(self, distance: f64) -> f64 {
        let x = distance / self.width;
        if x.abs() > 9.0 {
            return x.signum();
        }
        libm::erf(x * FRAC_1_SQRT_2) + x / TAU.sqrt() * (-0.5 * x * x).exp()
    }

    /// `int p(c) exp(-c^2 / 4t) dc`, and the same with `c^2`.
    pub(crate) fn moments(self, t: f64) -> [f64; 2] {
        let square = self.width * self.width;
        let y = square / (2.0 * t);
        [
            (1.0 + 1.5 * y) * (1.0 + y).powf(-1.5),
            1.5 * square * y * (1.0 + y).powf(-2.5),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The kernel from the profile by differences, and its moments by quadrature.
    #[test]
    fn moments_are_those_of_the_derivative_of_the_profile() {
        let profile = Profile { width: 0.3 };
        let step = 1e-3;
        let density = |c: f64| (profile.of(c + step) - profile.of(c - step)) / (4.0 * step);
        for t in [0.02, 0.3, 7.0] {
            let mut sums = [0.0; 2];
            for k in -4000..=4000 {
                let c = f64::from(k) * step;
                let part = step * density(c) * (-c * c / (4.0 * t)).exp();
                sums[0] += part;
                sums[1] += part * c * c;
            }
            for (sum, exact) in sums.into_iter().zip(profile.moments(t)) {
                assert!((sum - exact).abs() < 1e-5, "{t}: {sum} {exact}");
            }
        }
        let [_, second] = profile.moments(1e9);
        assert!(second < 1e-10, "{second}");
        assert!((profile.of(Profile::PURE * 0.3) - 1.0).abs() < 1e-8);
    }
}

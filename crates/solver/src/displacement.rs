//! Phase fields as displacements of each other.
//!
//! Where the profile is `tanh(3 d / (4 eps))`, `atanh u` is the distance `d` in units of `4 eps / 3`, and the difference of two
//! phase fields in that variable is the displacement of the interface between them.

use std::sync::LazyLock;

use geometry::Stored;

/// Values nearer to the pure phases than this are taken for it: behind small radii phase fields overshoot them, and there a
/// displacement means nothing.
const PURE: f64 = 1e-3;

/// The depths of both pure phases, which most nodes have.
static PURE_DEPTHS: LazyLock<[f64; 2]> = LazyLock::new(|| [PURE - 1.0, 1.0 - PURE].map(f64::atanh));

fn clipped(u: f64) -> f64 {
    u.clamp(PURE - 1.0, 1.0 - PURE)
}

/// `atanh u`, the distance inside the interface in units of `4 eps / 3`.
pub(crate) fn depth(u: f64) -> f64 {
    if u.abs() >= 1.0 - PURE {
        return PURE_DEPTHS[usize::from(u > 0.0)];
    }
    clipped(u).atanh()
}

/// `atanh u - atanh v`, in units of `4 eps / 3`; zero in the pure phases.
pub(crate) fn displacement(u: f64, v: f64) -> f64 {
    depth(u) - depth(v)
}

/// `u` displaced by `y`, `tanh(atanh u + y)`. What `u` is beyond the pure phases stays.
pub(crate) fn displaced(u: f64, y: f64) -> f64 {
    let (inner, shift) = (clipped(u), y.tanh());
    (inner + shift) / (1.0 + inner * shift) + (u - inner)
}

/// The weight of a place in averages over the interface, `(1 - u^2)^2`.
pub(crate) fn on_interface(u: f64) -> f64 {
    (1.0 - u * u).max(0.0).powi(2)
}

/// One on the interface and zero in the pure phases, beyond `(1 - u^2)^2` of some `10^-3`.
pub(crate) fn window(u: f64) -> f64 {
    const EDGE: f64 = 1e-3;
    let weight = on_interface(u);
    weight / (weight + EDGE)
}

/// The largest distance from the interface of `u` to that of `other` in interface widths, but for a fiftieth of it, which may vanish: `4/3 |atanh v|`
/// with the values `v` of `other` where `u` changes its sign, about five where there is no interface nearby. Zero if `u` has none.
pub fn widths_between<const D: usize>(u: &Stored<D>, other: &Stored<D>) -> f64 {
    const VANISHING: f64 = 0.02;
    let mut depths = other.where_zero(u);
    for value in &mut depths {
        *value = depth(*value).abs();
    }
    if depths.is_empty() {
        return 0.0;
    }
    let vanishing = (VANISHING * depths.len() as f64) as usize;
    let (_, depth, _) = depths.select_nth_unstable_by(vanishing, |a, b| b.total_cmp(a));
    4.0 * *depth / 3.0
}

/// The factor by which the `L2` metric is too weak for a displacement `d` to a surface of mean curvature `kappa`; `bend` is `kappa d`.
///
/// The metric measures in a straight line: the squared distance is `d^2` on the surface half-way, where areas are `1 - kappa d / 2` times those of
/// the displaced one, and its derivative there is `(1 - kappa d / 4) d` for each area.
pub(crate) fn curvature_weight(bend: f64) -> f64 {
    /// Where the curvature changes within the displacement, at corners, it says nothing.
    const MOST: f64 = 0.5;
    1.0 / (1.0 - 0.25 * bend.clamp(-MOST, MOST))
}

/// The factor by which the `L2` metric is too weak for a motion that displaces the interface by `y`, `1 / rho(y)`.
///
/// For `tanh` profiles the squared distance is `eps |q(.) - q(. - d)|^2 = (3 / y^2) (y coth y - 1) d^2` with `y = 3 d / (4 eps)`, so that the
/// force of the motion is `rho(y) = 3 / (2 y) (coth y - y / sinh^2 y) = 1 - 2 y^2 / 15 + ...` times that of short motions.
pub(crate) fn metric_weight(y: f64) -> f64 {
    /// Beyond this the profiles hardly overlap.
    const FAR: f64 = 4.0;
    /// Below this the series is exact to rounding.
    const NEAR: f64 = 1e-3;
    let y = y.abs().min(FAR);
    if y < NEAR {
        return 1.0 + 2.0 / 15.0 * y * y;
    }
    let rho = 1.5 / y * (y.tanh().recip() - y / y.sinh().powi(2));
    rho.recip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_displaced_into_itself() {
        for (place, shift) in [(0.3, 0.5), (-1.2, 0.9), (2.0, -1.5), (0.0, 2.0)] {
            let (u, v) = (f64::tanh(place), f64::tanh(place + shift));
            assert!((displaced(u, shift) - v).abs() < 1e-14);
            assert!((displacement(v, u) - shift).abs() < 1e-13);
        }
    }

    #[test]
    fn depths_end_with_those_of_the_pure_phases() {
        for u in [-2.0, -1.0, PURE - 1.0, -0.9, 0.0, 0.9, 1.0 - PURE, 1.0, 1.1] {
            assert!(depth(u).total_cmp(&clipped(u).atanh()).is_eq(), "{u}");
        }
        assert!(depth(f64::NAN).is_nan());
    }

    #[test]
    fn overshoots_are_no_interface() {
        assert!(displacement(1.03, 0.9999).abs() < 1e-15);
        assert!((displaced(1.03, 0.5) - 1.03).abs() < 1e-3);
        assert!(on_interface(1.03).abs() < 1e-15);
    }

    /// Against the metric itself, by quadrature: the force is half the derivative of the squared distance over the distance.
    #[test]
    fn the_weight_makes_up_for_the_metric() {
        let squared = |y: f64| {
            let q = |x: f64| x.tanh();
            let cells = (-30_000..30_000).map(|i| (f64::from(i) + 0.5) * 1e-3);
            cells.map(|x| (q(x) - q(x - y)).powi(2)).sum::<f64>() * 1e-3
        };
        // For short motions the squared distance is y^2 times the integral of the squared derivative, 4/3.
        for y in [0.05, 0.4, 1.3, 3.0] {
            let step = 1e-4;
            let force = (squared(y + step) - squared(y - step)) / (2.0 * step);
            let rho = force / (2.0 * y * 4.0 / 3.0);
            assert!((metric_weight(y) * rho - 1.0).abs() < 1e-5, "{y}: {rho}");
        }
        let (below, above) = (metric_weight(0.999_999e-3), metric_weight(1.000_001e-3));
        assert!((below - above).abs() < 1e-9);
        assert!((metric_weight(-1.3) - metric_weight(1.3)).abs() < 1e-15);
    }
}

//! Fixed low-discrepancy samples: nothing depends on time, threads or a seed.

use glam::DVec3;

/// Term `k` of the R2 sequence (M. Roberts: The unreasonable effectiveness of quasirandom
/// sequences, 2018).
pub(crate) fn r2(k: usize) -> [f64; 2] {
    /// Powers of the reciprocal of the plastic number.
    const STEPS: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_3];
    STEPS.map(|step| (0.5 + k as f64 * step).fract())
}

/// From the unit square to the unit disc, preserving areas and neighbourhoods (P. Shirley,
/// K. Chiu: A low distortion map between disk and square, 1997).
pub(crate) fn disc([u, v]: [f64; 2]) -> [f64; 2] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let quarter = std::f64::consts::FRAC_PI_4;
    let (radius, angle) = if a == 0.0 && b == 0.0 {
        (0.0, 0.0)
    } else if a.abs() > b.abs() {
        (a, quarter * b / a)
    } else {
        (b, quarter * (2.0 - a / b))
    };
    [radius * angle.cos(), radius * angle.sin()]
}

/// Two unit vectors that complete `n` to an orthonormal frame (T. Duff and others: Building an
/// orthonormal basis, revisited, 2017).
pub(crate) fn frame(n: DVec3) -> [DVec3; 2] {
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    [
        DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        DVec3::new(b, sign + n.y * n.y * a, -n.y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_fill_the_square_and_the_disc_evenly() {
        let count = 4096;
        let quarter = (0..count)
            .map(r2)
            .filter(|[u, v]| *u < 0.5 && *v < 0.5)
            .count();
        assert!(quarter.abs_diff(count / 4) < 8, "{quarter}");
        let half = (0..count)
            .map(|k| disc(r2(k)))
            .filter(|[x, y]| x.hypot(*y) < 0.5_f64.sqrt())
            .count();
        assert!(half.abs_diff(count / 2) < 16, "{half}");
    }

    #[test]
    fn frames_are_orthonormal() {
        for n in [DVec3::Z, -DVec3::Z, DVec3::X, DVec3::new(0.36, -0.48, -0.8)] {
            let [a, b] = frame(n);
            for (product, expected) in [
                (a.dot(a), 1.0),
                (b.dot(b), 1.0),
                (a.dot(b), 0.0),
                (a.dot(n), 0.0),
                (b.dot(n), 0.0),
            ] {
                assert!((product - expected).abs() < 1e-12, "{n}");
            }
        }
    }
}

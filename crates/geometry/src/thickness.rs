//! How thick shapes are.

use crate::SignedDistance;

/// A ray has arrived when it is this part of the largest thickness from the other side.
const ARRIVED: f64 = 0.01;
/// It starts this part of the largest thickness below the surface.
const START: f64 = 0.04;

/// The length of the way through a shape from a point `x` of its boundary against the outward normal `n` of length 1, as far as it is at
/// most `largest`: the first `t` with `s(x - t n) = 0`.
///
/// With `-n` and the negative distance it is the width of the gap before the shape. Found by sphere tracing, to about a hundredth of
/// `largest` (J. C. Hart: Sphere tracing. The Visual Computer 12, 1996).
pub fn thickness<const D: usize>(
    distance: impl Fn([f64; D]) -> f64,
    x: [f64; D],
    normal: [f64; D],
    largest: f64,
) -> f64 {
    let mut t = START * largest;
    while t < largest {
        let depth = -distance(std::array::from_fn(|i| x[i] - t * normal[i]));
        if depth.is_nan() || depth <= ARRIVED * largest {
            return t;
        }
        t += depth;
    }
    largest
}

/// Whether a shape with this signed distance, or the gap before it, is thinner than `width` at a point of its boundary with this outward normal.
pub fn is_thin<const D: usize>(
    distance: impl Fn([f64; D]) -> f64,
    x: [f64; D],
    normal: [f64; D],
    width: f64,
) -> bool {
    let inside = thickness(&distance, x, normal, width);
    let outward = normal.map(|n| -n);
    let gap = || thickness(|x| -distance(x), x, outward, width);
    inside < width || gap() < width
}

/// The part of the weight of points on the boundary of a shape, each with its outward normal, where it [is thin](is_thin).
pub fn thin_part<const D: usize>(
    shape: &(impl SignedDistance<D> + ?Sized),
    points: impl Iterator<Item = ([f64; D], [f64; D], f64)>,
    width: f64,
) -> f64 {
    let (mut thin, mut all) = (0.0, 0.0);
    for (x, normal, weight) in points {
        if is_thin(|x| shape.signed_distance(x), x, normal, width) {
            thin += weight;
        }
        all += weight;
    }
    thin / all.max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::Cuboid;

    /// A box of sides 2 and 0.4, seen from its upper face and from its right one, also next to a corner.
    #[test]
    fn boxes_are_as_thick_as_they_are() {
        let shape = Cuboid::new([1.0, 0.2]).unwrap();
        let s = |x| shape.signed_distance(x);
        for x in [-0.99, -0.3, 0.9] {
            let found = thickness(s, [x, 0.2], [0.0, 1.0], 1.0);
            assert!((found - 0.4).abs() < 0.02, "{found}");
        }
        assert_eq!(
            thickness(s, [1.0, 0.1], [1.0, 0.0], 1.0).to_bits(),
            1.0_f64.to_bits()
        );
        let points = [([0.0, 0.2], [0.0, 1.0], 3.0), ([1.0, 0.0], [1.0, 0.0], 1.0)];
        let part = |width| thin_part(&shape, points.into_iter(), width);
        assert!((part(0.5) - 0.75).abs() < 1e-12 && part(0.3) == 0.0);
    }
}

//! Shapes with exact signed distances, inside and outside.
//!
//! All but [`Ball`] and [`Capsule`] are centred at the origin; move them with
//! [`translated`](crate::SignedDistanceExt::translated).

use crate::error::{finite, positive, require};
use crate::{Error, SignedDistance, vector};

/// A ball (a disc in 2D). Exact everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball<const D: usize> {
    centre: [f64; D],
    radius: f64,
}

impl<const D: usize> Ball<D> {
    /// The ball of the given centre and radius.
    ///
    /// # Errors
    /// The centre must be finite, the radius finite and positive.
    pub fn new(centre: [f64; D], radius: f64) -> Result<Self, Error> {
        Ok(Self {
            centre: finite("centre", centre)?,
            radius: positive("radius", radius)?,
        })
    }
}

impl<const D: usize> SignedDistance<D> for Ball<D> {
    fn signed_distance(&self, x: [f64; D]) -> f64 {
        vector::norm(vector::sub(x, self.centre)) - self.radius
    }
}

/// Signed distance of the box with the given half extents, from the absolute coordinates.
fn cuboid_distance<const D: usize>(absolute: [f64; D], half_extents: [f64; D]) -> f64 {
    let excess = vector::sub(absolute, half_extents);
    let outside = vector::norm(excess.map(|q| q.max(0.0)));
    let inside = excess.into_iter().fold(f64::NEG_INFINITY, vector::max);
    // NaN must pass: the check of the phase field relies on it.
    if inside > 0.0 { outside } else { inside }
}

/// The box `|x_i| <= half_extents_i` (a rectangle in 2D). Exact everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid<const D: usize> {
    half_extents: [f64; D],
}

impl<const D: usize> Cuboid<D> {
    /// The box with the given half extents.
    ///
    /// # Errors
    /// They must be finite and positive.
    pub fn new(half_extents: [f64; D]) -> Result<Self, Error> {
        for value in half_extents {
            positive("half extent", value)?;
        }
        Ok(Self { half_extents })
    }
}

impl<const D: usize> SignedDistance<D> for Cuboid<D> {
    fn signed_distance(&self, x: [f64; D]) -> f64 {
        cuboid_distance(x.map(f64::abs), self.half_extents)
    }
}

/// The union over the axes `k` of the boxes `|x_k| <= a`, `|x_i| <= b` for `i != k`.
///
/// In 2D this is the cross `[-a,a] x [-b,b]` with its transpose. Exact everywhere, also near the
/// re-entrant corners, where the minimum over the boxes is not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cross<const D: usize> {
    half_length: f64,
    half_width: f64,
}

impl<const D: usize> Cross<D> {
    /// The cross with arms of half length `a` and half width `b`.
    ///
    /// # Errors
    /// `0 < b < a`, both finite.
    pub fn new(half_length: f64, half_width: f64) -> Result<Self, Error> {
        positive("half length", half_length)?;
        let holds = half_width > 0.0 && half_width < half_length;
        let requirement = "positive and smaller than the half length";
        require("half width", half_width, requirement, |_| holds)?;
        Ok(Self {
            half_length,
            half_width,
        })
    }
}

impl<const D: usize> SignedDistance<D> for Cross<D> {
    fn signed_distance(&self, x: [f64; D]) -> f64 {
        let (a, b) = (self.half_length, self.half_width);
        let x = x.map(f64::abs);
        let arm = |k| cuboid_distance(x, std::array::from_fn(|i| if i == k { a } else { b }));
        let union = -(0..D).map(|k| -arm(k)).fold(f64::NEG_INFINITY, vector::max);
        if union >= 0.0 || union.is_nan() {
            return union;
        }
        // By symmetry the nearest point outside is in the same orthant. There the outside is
        // the union of {x_i > a} and of {x_i > b and x_j > b} over the pairs, of which the two
        // largest coordinates give the nearest.
        let (first, second) =
            x.into_iter()
                .fold((f64::NEG_INFINITY, f64::NEG_INFINITY), |(p, q), v| {
                    if v > p { (v, p) } else { (p, q.max(v)) }
                });
        let corner = (b - first).max(0.0).hypot((b - second).max(0.0));
        -corner.min(a - first)
    }
}

/// The ellipse with the given half axes. Exact everywhere, and smooth but on the segment between its centres of curvature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipse {
    half_axes: [f64; 2],
}

impl Ellipse {
    /// The ellipse `(x/a)^2 + (y/b)^2 <= 1`.
    ///
    /// # Errors
    /// The half axes must be finite and positive.
    pub fn new(half_axes: [f64; 2]) -> Result<Self, Error> {
        for value in half_axes {
            positive("half axis", value)?;
        }
        Ok(Self { half_axes })
    }
}

impl SignedDistance<2> for Ellipse {
    /// The point of the boundary nearest to `x` is `(a^2 x / (s + a^2), b^2 y / (s + b^2))`, in units where the shorter half axis `b`
    /// is 1, for the largest `s` that puts it on the boundary; bisection finds that to the last bit.
    fn signed_distance(&self, x: [f64; 2]) -> f64 {
        let ([a, b], [x, y]) = (self.half_axes, x.map(f64::abs));
        let ([a, b], [x, y]) = if a < b {
            ([b, a], [y, x])
        } else {
            ([a, b], [x, y])
        };
        let (ratio, along, across) = ((a / b).powi(2), x / b * (a / b), y / b);
        let outside = |s: f64| (along / (s + ratio)).hypot(across / (s + 1.0)) > 1.0;
        let (mut low, mut high) = (across - 1.0, along.hypot(across) - 1.0);
        loop {
            let s = 0.5 * (low + high);
            if !(low < s && s < high) {
                break;
            }
            if outside(s) { low = s } else { high = s }
        }
        let nearest = (ratio * x / (high + ratio) / a).min(1.0);
        let distance = (x - a * nearest).hypot(y - b * (1.0 - nearest * nearest).sqrt());
        if (x / a).hypot(y / b) > 1.0 {
            distance
        } else {
            -distance
        }
    }
}

/// The points within `radius` of a segment. Exact everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule<const D: usize> {
    start: [f64; D],
    end: [f64; D],
    radius: f64,
}

impl<const D: usize> Capsule<D> {
    /// The capsule about the segment from `start` to `end`, which may coincide.
    ///
    /// # Errors
    /// The points must be finite, the radius finite and positive.
    pub fn new(start: [f64; D], end: [f64; D], radius: f64) -> Result<Self, Error> {
        Ok(Self {
            start: finite("start", start)?,
            end: finite("end", end)?,
            radius: positive("radius", radius)?,
        })
    }
}

impl<const D: usize> SignedDistance<D> for Capsule<D> {
    fn signed_distance(&self, x: [f64; D]) -> f64 {
        let (axis, relative) = (
            vector::sub(self.end, self.start),
            vector::sub(x, self.start),
        );
        let length_squared = vector::dot(axis, axis);
        let along = if length_squared > 0.0 {
            (vector::dot(relative, axis) / length_squared).clamp(0.0, 1.0)
        } else {
            0.0
        };
        vector::norm(vector::sub(relative, vector::scale(axis, along))) - self.radius
    }
}

/// A ring torus about the third axis. Exact everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Torus {
    major: f64,
    minor: f64,
}

impl Torus {
    /// The torus whose tube, of radius `minor`, has the circle of radius `major` as its centre.
    ///
    /// # Errors
    /// `0 < minor < major`, both finite.
    pub fn new(major: f64, minor: f64) -> Result<Self, Error> {
        positive("major radius", major)?;
        let holds = minor > 0.0 && minor < major;
        let requirement = "positive and smaller than the major radius";
        require("minor radius", minor, requirement, |_| holds)?;
        Ok(Self { major, minor })
    }

    /// The Clifford torus, `major = sqrt(2) minor`, with outer radius `major + minor`.
    ///
    /// # Errors
    /// The radius must be finite and positive.
    pub fn clifford(outer_radius: f64) -> Result<Self, Error> {
        let minor = positive("outer radius", outer_radius)? / (1.0 + std::f64::consts::SQRT_2);
        Self::new(outer_radius - minor, minor)
    }

    /// Radius of the central circle.
    pub fn major(&self) -> f64 {
        self.major
    }

    /// Radius of the tube.
    pub fn minor(&self) -> f64 {
        self.minor
    }
}

impl SignedDistance<3> for Torus {
    fn signed_distance(&self, [x, y, z]: [f64; 3]) -> f64 {
        (x.hypot(y) - self.major).hypot(z) - self.minor
    }
}

/// A solid cylinder (a thick disk, if flat) about the third axis. Exact everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    radius: f64,
    half_height: f64,
}

impl Cylinder {
    /// The cylinder `x^2 + y^2 <= radius^2`, `|z| <= half_height`.
    ///
    /// # Errors
    /// Both must be finite and positive.
    pub fn new(radius: f64, half_height: f64) -> Result<Self, Error> {
        Ok(Self {
            radius: positive("radius", radius)?,
            half_height: positive("half height", half_height)?,
        })
    }
}

impl SignedDistance<3> for Cylinder {
    fn signed_distance(&self, [x, y, z]: [f64; 3]) -> f64 {
        cuboid_distance([x.hypot(y), z.abs()], [self.radius, self.half_height])
    }
}

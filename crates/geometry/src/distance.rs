//! Signed distances and their combinations.
//!
//! | combination | outside | inside |
//! |---|---|---|
//! | union (minimum) | exact | bound: never deeper than the truth |
//! | intersection (maximum) | bound: never farther than the truth | exact |
//! | difference (`a` and not `b`) | bound: never farther | exact |
//! | translated, rotated, scaled | as the operand | as the operand |
//!
//! The table is for exact operands. A bound has the right sign and zero set, is 1-Lipschitz, and
//! `|bound| <= |distance|`. A union is exact inside as well where its parts do not touch; an
//! intersection outside, for the complements.

use crate::Error;
use crate::error::positive;
use crate::vector::{self, max};

/// The signed distance to the boundary of a shape: negative inside, positive outside.
///
/// Closures `Fn([f64; D]) -> f64 + Sync` implement it.
pub trait SignedDistance<const D: usize>: Sync {
    /// The signed distance of `x`.
    fn signed_distance(&self, x: [f64; D]) -> f64;
}

impl<const D: usize, F: Fn([f64; D]) -> f64 + Sync> SignedDistance<D> for F {
    fn signed_distance(&self, x: [f64; D]) -> f64 {
        self(x)
    }
}

impl<const D: usize> SignedDistance<D> for Box<dyn SignedDistance<D> + '_> {
    fn signed_distance(&self, x: [f64; D]) -> f64 {
        (**self).signed_distance(x)
    }
}

/// The combinations, as methods of every shape. Exactness: see the [module](crate::distance).
pub trait SignedDistanceExt<const D: usize>: SignedDistance<D> + Sized {
    /// Points in `self` or `other`.
    fn union(self, other: impl SignedDistance<D>) -> impl SignedDistance<D> {
        move |x| -max(-self.signed_distance(x), -other.signed_distance(x))
    }

    /// Points in both.
    fn intersection(self, other: impl SignedDistance<D>) -> impl SignedDistance<D> {
        move |x| max(self.signed_distance(x), other.signed_distance(x))
    }

    /// Points in `self` and not in `other`.
    fn difference(self, other: impl SignedDistance<D>) -> impl SignedDistance<D> {
        move |x| max(self.signed_distance(x), -other.signed_distance(x))
    }

    /// Moves the shape by `shift`.
    fn translated(self, shift: [f64; D]) -> impl SignedDistance<D> {
        move |x| self.signed_distance(vector::sub(x, shift))
    }

    /// Turns the shape about the origin.
    fn rotated(self, rotation: Rotation<D>) -> impl SignedDistance<D> {
        move |x| self.signed_distance(rotation.apply_inverse(x))
    }

    /// Scales the shape about the origin.
    ///
    /// # Errors
    /// The factor must be finite and positive.
    fn scaled(self, factor: f64) -> Result<impl SignedDistance<D>, Error> {
        let factor = positive("factor", factor)?;
        Ok(move |x: [f64; D]| factor * self.signed_distance(x.map(|v| v / factor)))
    }
}

impl<const D: usize, S: SignedDistance<D>> SignedDistanceExt<D> for S {}

/// A rotation about the origin, an element of `SO(D)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation<const D: usize> {
    rows: [[f64; D]; D],
}

impl Rotation<2> {
    /// Counter-clockwise by `angle` (radians): from the first axis towards the second.
    pub fn by_angle(angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self {
            rows: [[cos, -sin], [sin, cos]],
        }
    }
}

impl Rotation<3> {
    /// By `angle` (radians) about `axis`, right-handed (Rodrigues' formula).
    ///
    /// # Errors
    /// The axis must be finite and not zero.
    pub fn about_axis(axis: [f64; 3], angle: f64) -> Result<Self, Error> {
        let length = positive("length of the axis", vector::norm(axis))?;
        let [x, y, z] = vector::scale(axis, 1.0 / length);
        let (sin, cos) = angle.sin_cos();
        let rest = 1.0 - cos;
        Ok(Self {
            rows: [
                [
                    cos + x * x * rest,
                    x * y * rest - z * sin,
                    x * z * rest + y * sin,
                ],
                [
                    y * x * rest + z * sin,
                    cos + y * y * rest,
                    y * z * rest - x * sin,
                ],
                [
                    z * x * rest - y * sin,
                    z * y * rest + x * sin,
                    cos + z * z * rest,
                ],
            ],
        })
    }
}

impl<const D: usize> Rotation<D> {
    /// The rows of the matrix `R`.
    pub fn matrix(&self) -> [[f64; D]; D] {
        self.rows
    }

    /// `R x`.
    pub fn apply(&self, x: [f64; D]) -> [f64; D] {
        self.rows.map(|row| vector::dot(row, x))
    }

    /// `R^-1 x = R^T x`.
    pub fn apply_inverse(&self, x: [f64; D]) -> [f64; D] {
        std::array::from_fn(|j| (0..D).map(|i| self.rows[i][j] * x[i]).sum())
    }
}

//! Signed distances and their combinations.
//!
//! | combination | outside | inside |
//! |---|---|---|
//! | [`Union`] (minimum) | exact | bound: never deeper than the truth |
//! | [`Intersection`] (maximum) | bound: never farther than the truth | exact |
//! | [`Difference`] (`a` and not `b`) | bound: never farther | exact |
//! | [`Translated`], [`Rotated`], [`Scaled`] | as the operand | as the operand |
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
    fn union<S: SignedDistance<D>>(self, other: S) -> Union<Self, S> {
        Union(self, other)
    }

    /// Points in both.
    fn intersection<S: SignedDistance<D>>(self, other: S) -> Intersection<Self, S> {
        Intersection(self, other)
    }

    /// Points in `self` and not in `other`.
    fn difference<S: SignedDistance<D>>(self, other: S) -> Difference<Self, S> {
        Difference(self, other)
    }

    /// Moves the shape by `shift`.
    fn translated(self, shift: [f64; D]) -> Translated<Self, D> {
        Translated { shape: self, shift }
    }

    /// Turns the shape about the origin.
    fn rotated(self, rotation: Rotation<D>) -> Rotated<Self, D> {
        Rotated {
            shape: self,
            rotation,
        }
    }

    /// Scales the shape about the origin.
    ///
    /// # Errors
    /// The factor must be finite and positive.
    fn scaled(self, factor: f64) -> Result<Scaled<Self>, Error> {
        Ok(Scaled {
            shape: self,
            factor: positive("factor", factor)?,
        })
    }
}

impl<const D: usize, S: SignedDistance<D>> SignedDistanceExt<D> for S {}

/// See [`SignedDistanceExt::union`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Union<A, B>(A, B);

/// See [`SignedDistanceExt::intersection`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection<A, B>(A, B);

/// See [`SignedDistanceExt::difference`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference<A, B>(A, B);

/// See [`SignedDistanceExt::translated`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Translated<S, const D: usize> {
    shape: S,
    shift: [f64; D],
}

/// See [`SignedDistanceExt::rotated`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotated<S, const D: usize> {
    shape: S,
    rotation: Rotation<D>,
}

/// See [`SignedDistanceExt::scaled`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaled<S> {
    shape: S,
    factor: f64,
}

impl<const D: usize, A: SignedDistance<D>, B: SignedDistance<D>> SignedDistance<D> for Union<A, B> {
    fn signed_distance(&self, x: [f64; D]) -> f64 {
        -max(-self.0.signed_distance(x), -self.1.signed_distance(x))
    }
}

impl<const D: usize, A, B> SignedDistance<D> for Intersection<A, B>
where
    A: SignedDistance<D>,
    B: SignedDistance<D>,
{
    fn signed_distance(&self, x: [f64; D]) -> f64 {
        max(self.0.signed_distance(x), self.1.signed_distance(x))
    }
}

impl<const D: usize, A, B> SignedDistance<D> for Difference<A, B>
where
    A: SignedDistance<D>,
    B: SignedDistance<D>,
{
    fn signed_distance(&self, x: [f64; D]) -> f64 {
        max(self.0.signed_distance(x), -self.1.signed_distance(x))
    }
}

impl<const D: usize, S: SignedDistance<D>> SignedDistance<D> for Translated<S, D> {
    fn signed_distance(&self, x: [f64; D]) -> f64 {
        self.shape.signed_distance(vector::sub(x, self.shift))
    }
}

impl<const D: usize, S: SignedDistance<D>> SignedDistance<D> for Rotated<S, D> {
    fn signed_distance(&self, x: [f64; D]) -> f64 {
        self.shape.signed_distance(self.rotation.apply_inverse(x))
    }
}

impl<const D: usize, S: SignedDistance<D>> SignedDistance<D> for Scaled<S> {
    fn signed_distance(&self, x: [f64; D]) -> f64 {
        self.factor * self.shape.signed_distance(x.map(|v| v / self.factor))
    }
}

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

//! Signed distances and their combinations.
//!
//! | combination | outside | inside |
//! |---|---|---|
//! | union (minimum) | exact | bound: never deeper than the truth |
//! | difference (`a` and not `b`, maximum) | bound: never farther than the truth | exact |
//! | translated | as the operand | as the operand |
//!
//! The table is for exact operands. A bound has the right sign and zero set, is 1-Lipschitz, and
//! `|bound| <= |distance|`. A union is exact inside as well where its parts do not touch.

use crate::vector::{self, max};

/// The signed distance to the boundary of a shape: negative inside, positive outside.
///
/// Closures `Fn([f64; D]) -> f64 + Sync` implement it.
pub trait SignedDistance<const D: usize>: Send + Sync {
    /// The signed distance of `x`.
    fn signed_distance(&self, x: [f64; D]) -> f64;
}

impl<const D: usize, F: Fn([f64; D]) -> f64 + Send + Sync> SignedDistance<D> for F {
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

    /// Points in `self` and not in `other`.
    fn difference(self, other: impl SignedDistance<D>) -> impl SignedDistance<D> {
        move |x| max(self.signed_distance(x), -other.signed_distance(x))
    }

    /// Moves the shape by `shift`.
    fn translated(self, shift: [f64; D]) -> impl SignedDistance<D> {
        move |x| self.signed_distance(vector::sub(x, shift))
    }
}

impl<const D: usize, S: SignedDistance<D>> SignedDistanceExt<D> for S {}

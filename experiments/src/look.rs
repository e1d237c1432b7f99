//! How things look in the figures.

use geometry::contour::zero_level;

use crate::prelude::*;

/// The methods in their schemes, in the order of legends.
pub fn variants() -> impl Iterator<Item = (Method, Scheme)> {
    let schemes = |method| Scheme::ALL.map(|scheme| (method, scheme));
    Method::ALL.into_iter().flat_map(schemes)
}

/// Colour of a method in a scheme, an entry of the palette.
pub fn colour(method: Method, scheme: Scheme) -> usize {
    match (method, scheme) {
        (Method::Hybrid, Scheme::Paper) => 0,
        (Method::Hybrid, Scheme::Calibrated) => 5,
        (Method::Hybrid, Scheme::Accurate) => 2,
        (Method::FeImplicit, Scheme::Paper) => 1,
        (Method::FeImplicit, _) => 4,
        (Method::FeSemi, Scheme::Paper) => 3,
        (Method::FeSemi, _) => 6,
    }
}

pub fn outline(field: &Field<2>) -> Curve {
    let curves = zero_level(field).into_iter();
    Curve::new(curves.map(|curve| curve.points).collect::<Vec<_>>())
}

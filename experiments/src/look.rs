//! How things look in the figures.

use geometry::contour::zero_level;

use crate::prelude::*;

/// The methods in their schemes that are shown, in the order of legends.
pub fn variants(
    shown: impl Fn((Method, Scheme)) -> bool,
) -> impl Iterator<Item = (Method, Scheme)> {
    let all = Method::ALL
        .into_iter()
        .flat_map(|method| Scheme::ALL.map(|scheme| (method, scheme)));
    all.filter(move |&variant| shown(variant))
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

/// A negative power of two, as `2⁻⁹`.
pub fn one_over_two_to(exponent: u32) -> String {
    let digits = exponent.to_string();
    let digits = digits.chars().filter_map(|c| c.to_digit(10));
    let superscript = digits.filter_map(|digit| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize));
    format!("2⁻{}", superscript.collect::<String>())
}

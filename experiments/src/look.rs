//! How curves look in the figures: colours stand for methods in their schemes, dashes for resolutions.

use geometry::contour::{Interpolation, zero_level};

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

/// How much finer the finest of `cells` is, counted in resolutions.
fn rank(n: usize, cells: &[usize]) -> usize {
    cells.iter().filter(|&&m| m > n).count()
}

fn dashes(n: usize, cells: &[usize]) -> LineStyle {
    use LineStyle::{Dashed, Dotted, ShortDashed, Solid};
    [Solid, Dashed, ShortDashed, Dotted][rank(n, cells).min(3)]
}

pub fn marker(n: usize, cells: &[usize]) -> Marker {
    use Marker::{Circle, Diamond, Square, Triangle};
    [Circle, Square, Triangle, Diamond][rank(n, cells).min(3)]
}

/// The curve of a method at one of several resolutions. Such curves often coincide, so coarser ones are wider and show on both sides of
/// finer ones.
pub fn curve(
    points: Vec<[f64; 2]>,
    (method, scheme): (Method, Scheme),
    (n, cells): (usize, &[usize]),
) -> Series {
    Series::new(format!("{}, n = {n}", method.label_in(scheme)), points)
        .with_colour(colour(method, scheme))
        .with_style(dashes(n, cells))
        .with_width(1.8 + 1.4 * rank(n, cells) as f64)
}

/// A legend for [curves](curve): methods, then resolutions.
pub fn legend(
    chart: LineChart,
    variants: impl IntoIterator<Item = (Method, Scheme)>,
    cells: &[usize],
) -> LineChart {
    let methods = variants.into_iter().map(|(method, scheme)| {
        let (label, colour) = (method.label_in(scheme), colour(method, scheme));
        LegendEntry::line(label, colour, LineStyle::Solid)
    });
    let resolutions = (cells.iter())
        .map(|&n| LegendEntry::line(format!("n = {n}"), Colour::Black, dashes(n, cells)));
    chart.with_entries(methods).with_entries(resolutions)
}

pub fn outline(field: &Field<2>) -> Curve {
    let curves = zero_level(field, Interpolation::Profile).into_iter();
    Curve::new(curves.map(|curve| curve.points).collect::<Vec<_>>())
}

/// A negative power of two, as `2⁻⁹`.
pub fn one_over_two_to(exponent: u32) -> String {
    let digits = exponent.to_string();
    let digits = digits.chars().filter_map(|c| c.to_digit(10));
    let superscript = digits.filter_map(|digit| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize));
    format!("2⁻{}", superscript.collect::<String>())
}

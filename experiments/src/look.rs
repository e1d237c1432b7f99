//! How curves look in the figures: colours stand for methods in their schemes, dashes for resolutions.

use report::{Colour, LegendEntry, LineChart, LineStyle, Marker, Series};

use crate::method::{Method, Scheme};

/// How much finer the finest of `cells` is, counted in resolutions.
fn rank(n: usize, cells: &[usize]) -> usize {
    cells.iter().filter(|&&m| m > n).count()
}

fn dashes(n: usize, cells: &[usize]) -> LineStyle {
    const STYLES: [LineStyle; 4] = [
        LineStyle::Solid,
        LineStyle::Dashed,
        LineStyle::ShortDashed,
        LineStyle::Dotted,
    ];
    STYLES[rank(n, cells).min(STYLES.len() - 1)]
}

/// A marker for a resolution.
pub fn marker(n: usize, cells: &[usize]) -> Marker {
    const MARKERS: [Marker; 4] = [
        Marker::Circle,
        Marker::Square,
        Marker::Triangle,
        Marker::Diamond,
    ];
    MARKERS[rank(n, cells).min(MARKERS.len() - 1)]
}

/// The curve of a method at one of several resolutions. Such curves often coincide, so coarser ones are wider and show on both sides of
/// finer ones.
pub fn curve(
    points: Vec<[f64; 2]>,
    (method, scheme): (Method, Scheme),
    (n, cells): (usize, &[usize]),
) -> Series {
    Series::new(format!("{}, n = {n}", method.label_in(scheme)), points)
        .with_colour(method.colour_in(scheme))
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
        LegendEntry::line(
            method.label_in(scheme),
            method.colour_in(scheme),
            LineStyle::Solid,
        )
    });
    let resolutions = (cells.iter())
        .map(|&n| LegendEntry::line(format!("n = {n}"), Colour::Black, dashes(n, cells)));
    chart.with_entries(methods).with_entries(resolutions)
}

//! Outlines as scalable vector graphics.

use std::fmt::Write as _;

use crate::{Frame, Outline};

/// An SVG file of an outline filled with black on white by the even-odd rule, in units of the pixels of a frame.
///
/// Coordinates are rounded to a thousandth of a pixel.
pub fn svg(frame: &Frame, outline: &Outline) -> String {
    let mut path = String::new();
    for curve in outline.curves() {
        for (k, &point) in curve.points.iter().enumerate() {
            let [x, y] = frame.position(point).map(thousandths);
            let command = if k == 0 { 'M' } else { ' ' };
            // Writing to a string does not fail.
            let _ = write!(path, "{command}{x} {y}");
        }
        path.push('Z');
    }
    let [width, height] = frame.size();
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n\
         <path fill=\"#000000\" fill-rule=\"evenodd\" d=\"{path}\"/>\n</svg>\n"
    )
}

/// Rounded, and without a negative zero.
fn thousandths(x: f64) -> f64 {
    (1e3 * x).round() / 1e3 + 0.0
}

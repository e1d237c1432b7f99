//! What charts are drawn on: one small trait before SVG documents and PNG files.
//!
//! The charts of plotters are not used. Its bitmaps fill polygons one pixel too wide, leave holes where a wide curve crosses itself and
//! know dashes of one length only; its axes have no small ticks and no factor common to all labels; its plots side by side do not line up.

use glam::{DVec2, dvec2};
use srgb::Rgb;

use crate::font::TextStyle;
use crate::geom::Rect;
use crate::style::Marker;

/// PNG pixels per layout unit.
pub(crate) const PNG_SCALE: usize = 2;

/// What the charts need to draw. Coordinates are layout units, of which a README shows one per CSS pixel.
pub(crate) trait Surface {
    /// A polyline with round joins, in dashes of a [pattern](crate::LineStyle::pattern).
    fn dashed(&mut self, points: &[DVec2], width: f64, colour: Rgb, pattern: &[f64]);
    /// The region inside an odd number of the loops.
    fn fill(&mut self, loops: &[Vec<DVec2>], colour: Rgb);
    /// Markers, each with a thin white rim, so that it stands out from its curve.
    fn markers(&mut self, marker: Marker, places: &[DVec2], colour: Rgb);
    /// One line of text, anchored at the middle of its capitals.
    fn text(&mut self, line: &str, at: DVec2, style: TextStyle);
    /// A raster of `columns` cells a row, row by row from the top, stretched over `area`, below everything else. Viewers may
    /// interpolate its cells if it is `smooth`.
    fn image(&mut self, area: Rect, columns: usize, cells: &[Rgb], smooth: bool);
}

impl dyn Surface + '_ {
    /// A solid polyline with round joins.
    pub fn stroke(&mut self, points: &[DVec2], width: f64, colour: Rgb) {
        self.dashed(points, width, colour, &[]);
    }

    /// Outlines a box with a line one unit wide.
    pub fn outline(&mut self, area: Rect, colour: Rgb) {
        let ([a, b, c, d], half) = (area.corners(), dvec2(0.5, 0.0));
        for ends in [[a - half, b + half], [d - half, c + half], [a, d], [b, c]] {
            self.stroke(&ends, 1.0, colour);
        }
    }
}

//! Outlines as scalable vector graphics.

use std::fmt::Write as _;
use std::path::Path;

use files::write_atomically;
use render::Rgb;

use crate::{Error, Frame, Outline};

/// Outlines drawn one over the other, as paths in units of the pixels of a frame.
///
/// Coordinates are rounded to a thousandth of a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Svg {
    frame: Frame,
    elements: String,
}

impl Svg {
    /// White paper.
    pub fn on_white(frame: Frame) -> Self {
        let elements = "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n".into();
        Self { frame, elements }
    }

    /// No paper.
    pub fn transparent(frame: Frame) -> Self {
        Self {
            frame,
            elements: String::new(),
        }
    }

    /// Fills an outline, by the even-odd rule.
    #[must_use]
    pub fn filled(mut self, outline: &Outline, Rgb(r, g, b): Rgb) -> Self {
        let mut data = String::new();
        for curve in outline.curves() {
            for (k, &point) in curve.points.iter().enumerate() {
                let [x, y] = self.frame.position(point).map(thousandths);
                let command = if k == 0 { 'M' } else { ' ' };
                // Writing to a string does not fail.
                let _ = write!(data, "{command}{x} {y}");
            }
            data.push('Z');
        }
        let style = format!("fill=\"#{r:02x}{g:02x}{b:02x}\" fill-rule=\"evenodd\"");
        let _ = writeln!(self.elements, "<path {style} d=\"{data}\"/>");
        self
    }

    /// Writes the file, atomically (see [`write_atomically`]).
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let text = self.to_string();
        Ok(write_atomically(path, |out| {
            out.write_all(text.as_bytes())
        })?)
    }
}

impl std::fmt::Display for Svg {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [width, height] = [self.frame.width(), self.frame.height()];
        write!(
            f,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\">\n{}</svg>\n",
            self.elements
        )
    }
}

/// Rounded, and without a negative zero.
fn thousandths(x: f64) -> f64 {
    (1e3 * x).round() / 1e3 + 0.0
}

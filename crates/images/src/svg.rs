//! Outlines as scalable vector graphics.

use std::fmt::Write as _;
use std::path::Path;

use geometry::file::write_atomically;
use render::Rgb;

use crate::error::positive;
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
    pub fn filled(mut self, outline: &Outline, colour: Rgb) -> Self {
        let style = format!("fill=\"{}\" fill-rule=\"evenodd\"", hexadecimal(colour));
        self.path(outline, &style);
        self
    }

    /// Draws a line along an outline, `width` pixels wide.
    ///
    /// # Errors
    /// The width must be finite and positive.
    pub fn outlined(mut self, outline: &Outline, colour: Rgb, width: f64) -> Result<Self, Error> {
        let width = positive("width of the line", width)?;
        let style = format!(
            "fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"",
            hexadecimal(colour)
        );
        self.path(outline, &style);
        Ok(self)
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

    fn path(&mut self, outline: &Outline, style: &str) {
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
        let _ = writeln!(self.elements, "<path {style} d=\"{data}\"/>");
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

fn hexadecimal(Rgb(r, g, b): Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

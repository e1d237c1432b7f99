//! Plane curves, filled or outlined, at equal aspect: zero level sets as small multiples.

use glam::DVec2;
use srgb::Rgb;

use crate::axis::Window;
use crate::colour::Colour;
use crate::drawable::Drawable;
use crate::error::Result;
use crate::geom::{Rect, clip_loop, clip_polyline, thin};
use crate::surface::Surface;

/// Closed polylines drawn alike, such as all components of one zero level set.
#[must_use]
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    loops: Vec<Vec<[f64; 2]>>,
    colour: Colour,
    width: f64,
    fill: Option<Colour>,
}

impl Curve {
    /// A solid outline in near-black along polylines `[x, y]`, `y` pointing up, whose ends are joined.
    pub fn new(loops: impl Into<Vec<Vec<[f64; 2]>>>) -> Self {
        Self {
            loops: loops.into(),
            colour: Colour::Black,
            width: 1.6,
            fill: None,
        }
    }

    /// Sets the colour of the outline (near-black by default).
    pub fn with_colour(mut self, colour: impl Into<Colour>) -> Self {
        self.colour = colour.into();
        self
    }

    /// Sets the width of the outline in layout units (1.6 by default).
    pub fn with_width(mut self, width: f64) -> Self {
        self.width = width;
        self
    }

    /// Fills the region inside an odd number of the polylines.
    pub fn filled(mut self, colour: impl Into<Colour>) -> Self {
        self.fill = Some(colour.into());
        self
    }
}

/// A panel of plane curves seen through a window, later ones on top, with a caption above.
#[must_use]
#[derive(Debug, Clone, PartialEq)]
pub struct Shapes {
    pub(crate) caption: String,
    curves: Vec<Curve>,
    window: [[f64; 2]; 2],
}

impl Shapes {
    /// No curves yet in a window from low to high `x` and from low to high `y`. Panels to be compared need the same.
    pub fn new(caption: impl Into<String>, window: [[f64; 2]; 2]) -> Self {
        Self {
            caption: caption.into(),
            curves: Vec::new(),
            window,
        }
    }

    /// Adds a curve on top of those before.
    pub fn with_curve(mut self, curve: Curve) -> Self {
        self.curves.push(curve);
        self
    }

    pub(crate) fn checked(&self) -> Result<Seen<'_>> {
        Ok(Seen {
            shapes: self,
            window: Window::linear(["x", "y"], self.window)?,
        })
    }
}

/// Curves with the window they are seen through.
pub(crate) struct Seen<'a> {
    shapes: &'a Shapes,
    window: Window,
}

impl Drawable for Seen<'_> {
    fn aspect(&self) -> Option<f64> {
        Some(self.window.aspect())
    }

    fn draw(&self, surface: &mut dyn Surface, plot: Rect) {
        for curve in &self.shapes.curves {
            let place = |ring: &Vec<[f64; 2]>| -> Vec<DVec2> {
                let finite = ring.iter().filter(|p| p.iter().all(|c| c.is_finite()));
                let placed: Vec<DVec2> = finite.map(|&p| self.window.place(&plot, p)).collect();
                thin(&placed, 0.2)
            };
            let placed: Vec<Vec<DVec2>> = curve.loops.iter().map(place).collect();
            if let Some(fill) = curve.fill {
                let inside: Vec<_> = placed.iter().map(|ring| clip_loop(ring, &plot)).collect();
                surface.fill(&inside, fill.rgb());
            }
            for mut ring in placed {
                ring.extend(ring.first().copied());
                for piece in clip_polyline(&ring, &plot) {
                    surface.stroke(&piece, curve.width, curve.colour.rgb());
                }
            }
        }
        surface.outline(plot, Rgb(170, 170, 170));
    }
}

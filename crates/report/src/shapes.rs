//! Plane curves, filled or outlined, at equal aspect: zero level sets as small multiples.

use srgb::Rgb;

use crate::axes::Margins;
use crate::axis::{Mapping, Scale};
use crate::colour::Colour;
use crate::error::{Error, Result};
use crate::geom::{Point, Rect, clip_loop, clip_polyline, point, thin};
use crate::panel::Drawable;
use crate::style::LineStyle;
use crate::surface::Surface;

/// Closed polylines drawn alike, such as all components of one zero level set.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Polylines as lists of `[x, y]`, `y` pointing up. The end need not repeat the start.
    pub loops: Vec<Vec<[f64; 2]>>,
    /// Colour of the outline.
    pub colour: Colour,
    /// Line style of the outline; [`LineStyle::None`] leaves it out.
    pub style: LineStyle,
    /// Width of the outline in layout units.
    pub width: f64,
    /// Colour of the region inside an odd number of the polylines, if it is to be filled.
    pub fill: Option<Colour>,
}

impl Curve {
    /// A solid outline in near-black.
    pub fn new(loops: impl Into<Vec<Vec<[f64; 2]>>>) -> Self {
        Self {
            loops: loops.into(),
            colour: Colour::Black,
            style: LineStyle::Solid,
            width: 1.6,
            fill: None,
        }
    }

    /// Sets the colour of the outline.
    #[must_use]
    pub fn with_colour(mut self, colour: impl Into<Colour>) -> Self {
        self.colour = colour.into();
        self
    }

    /// Sets the line style of the outline.
    #[must_use]
    pub fn with_style(mut self, style: LineStyle) -> Self {
        self.style = style;
        self
    }

    /// Sets the width of the outline in layout units (1.6 by default).
    #[must_use]
    pub fn with_width(mut self, width: f64) -> Self {
        self.width = width;
        self
    }

    /// Fills the inside.
    #[must_use]
    pub fn filled(mut self, colour: impl Into<Colour>) -> Self {
        self.fill = Some(colour.into());
        self
    }

    /// Finite points only.
    fn finite(&self) -> impl Iterator<Item = Vec<[f64; 2]>> {
        let finite = |p: &&[f64; 2]| p.iter().all(|c| c.is_finite());
        let rings = self.loops.iter();
        rings.map(move |ring| ring.iter().filter(finite).copied().collect())
    }
}

/// A panel of plane curves.
#[derive(Debug, Clone, PartialEq)]
pub struct Shapes {
    /// Caption above the drawing; may be empty.
    pub caption: String,
    /// Curves, later ones on top.
    pub curves: Vec<Curve>,
    /// The ends of what is shown in `x` and `y`; `None` shows all curves. Panels to be compared need a common one.
    pub window: Option<[[f64; 2]; 2]>,
}

impl Shapes {
    /// A panel showing all of its curves.
    pub fn new(caption: impl Into<String>) -> Self {
        Self {
            caption: caption.into(),
            curves: Vec::new(),
            window: None,
        }
    }

    /// Adds a curve.
    #[must_use]
    pub fn with_curve(mut self, curve: Curve) -> Self {
        self.curves.push(curve);
        self
    }

    /// Fixes what is shown.
    #[must_use]
    pub fn with_window(mut self, x: [f64; 2], y: [f64; 2]) -> Self {
        self.window = Some([x, y]);
        self
    }

    /// The window around all finite points, with a margin.
    fn bounds(&self) -> Result<[[f64; 2]; 2]> {
        let points = self.curves.iter().flat_map(Curve::finite).flatten();
        let join = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        let bounds = points
            .map(|point| point.map(|c| [c, c]))
            .reduce(|a, b| [join(a[0], b[0]), join(a[1], b[1])])
            .ok_or_else(|| Error::Empty {
                chart: self.caption.clone(),
            })?;
        let longest = bounds
            .map(|[low, high]| high - low)
            .into_iter()
            .fold(0.0, f64::max);
        let margin = if longest > 0.0 { 0.06 * longest } else { 1.0 };
        Ok(bounds.map(|[low, high]| [low - margin, high + margin]))
    }

    /// The curves with the window they are seen through.
    pub(crate) fn checked(&self) -> Result<Seen<'_>> {
        let [x, y] = match self.window {
            Some(window) => window,
            None => self.bounds()?,
        };
        Ok(Seen {
            shapes: self,
            x: Mapping::new("x", Scale::Linear, x[0], x[1])?,
            y: Mapping::new("y", Scale::Linear, y[0], y[1])?,
        })
    }
}

/// Curves with the window they are seen through.
pub(crate) struct Seen<'a> {
    shapes: &'a Shapes,
    x: Mapping,
    y: Mapping,
}

impl Drawable for Seen<'_> {
    fn aspect(&self) -> Option<f64> {
        Some((self.y.high - self.y.low) / (self.x.high - self.x.low))
    }

    fn margins(&self, _: f64, _: f64) -> Margins {
        Margins::even(1.0)
    }

    fn draw(&self, surface: &mut dyn Surface, plot: Rect) -> Result<()> {
        let place = |[x, y]: [f64; 2]| -> Point {
            point(
                plot.x + self.x.fraction(x) * plot.width,
                plot.bottom() - self.y.fraction(y) * plot.height,
            )
        };
        for curve in &self.shapes.curves {
            let placed: Vec<Vec<Point>> = curve
                .finite()
                .map(|ring| thin(&ring.into_iter().map(place).collect::<Vec<_>>(), 0.2))
                .collect();
            if let Some(fill) = curve.fill {
                let inside: Vec<_> = placed.iter().map(|ring| clip_loop(ring, &plot)).collect();
                surface.fill(&inside, fill.rgb())?;
            }
            if curve.style == LineStyle::None {
                continue;
            }
            for mut ring in placed {
                ring.extend(ring.first().copied());
                for piece in clip_polyline(&ring, &plot) {
                    surface.dashed(
                        &piece,
                        curve.width,
                        curve.colour.rgb(),
                        curve.style.pattern(),
                    )?;
                }
            }
        }
        surface.outline(plot, Rgb(170, 170, 170))
    }
}

//! Plane curves, filled or outlined, at equal aspect: zero level sets as small multiples.

use plotters_backend::text_anchor::HPos;
use srgb::Rgb;

use crate::axes::{Margins, draw_lines, title_height};
use crate::colour::{Colour, INK, WHITE};
use crate::error::{Error, Result};
use crate::geom::{Point, Rect, clip_loop, clip_polyline, point, thin};
use crate::legend::{LegendEntry, Sample};
use crate::panel::{Context, Drawable, Spot, Window};
use crate::style::LineStyle;
use crate::surface::{Surface, outline, stroke_dashed};

/// A set of polylines drawn alike, such as all components of one zero level set.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Polylines as lists of `[x, y]`, `y` pointing up. The end need not repeat the start.
    pub loops: Vec<Vec<[f64; 2]>>,
    /// Whether the ends of each polyline are joined. Only closed curves are filled.
    pub closed: bool,
    /// Colour of the outline.
    pub colour: Colour,
    /// Line style of the outline; [`LineStyle::None`] leaves it out.
    pub style: LineStyle,
    /// Width of the outline in layout units.
    pub width: f64,
    /// Colour of the region inside an odd number of the polylines, if it is to be filled.
    pub fill: Option<Colour>,
    /// Legend label; empty keeps it out of the legend.
    pub label: String,
}

impl Curve {
    /// A closed, solid outline in near-black.
    pub fn new(loops: impl Into<Vec<Vec<[f64; 2]>>>) -> Self {
        Self {
            loops: loops.into(),
            closed: true,
            colour: Colour::Black,
            style: LineStyle::Solid,
            width: 1.6,
            fill: None,
            label: String::new(),
        }
    }

    /// Leaves the ends of the polylines apart.
    #[must_use]
    pub fn open(mut self) -> Self {
        self.closed = false;
        self
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

    /// Names the curve in the legend.
    #[must_use]
    pub fn with_label(mut self, label: impl Into<String>) -> Self {
        self.label = label.into();
        self
    }

    /// Finite points only, with the first repeated at the end of closed curves.
    pub(crate) fn closed_loops(&self) -> impl Iterator<Item = Vec<[f64; 2]>> {
        self.loops.iter().map(|ring| {
            let mut points: Vec<[f64; 2]> = ring
                .iter()
                .copied()
                .filter(|p| p.iter().all(|c| c.is_finite()))
                .collect();
            if self.closed && points.len() > 2 && points.first() != points.last() {
                points.push(points[0]);
            }
            points
        })
    }

    pub(crate) fn legend_entry(&self) -> Option<LegendEntry> {
        if self.label.is_empty() {
            return None;
        }
        let line = LegendEntry {
            label: self.label.clone(),
            colour: self.colour,
            sample: Sample::Line(self.style, None),
        };
        Some(match (self.fill, self.style) {
            (Some(fill), LineStyle::None) => LegendEntry::patch(self.label.clone(), fill),
            _ => line,
        })
    }
}

/// A panel of plane curves.
#[derive(Debug, Clone, PartialEq)]
pub struct Shapes {
    /// Caption above the drawing; may be empty.
    pub caption: String,
    /// Curves, later ones on top. A panel without curves stays empty.
    pub curves: Vec<Curve>,
    /// What to show; `None` shows all curves of all such panels in the figure at one scale.
    pub window: Option<Window>,
    /// Whether a thin frame is drawn around the window.
    pub frame: bool,
}

impl Shapes {
    /// A framed panel showing all of its curves.
    pub fn new(caption: impl Into<String>) -> Self {
        Self {
            caption: caption.into(),
            curves: Vec::new(),
            window: None,
            frame: true,
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
        self.window = Some(Window { x, y });
        self
    }

    /// Leaves the frame out.
    #[must_use]
    pub fn without_frame(mut self) -> Self {
        self.frame = false;
        self
    }

    /// The smallest window around all finite points.
    fn bounds(&self) -> Option<Window> {
        let points = self.curves.iter().flat_map(Curve::closed_loops).flatten();
        points
            .map(|[x, y]| Window {
                x: [x, x],
                y: [y, y],
            })
            .reduce(Window::union)
    }

    /// The common window of all panels that do not fix their own, with a margin.
    pub(crate) fn common_window<'a>(panels: impl Iterator<Item = &'a Self>) -> Option<Window> {
        let bounds = panels
            .filter(|p| p.window.is_none())
            .filter_map(Self::bounds)
            .reduce(Window::union)?;
        let longest = (bounds.x[1] - bounds.x[0]).max(bounds.y[1] - bounds.y[0]);
        let margin = if longest > 0.0 { 0.06 * longest } else { 1.0 };
        let grow = |[low, high]: [f64; 2]| [low - margin, high + margin];
        Some(Window {
            x: grow(bounds.x),
            y: grow(bounds.y),
        })
    }

    fn window(&self, context: &Context) -> Result<Window> {
        let window = self.window.or(context.window);
        window
            .ok_or_else(|| Error::Empty {
                chart: self.caption.clone(),
            })?
            .checked()
    }
}

impl Drawable for Shapes {
    fn legend(&self) -> Vec<Vec<LegendEntry>> {
        vec![self.curves.iter().filter_map(Curve::legend_entry).collect()]
    }

    fn aspect(&self, context: &Context) -> Result<Option<f64>> {
        Ok(Some(self.window(context)?.aspect()))
    }

    fn margins(&self, context: &Context, _: Spot, _: f64, _: f64) -> Result<Margins> {
        let top = title_height(&self.caption, context.fonts.label, context.cell_width);
        Ok(Margins {
            left: 1.0,
            right: 1.0,
            top: top + 1.0,
            bottom: 1.0,
        })
    }

    fn draw(
        &self,
        context: &Context,
        surface: &mut dyn Surface,
        _: Spot,
        plot: Rect,
        outer: Rect,
    ) -> Result<()> {
        let window = self.window(context)?;
        // Far outside points are pulled in, or their coordinates overflow later on.
        let fraction =
            |value: f64, [low, high]: [f64; 2]| ((value - low) / (high - low)).clamp(-1e4, 1e4);
        let place = |[x, y]: [f64; 2]| -> Point {
            point(
                plot.x + fraction(x, window.x) * plot.width,
                plot.bottom() - fraction(y, window.y) * plot.height,
            )
        };
        surface.rect(plot, WHITE)?;
        for curve in &self.curves {
            let placed: Vec<Vec<Point>> = curve
                .closed_loops()
                .map(|ring| thin(&ring.into_iter().map(place).collect::<Vec<_>>(), 0.2))
                .collect();
            if let Some(fill) = curve.fill.filter(|_| curve.closed) {
                let inside: Vec<Vec<Point>> =
                    placed.iter().map(|ring| clip_loop(ring, &plot)).collect();
                surface.fill(&inside, fill.rgb())?;
            }
            if curve.style != LineStyle::None {
                for piece in placed.iter().flat_map(|ring| clip_polyline(ring, &plot)) {
                    let (width, pattern) = (curve.width, curve.style.pattern());
                    stroke_dashed(surface, &piece, width, curve.colour.rgb(), pattern)?;
                }
            }
        }
        if self.frame {
            outline(surface, plot, 1.0, Rgb(170, 170, 170))?;
        }
        let em = context.fonts.label;
        let at = (plot.centre().x, outer.y);
        draw_lines(
            surface,
            &self.caption,
            (em, INK),
            HPos::Center,
            at,
            context.cell_width,
        )
    }
}

//! What a figure and its panels tell each other.

use crate::axes::Margins;
use crate::axis::{Mapping, Scale};
use crate::error::Result;
use crate::geom::Rect;
use crate::legend::LegendEntry;
use crate::style::Fonts;
use crate::surface::Surface;

/// The part of the plane a drawing shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Left and right end.
    pub x: [f64; 2],
    /// Lower and upper end.
    pub y: [f64; 2],
}

impl Window {
    pub(crate) fn union(self, other: Self) -> Self {
        let join = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        Self {
            x: join(self.x, other.x),
            y: join(self.y, other.y),
        }
    }

    pub(crate) fn aspect(&self) -> f64 {
        (self.y[1] - self.y[0]) / (self.x[1] - self.x[0])
    }

    pub(crate) fn checked(self) -> Result<Self> {
        for (axis, [low, high]) in [("x", self.x), ("y", self.y)] {
            Mapping::new(axis, Scale::Linear, low, high)?;
        }
        Ok(self)
    }
}

/// What a panel needs to know about the figure around it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Context {
    pub fonts: Fonts,
    /// Room for text as wide as the panel with its margins.
    pub cell_width: f64,
    /// Legends are collected below the whole figure.
    pub shared_legend: bool,
    /// Common window of the panels of plane curves.
    pub window: Option<Window>,
}

/// Where a panel draws its own legend.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Spot {
    Nowhere,
    Inside,
    Below,
    Right,
}

/// What the layout asks of a panel.
pub(crate) trait Drawable {
    /// Groups of entries for the legend.
    fn legend(&self) -> Vec<Vec<LegendEntry>>;

    /// Height over width of the plot box, if that is fixed.
    fn aspect(&self, _context: &Context) -> Result<Option<f64>> {
        Ok(None)
    }

    /// Decides about the legend, given the approximate size of the plot box.
    fn spot(&self, _context: &Context, _width: f64, _height: f64) -> Result<Spot> {
        Ok(Spot::Nowhere)
    }

    /// Room needed around a plot box of the given size.
    fn margins(&self, context: &Context, spot: Spot, width: f64, height: f64) -> Result<Margins>;

    /// Draws the panel with its plot box at `plot`; text may use all of `outer`.
    fn draw(
        &self,
        context: &Context,
        surface: &mut dyn Surface,
        spot: Spot,
        plot: Rect,
        outer: Rect,
    ) -> Result<()>;
}

//! Heat maps: a two-dimensional array as colours.

use srgb::Rgb;

use crate::axes::{Axes, Ruler};
use crate::axis::{Axis, Window};
use crate::colour::{FRAME, viridis};
use crate::drawable::Drawable;
use crate::error::{Error, Result};
use crate::geom::{Margins, Rect};
use crate::style::Fonts;
use crate::surface::Surface;

/// An array as viridis colours, with a colour bar.
#[derive(Debug, Clone, PartialEq)]
pub struct Heatmap {
    pub(crate) title: String,
    x: Axis,
    y: Axis,
    shape: [usize; 2],
    values: Vec<f64>,
    bar: Axis,
}

impl Heatmap {
    /// A heat map with its axes and its colour bar. Ranges of the axes are the outer edges of the cells, 0 to 1 if there is none; without
    /// a range the colours span the data.
    ///
    /// `values[i * shape[1] + j]` belongs to the `i`-th position along the horizontal axis and the `j`-th along the vertical one.
    /// Values that cannot be shown (NaN, or not positive on a logarithmic colour axis) are drawn grey.
    pub fn new(
        title: impl Into<String>,
        [x, y, bar]: [Axis; 3],
        shape: [usize; 2],
        values: impl Into<Vec<f64>>,
    ) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            shape,
            values: values.into(),
            bar,
        }
    }

    pub(crate) fn checked(&self, fonts: Fonts) -> Result<Coloured<'_>> {
        Error::check_shape(&self.title, self.shape, self.values.len())?;
        let colours = self.bar.resolve(self.values.iter().copied(), 0.0)?;
        let colours = colours.ok_or_else(|| Error::Empty(self.title.clone()))?;
        let bar = Ruler::new(&self.bar, colours, fonts);
        let ends = [&self.x, &self.y].map(|axis| axis.range.unwrap_or([0.0, 1.0]));
        let window = Window::linear([&self.x.label, &self.y.label], ends)?;
        let axes = Axes::new(window, [&self.x, &self.y], fonts);
        Ok(Coloured {
            map: self,
            axes,
            bar,
        })
    }
}

/// A heat map with the ends of its axes and of its colour bar.
pub(crate) struct Coloured<'a> {
    map: &'a Heatmap,
    axes: Axes<'a>,
    bar: Ruler<'a>,
}

const BAR_GAP: f64 = 10.0;
const BAR_WIDTH: f64 = 14.0;

impl Drawable for Coloured<'_> {
    fn aspect(&self) -> Option<f64> {
        Some(self.axes.window.aspect())
    }

    fn margins(&self, width: f64, height: f64) -> Margins {
        let margins = self.axes.margins(width, height);
        let (beside, above) = self.bar.room_up(height);
        Margins {
            right: BAR_GAP + BAR_WIDTH + beside + 6.0,
            top: margins.top.max(above),
            ..margins
        }
    }

    fn draw(&self, surface: &mut dyn Surface, plot: Rect) {
        let [columns, rows] = self.map.shape;
        // Row by row from the top, as a picture stores them.
        let column = |j: usize| (0..columns).map(move |i| i * rows + j);
        let values = (0..rows).rev().flat_map(column).map(|k| self.map.values[k]);
        let colour = |value: f64| match self.bar.map.fraction(value) {
            share if self.map.bar.shows(value) => viridis(share),
            _ => viridis(f64::NAN),
        };
        let cells: Vec<Rgb> = values.map(colour).collect();
        surface.image(plot, columns, &cells, false);
        self.axes.draw_frame(surface, plot);
        let bar = Rect::new(plot.right() + BAR_GAP, plot.y, BAR_WIDTH, plot.height);
        let shades = (0..=255).rev().map(|k| viridis(f64::from(k) / 255.0));
        let shades: Vec<Rgb> = shades.collect();
        surface.image(bar, 1, &shades, false);
        surface.outline(bar, FRAME);
        self.bar.draw_up(surface, bar, true);
    }
}

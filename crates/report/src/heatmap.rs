//! Heat maps: a two-dimensional array as colours.

use crate::axes::{Axes, Margins, Ruler};
use crate::axis::{Axis, Mapping, Scale};
use crate::colour::{FRAME, viridis};
use crate::error::{Error, Result};
use crate::geom::Rect;
use crate::panel::Drawable;
use crate::style::Fonts;
use crate::surface::Surface;

/// An array as viridis colours, with a colour bar.
///
/// Values are in grid order: `values[i * shape[1] + j]` belongs to the `i`-th position along the
/// horizontal axis and the `j`-th along the vertical one (row-major, last axis fastest, `y` up).
#[derive(Debug, Clone, PartialEq)]
pub struct Heatmap {
    /// Title above the plot; may be empty.
    pub title: String,
    /// Horizontal axis (axis 0 of the array). Its range, `[0, 1]` if there is none, spans the outer
    /// edges of the cells.
    pub x: Axis,
    /// Vertical axis (axis 1 of the array), likewise.
    pub y: Axis,
    /// Number of cells along `x` and `y`.
    pub shape: [usize; 2],
    /// The array. Values that cannot be shown (NaN, or not positive on a logarithmic colour axis)
    /// are drawn grey.
    pub values: Vec<f64>,
    /// Label, scale and range of the colour bar. An automatic range spans the data.
    pub bar: Axis,
}

impl Heatmap {
    /// A heat map on the unit square with an automatic, linear colour range.
    pub fn new(title: impl Into<String>, shape: [usize; 2], values: impl Into<Vec<f64>>) -> Self {
        Self {
            title: title.into(),
            x: Axis::linear("x"),
            y: Axis::linear("y"),
            shape,
            values: values.into(),
            bar: Axis::linear(""),
        }
    }

    /// Sets both axes. A range on an axis is the extent of the array in that direction.
    #[must_use]
    pub fn with_axes(mut self, x: Axis, y: Axis) -> Self {
        (self.x, self.y) = (x, y);
        self
    }

    /// Sets label, scale and range of the colour bar.
    #[must_use]
    pub fn with_bar(mut self, bar: Axis) -> Self {
        self.bar = bar;
        self
    }

    /// The heat map with the ends of its axes.
    pub(crate) fn checked(&self, fonts: Fonts) -> Result<Coloured<'_>> {
        Error::check_shape(&self.title, self.shape, self.values.len())?;
        let side = |axis: &'_ Axis| {
            let [low, high] = axis.range.unwrap_or([0.0, 1.0]);
            Mapping::new(&axis.label, Scale::Linear, low, high)
        };
        let mut values = self.values.iter().copied().filter(|&v| self.bar.shows(v));
        let first = values.next();
        let padding = if values.all(|v| Some(v) == first) {
            0.05
        } else {
            0.0
        };
        let colours = self.bar.resolve(self.values.iter().copied(), padding)?;
        let chart = self.title.clone();
        let ruler = |axis, map| Ruler { axis, map, fonts };
        Ok(Coloured {
            map: self,
            axes: Axes {
                x: ruler(&self.x, side(&self.x)?),
                y: ruler(&self.y, side(&self.y)?),
            },
            bar: ruler(&self.bar, colours.ok_or(Error::Empty { chart })?),
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
        let length = |ruler: &Ruler<'_>| ruler.map.high - ruler.map.low;
        Some(length(&self.axes.y) / length(&self.axes.x))
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

    fn draw(&self, surface: &mut dyn Surface, plot: Rect) -> Result<()> {
        let [columns, rows] = self.map.shape;
        // Row by row from the top, as a picture stores them.
        let cells = (0..rows)
            .rev()
            .flat_map(|j| (0..columns).map(move |i| (i, j)));
        let colour = |(i, j)| {
            let value: f64 = self.map.values[i * rows + j];
            let known = self.map.bar.shows(value);
            viridis(if known {
                self.bar.map.fraction(value)
            } else {
                f64::NAN
            })
        };
        surface.image(plot, columns, &cells.map(colour).collect::<Vec<_>>(), false)?;
        self.axes.draw_frame(surface, plot)?;
        let bar = Rect::new(plot.right() + BAR_GAP, plot.y, BAR_WIDTH, plot.height);
        let shades: Vec<_> = (0..=255)
            .rev()
            .map(|k| viridis(f64::from(k) / 255.0))
            .collect();
        surface.image(bar, 1, &shades, false)?;
        surface.outline(bar, FRAME)?;
        self.bar.draw_up(surface, bar, true)
    }
}

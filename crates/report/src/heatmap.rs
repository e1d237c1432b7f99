//! Heat maps: a two-dimensional array as colours.

use plotters_backend::text_anchor::HPos;
use srgb::Rgb;

use crate::axes::{Axes, Margins, draw_lines, snap, title_height};
use crate::axis::{Axis, Mapping, Scale, Ticks};
use crate::colour::{ColourMap, FRAME, INK};
use crate::error::{Error, Result};
use crate::font;
use crate::geom::{Point, Rect, clip_polyline, point, thin};
use crate::legend::LegendEntry;
use crate::panel::{Context, Drawable, Spot};
use crate::shapes::Curve;
use crate::surface::{Scaling, Surface, Text, outline, stroke_dashed};

/// A description of a heat map with a colour bar.
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
    /// Colour map.
    pub map: ColourMap,
    /// Label, scale and range of the colour bar. An automatic range spans the data; with
    /// [`ColourMap::BlueWhiteRed`] on a linear scale it is symmetric about 0.
    pub bar: Axis,
    /// Whether the colour bar is drawn.
    pub show_bar: bool,
    /// Curves on top, such as zero level sets, in the coordinates of the axes.
    pub curves: Vec<Curve>,
}

impl Heatmap {
    /// A viridis heat map on the unit square with an automatic, linear colour range.
    pub fn new(title: impl Into<String>, shape: [usize; 2], values: impl Into<Vec<f64>>) -> Self {
        Self {
            title: title.into(),
            x: Axis::linear("x"),
            y: Axis::linear("y"),
            shape,
            values: values.into(),
            map: ColourMap::Viridis,
            bar: Axis::linear(""),
            show_bar: true,
            curves: Vec::new(),
        }
    }

    /// Sets both axes. A range on an axis is the extent of the array in that direction.
    #[must_use]
    pub fn with_axes(mut self, x: Axis, y: Axis) -> Self {
        (self.x, self.y) = (x, y);
        self
    }

    /// Sets the colour map.
    #[must_use]
    pub fn with_map(mut self, map: ColourMap) -> Self {
        self.map = map;
        self
    }

    /// Sets label, scale and range of the colour bar.
    #[must_use]
    pub fn with_bar(mut self, bar: Axis) -> Self {
        self.bar = bar;
        self
    }

    /// Leaves the colour bar out.
    #[must_use]
    pub fn without_bar(mut self) -> Self {
        self.show_bar = false;
        self
    }

    /// Draws a curve on top.
    #[must_use]
    pub fn with_curve(mut self, curve: Curve) -> Self {
        self.curves.push(curve);
        self
    }

    fn axes(&self, context: &Context) -> Result<Axes<'_>> {
        let expected = self.shape[0] * self.shape[1];
        if self.values.len() != expected {
            return Err(Error::ArrayShape {
                chart: self.title.clone(),
                shape: self.shape,
                expected,
                found: self.values.len(),
            });
        }
        let extent = |axis: &Axis| {
            let [low, high] = axis.range.unwrap_or([0.0, 1.0]);
            Mapping::new(&axis.label, Scale::Linear, low, high)
        };
        Ok(Axes {
            x: (&self.x, extent(&self.x)?),
            y: (&self.y, extent(&self.y)?),
            grid: false,
            fonts: context.fonts,
        })
    }

    fn colours(&self) -> Result<Mapping> {
        let largest = || {
            let sizes = self
                .values
                .iter()
                .filter(|v| v.is_finite())
                .map(|v| v.abs());
            sizes.fold(0.0_f64, f64::max)
        };
        let symmetric = self.map == ColourMap::BlueWhiteRed
            && self.bar.scale == Scale::Linear
            && self.bar.range.is_none()
            && largest() > 0.0;
        let mapping = if symmetric {
            Some(Mapping::new(
                &self.bar.label,
                Scale::Linear,
                -largest(),
                largest(),
            )?)
        } else {
            let padding = if self.is_constant() { 0.05 } else { 0.0 };
            self.bar.resolve(self.values.iter().copied(), padding)?
        };
        mapping.ok_or_else(|| Error::Empty {
            chart: self.title.clone(),
        })
    }

    fn is_constant(&self) -> bool {
        let shown = || self.values.iter().copied().filter(|&v| self.bar.shows(v));
        shown().fold(f64::INFINITY, f64::min) >= shown().fold(f64::NEG_INFINITY, f64::max)
    }

    /// Colours of the cells row by row from the top, as a picture stores them.
    fn cells(&self, colours: &Mapping) -> Vec<Rgb> {
        let [columns, rows] = self.shape;
        (0..rows)
            .rev()
            .flat_map(|j| (0..columns).map(move |i| self.values[i * rows + j]))
            .map(|value| {
                let t = if self.bar.shows(value) {
                    colours.fraction(value)
                } else {
                    f64::NAN
                };
                self.map.at(t)
            })
            .collect()
    }

    fn bar_ticks(&self, context: &Context, height: f64) -> Result<Ticks> {
        Ok(self
            .colours()?
            .ticks(height.max(1.0), |_| 2.1 * context.fonts.tick))
    }

    fn draw_bar(&self, context: &Context, surface: &mut dyn Surface, plot: &Rect) -> Result<()> {
        const SHADES: u32 = 256;
        let fonts = context.fonts;
        let colours = self.colours()?;
        let bar = Rect::new(plot.right() + BAR_GAP, plot.y, BAR_WIDTH, plot.height);
        let shades: Vec<Rgb> = (0..SHADES)
            .rev()
            .map(|k| self.map.at(f64::from(k) / f64::from(SHADES - 1)))
            .collect();
        surface.image(bar, 1, &shades, Scaling::Cells)?;
        outline(surface, bar, 1.0, FRAME)?;
        let ticks = self.bar_ticks(context, plot.height)?;
        let at = |value: f64| snap(bar.bottom() - colours.fraction(value) * bar.height);
        for &value in &ticks.minor {
            let y = at(value);
            surface.stroke(
                &[point(bar.right() - 3.0, y), point(bar.right(), y)],
                1.0,
                FRAME,
            )?;
        }
        let mut text = Text {
            line: "",
            at: point(bar.right() + BAR_TICK + 4.0, 0.0),
            em: fonts.tick,
            colour: INK,
            align: HPos::Left,
            vertical: false,
        };
        for (value, label) in &ticks.major {
            let y = at(*value);
            surface.stroke(
                &[point(bar.right(), y), point(bar.right() + BAR_TICK, y)],
                1.0,
                FRAME,
            )?;
            surface.text(Text {
                line: label,
                at: point(text.at.x, y),
                ..text
            })?;
        }
        if let Some(factor) = &ticks.factor {
            surface.text(Text {
                line: factor,
                at: point(bar.x, bar.y - 0.9 * fonts.tick),
                ..text
            })?;
        }
        text.em = fonts.label;
        text.at = point(
            text.at.x + widest(&ticks, fonts.tick) + 7.0 + 0.5 * fonts.label,
            plot.centre().y,
        );
        surface.text(Text {
            line: &self.bar.label,
            align: HPos::Center,
            vertical: true,
            ..text
        })
    }
}

const BAR_GAP: f64 = 10.0;
const BAR_WIDTH: f64 = 14.0;
const BAR_TICK: f64 = 4.0;

fn widest(ticks: &Ticks, em: f64) -> f64 {
    ticks
        .major
        .iter()
        .map(|(_, label)| font::width(label, em))
        .fold(0.0, f64::max)
}

impl Drawable for Heatmap {
    fn legend(&self) -> Vec<Vec<LegendEntry>> {
        vec![self.curves.iter().filter_map(Curve::legend_entry).collect()]
    }

    fn aspect(&self, context: &Context) -> Result<Option<f64>> {
        let axes = self.axes(context)?;
        Ok(Some(
            (axes.y.1.high - axes.y.1.low) / (axes.x.1.high - axes.x.1.low),
        ))
    }

    fn margins(&self, context: &Context, _: Spot, width: f64, height: f64) -> Result<Margins> {
        let mut margins = self.axes(context)?.margins(width, height);
        if self.show_bar {
            let ticks = self.bar_ticks(context, height)?;
            let fonts = context.fonts;
            let label = if self.bar.label.is_empty() {
                0.0
            } else {
                9.0 + 1.1 * fonts.label
            };
            let numbers = BAR_TICK + 4.0 + widest(&ticks, fonts.tick);
            margins.right = (BAR_GAP + BAR_WIDTH + numbers + label + 4.0).ceil();
            if ticks.factor.is_some() {
                margins.top = margins.top.max((1.5 * fonts.tick).ceil());
            }
        }
        margins.top += title_height(&self.title, context.fonts.title, context.cell_width);
        Ok(margins)
    }

    fn draw(
        &self,
        context: &Context,
        surface: &mut dyn Surface,
        _: Spot,
        plot: Rect,
        outer: Rect,
    ) -> Result<()> {
        let axes = self.axes(context)?;
        let cells = self.cells(&self.colours()?);
        surface.image(plot, self.shape[0], &cells, Scaling::Cells)?;
        for curve in &self.curves {
            for ring in curve.closed_loops() {
                let placed: Vec<Point> = ring.iter().map(|&p| axes.place(&plot, p)).collect();
                for piece in clip_polyline(&thin(&placed, 0.2), &plot) {
                    let (width, pattern) = (curve.width, curve.style.pattern());
                    stroke_dashed(surface, &piece, width, curve.colour.rgb(), pattern)?;
                }
            }
        }
        axes.draw_frame(surface, plot)?;
        if self.show_bar {
            self.draw_bar(context, surface, &plot)?;
        }
        let ink = (context.fonts.title, INK);
        let middle = (plot.centre().x, outer.y);
        draw_lines(
            surface,
            &self.title,
            ink,
            HPos::Center,
            middle,
            context.cell_width,
        )
    }
}

//! Frame, grid, ticks and labels around a plot: shared by line charts and heat maps.

use plotters_backend::text_anchor::HPos;
use srgb::Rgb;

use crate::axis::{Axis, Mapping, Scale, Ticks};
use crate::colour::{FRAME, GRID, INK};
use crate::error::Result;
use crate::font;
use crate::geom::{Point, Rect, point};
use crate::style::{Fonts, LEADING};
use crate::surface::{Surface, Text, outline};

/// Room a panel needs around its plot box.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Margins {
    pub left: f64,
    pub right: f64,
    pub top: f64,
    pub bottom: f64,
}

impl Margins {
    pub fn max(self, other: Self) -> Self {
        Self {
            left: self.left.max(other.left),
            right: self.right.max(other.right),
            top: self.top.max(other.top),
            bottom: self.bottom.max(other.bottom),
        }
    }
}

const TICK: f64 = 5.0;
const MINOR_TICK: f64 = 3.0;
const TICK_GAP: f64 = 5.0;
const LABEL_GAP: f64 = 7.0;

/// A pair of axes with known ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Axes<'a> {
    pub x: (&'a Axis, Mapping),
    pub y: (&'a Axis, Mapping),
    pub grid: bool,
    pub fonts: Fonts,
}

impl Axes<'_> {
    fn x_ticks(&self, width: f64) -> Ticks {
        let em = self.fonts.tick;
        self.x
            .1
            .ticks(width.max(1.0), |label| font::width(label, em) + 2.0 * em)
    }

    fn y_ticks(&self, height: f64) -> Ticks {
        let em = self.fonts.tick;
        self.y.1.ticks(height.max(1.0), |_| 2.1 * em)
    }

    fn widest(&self, ticks: &Ticks) -> f64 {
        ticks
            .major
            .iter()
            .map(|(_, l)| font::width(l, self.fonts.tick))
            .fold(0.0, f64::max)
    }

    /// Room for ticks and labels around a plot box of about this size.
    pub fn margins(&self, width: f64, height: f64) -> Margins {
        let (x_ticks, y_ticks) = (self.x_ticks(width), self.y_ticks(height));
        let overhang = x_ticks.major.last().map_or(0.0, |(value, label)| {
            let reach = 0.5 * font::width(label, self.fonts.tick);
            reach - (1.0 - self.x.1.fraction(*value)) * width
        });
        let label = |axis: &Axis| {
            if axis.label.is_empty() {
                0.0
            } else {
                LABEL_GAP + 1.1 * self.fonts.label
            }
        };
        Margins {
            left: (TICK_GAP + self.widest(&y_ticks) + label(self.y.0) + 2.0).ceil(),
            right: overhang.max(6.0).ceil(),
            top: if y_ticks.factor.is_some() {
                (1.5 * self.fonts.tick).ceil()
            } else {
                6.0
            },
            bottom: (TICK_GAP + 1.2 * self.fonts.tick + label(self.x.0) + 2.0).ceil(),
        }
    }

    /// The place of a data point in the plot box.
    pub fn place(&self, plot: &Rect, [x, y]: [f64; 2]) -> Point {
        // Far outside values are pulled in, or their coordinates overflow later on.
        let fraction = |map: &Mapping, value: f64| map.fraction(value).clamp(-1e4, 1e4);
        point(
            plot.x + fraction(&self.x.1, x) * plot.width,
            plot.bottom() - fraction(&self.y.1, y) * plot.height,
        )
    }

    /// Grid lines; goes under the data.
    pub fn draw_grid(&self, surface: &mut dyn Surface, plot: Rect) -> Result<()> {
        if !self.grid {
            return Ok(());
        }
        let faint = Rgb(243, 243, 243);
        let (x_ticks, y_ticks) = (self.x_ticks(plot.width), self.y_ticks(plot.height));
        let minor_y = (self.y.1.scale == Scale::Log).then_some(&y_ticks.minor);
        for &value in minor_y.into_iter().flatten() {
            let y = snap(self.place(&plot, [self.x.1.low, value]).y);
            surface.stroke(&[point(plot.x, y), point(plot.right(), y)], 1.0, faint)?;
        }
        for (value, _) in &x_ticks.major {
            let x = snap(self.place(&plot, [*value, self.y.1.low]).x);
            surface.stroke(&[point(x, plot.y), point(x, plot.bottom())], 1.0, GRID)?;
        }
        for (value, _) in &y_ticks.major {
            let y = snap(self.place(&plot, [self.x.1.low, *value]).y);
            surface.stroke(&[point(plot.x, y), point(plot.right(), y)], 1.0, GRID)?;
        }
        Ok(())
    }

    /// Frame, ticks and labels; goes over the data.
    pub fn draw_frame(&self, surface: &mut dyn Surface, plot: Rect) -> Result<()> {
        outline(surface, plot, 1.0, FRAME)?;
        self.draw_x(surface, plot)?;
        self.draw_y(surface, plot)
    }

    fn draw_x(&self, surface: &mut dyn Surface, plot: Rect) -> Result<()> {
        let ticks = self.x_ticks(plot.width);
        let at = |value: f64| snap(plot.x + self.x.1.fraction(value) * plot.width);
        for (x, length) in marks(&ticks, at) {
            let ends = [point(x, plot.bottom() - length), point(x, plot.bottom())];
            surface.stroke(&ends, 1.0, FRAME)?;
        }
        let em = self.fonts.tick;
        let y = plot.bottom() + TICK_GAP + 0.6 * em;
        let mut text = Text {
            line: "",
            at: point(0.0, y),
            em,
            colour: INK,
            align: HPos::Center,
            vertical: false,
        };
        for (value, label) in &ticks.major {
            surface.text(Text {
                line: label,
                at: point(at(*value), y),
                ..text
            })?;
        }
        let below = y + 0.6 * em + LABEL_GAP + 0.5 * self.fonts.label;
        if let Some(factor) = &ticks.factor {
            let at = point(plot.right(), below);
            surface.text(Text {
                line: factor,
                at,
                align: HPos::Right,
                ..text
            })?;
        }
        text.em = self.fonts.label;
        text.at = point(plot.centre().x, below);
        surface.text(Text {
            line: &self.x.0.label,
            ..text
        })
    }

    fn draw_y(&self, surface: &mut dyn Surface, plot: Rect) -> Result<()> {
        let ticks = self.y_ticks(plot.height);
        let at = |value: f64| snap(plot.bottom() - self.y.1.fraction(value) * plot.height);
        for (y, length) in marks(&ticks, at) {
            surface.stroke(&[point(plot.x, y), point(plot.x + length, y)], 1.0, FRAME)?;
        }
        let em = self.fonts.tick;
        let right = plot.x - TICK_GAP;
        let text = Text {
            line: "",
            at: point(right, 0.0),
            em,
            colour: INK,
            align: HPos::Right,
            vertical: false,
        };
        for (value, label) in &ticks.major {
            surface.text(Text {
                line: label,
                at: point(right, at(*value)),
                ..text
            })?;
        }
        if let Some(factor) = &ticks.factor {
            let at = point(plot.x, plot.y - 0.9 * em);
            surface.text(Text {
                line: factor,
                at,
                align: HPos::Left,
                ..text
            })?;
        }
        let x = right - self.widest(&ticks) - LABEL_GAP - 0.5 * self.fonts.label;
        surface.text(Text {
            line: &self.y.0.label,
            at: point(x, plot.centre().y),
            em: self.fonts.label,
            align: HPos::Center,
            vertical: true,
            ..text
        })
    }
}

/// Positions and lengths of the tick marks.
fn marks(ticks: &Ticks, at: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    let minor = ticks.minor.iter().map(|&value| (at(value), MINOR_TICK));
    minor
        .chain(ticks.major.iter().map(|(value, _)| (at(*value), TICK)))
        .collect()
}

/// Puts hairlines on whole pixels, so that they are not smeared over two.
pub(crate) fn snap(coordinate: f64) -> f64 {
    (2.0 * coordinate).round() / 2.0
}

/// Height of a wrapped title above a panel.
pub(crate) fn title_height(title: &str, em: f64, width: f64) -> f64 {
    let lines = font::wrap(title, em, width).len();
    if lines == 0 {
        0.0
    } else {
        (lines as f64 * LEADING * em + 5.0).ceil()
    }
}

/// Draws wrapped lines centred at (or starting from) `x`, the first one below `top`.
pub(crate) fn draw_lines(
    surface: &mut dyn Surface,
    text: &str,
    (em, colour): (f64, Rgb),
    align: HPos,
    (x, top): (f64, f64),
    width: f64,
) -> Result<()> {
    for (k, line) in font::wrap(text, em, width).iter().enumerate() {
        let y = top + (k as f64 + 0.5) * LEADING * em;
        surface.text(Text {
            line,
            at: point(x, y),
            em,
            colour,
            align,
            vertical: false,
        })?;
    }
    Ok(())
}

//! Frame, grid, ticks and labels around a plot: shared by line charts and heat maps.

use glam::dvec2;

use crate::axis::{Axis, Mapping, Ticks, Window};
use crate::colour::{FRAME, GRID, INK, MINOR_GRID};
use crate::font::{self, Align, TextStyle};
use crate::geom::{Margins, Rect};
use crate::style::Fonts;
use crate::surface::Surface;

const TICK: f64 = 5.0;
const MINOR_TICK: f64 = 3.0;
const TICK_GAP: f64 = 5.0;
const LABEL_GAP: f64 = 7.0;

/// An axis with known ends and what it takes to draw it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ruler<'a> {
    pub label: &'a str,
    pub map: Mapping,
    pub fonts: Fonts,
}

impl<'a> Ruler<'a> {
    pub fn new(axis: &'a Axis, map: Mapping, fonts: Fonts) -> Self {
        let label = &axis.label;
        Self { label, map, fonts }
    }

    fn ticks_along(&self, width: f64) -> Ticks {
        let em = self.fonts.tick;
        let extent = |label: &str| font::width(label, em) + 2.0 * em;
        self.map.ticks(width.max(1.0), extent)
    }

    fn ticks_up(&self, height: f64) -> Ticks {
        self.map.ticks(height.max(1.0), |_| 2.1 * self.fonts.tick)
    }

    fn widest(&self, ticks: &Ticks) -> f64 {
        let widths = (ticks.major.iter()).map(|(_, label)| font::width(label, self.fonts.tick));
        widths.fold(0.0, f64::max)
    }

    /// Room for the label, if there is one.
    fn label_room(&self) -> f64 {
        if self.label.is_empty() {
            return 0.0;
        }
        LABEL_GAP + 1.1 * self.fonts.label
    }

    /// Room beside a vertical axis for its numbers and label, and above it for the factor of the numbers.
    pub fn room_up(&self, height: f64) -> (f64, f64) {
        let ticks = self.ticks_up(height);
        let beside = TICK_GAP + self.widest(&ticks) + self.label_room() + 2.0;
        let above = ticks.factor.map_or(6.0, |_| 1.5 * self.fonts.tick);
        (beside.ceil(), above.ceil())
    }

    /// Room below a horizontal axis, and to the right for half its last number.
    fn room_along(&self, width: f64) -> (f64, f64) {
        let below = TICK_GAP + 1.2 * self.fonts.tick + self.label_room() + 2.0;
        let overhang = |(value, label): &(f64, String)| {
            0.5 * font::width(label, self.fonts.tick) - (1.0 - self.map.fraction(*value)) * width
        };
        let right = self.ticks_along(width).major.last().map_or(0.0, overhang);
        (below.ceil(), right.max(6.0).ceil())
    }

    /// Ticks, numbers and label of a horizontal axis at the lower edge of `plot`.
    fn draw_along(&self, surface: &mut dyn Surface, plot: Rect) {
        let ticks = self.ticks_along(plot.width);
        let at = |value: f64| snap(plot.x + self.map.fraction(value) * plot.width);
        for (x, length) in marks(&ticks, at) {
            let ends = [dvec2(x, plot.bottom() - length), dvec2(x, plot.bottom())];
            surface.stroke(&ends, 1.0, FRAME);
        }
        let (em, number) = (self.fonts.tick, TextStyle::new(self.fonts.tick, INK));
        let y = plot.bottom() + TICK_GAP + 0.6 * em;
        for (value, label) in &ticks.major {
            surface.text(label, dvec2(at(*value), y), number);
        }
        let below = y + 0.6 * em + LABEL_GAP + 0.5 * self.fonts.label;
        if let Some(factor) = &ticks.factor {
            let corner = dvec2(plot.right(), below);
            surface.text(factor, corner, number.aligned(Align::Right));
        }
        let label = TextStyle::new(self.fonts.label, INK);
        surface.text(self.label, dvec2(plot.centre().x, below), label);
    }

    /// Ticks, numbers and label of a vertical axis at the left edge of `area`, or outside at its right edge.
    pub fn draw_up(&self, surface: &mut dyn Surface, area: Rect, right: bool) {
        let (edge, beside, side, align) = if right {
            (area.right(), TICK + TICK_GAP, 1.0, Align::Left)
        } else {
            (area.x, -TICK_GAP, -1.0, Align::Right)
        };
        let ticks = self.ticks_up(area.height);
        let at = |value: f64| snap(area.bottom() - self.map.fraction(value) * area.height);
        for (y, length) in marks(&ticks, at) {
            surface.stroke(&[dvec2(edge, y), dvec2(edge + length, y)], 1.0, FRAME);
        }
        let number = TextStyle::new(self.fonts.tick, INK);
        for (value, label) in &ticks.major {
            let place = dvec2(edge + beside, at(*value));
            surface.text(label, place, number.aligned(align));
        }
        if let Some(factor) = &ticks.factor {
            let above = dvec2(area.x, area.y - 0.9 * self.fonts.tick);
            surface.text(factor, above, number.aligned(Align::Left));
        }
        let away = self.widest(&ticks) + LABEL_GAP + 0.5 * self.fonts.label;
        let middle = dvec2(edge + beside + side * away, area.centre().y);
        let upwards = TextStyle::new(self.fonts.label, INK).upwards();
        surface.text(self.label, middle, upwards);
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Axes<'a> {
    pub window: Window,
    x: Ruler<'a>,
    y: Ruler<'a>,
}

impl<'a> Axes<'a> {
    pub fn new(window: Window, [x, y]: [&'a Axis; 2], fonts: Fonts) -> Self {
        Self {
            window,
            x: Ruler::new(x, window.x, fonts),
            y: Ruler::new(y, window.y, fonts),
        }
    }

    /// Room for ticks and labels around a plot box of about this size.
    pub fn margins(&self, width: f64, height: f64) -> Margins {
        let (left, top) = self.y.room_up(height);
        let (bottom, right) = self.x.room_along(width);
        Margins {
            left,
            right,
            top,
            bottom,
        }
    }

    /// Grid lines; goes under the data.
    pub fn draw_grid(&self, surface: &mut dyn Surface, plot: Rect) {
        let (along, up) = (self.x.ticks_along(plot.width), self.y.ticks_up(plot.height));
        let level = |value: f64| {
            let y = snap(plot.bottom() - self.y.map.fraction(value) * plot.height);
            [dvec2(plot.x, y), dvec2(plot.right(), y)]
        };
        for &value in &up.minor {
            surface.stroke(&level(value), 1.0, MINOR_GRID);
        }
        for (value, _) in &along.major {
            let x = snap(plot.x + self.x.map.fraction(*value) * plot.width);
            surface.stroke(&[dvec2(x, plot.y), dvec2(x, plot.bottom())], 1.0, GRID);
        }
        for (value, _) in &up.major {
            surface.stroke(&level(*value), 1.0, GRID);
        }
    }

    /// Frame, ticks and labels; goes over the data.
    pub fn draw_frame(&self, surface: &mut dyn Surface, plot: Rect) {
        surface.outline(plot, FRAME);
        self.x.draw_along(surface, plot);
        self.y.draw_up(surface, plot, false);
    }
}

/// Positions and lengths of the tick marks.
fn marks(ticks: &Ticks, at: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    let minor = ticks.minor.iter().map(|&value| (at(value), MINOR_TICK));
    let major = ticks.major.iter().map(|(value, _)| (at(*value), TICK));
    minor.chain(major).collect()
}

/// Puts hairlines on whole pixels, so that they are not smeared over two.
fn snap(coordinate: f64) -> f64 {
    (2.0 * coordinate).round() / 2.0
}

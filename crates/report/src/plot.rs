//! Line charts.

use glam::DVec2;

use crate::axes::Axes;
use crate::axis::{Axis, Window};
use crate::colour::Colour;
use crate::drawable::Drawable;
use crate::error::{Error, Result};
use crate::geom::{Margins, Rect, clip_polyline, disc, thin};
use crate::legend::LegendEntry;
use crate::style::{Fonts, LineStyle, Marker};
use crate::surface::Surface;

/// A named curve.
#[must_use]
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name and looks.
    pub(crate) entry: LegendEntry,
    /// Data points `[x, y]` in drawing order.
    pub points: Vec<[f64; 2]>,
    width: f64,
}

impl Series {
    /// A solid curve in the first colour of the palette through points `[x, y]` in drawing order. Points that are not finite, or not
    /// positive on a logarithmic axis, are left out and interrupt the curve. Without a name it is not in the legend.
    pub fn new(name: impl Into<String>, points: impl Into<Vec<[f64; 2]>>) -> Self {
        Self {
            entry: LegendEntry::line(name, 0, LineStyle::Solid),
            points: points.into(),
            width: 2.0,
        }
    }

    /// A curve with one point for each record.
    pub fn of<R>(
        name: impl Into<String>,
        records: impl IntoIterator<Item = R>,
        point: impl FnMut(R) -> [f64; 2],
    ) -> Self {
        let points: Vec<[f64; 2]> = records.into_iter().map(point).collect();
        Self::new(name, points)
    }

    /// Sets the colour: a palette index or a [`Colour`].
    pub fn with_colour(mut self, colour: impl Into<Colour>) -> Self {
        self.entry.colour = colour.into();
        self
    }

    /// Sets how the line is stroked (solid by default).
    pub fn with_style(mut self, style: LineStyle) -> Self {
        self.entry.style = style;
        self
    }

    /// Marks the data points, but for those too close to others.
    pub fn with_marker(mut self, marker: Marker) -> Self {
        self.entry.marker = Some(marker);
        self
    }

    /// Shows symbols at the data points, and no line.
    pub fn with_symbols(self, marker: Marker) -> Self {
        self.with_style(LineStyle::None).with_marker(marker)
    }

    /// Sets the width of the line in layout units (2 by default).
    pub fn with_width(mut self, width: f64) -> Self {
        self.width = width;
        self
    }
}

/// Curves over a pair of axes, later ones on top.
#[must_use]
#[derive(Debug, Clone, PartialEq)]
pub struct LineChart {
    pub(crate) title: String,
    x: Axis,
    y: Axis,
    pub(crate) series: Vec<Series>,
    entries: Option<Vec<Vec<LegendEntry>>>,
    /// A remark in small type below the plot; may be empty.
    pub note: String,
}

impl LineChart {
    /// An empty chart; the title above it may be empty.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            series: Vec::new(),
            entries: None,
            note: String::new(),
        }
    }

    /// Adds curves on top of those before.
    pub fn with_curves(mut self, curves: impl IntoIterator<Item = Series>) -> Self {
        self.series.extend(curves);
        self
    }

    /// Replaces the legend by groups of entries; call it once for every group. With line style for the method and colour for the
    /// resolution, two small groups explain many curves.
    pub fn with_entries(mut self, group: impl IntoIterator<Item = LegendEntry>) -> Self {
        let groups = self.entries.get_or_insert_default();
        groups.push(group.into_iter().collect());
        self
    }

    /// Adds a remark in small type below the plot.
    pub fn with_note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    fn shows(&self, [x, y]: [f64; 2]) -> bool {
        self.x.shows(x) && self.y.shows(y)
    }

    pub(crate) fn checked(&self, fonts: Fonts) -> Result<Plot<'_>> {
        let points = self.series.iter().flat_map(|s| &s.points);
        let shown: Vec<[f64; 2]> = points.copied().filter(|&p| self.shows(p)).collect();
        // Symbols need more room at the ends than plain lines.
        let symbols = self.series.iter().any(|s| s.entry.marker.is_some());
        let margin = if symbols { 0.04 } else { 0.02 };
        let x = self.x.resolve(shown.iter().map(|[x, _]| *x), margin)?;
        let y = self.y.resolve(shown.iter().map(|[_, y]| *y), 0.05)?;
        let (Some(x), Some(y), false) = (x, y, shown.is_empty()) else {
            return Err(Error::Empty(self.title.clone()));
        };
        let axes = Axes::new(Window { x, y }, [&self.x, &self.y], fonts);
        Ok(Plot { chart: self, axes })
    }
}

/// So many markers of a line are all drawn, however near to each other.
const FEW: usize = 12;

/// A line chart with the ends of its axes.
pub(crate) struct Plot<'a> {
    chart: &'a LineChart,
    axes: Axes<'a>,
}

impl Drawable for Plot<'_> {
    fn legend(&self) -> Vec<Vec<LegendEntry>> {
        if let Some(groups) = &self.chart.entries {
            return groups.clone();
        }
        let entries = self.chart.series.iter().map(|series| &series.entry);
        let named = entries.filter(|entry| !entry.label.is_empty());
        vec![named.cloned().collect()]
    }

    fn margins(&self, width: f64, height: f64) -> Margins {
        self.axes.margins(width, height)
    }

    fn draw(&self, surface: &mut dyn Surface, plot: Rect) {
        self.axes.draw_grid(surface, plot);
        let bounds = plot.grown(0.5);
        for series in &self.chart.series {
            let entry = &series.entry;
            let colour = entry.colour.rgb();
            let mut symbols = Vec::new();
            for run in series.points.split(|&p| !self.chart.shows(p)) {
                let placed: Vec<DVec2> = run
                    .iter()
                    .map(|&p| self.axes.window.place(&plot, p))
                    .collect();
                // A line of one point would not be seen.
                if let ([one], None) = (&placed[..], entry.marker)
                    && bounds.contains(*one)
                {
                    surface.fill(&[disc(*one, series.width)], colour);
                }
                if entry.style != LineStyle::None {
                    for piece in clip_polyline(&thin(&placed, 0.2), &bounds) {
                        surface.dashed(&piece, series.width, colour, entry.style.pattern());
                    }
                }
                symbols.extend(placed.into_iter().filter(|&p| bounds.contains(p)));
            }
            if let Some(marker) = entry.marker {
                // Along a line of many some of them do.
                if entry.style != LineStyle::None && symbols.len() > FEW {
                    symbols = thin(&symbols, 11.0);
                }
                surface.markers(marker, &symbols, colour);
            }
        }
        self.axes.draw_frame(surface, plot);
    }
}

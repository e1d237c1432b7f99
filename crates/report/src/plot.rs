//! Line charts.

use plotters_backend::text_anchor::HPos;

use crate::axes::{Axes, Margins, draw_lines, snap, title_height};
use crate::axis::Axis;
use crate::colour::{Colour, GREY, INK, WHITE};
use crate::error::{Error, Result};
use crate::font;
use crate::geom::{Point, Rect, clip_polyline, point, sample, thin};
use crate::legend::{Block, Legend, LegendEntry, Sample};
use crate::panel::{Context, Drawable, Spot};
use crate::style::{CURVE_WIDTH, LEADING, LineStyle, Marker, draw_marker};
use crate::surface::{Surface, Text, stroke_dashed};

/// A named curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Legend label; empty keeps the curve out of the legend.
    pub name: String,
    /// Data points `[x, y]` in drawing order. Points that are not finite, or not positive on a
    /// logarithmic axis, are left out and interrupt the curve.
    pub points: Vec<[f64; 2]>,
    /// Colour.
    pub colour: Colour,
    /// Line style.
    pub style: LineStyle,
    /// Symbol at the data points; crowded ones are thinned out.
    pub marker: Option<Marker>,
    /// Width of the line in layout units.
    pub width: f64,
}

impl Series {
    /// A solid curve in the first colour of the palette.
    pub fn new(name: impl Into<String>, points: impl Into<Vec<[f64; 2]>>) -> Self {
        Self {
            name: name.into(),
            points: points.into(),
            colour: Colour::Palette(0),
            style: LineStyle::Solid,
            marker: None,
            width: CURVE_WIDTH,
        }
    }

    /// A curve through `(x[k], y[k])`; surplus values of the longer slice are ignored.
    pub fn from_columns(name: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        let points: Vec<[f64; 2]> = x.iter().zip(y).map(|(&x, &y)| [x, y]).collect();
        Self::new(name, points)
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
    #[must_use]
    pub fn with_colour(mut self, colour: impl Into<Colour>) -> Self {
        self.colour = colour.into();
        self
    }

    /// Sets the line style.
    #[must_use]
    pub fn with_style(mut self, style: LineStyle) -> Self {
        self.style = style;
        self
    }

    /// Marks the data points.
    #[must_use]
    pub fn with_marker(mut self, marker: Marker) -> Self {
        self.marker = Some(marker);
        self
    }

    /// Shows symbols at the data points, and no line.
    #[must_use]
    pub fn with_symbols(self, marker: Marker) -> Self {
        self.with_style(LineStyle::None).with_marker(marker)
    }

    /// Sets the width of the line in layout units (2 by default).
    #[must_use]
    pub fn with_width(mut self, width: f64) -> Self {
        self.width = width;
        self
    }
}

/// A line across the whole plot at a fixed value.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// Where and in which direction.
    pub at: ReferenceAt,
    /// Text next to the line; may be empty.
    pub label: String,
    /// Line style.
    pub style: LineStyle,
}

/// Position of a [`Reference`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ReferenceAt {
    /// A vertical line at this `x`.
    X(f64),
    /// A horizontal line at this `y`.
    Y(f64),
}

impl Reference {
    /// A dashed vertical line.
    pub fn vertical(x: f64, label: impl Into<String>) -> Self {
        Self {
            at: ReferenceAt::X(x),
            label: label.into(),
            style: LineStyle::Dashed,
        }
    }

    /// A dashed horizontal line.
    pub fn horizontal(y: f64, label: impl Into<String>) -> Self {
        Self {
            at: ReferenceAt::Y(y),
            label: label.into(),
            style: LineStyle::Dashed,
        }
    }
}

/// A description of a line chart, drawn alike to SVG and PNG.
#[derive(Debug, Clone, PartialEq)]
pub struct LineChart {
    /// Title above the plot; may be empty.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Curves, later ones on top.
    pub series: Vec<Series>,
    /// Reference lines, below the curves.
    pub references: Vec<Reference>,
    /// Where the legend goes.
    pub legend: Legend,
    /// Groups of legend entries in place of one entry per named series: with line style for the
    /// method and colour for the resolution, two small groups explain many curves.
    pub entries: Option<Vec<Vec<LegendEntry>>>,
    /// A remark in small type below the plot.
    pub note: Option<String>,
}

impl LineChart {
    /// An empty chart.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            series: Vec::new(),
            references: Vec::new(),
            legend: Legend::Auto,
            entries: None,
            note: None,
        }
    }

    /// Adds a curve.
    #[must_use]
    pub fn with_series(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Adds curves, later ones on top.
    #[must_use]
    pub fn with_curves(mut self, curves: impl IntoIterator<Item = Series>) -> Self {
        self.series.extend(curves);
        self
    }

    /// Adds a reference line.
    #[must_use]
    pub fn with_reference(mut self, reference: Reference) -> Self {
        self.references.push(reference);
        self
    }

    /// Places the legend.
    #[must_use]
    pub fn with_legend(mut self, legend: Legend) -> Self {
        self.legend = legend;
        self
    }

    /// Replaces the legend by groups of entries; call it once for every group.
    #[must_use]
    pub fn with_entries(mut self, group: impl IntoIterator<Item = LegendEntry>) -> Self {
        self.entries
            .get_or_insert_default()
            .push(group.into_iter().collect());
        self
    }

    /// Adds a remark below the plot.
    #[must_use]
    pub fn with_note(mut self, note: impl Into<String>) -> Self {
        self.note = Some(note.into());
        self
    }

    fn shows(&self, [x, y]: [f64; 2]) -> bool {
        self.x.shows(x) && self.y.shows(y)
    }

    pub(crate) fn axes(&self, context: &Context) -> Result<Axes<'_>> {
        let empty = || Error::Empty {
            chart: self.title.clone(),
        };
        let points = || {
            self.series
                .iter()
                .flat_map(|s| &s.points)
                .copied()
                .filter(|&p| self.shows(p))
        };
        if points().next().is_none() {
            return Err(empty());
        }
        let lines = |vertical: bool| {
            self.references
                .iter()
                .filter_map(move |reference| match reference.at {
                    ReferenceAt::X(x) if vertical => Some(x),
                    ReferenceAt::Y(y) if !vertical => Some(y),
                    _ => None,
                })
        };
        // Symbols need more room at the ends than plain lines.
        let symbols = self.series.iter().any(|s| s.marker.is_some());
        let margin = if symbols { 0.04 } else { 0.02 };
        let x = self
            .x
            .resolve(points().map(|[x, _]| x).chain(lines(true)), margin)?;
        let y = self
            .y
            .resolve(points().map(|[_, y]| y).chain(lines(false)), 0.05)?;
        Ok(Axes {
            x: (&self.x, x.ok_or_else(empty)?),
            y: (&self.y, y.ok_or_else(empty)?),
            grid: true,
            fonts: context.fonts,
        })
    }

    /// Connected pieces of a curve in the plot box, and its visible data points.
    fn trace(
        &self,
        axes: &Axes<'_>,
        plot: &Rect,
        series: &Series,
    ) -> (Vec<Vec<Point>>, Vec<Point>) {
        let mut pieces = Vec::new();
        let mut symbols = Vec::new();
        for run in series
            .points
            .split(|&p| !self.shows(p))
            .filter(|run| !run.is_empty())
        {
            let placed: Vec<Point> = run.iter().map(|&p| axes.place(plot, p)).collect();
            symbols.extend(
                placed
                    .iter()
                    .copied()
                    .filter(|&p| plot.grown(0.5).contains(p)),
            );
            pieces.extend(clip_polyline(&thin(&placed, 0.2), &plot.grown(0.5)));
        }
        (pieces, symbols)
    }

    /// Points the legend should not cover.
    fn obstacles(&self, axes: &Axes<'_>, plot: &Rect) -> Vec<Point> {
        let mut points = Vec::new();
        for series in &self.series {
            let (pieces, symbols) = self.trace(axes, plot, series);
            points.extend(pieces.iter().flat_map(|piece| sample(piece, 4.0)));
            points.extend(symbols);
        }
        points
    }

    /// Both ends of a reference line, if it is in sight.
    fn reference_line(axes: &Axes<'_>, plot: &Rect, at: ReferenceAt) -> Option<[Point; 2]> {
        match at {
            ReferenceAt::X(x) if axes.x.1.holds(x) => {
                let x = snap(axes.place(plot, [x, axes.y.1.low]).x);
                Some([point(x, plot.bottom()), point(x, plot.y)])
            }
            ReferenceAt::Y(y) if axes.y.1.holds(y) => {
                let y = snap(axes.place(plot, [axes.x.1.low, y]).y);
                Some([point(plot.x, y), point(plot.right(), y)])
            }
            _ => None,
        }
    }

    /// Where the labels of the reference lines go: beside their line where they cover least.
    fn reference_labels(
        &self,
        axes: &Axes<'_>,
        plot: &Rect,
        obstacles: &mut Vec<Point>,
    ) -> Vec<(&Reference, Rect)> {
        let em = axes.fonts.legend;
        let mut placed = Vec::new();
        for reference in self.references.iter().filter(|r| !r.label.is_empty()) {
            let Some([from, to]) = Self::reference_line(axes, plot, reference.at) else {
                continue;
            };
            let length = font::width(&reference.label, em) + 6.0;
            let height = 1.25 * em;
            let room = from.distance(to) - length - 12.0;
            let areas = [1.0, -1.0].into_iter().flat_map(|side| {
                [1.0, 0.0, 0.5, 0.75, 0.25, 0.875, 0.125, 0.625, 0.375]
                    .into_iter()
                    .map(move |t| {
                        let start = 6.0 + t * room;
                        let beside = if side > 0.0 { height + 1.5 } else { -1.5 };
                        match reference.at {
                            ReferenceAt::Y(_) => {
                                Rect::new(from.x + start, from.y - beside, length, height)
                            }
                            ReferenceAt::X(_) => {
                                Rect::new(from.x - beside, from.y - start - length, height, length)
                            }
                        }
                    })
            });
            let best = areas
                .filter(|area| area.corners().iter().all(|&corner| plot.contains(corner)))
                .min_by_key(|area| obstacles.iter().filter(|&&p| area.contains(p)).count());
            if let Some(area) = best {
                let columns = (area.width / 4.0) as usize;
                let rows = (area.height / 4.0) as usize;
                obstacles.extend((0..=columns).flat_map(|i| {
                    (0..=rows).map(move |j| point(area.x + 4.0 * i as f64, area.y + 4.0 * j as f64))
                }));
                placed.push((reference, area));
            }
        }
        placed
    }

    fn draw_series(&self, surface: &mut dyn Surface, axes: &Axes<'_>, plot: &Rect) -> Result<()> {
        for series in &self.series {
            let colour = series.colour.rgb();
            let (pieces, symbols) = self.trace(axes, plot, series);
            if series.style != LineStyle::None {
                for piece in &pieces {
                    stroke_dashed(surface, piece, series.width, colour, series.style.pattern())?;
                }
            }
            if let Some(marker) = series.marker {
                for at in thin(&symbols, 11.0) {
                    draw_marker(surface, marker, at, colour)?;
                }
            }
        }
        Ok(())
    }

    fn note_height(&self, context: &Context) -> f64 {
        self.note.as_ref().map_or(0.0, |note| {
            let lines = font::wrap(note, context.fonts.note, context.cell_width).len();
            6.0 + lines as f64 * LEADING * context.fonts.note
        })
    }
}

impl Drawable for LineChart {
    fn legend(&self) -> Vec<Vec<LegendEntry>> {
        if let Some(groups) = &self.entries {
            return groups.clone();
        }
        let entries: Vec<LegendEntry> = self
            .series
            .iter()
            .filter(|series| !series.name.is_empty())
            .map(|series| LegendEntry {
                label: series.name.clone(),
                colour: series.colour,
                sample: Sample::Line(series.style, series.marker),
            })
            .collect();
        vec![entries]
    }

    fn spot(&self, context: &Context, width: f64, height: f64) -> Result<Spot> {
        let entries = self.legend();
        if context.shared_legend || entries.iter().all(Vec::is_empty) {
            return Ok(Spot::Nowhere);
        }
        Ok(match self.legend {
            Legend::Hidden => Spot::Nowhere,
            Legend::Below => Spot::Below,
            Legend::Right => Spot::Right,
            Legend::Auto => {
                let axes = self.axes(context)?;
                let plot = Rect::new(0.0, 0.0, width, height);
                let mut obstacles = self.obstacles(&axes, &plot);
                self.reference_labels(&axes, &plot, &mut obstacles);
                let free = Block::inside(&entries, context.fonts.legend)
                    .iter()
                    .any(|block| matches!(block.place(&plot, &obstacles), Some((_, 0))));
                if free { Spot::Inside } else { Spot::Below }
            }
        })
    }

    fn margins(&self, context: &Context, spot: Spot, width: f64, height: f64) -> Result<Margins> {
        let mut margins = self.axes(context)?.margins(width, height);
        margins.top += title_height(&self.title, context.fonts.title, context.cell_width);
        margins.bottom += self.note_height(context);
        let entries = self.legend();
        match spot {
            Spot::Below => {
                let block = Block::within(&entries, context.fonts.legend, context.cell_width);
                margins.bottom += block.height() + 2.0;
            }
            Spot::Right => {
                margins.right = Block::column(&entries, context.fonts.legend)
                    .width()
                    .max(margins.right);
            }
            Spot::Inside | Spot::Nowhere => {}
        }
        Ok(margins)
    }

    fn draw(
        &self,
        context: &Context,
        surface: &mut dyn Surface,
        spot: Spot,
        plot: Rect,
        outer: Rect,
    ) -> Result<()> {
        let axes = self.axes(context)?;
        axes.draw_grid(surface, plot)?;
        for reference in &self.references {
            if let Some(line) = Self::reference_line(&axes, &plot, reference.at) {
                stroke_dashed(surface, &line, 1.4, GREY, reference.style.pattern())?;
            }
        }
        let mut obstacles = self.obstacles(&axes, &plot);
        for (reference, area) in self.reference_labels(&axes, &plot, &mut obstacles) {
            surface.rect(area, WHITE)?;
            surface.text(Text {
                line: &reference.label,
                at: area.centre(),
                em: context.fonts.legend,
                colour: GREY,
                align: HPos::Center,
                vertical: matches!(reference.at, ReferenceAt::X(_)),
            })?;
        }
        self.draw_series(surface, &axes, &plot)?;
        axes.draw_frame(surface, plot)?;

        let fonts = context.fonts;
        let middle = plot.centre().x;
        let ink = (fonts.title, INK);
        draw_lines(
            surface,
            &self.title,
            ink,
            HPos::Center,
            (middle, outer.y),
            context.cell_width,
        )?;

        let mut below = plot.bottom() + axes.margins(plot.width, plot.height).bottom;
        let entries = self.legend();
        match spot {
            Spot::Nowhere => {}
            Spot::Inside => {
                let best = Block::inside(&entries, fonts.legend)
                    .into_iter()
                    .filter_map(|block| Some((block.place(&plot, &obstacles)?, block)))
                    .min_by_key(|((_, hits), _)| *hits);
                if let Some(((corner, _), block)) = best {
                    block.draw(surface, corner, true)?;
                }
            }
            Spot::Right => {
                let block = Block::column(&entries, fonts.legend);
                block.draw(surface, point(plot.right() + 6.0, plot.y), false)?;
            }
            Spot::Below => {
                let block = Block::within(&entries, fonts.legend, context.cell_width);
                let left = (middle - 0.5 * block.width())
                    .min(outer.right() - block.width())
                    .max(outer.x);
                block.draw(surface, point(left, below + 2.0), false)?;
                below += block.height() + 2.0;
            }
        }
        if let Some(note) = &self.note {
            let at = (outer.x + 4.0, below + 4.0);
            let small = (fonts.note, GREY);
            draw_lines(surface, note, small, HPos::Left, at, context.cell_width)?;
        }
        Ok(())
    }
}

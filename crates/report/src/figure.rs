//! Figures: panels on a grid, with a heading, row and column labels and a common legend.

use std::collections::HashSet;
use std::ops::RangeInclusive;

use glam::{DVec2, dvec2};

use crate::bitmap;
use crate::colour::{GREY, INK};
use crate::drawable::Drawable;
use crate::error::{Error, Result};
use crate::font::{self, AIR, Align, LEADING, TextStyle};
use crate::geom::{Margins, Rect};
use crate::legend::{Block, LegendEntry};
use crate::output::OutputDir;
use crate::panel::Panel;
use crate::style::Fonts;
use crate::surface::Surface;
use crate::svg;

/// A figure: panels row by row on a grid. Legends are below the panels, where they cover nothing.
#[must_use]
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Heading above all panels; may be empty.
    pub title: String,
    panels: Vec<Panel>,
    columns: usize,
    column_labels: Vec<String>,
    row_labels: Vec<String>,
    shared_legend: bool,
    note: String,
    width: f64,
}

impl<P: Into<Panel>> From<P> for Figure {
    fn from(panel: P) -> Self {
        Self::new("", 1).with_panel(panel)
    }
}

const PADDING: f64 = 12.0;
const COLUMN_GAP: f64 = 16.0;
const ROW_GAP: f64 = 14.0;
const SIDES: RangeInclusive<f64> = 80.0..=2600.0;
const SMALLEST_PLOT: f64 = 40.0;

impl Figure {
    /// A figure without panels, 800 units wide, for `columns` panels in a row.
    pub fn new(title: impl Into<String>, columns: usize) -> Self {
        Self {
            title: title.into(),
            panels: Vec::new(),
            columns,
            column_labels: Vec::new(),
            row_labels: Vec::new(),
            shared_legend: false,
            note: String::new(),
            width: 800.0,
        }
    }

    /// Adds a panel to the right of the last one, or at the start of the next row.
    pub fn with_panel(self, panel: impl Into<Panel>) -> Self {
        self.with_panels([panel])
    }

    /// Adds panels, row by row.
    pub fn with_panels<P: Into<Panel>>(mut self, panels: impl IntoIterator<Item = P>) -> Self {
        self.panels.extend(panels.into_iter().map(Into::into));
        self
    }

    /// Labels the columns above them.
    pub fn with_column_labels<S: Into<String>>(
        mut self,
        labels: impl IntoIterator<Item = S>,
    ) -> Self {
        self.column_labels = labels.into_iter().map(Into::into).collect();
        self
    }

    /// Labels the rows left of them, read upwards; a line break in a label makes two lines.
    pub fn with_row_labels<S: Into<String>>(mut self, labels: impl IntoIterator<Item = S>) -> Self {
        self.row_labels = labels.into_iter().map(Into::into).collect();
        self
    }

    /// Shows one legend below all panels instead of one below each.
    pub fn with_shared_legend(mut self) -> Self {
        self.shared_legend = true;
        self
    }

    /// Adds a remark in small type at the bottom.
    pub fn with_note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Fixes the width; the height follows.
    pub fn with_width(mut self, width: f64) -> Self {
        self.width = width;
        self
    }

    /// The figure as an SVG document, in which text stays text. Every panel needs something to draw, ranges and arrays that fit, and room.
    pub fn to_svg(&self) -> Result<String> {
        let layout = self.layout()?;
        Ok(svg::svg(layout.size, |s| self.draw(&layout, s)))
    }

    /// The figure as a PNG file, two pixels per layout unit.
    pub fn to_png(&self) -> Result<Vec<u8>> {
        let layout = self.layout()?;
        Ok(bitmap::png(layout.size, |s| self.draw(&layout, s)))
    }

    /// Writes `<stem>.svg` and `<stem>.png`.
    pub fn write(&self, folder: &OutputDir, stem: &str) -> Result<()> {
        let (svg, png) = (self.to_svg()?, self.to_png()?);
        folder.write(&format!("{stem}.svg"), svg)?;
        folder.write(&format!("{stem}.png"), png)?;
        Ok(())
    }

    fn columns(&self) -> usize {
        self.columns.clamp(1, self.panels.len())
    }

    fn layout(&self) -> Result<Layout<'_>> {
        if self.panels.is_empty() {
            return Err(Error::NoPanels);
        }
        let refused = |height: f64| {
            let width = self.width;
            Err(Error::FigureSize { width, height })
        };
        if !SIDES.contains(&self.width) {
            return refused(0.0);
        }
        let (width, columns) = (self.width.round(), self.columns());
        let (inner, fonts) = (width - 2.0 * PADDING, Fonts::for_columns(columns));
        let strip = strip(fonts);
        let lines = self.row_labels.iter().map(|label| label.lines().count());
        let left = PADDING + strip * lines.max().unwrap_or(0) as f64;
        let heading = match font::height(&self.title, Fonts::HEADING, inner) {
            0.0 => PADDING,
            height => PADDING + height + 5.0,
        };
        let labelled = !self.column_labels.is_empty();
        let top = heading + if labelled { strip } else { 0.0 };

        let room = width - PADDING - left - COLUMN_GAP * (columns - 1) as f64;
        let cell = |panel| Cell::new(panel, fonts, room / columns as f64, !self.shared_legend);
        let mut cells = self.panels.iter().map(cell).collect::<Result<Vec<_>>>()?;
        let legend_top = arrange(&mut cells, columns, room, dvec2(left, top)) + AIR;
        let shared = self.shared_legend.then(|| joined(&cells));
        let legend = Block::new(shared.as_deref().unwrap_or_default(), fonts.tick, inner);
        let note_top = legend_top + legend.height;
        let height = (note_top + font::height(&self.note, Fonts::NOTE, inner) + PADDING).round();
        let small = |cell: &Cell<'_>| cell.plot.width.min(cell.plot.height) < SMALLEST_PLOT;
        if !SIDES.contains(&height) || cells.iter().any(small) {
            return refused(height);
        }
        cells.iter_mut().for_each(Cell::fit);
        Ok(Layout {
            size: [width, height].map(|side| side as u32),
            fonts,
            cells,
            legend,
            legend_top,
            note_top,
        })
    }

    fn draw(&self, layout: &Layout<'_>, surface: &mut dyn Surface) {
        let (fonts, columns, strip) = (layout.fonts, self.columns(), strip(layout.fonts));
        let (middle, inner) = (0.5 * self.width.round(), self.width - 2.0 * PADDING);
        let heading = TextStyle::new(Fonts::HEADING, INK);
        draw_lines(surface, &self.title, heading, dvec2(middle, PADDING), inner);

        let label = TextStyle::new(fonts.label, INK);
        for (text, cell) in self.column_labels.iter().zip(&layout.cells[..columns]) {
            let at = dvec2(cell.plot.centre().x, cell.outer.y - 0.5 * strip);
            surface.text(text, at, label);
        }
        let rows = layout.cells.iter().step_by(columns);
        for (text, cell) in self.row_labels.iter().zip(rows) {
            for (k, line) in text.lines().enumerate() {
                let x = PADDING + (k as f64 + 0.45) * strip;
                surface.text(line, dvec2(x, cell.plot.centre().y), label.upwards());
            }
        }
        for cell in &layout.cells {
            cell.draw(surface);
        }
        let legend_top = dvec2(middle, layout.legend_top);
        layout.legend.draw(surface, legend_top);
        let style = TextStyle::new(Fonts::NOTE, GREY).aligned(Align::Left);
        let at = dvec2(PADDING + 4.0, layout.note_top + AIR);
        draw_lines(surface, &self.note, style, at, inner);
    }
}

/// Unique entries of all panels, in order of appearance; the k-th groups of all go together.
fn joined(cells: &[Cell<'_>]) -> Vec<Vec<LegendEntry>> {
    let mut seen = HashSet::new();
    let mut groups: Vec<Vec<LegendEntry>> = Vec::new();
    for cell in cells {
        for (k, group) in cell.content.legend().into_iter().enumerate() {
            groups.resize_with(groups.len().max(k + 1), Vec::new);
            groups[k].extend(group.into_iter().filter(|e| seen.insert(e.label.clone())));
        }
    }
    groups
}

/// Room for one line of row or column labels.
fn strip(fonts: Fonts) -> f64 {
    (LEADING * fonts.label + 4.0).ceil()
}

/// Draws wrapped lines below `top`, where they are centred or begin.
fn draw_lines(surface: &mut dyn Surface, text: &str, style: TextStyle, top: DVec2, width: f64) {
    for (k, line) in font::wrap(text, style.em, width).iter().enumerate() {
        let y = top.y + (k as f64 + 0.5) * LEADING * style.em;
        surface.text(line, dvec2(top.x, y), style);
    }
}

/// Where everything is.
struct Layout<'a> {
    size: [u32; 2],
    fonts: Fonts,
    cells: Vec<Cell<'a>>,
    legend: Block,
    legend_top: f64,
    note_top: f64,
}

/// A panel and its place.
struct Cell<'a> {
    panel: &'a Panel,
    content: Box<dyn Drawable + 'a>,
    legend: Block,
    fonts: Fonts,
    /// Room for text as wide as the panel with its margins.
    text_width: f64,
    /// The box of the data,
    plot: Rect,
    /// and that with the margins which the panels of a row or column share.
    outer: Rect,
}

impl<'a> Cell<'a> {
    fn new(panel: &'a Panel, fonts: Fonts, text_width: f64, own_legend: bool) -> Result<Self> {
        let content = panel.checked(fonts)?;
        let legend = if own_legend { content.legend() } else { vec![] };
        Ok(Self {
            panel,
            content,
            legend: Block::new(&legend, fonts.tick, text_width),
            fonts,
            text_width,
            plot: Rect::new(0.0, 0.0, text_width - 70.0, 0.5 * text_width),
            outer: Rect::new(0.0, 0.0, 0.0, 0.0),
        })
    }

    /// Height of the plot box, if it is this wide in one of so many columns.
    fn height(&self, width: f64, columns: usize) -> f64 {
        match self.content.aspect() {
            None if columns == 1 => 0.52 * self.text_width,
            None => 0.66 * self.text_width,
            // A single panel would otherwise be as tall as the figure is wide.
            Some(aspect) if columns == 1 => {
                (aspect.min(1.2) * width).min((0.62 * self.text_width).max(440.0))
            }
            Some(aspect) => aspect.min(1.2) * width,
        }
    }

    /// The title above, and the caption or the remark below.
    fn texts(&self) -> (&str, &str, TextStyle) {
        let small = TextStyle::new(Fonts::NOTE, GREY).aligned(Align::Left);
        match self.panel.texts() {
            [title, "", remark] => (title, remark, small),
            [title, caption, _] => (title, caption, TextStyle::new(self.fonts.label, INK)),
        }
    }

    /// Room for axes and texts around the plot box.
    fn margins(&self) -> Margins {
        let (title, remark, style) = self.texts();
        let mut margins = self.content.margins(self.plot.width, self.plot.height);
        margins.top += font::height(title, self.fonts.title, self.text_width);
        margins.bottom += self.legend.height + font::height(remark, style.em, self.text_width);
        margins
    }

    /// Gives the plot box its own shape within its row; the title stays with it.
    fn fit(&mut self) {
        let whole = self.plot.height / self.plot.width;
        let fitted = self.plot.fitted(self.content.aspect().unwrap_or(whole));
        self.outer.y += fitted.y - self.plot.y;
        self.plot = fitted;
    }

    fn draw(&self, surface: &mut dyn Surface) {
        let (plot, outer, middle) = (self.plot, self.outer, self.plot.centre().x);
        let (title, remark, style) = self.texts();
        let (heading, top) = (TextStyle::new(self.fonts.title, INK), outer.y);
        // In the middle of the plot box, as far as that leaves room.
        let within = |half: f64| middle.min(outer.right() - half).max(outer.x + half);
        let lines = font::wrap(title, heading.em, self.text_width);
        let widths = lines.iter().map(|line| font::width(line, heading.em));
        let at = dvec2(within(0.5 * widths.fold(0.0, f64::max)), top);
        draw_lines(surface, title, heading, at, self.text_width);
        self.content.draw(surface, plot);
        let mut below = plot.bottom() + self.content.margins(plot.width, plot.height).bottom;
        self.legend
            .draw(surface, dvec2(within(0.5 * self.legend.width), below));
        below += self.legend.height;
        let x = match style.align {
            Align::Left => outer.x + 4.0,
            _ => middle,
        };
        let at = dvec2(x, below + AIR);
        draw_lines(surface, remark, style, at, self.text_width);
    }
}

/// Gives all cells their places from a corner on, with plot boxes of one width and of one height in a row, and says where they end.
fn arrange(cells: &mut [Cell<'_>], columns: usize, room: f64, corner: DVec2) -> f64 {
    let mut sides = vec![Margins::default(); columns];
    let mut rows = vec![Margins::default(); cells.len().div_ceil(columns)];
    // Margins depend on the tick labels, those on the sizes, and those on the margins.
    for _ in 0..4 {
        sides.fill(Margins::default());
        rows.fill(Margins::default());
        for (k, cell) in cells.iter().enumerate() {
            let needed = cell.margins();
            sides[k % columns] = sides[k % columns].max(needed);
            rows[k / columns] = rows[k / columns].max(needed);
        }
        let taken: f64 = sides.iter().map(|side| side.left + side.right).sum();
        let width = ((room - taken) / columns as f64).floor();
        for row in cells.chunks_mut(columns) {
            let heights = row.iter().map(|cell| cell.height(width, columns));
            let height = heights.fold(0.0, f64::max).floor();
            for cell in row {
                (cell.plot.width, cell.plot.height) = (width, height);
            }
        }
    }
    let mut y = corner.y;
    for (row, ends) in cells.chunks_mut(columns).zip(&rows) {
        let mut x = corner.x;
        let height = row[0].plot.height;
        for (cell, side) in row.iter_mut().zip(&sides) {
            (cell.plot.x, cell.plot.y) = (x + side.left, y + ends.top);
            let width = side.left + cell.plot.width + side.right;
            cell.outer = Rect::new(x, y, width, ends.top + height + ends.bottom);
            x += width + COLUMN_GAP;
        }
        y += ends.top + height + ends.bottom + ROW_GAP;
    }
    y - ROW_GAP
}

#[cfg(test)]
mod tests {
    use image::RgbImage;
    use proptest::prelude::*;
    use srgb::Rgb;

    use super::*;
    use crate::colour::viridis;
    use crate::{
        Axis, Colour, Curve, Heatmap, LineChart, LineStyle, Marker, OKABE_ITO, Raster, Series,
        Shapes,
    };

    const BLUE: Rgb = OKABE_ITO[0];
    const VERMILLION: Rgb = OKABE_ITO[1];

    /// The pixel at a place in layout units.
    fn at(picture: &RgbImage, [x, y]: [f64; 2]) -> Rgb {
        let [r, g, b] = picture.get_pixel((2.0 * x) as u32, (2.0 * y) as u32).0;
        Rgb(r, g, b)
    }

    /// Whether `colour` occurs within `reach` layout units of a point.
    fn has_near(picture: &RgbImage, Rgb(r, g, b): Rgb, [x, y]: [f64; 2], reach: f64) -> bool {
        let range = |c: f64, limit: u32| {
            let from = (2.0 * (c - reach)).max(0.0) as u32;
            from..=((2.0 * (c + reach)) as u32).min(limit - 1)
        };
        let mut rows = range(y, picture.height());
        let columns = range(x, picture.width());
        rows.any(|y| (columns.clone()).any(|x| picture.get_pixel(x, y).0 == [r, g, b]))
    }

    /// Number of pixels of exactly this colour.
    fn count(picture: &RgbImage, Rgb(r, g, b): Rgb) -> usize {
        picture.pixels().filter(|p| p.0 == [r, g, b]).count()
    }

    fn picture(figure: &Figure) -> RgbImage {
        let file = image::load_from_memory(&figure.to_png().unwrap());
        file.unwrap().into_rgb8()
    }

    /// The plot box of the first panel.
    fn plot(figure: &Figure) -> Rect {
        figure.layout().unwrap().cells[0].plot
    }

    fn unit_square(title: &str) -> LineChart {
        let axis = |label: &str| Axis::linear(label).with_range(0.0, 1.0);
        LineChart::new(title, axis("time t [s]"), axis("length <L>"))
    }

    /// A panel of shapes around the origin.
    fn shapes(caption: &str) -> Shapes {
        Shapes::new(caption, [[-1.12, 1.12]; 2])
    }

    fn heat_map(title: &str, shape: [usize; 2], values: Vec<f64>) -> Heatmap {
        Heatmap::new(title, ["x", "y", ""].map(Axis::linear), shape, values)
    }

    /// The straight line from corner to corner of the plot.
    fn diagonal() -> LineChart {
        let straight = Series::new("straight", vec![[0.0, 0.0], [1.0, 1.0]]);
        unit_square("Diagonal & more").with_curves([straight])
    }

    /// The place of a point of the first panel, from 0 to 1, in layout units.
    fn place(figure: &Figure, [x, y]: [f64; 2]) -> [f64; 2] {
        let plot = plot(figure);
        [plot.x + x * plot.width, plot.bottom() - y * plot.height]
    }

    #[test]
    fn a_curve_is_where_its_points_are() {
        let figure = Figure::from(diagonal());
        let (picture, size) = (picture(&figure), figure.layout().unwrap().size);
        assert_eq!(picture.dimensions(), (2 * size[0], 2 * size[1]));
        assert_eq!(at(&picture, [0.0; 2]), Rgb::WHITE);
        for t in [0.1, 0.25, 0.5, 0.75, 0.9] {
            let [on, beside] = [t, 1.0 - t + 0.15].map(|y| place(&figure, [t, y]));
            assert!(has_near(&picture, BLUE, on, 0.5), "nothing at {t}");
            assert!(
                !has_near(&picture, BLUE, beside, 1.0),
                "something beside {t}"
            );
        }
    }

    #[test]
    fn a_power_law_is_straight_on_logarithmic_axes() {
        let steps = (0..=60).map(|k| 10.0_f64.powf(-3.0 + f64::from(k) / 20.0));
        let axes = (
            Axis::log("h").with_range(1e-3, 1.0),
            Axis::log("e").with_range(1e-6, 1.0),
        );
        let chart = LineChart::new("", axes.0, axes.1);
        let chart = chart.with_curves([Series::of("", steps, |h| [h, h * h])]);
        let figure = Figure::from(chart);
        let picture = picture(&figure);
        for t in [0.2, 0.5, 0.8] {
            let on = place(&figure, [t, t]);
            assert!(has_near(&picture, BLUE, on, 0.6), "not straight at {t}");
        }
    }

    #[test]
    fn points_that_cannot_be_shown_interrupt_the_curve() {
        let points = [0.1, 0.4, f64::NAN, 0.6, 0.9].map(|t| [t, t]);
        let figure = Figure::from(unit_square("Gap").with_curves([Series::new("", points)]));
        let picture = picture(&figure);
        let shown = |t: f64| has_near(&picture, BLUE, place(&figure, [t, t]), 0.5);
        assert!(shown(0.25) && shown(0.75) && !shown(0.5));
    }

    #[test]
    fn nothing_to_draw_is_an_error_that_names_the_panel() {
        let bad = Series::new("bad", vec![[0.0, 0.0], [1.0, -1.0], [f64::NAN, 1.0]]);
        let empty = LineChart::new("c", Axis::linear("t"), Axis::log("W")).with_curves([bad]);
        let panels = [
            Panel::from(empty),
            heat_map("c", [2, 2], vec![f64::NAN; 4]).into(),
            Raster::new("c", [0, 3], vec![]).into(),
        ];
        for panel in panels {
            let error = Figure::from(panel).to_svg().unwrap_err();
            assert!(
                matches!(&error, Error::Empty(chart) if chart == "c"),
                "{error}"
            );
        }
        assert!(matches!(
            Figure::new("", 2).to_svg().unwrap_err(),
            Error::NoPanels
        ));
    }

    #[test]
    fn sizes_and_shapes_that_do_not_fit_are_refused() {
        for width in [10.0, 1e9, f64::NAN, 90.0] {
            let error = Figure::from(diagonal())
                .with_width(width)
                .to_svg()
                .unwrap_err();
            assert!(
                matches!(error, Error::FigureSize { .. }),
                "{width}: {error}"
            );
        }
        let panels = [
            (Panel::from(heat_map("u", [3, 4], vec![0.0; 11])), 11),
            (Raster::new("", [3, 4], vec![[0; 4]; 13]).into(), 13),
            (Raster::new("", [usize::MAX, 2], vec![[0; 4]; 3]).into(), 3),
        ];
        for (panel, length) in panels {
            let error = Figure::from(panel).to_svg().unwrap_err();
            assert!(
                matches!(error, Error::ArrayShape { found, .. } if found == length),
                "{error}"
            );
        }
        let figure = Figure::from(diagonal()).with_width(700.0);
        assert_eq!(figure.layout().unwrap().size[0], 700);
    }

    #[test]
    fn an_svg_holds_all_texts_and_no_nan() {
        let broken = Series::new(
            "broken",
            vec![[0.0, f64::NAN], [0.5, 0.1], [0.9, f64::INFINITY]],
        );
        let chart = diagonal().with_curves([broken]).with_note("A remark.");
        let figure = Figure::new("Two", 2)
            .with_panel(chart)
            .with_panel(shapes("caption").with_curve(Curve::new(vec![square(1.0)])))
            .with_column_labels(["left", "right"])
            .with_row_labels(["only row\nsecond line"])
            .with_note("Another.");
        let svg = figure.to_svg().unwrap();
        for text in [
            "Two",
            "Diagonal &amp; more",
            "time t [s]",
            "length &lt;L&gt;",
            "straight",
            "broken",
            "A remark.",
            "0.5",
            "caption",
            "left",
            "right",
            "only row",
            "second line",
            "Another.",
        ] {
            assert!(svg.contains(&format!(">{text}</text>")), "no {text:?}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert!(svg.contains("sans-serif") && svg.trim_end().ends_with("</svg>"));
    }

    #[test]
    fn legends_show_every_curve_below_the_panel_or_the_figure() {
        let two = || {
            let falling = Series::new("falling", vec![[0.0, 1.0], [1.0, 0.0]]);
            diagonal().with_curves([falling.with_colour(1).with_style(LineStyle::Dashed)])
        };
        let nameless = |mut chart: LineChart| {
            for series in &mut chart.series {
                series.entry.label.clear();
            }
            chart
        };
        let (with, without) = (Figure::from(two()), Figure::from(nameless(two())));
        assert_eq!(plot(&with), plot(&without));
        let (with, without) = (picture(&with), picture(&without));
        assert!(with.height() > without.height() + 30);
        for colour in [BLUE, VERMILLION] {
            assert!(count(&with, colour) > count(&without, colour) + 40);
        }

        let own = LegendEntry::line("method A", Colour::Black, LineStyle::Dashed);
        let figure = Figure::new("", 2)
            .with_panels([two(), two(), two().with_entries([own])])
            .with_shared_legend();
        let svg = figure.to_svg().unwrap();
        for label in ["straight", "falling", "method A"] {
            assert_eq!(
                svg.matches(&format!(">{label}</text>")).count(),
                1,
                "{label}"
            );
        }
    }

    #[test]
    fn markers_are_drawn_without_a_line_between_them() {
        let points = Series::new("", vec![[0.25, 0.5], [0.75, 0.5]]);
        let points = points.with_symbols(Marker::Square);
        let figure = Figure::from(unit_square("").with_curves([points]));
        let picture = picture(&figure);
        let [x, y] = place(&figure, [0.25, 0.5]);
        assert!(has_near(&picture, BLUE, [x + 2.5, y + 2.5], 0.3));
        assert!(!has_near(&picture, BLUE, place(&figure, [0.4, 0.5]), 2.0));
    }

    #[test]
    fn a_curve_of_one_point_is_seen() {
        let one = Series::new("one", vec![[0.5, 0.25]]);
        let figure = Figure::from(unit_square("").with_curves([one]));
        assert!(has_near(
            &picture(&figure),
            BLUE,
            place(&figure, [0.5, 0.25]),
            1.0
        ));
    }

    #[test]
    fn heat_map_cells_have_their_colours_and_orientation() {
        // Axis 0 goes right, axis 1 up: only the cell at x = last, y = first is hot, and one is unknown.
        let mut values = vec![0.0; 12];
        (values[3 * 3], values[2]) = (1.0, f64::NAN);
        let axis = |label, high| Axis::linear(label).with_range(0.0, high);
        let axes = [axis("x", 4.0), axis("y", 3.0), Axis::linear("value")];
        let figure = Figure::from(Heatmap::new("Hot cell", axes, [4, 3], values));
        let (picture, plot) = (picture(&figure), plot(&figure));
        assert!(
            (plot.height / plot.width - 0.75).abs() < 0.01,
            "equal aspect"
        );
        let colour = |x: f64, y: f64| at(&picture, place(&figure, [x / 4.0, y / 3.0]));
        assert_eq!(
            (colour(3.5, 0.5), colour(0.2, 2.8)),
            (viridis(1.0), viridis(f64::NAN))
        );
        for (x, y) in [(0.2, 0.2), (3.5, 2.5), (2.5, 0.5)] {
            assert_eq!(colour(x, y), viridis(0.0), "{x}, {y}");
        }
        // Colours in between occur in the colour bar alone.
        let middle = viridis(128.0 / 255.0);
        assert!(has_near(
            &picture,
            middle,
            [plot.right() + 17.0, plot.centre().y],
            3.0
        ));
        let svg = figure.to_svg().unwrap();
        assert_eq!(svg.matches("<image").count(), 2);
        assert_eq!(svg.matches("pixelated").count(), 2);
        assert!(svg.contains("value"));
    }

    fn square(half: f64) -> Vec<[f64; 2]> {
        vec![[-half, -half], [half, -half], [half, half], [-half, half]]
    }

    #[test]
    fn shapes_are_filled_with_holes_and_cut_off_at_the_window() {
        let ring = Curve::new(vec![square(1.0), square(0.5)]).filled(Colour::Palette(1));
        let seen = Shapes::new("cut", [[-2.0, 0.75]; 2]);
        let figure = Figure::new("Squares", 2)
            .with_panel(shapes("ring").with_curve(ring.clone()))
            .with_panel(seen.with_curve(ring));
        let (picture, layout) = (picture(&figure), figure.layout().unwrap());
        let (left, right) = (layout.cells[0].plot, layout.cells[1].plot);
        assert!((left.width - left.height).abs() <= 1.0);
        let at = |x: f64, y: f64| {
            let place = place(&figure, [x, y].map(|c| 0.5 + c / 2.24));
            at(&picture, place)
        };
        for (x, y) in [(0.75, 0.0), (0.0, -0.75), (0.9, 0.9)] {
            assert_eq!(at(x, y), VERMILLION);
        }
        for (x, y) in [(0.0, 0.0), (0.4, 0.4), (1.05, 0.0)] {
            assert_eq!(at(x, y), Rgb::WHITE);
        }
        let y = right.centre().y;
        assert!(has_near(
            &picture,
            VERMILLION,
            [right.right() - 3.0, y],
            0.5
        ));
        assert!(!has_near(
            &picture,
            VERMILLION,
            [right.right() + 3.0, y],
            2.0
        ));
    }

    #[test]
    fn panels_line_up() {
        let figure = Figure::new("Grid", 2).with_panels([diagonal(), diagonal(), diagonal()]);
        let layout = figure.layout().unwrap();
        let plots: Vec<Rect> = layout.cells.iter().map(|cell| cell.plot).collect();
        assert_eq!((plots[0].y, plots[0].height), (plots[1].y, plots[1].height));
        assert_eq!((plots[0].x, plots[0].width), (plots[2].x, plots[2].width));
        assert!(plots[1].x > plots[0].right() && plots[2].y > plots[0].bottom());
        let [width, height] = layout.size;
        assert!(plots[1].right() <= f64::from(width) && plots[2].bottom() < f64::from(height));
    }

    #[test]
    fn mixed_panels_are_written_twice_with_the_same_bytes() {
        let figure = Figure::new("Mixed", 2)
            .with_panel(diagonal())
            .with_panel(heat_map("u", [2, 2], vec![1.0, 2.0, 3.0, 4.0]))
            .with_panel(shapes("s").with_curve(Curve::new(vec![square(1.0)])))
            .with_panel(half(30, 20));
        let root = tempfile::tempdir().unwrap();
        let folder = OutputDir::create(root.path()).unwrap();
        figure.write(&folder, "first").unwrap();
        figure.clone().write(&folder, "second").unwrap();
        let read = |name: &str| std::fs::read(root.path().join(name)).unwrap();
        assert!(read("first.svg") == read("second.svg"));
        assert!(read("first.png") == read("second.png"));
        let picture = image::load_from_memory(&read("first.png"))
            .unwrap()
            .into_rgb8();
        for colour in [BLUE, viridis(1.0), INK, OKABE_ITO[2]] {
            assert!(count(&picture, colour) > 50, "{colour:?}");
        }
    }

    /// A picture of one colour whose left half is transparent.
    fn half(columns: usize, rows: usize) -> Raster {
        let [left, right] = [[9, 9, 9, 0], [0, 158, 115, 255]];
        let pixel = |k: usize| {
            if k % columns < columns / 2 {
                left
            } else {
                right
            }
        };
        let pixels: Vec<[u8; 4]> = (0..columns * rows).map(pixel).collect();
        Raster::new("step 100", [columns, rows], pixels)
    }

    #[test]
    fn pictures_keep_their_shape_and_show_the_page_where_they_are_transparent() {
        let green = OKABE_ITO[2];
        for (columns, rows) in [(300, 200), (60, 40), (1500, 1000)] {
            let figure = Figure::from(half(columns, rows));
            let (picture, plot) = (picture(&figure), plot(&figure));
            assert!((plot.height / plot.width - 2.0 / 3.0).abs() < 0.01);
            let at = |x: f64, y: f64| at(&picture, place(&figure, [x, y]));
            for y in [0.02, 0.5, 0.98] {
                assert_eq!(
                    (at(0.02, y), at(0.45, y)),
                    (Rgb::WHITE, Rgb::WHITE),
                    "{columns} {y}"
                );
                assert_eq!((at(0.55, y), at(0.98, y)), (green, green), "{columns} {y}");
            }
            let svg = figure.to_svg().unwrap();
            assert_eq!(svg.matches("<image").count(), 1);
            assert!(!svg.contains("pixelated") && svg.contains(">step 100</text>"));
        }
    }

    #[test]
    fn pictures_of_the_right_size_are_copied_and_others_averaged_in_linear_light() {
        let shown = |size: [usize; 2], pixels: Vec<[u8; 4]>| {
            let figure = Figure::from(Raster::new("", size, pixels)).with_width(200.0);
            (picture(&figure), plot(&figure))
        };
        // The layout depends on the ratio of the sides alone.
        let (_, plot) = shown([1, 1], vec![[0; 4]]);
        let size = [2 * plot.width as usize, 2 * plot.height as usize];
        let noise = |k: usize| [k * 37, k * 91, k * 53].map(|v| (v % 256) as u8);
        let opaque = |[r, g, b]: [u8; 3]| [r, g, b, 255];
        let (copied, _) = shown(
            size,
            (0..size[0] * size[1]).map(|k| opaque(noise(k))).collect(),
        );
        for (x, y) in [(0, 0), (7, 3), (size[0] - 1, size[1] - 1)] {
            let [r, g, b] = noise(y * size[0] + x);
            let [left, top] = [plot.x, plot.y].map(|c| 2 * c as u32);
            let pixel = copied.get_pixel(left + x as u32, top + y as u32);
            assert_eq!(pixel.0, [r, g, b], "{x} {y}");
        }
        // A fine chessboard of black and white has half the light of white.
        let double = [2 * size[0], 2 * size[1]];
        let white = |k: usize| (k % double[0] + k / double[0]) % 2;
        let board = (0..double[0] * double[1]).map(|k| opaque([255 * white(k) as u8; 3]));
        let (averaged, plot) = shown(double, board.collect());
        let centre = at(&averaged, plot.centre().to_array());
        assert!(centre.0.abs_diff(188) <= 1, "{centre:?}");
    }

    proptest! {
        #[test]
        fn any_data_gives_a_drawing_or_a_typed_error(
            points in prop::collection::vec([any::<f64>(), any::<f64>()], 0..20),
            scale in -320..300_i32,
            logs in any::<[bool; 2]>(),
        ) {
            let [x, y] = logs.map(|log| if log { Axis::log("a") } else { Axis::linear("a") });
            // Numbers of all sizes, and numbers all of one size.
            let even: Vec<[f64; 2]> = points
                .iter()
                .map(|p| p.map(|c| 10.0_f64.powi(scale) * c.to_bits() as f64 / 1e19))
                .collect();
            for data in [points, even] {
                let loops = Curve::new(vec![data.clone()]).filled(0);
                let chart = LineChart::new("Any", x.clone(), y.clone())
                    .with_curves([Series::new("any", data).with_style(LineStyle::Dashed)]);
                for figure in [Figure::from(chart), Figure::from(shapes("Any").with_curve(loops))] {
                    match figure.with_width(400.0).to_svg() {
                        Ok(svg) => prop_assert!(!svg.contains("NaN") && !svg.contains("inf")),
                        Err(error) => prop_assert!(
                            matches!(error, Error::Empty { .. } | Error::Range { .. } | Error::FigureSize { .. }),
                            "{error}"
                        ),
                    }
                }
            }
        }
    }
}

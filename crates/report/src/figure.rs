//! Figures: panels on a grid, with a heading, row and column labels and a common legend.

use std::collections::HashSet;

use plotters_backend::text_anchor::HPos;

use crate::axes::{Margins, draw_lines, title_height};
use crate::colour::{GREY, INK};
use crate::error::{Error, Result};
use crate::font;
use crate::geom::{Rect, point};
use crate::heatmap::Heatmap;
use crate::legend::{Block, LegendEntry};
use crate::output::OutputDir;
use crate::panel::{Context, Drawable, Spot};
use crate::plot::LineChart;
use crate::raster::Raster;
use crate::shapes::Shapes;
use crate::style::{Fonts, LEADING};
use crate::surface::{self, Surface, Text};

/// One cell of a figure.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Panel {
    /// A line chart.
    Line(LineChart),
    /// A heat map.
    Heatmap(Heatmap),
    /// Plane curves.
    Shapes(Shapes),
    /// A picture.
    Raster(Raster),
}

impl From<LineChart> for Panel {
    fn from(chart: LineChart) -> Self {
        Self::Line(chart)
    }
}

impl From<Heatmap> for Panel {
    fn from(map: Heatmap) -> Self {
        Self::Heatmap(map)
    }
}

impl From<Shapes> for Panel {
    fn from(shapes: Shapes) -> Self {
        Self::Shapes(shapes)
    }
}

impl From<Raster> for Panel {
    fn from(raster: Raster) -> Self {
        Self::Raster(raster)
    }
}

impl Panel {
    fn drawable(&self) -> &dyn Drawable {
        match self {
            Self::Line(chart) => chart,
            Self::Heatmap(map) => map,
            Self::Shapes(shapes) => shapes,
            Self::Raster(raster) => raster,
        }
    }
}

/// A figure: panels row by row on a grid.
///
/// Sizes are in layout units, one CSS pixel each when a README shows the figure at its own width.
/// The PNG has two pixels per unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Heading above all panels; may be empty.
    pub title: String,
    /// Panels, row by row.
    pub panels: Vec<Panel>,
    /// Number of panels in a row.
    pub columns: usize,
    /// Labels above the columns; may be empty.
    pub column_labels: Vec<String>,
    /// Labels left of the rows, read upwards; may be empty.
    pub row_labels: Vec<String>,
    /// One legend below all panels instead of one in each. Labelled plane curves always go there.
    pub shared_legend: bool,
    /// A remark in small type at the bottom.
    pub note: Option<String>,
    /// Width.
    pub width: f64,
    /// Height; `None` chooses one that suits the panels.
    pub height: Option<f64>,
}

impl<P: Into<Panel>> From<P> for Figure {
    fn from(panel: P) -> Self {
        Self::new("", 1).with_panel(panel)
    }
}

const PADDING: f64 = 12.0;
const COLUMN_GAP: f64 = 16.0;
const ROW_GAP: f64 = 14.0;
const SMALLEST_SIDE: f64 = 80.0;
const LARGEST_SIDE: f64 = 2600.0;
const SMALLEST_PLOT: f64 = 40.0;

/// Where everything is.
pub(crate) struct Layout {
    pub width: f64,
    pub height: f64,
    /// Plot box of every panel.
    pub plots: Vec<Rect>,
    outers: Vec<Rect>,
    spots: Vec<Spot>,
    context: Context,
    legend: Vec<Vec<LegendEntry>>,
    legend_top: f64,
    note_top: f64,
}

impl Figure {
    /// A figure without panels, 800 units wide.
    pub fn new(title: impl Into<String>, columns: usize) -> Self {
        Self {
            title: title.into(),
            panels: Vec::new(),
            columns,
            column_labels: Vec::new(),
            row_labels: Vec::new(),
            shared_legend: false,
            note: None,
            width: 800.0,
            height: None,
        }
    }

    /// Adds a panel to the right of the last one, or at the start of the next row.
    #[must_use]
    pub fn with_panel(mut self, panel: impl Into<Panel>) -> Self {
        self.panels.push(panel.into());
        self
    }

    /// Adds panels, one after the other.
    #[must_use]
    pub fn with_panels<P: Into<Panel>>(mut self, panels: impl IntoIterator<Item = P>) -> Self {
        self.panels.extend(panels.into_iter().map(Into::into));
        self
    }

    /// Labels the columns.
    #[must_use]
    pub fn with_column_labels<S: Into<String>>(
        mut self,
        labels: impl IntoIterator<Item = S>,
    ) -> Self {
        self.column_labels = labels.into_iter().map(Into::into).collect();
        self
    }

    /// Labels the rows; a line break in a label makes two lines.
    #[must_use]
    pub fn with_row_labels<S: Into<String>>(mut self, labels: impl IntoIterator<Item = S>) -> Self {
        self.row_labels = labels.into_iter().map(Into::into).collect();
        self
    }

    /// Collects the legends of all panels below the figure.
    #[must_use]
    pub fn with_shared_legend(mut self) -> Self {
        self.shared_legend = true;
        self
    }

    /// Adds a remark at the bottom.
    #[must_use]
    pub fn with_note(mut self, note: impl Into<String>) -> Self {
        self.note = Some(note.into());
        self
    }

    /// Fixes the width; the height follows.
    #[must_use]
    pub fn with_width(mut self, width: f64) -> Self {
        self.width = width;
        self
    }

    /// Fixes width and height.
    #[must_use]
    pub fn with_size(mut self, width: f64, height: f64) -> Self {
        (self.width, self.height) = (width, Some(height));
        self
    }

    /// The figure as an SVG document. Text stays text, in a sans-serif family.
    ///
    /// # Errors
    ///
    /// If there is nothing to draw, a range or array does not fit, or the size leaves no room.
    pub fn to_svg(&self) -> Result<String> {
        let layout = self.layout()?;
        surface::svg(layout.width as u32, layout.height as u32, |s| {
            self.draw(&layout, s)
        })
    }

    /// The figure as a PNG file, two pixels per layout unit.
    ///
    /// # Errors
    ///
    /// As [`Figure::to_svg`].
    pub fn to_png(&self) -> Result<Vec<u8>> {
        let layout = self.layout()?;
        surface::png(layout.width as u32, layout.height as u32, |s| {
            self.draw(&layout, s)
        })
    }

    /// Writes `<stem>.svg` and `<stem>.png`.
    ///
    /// # Errors
    ///
    /// As [`Figure::to_svg`], or if a file cannot be written.
    pub fn write(&self, folder: &OutputDir, stem: &str) -> Result<()> {
        let (svg, png) = (self.to_svg()?, self.to_png()?);
        folder.write(&format!("{stem}.svg"), svg)?;
        folder.write(&format!("{stem}.png"), png)?;
        Ok(())
    }

    fn size_error(&self, height: f64) -> Error {
        Error::FigureSize {
            width: self.width,
            height,
            min: SMALLEST_SIDE,
            max: LARGEST_SIDE,
        }
    }

    /// Unique entries of all panels, in order of appearance; the k-th groups of all go together.
    fn collected_legend(&self) -> Vec<Vec<LegendEntry>> {
        let mut seen = HashSet::new();
        let mut groups: Vec<Vec<LegendEntry>> = Vec::new();
        for panel in &self.panels {
            if !self.shared_legend && matches!(panel, Panel::Line(_)) {
                continue;
            }
            for (k, group) in panel.drawable().legend().into_iter().enumerate() {
                if groups.len() <= k {
                    groups.push(Vec::new());
                }
                groups[k].extend(group.into_iter().filter(|e| seen.insert(e.label.clone())));
            }
        }
        groups.retain(|group| !group.is_empty());
        groups
    }

    pub(crate) fn layout(&self) -> Result<Layout> {
        if self.panels.is_empty() {
            return Err(Error::NoPanels);
        }
        let sides = SMALLEST_SIDE..=LARGEST_SIDE;
        let height_given = self.height.unwrap_or(SMALLEST_SIDE);
        if !sides.contains(&self.width) || !sides.contains(&height_given) {
            return Err(self.size_error(height_given));
        }
        let width = self.width.round();
        let columns = self.columns.clamp(1, self.panels.len());
        let fonts = Fonts::for_columns(columns);
        let label_strip = (LEADING * fonts.label + 4.0).ceil();
        let lines = |label: &String| label.lines().count();
        let label_lines = self.row_labels.iter().map(lines).max().unwrap_or(0);
        let left = PADDING + label_strip * label_lines as f64;
        let gaps = COLUMN_GAP * (columns - 1) as f64;
        let room = width - PADDING - left - gaps;
        let cell_width = room / columns as f64;
        let context = Context {
            fonts,
            cell_width,
            shared_legend: self.shared_legend,
            window: Shapes::common_window(self.panels.iter().filter_map(|panel| match panel {
                Panel::Shapes(shapes) => Some(shapes),
                _ => None,
            })),
        };

        let heading = match title_height(&self.title, fonts.heading, width - 2.0 * PADDING) {
            height if height > 0.0 => height + 5.0,
            _ => 0.0,
        };
        let column_strip = if self.column_labels.is_empty() {
            0.0
        } else {
            label_strip
        };
        let top = PADDING + heading + column_strip;
        let legend = self.collected_legend();
        let legend_height = if legend.is_empty() {
            0.0
        } else {
            6.0 + Block::within(&legend, fonts.legend, width - 2.0 * PADDING).height()
        };
        let note_height = self.note.as_ref().map_or(0.0, |note| {
            let lines = font::wrap(note, fonts.note, width - 2.0 * PADDING).len();
            6.0 + lines as f64 * LEADING * fonts.note
        });
        let bottom = PADDING + legend_height + note_height;

        let grid = Grid {
            columns,
            room,
            fixed: self.height.map(|h| h - top - bottom),
            context,
        };
        let (plan, spots) = grid.plan(&self.panels)?;
        let boxes = plan.boxes(left, top, self.panels.len());
        let height = (top + plan.height() + bottom).round();
        if !sides.contains(&height) {
            return Err(self.size_error(height));
        }
        if plan.plot_width < SMALLEST_PLOT || plan.rows.iter().any(|r| r.0 < SMALLEST_PLOT) {
            return Err(self.size_error(height));
        }
        let (mut plots, mut outers) = (Vec::new(), Vec::new());
        for (panel, (plot, mut outer)) in self.panels.iter().zip(boxes) {
            let fitted = panel
                .drawable()
                .aspect(&context)?
                .map_or(plot, |a| plot.fitted(a));
            // The title stays with a plot box that is less high than its row.
            outer.y += fitted.y - plot.y;
            outer.height -= fitted.y - plot.y;
            plots.push(whole(fitted));
            outers.push(outer);
        }
        Ok(Layout {
            width,
            height,
            plots,
            outers,
            spots,
            context,
            legend,
            legend_top: height - bottom + 6.0,
            note_top: height - PADDING - note_height + 6.0,
        })
    }

    fn draw(&self, layout: &Layout, surface: &mut dyn Surface) -> Result<()> {
        let fonts = layout.context.fonts;
        let (middle, inner) = (0.5 * layout.width, layout.width - 2.0 * PADDING);
        let heading = (fonts.heading, INK);
        draw_lines(
            surface,
            &self.title,
            heading,
            HPos::Center,
            (middle, PADDING),
            inner,
        )?;

        let columns = self.columns.clamp(1, self.panels.len());
        let strip = LEADING * fonts.label + 4.0;
        let mut label = Text {
            line: "",
            at: point(0.0, 0.0),
            em: fonts.label,
            colour: INK,
            align: HPos::Center,
            vertical: false,
        };
        for (text, k) in self.column_labels.iter().zip(0..columns) {
            let top = layout.outers[k].y;
            label.at = point(layout.plots[k].centre().x, top - 0.5 * strip);
            surface.text(Text {
                line: text,
                ..label
            })?;
        }
        label.vertical = true;
        for (text, plot) in self
            .row_labels
            .iter()
            .zip(layout.plots.iter().step_by(columns))
        {
            for (k, line) in text.lines().enumerate() {
                label.at = point(PADDING + (k as f64 + 0.45) * strip, plot.centre().y);
                surface.text(Text { line, ..label })?;
            }
        }

        for (k, panel) in self.panels.iter().enumerate() {
            let (plot, outer) = (layout.plots[k], layout.outers[k]);
            panel
                .drawable()
                .draw(&layout.context, surface, layout.spots[k], plot, outer)?;
        }

        if !layout.legend.is_empty() {
            let block = Block::within(&layout.legend, fonts.legend, inner);
            let left = (middle - 0.5 * block.width()).max(0.0).round();
            block.draw(surface, point(left, layout.legend_top), false)?;
        }
        if let Some(note) = &self.note {
            let at = (PADDING + 4.0, layout.note_top);
            draw_lines(surface, note, (fonts.note, GREY), HPos::Left, at, inner)?;
        }
        Ok(())
    }
}

/// Inputs of the grid layout.
struct Grid {
    columns: usize,
    /// Width for the panels with their margins, without gaps.
    room: f64,
    /// Height for all rows, if the figure's is fixed.
    fixed: Option<f64>,
    context: Context,
}

/// Sizes of plot boxes and of the margins around them, which align along rows and columns.
#[derive(Debug, Clone, Default)]
struct Plan {
    plot_width: f64,
    /// Left and right margin of every column.
    columns: Vec<(f64, f64)>,
    /// Plot height, top and bottom margin of every row.
    rows: Vec<(f64, f64, f64)>,
}

impl Grid {
    fn plan(&self, panels: &[Panel]) -> Result<(Plan, Vec<Spot>)> {
        let rows = panels.len().div_ceil(self.columns);
        let mut plan = Plan {
            plot_width: (self.context.cell_width - 70.0).max(SMALLEST_PLOT),
            columns: vec![(0.0, 0.0); self.columns],
            rows: vec![(0.0, 0.0, 0.0); rows],
        };
        self.set_heights(panels, &mut plan)?;
        let mut spots = vec![Spot::Nowhere; panels.len()];
        // Margins depend on the tick labels, those on the sizes, and those on the margins; whether
        // a legend fits inside is settled once the sizes are about right.
        for round in 0..4 {
            if round == 1 {
                for (k, panel) in panels.iter().enumerate() {
                    let height = plan.rows[k / self.columns].0;
                    spots[k] = panel
                        .drawable()
                        .spot(&self.context, plan.plot_width, height)?;
                }
            }
            self.refine(panels, &spots, &mut plan)?;
        }
        Ok((plan, spots))
    }

    fn refine(&self, panels: &[Panel], spots: &[Spot], plan: &mut Plan) -> Result<()> {
        let mut columns = vec![Margins::default(); self.columns];
        let mut rows = vec![Margins::default(); plan.rows.len()];
        for (k, panel) in panels.iter().enumerate() {
            let (row, column) = (k / self.columns, k % self.columns);
            let (width, height) = (plan.plot_width, plan.rows[row].0);
            let needed = panel
                .drawable()
                .margins(&self.context, spots[k], width, height)?;
            columns[column] = columns[column].max(needed);
            rows[row] = rows[row].max(needed);
        }
        plan.columns = columns.iter().map(|m| (m.left, m.right)).collect();
        for (row, margins) in plan.rows.iter_mut().zip(rows) {
            (row.1, row.2) = (margins.top, margins.bottom);
        }
        let taken: f64 = plan.columns.iter().map(|(left, right)| left + right).sum();
        plan.plot_width = ((self.room - taken) / self.columns as f64).floor();
        self.set_heights(panels, plan)
    }

    fn set_heights(&self, panels: &[Panel], plan: &mut Plan) -> Result<()> {
        let rows = plan.rows.len() as f64;
        let fixed = self.fixed.map(|height| {
            let margins: f64 = plan.rows.iter().map(|r| r.1 + r.2).sum();
            (height - margins - ROW_GAP * (rows - 1.0)) / rows
        });
        let share = if self.columns == 1 { 0.52 } else { 0.66 };
        for (row, members) in plan.rows.iter_mut().zip(panels.chunks(self.columns)) {
            let mut height = 0.0_f64;
            for panel in members {
                let own = match panel.drawable().aspect(&self.context)? {
                    Some(aspect) => (aspect * plan.plot_width).min(1.2 * plan.plot_width),
                    None => share * self.context.cell_width,
                };
                height = height.max(own);
            }
            // A single equal-aspect panel would otherwise be as tall as the figure is wide.
            let limit = match self.columns {
                1 => (0.62 * self.context.cell_width).max(440.0),
                _ => f64::MAX,
            };
            row.0 = fixed.unwrap_or(height.min(limit)).floor();
        }
        Ok(())
    }
}

impl Plan {
    fn height(&self) -> f64 {
        let rows: f64 = self
            .rows
            .iter()
            .map(|(plot, top, bottom)| plot + top + bottom)
            .sum();
        rows + ROW_GAP * (self.rows.len() - 1) as f64
    }

    /// Plot boxes and the boxes with margins around them.
    fn boxes(&self, left: f64, top: f64, count: usize) -> Vec<(Rect, Rect)> {
        let mut boxes = Vec::with_capacity(count);
        let mut y = top;
        for &(height, above, below) in &self.rows {
            let mut x = left;
            for &(before, after) in &self.columns {
                let plot = Rect::new(x + before, y + above, self.plot_width, height);
                let width = before + self.plot_width + after;
                let outer = Rect::new(x, y, width, above + height + below);
                boxes.push((plot, outer));
                x += width + COLUMN_GAP;
            }
            y += above + height + below + ROW_GAP;
        }
        boxes.truncate(count);
        boxes
    }
}

/// Puts the corners of a plot box on whole units, so that its frame is crisp.
fn whole(plot: Rect) -> Rect {
    let (x, y) = (plot.x.round(), plot.y.round());
    Rect::new(
        x,
        y,
        (plot.right().round() - x).max(1.0),
        (plot.bottom().round() - y).max(1.0),
    )
}

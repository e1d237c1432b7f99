//! Legends: what the colours and line styles mean, placed where no data is.

use plotters_backend::text_anchor::HPos;
use srgb::Rgb;

use crate::colour::{Colour, INK, WHITE};
use crate::error::Result;
use crate::font;
use crate::geom::{Point, Rect, point};
use crate::style::{CURVE_WIDTH, LineStyle, Marker, draw_marker};
use crate::surface::{Surface, Text, outline, stroke_dashed};

/// Where the legend of a chart goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Legend {
    /// Inside the plot where it covers no curve, or below the plot if there is no such place.
    #[default]
    Auto,
    /// Below the plot, in as many columns as fit.
    Below,
    /// To the right of the plot.
    Right,
    /// Not drawn.
    Hidden,
}

/// One line of a legend.
#[derive(Debug, Clone, PartialEq)]
pub struct LegendEntry {
    /// What it stands for.
    pub label: String,
    /// Colour of the sample.
    pub colour: Colour,
    /// What the sample looks like.
    pub sample: Sample,
}

/// What stands in front of a legend label.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sample {
    /// A piece of line, with a marker if there is one.
    Line(LineStyle, Option<Marker>),
    /// A filled box.
    Patch,
}

impl LegendEntry {
    /// A piece of line in a colour, for example grey dashes for "explicit" whatever the resolution.
    pub fn line(label: impl Into<String>, colour: impl Into<Colour>, style: LineStyle) -> Self {
        Self {
            label: label.into(),
            colour: colour.into(),
            sample: Sample::Line(style, None),
        }
    }

    /// A filled box, for an area or for a colour shared by several line styles.
    pub fn patch(label: impl Into<String>, colour: impl Into<Colour>) -> Self {
        Self {
            label: label.into(),
            colour: colour.into(),
            sample: Sample::Patch,
        }
    }
}

const SAMPLE_WIDTH: f64 = 30.0;
const SAMPLE_GAP: f64 = 8.0;
const COLUMN_GAP: f64 = 22.0;
const GROUP_GAP: f64 = 6.0;
const PADDING: f64 = 8.0;

fn row_height(em: f64) -> f64 {
    (1.5 * em).round()
}

fn entry_width(entry: &LegendEntry, em: f64) -> f64 {
    SAMPLE_WIDTH + SAMPLE_GAP + font::width(&entry.label, em)
}

/// A legend with every entry in its place, relative to the upper left corner.
#[derive(Debug, Clone)]
pub(crate) struct Block<'a> {
    entries: Vec<(Point, &'a LegendEntry)>,
    em: f64,
    width: f64,
    height: f64,
}

impl<'a> Block<'a> {
    /// Groups one below the other, with a little air in between. Each is filled row by row into
    /// columns of equal width, as many as `columns` says and the entries need.
    fn stacked(groups: &'a [Vec<LegendEntry>], em: f64, columns: usize) -> Self {
        let row = row_height(em);
        let mut block = Self {
            entries: Vec::new(),
            em,
            width: 0.0,
            height: 0.0,
        };
        let mut lines: Vec<(std::ops::Range<usize>, f64)> = Vec::new();
        let mut y = 0.5 * PADDING;
        for (g, group) in groups
            .iter()
            .enumerate()
            .filter(|(_, group)| !group.is_empty())
        {
            if g > 0 && columns == 1 {
                y += GROUP_GAP;
            }
            let columns = columns.clamp(1, group.len());
            let widest = group.iter().map(|e| entry_width(e, em)).fold(0.0, f64::max);
            for line in group.chunks(columns) {
                let from = block.entries.len();
                let mut x = PADDING;
                for entry in line {
                    block.entries.push((point(x, y + 0.5 * row), entry));
                    // A single line needs no columns to line up with.
                    let step = if group.len() > columns {
                        widest
                    } else {
                        entry_width(entry, em)
                    };
                    x += step + COLUMN_GAP;
                }
                let width = x - COLUMN_GAP + PADDING;
                block.width = block.width.max(width.ceil());
                let full = if group.len() > columns {
                    columns as f64 * (widest + COLUMN_GAP) - COLUMN_GAP + 2.0 * PADDING
                } else {
                    width
                };
                lines.push((from..block.entries.len(), full));
                y += row;
            }
        }
        block.height = y + 0.5 * PADDING;
        if columns > 1 {
            for (line, width) in lines {
                let shift = (0.5 * (block.width - width)).max(0.0);
                for (at, _) in &mut block.entries[line] {
                    at.x += shift;
                }
            }
        }
        block
    }

    /// Groups as columns side by side.
    fn side_by_side(groups: &'a [Vec<LegendEntry>], em: f64) -> Self {
        let mut block = Self {
            entries: Vec::new(),
            em,
            width: PADDING,
            height: 0.0,
        };
        for group in groups.iter().filter(|group| !group.is_empty()) {
            for (k, entry) in group.iter().enumerate() {
                let y = 0.5 * PADDING + (k as f64 + 0.5) * row_height(em);
                block.entries.push((point(block.width, y), entry));
            }
            let widest = group.iter().map(|e| entry_width(e, em)).fold(0.0, f64::max);
            block.width += widest + COLUMN_GAP;
            block.height = block
                .height
                .max(group.len() as f64 * row_height(em) + PADDING);
        }
        block.width = (block.width - COLUMN_GAP + PADDING).ceil();
        block
    }

    /// Blocks to try inside the plot.
    pub fn inside(groups: &'a [Vec<LegendEntry>], em: f64) -> Vec<Self> {
        let mut blocks = vec![Self::stacked(groups, em, 1)];
        if groups.len() > 1 {
            blocks.push(Self::side_by_side(groups, em));
        } else {
            blocks.push(Self::stacked(groups, em, 2));
        }
        blocks
    }

    /// One column, to go beside the plot.
    pub fn column(groups: &'a [Vec<LegendEntry>], em: f64) -> Self {
        Self::stacked(groups, em, 1)
    }

    /// The flattest block that fits a width: each group on a line of its own, or on several.
    pub fn within(groups: &'a [Vec<LegendEntry>], em: f64, width: f64) -> Self {
        let most = groups.iter().map(Vec::len).max().unwrap_or(1);
        let fits = |columns: &usize| Self::stacked(groups, em, *columns).width <= width;
        let columns = (1..=most).rev().find(fits).unwrap_or(1);
        // With as many lines, fewer columns look more even: 4 + 4 rather than 7 + 1.
        let lines = |columns: usize| {
            groups
                .iter()
                .map(|g| g.len().div_ceil(columns))
                .sum::<usize>()
        };
        let even = (1..=columns)
            .find(|&c| lines(c) == lines(columns))
            .unwrap_or(columns);
        Self::stacked(groups, em, even)
    }

    pub fn width(&self) -> f64 {
        self.width
    }

    pub fn height(&self) -> f64 {
        self.height
    }

    /// Draws with the upper left corner at `at`; `boxed` puts it on white with a thin outline.
    pub fn draw(&self, surface: &mut dyn Surface, at: Point, boxed: bool) -> Result<()> {
        if boxed {
            let area = Rect::new(at.x, at.y, self.width(), self.height());
            surface.rect(area, WHITE)?;
            outline(surface, area, 1.0, Rgb(205, 205, 205))?;
        }
        for (place, entry) in &self.entries {
            let (x, y) = (at.x + place.x, at.y + place.y);
            draw_sample(surface, entry, point(x, y))?;
            surface.text(Text {
                line: &entry.label,
                at: point(x + SAMPLE_WIDTH + SAMPLE_GAP, y),
                em: self.em,
                colour: INK,
                align: HPos::Left,
                vertical: false,
            })?;
        }
        Ok(())
    }

    /// The place inside `plot` that covers the fewest of `obstacles`, with how many those are.
    /// Corners come first, the upper right one before all; then sides, then anywhere.
    pub fn place(&self, plot: &Rect, obstacles: &[Point]) -> Option<(Point, usize)> {
        const INSET: f64 = 10.0;
        const STEPS: u32 = 8;
        let (slack_x, slack_y) = (
            plot.width - self.width() - 2.0 * INSET,
            plot.height - self.height() - 2.0 * INSET,
        );
        if slack_x < 0.0 || slack_y < 0.0 {
            return None;
        }
        let anywhere = (0..=STEPS).flat_map(|row| {
            (0..=STEPS).rev().map(move |column| {
                (
                    f64::from(column) / f64::from(STEPS),
                    f64::from(row) / f64::from(STEPS),
                )
            })
        });
        let preferred = [(1.0, 0.0), (1.0, 1.0), (0.0, 0.0), (0.0, 1.0)];
        let sides = [(1.0, 0.5), (0.5, 0.0), (0.5, 1.0), (0.0, 0.5)];
        preferred
            .into_iter()
            .chain(sides)
            .chain(anywhere)
            .map(|(fx, fy)| {
                let corner = point(
                    (plot.x + INSET + fx * slack_x).round(),
                    (plot.y + INSET + fy * slack_y).round(),
                );
                let area = Rect::new(corner.x, corner.y, self.width(), self.height()).grown(5.0);
                (
                    corner,
                    obstacles.iter().filter(|&&p| area.contains(p)).count(),
                )
            })
            .min_by_key(|&(_, hits)| hits)
    }
}

fn draw_sample(surface: &mut dyn Surface, entry: &LegendEntry, at: Point) -> Result<()> {
    let colour = entry.colour.rgb();
    match entry.sample {
        Sample::Patch => surface.rect(
            Rect::new(at.x + 0.5 * (SAMPLE_WIDTH - 16.0), at.y - 5.5, 16.0, 11.0),
            colour,
        ),
        Sample::Line(style, marker) => {
            if style != LineStyle::None {
                let line = [at, point(at.x + SAMPLE_WIDTH, at.y)];
                stroke_dashed(surface, &line, CURVE_WIDTH, colour, style.pattern())?;
            }
            match marker {
                Some(marker) => draw_marker(
                    surface,
                    marker,
                    point(at.x + 0.5 * SAMPLE_WIDTH, at.y),
                    colour,
                ),
                None => Ok(()),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(count: usize) -> Vec<Vec<LegendEntry>> {
        let entry = |k: usize| LegendEntry::line(format!("N = {k}"), k, LineStyle::Solid);
        vec![(0..count).map(entry).collect()]
    }

    #[test]
    fn an_empty_corner_is_found() {
        let groups = entries(3);
        let block = Block::column(&groups, 13.0);
        let plot = Rect::new(0.0, 0.0, 600.0, 400.0);
        // Data everywhere except in the lower right quarter.
        let data: Vec<Point> = (0..60)
            .flat_map(|i| (0..40).map(move |j| point(10.0 * f64::from(i), 10.0 * f64::from(j))))
            .filter(|p| p.x < 350.0 || p.y < 230.0)
            .collect();
        let (corner, hits) = block.place(&plot, &data).unwrap();
        assert_eq!(hits, 0);
        assert!(corner.x > 350.0 && corner.y > 230.0, "{corner:?}");
    }

    #[test]
    fn a_legend_that_does_not_fit_is_not_placed() {
        let groups = entries(12);
        let plot = Rect::new(0.0, 0.0, 200.0, 60.0);
        assert!(
            Block::inside(&groups, 13.0)
                .iter()
                .all(|b| b.place(&plot, &[]).is_none())
        );
    }

    #[test]
    fn lines_fill_the_width_evenly_but_do_not_exceed_it() {
        let groups = entries(8);
        let block = Block::within(&groups, 13.0, 700.0);
        assert!(block.width() <= 700.0);
        let rows: Vec<u32> = block.entries.iter().map(|(at, _)| at.y as u32).collect();
        assert_eq!(rows.iter().filter(|&&row| row == rows[0]).count(), 4);
    }

    #[test]
    fn groups_start_new_lines() {
        let groups = [entries(3).remove(0), entries(4).remove(0)];
        let block = Block::within(&groups, 13.0, 2000.0);
        let y: Vec<u32> = block.entries.iter().map(|(at, _)| at.y as u32).collect();
        assert!(y[0] == y[2] && y[2] < y[3] && y[3] == y[6]);
    }
}

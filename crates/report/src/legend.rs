//! Legends: what the colours and line styles mean.

use glam::{DVec2, dvec2};

use crate::colour::{Colour, INK};
use crate::font::{self, Align, TextStyle};
use crate::style::{LineStyle, Marker};
use crate::surface::Surface;

/// A piece of line and what it stands for.
#[derive(Debug, Clone, PartialEq)]
pub struct LegendEntry {
    pub(crate) label: String,
    pub(crate) colour: Colour,
    pub(crate) style: LineStyle,
    pub(crate) marker: Option<Marker>,
}

impl LegendEntry {
    /// A piece of line in a colour, for example grey dashes for "explicit" whatever the resolution.
    pub fn line(label: impl Into<String>, colour: impl Into<Colour>, style: LineStyle) -> Self {
        Self {
            label: label.into(),
            colour: colour.into(),
            style,
            marker: None,
        }
    }

    fn width(&self, em: f64) -> f64 {
        SAMPLE_WIDTH + SAMPLE_GAP + font::width(&self.label, em)
    }

    /// Draws sample and label to the right of `at`.
    fn draw(&self, surface: &mut dyn Surface, at: DVec2, em: f64) {
        let (colour, right) = (self.colour.rgb(), |by| at + dvec2(by, 0.0));
        if self.style != LineStyle::None {
            let line = [at, right(SAMPLE_WIDTH)];
            surface.dashed(&line, 2.0, colour, self.style.pattern());
        }
        if let Some(marker) = self.marker {
            surface.markers(marker, &[right(0.5 * SAMPLE_WIDTH)], colour);
        }
        let style = TextStyle::new(em, INK).aligned(Align::Left);
        surface.text(&self.label, right(SAMPLE_WIDTH + SAMPLE_GAP), style);
    }
}

const SAMPLE_WIDTH: f64 = 30.0;
const SAMPLE_GAP: f64 = 8.0;
const COLUMN_GAP: f64 = 22.0;
const PADDING: f64 = 5.0;

/// A legend with every entry in its place, relative to the middle of its upper edge.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    entries: Vec<(DVec2, LegendEntry)>,
    em: f64,
    pub width: f64,
    pub height: f64,
}

impl Block {
    /// Groups one below the other, each on one line if it is no wider than `limit`, or else in columns of equal width.
    pub fn new(groups: &[Vec<LegendEntry>], em: f64, limit: f64) -> Self {
        let row = (1.5 * em).round();
        let (mut entries, mut width, mut y) = (Vec::new(), 0.0_f64, PADDING);
        for group in groups {
            let mut steps: Vec<f64> = group.iter().map(|e| e.width(em) + COLUMN_GAP).collect();
            let widest = steps.iter().copied().fold(0.0, f64::max);
            let mut columns = group.len();
            if steps.iter().sum::<f64>() - COLUMN_GAP > limit {
                let most = ((limit + COLUMN_GAP) / widest) as usize;
                // With as many lines, fewer columns look more even: 4 + 4 rather than 7 + 1.
                let lines = group.len().div_ceil(most.max(1));
                columns = group.len().div_ceil(lines);
                steps.fill(widest);
            }
            let whole = steps.iter().take(columns).sum::<f64>() - COLUMN_GAP;
            for line in group.chunks(columns.max(1)) {
                let mut x = -0.5 * whole;
                for (entry, step) in line.iter().zip(&steps) {
                    entries.push((dvec2(x, y + 0.5 * row), entry.clone()));
                    x += step;
                }
                y += row;
            }
            width = width.max(whole);
        }
        let height = if entries.is_empty() { 0.0 } else { y + PADDING };
        Self {
            entries,
            em,
            width,
            height,
        }
    }

    /// Draws with the middle of the upper edge at `top`.
    pub fn draw(&self, surface: &mut dyn Surface, top: DVec2) {
        let place = |p: &DVec2| dvec2((top.x + p.x).round(), top.y + p.y);
        for (at, entry) in &self.entries {
            entry.draw(surface, place(at), self.em);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(count: usize) -> Vec<LegendEntry> {
        let entry = |k: usize| LegendEntry::line(format!("N = {k}"), k, LineStyle::Solid);
        (0..count).map(entry).collect()
    }

    #[test]
    fn lines_fill_the_width_evenly_but_do_not_exceed_it() {
        let block = Block::new(&[entries(8)], 13.0, 700.0);
        assert!(block.width <= 700.0);
        let rows: Vec<u32> = block.entries.iter().map(|(at, _)| at.y as u32).collect();
        assert_eq!(rows.iter().filter(|&&row| row == rows[0]).count(), 4);
    }

    #[test]
    fn groups_start_new_lines() {
        let block = Block::new(&[entries(3), entries(4)], 13.0, 2000.0);
        let y: Vec<u32> = block.entries.iter().map(|(at, _)| at.y as u32).collect();
        assert!(y[0] == y[2] && y[2] < y[3] && y[3] == y[6]);
    }
}

//! Figures as PNG files, drawn by the bitmap backend of plotters at three times their size and averaged, which smooths every edge alike.

use std::fmt::Debug;

use glam::{DVec2, dvec2};
use plotters::prelude::{BitMapBackend, Color, DrawingBackend, RGBColor};
use srgb::Rgb;

use crate::font::{self, Align, HALF_CAPITAL, TOP_TO_BASELINE, TextStyle};
use crate::geom::{self, Rect, dash, distance};
use crate::style::Marker;
use crate::surface::{PNG_SCALE, Surface};

/// Samples per PNG pixel and direction.
const SUPERSAMPLING: usize = 3;
/// Samples per layout unit.
const SCALE: f64 = (PNG_SCALE * SUPERSAMPLING) as f64;

/// A backend whose pixels are the samples.
struct PngSurface<'a>(BitMapBackend<'a>);

/// What cannot fail, since the backend draws into memory.
fn drawn<E: Debug>(result: Result<(), E>) {
    result.expect("memory takes every drawing");
}

fn ink(Rgb(r, g, b): Rgb) -> RGBColor {
    RGBColor(r, g, b)
}

impl PngSurface<'_> {
    fn stroke(&mut self, points: &[DVec2], width: f64, colour: Rgb) {
        let half = 0.5 * width;
        for pair in points.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let length = distance(a, b);
            if length == 0.0 {
                continue;
            }
            let aside = half * (b - a).perp() / length;
            let quad = vec![a + aside, b + aside, b - aside, a - aside];
            self.fill(&[quad], colour);
        }
        let inner = 1..points.len().saturating_sub(1);
        for &joint in points.get(inner).unwrap_or_default() {
            self.fill(&[geom::disc(joint, half)], colour);
        }
    }
}

/// Column and row of the sample at a place in layout units.
fn sampled(p: DVec2) -> (i32, i32) {
    let sample = |c: f64| (c * SCALE).round() as i32;
    (sample(p.x), sample(p.y))
}

impl Surface for PngSurface<'_> {
    fn dashed(&mut self, points: &[DVec2], width: f64, colour: Rgb, pattern: &[f64]) {
        for piece in dash(points, pattern) {
            self.stroke(&piece, width, colour);
        }
    }

    /// One horizontal span of samples at a time. A sample belongs to the region if its centre does.
    fn fill(&mut self, loops: &[Vec<DVec2>], colour: Rgb) {
        let ((width, height), ink) = (self.0.get_size(), ink(colour).stroke_width(1));
        let sample =
            |c: f64, limit: u32| (c * SCALE - 0.5).ceil().clamp(0.0, f64::from(limit)) as i32;
        let all = || loops.iter().flatten().map(|p| sample(p.y, height));
        let (Some(first), Some(last)) = (all().min(), all().max()) else {
            return;
        };
        let mut crossings: Vec<Vec<f64>> = vec![Vec::new(); (last - first) as usize];
        for ring in loops {
            for (k, &b) in ring.iter().enumerate() {
                let a = ring[(k + ring.len() - 1) % ring.len()];
                let (upper, lower) = if a.y <= b.y { (a, b) } else { (b, a) };
                for row in sample(upper.y, height)..sample(lower.y, height) {
                    let t = ((f64::from(row) + 0.5) / SCALE - upper.y) / (lower.y - upper.y);
                    crossings[(row - first) as usize].push(upper.x + t * (lower.x - upper.x));
                }
            }
        }
        for (y, mut xs) in (first..).zip(crossings) {
            xs.sort_by(f64::total_cmp);
            for span in xs.chunks_exact(2) {
                let (from, to) = (sample(span[0], width), sample(span[1], width));
                if from < to {
                    drawn(self.0.draw_line((from, y), (to - 1, y), &ink));
                }
            }
        }
    }

    fn markers(&mut self, marker: Marker, places: &[DVec2], colour: Rgb) {
        for &at in places {
            self.fill(
                &[marker.outline(at, Marker::RADIUS + Marker::RIM)],
                Rgb::WHITE,
            );
            self.fill(&[marker.outline(at, Marker::RADIUS)], colour);
        }
    }

    fn text(&mut self, line: &str, at: DVec2, style: TextStyle) {
        let em = style.em * SCALE;
        let width = font::width(line, em).round() as i32;
        let start = match style.align {
            Align::Left => 0,
            Align::Centre => -width / 2,
            Align::Right => -width,
        };
        let top = sampled(style.below(at, HALF_CAPITAL - TOP_TO_BASELINE));
        font::rasterize(line, em, |along, down, covered| {
            let along = start + along;
            let (x, y) = if style.vertical {
                (top.0 + down, top.1 - along)
            } else {
                (top.0 + along, top.1 + down)
            };
            let ink = ink(style.colour).mix(f64::from(covered).min(1.0));
            drawn(self.0.draw_pixel((x, y), ink.to_backend_color()));
        });
    }

    fn image(&mut self, area: Rect, columns: usize, cells: &[Rgb], _: bool) {
        let rows = cells.len() / columns;
        let (x0, y0) = sampled(dvec2(area.x, area.y));
        let (x1, y1) = sampled(dvec2(area.right(), area.bottom()));
        let [width, height] = [x1 - x0, y1 - y0].map(|side| side.max(1) as usize);
        let row = |y: usize| y * rows / height * columns;
        let cell = |k: usize| cells[row(k / width) + k % width * columns / width];
        let pixels = (0..width * height).map(cell);
        let pixels: Vec<u8> = pixels.flat_map(|Rgb(r, g, b)| [r, g, b]).collect();
        let size = (width as u32, height as u32);
        drawn(self.0.blit_bitmap((x0, y0), size, &pixels));
    }
}

/// Draws a PNG file of the given size in layout units.
pub(crate) fn png(size: [u32; 2], draw: impl FnOnce(&mut dyn Surface)) -> Vec<u8> {
    let [width, height] = size.map(|side| side as usize * PNG_SCALE);
    let fine = [width, height].map(|side| side * SUPERSAMPLING);
    let Rgb(page, ..) = Rgb::WHITE;
    let mut samples = vec![page; 3 * fine[0] * fine[1]];
    let backend = BitMapBackend::with_buffer(&mut samples, fine.map(|side| side as u32).into());
    draw(&mut PngSurface(backend));
    crate::encode::png(width, &averaged(&samples, width))
}

/// Means over square blocks of samples, rounded.
fn averaged(samples: &[u8], width: usize) -> Vec<Rgb> {
    let (stride, count) = (3 * width * SUPERSAMPLING, SUPERSAMPLING * SUPERSAMPLING);
    let mut pixels = Vec::with_capacity(samples.len() / (3 * count));
    for rows in samples.chunks_exact(stride * SUPERSAMPLING) {
        for column in 0..width {
            let mean = |channel: usize| {
                let first = 3 * column * SUPERSAMPLING + channel;
                let block = (0..count)
                    .map(|s| first + (s / SUPERSAMPLING) * stride + 3 * (s % SUPERSAMPLING));
                let sum: usize = block.map(|at| usize::from(rows[at])).sum();
                ((sum + count / 2) / count) as u8
            };
            pixels.push(Rgb(mean(0), mean(1), mean(2)));
        }
    }
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLACK: Rgb = Rgb(0, 0, 0);

    fn ring(centre: f64, half: f64) -> Vec<DVec2> {
        let side = 2.0 * half;
        Rect::new(centre - half, centre - half, side, side)
            .corners()
            .to_vec()
    }

    #[test]
    fn a_fill_has_the_area_it_should_whatever_way_its_loops_turn() {
        let mut hole = ring(20.0, 5.0);
        for _ in 0..2 {
            let loops = [
                ring(20.0, 10.0),
                hole.clone(),
                ring(20.0, 1.0),
                ring(36.0, 2.0),
            ];
            let bytes = png([40; 2], |s| s.fill(&loops, BLACK));
            let picture = image::load_from_memory(&bytes).unwrap().into_rgb8();
            let area = 20 * 20 - 10 * 10 + 2 * 2 + 4 * 4;
            let black = picture.pixels().filter(|pixel| pixel.0 == [0; 3]);
            assert_eq!(black.count(), 4 * area);
            hole.reverse();
        }
    }

    #[test]
    fn hairlines_are_sharp_and_wide_curves_without_holes() {
        let cross = [[5.0, 5.0], [35.0, 35.0], [35.0, 5.0], [5.0, 35.0]].map(DVec2::from);
        let bytes = png([40; 2], |s| {
            s.stroke(&[dvec2(5.0, 2.5), dvec2(35.0, 2.5)], 1.0, BLACK);
            s.stroke(&cross, 6.0, BLACK);
        });
        let picture = image::load_from_memory(&bytes).unwrap().into_rgb8();
        let level = |x: u32, y: u32| picture.get_pixel(x, y).0[0];
        let column: Vec<u8> = (2..8).map(|y| level(30, y)).collect();
        assert_eq!(column, [255, 255, 0, 0, 255, 255]);
        assert_eq!((level(40, 40), level(71, 40)), (0, 0));
    }
}

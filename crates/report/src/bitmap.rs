//! Figures as PNG files, drawn by the bitmap backend of plotters at three times their size and averaged, which smooths every edge alike.

use plotters::prelude::{BitMapBackend, Color, DrawingBackend, RGBColor};
use plotters_backend::text_anchor::HPos;
use plotters_backend::{BackendCoord, DrawingErrorKind};
use srgb::Rgb;

use crate::colour::WHITE;
use crate::error::{Error, Result};
use crate::font::{self, TextStyle};
use crate::geom::{self, Point, Rect, dash, point};
use crate::style::Marker;
use crate::surface::{PNG_SCALE, Surface};

/// Samples per PNG pixel and direction.
const SUPERSAMPLING: u32 = 3;

struct PngSurface<'a> {
    backend: BitMapBackend<'a>,
}

impl PngSurface<'_> {
    const SCALE: f64 = (PNG_SCALE * SUPERSAMPLING) as f64;

    fn stroke(&mut self, points: &[Point], width: f64, colour: Rgb) -> Result<()> {
        let half = 0.5 * width;
        for pair in points.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let length = a.distance(b);
            if length == 0.0 {
                continue;
            }
            let (nx, ny) = (half * (a.y - b.y) / length, half * (b.x - a.x) / length);
            let quad = vec![
                point(a.x + nx, a.y + ny),
                point(b.x + nx, b.y + ny),
                point(b.x - nx, b.y - ny),
                point(a.x - nx, a.y - ny),
            ];
            self.fill(&[quad], colour)?;
        }
        let inner = 1..points.len().saturating_sub(1);
        let mut joints = points.get(inner).unwrap_or_default().iter();
        joints.try_for_each(|&joint| self.fill(&[geom::disc(joint, half)], colour))
    }
}

fn drawn<E: std::error::Error + Send + Sync>(
    result: Result<(), DrawingErrorKind<E>>,
) -> Result<()> {
    result.map_err(Error::draw)
}

/// Samples from layout units.
fn sampled(p: Point) -> BackendCoord {
    let sample = |c: f64| (c * PngSurface::SCALE).round() as i32;
    (sample(p.x), sample(p.y))
}

impl Surface for PngSurface<'_> {
    fn dashed(&mut self, points: &[Point], width: f64, colour: Rgb, pattern: &[f64]) -> Result<()> {
        let mut dashes = dash(points, pattern).into_iter();
        dashes.try_for_each(|piece| self.stroke(&piece, width, colour))
    }

    /// One horizontal span of samples at a time. A sample belongs to the region if its centre does.
    fn fill(&mut self, loops: &[Vec<Point>], colour: Rgb) -> Result<()> {
        let ((width, height), Rgb(r, g, b)) = (self.backend.get_size(), colour);
        let ink = RGBColor(r, g, b).stroke_width(1);
        let sample = |c: f64, limit: u32| {
            (c * Self::SCALE - 0.5).ceil().clamp(0.0, f64::from(limit)) as usize
        };
        let all = || loops.iter().flatten().map(|p| sample(p.y, height));
        let (Some(first), Some(last)) = (all().min(), all().max()) else {
            return Ok(());
        };
        let mut crossings: Vec<Vec<f64>> = vec![Vec::new(); last - first];
        for ring in loops {
            for (k, &b) in ring.iter().enumerate() {
                let a = ring[(k + ring.len() - 1) % ring.len()];
                let (upper, lower) = if a.y <= b.y { (a, b) } else { (b, a) };
                for row in sample(upper.y, height)..sample(lower.y, height) {
                    let t = ((row as f64 + 0.5) / Self::SCALE - upper.y) / (lower.y - upper.y);
                    crossings[row - first].push(upper.towards(lower, t).x);
                }
            }
        }
        for (y, mut xs) in (first as i32..).zip(crossings) {
            xs.sort_by(f64::total_cmp);
            for span in xs.chunks_exact(2) {
                let (from, to) = (sample(span[0], width) as i32, sample(span[1], width) as i32);
                if from < to {
                    drawn(self.backend.draw_line((from, y), (to - 1, y), &ink))?;
                }
            }
        }
        Ok(())
    }

    fn markers(&mut self, marker: Marker, places: &[Point], colour: Rgb) -> Result<()> {
        for &at in places {
            self.fill(&[marker.outline(at, Marker::RADIUS + Marker::RIM)], WHITE)?;
            self.fill(&[marker.outline(at, Marker::RADIUS)], colour)?;
        }
        Ok(())
    }

    fn text(&mut self, line: &str, at: Point, style: TextStyle) -> Result<()> {
        let (em, rise) = (style.em * Self::SCALE, style.rise());
        let width = font::width(line, em).round() as i32;
        let start = match style.align {
            HPos::Left => 0,
            HPos::Center => -width / 2,
            HPos::Right => -width,
        };
        let top = if style.vertical {
            sampled(point(at.x - rise, at.y))
        } else {
            sampled(point(at.x, at.y - rise))
        };
        let (Rgb(r, g, b), mut result) = (style.colour, Ok(()));
        font::rasterize(line, em, |along, down, covered| {
            let along = start + along;
            let (x, y) = if style.vertical {
                (top.0 + down, top.1 - along)
            } else {
                (top.0 + along, top.1 + down)
            };
            let ink = RGBColor(r, g, b).mix(f64::from(covered).min(1.0));
            if result.is_ok() {
                result = self.backend.draw_pixel((x, y), ink.to_backend_color());
            }
        });
        drawn(result)
    }

    fn image(&mut self, area: Rect, columns: usize, cells: &[Rgb], _: bool) -> Result<()> {
        let rows = cells.len() / columns;
        let (x0, y0) = sampled(point(area.x, area.y));
        let (x1, y1) = sampled(point(area.right(), area.bottom()));
        let (width, height) = ((x1 - x0).max(1) as usize, (y1 - y0).max(1) as usize);
        let row = |y: usize| y * rows / height * columns;
        let cell = |k: usize| cells[row(k / width) + k % width * columns / width];
        let pixels = (0..width * height).map(cell);
        let pixels: Vec<u8> = pixels.flat_map(|Rgb(r, g, b)| [r, g, b]).collect();
        let size = (width as u32, height as u32);
        drawn(self.backend.blit_bitmap((x0, y0), size, &pixels))
    }
}

/// Draws a PNG file of the given size in layout units.
pub(crate) fn png(
    (width, height): (u32, u32),
    draw: impl FnOnce(&mut dyn Surface) -> Result<()>,
) -> Result<Vec<u8>> {
    let (w, h) = (width * PNG_SCALE, height * PNG_SCALE);
    let fine = (w * SUPERSAMPLING, h * SUPERSAMPLING);
    let Rgb(page, ..) = WHITE;
    let mut buffer = vec![page; 3 * fine.0 as usize * fine.1 as usize];
    let backend = BitMapBackend::with_buffer_and_format(&mut buffer, fine).map_err(Error::draw)?;
    let mut surface = PngSurface { backend };
    draw(&mut surface)?;
    drawn(surface.backend.present())?;
    drop(surface);
    let width = w as usize;
    crate::encode::png(width, &averaged(&buffer, width))
}

/// Means over square blocks of samples, rounded.
fn averaged(samples: &[u8], width: usize) -> Vec<Rgb> {
    let factor = SUPERSAMPLING as usize;
    let (stride, count) = (3 * width * factor, factor * factor);
    let mut pixels = Vec::with_capacity(samples.len() / (3 * count));
    for rows in samples.chunks_exact(stride * factor) {
        for column in 0..width {
            let mean = |channel: usize| {
                let first = 3 * column * factor + channel;
                let block = (0..count).map(|s| (s / factor) * stride + first + 3 * (s % factor));
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
    use crate::figure::tests::Picture;

    const BLACK: Rgb = Rgb(0, 0, 0);

    fn ring(centre: f64, half: f64) -> Vec<Point> {
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
            let bytes = png((40, 40), |s| s.fill(&loops, BLACK)).unwrap();
            let area = 20 * 20 - 10 * 10 + 2 * 2 + 4 * 4;
            assert_eq!(Picture::new(&bytes).count(BLACK), 4 * area);
            hole.reverse();
        }
    }

    #[test]
    fn hairlines_are_sharp_and_wide_curves_without_holes() {
        let cross = [
            point(5.0, 5.0),
            point(35.0, 35.0),
            point(35.0, 5.0),
            point(5.0, 35.0),
        ];
        let bytes = png((40, 40), |s| {
            s.stroke(&[point(5.0, 2.5), point(35.0, 2.5)], 1.0, BLACK)?;
            s.stroke(&cross, 6.0, BLACK)
        });
        let picture = Picture::new(&bytes.unwrap());
        let column: Vec<Rgb> = (2..8).map(|y| picture.pixel(30, y)).collect();
        assert_eq!(column, [WHITE, WHITE, BLACK, BLACK, WHITE, WHITE]);
        assert_eq!(picture.pixel(40, 40), BLACK);
        assert_eq!(picture.pixel(71, 40), BLACK);
    }
}

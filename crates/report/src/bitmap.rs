//! Figures as PNG files, drawn at three times their size and averaged, which smooths every edge alike.

use srgb::Rgb;

use crate::colour::WHITE;
use crate::font::{self, Align, TextStyle};
use crate::geom::{self, Point, Rect, dash, point};
use crate::style::Marker;
use crate::surface::{PNG_SCALE, Surface};

/// Samples per PNG pixel and direction.
const SUPERSAMPLING: usize = 3;
/// Samples per layout unit.
const SCALE: f64 = (PNG_SCALE * SUPERSAMPLING) as f64;

/// Samples in rows from the top.
struct PngSurface {
    width: usize,
    samples: Vec<Rgb>,
}

impl PngSurface {
    fn height(&self) -> usize {
        self.samples.len() / self.width
    }

    /// The sample in a column and a row, if there is one.
    fn sample(&mut self, x: i32, y: i32) -> Option<&mut Rgb> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        let index = y * self.width + x;
        self.samples.get_mut(index).filter(|_| x < self.width)
    }

    fn stroke(&mut self, points: &[Point], width: f64, colour: Rgb) {
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
            self.fill(&[quad], colour);
        }
        let inner = 1..points.len().saturating_sub(1);
        for &joint in points.get(inner).unwrap_or_default() {
            self.fill(&[geom::disc(joint, half)], colour);
        }
    }
}

/// Column and row of the sample at a place in layout units.
fn sampled(p: Point) -> (i32, i32) {
    let sample = |c: f64| (c * SCALE).round() as i32;
    (sample(p.x), sample(p.y))
}

impl Surface for PngSurface {
    fn dashed(&mut self, points: &[Point], width: f64, colour: Rgb, pattern: &[f64]) {
        for piece in dash(points, pattern) {
            self.stroke(&piece, width, colour);
        }
    }

    /// One horizontal span of samples at a time. A sample belongs to the region if its centre does.
    fn fill(&mut self, loops: &[Vec<Point>], colour: Rgb) {
        let (width, height) = (self.width, self.height());
        let sample =
            |c: f64, limit: usize| (c * SCALE - 0.5).ceil().clamp(0.0, limit as f64) as usize;
        let all = || loops.iter().flatten().map(|p| sample(p.y, height));
        let (Some(first), Some(last)) = (all().min(), all().max()) else {
            return;
        };
        let mut crossings: Vec<Vec<f64>> = vec![Vec::new(); last - first];
        for ring in loops {
            for (k, &b) in ring.iter().enumerate() {
                let a = ring[(k + ring.len() - 1) % ring.len()];
                let (upper, lower) = if a.y <= b.y { (a, b) } else { (b, a) };
                for row in sample(upper.y, height)..sample(lower.y, height) {
                    let t = ((row as f64 + 0.5) / SCALE - upper.y) / (lower.y - upper.y);
                    crossings[row - first].push(upper.towards(lower, t).x);
                }
            }
        }
        for (row, mut xs) in (first..).zip(crossings) {
            xs.sort_by(f64::total_cmp);
            for span in xs.chunks_exact(2) {
                let [from, to] = [span[0], span[1]].map(|x| row * width + sample(x, width));
                self.samples[from..to].fill(colour);
            }
        }
    }

    fn markers(&mut self, marker: Marker, places: &[Point], colour: Rgb) {
        for &at in places {
            self.fill(&[marker.outline(at, Marker::RADIUS + Marker::RIM)], WHITE);
            self.fill(&[marker.outline(at, Marker::RADIUS)], colour);
        }
    }

    fn text(&mut self, line: &str, at: Point, style: TextStyle) {
        let (em, rise) = (style.em * SCALE, style.rise());
        let width = font::width(line, em).round() as i32;
        let start = match style.align {
            Align::Left => 0,
            Align::Centre => -width / 2,
            Align::Right => -width,
        };
        let top = if style.vertical {
            sampled(point(at.x - rise, at.y))
        } else {
            sampled(point(at.x, at.y - rise))
        };
        font::rasterize(line, em, |along, down, covered| {
            let along = start + along;
            let (x, y) = if style.vertical {
                (top.0 + down, top.1 - along)
            } else {
                (top.0 + along, top.1 + down)
            };
            if let Some(sample) = self.sample(x, y) {
                *sample = mixed(*sample, style.colour, covered);
            }
        });
    }

    fn image(&mut self, area: Rect, columns: usize, cells: &[Rgb], _: bool) {
        let rows = cells.len() / columns;
        let (x0, y0) = sampled(point(area.x, area.y));
        let (x1, y1) = sampled(point(area.right(), area.bottom()));
        let [width, height] = [x1 - x0, y1 - y0].map(|side| side.max(1));
        for y in 0..height {
            for x in 0..width {
                let row = y as usize * rows / height as usize;
                let column = x as usize * columns / width as usize;
                if let Some(sample) = self.sample(x0 + x, y0 + y) {
                    *sample = cells[row * columns + column];
                }
            }
        }
    }
}

/// A sample of which a part is covered, in steps of 1/256.
fn mixed(old: Rgb, new: Rgb, covered: f32) -> Rgb {
    let part = match (256.0 * covered) as i32 {
        255.. => 256,
        part => part,
    };
    let mix = |old: u8, new: u8| {
        let (old, new) = (i32::from(old), i32::from(new));
        (old + (new - old) * part / 256) as u8
    };
    Rgb(mix(old.0, new.0), mix(old.1, new.1), mix(old.2, new.2))
}

/// Draws a PNG file of the given size in layout units.
pub(crate) fn png((width, height): (u32, u32), draw: impl FnOnce(&mut dyn Surface)) -> Vec<u8> {
    let [width, height] = [width, height].map(|side| side as usize * PNG_SCALE);
    let fine = [width, height].map(|side| side * SUPERSAMPLING);
    let mut surface = PngSurface {
        width: fine[0],
        samples: vec![WHITE; fine[0] * fine[1]],
    };
    draw(&mut surface);
    crate::encode::png(width, &averaged(&surface))
}

/// Means over square blocks of samples, rounded.
fn averaged(surface: &PngSurface) -> Vec<Rgb> {
    let count = SUPERSAMPLING * SUPERSAMPLING;
    let mut pixels = Vec::with_capacity(surface.samples.len() / count);
    for rows in surface.samples.chunks_exact(surface.width * SUPERSAMPLING) {
        for first in (0..surface.width).step_by(SUPERSAMPLING) {
            let block = (rows.chunks_exact(surface.width))
                .flat_map(|row| &row[first..first + SUPERSAMPLING]);
            let [r, g, b] = block.fold([0; 3], |[r, g, b], sample| {
                let &Rgb(red, green, blue) = sample;
                [
                    r + usize::from(red),
                    g + usize::from(green),
                    b + usize::from(blue),
                ]
            });
            let [r, g, b] = [r, g, b].map(|sum| ((sum + count / 2) / count) as u8);
            pixels.push(Rgb(r, g, b));
        }
    }
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let bytes = png((40, 40), |s| s.fill(&loops, BLACK));
            let picture = image::load_from_memory(&bytes).unwrap().into_rgb8();
            let area = 20 * 20 - 10 * 10 + 2 * 2 + 4 * 4;
            let black = picture.pixels().filter(|pixel| pixel.0 == [0; 3]);
            assert_eq!(black.count(), 4 * area);
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
            s.stroke(&[point(5.0, 2.5), point(35.0, 2.5)], 1.0, BLACK);
            s.stroke(&cross, 6.0, BLACK);
        });
        let picture = image::load_from_memory(&bytes).unwrap().into_rgb8();
        let level = |x: u32, y: u32| picture.get_pixel(x, y).0[0];
        let column: Vec<u8> = (2..8).map(|y| level(30, y)).collect();
        assert_eq!(column, [255, 255, 0, 0, 255, 255]);
        assert_eq!((level(40, 40), level(71, 40)), (0, 0));
    }
}

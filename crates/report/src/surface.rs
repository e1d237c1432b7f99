//! The two drawing surfaces, SVG and PNG, behind one small trait.
//!
//! Both stand on the backends of plotters. Layout is in units of which a README shows one per CSS
//! pixel. SVG coordinates are multiples of 1/8 unit; a PNG has two pixels per unit and is drawn
//! three times finer still, then averaged, which smooths every edge alike.
//!
//! The charts of plotters are not used. Its bitmaps fill polygons one pixel too wide, leave holes where a wide curve crosses itself and
//! know dashes of one length only; its SVG documents stretch no picture; its axes have no small ticks and no factor common to all labels;
//! its plots side by side do not line up.

use std::f64::consts::TAU;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use plotters::prelude::{BitMapBackend, Color, DrawingBackend, RGBColor, SVGBackend, ShapeStyle};
use plotters_backend::{BackendCoord, DrawingErrorKind};
use srgb::Rgb;

use crate::colour::WHITE;
use crate::error::{Error, Result};
use crate::font::TextStyle;
use crate::geom::{Point, Rect, dash, point};

/// PNG pixels per layout unit.
pub(crate) const PNG_SCALE: u32 = 2;
/// Samples per PNG pixel and direction.
const SUPERSAMPLING: u32 = 3;
/// SVG user units per layout unit.
const SVG_SCALE: u32 = 8;

/// What the charts need to draw. Coordinates are layout units.
pub(crate) trait Surface {
    /// A solid polyline with round joins.
    fn stroke(&mut self, points: &[Point], width: f64, colour: Rgb) -> Result<()>;
    /// The region inside an odd number of the loops.
    fn fill(&mut self, loops: &[Vec<Point>], colour: Rgb) -> Result<()>;
    /// One line of text, anchored at the middle of its capitals.
    fn text(&mut self, line: &str, at: Point, style: TextStyle) -> Result<()>;
    /// A raster of `columns` cells a row, row by row from the top, stretched over `area`, below everything else. Viewers may
    /// interpolate its cells if it is `smooth`.
    fn image(&mut self, area: Rect, columns: usize, cells: &[Rgb], smooth: bool) -> Result<()>;
}

impl dyn Surface + '_ {
    /// Outlines a box with a line one unit wide.
    pub fn outline(&mut self, area: Rect, colour: Rgb) -> Result<()> {
        let [a, b, c, d] = area.corners();
        for (from, to) in [(a, b), (d, c)] {
            let ends = [point(from.x - 0.5, from.y), point(to.x + 0.5, to.y)];
            self.stroke(&ends, 1.0, colour)?;
        }
        self.stroke(&[a, d], 1.0, colour)?;
        self.stroke(&[b, c], 1.0, colour)
    }

    /// A polyline in dashes.
    pub fn dashed(
        &mut self,
        points: &[Point],
        width: f64,
        colour: Rgb,
        pattern: &[f64],
    ) -> Result<()> {
        let mut dashes = dash(points, pattern).into_iter();
        dashes.try_for_each(|piece| self.stroke(&piece, width, colour))
    }
}

fn ink(Rgb(r, g, b): Rgb, width: f64) -> ShapeStyle {
    RGBColor(r, g, b).stroke_width(width.round() as u32)
}

fn drawn<E: std::error::Error + Send + Sync>(
    result: Result<(), DrawingErrorKind<E>>,
) -> Result<()> {
    result.map_err(failed)
}

fn failed(error: impl std::error::Error) -> Error {
    let cause = error.to_string();
    Error::Draw { cause }
}

fn to_device(p: Point, scale: f64) -> BackendCoord {
    ((p.x * scale).round() as i32, (p.y * scale).round() as i32)
}

fn draw_text(
    backend: &mut impl DrawingBackend,
    scale: f64,
    (line, at, style): (&str, Point, TextStyle),
) -> Result<()> {
    let anchor = if style.vertical {
        point(at.x - style.rise(), at.y)
    } else {
        point(at.x, at.y - style.rise())
    };
    let style = TextStyle {
        em: style.em * scale,
        ..style
    };
    drawn(backend.draw_text(line, &style, to_device(anchor, scale)))
}

struct SvgSurface<'a> {
    backend: SVGBackend<'a>,
    /// `<image>` elements, which the backend cannot stretch.
    images: Vec<String>,
}

impl SvgSurface<'_> {
    const SCALE: f64 = SVG_SCALE as f64;
}

impl Surface for SvgSurface<'_> {
    fn stroke(&mut self, points: &[Point], width: f64, colour: Rgb) -> Result<()> {
        let style = ink(colour, width * Self::SCALE);
        let mut path: Vec<BackendCoord> =
            points.iter().map(|&p| to_device(p, Self::SCALE)).collect();
        path.dedup();
        drawn(self.backend.draw_path(path, &style))
    }

    /// The backend has polygons of one loop: this one goes around all of them, over bridges walked both ways.
    fn fill(&mut self, loops: &[Vec<Point>], colour: Rgb) -> Result<()> {
        let starts = loops.iter().filter_map(|ring| ring.first()).rev();
        let around = (loops.iter()).flat_map(|ring| ring.iter().chain(ring.first()));
        let path = around.chain(starts);
        let path = path.map(|&p| to_device(p, Self::SCALE));
        drawn(self.backend.fill_polygon(path, &ink(colour, 0.0)))
    }

    fn text(&mut self, line: &str, at: Point, style: TextStyle) -> Result<()> {
        draw_text(&mut self.backend, Self::SCALE, (line, at, style))
    }

    fn image(&mut self, area: Rect, columns: usize, cells: &[Rgb], smooth: bool) -> Result<()> {
        let bytes: Vec<u8> = cells.iter().flat_map(|&Rgb(r, g, b)| [r, g, b]).collect();
        let encoded = STANDARD.encode(encode_png(columns, cells.len() / columns, &bytes)?);
        let (x, y) = to_device(point(area.x, area.y), Self::SCALE);
        let (right, bottom) = to_device(point(area.right(), area.bottom()), Self::SCALE);
        let (width, height) = (right - x, bottom - y);
        let rendering = if smooth { "auto" } else { "pixelated" };
        self.images.push(format!(
            "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\" \
             style=\"image-rendering:{rendering}\" href=\"data:image/png;base64,{encoded}\"/>\n"
        ));
        Ok(())
    }
}

/// Draws an SVG document of the given size in layout units.
pub(crate) fn svg(
    (width, height): (u32, u32),
    draw: impl FnOnce(&mut dyn Surface) -> Result<()>,
) -> Result<String> {
    let (w, h) = (width * SVG_SCALE, height * SVG_SCALE);
    let mut document = String::new();
    let images = {
        let mut surface = SvgSurface {
            backend: SVGBackend::with_string(&mut document, (w, h)),
            images: Vec::new(),
        };
        draw(&mut surface)?;
        drawn(surface.backend.present())?;
        surface.images.concat()
    };
    let size = format!("<svg width=\"{w}\" height=\"{h}\"");
    let look = "stroke-linejoin=\"round\" fill-rule=\"evenodd\"";
    let sized = format!("<svg width=\"{width}\" height=\"{height}\" {look}");
    let document = document.replacen(&size, &sized, 1);
    let page = "<rect width=\"100%\" height=\"100%\" fill=\"#FFFFFF\"/>\n";
    Ok(document.replacen(">\n", &format!(">\n{page}{images}"), 1))
}

struct PngSurface<'a> {
    backend: BitMapBackend<'a>,
}

impl PngSurface<'_> {
    const SCALE: f64 = (PNG_SCALE * SUPERSAMPLING) as f64;
}

impl Surface for PngSurface<'_> {
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
        joints.try_for_each(|&joint| self.fill(&[disc(joint, half)], colour))
    }

    /// One horizontal span of samples at a time. A sample belongs to the region if its centre does.
    fn fill(&mut self, loops: &[Vec<Point>], colour: Rgb) -> Result<()> {
        let ((width, height), style) = (self.backend.get_size(), ink(colour, 1.0));
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
                    drawn(self.backend.draw_line((from, y), (to - 1, y), &style))?;
                }
            }
        }
        Ok(())
    }

    fn text(&mut self, line: &str, at: Point, style: TextStyle) -> Result<()> {
        draw_text(&mut self.backend, Self::SCALE, (line, at, style))
    }

    fn image(&mut self, area: Rect, columns: usize, cells: &[Rgb], _: bool) -> Result<()> {
        let rows = cells.len() / columns;
        let (x0, y0) = to_device(point(area.x, area.y), Self::SCALE);
        let (x1, y1) = to_device(point(area.right(), area.bottom()), Self::SCALE);
        let (width, height) = ((x1 - x0).max(1) as usize, (y1 - y0).max(1) as usize);
        let row = |y: usize| y * rows / height * columns;
        let cell = |k: usize| cells[row(k / width) + k % width * columns / width];
        let pixels = (0..width * height).map(cell);
        let pixels: Vec<u8> = pixels.flat_map(|Rgb(r, g, b)| [r, g, b]).collect();
        let size = (width as u32, height as u32);
        drawn(self.backend.blit_bitmap((x0, y0), size, &pixels))
    }
}

/// A regular polygon that passes for a disc at the sizes used for markers and joins.
pub(crate) fn disc(centre: Point, radius: f64) -> Vec<Point> {
    let sides = if radius < 2.0 { 12 } else { 24 };
    let corner = |k| {
        let (sin, cos) = (TAU * f64::from(k) / f64::from(sides)).sin_cos();
        point(centre.x + radius * cos, centre.y + radius * sin)
    };
    (0..sides).map(corner).collect()
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
    let backend = BitMapBackend::with_buffer_and_format(&mut buffer, fine).map_err(failed)?;
    let mut surface = PngSurface { backend };
    draw(&mut surface)?;
    drawn(surface.backend.present())?;
    drop(surface);
    let (w, h) = (w as usize, h as usize);
    encode_png(w, h, &averaged(&buffer, w, h))
}

/// Means over square blocks of samples, rounded.
fn averaged(samples: &[u8], width: usize, height: usize) -> Vec<u8> {
    let factor = SUPERSAMPLING as usize;
    let (stride, count) = (3 * width * factor, factor * factor);
    let mut pixels = Vec::with_capacity(3 * width * height);
    for rows in samples.chunks_exact(stride * factor) {
        for k in 0..3 * width {
            let first = k / 3 * 3 * factor + k % 3;
            let block = (0..count).map(|s| (s / factor) * stride + first + 3 * (s % factor));
            let sum: usize = block.map(|at| usize::from(rows[at])).sum();
            pixels.push(((sum + count / 2) / count) as u8);
        }
    }
    pixels
}

fn encode_png(width: usize, height: usize, rgb: &[u8]) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(rgb).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
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
        // In an SVG document they are one path that returns over its bridges.
        let document = svg((40, 40), |s| {
            s.fill(&[ring(20.0, 10.0), ring(20.0, 5.0)], BLACK)
        })
        .unwrap();
        assert!(document.contains("fill-rule=\"evenodd\""));
        let path = "80,80 240,80 240,240 80,240 80,80 120,120 200,120 200,200 120,200 120,120 120,120 80,80 ";
        assert!(document.contains(path), "{document}");
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

    #[test]
    fn an_svg_image_takes_its_place_and_scale() {
        let cells = [Rgb(1, 2, 3), Rgb(4, 5, 6)];
        let document = svg((100, 50), |s| {
            s.fill(&[ring(5.0, 2.0)], BLACK)?;
            s.image(Rect::new(10.0, 5.0, 20.0, 30.0), 2, &cells, false)
        })
        .unwrap();
        assert!(document.starts_with("<svg width=\"100\" height=\"50\""));
        assert!(document.contains("viewBox=\"0 0 800 400\""));
        let image = document.find("<image x=\"80\" y=\"40\" width=\"160\" height=\"240\"");
        assert!(
            image.unwrap() < document.find("<polygon").unwrap(),
            "below everything else"
        );
    }
}

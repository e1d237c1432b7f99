//! The two drawing surfaces, SVG and PNG, behind one small trait.
//!
//! Both stand on the backends of `plotters`. Layout is in units of which a README shows one per CSS
//! pixel. SVG coordinates are multiples of 1/8 unit; a PNG has two pixels per unit and is drawn
//! three times finer still, then averaged, which smooths every edge alike.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use plotters::prelude::{BitMapBackend, SVGBackend};
use plotters_backend::text_anchor::HPos;
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, DrawingBackend, DrawingErrorKind,
};
use srgb::Rgb;

use crate::error::{Error, Result};
use crate::font::{CAP_HEIGHT, Label, TOP_TO_BASELINE};
use crate::geom::{Point, Rect, dash, inside, point, signed_area};

/// PNG pixels per layout unit.
pub(crate) const PNG_SCALE: u32 = 2;
/// Samples per PNG pixel and direction.
const SUPERSAMPLING: u32 = 3;
/// SVG user units per layout unit.
const SVG_SCALE: u32 = 8;

/// One line of text.
#[derive(Clone, Copy)]
pub(crate) struct Text<'a> {
    pub line: &'a str,
    /// Anchor: horizontally as `align` says, vertically the middle of the capitals.
    pub at: Point,
    pub em: f64,
    pub colour: Rgb,
    pub align: HPos,
    /// Read from bottom to top; then `align` is along that direction.
    pub vertical: bool,
}

/// How viewers may scale a raster.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scaling {
    /// Cells stay sharp.
    Cells,
    /// Pixels are interpolated.
    Smooth,
}

/// What the charts need to draw. Coordinates are layout units.
pub(crate) trait Surface {
    /// A filled box.
    fn rect(&mut self, area: Rect, colour: Rgb) -> Result<()>;
    /// A solid polyline with round joins.
    fn stroke(&mut self, points: &[Point], width: f64, colour: Rgb) -> Result<()>;
    /// The region inside an odd number of the loops.
    fn fill(&mut self, loops: &[Vec<Point>], colour: Rgb) -> Result<()>;
    /// One line of text.
    fn text(&mut self, text: Text<'_>) -> Result<()>;
    /// A raster of `columns * rows` cells, row by row from the top, stretched over `area`.
    fn image(&mut self, area: Rect, columns: usize, cells: &[Rgb], scaling: Scaling) -> Result<()>;
}

/// Draws a polyline in dashes.
pub(crate) fn stroke_dashed(
    surface: &mut dyn Surface,
    points: &[Point],
    width: f64,
    colour: Rgb,
    pattern: &[f64],
) -> Result<()> {
    dash(points, pattern)
        .iter()
        .try_for_each(|piece| surface.stroke(piece, width, colour))
}

/// Outlines a box.
pub(crate) fn outline(
    surface: &mut dyn Surface,
    area: Rect,
    width: f64,
    colour: Rgb,
) -> Result<()> {
    let [a, b, c, d] = area.corners();
    let half = 0.5 * width;
    let (left, right) = (point(-half, 0.0), point(half, 0.0));
    let shift = |p: Point, by: Point| point(p.x + by.x, p.y + by.y);
    surface.stroke(&[shift(a, left), shift(b, right)], width, colour)?;
    surface.stroke(&[shift(d, left), shift(c, right)], width, colour)?;
    surface.stroke(&[a, d], width, colour)?;
    surface.stroke(&[b, c], width, colour)
}

#[derive(Clone, Copy)]
struct Ink {
    colour: Rgb,
    width: u32,
}

impl BackendStyle for Ink {
    fn color(&self) -> BackendColor {
        let Rgb(r, g, b) = self.colour;
        BackendColor {
            alpha: 1.0,
            rgb: (r, g, b),
        }
    }

    fn stroke_width(&self) -> u32 {
        self.width
    }
}

fn drawn<E: std::error::Error + Send + Sync>(
    result: Result<(), DrawingErrorKind<E>>,
) -> Result<()> {
    result.map_err(|error| Error::Draw {
        cause: error.to_string(),
    })
}

fn to_device(p: Point, scale: f64) -> BackendCoord {
    ((p.x * scale).round() as i32, (p.y * scale).round() as i32)
}

fn draw_label<B: DrawingBackend>(backend: &mut B, text: Text<'_>, scale: f64) -> Result<()> {
    // Move from the middle of the capitals to the backends' top anchor.
    let rise = text.em * (TOP_TO_BASELINE - 0.5 * CAP_HEIGHT);
    let anchor = if text.vertical {
        point(text.at.x - rise, text.at.y)
    } else {
        point(text.at.x, text.at.y - rise)
    };
    let label = Label {
        em: text.em * scale,
        colour: text.colour,
        align: text.align,
        vertical: text.vertical,
    };
    drawn(backend.draw_text(text.line, &label, to_device(anchor, scale)))
}

struct SvgSurface<'a> {
    backend: SVGBackend<'a>,
    /// `<image>` elements to put in place of their markers.
    images: Vec<String>,
}

impl SvgSurface<'_> {
    const SCALE: f64 = SVG_SCALE as f64;
}

/// Text content that marks the place of the `index`-th image; private-use characters, so that no
/// label can contain it by accident.
fn image_marker(index: usize) -> String {
    format!("\u{F8FF}{index}\u{F8FF}")
}

impl Surface for SvgSurface<'_> {
    fn rect(&mut self, area: Rect, colour: Rgb) -> Result<()> {
        let [a, _, b, _] = area.corners();
        let (a, b) = (to_device(a, Self::SCALE), to_device(b, Self::SCALE));
        drawn(
            self.backend
                .draw_rect(a, b, &Ink { colour, width: 0 }, true),
        )
    }

    fn stroke(&mut self, points: &[Point], width: f64, colour: Rgb) -> Result<()> {
        let style = Ink {
            colour,
            width: (width * Self::SCALE).round() as u32,
        };
        let mut path: Vec<BackendCoord> =
            points.iter().map(|&p| to_device(p, Self::SCALE)).collect();
        path.dedup();
        drawn(self.backend.draw_path(path, &style))
    }

    fn fill(&mut self, loops: &[Vec<Point>], colour: Rgb) -> Result<()> {
        let path = stitched(loops)
            .into_iter()
            .map(|p| to_device(p, Self::SCALE));
        drawn(self.backend.fill_polygon(path, &Ink { colour, width: 0 }))
    }

    fn text(&mut self, text: Text<'_>) -> Result<()> {
        draw_label(&mut self.backend, text, Self::SCALE)
    }

    fn image(&mut self, area: Rect, columns: usize, cells: &[Rgb], scaling: Scaling) -> Result<()> {
        let rows = cells.len() / columns;
        let rendering = match scaling {
            Scaling::Cells => " style=\"image-rendering:pixelated\"",
            Scaling::Smooth => "",
        };
        let bytes: Vec<u8> = cells.iter().flat_map(|&Rgb(r, g, b)| [r, g, b]).collect();
        let encoded = STANDARD.encode(encode_png(columns as u32, rows as u32, &bytes)?);
        let (x, y) = to_device(point(area.x, area.y), Self::SCALE);
        let (right, bottom) = to_device(point(area.right(), area.bottom()), Self::SCALE);
        let (width, height) = (right - x, bottom - y);
        self.images.push(format!(
            "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" \
             preserveAspectRatio=\"none\"{rendering} \
             href=\"data:image/png;base64,{encoded}\"/>\n"
        ));
        let marker = image_marker(self.images.len() - 1);
        let style = Label {
            em: 1.0,
            colour: Rgb(0, 0, 0),
            align: HPos::Left,
            vertical: false,
        };
        drawn(self.backend.draw_text(&marker, &style, (x, y)))
    }
}

/// One closed path that fills what several nested loops fill by the even-odd rule.
///
/// Loops are turned so that odd nesting depths run backwards and are joined by bridges walked both
/// ways, so the result is right under the non-zero rule too, the only one the backend offers.
fn stitched(loops: &[Vec<Point>]) -> Vec<Point> {
    let mut path: Vec<Point> = Vec::new();
    let mut bridges: Vec<Point> = Vec::new();
    for (k, ring) in loops.iter().enumerate().filter(|(_, ring)| ring.len() > 2) {
        let depth = loops
            .iter()
            .enumerate()
            .filter(|&(other, outer)| other != k && inside(ring[0], outer))
            .count();
        let forward = (signed_area(ring) > 0.0) == (depth % 2 == 0);
        let mut oriented = ring.clone();
        if !forward {
            oriented.reverse();
        }
        path.extend(&oriented);
        path.push(oriented[0]);
        bridges.push(oriented[0]);
    }
    path.extend(bridges.iter().rev().skip(1));
    path
}

/// Draws an SVG document of the given size in layout units.
pub(crate) fn svg(
    width: u32,
    height: u32,
    draw: impl FnOnce(&mut dyn Surface) -> Result<()>,
) -> Result<String> {
    let (w, h) = (width * SVG_SCALE, height * SVG_SCALE);
    let mut document = String::new();
    let images = {
        let backend = SVGBackend::with_string(&mut document, (w, h));
        let mut surface = SvgSurface {
            backend,
            images: Vec::new(),
        };
        surface.rect(
            Rect::new(0.0, 0.0, width.into(), height.into()),
            crate::colour::WHITE,
        )?;
        draw(&mut surface)?;
        drawn(surface.backend.present())?;
        surface.images
    };
    for (k, image) in images.iter().enumerate() {
        let marker = image_marker(k);
        let place = document.find(&marker).and_then(|at| {
            let from = document[..at].rfind("<text")?;
            let to = at + document[at..].find("</text>\n")? + "</text>\n".len();
            Some(from..to)
        });
        if let Some(range) = place {
            document.replace_range(range, image);
        }
    }
    let header = format!("<svg width=\"{w}\" height=\"{h}\"");
    let sized = format!("<svg width=\"{width}\" height=\"{height}\" stroke-linejoin=\"round\"");
    Ok(document.replacen(&header, &sized, 1))
}

struct PngSurface<'a> {
    backend: BitMapBackend<'a>,
}

impl PngSurface<'_> {
    const SCALE: f64 = (PNG_SCALE * SUPERSAMPLING) as f64;

    /// Fills by the even-odd rule, one horizontal span of device pixels at a time. A pixel belongs
    /// to the region if its centre does.
    fn scan(&mut self, loops: &[Vec<Point>], colour: Rgb) -> Result<()> {
        let (width, height) = self.backend.get_size();
        let edges = || {
            loops.iter().filter(|ring| ring.len() > 2).flat_map(|ring| {
                (0..ring.len()).map(move |k| (ring[k], ring[(k + 1) % ring.len()]))
            })
        };
        let (top, bottom) = edges().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), (a, _)| {
            (lo.min(a.y * Self::SCALE), hi.max(a.y * Self::SCALE))
        });
        let first = (top - 0.5).ceil().max(0.0);
        let last = (bottom - 0.5).ceil().min(f64::from(height));
        if first >= last {
            return Ok(());
        }
        let first = first as usize;
        let mut crossings: Vec<Vec<f64>> = vec![Vec::new(); last as usize - first];
        for (a, b) in edges() {
            let (upper, lower) = if a.y <= b.y { (a, b) } else { (b, a) };
            let (y0, y1) = (upper.y * Self::SCALE, lower.y * Self::SCALE);
            let from = ((y0 - 0.5).ceil().max(0.0) as usize).max(first);
            let to = ((y1 - 0.5).ceil().max(0.0) as usize).min(first + crossings.len());
            for row in from..to {
                let t = (row as f64 + 0.5 - y0) / (y1 - y0);
                crossings[row - first].push((upper.x + t * (lower.x - upper.x)) * Self::SCALE);
            }
        }
        let style = Ink { colour, width: 1 };
        for (y, mut xs) in (first as u32..).zip(crossings) {
            xs.sort_by(f64::total_cmp);
            for span in xs.chunks_exact(2) {
                let from = (span[0] - 0.5).ceil().max(0.0) as i32;
                let to = (span[1] - 0.5).ceil().min(f64::from(width)) as i32;
                if from < to {
                    let y = y.cast_signed();
                    drawn(self.backend.draw_line((from, y), (to - 1, y), &style))?;
                }
            }
        }
        Ok(())
    }
}

impl Surface for PngSurface<'_> {
    fn rect(&mut self, area: Rect, colour: Rgb) -> Result<()> {
        self.scan(&[area.corners().to_vec()], colour)
    }

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
            self.scan(&[quad], colour)?;
        }
        for &joint in points
            .get(1..points.len().saturating_sub(1))
            .unwrap_or_default()
        {
            self.scan(&[disc(joint, half)], colour)?;
        }
        Ok(())
    }

    fn fill(&mut self, loops: &[Vec<Point>], colour: Rgb) -> Result<()> {
        self.scan(loops, colour)
    }

    fn text(&mut self, text: Text<'_>) -> Result<()> {
        draw_label(&mut self.backend, text, Self::SCALE)
    }

    fn image(&mut self, area: Rect, columns: usize, cells: &[Rgb], _: Scaling) -> Result<()> {
        let rows = cells.len() / columns;
        let (x0, y0) = to_device(point(area.x, area.y), Self::SCALE);
        let (x1, y1) = to_device(point(area.right(), area.bottom()), Self::SCALE);
        let (width, height) = ((x1 - x0).max(1) as usize, (y1 - y0).max(1) as usize);
        let mut pixels = Vec::with_capacity(3 * width * height);
        for y in 0..height {
            let row = (y * rows / height) * columns;
            for x in 0..width {
                let Rgb(r, g, b) = cells[row + x * columns / width];
                pixels.extend([r, g, b]);
            }
        }
        drawn(
            self.backend
                .blit_bitmap((x0, y0), (width as u32, height as u32), &pixels),
        )
    }
}

/// A regular polygon that passes for a disc at the sizes used for markers and joins.
pub(crate) fn disc(centre: Point, radius: f64) -> Vec<Point> {
    let sides = if radius < 2.0 { 12 } else { 24 };
    (0..sides)
        .map(|k| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(sides);
            point(
                centre.x + radius * angle.cos(),
                centre.y + radius * angle.sin(),
            )
        })
        .collect()
}

/// Draws a PNG file of the given size in layout units.
pub(crate) fn png(
    width: u32,
    height: u32,
    draw: impl FnOnce(&mut dyn Surface) -> Result<()>,
) -> Result<Vec<u8>> {
    let (w, h) = (width * PNG_SCALE, height * PNG_SCALE);
    let fine = (w * SUPERSAMPLING, h * SUPERSAMPLING);
    let mut buffer = vec![255_u8; 3 * fine.0 as usize * fine.1 as usize];
    {
        let backend =
            BitMapBackend::with_buffer_and_format(&mut buffer, fine).map_err(|error| {
                Error::Draw {
                    cause: error.to_string(),
                }
            })?;
        let mut surface = PngSurface { backend };
        draw(&mut surface)?;
        drawn(surface.backend.present())?;
    }
    encode_png(w, h, &averaged(&buffer, w as usize, h as usize))
}

/// Means over square blocks of samples, rounded.
fn averaged(fine: &[u8], width: usize, height: usize) -> Vec<u8> {
    let factor = SUPERSAMPLING as usize;
    let stride = 3 * width * factor;
    let count = (factor * factor) as u32;
    let mut sums = vec![0_u32; 3 * width];
    let mut pixels = Vec::with_capacity(3 * width * height);
    for rows in fine.chunks_exact(stride * factor) {
        sums.fill(0);
        for row in rows.chunks_exact(stride) {
            for (block, sum) in row.chunks_exact(3 * factor).zip(sums.chunks_exact_mut(3)) {
                for sample in block.chunks_exact(3) {
                    for (total, &channel) in sum.iter_mut().zip(sample) {
                        *total += u32::from(channel);
                    }
                }
            }
        }
        pixels.extend(sums.iter().map(|&sum| ((sum + count / 2) / count) as u8));
    }
    pixels
}

fn encode_png(width: u32, height: u32, rgb: &[u8]) -> Result<Vec<u8>> {
    let failed = |error: png::EncodingError| Error::Draw {
        cause: error.to_string(),
    };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
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

    fn ring(centre: f64, half: f64) -> Vec<Point> {
        Rect::new(centre - half, centre - half, 2.0 * half, 2.0 * half)
            .corners()
            .to_vec()
    }

    fn winding(p: Point, path: &[Point]) -> i32 {
        (0..path.len())
            .map(|k| {
                let (a, b) = (path[k], path[(k + 1) % path.len()]);
                let side = (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
                i32::from(a.y <= p.y && b.y > p.y && side > 0.0)
                    - i32::from(a.y > p.y && b.y <= p.y && side < 0.0)
            })
            .sum()
    }

    #[test]
    fn stitched_loops_agree_with_even_odd_under_the_winding_rule() {
        let mut hole = ring(10.0, 5.0);
        for reversed in [false, true] {
            let loops = vec![
                ring(10.0, 8.0),
                hole.clone(),
                ring(10.0, 2.0),
                ring(30.0, 3.0),
            ];
            let path = stitched(&loops);
            for (x, filled) in [
                (3.0, true),
                (6.0, false),
                (10.3, true),
                (25.0, false),
                (31.0, true),
            ] {
                let p = point(x, if x > 20.0 { 30.5 } else { 10.1 });
                assert_eq!(winding(p, &path) != 0, filled, "{x} reversed {reversed}");
            }
            hole.reverse();
        }
    }

    #[test]
    fn a_png_fill_has_the_area_it_should() {
        let bytes = png(40, 40, |s| {
            s.fill(&[ring(20.0, 10.0), ring(20.0, 5.0)], Rgb(0, 0, 0))
        });
        let (_, _, pixels) = crate::decoded::rgb(&bytes.unwrap());
        let dark = pixels.chunks_exact(3).filter(|p| p[0] == 0).count();
        assert_eq!(dark, 4 * (20 * 20 - 10 * 10));
    }

    #[test]
    fn an_svg_image_takes_its_place_and_scale() {
        let cells = [Rgb(1, 2, 3), Rgb(4, 5, 6)];
        let document = svg(100, 50, |s| {
            s.image(Rect::new(10.0, 5.0, 20.0, 30.0), 2, &cells, Scaling::Cells)
        })
        .unwrap();
        assert!(document.starts_with("<svg width=\"100\" height=\"50\""));
        assert!(document.contains("viewBox=\"0 0 800 400\""));
        assert!(document.contains("<image x=\"80\" y=\"40\" width=\"160\" height=\"240\""));
        assert!(!document.contains('\u{F8FF}') && !document.contains("<text"));
    }
}

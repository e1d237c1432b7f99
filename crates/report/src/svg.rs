//! Figures as SVG documents.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::DVec2;
use srgb::Rgb;

use crate::font::{Align, HALF_CAPITAL, TextStyle};
use crate::geom::{Rect, simplified};
use crate::style::Marker;
use crate::surface::Surface;

/// User units per layout unit. Coordinates are whole numbers of them.
const SCALE: u32 = 16;

/// How far from a curve it may be drawn, in layout units.
const TOLERANCE: f64 = 0.05;

/// Families of fonts: the embedded one, the one with the same metrics, then any.
const FAMILY: &str = "DejaVu Sans, Verdana, sans-serif";

/// A length in user units.
fn units(length: f64) -> i32 {
    (length * f64::from(SCALE)).round() as i32
}

fn hex(Rgb(r, g, b): Rgb) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

/// Path data: the first point, and the steps from each to the next.
fn path(points: &[DVec2]) -> String {
    let points = simplified(points, TOLERANCE);
    let mut places: Vec<_> = points.iter().map(|p| (units(p.x), units(p.y))).collect();
    places.dedup();
    // A minus sign separates numbers as well as a space does.
    let spaced = |number: i32| match number {
        ..0 => number.to_string(),
        _ => format!(" {number}"),
    };
    let steps = places.windows(2).map(|pair| {
        let (from, to) = (pair[0], pair[1]);
        spaced(to.0 - from.0) + &spaced(to.1 - from.1)
    });
    let steps: String = steps.collect();
    match places.first() {
        Some((x, y)) if steps.is_empty() => format!("M{x} {y}"),
        Some((x, y)) => format!("M{x} {y}l{}", steps.trim_start()),
        None => String::new(),
    }
}

#[derive(Default)]
struct SvgSurface {
    images: Vec<String>,
    shapes: Vec<String>,
}

impl Surface for SvgSurface {
    fn dashed(&mut self, points: &[DVec2], width: f64, colour: Rgb, pattern: &[f64]) {
        let (data, colour, width) = (path(points), hex(colour), units(width));
        let lengths: Vec<String> = pattern.iter().map(|&l| units(l).to_string()).collect();
        let dashes = match lengths.join(" ") {
            lengths if lengths.is_empty() => lengths,
            lengths => format!(" stroke-dasharray=\"{lengths}\""),
        };
        self.shapes.push(format!(
            "<path d=\"{data}\" stroke=\"{colour}\" stroke-width=\"{width}\"{dashes}/>\n"
        ));
    }

    fn fill(&mut self, loops: &[Vec<DVec2>], colour: Rgb) {
        let loops = loops.iter().filter(|points| !points.is_empty());
        let data: String = loops.map(|points| path(points) + "z").collect();
        self.shapes
            .push(format!("<path d=\"{data}\" fill=\"{}\"/>\n", hex(colour)));
    }

    fn markers(&mut self, marker: Marker, places: &[DVec2], colour: Rgb) {
        // The rim is a line around the marker: its middle is half its width outside.
        let radius = Marker::RADIUS + 0.5 * Marker::RIM;
        let symbol = |&at: &DVec2| match marker {
            Marker::Circle => {
                let (x, y, r) = (units(at.x), units(at.y), units(radius));
                format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\"/>\n")
            }
            _ => format!("<path d=\"{}z\"/>\n", path(&marker.outline(at, radius))),
        };
        let (fill, rim, width) = (hex(colour), hex(Rgb::WHITE), units(Marker::RIM));
        let symbols: String = places.iter().map(symbol).collect();
        self.shapes.push(format!(
            "<g fill=\"{fill}\" stroke=\"{rim}\" stroke-width=\"{width}\" stroke-linejoin=\"miter\">\n{symbols}</g>\n"
        ));
    }

    fn text(&mut self, line: &str, at: DVec2, style: TextStyle) {
        let base = style.below(at, HALF_CAPITAL);
        let (x, y) = (units(base.x), units(base.y));
        let turned = if style.vertical {
            format!(" transform=\"rotate(-90 {x} {y})\"")
        } else {
            String::new()
        };
        let (size, colour) = (units(style.em), hex(style.colour));
        let anchor = match style.align {
            Align::Left => "start",
            Align::Centre => "middle",
            Align::Right => "end",
        };
        let line = line
            .replace('&', "&amp;")
            .replace('<', "&lt;")
            .replace('>', "&gt;");
        self.shapes.push(format!(
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" text-anchor=\"{anchor}\" fill=\"{colour}\"{turned}>{line}</text>\n"
        ));
    }

    fn image(&mut self, area: Rect, columns: usize, cells: &[Rgb], smooth: bool) {
        let encoded = STANDARD.encode(crate::encode::png(columns, cells));
        let (x, y) = (units(area.x), units(area.y));
        let (width, height) = (units(area.right()) - x, units(area.bottom()) - y);
        let rendering = if smooth { "auto" } else { "pixelated" };
        self.images.push(format!(
            "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\" \
             style=\"image-rendering:{rendering}\" href=\"data:image/png;base64,{encoded}\"/>\n"
        ));
    }
}

/// Draws an SVG document of the given size in layout units.
pub(crate) fn svg(size: [u32; 2], draw: impl FnOnce(&mut dyn Surface)) -> String {
    let [width, height] = size;
    let mut surface = SvgSurface::default();
    draw(&mut surface);
    let elements = [surface.images, surface.shapes].concat().concat();
    let (w, h, page) = (width * SCALE, height * SCALE, hex(Rgb::WHITE));
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {w} {h}\" \
         font-family=\"{FAMILY}\" fill=\"none\" fill-rule=\"evenodd\" stroke-linejoin=\"round\">\n\
         <rect width=\"{w}\" height=\"{h}\" fill=\"{page}\"/>\n{elements}</svg>\n"
    )
}

#[cfg(test)]
mod tests {
    use glam::dvec2;

    use super::*;

    const BLACK: Rgb = Rgb::BLACK;

    #[test]
    fn loops_are_one_path_and_dashes_an_attribute() {
        let ring = |side| Rect::new(5.0, 5.0, side, side).corners().to_vec();
        let document = svg([100, 50], |s| {
            s.fill(&[ring(20.0), vec![], ring(10.0)], BLACK);
            s.dashed(&[dvec2(0.0, 1.0), dvec2(9.0, 1.0)], 2.0, BLACK, &[8.5, 4.5]);
        });
        let path = "M80 80l320 0 0 320-320 0zM80 80l160 0 0 160-160 0z";
        assert!(
            document.contains(&format!("<path d=\"{path}\" fill=\"#000000\"/>")),
            "{document}"
        );
        let line = "<path d=\"M0 16l144 0\" stroke=\"#000000\" stroke-width=\"32\" stroke-dasharray=\"136 72\"/>";
        assert!(document.contains(line), "{document}");
    }

    #[test]
    fn images_take_their_place_and_scale_below_everything_else() {
        let cells = [Rgb(1, 2, 3), Rgb(4, 5, 6)];
        let document = svg([100, 50], |s| {
            s.markers(Marker::Circle, &[dvec2(1.0, 2.0)], BLACK);
            s.image(Rect::new(10.0, 5.0, 20.0, 30.0), 2, &cells, false);
        });
        assert!(document.contains("width=\"100\" height=\"50\" viewBox=\"0 0 1600 800\""));
        let image = document.find("<image x=\"160\" y=\"80\" width=\"320\" height=\"480\"");
        assert!(
            image.unwrap()
                < document
                    .find("<circle cx=\"16\" cy=\"32\" r=\"69\"/>")
                    .unwrap()
        );
    }
}

//! Drawings of shapes as pictures with smooth edges.

use geometry::SignedDistance;
use rayon::prelude::*;
use render::{Picture, Rgb};

use crate::{Error, Frame};

/// Pixels at an edge are cut into this many parts along both axes.
const PARTS: u32 = 4;
/// Rows drawn at once.
const BAND: usize = 16;

/// A shape in black, on paper of a colour or on nothing.
///
/// The value of a pixel is the part of its area that the shape covers: near an edge the shape
/// is taken for a half plane in each of 16 parts of the pixel. The outline is found again in the picture by a threshold of 0.5.
pub fn drawing(
    frame: &Frame,
    shape: &dyn SignedDistance<2>,
    paper: Option<Rgb>,
) -> Result<Picture, Error> {
    // Colour times opacity, and opacity.
    let paper = paper.map_or([0.0; 4], |Rgb(r, g, b)| {
        [r, g, b, 255].map(|v| f64::from(v) / 255.0)
    });
    // A frame that was stored may have any size.
    let [width, height] = render::checked_size(frame.size())?.map(|side| side as usize);
    let mut pixels = vec![[0; 4]; width * height];
    let bands = pixels.par_chunks_mut(BAND * width).enumerate();
    bands.for_each(|(band, pixels)| {
        let first = BAND * band;
        let corners = corners(frame, shape, first, pixels.len() / width);
        for (index, pixel) in pixels.iter_mut().enumerate() {
            let [column, row] = [index % width, index / width];
            let corner = row * (width + 1) + column;
            let around = [0, 1, width + 1, width + 2].map(|k| corners[corner + k]);
            let place = [column as f64, (first + row) as f64];
            let covered = coverage(frame, shape, place, around);
            let ink = [0.0, 0.0, 0.0, 255.0].map(|v| covered * v / 255.0);
            *pixel = stored(std::array::from_fn(|c| ink[c] + (1.0 - covered) * paper[c]));
        }
    });
    Ok(Picture::new(frame.size(), pixels)?)
}

/// As a picture has it, of colour times opacity, and opacity.
fn stored([r, g, b, opacity]: [f64; 4]) -> [u8; 4] {
    let byte = |v: f64| (255.0 * v).round() as u8;
    match byte(opacity) {
        0 => [0; 4],
        alpha => {
            let [r, g, b] = [r, g, b].map(|v| byte(v / opacity));
            [r, g, b, alpha]
        }
    }
}

/// Distances at the corners of the pixels of some rows.
fn corners(frame: &Frame, shape: &dyn SignedDistance<2>, first: usize, rows: usize) -> Vec<f64> {
    let columns = frame.size()[0] as usize + 1;
    let place = |k: usize| frame.point([(k % columns) as f64, (first + k / columns) as f64]);
    let corners = 0..columns * (rows + 1);
    corners.map(|k| shape.signed_distance(place(k))).collect()
}

/// The covered part of the pixel with the given upper left corner, and distances at all four.
fn coverage(
    frame: &Frame,
    shape: &dyn SignedDistance<2>,
    [column, row]: [f64; 2],
    corners: [f64; 4],
) -> f64 {
    let side = frame.pixel();
    let s = |x: [f64; 2]| shape.signed_distance(x);
    // Nothing is near: a point in the pixel is at most 0.71 sides from a corner. Fields that have
    // lost their profile may be steep, so that only the signs tell.
    let [inside, outside] = [-1.0, 1.0].map(|sign| corners.iter().all(|s| sign * s > side));
    if inside || outside {
        return f64::from(u8::from(inside));
    }
    let part = side / f64::from(PARTS);
    let step = 0.25 * part;
    let mut sum = 0.0;
    for k in 0..PARTS * PARTS {
        let [i, j] = [k % PARTS, k / PARTS].map(|i| (f64::from(i) + 0.5) / f64::from(PARTS));
        let [x, y] = frame.point([column + i, row + j]);
        let gradient = [
            (s([x + step, y]) - s([x - step, y])) / (2.0 * step),
            (s([x, y + step]) - s([x, y - step])) / (2.0 * step),
        ];
        let length = gradient[0].hypot(gradient[1]);
        // On the line in the middle of a shape the gradient means nothing.
        let slope = if length > 0.5 { length } else { 1.0 };
        let depth = -s([x, y]) / slope;
        sum += half_plane(depth / part, gradient);
    }
    sum / f64::from(PARTS * PARTS)
}

/// The part of a unit square covered by a half plane whose border is `depth` beyond the centre
/// of the square, in the direction of the normal (of any length).
fn half_plane(depth: f64, normal: [f64; 2]) -> f64 {
    let length = normal[0].hypot(normal[1]);
    let [a, b] = if length > 0.0 {
        normal.map(|v| v.abs() / length)
    } else {
        [1.0, 0.0]
    };
    let (long, short) = (a.max(b), a.min(b));
    // What is left of the square beyond the border, or before it, is a triangle at a corner, unless
    // the border cuts opposite sides.
    let rest = 0.5 * (long + short) - depth.abs();
    let smaller = if rest <= 0.0 {
        0.0
    } else if rest < short {
        0.5 * rest * rest / (long * short)
    } else {
        0.5 - depth.abs() / long
    };
    if depth > 0.0 { 1.0 - smaller } else { smaller }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_planes_cover_what_they_do() {
        for k in 0..40 {
            let angle = f64::from(k) * 0.1637;
            let normal = [3.0 * angle.cos(), 3.0 * angle.sin()];
            for l in -10..=10 {
                let depth = 0.08 * f64::from(l);
                // Counted on a fine raster.
                let inside = |i: u32| {
                    let [x, y] = [i % 400, i / 400].map(|i| (f64::from(i) + 0.5) / 400.0 - 0.5);
                    x * angle.cos() + y * angle.sin() < depth
                };
                let counted = (0..160_000).filter(|&i| inside(i)).count() as f64 / 160e3;
                let covered = half_plane(depth, normal);
                assert!(
                    (covered - counted).abs() < 3e-3,
                    "{covered} for {counted}: {angle}, {depth}"
                );
            }
        }
    }
}

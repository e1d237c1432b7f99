//! Shapes rendered to files without the code under test.
pub mod files;

use images::{Image, Outline, Side, decode};

/// Grey values from 0 to 1, row by row from the top.
pub struct Raster {
    pub size: [u32; 2],
    pub values: Vec<f64>,
}

impl Raster {
    /// Black where `inside` holds, white elsewhere. `parts` squared points in every pixel: one for
    /// hard edges. Points are in pixels from the lower left corner, the second axis upwards.
    pub fn new(size: [u32; 2], parts: u32, inside: impl Fn([f64; 2]) -> bool) -> Self {
        let [width, height] = size;
        let mut values = Vec::new();
        for row in 0..height {
            for column in 0..width {
                let mut count = 0;
                for k in 0..parts * parts {
                    let [i, j] =
                        [k % parts, k / parts].map(|i| (f64::from(i) + 0.5) / f64::from(parts));
                    let y = f64::from(height) - f64::from(row) - j;
                    count += u32::from(inside([f64::from(column) + i, y]));
                }
                values.push(1.0 - f64::from(count) / f64::from(parts * parts));
            }
        }
        Self { size, values }
    }

    pub fn bytes(&self) -> Vec<u8> {
        self.values
            .iter()
            .map(|v| (255.0 * v).round() as u8)
            .collect()
    }

    pub fn shorts(&self) -> Vec<u16> {
        self.values
            .iter()
            .map(|v| (65535.0 * v).round() as u16)
            .collect()
    }

    /// An 8-bit grey PNG, read back.
    pub fn image(&self) -> Image {
        decode(&png(
            self.size,
            png::ColorType::Grayscale,
            png::BitDepth::Eight,
            &self.bytes(),
        ))
        .unwrap()
    }
}

pub fn disc(centre: [f64; 2], radius: f64) -> impl Fn([f64; 2]) -> bool {
    move |[x, y]| (x - centre[0]).hypot(y - centre[1]) < radius
}

/// A square about a centre, turned counter-clockwise.
pub fn square(centre: [f64; 2], half: f64, angle: f64) -> impl Fn([f64; 2]) -> bool {
    move |[x, y]| {
        let (x, y) = (x - centre[0], y - centre[1]);
        let (sin, cos) = angle.sin_cos();
        (cos * x + sin * y).abs().max((cos * y - sin * x).abs()) < half
    }
}

/// A PNG file of rows as they are stored.
pub fn png(size: [u32; 2], colour: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
    png_with(size, colour, depth, data, |_| ())
}

/// A PNG file with more in its header.
pub fn png_with(
    size: [u32; 2],
    colour: png::ColorType,
    depth: png::BitDepth,
    data: &[u8],
    more: impl FnOnce(&mut png::Encoder<&mut Vec<u8>>),
) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    more(&mut encoder);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(data).unwrap();
    writer.finish().unwrap();
    bytes
}

/// A JPEG file.
pub fn jpeg(
    size: [u32; 2],
    colour: jpeg_encoder::ColorType,
    progressive: bool,
    data: &[u8],
) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = jpeg_encoder::Encoder::new(&mut bytes, 95);
    encoder.set_progressive(progressive);
    encoder
        .encode(data, size[0] as u16, size[1] as u16, colour)
        .unwrap();
    bytes
}

/// The outline with a threshold in the middle.
pub fn outline(image: &Image) -> Outline {
    let side = Side::of(image, 0.5).unwrap();
    Outline::of_image(image, side).unwrap()
}

#[track_caller]
pub fn near(value: f64, expected: f64, tolerance: f64) {
    assert!(
        (value - expected).abs() <= tolerance,
        "{value} for {expected}"
    );
}

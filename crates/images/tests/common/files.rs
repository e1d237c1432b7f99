//! Image files of all kinds.

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use images::Image;
use png::{BitDepth, ColorType};

use super::{Raster, disc, png, png_with};

/// Pixels of the pictures.
pub const SIZE: [u32; 2] = [21, 13];

/// A disc that is neither in the middle nor symmetric.
pub fn raster() -> Raster {
    Raster::new(SIZE, 4, disc([7.0, 8.0], 4.5))
}

/// Rows of samples of fewer than eight bits, each row from a new byte.
pub fn packed(samples: &[u8], bits: usize) -> Vec<u8> {
    let rows = samples.chunks(SIZE[0] as usize);
    let row = |row: &[u8]| {
        let bytes = row.chunks(8 / bits).map(|chunk| {
            let shifts = (1..=chunk.len()).map(|k| 8 - k * bits);
            chunk
                .iter()
                .zip(shifts)
                .fold(0, |byte, (s, shift)| byte | s << shift)
        });
        bytes.collect::<Vec<u8>>()
    };
    rows.flat_map(row).collect()
}

pub fn widened(bytes: impl IntoIterator<Item = u8>) -> Vec<u16> {
    bytes.into_iter().map(|v| 257 * u16::from(v)).collect()
}

/// The same picture in every kind of PNG, with the grey values expected.
pub fn png_files() -> Vec<(&'static str, Vec<u8>, Image)> {
    let raster = raster();
    let (bytes, shorts) = (raster.bytes(), raster.shorts());
    let image = |grey: Vec<u16>, opacity| Image::new(SIZE, grey, opacity).unwrap();
    let plain = || widened(bytes.iter().copied());
    let big_endian = |values: &[u16]| {
        values
            .iter()
            .flat_map(|v| v.to_be_bytes())
            .collect::<Vec<u8>>()
    };
    let each = |f: fn(u8) -> Vec<u8>| bytes.iter().flat_map(|&v| f(v)).collect::<Vec<u8>>();

    let mut files = vec![
        (
            "grey",
            png(SIZE, ColorType::Grayscale, BitDepth::Eight, &bytes),
            image(plain(), None),
        ),
        (
            "grey, 16 bits",
            png(
                SIZE,
                ColorType::Grayscale,
                BitDepth::Sixteen,
                &big_endian(&shorts),
            ),
            image(shorts.clone(), None),
        ),
        (
            "grey and opacity",
            png(
                SIZE,
                ColorType::GrayscaleAlpha,
                BitDepth::Eight,
                &each(|v| vec![v, 255 - v]),
            ),
            image(plain(), Some(widened(bytes.iter().map(|v| 255 - v)))),
        ),
        (
            "grey and opacity, 16 bits",
            png(
                SIZE,
                ColorType::GrayscaleAlpha,
                BitDepth::Sixteen,
                &big_endian(
                    &shorts
                        .iter()
                        .flat_map(|&v| [v, v / 3])
                        .collect::<Vec<u16>>(),
                ),
            ),
            image(shorts.clone(), Some(shorts.iter().map(|v| v / 3).collect())),
        ),
        (
            "colours",
            png(
                SIZE,
                ColorType::Rgb,
                BitDepth::Eight,
                &each(|v| vec![v, 0, 255]),
            ),
            image(
                widened(bytes.iter().copied())
                    .iter()
                    .map(|&v| (0.299 * f64::from(v) + 0.114 * 65535.0).round() as u16)
                    .collect(),
                None,
            ),
        ),
        (
            "colours, 16 bits",
            png(
                SIZE,
                ColorType::Rgb,
                BitDepth::Sixteen,
                &big_endian(&shorts.iter().flat_map(|&v| [v; 3]).collect::<Vec<u16>>()),
            ),
            image(shorts.clone(), None),
        ),
        (
            "colours and opacity",
            png(
                SIZE,
                ColorType::Rgba,
                BitDepth::Eight,
                &each(|v| vec![0, v, 0, v / 2]),
            ),
            image(
                widened(bytes.iter().copied())
                    .iter()
                    .map(|&v| (0.587 * f64::from(v)).round() as u16)
                    .collect(),
                Some(widened(bytes.iter().map(|v| v / 2))),
            ),
        ),
    ];
    // Few bits, as grey values and as indices of a palette with transparent colours.
    for (name, depth, bits) in [
        ("1 bit", BitDepth::One, 1),
        ("2 bits", BitDepth::Two, 2),
        ("4 bits", BitDepth::Four, 4),
        ("8 bits", BitDepth::Eight, 8),
    ] {
        let largest = ((1_u32 << bits) - 1).min(15) as u8;
        let samples: Vec<u8> = raster
            .values
            .iter()
            .map(|v| (f64::from(largest) * v).round() as u8)
            .collect();
        let data = packed(&samples, bits);
        if bits < 8 {
            let grey = widened(samples.iter().map(|s| s * (255 / largest)));
            files.push((
                name,
                png(SIZE, ColorType::Grayscale, depth, &data),
                image(grey, None),
            ));
        }
        let palette: Vec<u8> = (0..=largest)
            .flat_map(|s| [17 * s, 17 * s, 17 * s])
            .collect();
        let file = png_with(SIZE, ColorType::Indexed, depth, &data, |encoder| {
            encoder.set_palette(palette);
            encoder.set_trns(vec![0, 100]);
        });
        let opacity = samples
            .iter()
            .map(|&s| [0, 100].get(usize::from(s)).copied().unwrap_or(255));
        let grey = samples.iter().map(|s| 17 * s);
        files.push((name, file, image(widened(grey), Some(widened(opacity)))));
    }
    // White that is transparent.
    let file = png_with(
        SIZE,
        ColorType::Grayscale,
        BitDepth::Eight,
        &bytes,
        |encoder| {
            encoder.set_trns(vec![0, 255]);
        },
    );
    let opacity = bytes.iter().map(|&v| if v == 255 { 0 } else { 255 });
    files.push((
        "transparent white",
        file,
        image(plain(), Some(widened(opacity))),
    ));
    files
}

/// The same picture in the formats that the crate `image` reads beside PNG, with the grey values
/// expected.
pub fn other_files() -> Vec<(&'static str, Vec<u8>, Image)> {
    let bytes = raster().bytes();
    let colours = bytes.iter().flat_map(|&v| [v; 3]).collect();
    let picture = image::RgbImage::from_raw(SIZE[0], SIZE[1], colours).unwrap();
    let expected = Image::new(SIZE, widened(bytes), None).unwrap();
    [
        ("BMP", image::ImageFormat::Bmp),
        ("GIF", image::ImageFormat::Gif),
        ("TIFF", image::ImageFormat::Tiff),
        ("WebP", image::ImageFormat::WebP),
    ]
    .map(|(name, format)| {
        let mut file = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut file, format).unwrap();
        (name, file.into_inner(), expected.clone())
    })
    .into()
}

/// Appends a PNG chunk.
pub fn chunk(bytes: &mut Vec<u8>, name: [u8; 4], data: &[u8]) {
    bytes.extend((data.len() as u32).to_be_bytes());
    let start = bytes.len();
    bytes.extend(name);
    bytes.extend(data);
    let mut sum = flate2::Crc::new();
    sum.update(&bytes[start..]);
    bytes.extend(sum.sum().to_be_bytes());
}

/// A PNG file of grey pixels of 8 bits, with chunks before its data, which are rows with a byte for their filter.
pub fn png_of_chunks(
    size: [u32; 2],
    interlaced: u8,
    more: &[([u8; 4], &[u8])],
    rows: &[u8],
) -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    let size = size.map(u32::to_be_bytes).concat();
    chunk(
        &mut bytes,
        *b"IHDR",
        &[&size[..], &[8, 0, 0, 0, interlaced]].concat(),
    );
    for (name, data) in more {
        chunk(&mut bytes, *name, data);
    }
    chunk(&mut bytes, *b"IDAT", &zlib(rows));
    chunk(&mut bytes, *b"IEND", &[]);
    bytes
}

/// A zlib stream without compression.
fn zlib(data: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::none());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

/// Exif data that tells the orientation.
pub fn exif(value: u8, little: bool) -> Vec<u8> {
    if little {
        [
            b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0",
            &[value, 0, 0, 0, 0, 0, 0, 0][..],
        ]
        .concat()
    } else {
        [
            b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01",
            &[0, value, 0, 0, 0, 0, 0, 0][..],
        ]
        .concat()
    }
}

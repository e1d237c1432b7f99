//! Image files: all kinds of PNG and JPEG, files that are none, and random bytes.

mod common;

use std::fs;
use std::sync::LazyLock;

use common::{Raster, disc, jpeg, png, png_with};
use images::{
    Error, FormatError, Image, Inside, Outline, OutlineDistance, Side, Threshold, decode, read,
};
use jpeg_encoder::ColorType as Jpeg;
use png::{BitDepth, ColorType};
use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRunner};

const SIZE: [u32; 2] = [21, 13];

/// A disc that is neither in the middle nor symmetric.
fn raster() -> Raster {
    Raster::new(SIZE, 4, disc([7.0, 8.0], 4.5))
}

/// Rows of samples of fewer than eight bits, each row from a new byte.
fn packed(samples: &[u8], bits: usize) -> Vec<u8> {
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

fn widened(bytes: impl IntoIterator<Item = u8>) -> Vec<u16> {
    bytes.into_iter().map(|v| 257 * u16::from(v)).collect()
}

/// The same picture in every kind of PNG, with the grey values expected.
fn png_files() -> Vec<(&'static str, Vec<u8>, Image)> {
    let raster = raster();
    let (bytes, shorts) = (raster.bytes(), raster.shorts());
    let image = |grey: Vec<u16>, opacity| Image::new(SIZE[0], SIZE[1], grey, opacity).unwrap();
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

#[test]
fn every_kind_of_png_is_read() {
    for (name, file, expected) in png_files() {
        assert_eq!(decode(&file).unwrap(), expected, "{name}");
    }
    // Opaque all over is not transparent.
    let data: Vec<u8> = raster()
        .bytes()
        .into_iter()
        .flat_map(|v| [v, 255])
        .collect();
    let image = decode(&png(
        SIZE,
        ColorType::GrayscaleAlpha,
        BitDepth::Eight,
        &data,
    ))
    .unwrap();
    assert_eq!(image.opacity(), None);
}

#[test]
fn interlaced_png_is_read() {
    // Passes of Adam7 for 5 x 5 pixels with the values 10 row + column, each row without filter.
    let starts = [
        (0, 0, 8, 8),
        (4, 0, 8, 8),
        (0, 4, 4, 8),
        (2, 0, 4, 4),
        (0, 2, 2, 4),
        (1, 0, 2, 2),
        (0, 1, 1, 2),
    ];
    let mut data = Vec::new();
    for (x0, y0, dx, dy) in starts {
        for y in (y0..5_u8).step_by(dy) {
            let row: Vec<u8> = (x0..5_u8).step_by(dx).map(|x| 10 * y + x).collect();
            if !row.is_empty() {
                data.push(0);
                data.extend(row);
            }
        }
    }
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    let header = [
        &5_u32.to_be_bytes()[..],
        &5_u32.to_be_bytes(),
        &[8, 0, 0, 0, 1],
    ]
    .concat();
    chunk(&mut bytes, *b"IHDR", &header);
    chunk(&mut bytes, *b"IDAT", &zlib(&data));
    chunk(&mut bytes, *b"IEND", &[]);
    let expected = (0..5).flat_map(|y| (0..5).map(move |x| 10 * y + x));
    assert_eq!(decode(&bytes).unwrap().grey(), widened(expected));
}

/// Appends a PNG chunk.
fn chunk(bytes: &mut Vec<u8>, name: [u8; 4], data: &[u8]) {
    bytes.extend((data.len() as u32).to_be_bytes());
    let start = bytes.len();
    bytes.extend(name);
    bytes.extend(data);
    let mut sum = u32::MAX;
    for &byte in &bytes[start..] {
        sum ^= u32::from(byte);
        for _ in 0..8 {
            sum = if sum & 1 == 1 {
                sum >> 1 ^ 0xedb8_8320
            } else {
                sum >> 1
            };
        }
    }
    bytes.extend((!sum).to_be_bytes());
}

/// A zlib stream without compression.
fn zlib(data: &[u8]) -> Vec<u8> {
    let length = data.len() as u16;
    let (mut a, mut b) = (1_u32, 0_u32);
    for &byte in data {
        a = (a + u32::from(byte)) % 65521;
        b = (b + a) % 65521;
    }
    let sum = b << 16 | a;
    [
        &[0x78, 0x01, 1][..],
        &length.to_le_bytes(),
        &(!length).to_le_bytes(),
        data,
        &sum.to_be_bytes(),
    ]
    .concat()
}

#[test]
fn every_kind_of_jpeg_is_read() {
    let raster = Raster::new([64, 48], 4, disc([25.0, 20.0], 15.0));
    let bytes = raster.bytes();
    let each = |f: fn(u8) -> Vec<u8>| bytes.iter().flat_map(|&v| f(v)).collect::<Vec<u8>>();
    for (name, colour, data, scale) in [
        ("grey", Jpeg::Luma, bytes.clone(), 1.0),
        ("colours", Jpeg::Rgb, each(|v| vec![v; 3]), 1.0),
        ("green", Jpeg::Rgb, each(|v| vec![0, v, 0]), 0.587),
        ("CMYK", Jpeg::Cmyk, each(|v| vec![0, 0, 0, 255 - v]), 1.0),
        (
            "YCCK",
            Jpeg::CmykAsYcck,
            each(|v| vec![0, 0, 0, 255 - v]),
            1.0,
        ),
    ] {
        for progressive in [false, true] {
            let image = decode(&jpeg(raster.size, colour, progressive, &data)).unwrap();
            assert_eq!([image.width(), image.height()], raster.size);
            let errors = image
                .grey()
                .iter()
                .zip(&raster.values)
                .map(|(&grey, v)| (f64::from(grey) / 65535.0 - scale * v).powi(2));
            let error = (errors.sum::<f64>() / raster.values.len() as f64).sqrt();
            println!("{name}, progressive {progressive}: {error:.4}");
            assert!(error < 0.03, "{name}, {progressive}: {error}");
        }
    }
}

#[test]
fn what_follows_an_image_does_not_matter() {
    let raster = Raster::new([64, 48], 4, disc([25.0, 20.0], 15.0));
    for progressive in [false, true] {
        let file = jpeg(raster.size, Jpeg::Luma, progressive, &raster.bytes());
        let expected = decode(&file).unwrap();
        // Cameras append a second picture, programs whatever they like.
        for tail in [&file[..], b"\0\0\0", b"\xff\xff", b"some text"] {
            let longer = [&file[..], tail].concat();
            assert_eq!(decode(&longer).as_ref(), Ok(&expected), "{progressive}");
        }
        // Without its end marker a file is not complete, or has all pixels nevertheless.
        for missing in 1..40 {
            if let Ok(image) = decode(&file[..file.len() - missing]) {
                assert_eq!(image, expected, "{progressive}: {missing} bytes less");
            }
        }
    }
}

/// Exif data that tells the orientation.
fn exif(value: u8, little: bool) -> Vec<u8> {
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

#[test]
fn photographs_are_set_upright() {
    // Stored rows, by the meaning of each value: where row 0 and column 0 are in the upright image.
    let upright: [[u8; 3]; 2] = [[1, 2, 3], [4, 5, 6]];
    let at = |x: usize, y: usize| upright[y][x];
    for value in 0..=9 {
        let turned = (5..=8).contains(&value);
        let [width, height] = if turned { [2, 3] } else { [3, 2] };
        let stored: Vec<u8> = (0..width * height)
            .map(|k| {
                let (column, row) = (k % width, k / width);
                match value {
                    2 => at(2 - column, row),
                    3 => at(2 - column, 1 - row),
                    4 => at(column, 1 - row),
                    5 => at(row, column),
                    6 => at(2 - row, column),
                    7 => at(2 - row, 1 - column),
                    8 => at(row, 1 - column),
                    _ => at(column, row),
                }
            })
            .collect();
        for little in [false, true] {
            let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
            let size = [width as u32, height as u32].map(u32::to_be_bytes).concat();
            chunk(
                &mut bytes,
                *b"IHDR",
                &[&size[..], &[8, 0, 0, 0, 0]].concat(),
            );
            chunk(&mut bytes, *b"eXIf", &exif(value, little));
            let rows: Vec<u8> = stored
                .chunks(width)
                .flat_map(|row| [&[0], row].concat())
                .collect();
            chunk(&mut bytes, *b"IDAT", &zlib(&rows));
            chunk(&mut bytes, *b"IEND", &[]);
            let image = decode(&bytes).unwrap();
            assert_eq!((image.width(), image.height()), (3, 2), "{value}");
            assert_eq!(image.grey(), widened(upright.concat()), "{value}");
        }
    }

    // The same tag in a JPEG file.
    let raster = Raster::new([32, 16], 1, |[x, _]| x < 8.0);
    let mut bytes = Vec::new();
    let mut encoder = jpeg_encoder::Encoder::new(&mut bytes, 95);
    encoder
        .add_app_segment(1, [&b"Exif\0\0"[..], &exif(6, true)].concat())
        .unwrap();
    encoder.encode(&raster.bytes(), 32, 16, Jpeg::Luma).unwrap();
    let image = decode(&bytes).unwrap();
    assert_eq!((image.width(), image.height()), (16, 32));
    // The left quarter of the stored rows is on top.
    let dark: Vec<bool> = image.grey().chunks(16).map(|row| row[7] < 0x8000).collect();
    assert_eq!(dark, (0..32).map(|y| y < 8).collect::<Vec<bool>>());
}

#[test]
fn files_that_are_no_images_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.png");
    let message = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        let text = read(&path).unwrap_err().to_string();
        let start = format!("{} cannot be read as an image: ", path.display());
        text.strip_prefix(&start).expect(&text).to_string()
    };
    assert_eq!(message(b""), "the file is empty");
    assert_eq!(
        message(b"GIF89a"),
        "it begins with the bytes [47, 49, 46, 38, 39, 61], which is neither PNG nor JPEG; save it \
         as one of these"
    );
    let good = png(
        SIZE,
        ColorType::Grayscale,
        BitDepth::Eight,
        &raster().bytes(),
    );
    for length in 4..good.len() - 12 {
        let text = message(&good[..length]);
        assert!(
            text.starts_with("damaged or truncated PNG: "),
            "{length}: {text}"
        );
        assert!(!text.contains('\n') && text.len() < 200, "{text}");
    }
    let mut huge = b"\x89PNG\r\n\x1a\n".to_vec();
    let header = [
        &8193_u32.to_be_bytes()[..],
        &8192_u32.to_be_bytes(),
        &[8, 0, 0, 0, 0],
    ]
    .concat();
    chunk(&mut huge, *b"IHDR", &header);
    chunk(&mut huge, *b"IDAT", &[]);
    assert_eq!(
        message(&huge),
        "it has 8193 x 8192 pixels, and may have 1 to 67108864; make it smaller"
    );

    for progressive in [false, true] {
        let good = jpeg(
            [64, 48],
            Jpeg::Luma,
            progressive,
            &Raster::new([64, 48], 4, disc([25.0, 20.0], 15.0)).bytes(),
        );
        assert!(decode(&good).is_ok());
        // Without its end marker, or without its last rows.
        for length in (3..good.len() - 40).step_by(7) {
            let text = message(&good[..length]);
            assert!(
                text.starts_with("damaged, truncated or unusual JPEG: "),
                "{length}: {text}"
            );
            assert!(text.ends_with("; try saving it as PNG"), "{text}");
        }
        let mut huge = good.clone();
        let marker = if progressive { 0xc2 } else { 0xc0 };
        let frame = huge.windows(2).position(|w| w == [0xff, marker]).unwrap();
        huge[frame + 5..frame + 9].fill(0xff);
        assert_eq!(
            message(&huge),
            "it has 65535 x 65535 pixels, and may have 1 to 67108864; make it smaller"
        );
    }

    let missing = folder.path().join("none.png");
    let error = read(&missing).unwrap_err();
    assert!(matches!(error, Error::Geometry(_)));
    assert_eq!(
        error.to_string(),
        format!("could not read {}", missing.display())
    );
    assert!(read(folder.path()).is_err());
    // The extension does not matter.
    fs::write(&path, jpeg([64, 48], Jpeg::Luma, false, &[9; 64 * 48])).unwrap();
    assert!(read(&path).is_ok());
    // One more byte than accepted, none of them stored.
    fs::File::options()
        .write(true)
        .open(&path)
        .unwrap()
        .set_len((1 << 29) + 1)
        .unwrap();
    assert_eq!(
        read(&path).unwrap_err().to_string(),
        format!(
            "{} cannot be read as an image: it has more than 536870912 bytes; make the image smaller",
            path.display()
        )
    );
}

/// Whatever was read has an outline or a reason; whatever was not has one line to say.
fn exercise(bytes: &[u8]) {
    match decode(bytes) {
        Ok(image) => {
            let count = image.width() as usize * image.height() as usize;
            assert_eq!(image.grey().len(), count);
            assert!(image.opacity().is_none_or(|o| o.len() == count));
            if count < 10_000 {
                let side = Side::of(&image, Inside::Auto, Threshold::Otsu).unwrap();
                if let Ok(outline) = Outline::of_image(&image, side) {
                    use geometry::SignedDistance;
                    let s = OutlineDistance::new(&outline).signed_distance([1.0, 1.0]);
                    assert!(s.is_finite());
                }
            }
        }
        Err(problem) => {
            let text = problem.to_string();
            assert!(!text.contains('\n') && text.len() < 300, "{text:?}");
        }
    }
}

/// Valid files of all kinds.
static VALID_FILES: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let mut files: Vec<Vec<u8>> = png_files().into_iter().map(|(_, file, _)| file).collect();
    let raster = raster();
    for progressive in [false, true] {
        let grey = raster.bytes();
        let colours: Vec<u8> = grey.iter().flat_map(|&v| [v, 255 - v, 80]).collect();
        let print: Vec<u8> = grey.iter().flat_map(|&v| [v, 0, 9, 80]).collect();
        files.push(jpeg(SIZE, Jpeg::Luma, progressive, &grey));
        files.push(jpeg(SIZE, Jpeg::Rgb, progressive, &colours));
        files.push(jpeg(SIZE, Jpeg::CmykAsYcck, progressive, &print));
    }
    let mut bytes = Vec::new();
    let mut encoder = jpeg_encoder::Encoder::new(&mut bytes, 80);
    encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::F_2_2);
    encoder.set_restart_interval(1);
    encoder
        .add_app_segment(1, [&b"Exif\0\0"[..], &exif(6, false)].concat())
        .unwrap();
    let colours: Vec<u8> = raster
        .bytes()
        .iter()
        .flat_map(|&v| [v, 255 - v, 80])
        .collect();
    encoder
        .encode(&colours, SIZE[0] as u16, SIZE[1] as u16, Jpeg::Rgb)
        .unwrap();
    files.push(bytes);
    files
});

/// A change of a file: place, kind and bytes.
type Change = (usize, u8, Vec<u8>);

fn changed(file: &[u8], changes: &[Change]) -> Vec<u8> {
    let mut bytes = file.to_vec();
    for (place, kind, with) in changes {
        let place = place % (bytes.len() + 1);
        let end = (place + with.len()).min(bytes.len());
        match kind {
            // Overwritten, inserted, removed, cut off, doubled.
            0..=3 => bytes[place..end].copy_from_slice(&with[..end - place]),
            4 => drop(bytes.splice(place..place, with.iter().copied())),
            5 => drop(bytes.drain(place..end)),
            6 => bytes.truncate(place),
            _ => bytes.extend_from_within(place..),
        }
        bytes.truncate(1 << 16);
    }
    bytes
}

/// PNG checks its chunks by sums that a change breaks: with them set right, more of the reader is
/// reached.
fn with_right_sums(bytes: &[u8]) -> Vec<u8> {
    let mut right = bytes.get(..8).unwrap_or(bytes).to_vec();
    let mut rest = bytes.get(8..).unwrap_or(&[]);
    while let Some((head, tail)) = rest.split_at_checked(8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some((data, tail)) = tail.split_at_checked(length) else {
            break;
        };
        chunk(&mut right, [head[4], head[5], head[6], head[7]], data);
        rest = tail.get(4..).unwrap_or(&[]);
    }
    right.extend(rest);
    right
}

/// Of random bytes and changed files; the environment variable FUZZ_CASES asks for more cases.
#[test]
fn no_bytes_upset_the_reader() {
    let cases = std::env::var("FUZZ_CASES")
        .ok()
        .map_or(256, |n| n.parse().unwrap());
    let config = ProptestConfig {
        cases,
        failure_persistence: None,
        // Few cases are always the same ones; many are others every time.
        rng_seed: if cases > 256 {
            RngSeed::Random
        } else {
            RngSeed::Fixed(5)
        },
        ..ProptestConfig::default()
    };
    let bytes = prop::collection::vec(any::<u8>(), 0..64);
    let kind = prop_oneof![any::<u8>(), Just(0_u8), Just(0xff), Just(0x80)];
    let few = prop::collection::vec(kind, 1..6);
    let changes = prop::collection::vec((any::<usize>(), 0_u8..8, few), 0..5);
    let input = (any::<usize>(), bytes, changes, any::<bool>());
    TestRunner::new(config)
        .run(&input, |(which, bytes, changes, right_sums)| {
            let files = &*VALID_FILES;
            let file = match which % (files.len() + 3) {
                0 => bytes,
                1 => [b"\x89PNG\r\n\x1a\n", &bytes[..]].concat(),
                2 => [&[0xff, 0xd8, 0xff], &bytes[..]].concat(),
                n => changed(&files[n - 3], &changes),
            };
            let png = file.starts_with(b"\x89PNG");
            exercise(&if png && right_sums {
                with_right_sums(&file)
            } else {
                file
            });
            Ok(())
        })
        .unwrap();
}

#[test]
fn errors_can_be_matched() {
    assert_eq!(decode(&[]), Err(FormatError::Empty));
    assert_eq!(
        decode(b"\x89PNX"),
        Err(FormatError::UnknownFormat {
            start: b"\x89PNX".to_vec()
        })
    );
}

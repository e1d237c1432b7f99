//! Image files of all kinds, and files that are none.

use std::fs;

use crate::common::files::{SIZE, exif, other_files, png_files, png_of_chunks, raster, widened};
use crate::common::{Raster, disc, jpeg, png};
use images::{Error, FormatError, decode, read};
use jpeg_encoder::ColorType as Jpeg;
use png::{BitDepth, ColorType};

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
fn other_formats_are_read_whole_or_not_at_all() {
    for (name, file, expected) in other_files() {
        assert_eq!(decode(&file).unwrap(), expected, "{name}");
        for length in 10..file.len() {
            match decode(&file[..length]) {
                Ok(image) => assert_eq!(image, expected, "{name}: {length} of {}", file.len()),
                Err(error) => {
                    let text = error.to_string();
                    assert!(text.contains(name) && !text.contains('\n'), "{text}");
                }
            }
        }
    }
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
    let bytes = png_of_chunks([5; 2], 1, &[], &data);
    let expected = (0..5).flat_map(|y| (0..5).map(move |x| 10 * y + x));
    assert_eq!(decode(&bytes).unwrap().grey(), widened(expected));
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
            assert_eq!(image.size(), raster.size);
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
            let (size, exif) = ([width as u32, height as u32], exif(value, little));
            let rows: Vec<u8> = stored
                .chunks(width)
                .flat_map(|row| [&[0], row].concat())
                .collect();
            let bytes = png_of_chunks(size, 0, &[(*b"eXIf", &exif[..])], &rows);
            let image = decode(&bytes).unwrap();
            assert_eq!(image.size(), [3, 2], "{value}");
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
    assert_eq!(image.size(), [16, 32]);
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
        message(b"GI a"),
        "it begins with the bytes [47, 49, 20, 61], which is none of PNG, JPEG, WebP, GIF, TIFF and \
         BMP; save it as one of these"
    );
    let good = png(
        SIZE,
        ColorType::Grayscale,
        BitDepth::Eight,
        &raster().bytes(),
    );
    for length in 8..good.len() - 12 {
        let text = message(&good[..length]);
        assert!(
            text.starts_with("damaged, truncated or unusual PNG: "),
            "{length}: {text}"
        );
        assert!(!text.contains('\n') && text.len() < 200, "{text}");
    }
    assert_eq!(
        message(&png_of_chunks([8193, 8192], 0, &[], &[])),
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
    assert!(matches!(error, Error::Io(_)));
    let start = format!("could not read {}: ", missing.display());
    assert!(error.to_string().starts_with(&start), "{error}");
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

/// A TIFF file of colours and opacities as floats, with its pixels in one strip; those of a large one need not be there.
fn deep_tiff([width, height]: [u32; 2], pixels: &[f32]) -> Vec<u8> {
    let entries: [[u32; 4]; 10] = [
        [256, 4, 1, width],
        [257, 4, 1, height],
        [258, 3, 4, 134],
        [259, 3, 1, 1],
        [262, 3, 1, 2],
        [273, 4, 1, 150],
        [277, 3, 1, 4],
        [278, 4, 1, height],
        [279, 4, 1, 16 * width * height],
        [339, 3, 4, 142],
    ];
    let mut file = b"II*\0\x08\0\0\0\x0a\0".to_vec();
    for [tag, kind, count, value] in entries {
        file.extend(
            [tag as u16, kind as u16]
                .iter()
                .flat_map(|n| n.to_le_bytes()),
        );
        file.extend([count, value].iter().flat_map(|n| n.to_le_bytes()));
    }
    file.extend([0; 4]);
    file.extend(
        [32_u16, 32, 32, 32, 3, 3, 3, 3]
            .iter()
            .flat_map(|n| n.to_le_bytes()),
    );
    file.extend(pixels.iter().flat_map(|v| v.to_le_bytes()));
    file
}

/// They would need 32 bytes a pixel while they are decoded.
#[test]
fn deep_images_are_refused_before_they_take_memory() {
    let pixels = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0].repeat(6);
    let image = decode(&deep_tiff([4, 3], &pixels)).unwrap();
    assert_eq!(image.size(), [4, 3]);
    assert_eq!(image.grey()[..4], [0, 65535, 0, 65535]);
    let (result, peak) = fuzzing::peak_of(|| decode(&deep_tiff([8128, 8128], &[])));
    let Err(error @ FormatError::Deep { .. }) = result else {
        panic!("{result:?}");
    };
    assert!(
        error.to_string().contains("save it with 8 or 16 bits"),
        "{error}"
    );
    fuzzing::assert_short_line(&error);
    assert!(peak < 1 << 20, "{peak}");
    // Three quarters of the most pixels are not too many.
    let error = decode(&deep_tiff([8192, 6144], &[])).unwrap_err();
    assert!(matches!(error, FormatError::Damaged { .. }), "{error}");
}

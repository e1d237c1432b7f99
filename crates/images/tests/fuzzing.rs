//! Damaged and malicious images.

use crate::common::files::{SIZE, chunk, exif, other_files, png_files, raster};
use crate::common::jpeg;
use fuzzing::{Fuzz, Limit};
use geometry::SignedDistance;
use images::{Image, LARGEST_IMAGE, Outline, Side, Tones, decode};
use jpeg_encoder::ColorType as Jpeg;

/// As documented at [`images::read`].
const LIMIT: Limit = Limit {
    times: 4,
    plus: 24 * LARGEST_IMAGE + (32 << 20),
};

/// Whatever was read has an outline or a reason.
#[allow(clippy::needless_pass_by_value, reason = "as the harness calls it")]
fn check(_: &[u8], image: Image) {
    let count = image
        .size()
        .iter()
        .map(|&side| side as usize)
        .product::<usize>();
    assert_eq!(image.grey().len(), count);
    assert!(image.opacity().is_none_or(|o| o.len() == count));
    if count < 10_000 {
        let side = Side::of(&image, 0.5).unwrap();
        let side = side.at(Tones::of(&image, side).threshold);
        if let Ok(outline) = Outline::of_image(&image, side) {
            let s = outline.distance().signed_distance([1.0, 1.0]);
            assert!(s.is_finite());
        }
    }
}

/// Valid files of all kinds.
fn valid_files() -> Vec<Vec<u8>> {
    let files = png_files().into_iter().chain(other_files());
    let mut files: Vec<Vec<u8>> = files.map(|(_, file, _)| file).collect();
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

#[test]
fn fuzzing_images() {
    Fuzz::new("images", LIMIT)
        .valid(valid_files())
        .starts([
            &b"\x89PNG\r\n\x1a\n"[..],
            &[0xff, 0xd8, 0xff],
            b"BM",
            b"GIF89a",
            b"RIFF\x40\0\0\0WEBPVP8 ",
        ])
        .words([
            &b"IHDR"[..],
            b"IDAT",
            b"IEND",
            b"PLTE",
            b"tRNS",
            b"eXIf",
            b"acTL",
            b"fcTL",
            b"fdAT",
            b"iCCP",
            b"zTXt",
            b"II*\0\x08\0\0\0",
            b"MM\0*\0\0\0\x08",
            b"\xff\xc0",
            b"\xff\xc2",
            b"\xff\xc4",
            b"\xff\xda",
            b"\xff\xdb",
            b"\xff\xdd",
            b"\xff\xe1",
            b"\xff\xd9",
            b"\xff\xd0",
            b"\0\0\0\0",
        ])
        .repair(|bytes| {
            if bytes.starts_with(b"\x89PNG") {
                with_right_sums(&bytes)
            } else {
                bytes
            }
        })
        .run(decode, check);
}

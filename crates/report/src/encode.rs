//! PNG files that are small.

use std::collections::BTreeMap;

use png::{BitDepth, ColorType, Compression, Encoder, EncodingError, Filter};
use srgb::Rgb;

/// Pixels in rows of `width`, as a PNG file: with a [palette] if there is one and the file becomes smaller by it.
pub(crate) fn png(width: usize, pixels: &[Rgb]) -> Vec<u8> {
    const FITS: &str = "there are pixels, and they fill the picture";
    let size = [width, pixels.len() / width].map(|side| side as u32);
    let bytes =
        |pixels: &[Rgb]| -> Vec<u8> { pixels.iter().flat_map(|&Rgb(r, g, b)| [r, g, b]).collect() };
    let plain = written(size, None, &bytes(pixels)).expect(FITS);
    let Some((palette, indices)) = palette(pixels) else {
        return plain;
    };
    let indexed = written(size, Some(bytes(&palette)), &indices).expect(FITS);
    let both = [plain, indexed].into_iter();
    both.min_by_key(Vec::len).expect("there are two")
}

fn written(
    [width, height]: [u32; 2],
    palette: Option<Vec<u8>>,
    data: &[u8],
) -> Result<Vec<u8>, EncodingError> {
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, width, height);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::High);
    encoder.set_color(ColorType::Rgb);
    if let Some(palette) = palette {
        encoder.set_color(ColorType::Indexed);
        encoder.set_palette(palette);
        // Differences of indices mean nothing.
        encoder.set_filter(Filter::NoFilter);
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(data)?;
    writer.finish()?;
    Ok(file)
}

/// Pixels of one colour, the square of its distance to the palette, and the nearest entry.
struct Shade {
    colour: Rgb,
    count: u64,
    error: u64,
    index: u8,
}

/// A palette and the index of every pixel in it. It has all colours if they are no more than 256. Of more colours, the next entry is
/// always the one that takes away the largest sum of squared errors from its own pixels. `None` if the squares of the errors, summed over
/// the channels, are on average over the pixels larger than 1/2: rounding to 8 bits leaves 1/4 anyway.
fn palette(pixels: &[Rgb]) -> Option<(Vec<Rgb>, Vec<u8>)> {
    let mut counts = BTreeMap::<Rgb, u64>::new();
    for &pixel in pixels {
        *counts.entry(pixel).or_default() += 1;
    }
    let far = 3 * 256 * 256;
    let shade = |(&colour, &count)| Shade {
        colour,
        count,
        error: far,
        index: 0,
    };
    let mut shades: Vec<Shade> = counts.iter().map(shade).collect();
    let mut palette = Vec::new();
    for index in 0..=u8::MAX {
        let worst = shades.iter().max_by_key(|shade| shade.count * shade.error);
        let Some(entry) = worst.filter(|worst| worst.error > 0) else {
            break;
        };
        let entry = entry.colour;
        palette.push(entry);
        for shade in &mut shades {
            let error = squared_distance(shade.colour, entry);
            if error < shade.error {
                (shade.error, shade.index) = (error, index);
            }
        }
    }
    let error: u64 = shades.iter().map(|shade| shade.count * shade.error).sum();
    if 2 * error > pixels.len() as u64 {
        return None;
    }
    let nearest: BTreeMap<Rgb, u8> = shades.iter().map(|s| (s.colour, s.index)).collect();
    Some((palette, pixels.iter().map(|pixel| nearest[pixel]).collect()))
}

fn squared_distance(a: Rgb, b: Rgb) -> u64 {
    let squared = |a: u8, b: u8| u64::from(a.abs_diff(b)).pow(2);
    squared(a.0, b.0) + squared(a.1, b.1) + squared(a.2, b.2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pixels of a file.
    fn decoded(file: &[u8]) -> Vec<Rgb> {
        let picture = image::load_from_memory(file).unwrap().into_rgb8();
        let pixels = picture.pixels();
        pixels.map(|p| Rgb(p.0[0], p.0[1], p.0[2])).collect()
    }

    /// A picture whose `k`-th pixel has the colour of this number.
    fn picture(pixels: u32, number: impl Fn(u32) -> u32) -> Vec<Rgb> {
        let colour = |k: u32| Rgb((k % 61) as u8, (7 * k % 256) as u8, (k / 2 % 256) as u8);
        (0..pixels).map(|k| colour(number(k))).collect()
    }

    fn noise(k: u32) -> u32 {
        k.wrapping_mul(k).wrapping_mul(0x9e37_79b9)
    }

    fn kind(file: &[u8]) -> ColorType {
        let decoder = png::Decoder::new(std::io::Cursor::new(file));
        decoder.read_info().unwrap().info().color_type
    }

    #[test]
    fn few_colours_are_exact_with_a_palette() {
        let pixels = picture(1 << 14, |k| noise(k) >> 24);
        let file = png(16, &pixels);
        assert_eq!(kind(&file), ColorType::Indexed);
        assert!(decoded(&file) == pixels);
    }

    #[test]
    fn rare_colours_are_those_that_give_way() {
        let pixels = picture(
            1 << 18,
            |k| if k % 512 < 2 { k % 401 } else { noise(k) % 200 },
        );
        let file = png(16, &pixels);
        assert_eq!(kind(&file), ColorType::Indexed);
        let pairs = pixels.iter().zip(decoded(&file));
        let sum: u64 = pairs.map(|(&a, b)| squared_distance(a, b)).sum();
        assert!(sum > 0 && 2 * sum < pixels.len() as u64, "{sum}");
    }

    #[test]
    fn many_colours_stay_as_they_are() {
        let pixels = picture(1 << 14, |k| noise(k) >> 20);
        let file = png(16, &pixels);
        assert_eq!(kind(&file), ColorType::Rgb);
        assert!(decoded(&file) == pixels);
    }
}

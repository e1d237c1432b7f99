//! Pictures inside a page.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, html};

use crate::error::{Error, Result};

/// An intact PNG or SVG picture, which becomes a part of the page.
#[derive(Clone, Debug)]
pub struct ImageElement {
    mime: &'static str,
    data: String,
    size: Option<[u32; 2]>,
}

impl ImageElement {
    /// A picture from the bytes of a PNG or SVG file; `name` is for messages.
    pub fn from_bytes(name: &str, bytes: &[u8]) -> Result<Self> {
        let (mime, size) = if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
            ("image/png", png(bytes).map(Some))
        } else {
            ("image/svg+xml", svg(bytes))
        };
        let size = size.map_err(|problem| Error::Picture {
            name: name.to_owned(),
            problem,
        })?;
        let data = STANDARD.encode(bytes);
        Ok(Self { mime, data, size })
    }

    /// A smaller picture, at most so many pixels wide, of the PNG file with these bytes; where that is taller than wide, of its upper part, three
    /// by two.
    pub(crate) fn reduced(name: &str, bytes: &[u8], most: usize) -> Result<Self> {
        let (mut size, pixels) = pixels(bytes).map_err(|problem| Error::Picture {
            name: name.to_owned(),
            problem,
        })?;
        if size[1] > size[0] {
            size[1] = (2 * size[0]).div_ceil(3);
        }
        let factor = size[0].div_ceil(most);
        let smaller = size.map(|side| side.div_ceil(factor));
        // Each is the mean of a square, at the lower and right ends of a part of it.
        let mean = |k: usize| {
            let squares = [k % smaller[0], k / smaller[0]];
            let [columns, rows] =
                [0, 1].map(|i| factor * squares[i]..(factor * (squares[i] + 1)).min(size[i]));
            let count = columns.len() * rows.len();
            let mut sum = [0; 4];
            for pixel in rows.flat_map(|row| &pixels[size[0] * row..][columns.clone()]) {
                sum = std::array::from_fn(|c| sum[c] + usize::from(pixel[c]));
            }
            sum.map(|sum| ((sum + count / 2) / count) as u8)
        };
        let pixels = (0..smaller[0] * smaller[1]).map(mean).collect();
        let picture = render::Picture::new(smaller.map(|side| side as u32), pixels)?;
        Self::from_bytes(name, &picture.to_png()?)
    }

    /// The element; `alternative` is for readers who cannot see the picture.
    pub(crate) fn html(&self, alternative: &str) -> Markup {
        // With the size known beforehand, nothing jumps while a page is loaded.
        let [width, height] = [0, 1].map(|side| self.size.map(|size| size[side]));
        html! {
            img src={ "data:" (self.mime) ";base64," (self.data) } alt=(alternative) width=[width] height=[height];
        }
    }
}

/// The size of a PNG picture. All of it is read, so that damage is found here and not by those who look at the page.
fn png(bytes: &[u8]) -> Result<[u32; 2], String> {
    let (size, ..) = decoded(bytes, png::Transformations::IDENTITY)?;
    Ok(size)
}

/// The size of a PNG picture, how many channels a pixel has, and all of them.
fn decoded(
    bytes: &[u8],
    as_what: png::Transformations,
) -> Result<([u32; 2], usize, Vec<u8>), String> {
    let line = |error: png::DecodingError| error.to_string();
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(as_what);
    let mut reader = decoder.read_info().map_err(line)?;
    let info = reader.info();
    let size = [info.width, info.height];
    let length = reader
        .output_buffer_size()
        .ok_or("it is too large for this machine")?;
    let mut pixels = vec![0; length];
    reader.next_frame(&mut pixels).map_err(line)?;
    reader.finish().map_err(line)?;
    Ok((size, reader.output_color_type().0.samples(), pixels))
}

/// The pixels of a PNG picture with opacity, and its size.
fn pixels(bytes: &[u8]) -> Result<([usize; 2], Vec<[u8; 4]>), String> {
    let as_what = png::Transformations::normalize_to_color8() | png::Transformations::ALPHA;
    let (size, channels, values) = decoded(bytes, as_what)?;
    let pixels = match channels {
        // Grey.
        2 => (values.as_chunks().0.iter())
            .map(|&[tone, opacity]| [tone, tone, tone, opacity])
            .collect(),
        _ => values.as_chunks().0.to_vec(),
    };
    Ok((size.map(|side| side as usize), pixels))
}

/// The size of an SVG picture, if it has one.
fn svg(bytes: &[u8]) -> Result<Option<[u32; 2]>, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is neither PNG nor text".to_owned())?;
    let document = roxmltree::Document::parse(text).map_err(|error| error.to_string())?;
    let root = document.root_element();
    let name = root.tag_name();
    if (name.name(), name.namespace()) != ("svg", Some("http://www.w3.org/2000/svg")) {
        return Err(format!("its first element is <{}>", name.name()));
    }
    let side = |attribute: &str| {
        let value: f64 = root.attribute(attribute)?.parse().ok()?;
        (value >= 1.0 && value <= f64::from(u32::MAX)).then_some(value.round() as u32)
    };
    Ok(side("width").zip(side("height")).map(|(w, h)| [w, h]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(shade: u8) -> render::Picture {
        render::Picture::new([3, 2], vec![[shade, 0, 0, 255]; 6]).unwrap()
    }

    #[test]
    fn pictures_are_recognised_with_their_size() {
        let still = ImageElement::from_bytes("still", &picture(7).to_png().unwrap()).unwrap();
        assert_eq!(still.size, Some([3, 2]));
        let html = still.html("red \"squares\"").0;
        assert!(html.starts_with("<img src=\"data:image/png;base64,iVBOR"));
        assert!(html.ends_with("alt=\"red &quot;squares&quot;\" width=\"3\" height=\"2\">"));

        let svg = br#"<svg xmlns="http://www.w3.org/2000/svg" width="80" height="40.4"/>"#;
        let svg = ImageElement::from_bytes("drawing", svg).unwrap();
        assert_eq!(svg.size, Some([80, 40]));
        assert_eq!(svg.mime, "image/svg+xml");
    }

    #[test]
    fn smaller_pictures_are_means() {
        let pixels_of_rows = [0, 4, 9, 0, 4, 9].map(|tone| [tone, 0, 0, 255]);
        let picture = render::Picture::new([3, 2], pixels_of_rows.to_vec()).unwrap();
        let bytes = picture.to_png().unwrap();
        for (most, tones) in [(3, &[0, 4, 9, 0, 4, 9][..]), (2, &[2, 9]), (1, &[4])] {
            let reduced = ImageElement::reduced("rows", &bytes, most).unwrap();
            let (_, back) = pixels(&STANDARD.decode(reduced.data).unwrap()).unwrap();
            let found: Vec<u8> = back.iter().map(|pixel| pixel[0]).collect();
            assert_eq!(found, tones);
        }
        let tall = [&pixels_of_rows[..], &[[7, 0, 0, 255]; 21]].concat();
        let tall = render::Picture::new([3, 9], tall).unwrap();
        let reduced = ImageElement::reduced("tall", &tall.to_png().unwrap(), 3).unwrap();
        assert_eq!(reduced.size, Some([3, 2]));
    }

    #[test]
    fn damaged_pictures_are_named() {
        let whole = picture(9).to_png().unwrap();
        let mut flipped = whole.clone();
        // In the compressed pixels, the fifth byte from the end of their chunk.
        let place = flipped.len() - 12 - 9;
        flipped[place] ^= 0x55;
        let cases: [(&str, &[u8]); 6] = [
            ("empty.png", b""),
            ("half.png", &whole[..whole.len() / 2]),
            ("flipped.png", &flipped),
            ("page.svg", b"<html></html>"),
            ("cut.svg", b"<svg xmlns=\"http://www.w3.org/2000/svg\"><g>"),
            ("photo.png", b"\xff\xd8\xff\xe0"),
        ];
        for (name, bytes) in cases {
            let error = ImageElement::from_bytes(name, bytes).unwrap_err();
            let message = error.to_string();
            assert!(matches!(error, Error::Picture { .. }));
            assert!(
                message.contains(name) && !message.contains('\n'),
                "{message}"
            );
        }
    }
}

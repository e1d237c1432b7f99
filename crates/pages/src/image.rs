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
    let line = |error: png::DecodingError| error.to_string();
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
        .read_info()
        .map_err(line)?;
    let info = reader.info();
    let size = [info.width, info.height];
    let length = reader
        .output_buffer_size()
        .ok_or("it is too large for this machine")?;
    let mut pixels = vec![0; length];
    reader.next_frame(&mut pixels).map_err(line)?;
    reader.finish().map_err(line)?;
    Ok(size)
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

//! Pictures, inside the page or beside it.

use std::fs;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::error::{Error, Result};
use crate::escape::{escaped, relative_address};

/// Where the pictures of a page are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Pictures {
    /// In the page itself, as data URIs: one file that can be moved and mailed. The default, as a
    /// page should not break when it is moved.
    #[default]
    Embedded,
    /// In their own files beside the page, by relative links: for pages that are kept together with
    /// large folders, above all under version control, where every picture would be stored twice
    /// and all of them again at every change of one.
    Linked,
}

/// An intact PNG (also animated) or SVG picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    address: String,
    size: Option<[u32; 2]>,
    animated: bool,
}

/// What is found inside a picture.
struct Content {
    mime: &'static str,
    size: Option<[u32; 2]>,
    animated: bool,
}

impl Image {
    /// A picture from the bytes of a PNG or SVG file; `name` is for messages. It is embedded.
    ///
    /// # Errors
    /// [`Error::Picture`] if it is damaged or something else.
    pub fn from_bytes(name: &str, bytes: &[u8]) -> Result<Self> {
        let content = inspected(name, bytes)?;
        Ok(Self {
            address: format!("data:{};base64,{}", content.mime, STANDARD.encode(bytes)),
            size: content.size,
            animated: content.animated,
        })
    }

    /// A picture from a file, embedded.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::Picture`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        Self::from_bytes(&path.display().to_string(), &read(path)?)
    }

    /// The picture in the file `folder/path`, where the page will lie in `folder`: embedded, or
    /// linked by the relative `path`, with `/` between its components.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::Picture`], [`Error::Link`].
    pub fn beside(folder: impl AsRef<Path>, path: &str, pictures: Pictures) -> Result<Self> {
        let address = relative_address(path)?;
        let file = folder.as_ref().join(path);
        let bytes = read(&file)?;
        match pictures {
            Pictures::Embedded => Self::from_bytes(path, &bytes),
            Pictures::Linked => {
                let content = inspected(path, &bytes)?;
                Ok(Self {
                    address,
                    size: content.size,
                    animated: content.animated,
                })
            }
        }
    }

    /// A rendered picture, embedded as PNG.
    ///
    /// # Errors
    /// [`Error::Render`] if it cannot be encoded.
    pub fn from_picture(picture: &render::Picture) -> Result<Self> {
        Self::from_bytes("the rendered picture", &picture.to_png()?)
    }

    /// Whether it moves.
    pub fn is_animated(&self) -> bool {
        self.animated
    }

    /// Whether the page needs its file.
    pub(crate) fn is_linked(&self) -> bool {
        !self.address.starts_with("data:")
    }

    /// The element; `alternative` is for readers who cannot see the picture.
    pub(crate) fn html(&self, alternative: &str) -> String {
        // With the size known beforehand, nothing jumps while a page is loaded.
        let size = self
            .size
            .map(|[width, height]| format!(" width=\"{width}\" height=\"{height}\""))
            .unwrap_or_default();
        let loading = if self.is_linked() {
            " loading=\"lazy\" decoding=\"async\""
        } else {
            ""
        };
        let alternative = escaped(alternative);
        format!(
            "<img src=\"{}\" alt=\"{alternative}\"{size}{loading}>",
            self.address
        )
    }
}

fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).map_err(|source| Error::Read {
        path: path.into(),
        source,
    })
}

/// Reads the whole picture, so that damage is found here and not by those who look at the page.
fn inspected(name: &str, bytes: &[u8]) -> Result<Content> {
    let content = if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        png(bytes)
    } else {
        svg(bytes)
    };
    content.map_err(|problem| Error::Picture {
        name: name.to_owned(),
        problem,
    })
}

fn png(bytes: &[u8]) -> Result<Content, String> {
    let line = |error: png::DecodingError| error.to_string();
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
        .read_info()
        .map_err(line)?;
    let info = reader.info();
    let (size, frames) = (
        [info.width, info.height],
        info.animation_control().map(|a| a.num_frames),
    );
    let length = reader
        .output_buffer_size()
        .ok_or("it is too large for this machine")?;
    let mut pixels = vec![0; length];
    for _ in 0..frames.unwrap_or(1) {
        reader.next_frame(&mut pixels).map_err(line)?;
    }
    reader.finish().map_err(line)?;
    Ok(Content {
        mime: "image/png",
        size: Some(size),
        animated: frames.is_some_and(|n| n > 1),
    })
}

fn svg(bytes: &[u8]) -> Result<Content, String> {
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
    Ok(Content {
        mime: "image/svg+xml",
        size: side("width").zip(side("height")).map(|(w, h)| [w, h]),
        animated: false,
    })
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn picture(shade: u8) -> render::Picture {
        render::Picture::new(3, 2, vec![[shade, 0, 0, 255]; 6]).unwrap()
    }

    #[test]
    fn pictures_are_recognised_with_their_size() {
        let still = Image::from_picture(&picture(7)).unwrap();
        assert_eq!((still.size, still.animated), (Some([3, 2]), false));
        let html = still.html("red \"squares\"");
        assert!(html.starts_with("<img src=\"data:image/png;base64,iVBOR"));
        assert!(html.ends_with("alt=\"red &quot;squares&quot;\" width=\"3\" height=\"2\">"));

        let frames = vec![picture(1), picture(2)];
        let moving = render::Animation::new(frames, Duration::from_millis(50)).unwrap();
        let moving = Image::from_bytes("moving", &moving.to_apng().unwrap()).unwrap();
        assert!(moving.is_animated());

        let svg = br#"<svg xmlns="http://www.w3.org/2000/svg" width="80" height="40.4"/>"#;
        let svg = Image::from_bytes("drawing", svg).unwrap();
        assert_eq!(svg.size, Some([80, 40]));
        assert!(svg.address.starts_with("data:image/svg+xml;base64,"));
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
            let error = Image::from_bytes(name, bytes).unwrap_err();
            let message = error.to_string();
            assert!(matches!(error, Error::Picture { .. }));
            assert!(
                message.contains(name) && !message.contains('\n'),
                "{message}"
            );
        }
    }

    #[test]
    fn linked_pictures_must_exist_and_stay_outside() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("a run")).unwrap();
        let bytes = picture(3).to_png().unwrap();
        fs::write(folder.path().join("a run/x.png"), &bytes).unwrap();
        let linked = Image::beside(folder.path(), "a run/x.png", Pictures::Linked).unwrap();
        assert!(linked.html("x").contains("src=\"a%20run/x.png\""));
        let embedded = Image::beside(folder.path(), "a run/x.png", Pictures::Embedded).unwrap();
        assert_eq!(embedded, Image::from_bytes("x", &bytes).unwrap());
        for pictures in [Pictures::Linked, Pictures::Embedded] {
            let error = Image::beside(folder.path(), "a run/y.png", pictures).unwrap_err();
            assert!(error.to_string().contains("y.png"), "{error}");
            let error = Image::beside(folder.path(), "/x.png", pictures).unwrap_err();
            assert!(matches!(error, Error::Link { .. }));
        }
    }
}

//! Sequences of pictures.

use std::fmt::Write;

use crate::error::{Error, Result};
use crate::escape::escaped;
use crate::image::Image;

/// Pictures of which one is shown at a time, chosen by a slider or played. Without JavaScript they
/// are a strip that scrolls.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    caption: String,
    frames: Vec<(String, Image)>,
}

impl Frames {
    /// A sequence of pictures with a label each, such as the step of a flow.
    ///
    /// # Errors
    /// [`Error::Empty`] without pictures.
    pub fn new(caption: impl Into<String>, frames: Vec<(String, Image)>) -> Result<Self> {
        let caption = caption.into();
        if frames.is_empty() {
            return Err(Error::Empty {
                what: "the sequence of pictures",
                title: caption,
                item: "picture",
            });
        }
        Ok(Self { caption, frames })
    }

    pub(crate) fn is_linked(&self) -> bool {
        self.frames.iter().any(|(_, image)| image.is_linked())
    }

    pub(crate) fn html(&self) -> String {
        let caption = escaped(&self.caption);
        let mut html = format!(
            "<figure class=\"frames\">\n\
             <div class=\"strip\" tabindex=\"0\" role=\"region\" aria-label=\"{caption}\">\n"
        );
        for (label, image) in &self.frames {
            let image = image.html(&format!("{}, {label}", self.caption));
            let label = escaped(label);
            let _ = writeln!(
                html,
                "<div class=\"frame\" data-label=\"{label}\">{image}<span>{label}</span></div>"
            );
        }
        let _ = writeln!(
            html,
            "</div>\n<figcaption>{caption}</figcaption>\n</figure>"
        );
        html
    }
}

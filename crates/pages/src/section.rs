//! Sections of a page and what is in them.

use std::fmt::Write;

use crate::escape::escaped;
use crate::facts::Facts;
use crate::frames::Frames;
use crate::image::Image;
use crate::table::Table;
use crate::text::Text;
use crate::viewer::Viewer;

/// A picture with a caption.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    image: Image,
    caption: Text,
    alternative: String,
}

impl Figure {
    /// A picture with a caption, which also is what readers are told who cannot see the picture.
    pub fn new(image: Image, caption: &str) -> Self {
        Self {
            image,
            caption: caption.into(),
            alternative: caption.to_owned(),
        }
    }

    /// Adds text to the caption alone.
    #[must_use]
    pub fn with_note(mut self, note: &Text) -> Self {
        self.caption = self.caption.appended(note);
        self
    }

    /// Says more to those who cannot see the picture.
    #[must_use]
    pub fn with_alternative(mut self, text: impl Into<String>) -> Self {
        self.alternative = text.into();
        self
    }

    fn html(&self) -> String {
        let (image, caption) = (self.image.html(&self.alternative), self.caption.html());
        let figure = format!("<figure>{image}\n<figcaption>{caption}</figcaption></figure>\n");
        if self.image.is_animated() {
            // What moves can be put away.
            format!("<details open><summary>Animation</summary>\n{figure}</details>\n")
        } else {
            figure
        }
    }
}

/// Blocks behind a line that opens them.
#[derive(Clone, Debug, PartialEq)]
pub struct Details {
    summary: String,
    blocks: Vec<Block>,
}

impl Details {
    /// Nothing yet behind the given line.
    pub fn new(summary: impl Into<String>) -> Self {
        Self {
            summary: summary.into(),
            blocks: Vec::new(),
        }
    }

    /// Adds a block.
    #[must_use]
    pub fn with(mut self, block: impl Into<Block>) -> Self {
        self.blocks.push(block.into());
        self
    }
}

/// One thing in a section.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Block {
    /// Running text.
    Paragraph(Text),
    /// Short texts, one below the other.
    List(Vec<Text>),
    /// A picture.
    Figure(Figure),
    /// A table.
    Table(Table),
    /// Names with values.
    Facts(Facts),
    /// A sequence of pictures.
    Frames(Frames),
    /// Surfaces to turn.
    Viewer(Viewer),
    /// What is folded away.
    Details(Details),
}

macro_rules! block_from {
    ($($kind:ident($content:ty)),*) => {
        $(impl From<$content> for Block {
            fn from(content: $content) -> Self {
                Self::$kind(content)
            }
        })*
    };
}

block_from!(
    Paragraph(Text),
    List(Vec<Text>),
    Figure(Figure),
    Table(Table),
    Facts(Facts),
    Frames(Frames),
    Viewer(Viewer),
    Details(Details)
);

impl From<&str> for Block {
    fn from(text: &str) -> Self {
        Self::Paragraph(text.into())
    }
}

/// What a page must carry or allow for its blocks.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Needs {
    pub linked_pictures: bool,
    pub frames: bool,
    pub viewer: bool,
}

impl Block {
    fn add_needs(&self, needs: &mut Needs) {
        match self {
            Self::Figure(figure) => needs.linked_pictures |= figure.image.is_linked(),
            Self::Frames(frames) => {
                needs.frames = true;
                needs.linked_pictures |= frames.is_linked();
            }
            Self::Viewer(viewer) => {
                needs.viewer = true;
                needs.linked_pictures |= viewer.is_linked();
            }
            Self::Details(details) => details.blocks.iter().for_each(|b| b.add_needs(needs)),
            Self::Paragraph(_) | Self::List(_) | Self::Table(_) | Self::Facts(_) => {}
        }
    }

    fn html(&self) -> String {
        match self {
            Self::Paragraph(text) => format!("<p>{}</p>\n", text.html()),
            Self::List(items) => {
                let mut html = "<ul>\n".to_owned();
                for item in items {
                    let _ = writeln!(html, "<li>{}</li>", item.html());
                }
                html.push_str("</ul>\n");
                html
            }
            Self::Figure(figure) => figure.html(),
            Self::Table(table) => table.html(),
            Self::Facts(facts) => facts.html(),
            Self::Frames(frames) => frames.html(),
            Self::Viewer(viewer) => viewer.html(),
            Self::Details(details) => {
                let blocks: String = details.blocks.iter().map(Self::html).collect();
                let summary = escaped(&details.summary);
                format!("<details><summary>{summary}</summary>\n{blocks}</details>\n")
            }
        }
    }
}

/// A part of a page under a heading of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    pub(crate) title: String,
    pub(crate) name: String,
    blocks: Vec<Block>,
}

impl Section {
    /// An empty section.
    pub fn new(title: impl Into<String>) -> Self {
        let title = title.into();
        Self {
            name: title.clone(),
            title,
            blocks: Vec::new(),
        }
    }

    /// Gives the section a name of its own for links to it, `page.html#name`; without, it is the
    /// title in small letters.
    #[must_use]
    pub fn named(mut self, name: impl Into<String>) -> Self {
        self.name = name.into();
        self
    }

    /// The same section under another heading.
    pub(crate) fn retitled(mut self, title: &str) -> Self {
        title.clone_into(&mut self.title);
        self
    }

    /// Adds a block.
    #[must_use]
    pub fn with(mut self, block: impl Into<Block>) -> Self {
        self.push(block);
        self
    }

    /// Adds a block.
    pub fn push(&mut self, block: impl Into<Block>) {
        self.blocks.push(block.into());
    }

    pub(crate) fn add_needs(&self, needs: &mut Needs) {
        self.blocks.iter().for_each(|b| b.add_needs(needs));
    }

    pub(crate) fn write(&self, html: &mut String, id: &str) {
        let title = escaped(&self.title);
        let _ = write!(
            html,
            "<section aria-labelledby=\"{id}\">\n<h2 id=\"{id}\">{title}</h2>\n"
        );
        for block in &self.blocks {
            html.push_str(&block.html());
        }
        html.push_str("</section>\n");
    }
}

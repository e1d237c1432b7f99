//! Pages: one HTML file with everything in it.

use std::collections::HashSet;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use files::{Sha256, write_atomically};
use maud::{DOCTYPE, Markup, PreEscaped, Render, html};

use crate::error::Result;
use crate::image::ImageElement;
use crate::text::markdown;

const STYLE: &str = include_str!("../assets/page.css");
const CONTROLS: &str = include_str!("../assets/controls.js");
const FRAMES: &str = include_str!("../assets/frames.js");
const VIEWER: &str = include_str!("../assets/viewer.js");
const CHECK: &str = include_str!("../assets/check.js");

/// From this many sections on there is a table of contents.
const CONTENTS_FROM: usize = 3;

/// A page with a title and sections.
///
/// Its HTML needs nothing else: style, scripts and pictures are inside, and a content security policy
/// forbids the browser to load anything from anywhere, or to run any other script.
#[must_use]
#[derive(Clone, Debug)]
pub struct Page {
    title: String,
    lead: Vec<String>,
    sections: Vec<Section>,
}

impl Page {
    /// A title and no sections yet.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            lead: Vec::new(),
            sections: Vec::new(),
        }
    }

    /// Adds a paragraph between the title and the first section.
    pub fn with_lead(mut self, text: impl Into<String>) -> Self {
        self.lead.push(text.into());
        self
    }

    /// Adds a section below those before.
    pub fn with(mut self, section: Section) -> Self {
        self.sections.push(section);
        self
    }

    /// The page as HTML.
    pub fn to_html(&self) -> String {
        let ids = self.ids();
        let sections = || self.sections.iter().zip(&ids);
        let main = html! {
            main {
                @for (section, id) in sections() {
                    section aria-labelledby=(id) {
                        h2 id=(id) { (section.title) }
                        (PreEscaped(&section.body))
                    }
                }
            }
        };
        // Text has no tags, so that these are those of the crate.
        let has = |class: &str| main.0.contains(&format!("<figure class=\"{class}\""));
        let script = script(has("frames"), has("viewer"));
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta http-equiv="Content-Security-Policy" content=(PreEscaped(policy(&script)));
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    title { (self.title) }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    header {
                        h1 { (self.title) }
                        @for text in &self.lead { p { (text) } }
                    }
                    @if ids.len() >= CONTENTS_FROM {
                        nav aria-label="Contents" {
                            ol {
                                @for (section, id) in sections() {
                                    li { a href={ "#" (id) } { (section.title) } }
                                }
                            }
                        }
                    }
                    (main)
                    script { (PreEscaped(script)) }
                }
            }
        };
        page.into_string()
    }

    /// Writes the page, atomically.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<()> {
        let html = self.to_html();
        Ok(write_atomically(path, |out| {
            out.write_all(html.as_bytes())
        })?)
    }

    /// An identifier for every section, none twice.
    fn ids(&self) -> Vec<String> {
        let mut taken = HashSet::new();
        let unique = |section: &Section| {
            let wanted = identifier(&section.name);
            let numbered = (2..).map(|k| format!("{wanted}-{k}"));
            let mut free = std::iter::once(wanted.clone()).chain(numbered);
            let id = free.find(|id| taken.insert(id.clone()));
            id.expect("some number is free")
        };
        self.sections.iter().map(unique).collect()
    }
}

/// A name as an identifier for links inside the page.
fn identifier(name: &str) -> String {
    let mut id = String::new();
    for character in name.chars().flat_map(char::to_lowercase) {
        if character.is_alphanumeric() || character == '_' {
            id.push(character);
        } else if !id.is_empty() && !id.ends_with('-') {
            id.push('-');
        }
    }
    let id = id.trim_end_matches('-');
    if id.is_empty() { "section" } else { id }.to_owned()
}

/// The scripts that the page needs, in one scope of their own.
fn script(frames: bool, viewer: bool) -> String {
    let parts = [
        (frames || viewer, CONTROLS),
        (frames, FRAMES),
        (viewer, VIEWER),
        (true, CHECK),
    ];
    let needed = parts.into_iter().filter(|(needed, _)| *needed);
    let parts: String = needed.map(|(_, part)| part).collect();
    format!("(() => {{\n\"use strict\";\n{parts}}})();\n")
}

/// What the browser may load: nothing but the style and the script, by their hashes, and pictures
/// inside.
fn policy(script: &str) -> String {
    let hash = |text: &str| STANDARD.encode(Sha256::of(text));
    format!(
        "default-src 'none'; img-src data:; style-src 'sha256-{}'; script-src 'sha256-{}'; \
         base-uri 'none'; form-action 'none'",
        hash(STYLE),
        hash(script)
    )
}

/// A part of a page under a heading of its own. In another section it is a block behind a line that opens it, and has no name.
#[must_use]
#[derive(Clone, Debug)]
pub struct Section {
    title: String,
    name: String,
    body: String,
}

impl Section {
    /// A heading and no blocks yet.
    pub fn new(title: impl Into<String>) -> Self {
        let title = title.into();
        Self {
            name: title.clone(),
            title,
            body: String::new(),
        }
    }

    /// Gives the section a name of its own for links to it, `page.html#name`; without, it is the
    /// title in small letters.
    pub fn named(mut self, name: impl Into<String>) -> Self {
        self.name = name.into();
        self
    }

    /// Adds a block: a [paragraph](crate::paragraph), text in [Markdown](crate::markdown), a [`figure`], a [`TableElement`](crate::TableElement),
    /// [`Facts`](crate::Facts), [`frames`], a [viewer](crate::viewer()) or another section.
    pub fn with(mut self, block: impl Render) -> Self {
        self.push(block);
        self
    }

    /// As [`Section::with`], in place.
    pub fn push(&mut self, block: impl Render) {
        block.render_to(&mut self.body);
    }
}

impl Render for Section {
    fn render(&self) -> Markup {
        html! { details { summary { (self.title) } (PreEscaped(&self.body)) } }
    }
}

/// A picture with a caption, which also is what readers are told who cannot see the picture.
pub fn figure(image: &ImageElement, caption: &str) -> Markup {
    html! {
        figure { (image.html(caption)) figcaption { (caption) } }
    }
}

/// Pictures of which one is shown at a time, chosen by a slider or played: one or more with a label each, such as the step of a flow.
pub fn frames(caption: &str, frames: &[(String, ImageElement)]) -> Markup {
    html! {
        figure.frames {
            div.strip tabindex="0" role="region" aria-label=(caption) {
                @for frame in frames {
                    div.frame data-label=(frame.0) { (labelled(caption, frame)) }
                }
            }
            figcaption { (caption) }
        }
    }
}

/// A picture of several in a figure, above its label.
pub(crate) fn labelled(caption: &str, (label, image): &(String, ImageElement)) -> Markup {
    html! {
        (image.html(&format!("{caption}, {label}")))
        span { (label) }
    }
}

/// Pictures that lead to sections of the page: the name of a section, a picture with a text for those who cannot see it, a title, and a sentence
/// in Markdown.
pub(crate) fn gallery(cards: &[Card]) -> Markup {
    html! {
        ul.gallery {
            @for card in cards {
                li {
                    a href={ "#" (card.section) } {
                        (card.image.html(&card.alternative))
                        span { (card.title) }
                    }
                    (markdown(&card.sentence))
                }
            }
        }
    }
}

/// One of a [`gallery`].
pub(crate) struct Card {
    pub section: String,
    pub image: ImageElement,
    pub alternative: String,
    pub title: String,
    pub sentence: String,
}

/// Every k-th item, with the smallest k that leaves at most `most` of them, which are two or more; the last one in any case.
pub fn thinned<T>(items: &[T], most: usize) -> impl Iterator<Item = &T> {
    // One less, as the last one may come on top.
    let every = items.len().div_ceil(most - 1).max(1);
    let every = if items.len() <= most { 1 } else { every };
    let last = items.len().saturating_sub(1);
    (items.iter().enumerate())
        .filter(move |(k, _)| k % every == 0 || *k == last)
        .map(|(_, item)| item)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_single_words() {
        assert_eq!(identifier("Willmore flow, n = 128"), "willmore-flow-n-128");
        assert_eq!(identifier("rocker_arm"), "rocker_arm");
        assert_eq!(identifier("<?\"!"), "section");
    }

    #[test]
    fn long_sequences_are_thinned_to_their_ends() {
        for length in 0..400 {
            let items: Vec<usize> = (0..length).collect();
            let kept: Vec<usize> = thinned(&items, 60).copied().collect();
            assert!(kept.len() <= 60, "{length}: {}", kept.len());
            assert!(length > 60 || kept == items);
            assert!(length == 0 || (kept[0] == 0 && kept[kept.len() - 1] == length - 1));
            assert!(length < 100 || kept.len() > 30, "{length}: {}", kept.len());
        }
    }
}

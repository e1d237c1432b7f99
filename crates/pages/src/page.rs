//! Pages: one HTML file with everything in it.

use std::collections::HashSet;
use std::fmt::Write;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use geometry::file::write_atomically;
use sha2::{Digest, Sha256};

use crate::error::Result;
use crate::escape::{escaped, identifier};
use crate::section::{Needs, Section};
use crate::text::Text;

const STYLE: &str = include_str!("../assets/page.css");
const CONTROLS: &str = include_str!("../assets/controls.js");
const FRAMES: &str = include_str!("../assets/frames.js");
const VIEWER: &str = include_str!("../assets/viewer.js");
const CHECK: &str = include_str!("../assets/check.js");

/// From this many sections on there is a table of contents.
const CONTENTS_FROM: usize = 3;

/// A page with a title and sections.
///
/// Its HTML needs nothing but linked pictures, if there are any: style and scripts are inside, and
/// a content security policy forbids the browser to load anything else from anywhere, or to run
/// any other script. The same page gives the same bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    title: String,
    lead: Vec<Text>,
    sections: Vec<Section>,
}

impl Page {
    /// An empty page.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            lead: Vec::new(),
            sections: Vec::new(),
        }
    }

    /// Adds a paragraph between the title and the first section.
    #[must_use]
    pub fn with_lead(mut self, text: impl Into<Text>) -> Self {
        self.lead.push(text.into());
        self
    }

    /// Adds a section.
    #[must_use]
    pub fn with(mut self, section: Section) -> Self {
        self.push(section);
        self
    }

    /// Adds a section.
    pub fn push(&mut self, section: Section) {
        self.sections.push(section);
    }

    /// The page as HTML.
    pub fn to_html(&self) -> String {
        let mut needs = Needs::default();
        for section in &self.sections {
            section.add_needs(&mut needs);
        }
        let title = escaped(&self.title);
        let script = script(needs);
        let policy = policy(needs, &script);
        let mut html = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"{policy}\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n\
             <header>\n<h1>{title}</h1>\n"
        );
        for text in &self.lead {
            let _ = writeln!(html, "<p>{}</p>", text.html());
        }
        html.push_str("</header>\n");
        let ids = self.ids();
        if ids.len() >= CONTENTS_FROM {
            html.push_str("<nav aria-label=\"Contents\"><ol>\n");
            for (section, id) in self.sections.iter().zip(&ids) {
                let title = escaped(&section.title);
                let _ = writeln!(html, "<li><a href=\"#{id}\">{title}</a></li>");
            }
            html.push_str("</ol></nav>\n");
        }
        html.push_str("<main>\n");
        for (section, id) in self.sections.iter().zip(&ids) {
            section.write(&mut html, id);
        }
        let _ = write!(
            html,
            "</main>\n<script>{script}</script>\n</body>\n</html>\n"
        );
        html
    }

    /// Writes the page, atomically.
    ///
    /// # Errors
    /// [`Error::Write`](crate::Error::Write).
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
            let id = std::iter::once(wanted.clone())
                .chain(numbered)
                .find(|id| !taken.contains(id))
                .unwrap_or(wanted);
            taken.insert(id.clone());
            id
        };
        self.sections.iter().map(unique).collect()
    }
}

/// The scripts that the page needs, in one scope of their own.
fn script(needs: Needs) -> String {
    let parts = [
        (needs.frames || needs.viewer, CONTROLS),
        (needs.frames, FRAMES),
        (needs.viewer, VIEWER),
        (true, CHECK),
    ];
    let mut script = "(() => {\n\"use strict\";\n".to_owned();
    for (_, part) in parts.iter().filter(|(needed, _)| *needed) {
        script.push_str(part);
    }
    script.push_str("})();\n");
    script
}

/// What the browser may load: nothing but the style and the script, by their hashes, and pictures.
fn policy(needs: Needs, script: &str) -> String {
    let hash = |text: &str| STANDARD.encode(Sha256::digest(text));
    // Of pages without a server, `file:` are the neighbours.
    let pictures = if needs.linked_pictures {
        "data: 'self' file:"
    } else {
        "data:"
    };
    format!(
        "default-src 'none'; img-src {pictures}; style-src 'sha256-{}'; script-src 'sha256-{}'; \
         base-uri 'none'; form-action 'none'",
        hash(STYLE),
        hash(script)
    )
}

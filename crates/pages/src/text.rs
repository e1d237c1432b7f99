//! Running text.

use maud::{Markup, PreEscaped};
use pulldown_cmark::{Event, HeadingLevel, Options, Parser, Tag, TagEnd, html};

/// A paragraph of text as it is.
///
/// ```
/// assert_eq!(pages::paragraph("2 < 3 `n`").0, "<p>2 &lt; 3 `n`</p>");
/// assert_eq!(pages::markdown("2 < 3 `n`").0, "<p>2 &lt; 3 <code>n</code></p>\n");
/// ```
pub fn paragraph(text: &str) -> Markup {
    maud::html! { p { (text) } }
}

/// Text in Markdown, headings one level down. HTML in it is shown as it is written; of links
/// to files only the text is left, as a page is a file of its own.
pub fn markdown(text: &str) -> Markup {
    linked(text, |_| None)
}

/// The same with links to some files that lead to a section of the page; `section` gives its
/// name.
pub(crate) fn linked(text: &str, section: impl Fn(&str) -> Option<String>) -> Markup {
    rendered(events(text, section))
}

/// Markdown within a line.
pub(crate) fn inline(text: &str) -> Markup {
    let is_block = |event: &Event<'_>| {
        matches!(
            event,
            Event::Start(Tag::Paragraph) | Event::End(TagEnd::Paragraph)
        )
    };
    rendered(events(text, |_| None).filter(|event| !is_block(event)))
}

fn rendered<'a>(events: impl Iterator<Item = Event<'a>>) -> Markup {
    let mut text = String::new();
    html::push_html(&mut text, events);
    PreEscaped(text)
}

/// The parts of a text, without what a page must not have.
fn events<'a>(
    text: &'a str,
    section: impl Fn(&str) -> Option<String> + 'a,
) -> impl Iterator<Item = Event<'a>> {
    let mut kept = true;
    Parser::new_ext(text, Options::ENABLE_TABLES).filter_map(move |mut event| {
        match &mut event {
            Event::Html(html) | Event::InlineHtml(html) => {
                return Some(Event::Text(html.clone()));
            }
            Event::Start(Tag::HtmlBlock) => return Some(Event::Start(Tag::Paragraph)),
            Event::End(TagEnd::HtmlBlock) => return Some(Event::End(TagEnd::Paragraph)),
            // Of a picture the text is left.
            Event::Start(Tag::Image { .. }) | Event::End(TagEnd::Image) => return None,
            Event::Start(Tag::Link { dest_url, .. }) => {
                let mut outside = ["https://", "http://"].iter();
                kept = outside.any(|start| dest_url.starts_with(start));
                if !kept {
                    *dest_url = format!("#{}", section(dest_url)?).into();
                    kept = true;
                }
            }
            Event::Text(text) => *text = unbroken(text).into(),
            Event::End(TagEnd::Link) => return kept.then_some(event),
            Event::Start(Tag::Heading { level, .. }) | Event::End(TagEnd::Heading(level)) => {
                let below = HeadingLevel::try_from(*level as usize + 1);
                *level = below.unwrap_or(HeadingLevel::H6);
            }
            _ => {}
        }
        Some(event)
    })
}

/// A text in which no line ends beside a sign of equality, as in `n = 128`.
pub(crate) fn unbroken(text: &str) -> String {
    text.replace(" = ", "\u{a0}=\u{a0}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn links_lead_outside_or_to_sections() {
        let text = "[a](b) [c](https://d.org) ![e](f.png) <b>g</b> javascript: [x](javascript:y)";
        let html = linked(text, |target| (target == "b").then(|| "b-2".to_owned()));
        assert_eq!(
            html.0,
            "<p><a href=\"#b-2\">a</a> <a href=\"https://d.org\">c</a> e &lt;b&gt;g&lt;/b&gt; javascript: x</p>\n"
        );
        assert_eq!(inline("[a](b) **c**").0, "a <strong>c</strong>");
    }

    /// Any characters, those that mean something in HTML or Markdown more often than others.
    fn text() -> impl Strategy<Value = String> {
        let special = "<>&\"'\0\t\n-:/ &amp;*_`[](){}!|#\\"
            .chars()
            .collect::<Vec<_>>();
        let character = prop_oneof![prop::sample::select(special), any::<char>()];
        prop::collection::vec(character, 0..60).prop_map(String::from_iter)
    }

    proptest! {
        #[test]
        fn no_text_becomes_a_script_or_a_picture(text in text(), tag in 0..3_usize) {
            let tag = ["<script>", "<img src=x onerror=y>", "[x](<javascript:\">)"][tag];
            let text = format!("{text}{tag}");
            for PreEscaped(html) in [markdown(&text), paragraph(&text)] {
                prop_assert!(!html.contains("<script") && !html.contains("<img"), "{html}");
                prop_assert!(!html.contains("href=\"j"), "{html}");
            }
        }
    }
}

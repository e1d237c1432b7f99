//! Text and addresses as HTML.

use std::fmt::Write;

use crate::error::{Error, Result};

/// Text as content of an element or of a quoted attribute. Characters that HTML cannot carry become
/// the replacement character.
pub(crate) fn escaped(text: &str) -> String {
    let mut html = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => html.push_str("&amp;"),
            '<' => html.push_str("&lt;"),
            '>' => html.push_str("&gt;"),
            '"' => html.push_str("&quot;"),
            '\'' => html.push_str("&#39;"),
            '\t' | '\n' => html.push(character),
            _ if character.is_control() => html.push(char::REPLACEMENT_CHARACTER),
            _ => html.push(character),
        }
    }
    html
}

/// A relative path as an address, with everything but plain letters encoded.
///
/// # Errors
/// [`Error::Link`] for absolute paths, other schemes, other separators and empty components.
pub(crate) fn relative_address(path: &str) -> Result<String> {
    let refused = || Error::Link {
        link: path.to_owned(),
    };
    if path.contains('\\') || path.split('/').any(|part| part.is_empty() || part == ".") {
        return Err(refused());
    }
    let mut address = String::with_capacity(path.len());
    for byte in path.bytes() {
        match byte {
            // A colon is encoded, so that nothing is taken for a scheme.
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' | b'/' => {
                address.push(char::from(byte));
            }
            _ => write!(address, "%{byte:02X}").unwrap_or_default(),
        }
    }
    Ok(address)
}

/// A name as an identifier for links inside the page.
pub(crate) fn identifier(name: &str) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn markup_becomes_text() {
        assert_eq!(
            escaped("<a href=\"x\">'&'</a>\u{0}"),
            "&lt;a href=&quot;x&quot;&gt;&#39;&amp;&#39;&lt;/a&gt;\u{FFFD}"
        );
        assert_eq!(escaped("τ̃ = h², 7.6·10⁻⁸"), "τ̃ = h², 7.6·10⁻⁸");
    }

    #[test]
    fn addresses_stay_relative() {
        assert_eq!(
            relative_address("cross/errors.svg").unwrap(),
            "cross/errors.svg"
        );
        assert_eq!(
            relative_address("a b/50%#?.png").unwrap(),
            "a%20b/50%25%23%3F.png"
        );
        assert_eq!(
            relative_address("javascript:alert(1)").unwrap(),
            "javascript%3Aalert%281%29"
        );
        for path in ["", "/etc/x", "//host/x", "a//b", "a/", "a\\b", "./a"] {
            let error = relative_address(path).unwrap_err();
            assert!(
                matches!(&error, Error::Link { link } if link == path),
                "{path:?}"
            );
        }
    }

    #[test]
    fn identifiers_are_single_words() {
        assert_eq!(identifier("Willmore flow, n = 128"), "willmore-flow-n-128");
        assert_eq!(identifier("rocker_arm"), "rocker_arm");
        assert_eq!(identifier("?!"), "section");
    }

    /// Any characters, those that mean something in HTML more often than others.
    fn text() -> impl Strategy<Value = String> {
        let special = prop::sample::select("<>&\"'\0\t\n-:/ &amp;".chars().collect::<Vec<_>>());
        let character = prop_oneof![special, any::<char>()];
        prop::collection::vec(character, 0..60).prop_map(String::from_iter)
    }

    proptest! {
        #[test]
        fn escaped_text_holds_no_markup_and_reads_back(text in text()) {
            let html = escaped(&text);
            prop_assert!(!html.contains(['<', '>', '"', '\'']));
            let back = html
                .replace("&lt;", "<")
                .replace("&gt;", ">")
                .replace("&quot;", "\"")
                .replace("&#39;", "'")
                .replace("&amp;", "&");
            let expected: String = text
                .chars()
                .map(|c| match c {
                    '\t' | '\n' => c,
                    c if c.is_control() => '\u{FFFD}',
                    c => c,
                })
                .collect();
            prop_assert_eq!(back, expected);
        }

        #[test]
        fn identifiers_hold_no_spaces_or_quotes(name in text()) {
            let id = identifier(&name);
            prop_assert!(!id.is_empty());
            prop_assert!(id.chars().all(|c| c.is_alphanumeric() || "_-".contains(c)));
        }
    }
}

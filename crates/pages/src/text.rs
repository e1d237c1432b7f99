//! Running text with links.

use crate::error::Result;
use crate::escape::{escaped, relative_address};

/// Text that may hold links to files beside the page and names in typewriter letters.
///
/// ```
/// use pages::Text;
/// let text = Text::from("The data are in ").link("errors.csv", "cross/errors.csv")?.then(".");
/// # let _ = text;
/// # Ok::<(), pages::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Text {
    html: String,
}

impl Text {
    /// Adds plain text.
    #[must_use]
    pub fn then(mut self, text: &str) -> Self {
        self.html.push_str(&escaped(text));
        self
    }

    /// Adds a name in typewriter letters.
    #[must_use]
    pub fn code(mut self, name: &str) -> Self {
        self.html.push_str("<code>");
        self.html.push_str(&escaped(name));
        self.html.push_str("</code>");
        self
    }

    /// Adds a link to a file, given relative to the page.
    ///
    /// # Errors
    /// [`Error::Link`](crate::Error::Link) unless the path is relative.
    pub fn link(mut self, label: &str, path: &str) -> Result<Self> {
        let address = relative_address(path)?;
        self.html.push_str("<a href=\"");
        self.html.push_str(&address);
        self.html.push_str("\">");
        self.html.push_str(&escaped(label));
        self.html.push_str("</a>");
        Ok(self)
    }

    /// This text followed by another.
    #[must_use]
    pub fn appended(mut self, text: &Self) -> Self {
        self.html.push_str(&text.html);
        self
    }

    pub(crate) fn html(&self) -> &str {
        &self.html
    }
}

impl From<&str> for Text {
    fn from(text: &str) -> Self {
        Self::default().then(text)
    }
}

impl From<String> for Text {
    fn from(text: String) -> Self {
        Self::from(text.as_str())
    }
}

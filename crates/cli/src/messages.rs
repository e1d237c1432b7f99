//! What is printed.

use std::io::Write;

use report::Progress;

use crate::cli::MessageOptions;
use crate::prelude::*;

impl MessageOptions {
    /// Prints the outcome of a command: an object, or a text for people.
    pub fn report(self, outcome: &Value, text: &str) {
        // A closed pipe (`| head`) is no reason to fail after the results have been written.
        if self.json {
            let _ = writeln!(std::io::stdout(), "{outcome}");
        } else if !self.quiet {
            let _ = writeln!(std::io::stdout(), "{text}");
        }
    }

    pub fn warn(self, what: &str) {
        if !self.quiet {
            eprintln!("warning: {what}");
        }
    }

    pub fn note(self, what: &str) {
        if !self.quiet && !self.json {
            eprintln!("{what}");
        }
    }

    pub fn progress(self) -> Progress {
        Progress::new(self.quiet || self.json)
    }
}

//! What is printed, and where.

use std::fmt::Display;
use std::io::{self, Write};
use std::sync::Mutex;

use indicatif::ProgressBar;
use jobs::{Note, Progress, Warning, Watcher};
use report::ProgressBars;
use runs::Interrupt;
use serde_json::Value;

use crate::cli::MessageOptions;
use crate::error::Result;
use crate::spelling::spelled;

/// Standard output and standard error, or what stands for them.
pub struct Console {
    out: Mutex<Box<dyn Write + Send>>,
    error: Mutex<Box<dyn Write + Send>>,
    options: MessageOptions,
    /// Whether standard output is a result, beside which only warnings are told.
    is_piped: bool,
}

impl Console {
    /// The streams of the process.
    pub fn standard() -> Self {
        Self::new(io::stdout(), io::stderr())
    }

    /// These streams.
    pub fn new(out: impl Write + Send + 'static, error: impl Write + Send + 'static) -> Self {
        Self {
            out: Mutex::new(Box::new(out)),
            error: Mutex::new(Box::new(error)),
            options: MessageOptions::default(),
            is_piped: false,
        }
    }

    /// Prints as the options say, and nothing but a result to standard output if that is piped.
    pub(crate) fn set(&mut self, options: MessageOptions, is_piped: bool) {
        (self.options, self.is_piped) = (options, is_piped);
    }

    /// Prints the outcome of a command: an object, or a text for people.
    pub(crate) fn report(&self, outcome: &Value, text: &str) -> Result<()> {
        let MessageOptions { quiet, json } = self.options;
        if self.is_piped || quiet && !json {
            return Ok(());
        }
        let text = spelled(text);
        let shown: &dyn Display = if json { outcome } else { &text };
        self.write(format!("{shown}\n").as_bytes())
    }

    /// Tells what a person should know before trusting a result.
    pub(crate) fn warn(&self, what: &str) {
        if !self.options.quiet {
            self.tell(&format!("warning: {}", spelled(what)));
        }
    }

    /// Tells what was chosen, or how far it is.
    pub(crate) fn note(&self, what: &str) {
        if !self.is_silent() {
            self.tell(&spelled(what));
        }
    }

    /// Says why there is no outcome.
    pub(crate) fn fail(&self, why: &str) {
        self.tell(&format!("error: {}", spelled(why)));
    }

    /// Progress bars, where standard error is a terminal.
    pub(crate) fn progress(&self) -> ProgressBars {
        ProgressBars::new(self.is_silent())
    }

    fn is_silent(&self) -> bool {
        self.options.quiet || self.options.json || self.is_piped
    }

    /// Writes to standard output. A closed pipe (`| head`) is no failure.
    pub(crate) fn write(&self, bytes: &[u8]) -> Result<()> {
        let mut out = lock(&self.out);
        match out.write_all(bytes).and_then(|()| out.flush()) {
            Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
                Err(files::Error::of("write", "standard output")(error).into())
            }
            _ => Ok(()),
        }
    }

    fn tell(&self, what: &str) {
        // A closed pipe is no reason to fail here either.
        let _ = writeln!(lock(&self.error), "{what}");
    }
}

fn lock<T>(of: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    of.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

impl Watcher for Console {
    fn warning(&self, warning: &Warning) {
        self.warn(&warning.to_string());
    }

    fn note(&self, note: &Note) {
        Self::note(self, &note.to_string());
    }

    fn begins(&self, title: &str, parts: u64) -> Box<dyn Progress> {
        let bars = self.progress();
        let bar = bars.bar(title.to_owned(), parts);
        Box::new(Bar { bars, bar })
    }

    fn interrupt(&self) -> Result<Interrupt, runs::Error> {
        Interrupt::catch()
    }
}

/// A bar, which leaves the screen when it is dropped.
struct Bar {
    bars: ProgressBars,
    bar: ProgressBar,
}

impl Progress for Bar {
    fn expect(&self, parts: u64) {
        self.bar.set_length(parts);
    }

    fn reach(&self, parts: u64) {
        self.bar.set_position(parts);
    }

    fn advance(&self) {
        self.bar.inc(1);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish();
        self.bars.clear();
    }
}

//! What is printed, and where.

use std::fmt::Display;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, Once};
use std::time::Duration;

use indicatif::ProgressBar;
use jobs::{Note, Progress, Warning, Watcher};
use report::ProgressBars;
use runs::{Interrupt, Last};
use serde_json::{Value, json};

use crate::cli::MessageOptions;
use crate::error::Result;
use crate::spelling::spelled;

/// How long after a signal the program ends at the latest. What is printed and the end of the process come on top.
const GRACE: Duration = Duration::from_millis(800);

/// A stream that several threads may write to.
type Stream = Arc<Mutex<Box<dyn Write + Send>>>;

/// Standard output and standard error, or what stands for them.
#[derive(Clone)]
pub struct Console {
    out: Stream,
    error: Stream,
    options: MessageOptions,
    /// Whether standard output is a result, beside which only warnings are told.
    is_piped: bool,
    /// Names of files that only stand for something, and what they stand for.
    aliases: Vec<(String, &'static str)>,
    /// The run that a signal would end.
    begun: Arc<Mutex<Option<Begun>>>,
    /// Whether all is said and done.
    ended: Arc<AtomicBool>,
}

/// A run that can be resumed.
struct Begun {
    command: &'static str,
    folder: PathBuf,
    /// The file to which its result goes, if one was chosen.
    save: Option<PathBuf>,
}

impl Begun {
    /// How to go on with it.
    fn advice(&self) -> String {
        advice(&self.folder, self.save.as_deref())
    }
}

/// How to go on with an interrupted run whose result goes to this file.
pub(crate) fn advice(folder: &Path, save: Option<&Path>) -> String {
    // What is there by now, perhaps from the end of this run, is to be written over by whoever goes on, too.
    let is_saved = save.is_some_and(Path::exists);
    let force = if is_saved { " --force" } else { "" };
    format!(
        "interrupted, go on with: willmore resume {}{force}",
        folder.display()
    )
}

impl Console {
    /// The streams of the process.
    pub fn standard() -> Self {
        Self::new(io::stdout(), io::stderr())
    }

    /// These streams.
    pub fn new(out: impl Write + Send + 'static, error: impl Write + Send + 'static) -> Self {
        Self {
            out: Arc::new(Mutex::new(Box::new(out))),
            error: Arc::new(Mutex::new(Box::new(error))),
            options: MessageOptions::default(),
            is_piped: false,
            aliases: Vec::new(),
            begun: Arc::default(),
            ended: Arc::default(),
        }
    }

    /// Prints as the options say, and nothing but a result to standard output if that is piped. What files stand for is called by its name.
    pub(crate) fn set(
        &mut self,
        options: MessageOptions,
        is_piped: bool,
        aliases: Vec<(String, &'static str)>,
    ) {
        (self.options, self.is_piped, self.aliases) = (options, is_piped, aliases);
    }

    /// A message as it is typed and called.
    fn called(&self, message: &str) -> String {
        let mut text = spelled(message);
        for (file, name) in &self.aliases {
            text = text.replace(file, name);
        }
        text
    }

    /// What is said when a signal ends the program before its run could end by itself.
    fn last_words(&self) -> Last {
        if self.ended.load(Ordering::Relaxed) {
            return Last::Wait;
        }
        let Some(begun) = lock(&self.begun).take() else {
            self.fail("interrupted");
            return Last::Leave;
        };
        let folder = begun.folder.to_string_lossy();
        let outcome = json!({ "command": begun.command, "finished": false, "run": folder });
        // The process ends in any case.
        let _ = self.print(&outcome, &begun.advice());
        Last::Leave
    }

    /// All is said: no signal ends the program any more.
    pub(crate) fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
    }

    /// Prints the outcome of a command: an object, or a text for people.
    pub(crate) fn report(&self, outcome: &Value, text: &str) -> Result<()> {
        lock(&self.begun).take();
        self.print(outcome, text)
    }

    fn print(&self, outcome: &Value, text: &str) -> Result<()> {
        let MessageOptions { quiet, json } = self.options;
        if self.is_piped || quiet && !json {
            return Ok(());
        }
        let text = self.called(text);
        let shown: &dyn Display = if json { outcome } else { &text };
        self.write(format!("{shown}\n").as_bytes())
    }

    /// Tells what a person should know before trusting a result.
    pub(crate) fn warn(&self, what: &str) {
        if !self.options.quiet {
            self.tell(&format!("warning: {}", self.called(what)));
        }
    }

    /// Tells what was chosen, or how far it is.
    pub(crate) fn note(&self, what: &str) {
        if !self.is_silent() {
            self.tell(&self.called(what));
        }
    }

    /// Says why there is no outcome.
    pub(crate) fn fail(&self, why: &str) {
        self.tell(&format!("error: {}", self.called(why)));
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
        static WATCHED: Once = Once::new();
        let interrupt = Interrupt::catch()?;
        WATCHED.call_once(|| {
            let console = self.clone();
            interrupt.leave_within(GRACE, move || console.last_words());
        });
        Ok(interrupt)
    }

    fn stores(&self, command: &'static str, folder: &Path, save: Option<&Path>) {
        *lock(&self.begun) = Some(Begun {
            command,
            folder: folder.to_owned(),
            save: save.map(Path::to_owned),
        });
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A run that a signal ends after it has saved its result goes on by what it advises.
    #[test]
    fn what_is_saved_is_looked_at_when_the_run_ends() {
        let folder = tempfile::tempdir().unwrap();
        let save = folder.path().join("cross.svg");
        let console = Console::new(io::sink(), io::sink());
        console.stores("flow", Path::new("run"), Some(&save));
        let advice = || {
            let begun = lock(&console.begun);
            begun.as_ref().map(Begun::advice).unwrap()
        };
        assert!(advice().ends_with("willmore resume run"));
        std::fs::write(&save, "saved").unwrap();
        assert!(advice().ends_with("willmore resume run --force"));
    }
}

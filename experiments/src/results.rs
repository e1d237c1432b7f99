//! What every program writes: figures, tables, metrics and the manifest, and at the end a text on standard output.

use operators::ComputeDevice;
use report::{Figure, Manifest, OutputDir, Progress, Summary, Table};
use serde::Serialize;

use crate::Error;
use crate::options::RunOptions;

/// The results of a running program.
#[derive(Debug)]
pub struct Results<'a> {
    run: &'a RunOptions,
    /// The output folder.
    pub output: OutputDir,
    /// What was run; its phases are timed.
    pub manifest: Manifest,
    /// Progress bars, unless quiet.
    pub progress: Progress,
    /// The metrics.
    pub summary: Summary,
    text: String,
}

impl<'a> Results<'a> {
    /// Creates and checks the output folder and starts the clock; to be called when everything else has been checked.
    ///
    /// # Errors
    /// [`Error::Report`] if the folder cannot be written, or the parameters do not serialise to a map.
    pub fn begin(
        run: &'a RunOptions,
        program: &str,
        parameters: &impl Serialize,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        Ok(Self {
            run,
            output: run.open_output(program)?,
            manifest: run.manifest(program, parameters, device)?,
            progress: run.progress(),
            summary: Summary::new(),
            text: String::new(),
        })
    }

    /// Writes a figure; its title says so if this is a quick run.
    ///
    /// # Errors
    /// [`Error::Report`].
    pub fn figure(&self, figure: Figure, stem: &str) -> Result<(), Error> {
        let title = self.run.title(&figure.title);
        Ok(Figure { title, ..figure }.write(&self.output, stem)?)
    }

    /// Writes a table, which is also shown at the end.
    ///
    /// # Errors
    /// [`Error::Report`].
    pub fn table(&mut self, table: &Table, stem: &str) -> Result<(), Error> {
        table.write(&self.output, stem)?;
        self.say(&table.to_markdown());
        Ok(())
    }

    /// Adds lines to the text at the end.
    pub fn say(&mut self, text: &str) {
        self.text.extend([text, "\n"]);
    }

    /// Writes metrics and manifest, and prints a title, the tables, and where everything is.
    ///
    /// # Errors
    /// [`Error::Report`].
    pub fn finish(mut self, title: &str) -> Result<(), Error> {
        self.summary.write(&self.output)?;
        self.manifest.write(&self.output)?;
        self.progress.clear();
        let title = self.run.title(title);
        let folder = self.output.as_path().display();
        self.run
            .say(&format!("{title}\n{}Results are in {folder}", self.text));
        Ok(())
    }
}

//! What every program does between its options and its results.

use std::time::Instant;

use engine::{Case, Samples, Stop, Trajectory};
use operators::ComputeDevice;
use report::{Figure, Manifest, OutputDir, Progress, Summary};
use runs::Interrupt;
use serde::Serialize;

use crate::Error;
use crate::options::RunOptions;

/// A program whose options are checked: its device, its output folder, its manifest.
pub struct Session<'a> {
    /// Common options.
    pub options: &'a RunOptions,
    /// Where tensors live.
    pub device: ComputeDevice,
    /// Where results go.
    pub output: OutputDir,
    /// Progress bars.
    pub progress: Progress,
    /// What is run, and the wall times of its parts.
    pub manifest: Manifest,
    clock: Instant,
}

impl<'a> Session<'a> {
    /// Opens the output folder of a program and begins its manifest; to be called when everything else has been checked.
    ///
    /// # Errors
    /// [`Error::Report`] if the folder cannot be written.
    pub fn open(
        program: &str,
        options: &'a RunOptions,
        device: ComputeDevice,
        parameters: &impl Serialize,
    ) -> Result<Self, Error> {
        let output = options.open_output(program)?;
        Ok(Self {
            manifest: options.manifest(program, parameters, &device)?,
            progress: options.progress(),
            clock: Instant::now(),
            options,
            device,
            output,
        })
    }

    /// Does a part of the work, whose wall time stands in the manifest.
    ///
    /// # Errors
    /// That of the work.
    pub fn phase<T>(
        &mut self,
        title: impl Into<String>,
        work: impl FnOnce() -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.manifest.phase(title, work)
    }

    /// Runs a case, continues it, or looks it up in the folder `fields/NAME` of the output.
    ///
    /// # Errors
    /// What the case raises.
    pub fn trajectory<const D: usize>(
        &mut self,
        title: &str,
        case: Case<D>,
        name: &str,
        samples: &Samples,
    ) -> Result<Trajectory<D>, Error> {
        let folder = self.output.as_path().join("fields").join(name);
        let steps = case.stops.iter().find_map(|stop| match stop {
            Stop::Steps(steps) => Some(*steps as u64),
            _ => None,
        });
        let mut bar = self.progress.bar(title.to_owned(), steps.unwrap_or(0));
        let (device, never) = (&self.device, Interrupt::never());
        let trajectory = self.manifest.phase(title, || {
            Trajectory::of(case, device, &folder, samples, &mut [&mut bar], &never)
        })?;
        bar.finish();
        Ok(trajectory.expect("nobody interrupts it"))
    }

    /// Writes a figure; its title says so if this is a quick run.
    ///
    /// # Errors
    /// [`Error::Report`].
    pub fn figure(&self, figure: Figure, stem: &str) -> Result<(), Error> {
        let title = self.options.title(&figure.title);
        Ok(Figure { title, ..figure }.write(&self.output, stem)?)
    }

    /// Writes the summary, with the wall time since the beginning, and the manifest, and prints a report below the title.
    ///
    /// # Errors
    /// [`Error::Report`].
    pub fn finish(mut self, title: &str, mut summary: Summary, report: &str) -> Result<(), Error> {
        summary.insert("seconds", self.clock.elapsed().as_secs_f64())?;
        summary.write(&self.output)?;
        self.manifest.write(&self.output)?;
        self.progress.clear();
        self.options.say(&format!(
            "{}\n{report}\nResults are in {}",
            self.options.title(title),
            self.output.as_path().display()
        ));
        Ok(())
    }
}

//! What every program does between its options and its results.

use std::io::Write;

use report::{Manifest, Summary};
use runs::Interrupt;
use serde::de::DeserializeOwned;

use crate::options::RunOptions;
use crate::prelude::libraries::*;

/// A program whose options are checked, and what it has to say so far.
pub struct Session {
    pub program: String,
    pub options: RunOptions,
    pub device: ComputeDevice,
    pub output: OutputDir,
    pub progress: ProgressBars,
    /// What is run, and the wall times of its parts.
    pub manifest: Manifest,
    pub summary: Summary,
    /// What is printed in the end.
    report: Vec<String>,
    clock: Instant,
}

/// What a part of the work needs, and the bar that shows how far it is.
pub struct Stage<'a> {
    pub options: &'a RunOptions,
    pub device: &'a ComputeDevice,
    pub output: &'a OutputDir,
    pub bar: ProgressBar,
}

impl Stage<'_> {
    /// Runs a case to its end; the bar counts the steps.
    pub fn run<const D: usize>(&self, case: Case<D>) -> Result<Run<D>> {
        let mut run = Run::new(case, self.device)?;
        self.finish(&mut run)?;
        Ok(run)
    }

    pub fn finish<const D: usize>(&self, run: &mut Run<D>) -> Result<()> {
        run.advance(None, &mut [&mut self.bar.clone()], &Interrupt::never())?;
        Ok(())
    }
}

impl Session {
    /// Opens the device and the output folder of a program and begins its manifest; to be called when everything else has been checked.
    pub fn open(program: &str, options: &RunOptions, mut parameters: Value) -> Result<Self> {
        let device = options.open_device()?;
        parameters["quick"] = options.quick.into();
        let usual = format!("results/{program}{}", options.either("-quick", ""));
        let folder = options.output.clone().unwrap_or_else(|| usual.into());
        let output = OutputDir::create(folder)?;
        let place = if device.kind().is_cpu() { "cpu" } else { "gpu" };
        let dtype = format!("{:?}", device.dtype()).to_lowercase();
        Ok(Self {
            program: program.to_owned(),
            manifest: Manifest::start(
                program,
                &parameters,
                [device.kind().name(), place, &dtype],
                options.seed,
            )?,
            progress: ProgressBars::new(options.quiet),
            summary: Summary::default(),
            report: Vec::new(),
            clock: Instant::now(),
            options: options.clone(),
            device,
            output,
        })
    }

    /// Does a part of the work, whose wall time stands in the manifest.
    pub fn phase<T>(
        &mut self,
        title: impl Into<String>,
        work: impl FnOnce(&Stage<'_>) -> Result<T>,
    ) -> Result<T> {
        let title = title.into();
        let stage = Stage {
            options: &self.options,
            device: &self.device,
            output: &self.output,
            bar: self.progress.bar(title.clone(), 0),
        };
        let done = self.manifest.phase(title, || work(&stage));
        stage.bar.finish();
        done
    }

    /// Runs a case, continues it, or looks it up in the folder `fields/NAME` of the output.
    pub fn trajectory<const D: usize>(
        &mut self,
        title: &str,
        case: Case<D>,
        name: &str,
        samples: &Samples,
    ) -> Result<Trajectory<D>> {
        let folder = self.output.as_path().join("fields").join(name);
        let steps = case.stops.iter().find_map(|stop| match stop {
            Stop::Steps(steps) => Some(*steps as u64),
            _ => None,
        });
        let never = Interrupt::never();
        let trajectory = self.phase(title, |stage| {
            stage.bar.set_length(steps.unwrap_or(0));
            let bar = &mut stage.bar.clone();
            let trajectory =
                Trajectory::of(case, stage.device, &folder, samples, &mut [bar], &never);
            Ok(trajectory?)
        })?;
        Ok(trajectory.expect("nobody interrupts it"))
    }

    /// Writes a figure; its title says so if this is a quick run.
    pub fn figure(&self, mut figure: Figure, stem: &str) -> Result<()> {
        figure.title = self.options.title(&figure.title);
        Ok(figure.write(&self.output, stem)?)
    }

    /// Writes a table, which is printed in the end, too, and adds its metrics.
    pub fn sheet<R>(&mut self, sheet: Sheet<'_, R>, stem: &str) -> Result<()> {
        let (table, metrics) = sheet.finish()?;
        table.write(&self.output, stem)?;
        self.remark(table.to_markdown());
        (metrics.into_iter()).try_for_each(|(name, value)| self.metric(&name, value))
    }

    /// Writes a table for programs alone.
    pub fn csv<R>(&self, sheet: Sheet<'_, R>, stem: &str) -> Result<()> {
        let (table, _) = sheet.finish()?;
        self.output.write(&format!("{stem}.csv"), table.to_csv())?;
        Ok(())
    }

    /// Adds a metric, unless its value is missing.
    pub fn metric(&mut self, name: &str, value: impl Into<Cell>) -> Result<()> {
        Ok(self.summary.insert(name, value)?)
    }

    pub fn metrics<const N: usize>(&mut self, key: &str, metrics: [(&str, Cell); N]) -> Result<()> {
        let mut metrics = metrics.into_iter();
        metrics.try_for_each(|(name, value)| self.metric(&format!("{key}.{name}"), value))
    }

    pub fn remark(&mut self, text: impl Into<String>) {
        self.report.push(text.into());
    }

    /// Writes the metrics, with the wall time since the beginning, and the manifest, and prints the tables and remarks below the title.
    pub fn finish(mut self, title: &str) -> Result<()> {
        let seconds = self.clock.elapsed().as_secs_f64();
        self.summary.insert("seconds", seconds)?;
        self.summary.write(&self.output)?;
        self.manifest.write(&self.output)?;
        self.progress.clear();
        if !self.options.quiet {
            let (title, report) = (self.options.title(title), self.report.join("\n"));
            let folder = self.output.as_path().display();
            // A closed pipe (`| head`) is no reason to fail after the results have been written.
            let _ = writeln!(
                std::io::stdout(),
                "{title}\n{report}\nResults are in {folder}"
            );
        }
        Ok(())
    }
}

/// Removes a folder of partial results, after the final ones have been written.
pub fn remove_folder(folder: &OutputDir) -> Result<()> {
    let path = folder.as_path();
    Ok(std::fs::remove_dir_all(path).map_err(files::Error::of("remove", path))?)
}

/// What is stored in a file, if it is there, readable, and belongs to this key.
pub fn load<T: DeserializeOwned>(file: &Path, key: &Value) -> Option<T> {
    let (found, stored): (Value, T) = serde_json::from_slice(&std::fs::read(file).ok()?).ok()?;
    (found == *key).then_some(stored)
}

/// Stores something with all that it depends on, its key, whole or not at all.
pub fn store(file: &Path, key: &Value, stored: &impl Serialize) -> Result<(), files::Error> {
    let text = serde_json::to_string(&(key, stored)).map_err(std::io::Error::from);
    files::write_atomically(file, |out| out.write_all(text?.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checkpoints_belong_to_their_keys() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("part.json");
        let (key, values) = (json!({ "x": 0.1 + 0.2 }), vec![1.0 / 3.0, -0.0]);
        assert_eq!(load::<Vec<f64>>(&file, &key), None);
        store(&file, &key, &values).unwrap();
        let bits = |values: Vec<f64>| values.into_iter().map(f64::to_bits).collect::<Vec<_>>();
        assert_eq!(load(&file, &key).map(bits), Some(bits(values)));
        assert_eq!(load::<Vec<f64>>(&file, &json!({ "x": 0.3 })), None);
        std::fs::write(&file, "{").unwrap();
        assert_eq!(load::<Vec<f64>>(&file, &key), None);
    }
}

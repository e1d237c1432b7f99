//! What an experiment says about itself: all that others show, list or test comes from here.

use std::process::ExitCode;

use clap::Parser;

use crate::metrics::{MetricTable, Word};
use crate::{Result, harness};

/// An experiment: a program, and what it leaves.
pub struct Experiment {
    /// Name of its file, its executable and its usual folder.
    pub name: &'static str,
    /// What it does, in a sentence.
    pub summary: &'static str,
    /// Runs it with the options of the command line: [`Experiment::run`] with its function.
    pub program: fn(&Self) -> ExitCode,
    /// What a quick run needs beside `--quick`. Such a run is tested: it writes the figures of the first of the results, and metrics that are
    /// explained. None if there are no quick runs.
    pub quick: Option<&'static [&'static str]>,
    /// The results that are kept.
    pub results: &'static [ResultFolder],
    /// What its metrics mean.
    pub metrics: &'static [&'static MetricTable],
    /// What words in capitals stand for in its metrics, beside those that the tables explain.
    pub words: &'static [Word],
}

/// A folder of `results`.
pub struct ResultFolder {
    /// Its name: that of the experiment, or another one for a run with other options.
    pub name: &'static str,
    pub title: &'static str,
    /// What it is, in a sentence or two.
    pub description: &'static str,
    pub figures: Figures,
    /// Options with which `scripts/regenerate_figures` makes it again; none if something else does, which the head of that script names.
    pub options: Option<&'static str>,
}

/// The figures that a folder must have: names without extension, and captions.
pub type Figures = &'static [(&'static str, &'static str)];

impl Experiment {
    /// The experiment as a program.
    pub fn main(&self) -> ExitCode {
        (self.program)(self)
    }

    /// Runs a function with the options of the command line, whose documentation is the help.
    pub fn run<O: Parser>(&self, program: impl FnOnce(&O) -> Result<()>) -> ExitCode {
        harness::main(O::command().name(self.name), program)
    }

    /// The same with this help, for options that other experiments have, too.
    pub fn run_with_help<O: Parser>(
        &self,
        help: &'static str,
        program: impl FnOnce(&O) -> Result<()>,
    ) -> ExitCode {
        harness::main(O::command().name(self.name).about(help), program)
    }
}

//! Files that follow from the list of the experiments, which `cargo run -p experiments -- --write` writes.

use std::fs;
use std::path::{Path, PathBuf};

use crate::experiment::{Experiment, ResultFolder};
use crate::programs::paper_numbers;
use crate::{Result, metrics};

/// The command that writes them.
pub const COMMAND: &str = "cargo run -p experiments -- --write";

/// The folder of the repository.
pub fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().expect("the crate is in it").to_owned()
}

/// All these files of a repository, and what they should hold: executables, which Cargo wants as files, their names in the manifest, the
/// catalogue for the page of results, and what metrics mean.
pub fn files(root: &Path, experiments: &[&Experiment]) -> Result<Vec<(PathBuf, String)>> {
    let read = |path: &Path| fs::read_to_string(path).map_err(files::Error::of("read", path));
    let executable = |experiment: &&Experiment| {
        let name = experiment.name;
        let path = root.join(format!("experiments/src/bin/{name}.rs"));
        (path, executable(experiment))
    };
    let mut all: Vec<_> = experiments.iter().map(executable).collect();
    let manifest = root.join("experiments/Cargo.toml");
    let text = with_executables(&read(&manifest)?, experiments)?;
    all.push((manifest, text));
    let catalogue = root.join("crates/pages/assets/catalogue.toml");
    all.push((catalogue, self::catalogue(experiments)));
    let page = root.join("results/METRICS.md");
    let text = read(&page)?;
    let start = text
        .find("| in names |")
        .ok_or("results/METRICS.md has no table of words")?;
    all.push((page, text[..start].to_owned() + &metrics::page(experiments)));
    Ok(all)
}

/// The program of an experiment.
fn executable(Experiment { name, summary, .. }: &Experiment) -> String {
    format!(
        "//! {summary}\n\n// Written by `{COMMAND}`.\nfn main() -> std::process::ExitCode {{\n    \
         experiments::programs::{name}::EXPERIMENT.main()\n}}\n"
    )
}

/// A manifest with the executables of the experiments, and this program.
fn with_executables(manifest: &str, experiments: &[&Experiment]) -> Result<String> {
    let parts = manifest.split_once("bin = [\n").and_then(|(before, rest)| {
        let (_, after) = rest.split_once("]\n")?;
        Some((before, after))
    });
    let (before, after) = parts.ok_or("experiments/Cargo.toml has no list of executables")?;
    let mut names: Vec<&str> = experiments
        .iter()
        .map(|experiment| experiment.name)
        .collect();
    names.push("experiments");
    names.sort_unstable();
    let line = |name: &&str| format!("    {{ name = \"{name}\", test = false }},\n");
    let list: String = names.iter().map(line).collect();
    Ok(format!("{before}bin = [\n{list}]\n{after}"))
}

/// The catalogue for the page of results.
fn catalogue(experiments: &[&Experiment]) -> String {
    let entry = |folder: &ResultFolder| {
        let figure = |(stem, caption): &(&str, &str)| format!("    [{stem:?}, {caption:?}],\n");
        let figures: String = folder.figures.iter().map(figure).collect();
        format!(
            "\n[[experiment]]\nfolder = {:?}\ntitle = {:?}\ndescription = {:?}\nfigures = [\n{figures}]\n",
            folder.name, folder.title, folder.description
        )
    };
    let folders = experiments.iter().flat_map(|experiment| experiment.results);
    let entries: String = folders.map(entry).collect();
    format!(
        "# The experiments whose results are kept, in the paper's order, and the figures that each must have, with their captions.\n\
         # Written by `{COMMAND}`.\n{entries}"
    )
}

/// The results that `scripts/regenerate_figures` makes, with experiments and options; those that take least time first, by their manifests, or
/// that there are not yet. The paper's numbers are last: they are read from the summaries of all others.
pub fn runs(root: &Path, experiments: &[&Experiment]) -> Vec<String> {
    let seconds = |folder: &ResultFolder| {
        if folder.name == paper_numbers::EXPERIMENT.name {
            return Some(f64::INFINITY);
        }
        let manifest = root.join(format!("results/{}/manifest.json", folder.name));
        let manifest: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(manifest).ok()?).ok()?;
        manifest["wall_seconds"].as_f64()
    };
    let mut runs = Vec::new();
    for experiment in experiments {
        for folder in experiment.results {
            if let Some(options) = folder.options {
                let run = format!("{} {} {options}", folder.name, experiment.name);
                runs.push((seconds(folder).unwrap_or(0.0), run.trim_end().to_owned()));
            }
        }
    }
    runs.sort_by(|a, b| a.0.total_cmp(&b.0));
    runs.into_iter().map(|(_, run)| run).collect()
}

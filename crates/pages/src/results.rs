//! Pages of results: what the folders of experiments hold, as sections.
//!
//! A folder of an experiment has a `manifest.json` and a `summary.json`, figures (PNG, the same as
//! SVG beside it), and tables (Markdown, the same as CSV beside it). [`index_page`] makes one page
//! of all folders.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use serde::Deserialize;
use serde_json::Value;

use crate::error::{Error, Result};
use crate::facts::{Facts, five_digits, natural};
use crate::image::ImageElement;
use crate::page::{Card, Page, Section, figure, gallery};
use crate::table::TableElement;
use crate::text::{linked, markdown, paragraph};

/// Longer tables are folded away.
const LONGEST_OPEN_TABLE: usize = 24;
/// Longer CSV files are data and no tables to read.
const LONGEST_CSV: usize = 60;
/// Pixels a row of the pictures in the gallery, which stand in for larger ones.
const GALLERY_WIDTH: usize = 400;
/// More phases than these are too many to read.
const MOST_PHASES: usize = 40;

/// An experiment and the figures that it must have.
#[derive(Deserialize)]
struct Entry {
    /// Name of its folder.
    folder: String,
    title: String,
    /// What it is, in a sentence or two.
    description: String,
    /// Names of figures without extension, with their captions.
    figures: Vec<(String, String)>,
}

/// All experiments whose results are kept, in the paper's order; others are shown after them.
static CATALOGUE: LazyLock<Vec<Entry>> = LazyLock::new(|| {
    let text = include_str!("../assets/catalogue.toml");
    let mut lists: BTreeMap<String, Vec<Entry>> = toml::from_str(text).expect("a test reads it");
    lists.remove("experiment").expect("a test reads it")
});

/// The page of all experiments in a folder, in the paper's order after a gallery of their first figures and its `README.md`, and what is
/// missing or broken. Only a folder that cannot be read is an error.
pub fn index_page(folder: &Path) -> Result<(Page, Vec<Error>)> {
    let mut problems = Vec::new();
    let mut found: BTreeSet<String> = entries(folder, true)?.into_iter().collect();
    let mut names = Vec::new();
    for Entry { folder, .. } in CATALOGUE.iter() {
        match found.take(folder) {
            Some(name) => names.push(name),
            None => problems.push(Error::Missing(folder.clone())),
        }
    }
    names.extend(found);
    let page = Page::new("Results of the Willmore flow workbench");
    let mut sections = Vec::new();
    let cards: Vec<Card> = names.iter().filter_map(|name| card(folder, name)).collect();
    if !cards.is_empty() {
        sections.push(Section::new("Figures").with(gallery(&cards)));
    }
    if let Some(text) = kept(read(folder, "README.md"), &mut problems) {
        let section = |target: &str| {
            let name = target.split('/').next()?;
            names.iter().find(|other| *other == name).cloned()
        };
        let text = linked(without_title(&text), section);
        sections.push(Section::new("Beside the paper").with(text));
    }
    for name in &names {
        sections.push(experiment(folder, name, &mut problems));
    }
    let mut first = Section::new("Missing or broken files").named("problems");
    for problem in &problems {
        first.push(paragraph(&problem.to_string()));
    }
    let first = (!problems.is_empty()).then_some(first);
    let page = first.into_iter().chain(sections).fold(page, Page::with);
    Ok((page, problems))
}

/// The section of the experiment in the folder `root/name`.
fn experiment(root: &Path, name: &str, problems: &mut Vec<Error>) -> Section {
    let path = |file: &str| format!("{name}/{file}");
    let files = kept(entries(&root.join(name), false), problems).unwrap_or_default();
    let facts = kept(manifest(root, &path("manifest.json")), problems);
    let mut section = Section::new(title(name)).named(name);
    if let Some(entry) = entry(name) {
        section.push(markdown(&entry.description));
    }
    for (file, caption) in pictures(name, &files) {
        if !files.contains(&file) {
            problems.push(Error::Missing(path(&file)));
        } else if let Some(image) = kept(image(root, &path(&file)), problems) {
            section.push(figure(&image, &caption));
        }
    }
    let mut folded = Vec::new();
    for file in &files {
        let (stem, extension) = stem_and_extension(file);
        // Tables in Markdown, and those in CSV that are not there in Markdown.
        let decode: fn(String, &str) -> Result<TableElement> = match extension {
            "md" if file != "README.md" => TableElement::from_markdown,
            "csv" if !files.contains(&format!("{stem}.md")) => TableElement::from_csv,
            _ => continue,
        };
        let table = read(root, &path(file)).and_then(|text| decode(path(file), &text));
        let Some(mut table) = kept(table, problems) else {
            continue;
        };
        table.caption = spelled_out(stem);
        let (rows, marked) = (table.rows().len(), extension == "md");
        if marked && rows <= LONGEST_OPEN_TABLE {
            section.push(table);
        } else if marked || rows <= LONGEST_CSV {
            let title = format!("{} ({rows} rows)", table.caption);
            folded.push(Section::new(title).with(table));
        }
    }
    let summary = path("summary.json");
    let summary = read(root, &summary).and_then(|json| Facts::from_summary(&summary, &json));
    if let Some(summary) = kept(summary, problems) {
        folded.push(Section::new("Metrics").with(summary));
    }
    if let Some(facts) = facts {
        folded.push(Section::new("How it was computed").with(facts));
    }
    folded.into_iter().fold(section, Section::with)
}

/// The first figure of the experiment in the folder `root/name`, with a sentence that says what it is about and a link to its section. What is
/// missing or broken is told there.
fn card(root: &Path, name: &str) -> Option<Card> {
    let files = entries(&root.join(name), false).ok()?;
    let (file, caption) = pictures(name, &files).into_iter().next()?;
    let file = format!("{name}/{file}");
    let bytes = read_bytes(root, &file).ok()?;
    Some(Card {
        section: name.to_owned(),
        image: ImageElement::reduced(&file, &bytes, GALLERY_WIDTH).ok()?,
        title: title(name),
        sentence: entry(name).map_or_else(|| caption.clone(), |entry| entry.description.clone()),
        alternative: caption,
    })
}

/// What the catalogue says of an experiment.
fn entry(name: &str) -> Option<&'static Entry> {
    CATALOGUE.iter().find(|entry| entry.folder == name)
}

fn title(name: &str) -> String {
    entry(name).map_or_else(|| spelled_out(name), |entry| entry.title.clone())
}

/// The figures that an experiment must have, and others that are among its files, with their captions.
fn pictures(name: &str, files: &[String]) -> Vec<(String, String)> {
    let known = entry(name).map_or(&[][..], |entry| &entry.figures).iter();
    let known = known.map(|(stem, caption)| (format!("{stem}.png"), caption.clone()));
    let mut pictures: Vec<(String, String)> = known.collect();
    for file in files {
        let (stem, extension) = stem_and_extension(file);
        if extension == "png" && pictures.iter().all(|(other, _)| other != file) {
            pictures.push((file.clone(), format!("{}.", spelled_out(stem))));
        }
    }
    pictures
}

/// What is there; otherwise a problem more.
fn kept<T>(result: Result<T>, problems: &mut Vec<Error>) -> Option<T> {
    result.map_err(|error| problems.push(error)).ok()
}

/// Names of the files in a folder, or of the folders, without hidden ones, in natural order.
fn entries(folder: &Path, folders: bool) -> Result<Vec<String>> {
    let failed = |source| files::Error::of("read", folder)(source);
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        // Names that are not text are none of ours.
        if let Ok(name) = entry.file_name().into_string()
            && !name.starts_with('.')
            && entry.path().is_dir() == folders
        {
            names.push(name);
        }
    }
    names.sort_by(|a, b| natural(a, b));
    Ok(names)
}

/// A file, with errors that do not say where the page is made.
fn read_bytes(root: &Path, file: &str) -> Result<Vec<u8>> {
    Ok(fs::read(root.join(file)).map_err(files::Error::of("read", file))?)
}

fn read(root: &Path, file: &str) -> Result<String> {
    Ok(String::from_utf8_lossy(&read_bytes(root, file)?).into_owned())
}

fn image(root: &Path, file: &str) -> Result<ImageElement> {
    ImageElement::from_bytes(file, &read_bytes(root, file)?)
}

/// The important facts of a manifest: program, machine, seed, times, parameters.
fn manifest(root: &Path, file: &str) -> Result<Facts> {
    const KEYS: [&str; 12] = [
        "experiment",
        "version",
        "commit",
        "device",
        "backend",
        "dtype",
        "seed",
        "started",
        "wall_seconds",
        "cpus",
        "rustc",
        "target",
    ];
    let failed = |problem: String| Error::Json {
        name: file.to_owned(),
        expected: "the manifest of a run",
        problem,
    };
    let manifest: Value =
        serde_json::from_str(&read(root, file)?).map_err(|error| failed(error.to_string()))?;
    let (Value::String(_), Value::Object(parameters)) =
        (&manifest["experiment"], &manifest["parameters"])
    else {
        return Err(failed("it names no experiment or no parameters".to_owned()));
    };
    let named = KEYS.into_iter().map(|key| (key, &manifest[key]));
    let parameters = parameters.iter().map(|(key, value)| (key.as_str(), value));
    let mut facts = Facts::default();
    for (key, value) in named.chain(parameters) {
        facts = facts.with_value(key, value);
    }
    let phases = manifest["phases"].as_array().into_iter().flatten();
    for phase in phases.take(MOST_PHASES) {
        let name = phase["name"].as_str().unwrap_or_default();
        let seconds = phase["seconds"].as_f64().unwrap_or(f64::NAN);
        facts = facts.with(name, format!("{} s", five_digits(seconds)));
    }
    Ok(facts)
}

/// A Markdown text without the line of its title.
fn without_title(text: &str) -> &str {
    match text.split_once('\n') {
        Some((first, rest)) if first.starts_with("# ") => rest,
        _ => text,
    }
}

fn stem_and_extension(file: &str) -> (&str, &str) {
    file.rsplit_once('.').unwrap_or((file, ""))
}

/// `Error over radius` of `error_over_radius`.
fn spelled_out(name: &str) -> String {
    let text = name.replace(['_', '-'], " ");
    let mut characters = text.chars();
    let first = characters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(characters).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_experiment_is_in_the_catalogue_once() {
        let folders: HashSet<&str> = CATALOGUE.iter().map(|e| e.folder.as_str()).collect();
        assert_eq!(folders.len(), CATALOGUE.len());
        assert!(CATALOGUE.iter().all(|entry| !entry.figures.is_empty()));
        assert_eq!(spelled_out("error_over_radius"), "Error over radius");
    }

    #[test]
    fn parameters_are_flat_and_absent_facts_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let write = |json: &str| fs::write(folder.path().join("m.json"), json).unwrap();
        write(
            r#"{"experiment": "x", "parameters": {"n": [64, 128], "a": {"b": true, "c": null},
            "l": [{"d": "e"}]}, "dtype": "f64", "seed": null, "wall_seconds": 1.5,
            "phases": [{"name": "p", "seconds": 2}]}"#,
        );
        let expected = [
            ("experiment", "x"),
            ("dtype", "f64"),
            ("wall_seconds", "1.5000"),
            ("a: b", "true"),
            ("l[0]: d", "e"),
            ("n", "64, 128"),
            ("p", "2 s"),
        ];
        let expected = expected.map(|(name, value)| (name.to_owned(), value.to_owned()));
        let facts = manifest(folder.path(), "m.json").unwrap();
        assert_eq!(facts.entries, expected);
        for json in ["", "{}", "[]", "{\"experiment\": 3, \"parameters\": {}}"] {
            write(json);
            let message = manifest(folder.path(), "m.json").unwrap_err().to_string();
            assert!(
                message.contains("m.json") && !message.contains('\n'),
                "{message}"
            );
        }
    }
}

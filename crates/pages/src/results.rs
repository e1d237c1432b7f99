//! Pages of results: what the folders of experiments hold, as sections.
//!
//! A folder of an experiment has a `manifest.json` and a `summary.json`, figures (PNG, the same as
//! SVG beside it), numbered pictures (`name_000.png`, `name_001.png`, ...), and tables (Markdown,
//! the same as CSV beside it). [`index_page`] makes one page of all folders, [`run_page`] one of a
//! single folder.

mod catalogue;
mod experiment;
mod manifest;
mod readme;

use std::collections::BTreeSet;
use std::fmt;
use std::fs;
use std::path::Path;

use crate::error::{Error, Result};
use crate::image::Pictures;
use crate::page::Page;
use crate::section::Section;
use crate::text::Text;

use catalogue::CATALOGUE;
use experiment::Experiment;

/// Something that a page lacks because its file is missing or broken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// The file, relative to the folder of the page.
    pub file: String,
    /// What is wrong with it.
    pub problem: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.file, self.problem)
    }
}

impl Problem {
    fn new(file: impl Into<String>, problem: impl Into<String>) -> Self {
        Self {
            file: file.into(),
            problem: problem.into(),
        }
    }

    fn missing(file: impl Into<String>) -> Self {
        Self::new(file, "it is missing")
    }

    /// Without the path of the folder, so that pages are the same wherever they are made.
    fn because(file: impl Into<String>, error: &Error) -> Self {
        let problem = match error {
            Error::Read { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                "it is missing".to_owned()
            }
            Error::Read { source, .. } => format!("it cannot be read: {source}"),
            Error::Picture { problem, .. } => format!("no intact PNG or SVG picture: {problem}"),
            Error::Table { problem, .. } => format!("no table: {problem}"),
            Error::Json {
                expected, problem, ..
            } => format!("not {expected}: {problem}"),
            other => other.to_string(),
        };
        Self::new(file, problem)
    }
}

/// The page of all experiments in a folder, in the paper's order, and what is missing from it. It
/// is to lie in that folder if pictures are linked.
///
/// # Errors
/// [`Error::Read`] if the folder cannot be read. Files are no errors but problems.
pub fn index_page(folder: &Path, pictures: Pictures) -> Result<(Page, Vec<Problem>)> {
    let mut problems = Vec::new();
    let states = match readme::read(&folder.join("README.md")) {
        Ok(states) => states,
        Err(error) => {
            problems.push(Problem::because("README.md", &error));
            readme::States::default()
        }
    };
    let mut found: BTreeSet<String> = folders(folder)?;
    let mut sections = Vec::new();
    for entry in CATALOGUE {
        if !found.remove(entry.folder) {
            problems.push(Problem::missing(entry.folder));
            continue;
        }
        sections
            .push(Experiment::new(folder, entry.folder, pictures).section(&states, &mut problems));
    }
    for name in &found {
        sections.push(Experiment::new(folder, name, pictures).section(&states, &mut problems));
    }
    let mut lead = Text::from(
        "Figures, tables and numbers of all committed runs, in the paper's order. What they show \
         beside the results of Rumpf, Sassen and Smoch is in ",
    );
    lead = match pictures {
        Pictures::Linked => lead.link("README.md", "README.md")?,
        Pictures::Embedded => lead.code("results/README.md"),
    };
    let page = Page::new("Results of the Willmore flow workbench").with_lead(lead.then("."));
    Ok((finished(page, sections, &problems), problems))
}

/// The page of one run, with its pictures inside, and what is missing from it.
///
/// # Errors
/// [`Error::Read`] if the folder cannot be read. Files are no errors but problems.
pub fn run_page(folder: &Path) -> Result<(Page, Vec<Problem>)> {
    folders(folder)?;
    let mut problems = Vec::new();
    let run = Experiment::new(folder, "", Pictures::Embedded);
    let section = run.section(&readme::States::default(), &mut problems);
    let page = Page::new(section.title.clone());
    Ok((
        finished(page, vec![section.retitled("Results")], &problems),
        problems,
    ))
}

fn finished(mut page: Page, sections: Vec<Section>, problems: &[Problem]) -> Page {
    if !problems.is_empty() {
        let items: Vec<Text> = problems
            .iter()
            .map(|p| Text::default().code(&p.file).then(": ").then(&p.problem))
            .collect();
        let section = Section::new("Missing or broken files").named("problems");
        page.push(section.with(items));
    }
    for section in sections {
        page.push(section);
    }
    page
}

/// Names of the folders inside a folder, without hidden ones.
fn folders(folder: &Path) -> Result<BTreeSet<String>> {
    let failed = |source| Error::Read {
        path: folder.into(),
        source,
    };
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name();
        // Names that are not text cannot be linked; nothing here makes such.
        if let Some(name) = name.to_str().filter(|name| !name.starts_with('.'))
            && entry.path().is_dir()
        {
            names.insert(name.to_owned());
        }
    }
    Ok(names)
}

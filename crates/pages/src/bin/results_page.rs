//! Writes `results/index.html`: all figures, tables and numbers of the committed runs on one page.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use pages::results::{Problem, index_page, run_page};
use pages::{Error, Page, Pictures};

/// Makes a page to look at of the folder of all results, or of one run.
///
/// The page of all results refers to the pictures beside it, as it is kept under version control
/// together with them; with --embed, or anywhere else, it has them inside. The page of one run
/// always has them inside: one file that can be mailed.
#[derive(Parser, Debug)]
#[command(name = "results_page", version)]
struct Options {
    /// The folder with a folder for each experiment
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,

    /// Makes a page of this one run instead
    #[arg(long, value_name = "DIR", conflicts_with = "results")]
    run: Option<PathBuf>,

    /// The page [default: index.html in the folder]
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,

    /// Puts the pictures into the page
    #[arg(long)]
    embed: bool,

    /// Ends with exit code 1 if a file is missing or broken
    #[arg(long)]
    strict: bool,
}

fn main() -> ExitCode {
    let options = Options::parse();
    match program(&options) {
        Ok(problems) if options.strict && !problems.is_empty() => ExitCode::from(1),
        Ok(_) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn program(options: &Options) -> Result<Vec<Problem>, Error> {
    let folder = options.run.as_ref().unwrap_or(&options.results);
    let output = options
        .output
        .clone()
        .unwrap_or_else(|| folder.join("index.html"));
    let (page, problems) = made(options, folder, &output)?;
    page.write(&output)?;
    for problem in &problems {
        eprintln!("warning: {problem}");
    }
    println!("{}", output.display());
    Ok(problems)
}

fn made(options: &Options, folder: &Path, output: &Path) -> Result<(Page, Vec<Problem>), Error> {
    if options.run.is_some() {
        return run_page(folder);
    }
    let pictures = if options.embed || !lies_in(output, folder) {
        Pictures::Embedded
    } else {
        Pictures::Linked
    };
    index_page(folder, pictures)
}

/// Whether relative links from the file to what is in the folder are names without detours.
fn lies_in(file: &Path, folder: &Path) -> bool {
    let parent = match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    match (parent.canonicalize(), folder.canonicalize()) {
        (Ok(parent), Ok(folder)) => parent == folder,
        _ => false,
    }
}

//! Writes a page of results: all figures, tables and numbers of a folder of runs, or of one run.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use pages::Error;
use pages::results::{index_page, run_page};

/// Makes a page to look at of the folder of all results, or of one run: one file with everything inside.
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

fn program(options: &Options) -> Result<Vec<Error>, Error> {
    let (folder, (page, problems)) = match &options.run {
        Some(folder) => (folder, run_page(folder)?),
        None => (&options.results, index_page(&options.results)?),
    };
    let output = (options.output.clone()).unwrap_or_else(|| folder.join("index.html"));
    page.write(&output)?;
    for problem in &problems {
        eprintln!("warning: {problem}");
    }
    println!("{}", output.display());
    Ok(problems)
}

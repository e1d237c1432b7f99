//! Writes a page of results: all figures, tables and numbers of a folder of runs.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use pages::Error;
use pages::results::index_page;

/// Makes a page to look at of the folder of all results: one file with everything inside.
#[derive(Parser, Debug)]
#[command(name = "results_page", version)]
struct Options {
    /// The folder with a folder for each experiment
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,

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
    let (page, problems) = index_page(&options.results)?;
    let output = options.output.clone();
    let output = output.unwrap_or_else(|| options.results.join("index.html"));
    page.write(&output)?;
    for problem in &problems {
        eprintln!("warning: {problem}");
    }
    println!("{}", output.display());
    Ok(problems)
}

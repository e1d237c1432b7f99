//! The list of the experiments, and what follows from it.

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use experiments::derived;
use experiments::experiment::Experiment;
use experiments::programs::EXPERIMENTS;

/// Lists the experiments: `cargo run -p experiments --bin NAME` runs one.
#[derive(Parser, Debug)]
#[command(name = "experiments", version)]
struct Options {
    /// Writes the files that follow from the list: executables and their names in Cargo.toml, the catalogue of results, the tables of metrics
    #[arg(long)]
    write: bool,

    /// Lists the results that are made again, cheapest first and the paper's numbers last: folder, experiment and options of each
    #[arg(long, conflicts_with = "write")]
    results: bool,
}

fn main() -> ExitCode {
    match program(&Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", files::with_causes(&*error));
            ExitCode::from(2)
        }
    }
}

fn program(options: &Options) -> experiments::Result<()> {
    let root = derived::root();
    let mut lines = Vec::new();
    if options.write {
        for (path, text) in derived::files(&root, EXPERIMENTS)? {
            if std::fs::read_to_string(&path).is_ok_and(|old| old == text) {
                continue;
            }
            std::fs::write(&path, text).map_err(files::Error::of("write", &path))?;
            lines.push(path.display().to_string());
        }
    } else if options.results {
        lines = derived::runs(&root, EXPERIMENTS);
    } else {
        let names = EXPERIMENTS.iter().map(|experiment| experiment.name.len());
        let width = names.max().unwrap_or(0);
        let line = |one: &&Experiment| format!("{:width$}  {}", one.name, one.summary);
        lines = EXPERIMENTS.iter().map(line).collect();
    }
    lines.push(String::new());
    // A closed pipe (`| head`) is no failure.
    let _ = std::io::stdout().write_all(lines.join("\n").as_bytes());
    Ok(())
}

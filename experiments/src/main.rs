//! The list of the experiments, and what follows from it.

use std::process::ExitCode;

use clap::Parser;
use experiments::derived;
use experiments::programs::EXPERIMENTS;

/// Lists the experiments: `cargo run -p experiments --bin NAME` runs one.
#[derive(Parser, Debug)]
#[command(name = "experiments", version)]
struct Options {
    /// Writes the files that follow from the list: executables and their names in Cargo.toml, the catalogue of results, the tables of metrics
    #[arg(long)]
    write: bool,

    /// Lists the results that are kept, cheapest first: folder, experiment and options of each
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
    if options.write {
        for (path, text) in derived::files(&root, EXPERIMENTS)? {
            if std::fs::read_to_string(&path).is_ok_and(|old| old == text) {
                continue;
            }
            std::fs::write(&path, text).map_err(files::Error::of("write", &path))?;
            println!("{}", path.display());
        }
    } else if options.results {
        for run in derived::runs(&root, EXPERIMENTS) {
            println!("{run}");
        }
    } else {
        let names = EXPERIMENTS.iter().map(|experiment| experiment.name.len());
        let width = names.max().unwrap_or(0);
        for experiment in EXPERIMENTS {
            println!("{:width$}  {}", experiment.name, experiment.summary);
        }
    }
    Ok(())
}

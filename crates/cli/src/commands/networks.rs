//! `willmore networks`.

use std::path::Path;
use std::process::ExitCode;

use model::{Network, Shipped};
use serde_json::{Value, json};

use crate::cli::{NetworksCommand, SayOptions};
use crate::error::Error;

pub fn run(show: Option<&NetworksCommand>, say: SayOptions) -> Result<ExitCode, Error> {
    let shipped = || -> Result<Vec<(String, Network)>, Error> {
        let all = Shipped::Accurate
            .all()?
            .into_iter()
            .chain(Shipped::Paper.all()?);
        Ok(all.map(|(name, network)| (stem(name), network)).collect())
    };
    match show {
        None => {
            let all = shipped()?;
            let lines: Vec<String> = (all.iter())
                .map(|(name, network)| format!("{name:32} {}", network.ratios()))
                .collect();
            let list: Vec<Value> = all
                .iter()
                .map(|(name, network)| about(name, network))
                .collect();
            say.report(&Value::Array(list), &lines.join("\n"));
        }
        Some(NetworksCommand::Show { network: wanted }) => {
            let all = shipped()?;
            let known = all.into_iter().find(|(name, _)| *name == stem(wanted));
            let network = match known {
                Some((_, network)) => network,
                None if Path::new(wanted).exists() => Network::load(Path::new(wanted))?,
                None => {
                    return Err(Error::options(format!(
                        "there is no network {wanted:?}, neither in the list of `willmore networks` nor as a file"
                    )));
                }
            };
            let about = about(&stem(wanted), &network);
            say.report(&about, &format!("{about:#}"));
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn about(name: &str, network: &Network) -> Value {
    json!({
        "name": name,
        "ratios": network.ratios(),
        "layers": network.activation().layers(),
        "provenance": network.provenance(),
        "calibration": network.stored_calibration(),
    })
}

fn stem(name: &str) -> String {
    name.trim_end_matches(".safetensors").to_owned()
}

//! `willmore networks`.

use std::path::Path;

use model::{Network, pretrained};
use serde_json::{Value, json};

use crate::cli::{NetworksCommand, NetworksOptions};
use crate::error::Error;
use crate::run::{self, Ending};
use crate::scales::stem;

/// Lists the networks, or shows one.
///
/// # Errors
/// [`Error::Model`] for a file that is no network; [`Error::Options`] for a name that is none.
pub fn run(options: &NetworksOptions) -> Result<Ending, Error> {
    let shipped = || -> Result<Vec<(String, Network)>, Error> {
        let all = pretrained::all_accurate()?
            .into_iter()
            .chain(pretrained::all()?);
        Ok(all.map(|(name, network)| (stem(name), network)).collect())
    };
    match &options.show {
        None => {
            let all = shipped()?;
            let lines: Vec<String> = (all.iter())
                .map(|(name, network)| format!("{name:32} {}", network.ratios()))
                .collect();
            let list: Vec<Value> = all
                .iter()
                .map(|(name, network)| about(name, network))
                .collect();
            run::report(options.say, &Value::Array(list), &lines.join("\n"));
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
            run::report(options.say, &about, &format!("{about:#}"));
        }
    }
    Ok(Ending::Done)
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

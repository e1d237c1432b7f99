use model::{Network, Shipped};

use crate::cli::{MessageOptions, NetworksCommand};
use crate::prelude::*;

pub fn run(show: Option<&NetworksCommand>, messages: MessageOptions) -> Result<()> {
    let all = [Shipped::Accurate.all()?, Shipped::Paper.all()?].concat();
    let mut all = all.iter().map(|(name, network)| (stem(name), network));
    let Some(NetworksCommand::Show { network: wanted }) = show else {
        let (lines, list): (Vec<String>, Vec<Value>) = all
            .map(|(name, network)| {
                let line = format!("{name:32} {}", network.ratios());
                (line, about(&name, network))
            })
            .unzip();
        messages.report(&Value::Array(list), &lines.join("\n"));
        return Ok(());
    };
    let path = Path::new(wanted);
    let network = match all.find(|(name, _)| *name == stem(wanted)) {
        // With its extension the name is first of all that of a file.
        Some((name, network)) if name == *wanted || !path.exists() => network,
        _ if path.exists() => &Network::load(path)?,
        _ => {
            refuse!(
                "there is no network {wanted:?}, neither in the list of `willmore networks` nor as a file"
            );
        }
    };
    let about = about(&stem(wanted), network);
    messages.report(&about, &format!("{about:#}"));
    Ok(())
}

fn about(name: &str, network: &Network) -> Value {
    json!({
        "name": name,
        "ratios": network.ratios(),
        "layers": network.activation().layers(),
        "provenance": &network.provenance,
        "calibration": network.calibration,
    })
}

fn stem(name: &str) -> String {
    name.trim_end_matches(".safetensors").to_owned()
}

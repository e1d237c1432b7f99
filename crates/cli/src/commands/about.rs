//! What the program says of itself: `willmore info`, `networks`, `completions` and `man`.

use std::fmt::Write as _;
use std::path::Path;

use clap_complete::Shell;
use model::{Network, Shipped};

use operators::{ComputeDevice, DeviceKind};
use serde_json::{Value, json};

use crate::cli::NetworksCommand;
use crate::config::program;
use crate::console::Console;
use crate::error::{Result, refuse};

pub fn info(console: &Console) -> Result<()> {
    let version = env!("CARGO_PKG_VERSION");
    let mut devices = Vec::new();
    let mut text = format!(
        "willmore {version}\nplatform: {} {}",
        std::env::consts::OS,
        std::env::consts::ARCH
    );
    for kind in DeviceKind::ALL {
        let state = match ComputeDevice::open(kind) {
            Ok(device) => format!("works, {:?}", device.dtype()).to_lowercase(),
            Err(error) => error.to_string(),
        };
        let _ = write!(text, "\ndevice {kind}: {state}");
        devices
            .push(json!({ "name": kind.name(), "compiled": kind.is_compiled(), "state": state }));
    }
    let [paper, accurate] = [Shipped::Paper.all()?.len(), Shipped::Accurate.all()?.len()];
    let _ = write!(
        text,
        "\nnetworks: {accurate} accurate, {paper} of the paper's recipe"
    );
    let outcome = json!({
        "version": version,
        "devices": devices,
        "networks": { "accurate": accurate, "paper": paper },
    });
    console.report(&outcome, &text)
}

pub fn networks(show: Option<&NetworksCommand>, console: &Console) -> Result<()> {
    let all = [Shipped::Accurate.all()?, Shipped::Paper.all()?].concat();
    let mut all = all.iter().map(|(name, network)| (stem(name), network));
    let Some(NetworksCommand::Show { network: wanted }) = show else {
        let (lines, list): (Vec<String>, Vec<Value>) = all
            .map(|(name, network)| {
                let line = format!("{name:32} {}", network.ratios());
                (line, about(&name, network))
            })
            .unzip();
        return console.report(&Value::Array(list), &lines.join("\n"));
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
    console.report(&about, &format!("{about:#}"))
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

pub fn completions(shell: Shell, console: &Console) -> Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut program(), "willmore", &mut text);
    console.write(&text)
}

/// Prints the manual page: that of the program, then those of its commands.
pub fn man(console: &Console) -> Result<()> {
    let mut text = Vec::new();
    let mut command = program();
    command.build();
    let pages = std::iter::once(&command).chain(command.get_subcommands());
    for page in pages {
        clap_mangen::Man::new(page.clone())
            .render(&mut text)
            .map_err(files::Error::of("make the manual page of", page.get_name()))?;
    }
    console.write(&text)
}

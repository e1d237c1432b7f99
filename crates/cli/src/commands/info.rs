use std::fmt::Write;

use model::Shipped;

use crate::cli::MessageOptions;
use crate::prelude::*;

pub fn run(messages: MessageOptions) -> Result<()> {
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
    messages.report(&outcome, &text);
    Ok(())
}

//! The subcommands.

pub mod check;
pub mod fair;
pub mod flow;
pub mod info;
pub mod inpaint;
pub mod mcf;
pub mod networks;
pub mod resume;
pub mod sample;
pub mod shell;
pub mod train;

use operators::{ComputeDevice, DeviceKind};

use crate::cli::CommonOptions;
use crate::error::Error;

/// Opens the device and writes its name into the options.
///
/// # Errors
/// [`Error::Operators`] for a name that is unknown, not compiled in, or without hardware.
pub fn open_device(options: &mut CommonOptions) -> Result<ComputeDevice, Error> {
    let device = match &options.device {
        Some(name) => ComputeDevice::open(name.parse::<DeviceKind>()?)?,
        None => ComputeDevice::default_compiled()?,
    };
    options.device = Some(device.kind().name().to_owned());
    Ok(device)
}

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

use engine::{Operator, Storage};
use model::Networks;

use crate::cli::{CommonOptions, SchemeOptions};
use crate::prelude::*;

/// Opens the device and writes its name into the options.
pub fn open_device(options: &mut CommonOptions) -> Result<ComputeDevice, Error> {
    let device = match &options.device {
        Some(name) => ComputeDevice::open(name.parse::<DeviceKind>()?)?,
        None => ComputeDevice::default_compiled()?,
    };
    options.device = Some(device.kind().name().to_owned());
    Ok(device)
}

pub fn check_eps_over_h(eps_over_h: f64) -> Result<(), Error> {
    if (0.5..=64.0).contains(&eps_over_h) {
        return Ok(());
    }
    Err(Error::options(format!(
        "--eps-over-h {eps_over_h} is not possible: an interface is from 0.5 to 64 cells wide"
    )))
}

pub fn operator<const D: usize>(
    options: &SchemeOptions,
    method: Method,
    grid: &Grid<D>,
) -> Result<(Scales, Operator), Error> {
    let scales = Scales::of_grid(grid.spacing(), options.eps_over_h());
    let needed = scales.needs(D, grid.spacing());
    let networks = Networks::load(options.network.as_slice(), &[needed])?;
    let scheme = if method.is_learned() {
        options.scheme
    } else {
        Scheme::Paper
    };
    let mut operator = Operator::new((method, scheme), &networks, &needed, grid, &scales)?;
    operator.storage = options.storage.unwrap_or(Storage::Auto);
    Ok((scales, operator))
}

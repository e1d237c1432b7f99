//! The device and the operator that options choose.

use engine::{Operator, Storage};
use model::{Network, Networks};

use crate::cli::{CommonOptions, SchemeOptions};
use crate::paths::absolute;
use crate::prelude::*;

/// Refuses widths of the interface, in cells, that no grid resolves.
pub fn check_eps_over_h(eps_over_h: f64) -> Result<()> {
    if !(0.5..=64.0).contains(&eps_over_h) {
        refuse!(
            "--eps-over-h {eps_over_h} is not possible: an interface is from 0.5 to 64 cells wide"
        );
    }
    Ok(())
}

impl CommonOptions {
    /// Opens the device and notes its name.
    pub fn open_device(&mut self) -> Result<ComputeDevice> {
        let device = ComputeDevice::named(self.device.as_deref())?;
        self.device = Some(device.kind().name().to_owned());
        Ok(device)
    }
}

impl SchemeOptions {
    /// Interface width in cells.
    pub fn eps_over_h(&self) -> f64 {
        self.eps_over_h.unwrap_or(2.0)
    }

    /// Takes the width of the interface from the network, unless it is given.
    pub fn fill_in(&mut self) -> Result<()> {
        if let Some(network) = &mut self.network {
            *network = absolute(&*network)?;
        }
        if let (None, Some(path)) = (self.eps_over_h, &self.network) {
            self.eps_over_h = Some(Network::load(path)?.ratios().eps_over_h);
        }
        self.eps_over_h = Some(self.eps_over_h());
        check_eps_over_h(self.eps_over_h())
    }

    /// The step of mean curvature flow on a grid.
    pub fn operator<const D: usize>(
        &self,
        method: Method,
        grid: &Grid<D>,
    ) -> Result<(Scales, Operator)> {
        let scales = Scales::of_grid(grid.spacing(), self.eps_over_h());
        let needed = scales.needs(D, grid.spacing());
        let networks = Networks::load(self.network.as_slice(), &[needed])?;
        let scheme = if method.is_learned() {
            self.scheme
        } else {
            Scheme::Paper
        };
        let mut operator = Operator::new((method, scheme), &networks, &needed, grid, &scales)?;
        operator.storage = self.storage.unwrap_or(Storage::Auto);
        Ok((scales, operator))
    }
}

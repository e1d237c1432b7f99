//! Options that name networks.

use std::path::PathBuf;

use clap::Args;
use engine::{NeededNetwork, Networks, Scheme};
use model::Ratios;

use crate::Error;
use crate::circles::{EPS, STEP};

/// Options for programs that use trained networks.
#[derive(Args, Clone, Debug, Default)]
pub struct NetworkOptions {
    /// Use this safetensors file in place of the shipped network of the paper's recipe with its ratios; can be repeated
    #[arg(long, value_name = "FILE")]
    pub network: Vec<PathBuf>,
}

impl NetworkOptions {
    /// Where the networks of the paper's and the calibrated scheme come from.
    ///
    /// # Errors
    /// [`Error::Engine`] if a file is no network or meets none of the needs.
    pub fn load(&self, needs: &[NeededNetwork]) -> Result<Chosen, Error> {
        Ok(Chosen(Networks::load(&self.network, needs)?))
    }
}

/// The user's networks in place of those of the paper's recipe, before the shipped ones.
#[derive(Clone, Debug, Default)]
pub struct Chosen(Networks);

impl Chosen {
    /// Where the network of a scheme comes from; that of the accurate recipe is always the shipped one.
    pub fn of(&self, scheme: Scheme) -> Networks {
        match scheme {
            Scheme::Accurate => Networks::default(),
            Scheme::Paper | Scheme::Calibrated => self.0.clone(),
        }
    }
}

/// The paper's kernel width `n/8 + 1`.
pub fn kernel_width(cells_per_unit: usize) -> usize {
    cells_per_unit / 8 + 1
}

/// The network of the convergence tests, `eps = 2^-6` and `tautilde = 2^-14`, in 2D at resolution `n`.
///
/// # Errors
/// [`Error::Options`] unless `n` is a multiple of 16, [`Error::Model`] if the scheme does not allow the ratios.
pub fn convergence_network(cells_per_unit: usize) -> Result<NeededNetwork, Error> {
    if cells_per_unit == 0 || !cells_per_unit.is_multiple_of(16) {
        return Err(Error::Options(format!(
            "n = {cells_per_unit} is not possible: the kernel width n/8 + 1 must be odd, so n must be a multiple of 16"
        )));
    }
    let width = kernel_width(cells_per_unit);
    let ratios = Ratios::of_run(2, width, 1.0 / cells_per_unit as f64, EPS, STEP);
    ratios.validate()?;
    Ok(NeededNetwork::exactly(ratios))
}

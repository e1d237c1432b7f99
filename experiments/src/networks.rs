//! Which network serves which run.

use std::path::PathBuf;

use clap::Args;
use model::{Error as ModelError, Network, Ratios, pretrained};
use sha2::{Digest, Sha256};

use crate::Error;
use crate::circles::{EPS, STEP};

/// Options for programs that use trained networks.
#[derive(Args, Clone, Debug, Default)]
pub struct NetworkOptions {
    /// Use this safetensors file in place of the shipped network with its ratios; can be repeated
    #[arg(long, value_name = "FILE")]
    pub network: Vec<PathBuf>,
}

impl NetworkOptions {
    /// The network for each of these ratios, from the files where one fits, else the shipped one.
    ///
    /// # Errors
    /// [`Error::Model`] if a file is no network or fits none of the ratios, or if no network has them.
    pub fn find(&self, wanted: &[Ratios]) -> Result<Vec<Network>, Error> {
        let files = self
            .network
            .iter()
            .map(|path| Network::load(path))
            .collect::<Result<Vec<_>, _>>()?;
        for file in &files {
            let fits = |run: &Ratios| file.ratios().matches(run);
            if !wanted.iter().any(fits) {
                // The run that is most like the network makes the most helpful message.
                let nearest = wanted
                    .iter()
                    .max_by_key(|run| similarity(&file.ratios(), run));
                return Err(nearest.map_or_else(
                    || Error::Options("no run needs a network".to_owned()),
                    |&run| {
                        Error::Model(ModelError::Mismatch {
                            network: file.ratios(),
                            run,
                        })
                    },
                ));
            }
        }
        wanted
            .iter()
            .map(|run| {
                let own = files.iter().rev().find(|file| file.ratios().matches(run));
                Ok(match own {
                    Some(network) => network.clone(),
                    None => pretrained::find(*run)?,
                })
            })
            .collect()
    }
}

fn similarity(a: &Ratios, b: &Ratios) -> usize {
    usize::from(a.dimension == b.dimension) + usize::from(a.width == b.width)
}

/// The paper's kernel width `n/8 + 1`.
pub fn kernel_width(cells_per_unit: usize) -> usize {
    cells_per_unit / 8 + 1
}

/// Ratios of the convergence tests, `eps = 2^-6` and `tautilde = 2^-14`, in 2D at resolution `n`.
///
/// # Errors
/// [`Error::Options`] unless `n` is a multiple of 16, [`Error::Model`] if the scheme does not allow the ratios.
pub fn convergence_ratios(cells_per_unit: usize) -> Result<Ratios, Error> {
    if cells_per_unit == 0 || !cells_per_unit.is_multiple_of(16) {
        return Err(Error::Options(format!(
            "n = {cells_per_unit} is not possible: the kernel width n/8 + 1 must be odd, so n must be a multiple of 16"
        )));
    }
    let width = kernel_width(cells_per_unit);
    let ratios = Ratios::of_run(2, width, 1.0 / cells_per_unit as f64, EPS, STEP);
    ratios.validate()?;
    Ok(ratios)
}

/// SHA-256 of the numbers of a network, in hexadecimal: two networks with the same act alike.
pub fn checksum(network: &Network) -> String {
    let mut hash = Sha256::new();
    hash.update(network.ratios().to_string());
    for width in network.activation().layers() {
        hash.update(width.to_le_bytes());
    }
    for value in network
        .kernel()
        .iter()
        .chain(network.activation().parameters())
    {
        hash.update(value.to_le_bytes());
    }
    hexadecimal(&hash.finalize())
}

/// Bytes as text.
pub fn hexadecimal(bytes: &[u8]) -> String {
    (bytes.iter()).fold(String::with_capacity(2 * bytes.len()), |text, byte| {
        format!("{text}{byte:02x}")
    })
}

//! The networks that ship with the library.

use std::path::Path;

use crate::{Error, Network, Ratios};

macro_rules! shipped {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../networks/", $name)))),*]
    };
}

/// File names and contents of the networks of the paper's recipe. `train_networks` in the experiments package makes these files.
const PAPER: &[(&str, &[u8])] = shipped![
    "d2_k17_eps2_step1.safetensors",
    "d2_k33_eps4_step4.safetensors",
    "d2_k65_eps8_step16.safetensors",
    "d2_k129_eps16_step64.safetensors",
    "d2_k17_eps4_step4.safetensors",
    "d3_k17_eps2_step1.safetensors",
];

/// File names and contents of the networks of the accurate recipe.
const ACCURATE: &[(&str, &[u8])] = shipped![
    "accurate_d2_k9_eps1_step0.25.safetensors",
    "accurate_d2_k17_eps2_step1.safetensors",
    "accurate_d2_k33_eps4_step4.safetensors",
    "accurate_d2_k65_eps8_step16.safetensors",
    "accurate_d2_k129_eps16_step64.safetensors",
    "accurate_d2_k17_eps4_step4.safetensors",
    "accurate_d3_k17_eps2_step1.safetensors",
];

impl Ratios {
    /// The name under which a network of the paper's recipe with these ratios is shipped.
    pub fn file_name(self) -> String {
        let (dimension, width) = (self.dimension, self.width);
        let (eps, step) = (self.eps_over_h, self.step_over_h2);
        format!("d{dimension}_k{width}_eps{eps}_step{step}.safetensors")
    }
}

/// The networks of a recipe that ship with the library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shipped {
    /// The paper's recipe.
    Paper,
    /// The accurate recipe ([`crate::training::least_squares`]), whose activations are odd.
    Accurate,
}

impl Shipped {
    /// All shipped networks of the recipe with their file names.
    ///
    /// # Errors
    /// [`Error::Weights`] if a file in the program is damaged.
    pub fn all(self) -> Result<Vec<(&'static str, Network)>, Error> {
        let files = match self {
            Self::Paper => PAPER,
            Self::Accurate => ACCURATE,
        };
        files
            .iter()
            .map(|(name, data)| Ok((*name, Network::from_bytes(data, Path::new(name))?)))
            .collect()
    }

    /// Name of the recipe in messages.
    pub(crate) fn recipe(self) -> &'static str {
        match self {
            Self::Paper => "paper's",
            Self::Accurate => "accurate",
        }
    }
}

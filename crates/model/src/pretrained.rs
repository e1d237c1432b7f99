//! The networks that ship with the library.

use std::path::Path;

use crate::{Error, Network, Ratios};

macro_rules! shipped {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../networks/", $name)))),*]
    };
}

/// File names and contents. `train_networks` in the experiments package makes these files.
const SHIPPED: &[(&str, &[u8])] = shipped![
    "d2_k17_eps2_step1.safetensors",
    "d2_k33_eps4_step4.safetensors",
    "d2_k65_eps8_step16.safetensors",
    "d2_k17_eps4_step4.safetensors",
    "d3_k17_eps2_step1.safetensors",
];

/// Those of the accurate recipe.
const ACCURATE: &[(&str, &[u8])] = shipped![
    "accurate_d2_k9_eps1_step0.25.safetensors",
    "accurate_d2_k17_eps2_step1.safetensors",
    "accurate_d2_k33_eps4_step4.safetensors",
    "accurate_d2_k65_eps8_step16.safetensors",
    "accurate_d2_k17_eps4_step4.safetensors",
    "accurate_d3_k17_eps2_step1.safetensors",
];

/// The name under which a network with these ratios is shipped.
pub fn file_name(ratios: Ratios) -> String {
    let Ratios {
        dimension,
        width,
        eps_over_h,
        step_over_h2,
    } = ratios;
    format!("d{dimension}_k{width}_eps{eps_over_h}_step{step_over_h2}.safetensors")
}

/// All shipped networks of the paper's recipe with their file names.
///
/// # Errors
/// [`Error::Weights`] if a file in the program is damaged.
pub fn all() -> Result<Vec<(&'static str, Network)>, Error> {
    read(SHIPPED)
}

/// All shipped networks of the accurate recipe ([`crate::training::least_squares`]) with their file names.
///
/// # Errors
/// [`Error::Weights`] if a file in the program is damaged.
pub fn all_accurate() -> Result<Vec<(&'static str, Network)>, Error> {
    read(ACCURATE)
}

/// The shipped network of the paper's recipe with these ratios.
///
/// # Errors
/// [`Error::NotFound`] naming the ratios wanted and those available.
pub fn find(wanted: Ratios) -> Result<Network, Error> {
    one_of(all()?, wanted)
}

/// The shipped network of the accurate recipe with these ratios; its activation is odd.
///
/// # Errors
/// [`Error::NotFound`] naming the ratios wanted and those available.
pub fn find_accurate(wanted: Ratios) -> Result<Network, Error> {
    one_of(all_accurate()?, wanted)
}

fn read(files: &[(&'static str, &[u8])]) -> Result<Vec<(&'static str, Network)>, Error> {
    files
        .iter()
        .map(|(name, data)| Ok((*name, Network::from_bytes(data, Path::new(name))?)))
        .collect()
}

fn one_of(all: Vec<(&'static str, Network)>, wanted: Ratios) -> Result<Network, Error> {
    let available: Vec<String> = all
        .iter()
        .map(|(_, n)| format!("({})", n.ratios()))
        .collect();
    all.into_iter()
        .map(|(_, network)| network)
        .find(|network| network.ratios().matches(&wanted))
        .ok_or_else(|| Error::NotFound {
            wanted: wanted.to_string(),
            available: available.join(", "),
        })
}

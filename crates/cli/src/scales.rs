//! Which operator serves which grid.

use fem::FiniteElementStep;
use geometry::Grid;
use model::{Factors, Network, Ratios, pretrained};
use runs::{NetworkName, fingerprint};
use solver::{FlowParams, NewtonParams};

use crate::cli::{Scheme, SchemeOptions};
use crate::error::Error;

/// No network fits.
#[derive(Debug, thiserror::Error)]
#[error(
    "no network of the {scheme} recipe for {wanted}; there are {available}. Choose one of these by --eps-over-h, or train one: \
     willmore train --dimension {} --width {} --eps-over-h {} --step-over-h2 {} --save FILE.safetensors, and give it by --network",
    wanted.dimension, wanted.width, wanted.eps_over_h, wanted.step_over_h2
)]
pub struct MissingNetwork {
    scheme: &'static str,
    wanted: Ratios,
    available: String,
}

/// `tautilde / h^2` for an interface width in cells: a quarter of `eps^2`, as in the paper.
pub fn step_over_h2(eps_over_h: f64) -> f64 {
    0.25 * eps_over_h * eps_over_h
}

/// The ratios that a run needs, with the width that a network made for it would have.
pub fn wanted(dimension: usize, eps_over_h: f64) -> Ratios {
    Ratios {
        dimension,
        width: 8 * eps_over_h.clamp(1.0, 64.0).ceil() as usize + 1,
        eps_over_h,
        step_over_h2: step_over_h2(eps_over_h),
    }
}

/// The operator of a run.
pub struct Operator {
    /// The network.
    pub network: Network,
    /// Its name and checksum.
    pub name: NetworkName,
    /// What the energy is divided by.
    pub factors: Factors,
}

/// The scales of a grid of spacing `h`, with the paper's energy.
pub fn params(h: f64, eps_over_h: f64) -> FlowParams {
    FlowParams {
        eps: eps_over_h * h,
        mcf_step: step_over_h2(eps_over_h) * h * h,
        newton: NewtonParams::default(),
        calibration: Factors::PAPER,
    }
}

/// Refuses widths that make no sense.
///
/// # Errors
/// [`Error::Options`].
pub fn check_eps_over_h(eps_over_h: f64) -> Result<(), Error> {
    if (0.5..=64.0).contains(&eps_over_h) {
        return Ok(());
    }
    Err(Error::options(format!(
        "--eps-over-h {eps_over_h} is not possible: an interface is from 0.5 to 64 cells wide"
    )))
}

/// The network and the factors of a scheme.
///
/// # Errors
/// [`MissingNetwork`] naming the ratios, [`Error::Model`] for a file that is no network or does not fit.
pub fn operator(dimension: usize, options: &SchemeOptions) -> Result<Operator, Error> {
    let wanted = wanted(dimension, options.eps_over_h);
    let (name, network) = match &options.network {
        Some(path) => {
            let network = Network::load(path)?;
            network.check_fits(Ratios {
                width: network.ratios().width,
                ..wanted
            })?;
            let name = path.file_stem().unwrap_or(path.as_os_str());
            (name.to_string_lossy().into_owned(), network)
        }
        None => shipped(options.scheme, wanted)?,
    };
    let factors = match options.scheme {
        Scheme::Paper => Factors::PAPER,
        Scheme::Accurate | Scheme::Calibrated => network.calibration()?.factors,
    };
    let name = NetworkName {
        name,
        checksum: fingerprint(network.to_bytes()?),
    };
    // The odd part has the same factors to first order in its difference to the whole.
    let network = match options.scheme {
        Scheme::Calibrated => network.odd_part(),
        Scheme::Accurate | Scheme::Paper => network,
    };
    Ok(Operator {
        network,
        name,
        factors,
    })
}

/// The widest network that comes with the program and has these ratios.
fn shipped(scheme: Scheme, wanted: Ratios) -> Result<(String, Network), Error> {
    let (recipe, all) = match scheme {
        Scheme::Accurate => ("accurate", pretrained::all_accurate()?),
        Scheme::Calibrated | Scheme::Paper => ("paper's", pretrained::all()?),
    };
    let fits = |network: &Network| {
        let ratios = network.ratios();
        ratios.matches(&Ratios {
            width: ratios.width,
            ..wanted
        })
    };
    let mut available: Vec<f64> = (all.iter().map(|(_, network)| network.ratios()))
        .filter(|ratios| ratios.dimension == wanted.dimension)
        .map(|ratios| ratios.eps_over_h)
        .collect();
    available.sort_by(f64::total_cmp);
    available.dedup();
    let available: Vec<String> = available
        .iter()
        .map(|eps| format!("eps/h = {eps}"))
        .collect();
    all.into_iter()
        .filter(|(_, network)| fits(network))
        .max_by_key(|(_, network)| network.ratios().width)
        .map(|(name, network)| (stem(name), network))
        .ok_or_else(|| {
            MissingNetwork {
                scheme: recipe,
                wanted,
                available: available.join(", "),
            }
            .into()
        })
}

/// The name of a network's file without its extension.
pub fn stem(name: &str) -> String {
    name.trim_end_matches(".safetensors").to_owned()
}

/// The finite-element step of a grid.
///
/// # Errors
/// [`Error::Fem`].
pub fn elements<const D: usize>(
    implicit: bool,
    grid: &Grid<D>,
    params: &FlowParams,
) -> Result<FiniteElementStep<D>, Error> {
    let (eps, step) = (params.eps, params.mcf_step);
    Ok(if implicit {
        FiniteElementStep::implicit(grid, eps, step)?
    } else {
        FiniteElementStep::semi_implicit(grid, eps, step)?
    })
}

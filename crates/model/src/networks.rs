//! The choice of the network for a run.

use std::path::Path;

use serde::Serialize;

use crate::{Error, Network, Ratios, Shipped};

/// The ratios that a network must have.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NeededNetwork {
    /// Dimension of space, 2 or 3.
    pub dimension: usize,
    /// Width of the kernel in cells; none if it does not matter.
    pub width: Option<usize>,
    /// Interface width in cells.
    pub eps_over_h: f64,
    /// `tautilde / h^2`.
    pub step_over_h2: f64,
}

impl NeededNetwork {
    /// The need for exactly these ratios.
    pub fn exactly(ratios: Ratios) -> Self {
        Self {
            dimension: ratios.dimension,
            width: Some(ratios.width),
            eps_over_h: ratios.eps_over_h,
            step_over_h2: ratios.step_over_h2,
        }
    }

    /// With the width that is wanted, or else another.
    fn ratios(&self, other: usize) -> Ratios {
        Ratios {
            dimension: self.dimension,
            width: self.width.unwrap_or(other),
            eps_over_h: self.eps_over_h,
            step_over_h2: self.step_over_h2,
        }
    }

    fn is_met_by(&self, network: &Network) -> bool {
        let own = network.ratios();
        own.matches(&self.ratios(own.width))
    }
}

/// A network and its name.
#[derive(Clone, Debug)]
pub struct NamedNetwork {
    /// Name of its file without the extension.
    pub name: String,
    /// The network.
    pub network: Network,
}

/// Where networks come from: files that the user names, before those that are shipped.
#[derive(Clone, Debug, Default)]
pub struct Networks {
    files: Vec<NamedNetwork>,
}

impl Networks {
    /// The networks in these files.
    ///
    /// # Errors
    /// [`Error::File`], [`Error::Weights`]; [`Error::Mismatch`] for a file that meets none of the needs, [`Error::NetworkNotNeeded`] if there
    /// are none.
    pub fn load(paths: &[impl AsRef<Path>], needs: &[NeededNetwork]) -> Result<Self, Error> {
        let mut files = Vec::new();
        for path in paths.iter().map(AsRef::as_ref) {
            let network = Network::load(path)?;
            if !needs.iter().any(|need| need.is_met_by(&network)) {
                let own = network.ratios();
                let alike = |need: &&NeededNetwork| {
                    let width = need.width.unwrap_or(own.width);
                    usize::from(need.dimension == own.dimension) + usize::from(width == own.width)
                };
                // The need that is most like the network makes the most helpful message.
                let nearest = (needs.iter().max_by_key(alike)).ok_or(Error::NetworkNotNeeded)?;
                let run = nearest.ratios(own.width);
                return Err(Error::Mismatch { network: own, run });
            }
            files.push(NamedNetwork {
                name: stem(path),
                network,
            });
        }
        Ok(Self { files })
    }

    /// The network of the last file that meets the need, else the widest shipped one.
    ///
    /// # Errors
    /// [`Error::MissingNetwork`] naming the ratios and those available.
    pub fn find(&self, shipped: Shipped, needed: &NeededNetwork) -> Result<NamedNetwork, Error> {
        let fits = |network: &Network| needed.is_met_by(network);
        if let Some(own) = self.files.iter().rev().find(|file| fits(&file.network)) {
            return Ok(own.clone());
        }
        let all = shipped.all()?;
        let best = (all.iter())
            .filter(|(_, network)| fits(network))
            .max_by_key(|(_, network)| network.ratios().width);
        if let Some((name, network)) = best {
            return Ok(NamedNetwork {
                name: stem(Path::new(name)),
                network: network.clone(),
            });
        }
        let ratios = all.iter().map(|(_, network)| network.ratios());
        let list: Vec<String> = ratios
            .filter(|ratios| ratios.dimension == needed.dimension)
            .map(|ratios| ratios.to_string())
            .collect();
        let usual = 8 * needed.eps_over_h.clamp(1.0, 64.0).ceil() as usize + 1;
        Err(Error::MissingNetwork {
            recipe: shipped.recipe(),
            wanted: needed.ratios(usual),
            available: list.join("; "),
        })
    }
}

impl Shipped {
    /// The shipped network with these ratios.
    ///
    /// # Errors
    /// [`Error::MissingNetwork`] naming the ratios wanted and those available.
    pub fn find(self, wanted: Ratios) -> Result<Network, Error> {
        let named = Networks::default().find(self, &NeededNetwork::exactly(wanted))?;
        Ok(named.network)
    }
}

fn stem(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    stem.to_string_lossy().into_owned()
}

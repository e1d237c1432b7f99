//! What has to be the same for a run to be resumed.

use std::fmt;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::Error;
use crate::error::one_line;

/// What is computed, on which grid, with which network and options, and by which program. A run is
/// resumed only where all but the program agree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// Kind of the run, for example the name of the experiment.
    pub kind: String,
    /// Name and version of the program. Recorded only: the caller knows whether its versions give the
    /// same bits.
    pub program: String,
    /// The grid that the arrays live on.
    pub grid: GridShape,
    /// The network, if one is used.
    pub network: Option<NetworkName>,
    /// Fingerprint of all options that influence the result (see [`fingerprint`](crate::fingerprint)).
    pub options: String,
}

/// A grid as far as it must agree. All numbers must be finite.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridShape {
    /// Cells along each axis.
    pub cells: Vec<u64>,
    /// Length of a side.
    pub side: f64,
    /// First node.
    pub origin: Vec<f64>,
}

/// A network as far as it must agree.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkName {
    /// Its name.
    pub name: String,
    /// Checksum of its file.
    pub checksum: String,
}

impl Identity {
    /// Accepts what was stored at `path` only if it is the same as what is `expected` now.
    ///
    /// # Errors
    /// [`Error::Mismatch`] with the first difference and both values.
    pub fn require(&self, expected: &Self, path: &Path) -> Result<(), Error> {
        let options = |options: &str| format!("fingerprint {options}");
        let network = |network: &Option<NetworkName>| match network {
            None => "none".to_owned(),
            Some(network) => network.to_string(),
        };
        let differs = |what, found: String, expected: String| {
            Err(Error::Mismatch {
                path: path.into(),
                what,
                found: one_line(found),
                expected: one_line(expected),
            })
        };
        if self.kind != expected.kind {
            let quoted = |kind: &str| format!("{kind:?}");
            return differs("kind of run", quoted(&self.kind), quoted(&expected.kind));
        }
        if self.grid != expected.grid {
            return differs("grid", self.grid.to_string(), expected.grid.to_string());
        }
        if self.network != expected.network {
            let (found, expected) = (network(&self.network), network(&expected.network));
            return differs("network", found, expected);
        }
        if self.options != expected.options {
            let (found, expected) = (options(&self.options), options(&expected.options));
            return differs("set of options", found, expected);
        }
        Ok(())
    }
}

impl fmt::Display for GridShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            cells,
            side,
            origin,
        } = self;
        write!(f, "{cells:?} cells on a side of {side} from {origin:?}")
    }
}

impl fmt::Display for NetworkName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} with checksum {}", self.name, self.checksum)
    }
}

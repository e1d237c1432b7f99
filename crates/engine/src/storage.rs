//! What of a phase field is stored, and how much memory that takes.

use std::fmt;

use operators::memory;
use serde::{Deserialize, Serialize};

use crate::Error;

/// What of a phase field is stored and worked on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Storage {
    /// Bricks near the surface where the flow can have them and they are less than half of the grid
    Auto,
    /// The whole grid
    #[default]
    Dense,
    /// Bricks near the surface ([`solver::WillmoreFlow::on_bricks`])
    Bricks,
}

/// Bytes that a flow takes for each node of a grid that is stored as a whole, measured at 128 and 192 cells;
const PER_NODE: f64 = 300.0;
/// on bricks for each stored cell and, for the phase fields before and after a step, for each node, by the armadillo at 128 and 256 cells.
const ON_BRICKS: [f64; 2] = [220.0, 24.0];

impl Storage {
    /// Whether it is the usual one.
    pub(crate) fn is_dense(self) -> bool {
        self == Self::Dense
    }

    /// About how many bytes a flow takes on a grid of so many nodes of which so many are stored.
    pub fn bytes(nodes: usize, stored: usize) -> f64 {
        let [per_cell, per_node] = if stored < nodes {
            ON_BRICKS
        } else {
            [0.0, PER_NODE]
        };
        per_cell * stored as f64 + per_node * nodes as f64
    }

    /// Refuses a flow on a grid of `cells^dimension` nodes, of which so many are stored, for which the memory is too small.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub(crate) fn check(cells: usize, dimension: u32, stored: usize) -> Result<(), Error> {
        let needed = Self::bytes(cells.pow(dimension), stored);
        match memory::available() {
            Some(available) if needed > available => {
                let fitting =
                    cells as f64 * (available / needed).powf(f64::from(dimension).recip());
                Err(Error::Memory {
                    cells,
                    needed: needed * 1e-9,
                    available: available * 1e-9,
                    fitting: fitting as usize / 8 * 8,
                })
            }
            _ => Ok(()),
        }
    }
}

impl fmt::Display for Storage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Dense => "dense",
            Self::Bricks => "bricks",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_into_memory_is_refused_with_what_does() {
        assert!(Storage::check(64, 3, 64 * 64 * 64).is_ok());
        // Ten thousand cells a side take 300 TB, which no machine has.
        let error = Storage::check(10_000, 3, 1_000_000_000_000);
        let Err(Error::Memory {
            needed,
            available,
            fitting,
            ..
        }) = error
        else {
            assert!(memory::available().is_none());
            return;
        };
        assert!((needed - 300e3).abs() < 1.0);
        assert!(fitting > 64 && Storage::bytes(fitting.pow(3), fitting.pow(3)) <= available * 1e9);
        // On bricks a thousandth of that is stored.
        assert!(Storage::bytes(1 << 27, 1 << 23) < Storage::bytes(1 << 27, 1 << 27) / 4.0);
    }
}

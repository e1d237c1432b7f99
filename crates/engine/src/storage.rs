//! What of a phase field is stored.

use serde::{Deserialize, Serialize};

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

impl Storage {
    /// Whether it is the usual one.
    pub(crate) fn is_dense(self) -> bool {
        self == Self::Dense
    }
}

//! The flows.

use derive_more::Display;
use serde::{Deserialize, Serialize};

/// The geometric flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Display, Serialize, Deserialize)]
#[display(rename_all = "snake_case")]
#[serde(rename_all = "snake_case")]
pub enum Flow {
    /// Mean curvature flow.
    #[display("mcf")]
    #[serde(rename = "mcf")]
    MeanCurvature,
    /// Willmore flow.
    Willmore,
}

impl Flow {
    /// Both flows.
    pub const ALL: [Self; 2] = [Self::MeanCurvature, Self::Willmore];

    /// Name in titles.
    pub fn title(self) -> &'static str {
        match self {
            Self::MeanCurvature => "Mean curvature flow",
            Self::Willmore => "Willmore flow",
        }
    }
}

//! Jobs that make runs.

use crate::options::{FairOptions, FlowOptions, InpaintOptions, McfOptions, RunOptions};
use crate::prelude::*;

/// A job that makes a run, with its options.
#[derive(Serialize, Clone, Debug)]
#[serde(untagged)]
pub enum Job {
    /// Willmore flow.
    Flow(FlowOptions),
    /// Noise is taken off a mesh, or a segmentation becomes a smooth mesh.
    Fair(FairOptions),
    /// A region is filled smoothly.
    Inpaint(InpaintOptions),
    /// Mean curvature flow.
    Mcf(McfOptions),
}

impl Job {
    /// Its name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Flow(_) => "flow",
            Self::Fair(_) => "fair",
            Self::Inpaint(_) => "inpaint",
            Self::Mcf(_) => "mcf",
        }
    }

    /// The options that all jobs have.
    pub fn options(&mut self) -> &mut RunOptions {
        match self {
            Self::Flow(flow) => &mut flow.run,
            Self::Fair(fair) => &mut fair.flow.run,
            Self::Inpaint(inpaint) => &mut inpaint.flow.run,
            Self::Mcf(mcf) => &mut mcf.run,
        }
    }

    /// The options of Willmore flow; mean curvature flow has no energy and no controlled steps.
    pub(crate) fn willmore(&mut self) -> Option<&mut FlowOptions> {
        match self {
            Self::Flow(flow) => Some(flow),
            Self::Fair(fair) => Some(&mut fair.flow),
            Self::Inpaint(inpaint) => Some(&mut inpaint.flow),
            Self::Mcf(_) => None,
        }
    }
}

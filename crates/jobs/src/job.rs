//! Jobs that make runs.

use crate::named::options_of;
use crate::options::{
    CommonOptions, FairOptions, FlowOptions, InpaintOptions, InputOptions, McfOptions,
    OperatorOptions, RunOptions, WillmoreOptions,
};
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

/// The groups of options that jobs share.
pub(crate) struct Groups<'a> {
    /// Mean curvature flow has no energy and no controlled steps.
    pub willmore: Option<&'a mut WillmoreOptions>,
    pub input: &'a mut InputOptions,
    pub operator: &'a mut OperatorOptions,
    pub run: &'a mut RunOptions,
    pub common: &'a mut CommonOptions,
}

impl Job {
    /// The job of this name with options by their names, without an input, as [`options_of`](crate::options_of) reads them.
    ///
    /// # Errors
    /// [`Error::NoJob`], [`Error::Named`]
    pub fn of_named<'a>(
        name: &str,
        named: impl IntoIterator<Item = (&'a str, Option<String>)>,
    ) -> Result<Self> {
        match name {
            "flow" => options_of(named).map(Self::Flow),
            "fair" => options_of(named).map(Self::Fair),
            "inpaint" => options_of(named).map(Self::Inpaint),
            "mcf" => options_of(named).map(Self::Mcf),
            _ => Err(Error::NoJob(name.to_owned())),
        }
    }

    /// Its name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Flow(_) => "flow",
            Self::Fair(_) => "fair",
            Self::Inpaint(_) => "inpaint",
            Self::Mcf(_) => "mcf",
        }
    }

    /// The options of Willmore flow; mean curvature flow has none.
    pub fn willmore(&mut self) -> Option<&mut WillmoreOptions> {
        self.groups().willmore
    }

    /// The options of its input.
    pub fn input(&mut self) -> &mut InputOptions {
        self.groups().input
    }

    /// The options of its operator.
    pub fn operator(&mut self) -> &mut OperatorOptions {
        self.groups().operator
    }

    /// The options of its run.
    pub fn run(&mut self) -> &mut RunOptions {
        self.groups().run
    }

    /// Where it computes.
    pub fn common(&mut self) -> &mut CommonOptions {
        self.groups().common
    }

    pub(crate) fn groups(&mut self) -> Groups<'_> {
        match self {
            Self::Flow(flow) => Groups {
                willmore: Some(&mut flow.willmore),
                input: &mut flow.input,
                operator: &mut flow.operator,
                run: &mut flow.run,
                common: &mut flow.common,
            },
            Self::Fair(fair) => Groups {
                willmore: Some(&mut fair.willmore),
                input: &mut fair.input,
                operator: &mut fair.operator,
                run: &mut fair.run,
                common: &mut fair.common,
            },
            Self::Inpaint(inpaint) => Groups {
                willmore: Some(&mut inpaint.willmore),
                input: &mut inpaint.input,
                operator: &mut inpaint.operator,
                run: &mut inpaint.run,
                common: &mut inpaint.common,
            },
            Self::Mcf(mcf) => Groups {
                willmore: None,
                input: &mut mcf.input,
                operator: &mut mcf.operator,
                run: &mut mcf.run,
                common: &mut mcf.common,
            },
        }
    }
}

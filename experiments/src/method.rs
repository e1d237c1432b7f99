//! The methods that the paper compares: one step of mean curvature flow each, alone or inside the Willmore scheme.

use clap::ValueEnum;
use fem::{FiniteElementStep, LinearSolver};
use geometry::{Field, Grid};
use model::{Network, pretrained};
use operators::ComputeDevice;
use serde::{Deserialize, Serialize};
use solver::{Factors, FlowParams, MeanCurvatureFlow, WillmoreFlow};

use crate::Error;
use crate::circles::Flow;
use crate::networks::kernel_width;

/// How mean curvature flow is approximated; a line style in figures.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[value(rename_all = "snake_case")]
pub enum Method {
    /// The learned operator
    Hybrid,
    /// Implicit finite elements (Franken, Rumpf and Wirth)
    FeImplicit,
    /// Semi-implicit finite elements
    FeSemi,
}

/// How the energy of a time step of Willmore flow is weighted.
#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scheme {
    /// As in the paper
    #[default]
    Paper,
    /// Divided by the step's calibration factors; a learned operator with its odd part, which treats both phases alike
    Calibrated,
    /// Calibrated, with the operator of the accurate recipe in place of the paper's
    Accurate,
}

impl Scheme {
    /// All schemes.
    pub const ALL: [Self; 3] = [Self::Paper, Self::Calibrated, Self::Accurate];
}

/// The methods in their schemes that are shown, in the order of legends.
pub fn variants(
    shown: impl Fn((Method, Scheme)) -> bool,
) -> impl Iterator<Item = (Method, Scheme)> {
    let all = Method::ALL
        .into_iter()
        .flat_map(|method| Scheme::ALL.map(|scheme| (method, scheme)));
    all.filter(move |&variant| shown(variant))
}

impl Method {
    /// All methods, in the order of legends.
    pub const ALL: [Self; 3] = [Self::Hybrid, Self::FeImplicit, Self::FeSemi];

    /// Name in files and metrics.
    pub fn key(self) -> &'static str {
        match self {
            Self::Hybrid => "hybrid",
            Self::FeImplicit => "fe_implicit",
            Self::FeSemi => "fe_semi",
        }
    }

    /// Name in legends.
    pub fn label(self) -> &'static str {
        match self {
            Self::Hybrid => "learned operator",
            Self::FeImplicit => "FE implicit",
            Self::FeSemi => "FE semi-implicit",
        }
    }

    /// The schemes that make a difference for a flow with this method: the weights of the energy do not matter to mean
    /// curvature flow, and only operators are learned.
    pub fn schemes(self, flow: Flow) -> &'static [Scheme] {
        match (flow, self.is_learned()) {
            (Flow::Willmore, true) => &Scheme::ALL,
            (Flow::Willmore, false) => &[Scheme::Paper, Scheme::Calibrated],
            (Flow::MeanCurvature, true) => &[Scheme::Paper, Scheme::Accurate],
            (Flow::MeanCurvature, false) => &[Scheme::Paper],
        }
    }

    /// Of these, the wanted one, or the paper's where that makes no difference; all if none is wanted.
    pub fn chosen_schemes(self, flow: Flow, wanted: Option<Scheme>) -> Vec<Scheme> {
        let available = self.schemes(flow);
        match wanted {
            None => available.to_vec(),
            Some(wanted) if available.contains(&wanted) => vec![wanted],
            Some(_) => vec![Scheme::Paper],
        }
    }

    /// The operator and the factors of a scheme, from the network of the paper's recipe.
    ///
    /// # Errors
    /// [`Error::Options`] if the learned operator is asked for without a network; [`Error::Model`] if a step cannot be
    /// calibrated, or if no accurate network has the ratios.
    pub fn prepare<const D: usize>(
        self,
        scheme: Scheme,
        network: Option<&Network>,
        grid: &Grid<D>,
        params: &FlowParams,
    ) -> Result<(Option<Network>, Factors), Error> {
        Ok(match (self, scheme) {
            (Self::Hybrid, Scheme::Paper) => (Some(needed(network)?.clone()), Factors::PAPER),
            // The odd part has the same factors to first order in its difference to the whole.
            (Self::Hybrid, Scheme::Calibrated) => {
                let network = needed(network)?;
                (Some(network.odd_part()), network.calibration()?.factors)
            }
            (Self::Hybrid, Scheme::Accurate) => {
                let cells_per_unit = grid.spacing().recip().round() as usize;
                let width = network.map_or(kernel_width(cells_per_unit), |n| n.ratios().width);
                let accurate = pretrained::find_accurate(params.ratios(grid, width))?;
                let factors = accurate.calibration()?.factors;
                (Some(accurate), factors)
            }
            (_, Scheme::Paper) => (None, Factors::PAPER),
            (_, Scheme::Calibrated | Scheme::Accurate) => {
                let step = self.elements(grid, params, LinearSolver::default())?;
                (None, step.calibrate()?.factors)
            }
        })
    }

    /// Name in files and metrics in a scheme.
    pub fn key_in(self, scheme: Scheme) -> String {
        match scheme {
            Scheme::Paper => self.key().to_owned(),
            Scheme::Calibrated => format!("{}_calibrated", self.key()),
            Scheme::Accurate => format!("{}_accurate", self.key()),
        }
    }

    /// Name in legends in a scheme.
    pub fn label_in(self, scheme: Scheme) -> String {
        match scheme {
            Scheme::Paper => self.label().to_owned(),
            Scheme::Calibrated => format!("{}, calibrated", self.label()),
            Scheme::Accurate => "accurate operator, calibrated".to_owned(),
        }
    }

    /// Colour in figures in a scheme, an entry of the palette.
    pub fn colour_in(self, scheme: Scheme) -> usize {
        match (self, scheme) {
            (Self::Hybrid, Scheme::Paper) => 0,
            (Self::Hybrid, Scheme::Calibrated) => 5,
            (Self::Hybrid, Scheme::Accurate) => 2,
            (Self::FeImplicit, Scheme::Paper) => 1,
            (Self::FeImplicit, _) => 4,
            (Self::FeSemi, Scheme::Paper) => 3,
            (Self::FeSemi, _) => 6,
        }
    }

    /// Whether the method needs a trained network.
    pub fn is_learned(self) -> bool {
        self == Self::Hybrid
    }

    /// The finite-element step of a grid.
    fn elements<const D: usize>(
        self,
        grid: &Grid<D>,
        params: &FlowParams,
        linear: LinearSolver,
    ) -> Result<FiniteElementStep<D>, Error> {
        let (eps, step) = (params.eps, params.mcf_step);
        Ok(match self {
            Self::FeSemi => FiniteElementStep::semi_implicit(grid, eps, step)?,
            Self::FeImplicit | Self::Hybrid => {
                FiniteElementStep::implicit_with(grid, eps, step, linear)?
            }
        })
    }

    /// Mean curvature flow by this method with time step `params.mcf_step`.
    ///
    /// # Errors
    /// [`Error::Options`] if the learned operator is asked for without a network; what the flow raises.
    pub fn mean_curvature_flow<const D: usize>(
        self,
        network: Option<&Network>,
        initial: &Field<D>,
        params: &FlowParams,
        device: &ComputeDevice,
    ) -> Result<MeanCurvatureFlow<D>, Error> {
        Ok(match self {
            Self::Hybrid => {
                MeanCurvatureFlow::with_network(needed(network)?, initial, params, device)?
            }
            Self::FeImplicit | Self::FeSemi => {
                let step = self.elements(initial.grid(), params, LinearSolver::default())?;
                MeanCurvatureFlow::new(step, initial, device)?
            }
        })
    }

    /// Willmore flow with this method inside; by the learned operator its steps begin on the half grid where networks for that
    /// are shipped.
    ///
    /// # Errors
    /// As [`Self::mean_curvature_flow`].
    pub fn willmore_flow<const D: usize>(
        self,
        network: Option<&Network>,
        initial: &Field<D>,
        params: FlowParams,
        linear: LinearSolver,
        device: &ComputeDevice,
    ) -> Result<WillmoreFlow<D>, Error> {
        Ok(match self {
            Self::Hybrid => {
                let network = needed(network)?;
                let mut flow = WillmoreFlow::with_network(network, initial, params, device)?;
                flow.begin_on_half_grids(network)?;
                flow
            }
            Self::FeImplicit | Self::FeSemi => {
                let step = self.elements(initial.grid(), &params, linear)?;
                WillmoreFlow::new(step, initial, params, device)?
            }
        })
    }
}

fn needed(network: Option<&Network>) -> Result<&Network, Error> {
    network.ok_or_else(|| {
        Error::Options("the learned operator needs a network with the ratios of the run".to_owned())
    })
}

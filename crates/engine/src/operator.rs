//! The step of mean curvature flow inside a flow, and the weights of its energy.

use std::sync::Arc;

use derive_more::Display;
use fem::{FiniteElementStep, LinearSolver};
use geometry::Grid;
use mean_curvature::{Calibration, Factors, MeanCurvatureStep};
use model::{NamedNetwork, NeededNetwork, Networks, Shipped};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use solver::NewtonParams;

use crate::{Error, Flow, Storage};

/// How a step of mean curvature flow is approximated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Display, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[display(rename_all = "snake_case")]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The learned operator
    #[cfg_attr(feature = "clap", value(name = "network", alias = "hybrid"))]
    Hybrid,
    /// Implicit finite elements (Franken, Rumpf and Wirth)
    #[cfg_attr(feature = "clap", value(alias = "fe_implicit"))]
    FeImplicit,
    /// Semi-implicit finite elements
    #[cfg_attr(feature = "clap", value(alias = "fe_semi"))]
    FeSemi,
    /// A step of one's own ([`Operator::own`])
    #[cfg_attr(feature = "clap", value(skip))]
    Own,
}

/// How a time step of Willmore flow is formulated: the weights of its energy, and the recipe of the network inside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Display, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[cfg_attr(feature = "clap", value(rename_all = "snake_case"))]
#[display(rename_all = "snake_case")]
#[serde(rename_all = "snake_case")]
pub enum Formulation {
    /// Calibrated, with the most accurate network in place of the paper's network
    Accurate,
    /// Calibrated; a learned operator `V[u]` is replaced by its odd part `(V[u] - V[-u]) / 2`, which treats both phases alike
    Calibrated,
    /// As in the paper, without calibration
    #[default]
    Paper,
}

impl Formulation {
    /// All formulations, in the order of legends.
    pub const ALL: [Self; 3] = [Self::Paper, Self::Calibrated, Self::Accurate];

    /// The recipe of the shipped networks that this formulation uses.
    pub fn shipped(self) -> Shipped {
        match self {
            Self::Paper | Self::Calibrated => Shipped::Paper,
            Self::Accurate => Shipped::Accurate,
        }
    }
}

impl Method {
    /// All methods of the library, in the order of legends.
    pub const ALL: [Self; 3] = [Self::Hybrid, Self::FeImplicit, Self::FeSemi];

    /// Name in legends.
    pub fn label(self) -> &'static str {
        match self {
            Self::Hybrid => "learned operator",
            Self::FeImplicit => "FE implicit",
            Self::FeSemi => "FE semi-implicit",
            Self::Own => "own operator",
        }
    }

    /// Whether the method needs a trained network.
    pub fn is_learned(self) -> bool {
        self == Self::Hybrid
    }

    /// The formulations that make a difference for a flow with this method: mean curvature flow has no energy to be weighted, and
    /// only operators are learned.
    pub fn formulations(self, flow: Flow) -> &'static [Formulation] {
        match (flow, self.is_learned()) {
            (Flow::Willmore, true) => &Formulation::ALL,
            (Flow::Willmore, false) => &[Formulation::Paper, Formulation::Calibrated],
            (Flow::MeanCurvature, true) => &[Formulation::Paper, Formulation::Accurate],
            (Flow::MeanCurvature, false) => &[Formulation::Paper],
        }
    }

    /// Of these, the wanted one, or the paper's where that makes no difference; all if none is wanted.
    pub fn chosen_formulations(self, flow: Flow, wanted: Option<Formulation>) -> Vec<Formulation> {
        let available = self.formulations(flow);
        match wanted {
            None => available.to_vec(),
            Some(wanted) if available.contains(&wanted) => vec![wanted],
            Some(_) => vec![Formulation::Paper],
        }
    }
}

/// How a flow becomes discrete: the step of mean curvature flow inside, and the formulation of a time step with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Discretization {
    /// How a step of mean curvature flow is approximated.
    pub method: Method,
    /// How a time step is formulated.
    #[serde(rename = "scheme")]
    pub formulation: Formulation,
}

impl Discretization {
    /// A method in a formulation.
    pub const fn new(method: Method, formulation: Formulation) -> Self {
        Self {
            method,
            formulation,
        }
    }

    /// Name in files and metrics.
    pub fn key(self) -> String {
        match self.formulation {
            Formulation::Paper => self.method.to_string(),
            formulation => format!("{}_{formulation}", self.method),
        }
    }

    /// Name in legends.
    pub fn label(self) -> String {
        match self.formulation {
            Formulation::Paper => self.method.label().to_owned(),
            Formulation::Calibrated => format!("{}, calibrated", self.method.label()),
            Formulation::Accurate => "accurate operator, calibrated".to_owned(),
        }
    }
}

/// The lengths that a phase field and its flow depend on, and the settings of the minimization.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scales {
    /// Interface width `eps`.
    pub eps: f64,
    /// Inner time step `tautilde` of mean curvature flow.
    pub mcf_step: f64,
    /// Settings of the minimization.
    pub newton: NewtonParams,
}

impl Scales {
    /// The scales of a grid of spacing `h`: `eps` in cells, and `tautilde = eps^2 / 4` as in all of the paper's experiments.
    pub fn of_grid(h: f64, eps_over_h: f64) -> Self {
        Self {
            eps: eps_over_h * h,
            mcf_step: quarter_square(eps_over_h) * h * h,
            newton: NewtonParams::default(),
        }
    }

    /// The network that fits a grid of spacing `h` in `dimension` dimensions, of any kernel width.
    pub fn needs(&self, dimension: usize, h: f64) -> NeededNetwork {
        NeededNetwork {
            dimension,
            width: None,
            eps_over_h: self.eps / h,
            step_over_h2: self.mcf_step / (h * h),
        }
    }
}

/// `tautilde / h^2` for an interface width in cells: `(eps/h)^2 / 4`.
pub fn quarter_square(eps_over_h: f64) -> f64 {
    0.25 * eps_over_h * eps_over_h
}

/// The step of mean curvature flow of a case, with the weights of its energy.
#[derive(Clone, derive_more::Debug)]
pub struct Operator<const D: usize> {
    /// Its method and formulation.
    pub discretization: Discretization,
    /// The calibration factors by which the terms of the energy are divided.
    pub factors: Factors,
    /// The response of the step to curvature ([`mean_curvature::Calibration::response`]); 1 in the paper's formulation.
    pub response: f64,
    /// How the linear systems of implicit finite elements are solved.
    pub linear: LinearSolver,
    /// Whether steps of a learned operator begin on coarser grids where networks for those are shipped. The result differs by less
    /// than the tolerance of the minimization.
    pub half_grids: bool,
    /// What of the phase field is stored in Willmore flow with a learned operator.
    pub storage: Storage,
    network: Option<Arc<NamedNetwork>>,
    #[debug("{:?}", own.as_ref().map(|own| own.identity()))]
    own: Option<Arc<dyn MeanCurvatureStep<D>>>,
}

impl<const D: usize> Operator<D> {
    fn plain(discretization: Discretization) -> Self {
        Self {
            discretization,
            factors: Factors::PAPER,
            response: 1.0,
            linear: LinearSolver::default(),
            half_grids: false,
            storage: Storage::default(),
            network: None,
            own: None,
        }
    }

    /// A learned operator with the network that [`Networks::find`] has for the formulation: the calibrated one takes its odd part.
    ///
    /// # Errors
    /// [`Error::Model`] if the step cannot be calibrated.
    pub fn learned(formulation: Formulation, mut named: NamedNetwork) -> Result<Self, Error> {
        let mut operator = Self::plain(Discretization::new(Method::Hybrid, formulation));
        if formulation != Formulation::Paper {
            operator.calibrate(&named.network.calibration()?);
        }
        if formulation == Formulation::Calibrated {
            // The odd part has the same factors to first order in its difference to the whole.
            named.network = named.network.odd_part();
        }
        operator.half_grids = true;
        operator.network = Some(Arc::new(named));
        Ok(operator)
    }

    /// A step of one's own on the whole grid of a case, with its calibration in the calibrated formulation ([`MeanCurvatureStep::calibrate`]).
    pub fn own(
        step: impl MeanCurvatureStep<D> + 'static,
        calibration: Option<&Calibration>,
    ) -> Self {
        Self::shared(Arc::new(step), calibration)
    }

    /// The same with a step that is shared.
    pub fn shared(step: Arc<dyn MeanCurvatureStep<D>>, calibration: Option<&Calibration>) -> Self {
        let formulation = calibration.map_or(Formulation::Paper, |_| Formulation::Calibrated);
        let mut operator = Self::plain(Discretization::new(Method::Own, formulation));
        if let Some(calibration) = calibration {
            operator.calibrate(calibration);
        }
        operator.own = Some(step);
        operator
    }

    /// Finite elements on grids like this one.
    ///
    /// # Errors
    /// [`Error::Fem`] if the scales do not fit the grid, [`Error::MeanCurvature`] if the step cannot be calibrated.
    ///
    /// # Panics
    /// If the method is another one.
    pub fn finite_elements(
        discretization: Discretization,
        grid: &Grid<D>,
        scales: &Scales,
    ) -> Result<Self, Error> {
        let elements = [Method::FeImplicit, Method::FeSemi];
        assert!(
            elements.contains(&discretization.method),
            "finite elements are implicit or semi-implicit"
        );
        let mut operator = Self::plain(discretization);
        if discretization.formulation != Formulation::Paper {
            operator.calibrate(&operator.elements(grid, scales)?.calibrate()?);
        }
        Ok(operator)
    }

    fn calibrate(&mut self, calibration: &Calibration) {
        (self.factors, self.response) = (calibration.factors, calibration.response());
    }

    /// The operator of a discretization: [`Self::learned`] with the network that meets the need, or [`Self::finite_elements`].
    pub fn new(
        discretization: Discretization,
        networks: &Networks,
        needed: &NeededNetwork,
        grid: &Grid<D>,
        scales: &Scales,
    ) -> Result<Self, Error> {
        let Discretization {
            method,
            formulation,
        } = discretization;
        if method.is_learned() {
            Self::learned(formulation, networks.find(formulation.shipped(), needed)?)
        } else {
            Self::finite_elements(discretization, grid, scales)
        }
    }

    /// The network, if the operator is learned.
    pub fn network(&self) -> Option<&NamedNetwork> {
        self.network.as_deref()
    }

    /// The step of one's own, if it is one.
    pub fn own_step(&self) -> Option<&Arc<dyn MeanCurvatureStep<D>>> {
        self.own.as_ref()
    }

    /// Name in legends.
    pub fn label(&self) -> String {
        match &self.own {
            Some(own) => own.identity().name,
            None => self.discretization.label(),
        }
    }

    /// Name in files and metrics.
    pub fn key(&self) -> String {
        self.discretization.key()
    }

    /// What a result depends on, for the identity of a case.
    pub(crate) fn identity(&self) -> Value {
        let network = |named: &NamedNetwork| json!([named.name, named.network.fingerprint()]);
        let mut identity = json!({
            "method": self.discretization.method,
            "scheme": self.discretization.formulation,
            "factors": self.factors,
            "half_grids": self.half_grids,
            "network": self.network().map(network),
        });
        if self.linear != LinearSolver::default() {
            identity["linear"] = json!(format!("{:?}", self.linear));
        }
        if let Some(own) = &self.own {
            identity["own"] = json!(own.identity());
        }
        if self.storage != Storage::Dense {
            identity["storage"] = json!(self.storage);
        }
        identity
    }

    pub(crate) fn elements(
        &self,
        grid: &Grid<D>,
        scales: &Scales,
    ) -> Result<FiniteElementStep<D>, Error> {
        let (eps, step) = (scales.eps, scales.mcf_step);
        Ok(match self.discretization.method {
            Method::FeSemi => FiniteElementStep::semi_implicit(grid, eps, step)?,
            Method::FeImplicit | Method::Hybrid | Method::Own => {
                FiniteElementStep::implicit_with(grid, eps, step, self.linear)?
            }
        })
    }
}

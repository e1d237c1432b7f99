//! The operator on a device, as a Burn graph.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::Nodes;
use mean_curvature::{
    Calibration, Coarser, Factors, Identity, MeanCurvatureStep, PhaseInverse, PhaseInverses,
    StepFailure, StepScales,
};
use operators::{
    COEFFICIENTS, ComputeDevice, SpectralFilter, TableRange, circular_convolution, spectral_filter,
    tabulated,
};
use serde_json::json;

use crate::separable::SeparableOperator;
use crate::{Error, Network, Ratios, Shipped};

/// `V[u] = F(K * u)` in `D` dimensions, ready to be applied, differentiated or captured.
///
/// `F` is the quintic Hermite table of the network's activation, so that `F`, `F'` and `F''` belong to one function. Cheap to clone.
///
/// As a [step](MeanCurvatureStep) it works on bricks if its kernel is separable, and on half grids as far as networks are shipped.
#[derive(Clone, Debug)]
pub struct MeanCurvatureOperator<const D: usize> {
    network: Arc<Network>,
    device: ComputeDevice,
    kernel: Tensor<D>,
    table: Tensor<2>,
    range: TableRange,
    slope: f64,
    /// The same on bricks, or why it is not.
    separable: Result<SeparableOperator<D>, Arc<Error>>,
}

impl<const D: usize> MeanCurvatureOperator<D> {
    /// Uploads a network.
    ///
    /// # Errors
    /// [`Error::Shape`] if the network is of another dimension; as [`Network::table`].
    pub fn new(network: &Network, device: &ComputeDevice) -> Result<Self, Error> {
        let ratios = network.ratios_in(D)?;
        let table = network.table()?;
        let (range, mass) = (table.range(), network.mass());
        let coefficients = device.tensor(table.coefficients(), [range.cells, COEFFICIENTS]);
        let network = Arc::new(network.clone());
        let separable =
            SeparableOperator::with_table(network.clone(), &table, &coefficients, device);
        Ok(Self {
            device: device.clone(),
            kernel: device.tensor(network.kernel(), [ratios.width; D]),
            table: coefficients,
            range,
            separable: separable.map_err(Arc::new),
            slope: 0.5 * (table.derivative(mass, 1) + table.derivative(-mass, 1)),
            network,
        })
    }

    /// `V[u]`, on the device of `u` (which may be Burn's capture device), differentiable in `u`.
    pub fn apply(&self, u: Tensor<D>) -> Tensor<D> {
        let device = u.device();
        let kernel = self.kernel.clone().to_device(&device);
        let table = self.table.clone().to_device(&device);
        let smoothed = circular_convolution(u, kernel, false);
        tabulated(smoothed, table, self.range, 0)
    }

    /// The inverse of the energy's Hessian in the pure phases, `1 / (1 + c |1 - F'(m) k|^2)` with `k` the kernel's
    /// transfer function, `m` its value for constants and `c = tau / tautilde^2`: the preconditioner of a minimizing-movement step.
    pub fn phase_preconditioner(&self, cells: usize, stiffness: f64) -> SpectralFilter {
        let (slope, width) = (self.slope, self.network.ratios().width);
        SpectralFilter::from_kernel(&[cells; D], self.network.kernel(), width, |k| {
            let defect = 1.0 - k.scale(slope);
            1.0 / (1.0 + stiffness * defect.norm_sqr())
        })
    }

    /// Refuses a grid that the kernel does not fit on.
    ///
    /// # Errors
    /// [`Error::KernelTooWide`].
    pub fn check_grid(&self, cells: usize) -> Result<(), Error> {
        let width = self.network.ratios().width;
        if width > cells {
            return Err(Error::KernelTooWide { width, cells });
        }
        Ok(())
    }

    /// The network for the half grid: of the paper's recipe if this is one of its networks (or the odd part of one) or the energy is the
    /// paper's, else of the accurate recipe, since the relaxed profiles of one recipe are alike on all grids. None if none is shipped.
    fn halved(&self, factors: Factors) -> Result<Option<Halved>, Error> {
        /// Below this many cells per `eps` the motion is too far off to be of use.
        const COARSEST: f64 = 2.0;
        let own = self.network.ratios();
        let Some(ratios) = halved(own).filter(|r| r.eps_over_h >= COARSEST) else {
            return Ok(None);
        };
        let papers_energy = factors == Factors::PAPER;
        let papers_recipe = papers_energy
            || Shipped::Paper
                .find(own)
                .is_ok_and(|n| n.kernel() == self.network.kernel());
        let shipped = if papers_recipe {
            Shipped::Paper
        } else {
            Shipped::Accurate
        };
        let Ok(network) = shipped.find(ratios) else {
            return Ok(None);
        };
        if papers_energy {
            return Ok(Some(Halved { network, factors }));
        }
        let factors = network.calibration()?.factors;
        let network = if papers_recipe {
            network.odd_part()
        } else {
            network
        };
        Ok(Some(Halved { network, factors }))
    }
}

/// The network for a half grid, and its factors in a flow.
struct Halved {
    network: Network,
    factors: Factors,
}

/// The ratios of a network for the half grid, with a kernel that reaches equally far.
fn halved(ratios: Ratios) -> Option<Ratios> {
    let reach = (ratios.width - 1) / 2;
    reach.is_multiple_of(2).then_some(Ratios {
        width: reach + 1,
        eps_over_h: 0.5 * ratios.eps_over_h,
        step_over_h2: 0.25 * ratios.step_over_h2,
        ..ratios
    })
}

/// What tells a learned operator from others.
pub(crate) fn identity(network: &Network) -> Identity {
    Identity::new(
        "the learned operator",
        json!({ "network": network.fingerprint() }),
    )
}

impl<const D: usize> MeanCurvatureStep<D> for MeanCurvatureOperator<D> {
    fn apply(&self, u: Tensor<D>) -> Tensor<D> {
        MeanCurvatureOperator::apply(self, u)
    }

    fn identity(&self) -> Identity {
        identity(&self.network)
    }

    fn allows_single_precision(&self) -> bool {
        true
    }

    /// # Errors
    /// [`Error::Mismatch`] for other ratios, [`Error::KernelTooWide`].
    fn check(&self, scales: &StepScales) -> Result<(), StepFailure> {
        let StepScales {
            cells,
            spacing,
            eps,
            mcf_step,
        } = *scales;
        let width = self.network.ratios().width;
        (self.network).check_fits(Ratios::of_run(D, width, spacing, eps, mcf_step))?;
        Ok(self.check_grid(cells)?)
    }

    /// Known where the kernel is separable; near those of all others are -1 and 1.
    fn phase_values(&self) -> [f64; 2] {
        (self.separable.as_ref()).map_or([-1.0, 1.0], SeparableOperator::phase_values)
    }

    fn brick_side(&self) -> Option<usize> {
        let side = SeparableOperator::brick_side;
        self.separable.as_ref().ok().map(side)
    }

    fn on(&self, nodes: &Nodes<D>) -> Result<Arc<dyn MeanCurvatureStep<D>>, StepFailure> {
        match nodes.bricks() {
            None => {
                self.check_grid(nodes.grid().cells())?;
                Ok(Arc::new(self.clone()))
            }
            Some(bricks) => {
                let separable = self.separable.as_ref().map_err(Arc::clone)?;
                Ok(Arc::new(separable.on(bricks, &self.device)))
            }
        }
    }

    fn coarser(&self, factors: Factors) -> Result<Option<Coarser<D>>, StepFailure> {
        let Some(Halved { network, factors }) = self.halved(factors)? else {
            return Ok(None);
        };
        let step = Arc::new(Self::new(&network, &self.device)?);
        Ok(Some(Coarser { step, factors }))
    }

    fn phase_inverses(
        &self,
        nodes: &Nodes<D>,
        device: &ComputeDevice,
    ) -> Result<PhaseInverses<D>, StepFailure> {
        if nodes.bricks().is_some() {
            return self.on(nodes)?.phase_inverses(nodes, device);
        }
        let (step, cells) = (self.clone(), nodes.grid().cells());
        Ok(Arc::new(move |stiffness| {
            let inverse = step.phase_preconditioner(cells, stiffness);
            Arc::new(move |r: &Tensor<D>| spectral_filter(r.clone(), &inverse)) as PhaseInverse<D>
        }))
    }

    /// That of the network, which is stored with its weights.
    fn calibrate(
        &self,
        _scales: &StepScales,
        _device: &ComputeDevice,
    ) -> Result<Calibration, StepFailure> {
        Ok(self.network.calibration()?)
    }
}

//! The learned operator on the whole grid and on bricks.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::Nodes;
use model::{Factors, MeanCurvatureOperator, Network, Ratios, SeparableOperator, Shipped};
use operators::ComputeDevice;

use crate::error::StepFailure;
use crate::{Coarser, MeanCurvatureStep, PhaseInverse};

/// Temporary, until the operator itself is all of that.
pub struct LearnedStep<const D: usize> {
    network: Network,
    device: ComputeDevice,
    dense: MeanCurvatureOperator<D>,
    separable: Option<SeparableOperator<D>>,
}

impl<const D: usize> LearnedStep<D> {
    /// Uploads a network.
    pub fn new(network: &Network, device: &ComputeDevice) -> Result<Self, model::Error> {
        Ok(Self {
            network: network.clone(),
            device: device.clone(),
            dense: MeanCurvatureOperator::new(network, device)?,
            separable: SeparableOperator::new(network, device).ok(),
        })
    }
}

impl<const D: usize> MeanCurvatureStep<D> for LearnedStep<D> {
    fn apply(&self, u: Tensor<D>) -> Tensor<D> {
        self.dense.apply(u)
    }

    fn allows_single_precision(&self) -> bool {
        true
    }

    fn phase_preconditioner(&self, cells: usize, stiffness: f64) -> PhaseInverse<D> {
        MeanCurvatureStep::phase_preconditioner(&self.dense, cells, stiffness)
    }

    fn rests(&self) -> [f64; 2] {
        self.separable
            .as_ref()
            .map_or([-1.0, 1.0], SeparableOperator::rests)
    }

    fn brick_side(&self) -> Option<usize> {
        self.separable.as_ref().map(SeparableOperator::brick_side)
    }

    fn on(&self, nodes: &Nodes<D>) -> Result<Arc<dyn MeanCurvatureStep<D>>, StepFailure> {
        let separable = self.separable.as_ref().expect("asked before");
        Ok(Arc::new(
            separable.on(nodes.bricks().expect("bricks"), &self.device),
        ))
    }

    fn coarser(&self, factors: Factors) -> Result<Option<Coarser<D>>, StepFailure> {
        /// Below this many cells per `eps` the motion is too far off to be of use.
        const COARSEST: f64 = 2.0;
        let ratios = halved(self.network.ratios()).filter(|r| r.eps_over_h >= COARSEST);
        let Some(ratios) = ratios else {
            return Ok(None);
        };
        let papers_energy = factors == Factors::PAPER;
        let papers_recipe = papers_energy
            || Shipped::Paper
                .find(self.network.ratios())
                .is_ok_and(|n| n.kernel() == self.network.kernel());
        let shipped = if papers_recipe {
            Shipped::Paper
        } else {
            Shipped::Accurate
        };
        let Ok(mut network) = shipped.find(ratios) else {
            return Ok(None);
        };
        let mut own = factors;
        if !papers_energy {
            own = network.calibration()?.factors;
            if papers_recipe {
                network = network.odd_part();
            }
        }
        Ok(Some(Coarser {
            step: Arc::new(Self::new(&network, &self.device)?),
            factors: own,
        }))
    }
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

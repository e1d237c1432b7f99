//! Where the minimization of a time step begins.

use burn::tensor::{Slice, Tensor};
use geometry::{Field, Grid, NodeSet, require};
use mean_curvature::{Coarser, MeanCurvatureStep};
use model::{MeanCurvatureOperator, Network};
use operators::extrapolate;
use serde::{Deserialize, Serialize};

use super::{WillmoreFlow, download};
use crate::Error;

/// The origin of a start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StartKind {
    /// The phase field itself.
    #[default]
    Rest,
    /// The last motion, continued.
    Extrapolated,
    /// The motion that the same step makes on the grid of half as many cells.
    HalfGrid,
}

/// Where the minimization of a time step began, and what that cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Its origin.
    pub kind: StartKind,
    /// Hessian-vector products on coarser grids, each counted by its share of this grid's unknowns.
    pub hvp: f64,
}

impl<const D: usize> WillmoreFlow<D> {
    /// Begins every following step with the motion that `half`, a flow on the grid of every other node, makes in that step. A
    /// step that `half` cannot make begins as if it were not there. The results differ by less than the tolerance of the
    /// minimization, which still decides on this grid; only the way to them gets shorter.
    ///
    /// `half` may itself begin on its half grid. Its state does not matter: it is set anew in every step.
    ///
    /// # Errors
    /// [`Error::Geometry`] if its grid is not the half of this one, or for another `eps` or `tautilde`.
    pub fn begin_on(&mut self, half: Self) -> Result<(), Error> {
        if self.active.is_some() || half.active.is_some() {
            let what = "starts on half grids";
            return Err(Error::NeedsGrid { what });
        }
        self.grid.half()?.same_as(&half.grid)?;
        for (name, own, other) in [
            ("eps of the half grid", self.params.eps, half.params.eps),
            (
                "tautilde of the half grid",
                self.params.mcf_step,
                half.params.mcf_step,
            ),
        ] {
            let expected = "that of the flow, which begins there";
            require(name, other, expected, |other| {
                other.to_bits() == own.to_bits()
            })?;
        }
        self.half = Some(Box::new(half));
        let nodes = self.region.as_ref().map(|region| region.nodes.clone());
        nodes.map_or(Ok(()), |nodes| self.restrict_half(&nodes))
    }

    /// Restricts the flow on the half grid to a region's nodes there; where it has none, steps do not begin there.
    pub(super) fn restrict_half(&mut self, nodes: &NodeSet) -> Result<(), Error> {
        if let Some(mut half) = self.half.take() {
            let coarser = every_other_node(self.grid, nodes);
            if !coarser.is_empty() {
                half.restrict_to(&coarser)?;
                self.half = Some(half);
            }
        }
        Ok(())
    }

    /// [Begins](Self::begin_on) on the half grid, that on its half, and so on, as far as networks are shipped: those of the paper's
    /// recipe if the network is one of them (or its odd part) or the energy is the paper's, else those of the accurate recipe: the relaxed
    /// profiles of one recipe are alike on all grids. Says how many grids there are below this one; none for an odd number of cells,
    /// without networks, or on active bricks.
    pub fn begin_on_half_grids(&mut self, network: &Network) -> Result<usize, Error> {
        let operator = MeanCurvatureOperator::new(network, &self.device)?;
        self.begin_on_coarser_steps(&operator)
    }

    fn begin_on_coarser_steps(&mut self, step: &dyn MeanCurvatureStep<D>) -> Result<usize, Error> {
        let (Ok(grid), None) = (self.grid.half(), &self.active) else {
            return Ok(0);
        };
        let coarser = step.coarser(self.params.calibration);
        let Some(Coarser { step, factors }) = coarser.map_err(Error::Step)? else {
            return Ok(0);
        };
        let mut params = self.params;
        params.calibration = factors;
        let start = Tensor::ones(grid.shape(), (self.device.device(), self.device.dtype()));
        let mut half = Self::begun(step.clone(), None, (&grid, start), params, &self.device);
        let levels = 1 + half.begin_on_coarser_steps(&*step)?;
        self.begin_on(half)?;
        Ok(levels)
    }

    /// The start of a step of size `tau`.
    pub(super) fn start(&mut self, tau: f64) -> Result<(Tensor<D>, Start), Error> {
        if let Some((moved, hvp)) = self.motion_on_half_grid(tau)? {
            let before = self.half_motion.replace(moved.clone());
            let start = match (before, &self.previous) {
                // The half grid also moves the profile from the one that fits this grid to its own, in every step alike: what it
                // moves more than in the last step comes on top of the last motion here.
                (Some(before), Some((previous, _))) if self.step > 1 => {
                    let change = moved.zip_map(&before, |new, old| new - old)?;
                    self.current.clone() * 2.0 - previous.clone() + self.on_device(&change)?
                }
                _ => self.current.clone() + self.on_device(&moved)?,
            };
            let kind = StartKind::HalfGrid;
            return Ok((start, Start { kind, hvp }));
        }
        // Those further down belong to this one.
        self.set_half_motions(&[])?;
        Ok(match &self.previous {
            // The first step also relaxes the initial profile, which is nothing to extrapolate.
            Some((previous, last)) if self.step > 1 && self.moved_little(previous)? => {
                let start = extrapolate(&self.current, previous, (tau / last).min(2.0));
                let kind = StartKind::Extrapolated;
                (start, Start { kind, hvp: 0.0 })
            }
            _ => (self.current.clone(), Start::default()),
        })
    }

    /// A field on the half grid, interpolated on this one.
    fn on_device(&self, coarse: &Field<D>) -> Result<Tensor<D>, Error> {
        let fine = coarse.refined()?;
        Ok(self.device.tensor(fine.values(), self.grid.shape()))
    }

    /// What the half grid moves in a step of size `tau` from here, and what that cost.
    fn motion_on_half_grid(&mut self, tau: f64) -> Result<Option<(Field<D>, f64)>, Error> {
        let Some(half) = &mut self.half else {
            return Ok(None);
        };
        let every_other = |u: &Tensor<D>| u.clone().slice([Slice::with_step(0, None, 2); D]);
        let from = every_other(&self.current);
        half.current = from.clone();
        let previous = self.previous.as_ref();
        half.previous = previous.map(|(u, tau)| (every_other(u), *tau));
        (half.step, half.time) = (self.step, self.time);
        half.constraints = if self.constraints.is_empty() {
            self.constraints
        } else {
            let here = download(&self.grid, &self.current, &self.device)?;
            let there = download(&half.grid, &half.current, &half.device)?;
            self.constraints.carried(&here, &there, self.params.eps)?
        };
        let record = match half.advance(tau) {
            Err(error) if error.shorter_step_may_succeed() => return Ok(None),
            record => record?,
        };
        let moved = download(&half.grid, &(half.current.clone() - from), &half.device)?;
        let share = half.grid.len() as f64 / self.grid.len() as f64;
        Ok(Some((moved, share * record.hvp())))
    }

    /// The last motions on the coarser grids, the finest first.
    pub(super) fn half_motions(&self) -> Vec<Field<D>> {
        let below = self.half.iter().flat_map(|half| half.half_motions());
        self.half_motion.iter().cloned().chain(below).collect()
    }

    /// Takes over what [`Self::half_motions`] said.
    pub(super) fn set_half_motions(&mut self, motions: &[Field<D>]) -> Result<(), Error> {
        self.half_motion = None;
        let Some(half) = &mut self.half else {
            return Ok(());
        };
        let Some((own, below)) = motions.split_first() else {
            return half.set_half_motions(&[]);
        };
        self.half_motion = Some(Field::from_values(half.grid, own.values().to_vec())?);
        half.set_half_motions(below)
    }
}

/// Those that are nodes of the half grid.
fn every_other_node<const D: usize>(grid: Grid<D>, nodes: &NodeSet) -> NodeSet {
    let marks = nodes.iter().enumerate().filter(|(i, _)| {
        grid.multi_index(*i)
            .iter()
            .all(|index| index.is_multiple_of(2))
    });
    marks.map(|(_, mark)| mark).collect()
}

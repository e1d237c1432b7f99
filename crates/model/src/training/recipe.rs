//! The frame of all recipes: learning curve, checkpoint, measured quality, provenance.

use std::time::Instant;

use burn::tensor::DType;
use operators::{ComputeDevice, memory};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::{SphereData, TrainingObserver, TrainingProgress};
use crate::{Error, Mlp, Network, Provenance, Quality};

/// A method of training with its settings.
pub trait Recipe: Serialize + Sync {
    /// What the training needs to go on with the same bytes after an interruption; `()` for one that starts over.
    type State: Clone + Send + Serialize + DeserializeOwned;

    /// Whether the training goes on from a state; one that starts over gets none, and a new learning curve.
    const GOES_ON: bool = true;

    /// Trains kernel and activation. The observer is called after every iteration and may stop the training.
    ///
    /// # Errors
    /// [`Error::Training`] for impossible settings, [`Error::Shape`] for a state of other settings, [`Error::Diverged`],
    /// [`Error::Interrupted`], [`Error::Operators`].
    fn train(
        &self,
        data: &SphereData,
        seed: u64,
        state: Option<Self::State>,
        device: &ComputeDevice,
        observer: &mut TrainingObserver<'_, Self::State>,
    ) -> Result<(Vec<f64>, Mlp), Error>;

    /// Method and settings in words, after so many iterations.
    fn describe(&self, data: &SphereData, iterations: usize) -> String;
}

/// Everything that the result of a training depends on.
#[derive(Clone, Debug, Serialize)]
pub struct Training<'a, R> {
    /// The method and its settings.
    pub recipe: &'a R,
    /// The training data.
    pub data: SphereData,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Number of held-out radii on which the quality is measured, at least 1.
    pub held_out: usize,
}

/// One point of a learning curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Finished iterations or epochs.
    pub iteration: usize,
    /// Wall time since the start of the training, interruptions left out.
    pub seconds: f64,
    /// Loss on the training samples.
    pub training_loss: f64,
    /// Loss on held-out samples.
    pub held_out_loss: f64,
}

/// A checkpoint of a training; the default is its start.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint<State> {
    /// State after the last iteration.
    pub state: Option<State>,
    /// The learning curve.
    pub curve: Vec<CurvePoint>,
}

impl<State> Default for Checkpoint<State> {
    fn default() -> Self {
        Self {
            state: None,
            curve: Vec::new(),
        }
    }
}

/// A finished training.
#[derive(Clone, Debug)]
pub struct Trained {
    /// The network with its provenance, and with its calibration if it has one: hardly trained networks have no flat interface.
    pub network: Network,
    /// The learning curve.
    pub curve: Vec<CurvePoint>,
    /// The measured quality of the network.
    pub quality: Quality,
}

impl Trained {
    /// Wall time of the training.
    pub fn seconds(&self) -> f64 {
        self.curve.last().map_or(0.0, |point| point.seconds)
    }
}

impl<R: Recipe> Training<'_, R> {
    /// Trains on from a checkpoint, keeps it up to date, and measures the result.
    ///
    /// # Errors
    /// [`Error::Training`] without held-out radii, double precision or the memory to measure the result; those of the recipe;
    /// [`Error::Interrupted`].
    pub fn run(
        &self,
        checkpoint: &mut Checkpoint<R::State>,
        device: &ComputeDevice,
        observer: &mut TrainingObserver<'_, Checkpoint<R::State>>,
    ) -> Result<Trained, Error> {
        self.check(device)?;
        let state = checkpoint.state.clone().filter(|_| R::GOES_ON);
        if state.is_none() {
            checkpoint.curve.clear();
        }
        let before = checkpoint.curve.last().map_or(0.0, |point| point.seconds);
        let clock = Instant::now();
        let mut record = |progress: &TrainingProgress, state: &R::State| {
            checkpoint.state = Some(state.clone());
            checkpoint.curve.push(CurvePoint {
                iteration: progress.iteration,
                seconds: before + clock.elapsed().as_secs_f64(),
                training_loss: progress.training_loss,
                held_out_loss: progress.held_out_loss,
            });
            observer(progress, checkpoint)
        };
        // The order of sums in products of matrices depends on the number of threads: it is that of the shipped networks on every machine.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
        let pool = pool.map_err(|e| Error::Training(format!("cannot start threads: {e}")))?;
        let train = || (self.recipe).train(&self.data, self.seed, state, device, &mut record);
        let (kernel, activation) = pool.install(train)?;
        let curve = checkpoint.curve.clone();
        let provenance = Provenance {
            recipe: self.recipe.describe(&self.data, curve.len()),
            reference_cells: self.data.cells,
            seed: self.seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            training_loss: curve.last().map_or(0.0, |point| point.training_loss),
            held_out_loss: 0.0,
            flipped_loss: 0.0,
        };
        let mut network = Network::new(self.data.ratios, kernel, activation, provenance)?;
        let quality = Quality::measure(&network, &self.data, self.held_out, device)?;
        network.provenance.held_out_loss = quality.held_out_loss;
        network.provenance.flipped_loss = quality.flipped_loss;
        network.calibration = network.calibrate().ok();
        Ok(Trained {
            network,
            curve,
            quality,
        })
    }

    /// Refuses what would fail after the training.
    fn check(&self, device: &ComputeDevice) -> Result<(), Error> {
        /// Vectors of the grid in memory while the quality is measured.
        const VECTORS: f64 = 10.0;
        if !device.kind().is_cpu() || device.dtype() != DType::F64 {
            return Err(Error::Training(format!(
                "networks are trained in double precision on a CPU, and not by {} here: choose flex or ndarray",
                device.kind().name()
            )));
        }
        if self.held_out == 0 {
            return Err(Error::Training(
                "0 held-out radii have no loss to save with the network: choose 1 or more"
                    .to_owned(),
            ));
        }
        let nodes = (self.data.cells as f64).powi(self.data.ratios.dimension as i32);
        let gigabytes = 1e-9 * 8.0 * VECTORS * nodes;
        match memory::available().map(|bytes| 1e-9 * bytes) {
            Some(available) if gigabytes > available => Err(Error::Training(format!(
                "a grid of {} cells a side takes about {gigabytes:.1} GB of memory to measure the network on, and {available:.1} GB are \
                 available: choose narrower interfaces",
                self.data.cells
            ))),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ratios;
    use crate::training::least_squares::LeastSquaresParams;
    use crate::training::levenberg_marquardt::{LmParams, LmState};
    use crate::training::tests::ratios;

    #[test]
    fn a_training_without_held_out_radii_is_refused_before_it() {
        let device = ComputeDevice::default_compiled().unwrap();
        let training = Training {
            recipe: &LmParams::new(true),
            data: SphereData::new(ratios(2, 17), 128).unwrap(),
            seed: 1,
            held_out: 0,
        };
        let found = training.run(
            &mut Checkpoint::default(),
            &device,
            &mut |_: &TrainingProgress, _: &_| Ok(false),
        );
        assert!(matches!(found, Err(Error::Training(reason)) if reason.contains("held-out")));
    }

    #[test]
    fn a_training_that_starts_over_has_a_new_curve() {
        let device = ComputeDevice::default_compiled().unwrap();
        let training = Training {
            recipe: &LeastSquaresParams::new(true),
            data: SphereData::new(ratios(2, 17), 128).unwrap(),
            seed: 1,
            held_out: 2,
        };
        let mut checkpoint = Checkpoint::default();
        for _ in 0..2 {
            let stopped = training.run(
                &mut checkpoint,
                &device,
                &mut |p: &TrainingProgress, _: &_| Ok(p.iteration < 2),
            );
            assert!(matches!(stopped, Err(Error::Interrupted { iteration: 2 })));
            assert_eq!(checkpoint.curve.len(), 2);
        }
    }

    #[test]
    fn an_interrupted_training_goes_on_from_its_stored_checkpoint() {
        let device = ComputeDevice::default_compiled().unwrap();
        let small = Ratios::of_run(2, 9, 1.0, 1.0, 0.25);
        let training = Training {
            recipe: &LmParams::new(true),
            data: SphereData::new(small, 64).unwrap().quick(),
            seed: 1,
            held_out: 2,
        };
        let run = |checkpoint: &mut Checkpoint<LmState>, last: usize| {
            training.run(checkpoint, &device, &mut |p: &TrainingProgress, _: &_| {
                Ok(p.iteration < last)
            })
        };
        let whole = run(&mut Checkpoint::default(), 100).unwrap();
        let mut checkpoint = Checkpoint::default();
        let stopped = run(&mut checkpoint, 3);
        assert!(matches!(stopped, Err(Error::Interrupted { iteration: 3 })));
        let stored = serde_json::to_string(&checkpoint).unwrap();
        let mut found = serde_json::from_str(&stored).unwrap();
        let resumed = run(&mut found, 100).unwrap();
        assert_eq!(resumed.network, whole.network);
        let losses = |trained: &Trained| -> Vec<(usize, f64)> {
            let curve = trained.curve.iter();
            curve.map(|p| (p.iteration, p.held_out_loss)).collect()
        };
        assert_eq!(losses(&resumed), losses(&whole));
        assert!(resumed.curve.is_sorted_by_key(|point| point.seconds));
        // Nor does it matter how many threads there are.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let alone = pool
            .unwrap()
            .install(|| run(&mut Checkpoint::default(), 100));
        assert_eq!(alone.unwrap().network, whole.network);
    }
}

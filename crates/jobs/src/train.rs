//! Training of networks for other ratios than those of the networks that come with the library.

use engine::quarter_square;
use mean_curvature::Calibration;
use model::training::least_squares::LeastSquaresParams;
use model::training::{Checkpoint, SphereData, Training, TrainingProgress};
use model::{Network, Ratios};

use crate::case::check_eps_over_h;
use crate::options::TrainOptions;
use crate::prelude::*;

/// Cells per unit length of the training grid for `eps = 2h`; it grows with the interface, so that the same spheres fit.
const CELLS: f64 = 128.0;
/// Radii on which the quality is measured.
const HELD_OUT: usize = 20;
/// The same for a network of seconds.
const HELD_OUT_QUICK: usize = 2;

/// A network that was trained.
#[derive(Clone, Debug)]
pub struct TrainedNetwork {
    /// The network.
    pub network: Network,
    /// What it is for.
    pub ratios: Ratios,
    /// Its loss on spheres that it has not seen.
    pub held_out_loss: f64,
    /// Its calibration.
    pub calibration: Calibration,
}

impl TrainOptions {
    /// The ratios of the network.
    fn ratios(&self) -> Result<Ratios> {
        let missing = |option| Refusal::TrainNeeds { option };
        let eps_over_h = self.eps_over_h.ok_or(missing("eps_over_h"))?;
        check_eps_over_h(eps_over_h)?;
        let ratios = Ratios {
            dimension: self.dimension.ok_or(missing("dimension"))?,
            width: self.width.ok_or(missing("width"))?,
            eps_over_h,
            step_over_h2: self.step_over_h2.unwrap_or(quarter_square(eps_over_h)),
        };
        ratios.validate()?;
        Ok(ratios)
    }
}

/// Trains a network and writes it to the file of `save`, which is returned.
///
/// # Errors
/// As [`train`], and a file that is there or cannot be written.
pub fn train_and_save(
    options: TrainOptions,
    watcher: &dyn Watcher,
) -> Result<(PathBuf, TrainedNetwork)> {
    options.ratios()?;
    let file = options.save.clone();
    let file = file.ok_or(Refusal::TrainNeeds { option: "save" })?;
    options.force.check(&file)?;
    let trained = train(options, watcher)?;
    trained.network.save(&file)?;
    Ok((file, trained))
}

/// Trains a network in memory. Options of files are ignored.
///
/// # Errors
/// Refused options; a training that fails; [`Error::Interrupted`], after which nothing is kept.
pub fn train(mut options: TrainOptions, watcher: &dyn Watcher) -> Result<TrainedNetwork> {
    let ratios = options.ratios()?;
    let device = options.common.open_device()?;
    let cells = (CELLS * ratios.eps_over_h / 2.0).round() as usize;
    let mut data = SphereData::new(ratios, cells)?;
    if options.quick {
        data = data.quick();
    }
    let training = Training {
        recipe: &LeastSquaresParams::new(options.quick),
        data,
        seed: options.common.seed,
        held_out: if options.quick {
            HELD_OUT_QUICK
        } else {
            HELD_OUT
        },
    };
    let interrupt = watcher.interrupt()?;
    let progress = watcher.begins("training", 1);
    let shown = &*progress;
    let mut observer = |at: &TrainingProgress, _: &Checkpoint<()>| {
        shown.expect(at.of as u64);
        shown.reach(at.iteration as u64);
        Ok(!interrupt.requested())
    };
    let trained = training.run(&mut Checkpoint::default(), &device, &mut observer);
    drop(progress);
    let trained = trained.map_err(|error| match error {
        model::Error::Interrupted { .. } => Error::Interrupted,
        error => error.into(),
    })?;
    let calibration = trained.network.calibration()?;
    Ok(TrainedNetwork {
        network: trained.network,
        ratios,
        held_out_loss: trained.quality.held_out_loss,
        calibration,
    })
}

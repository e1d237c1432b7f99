//! The networks of the experiments, and training them with a progress bar and checkpoints.

use std::time::{Duration, Instant};

use model::training::{Checkpoint, Progress as Iteration, Recipe, SphereData, Trained, Training};
use model::{Error as ModelError, Ratios};
use operators::{ComputeDevice, DeviceKind};
use report::{OutputDir, Progress};
use runs::Cache;
use serde::Serialize;

use crate::Error;
use crate::options::RunOptions;

/// Least time between two checkpoints.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(3);

/// A network to be trained.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NetworkSpec {
    /// Name in files and metrics.
    pub name: String,
    /// Ratios of the operator.
    pub ratios: Ratios,
    /// Cells per unit length of the training grid.
    pub cells: usize,
}

const fn ratios(dimension: usize, width: usize, eps_over_h: f64, step_over_h2: f64) -> Ratios {
    Ratios {
        dimension,
        width,
        eps_over_h,
        step_over_h2,
    }
}

/// Name; dimension, width of the kernel, `eps/h`, `tautilde/h^2`; cells per unit length of the training grid.
///
/// `n64` to `n512` have the scales of the convergence tests, `eps = 2^-6` and `tautilde = 2^-14`. The paper inpaints at `n = 1024`
/// with `eps = 2^-8` and `tautilde = 2^-18`, which are the same ratios as those of the training at `n = 256`. The network of the
/// surfaces serves `n = 64` with `eps = 2^-5` and `tautilde = 2^-12`; it is trained at `n = 128`, where the smallest sphere
/// measures six cells.
const NETWORKS: [(&str, Ratios, usize); 6] = [
    ("n64", ratios(2, 9, 1.0, 0.25), 64),
    ("n128", ratios(2, 17, 2.0, 1.0), 128),
    ("n256", ratios(2, 33, 4.0, 4.0), 256),
    ("n512", ratios(2, 65, 8.0, 16.0), 512),
    ("inpainting", ratios(2, 17, 4.0, 4.0), 256),
    ("surfaces", ratios(3, 17, 2.0, 1.0), 128),
];

impl NetworkSpec {
    /// A network by name, ratios and reference resolution.
    pub fn new(name: impl Into<String>, ratios: Ratios, cells: usize) -> Self {
        Self {
            name: name.into(),
            ratios,
            cells,
        }
    }

    fn named(wanted: impl Fn(&str) -> bool) -> Vec<Self> {
        let chosen = NETWORKS.into_iter().filter(|(name, ..)| wanted(name));
        let spec = |(name, ratios, cells)| Self::new(name, ratios, cells);
        chosen.map(spec).collect()
    }

    /// The networks of the accurate recipe: those of the paper's, and one for `eps = h`.
    pub fn accurate() -> Vec<Self> {
        Self::named(|_| true)
    }

    /// The networks of the paper's recipe.
    pub fn paper() -> Vec<Self> {
        Self::named(|name| name != "n64")
    }

    /// The networks of the paper's convergence tests, each with twice the resolution of the one before.
    pub fn convergence() -> Vec<Self> {
        Self::named(|name| ["n128", "n256", "n512"].contains(&name))
    }

    /// The network of the surfaces.
    pub fn surfaces() -> Self {
        Self::named(|name| name == "surfaces").remove(0)
    }

    /// The training data.
    pub fn data(&self, quick: bool) -> Result<SphereData, Error> {
        let data = SphereData::new(self.ratios, self.cells)?;
        Ok(if quick { data.quick() } else { data })
    }
}

/// Training needs double precision: the given device if it has that, else a CPU.
///
/// # Errors
/// [`Error::Options`] if no CPU backend was compiled in.
pub fn training_device(device: &ComputeDevice) -> Result<ComputeDevice, Error> {
    if device.kind().is_cpu() {
        return Ok(device.clone());
    }
    let none = "training needs double precision: build with the feature `flex` or `ndarray`";
    let kind = (DeviceKind::compiled().find(|kind| kind.is_cpu()))
        .ok_or_else(|| Error::Options(none.to_owned()))?;
    Ok(ComputeDevice::open(kind)?)
}

/// Number of held-out radii for measuring quality.
pub fn held_out_radii(quick: bool) -> usize {
    if quick { 4 } else { 20 }
}

/// What the trainings of a program share.
pub struct Trainer<'a> {
    device: &'a ComputeDevice,
    progress: &'a Progress,
    options: &'a RunOptions,
    /// Where interrupted trainings are kept; to be removed when the networks have been saved.
    pub checkpoints: Cache,
}

impl<'a> Trainer<'a> {
    /// Trainings on a [`training_device`] that are kept in a folder of the output until they are all finished, or `restart`ed.
    pub fn open(
        options: &'a RunOptions,
        device: &'a ComputeDevice,
        output: &OutputDir,
        progress: &'a Progress,
        restart: bool,
    ) -> Result<Self, Error> {
        let folder = output.as_path().join("checkpoints");
        if restart {
            Cache::open(&folder)?.remove()?;
        }
        Ok(Self {
            checkpoints: Cache::open(folder)?,
            device,
            progress,
            options,
        })
    }

    /// Trains a network by a recipe of the given name, continuing from a checkpoint.
    pub fn train<R: Recipe>(
        &self,
        spec: &NetworkSpec,
        recipe_name: &str,
        recipe: &R,
    ) -> Result<Trained, Error> {
        let training = Training {
            recipe,
            data: spec.data(self.options.quick)?,
            seed: self.options.seed,
            held_out: held_out_radii(self.options.quick),
        };
        let name = format!("{}-{recipe_name}", spec.name);
        let key = (&training, env!("CARGO_PKG_VERSION"));
        let mut checkpoint: Checkpoint<R::State> =
            self.checkpoints.load(&name, &key).unwrap_or_default();
        let bar = self.progress.bar(name.clone(), 1);
        bar.set_position(checkpoint.curve.len() as u64);
        bar.reset_eta();
        let mut stored = Instant::now();
        let mut observer = |at: &Iteration, checkpoint: &Checkpoint<R::State>| {
            bar.set_length(at.of as u64);
            bar.set_position(at.iteration as u64);
            bar.set_message(format!("{name}  {:.2e}", at.held_out_loss));
            if stored.elapsed() >= CHECKPOINT_INTERVAL {
                (self.checkpoints.store(&name, &key, checkpoint))
                    .map_err(|error| ModelError::Training(error.to_string()))?;
                stored = Instant::now();
            }
            Ok(true)
        };
        let trained = training.run(&mut checkpoint, self.device, &mut observer)?;
        self.checkpoints.store(&name, &key, &checkpoint)?;
        bar.finish();
        Ok(trained)
    }
}

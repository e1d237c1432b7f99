//! The networks of the experiments, and training them with a progress bar and checkpoints.

use std::time::Duration;

use model::training::{Checkpoint, Progress as Iteration, Recipe, SphereData, Trained, Training};
use model::{Error as ModelError, Ratios};
use serde::de::DeserializeOwned;

use crate::prelude::*;

const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(3);

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NetworkSpec {
    pub name: &'static str,
    pub ratios: Ratios,
    /// Cells per unit length of the training grid.
    pub cells: usize,
}

impl NetworkSpec {
    const fn new(name: &'static str, ratios: Ratios, cells: usize) -> Self {
        Self {
            name,
            ratios,
            cells,
        }
    }

    /// The networks of the accurate recipe: those of the paper's, and one for `eps = h`. `n64` to `n512` have the scales of the
    /// convergence tests, `eps = 2^-6` and `tautilde = 2^-14`. Inpainting at `n = 1024` has `eps = 2^-8` and `tautilde = 2^-18`,
    /// which are the same ratios as those of the training at `n = 256`. The network of the surfaces serves `n = 64` with `eps = 2^-5` and
    /// `tautilde = 2^-12`; it is trained at `n = 128`, where the smallest sphere measures six cells.
    pub const ACCURATE: &'static [Self] = &[
        Self::new("n64", Ratios::of_run(2, 9, 1.0, 1.0, 0.25), 64),
        Self::new("n128", Ratios::of_run(2, 17, 1.0, 2.0, 1.0), 128),
        Self::new("n256", Ratios::of_run(2, 33, 1.0, 4.0, 4.0), 256),
        Self::new("n512", Ratios::of_run(2, 65, 1.0, 8.0, 16.0), 512),
        Self::new("inpainting", Ratios::of_run(2, 17, 1.0, 4.0, 4.0), 256),
        Self::new("surfaces", Ratios::of_run(3, 17, 1.0, 2.0, 1.0), 128),
    ];
    pub const PAPER: &'static [Self] = Self::ACCURATE.split_at(1).1;
    /// The networks of the paper's convergence tests, each with twice the resolution of the one before.
    pub const CONVERGENCE: &'static [Self] = Self::PAPER.split_at(3).0;
    pub const SURFACES: Self = Self::PAPER[4];

    pub fn data(&self, quick: bool) -> Result<SphereData> {
        let data = SphereData::new(self.ratios, self.cells)?;
        Ok(if quick { data.quick() } else { data })
    }
}

/// Training needs double precision: the same options if their device has that, else with a CPU.
pub fn in_double_precision(options: &RunOptions) -> Result<RunOptions> {
    let mut options = options.clone();
    if !options.open_device()?.kind().is_cpu() {
        let none = "training needs double precision: build with the feature `flex` or `ndarray`";
        let kind = DeviceKind::compiled().find(|kind| kind.is_cpu());
        let kind = kind.ok_or_else(|| Error::Options(none.to_owned()))?;
        options.device = Some(kind.name().to_owned());
    }
    Ok(options)
}

pub fn held_out_radii(quick: bool) -> usize {
    if quick { 4 } else { 20 }
}

/// Trains a network by a recipe [in double precision](in_double_precision), continuing from the checkpoint in a file.
pub fn train<R: Recipe>(
    (spec, recipe): (&NetworkSpec, &R),
    file: &Path,
    stage: &Stage<'_>,
) -> Result<Trained> {
    let training = Training {
        recipe,
        data: spec.data(stage.options.quick)?,
        seed: stage.options.seed,
        held_out: held_out_radii(stage.options.quick),
    };
    let key = serde_json::to_value((&training, env!("CARGO_PKG_VERSION")));
    let key = key.expect("settings are numbers and names");
    let mut checkpoint: Checkpoint<R::State> = load(file, &key).unwrap_or_default();
    let bar = &stage.bar;
    bar.set_position(checkpoint.curve.len() as u64);
    bar.reset_eta();
    let mut stored = Instant::now();
    let mut observer = |at: &Iteration, checkpoint: &Checkpoint<R::State>| {
        bar.set_length(at.of as u64);
        bar.set_position(at.iteration as u64);
        bar.set_message(format!("{}  {:.2e}", spec.name, at.held_out_loss));
        if stored.elapsed() >= CHECKPOINT_INTERVAL {
            store(file, &key, checkpoint).map_err(|e| ModelError::Training(e.to_string()))?;
            stored = Instant::now();
        }
        Ok(true)
    };
    let trained = training.run(&mut checkpoint, stage.device, &mut observer)?;
    store(file, &key, &checkpoint)?;
    Ok(trained)
}

/// What is stored in a file, if it is there, readable, and belongs to this key.
fn load<T: DeserializeOwned>(file: &Path, key: &Value) -> Option<T> {
    let (found, stored): (Value, T) = serde_json::from_slice(&std::fs::read(file).ok()?).ok()?;
    (found == *key).then_some(stored)
}

/// Stores something with all that it depends on, its key, whole or not at all.
fn store(file: &Path, key: &Value, stored: &impl Serialize) -> Result<(), files::Error> {
    let text = serde_json::to_string(&(key, stored)).map_err(std::io::Error::from);
    files::write_atomically(file, |out| out.write_all(text?.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn checkpoints_belong_to_their_keys() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("part.json");
        let (key, values) = (json!({ "x": 0.1 + 0.2 }), vec![1.0 / 3.0, -0.0]);
        assert_eq!(load::<Vec<f64>>(&file, &key), None);
        store(&file, &key, &values).unwrap();
        let bits = |values: Vec<f64>| values.into_iter().map(f64::to_bits).collect::<Vec<_>>();
        assert_eq!(load(&file, &key).map(bits), Some(bits(values)));
        assert_eq!(load::<Vec<f64>>(&file, &json!({ "x": 0.3 })), None);
        std::fs::write(&file, "{").unwrap();
        assert_eq!(load::<Vec<f64>>(&file, &key), None);
    }
}

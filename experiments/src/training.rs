//! Training runs with learning curves, checkpoints and measured quality.

use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use model::training::adam::{self, AdamParams, AdamState};
use model::training::least_squares::{self, LeastSquaresParams};
use model::training::levenberg_marquardt::{self as lm, LmParams, LmState};
use model::training::{Distillation, Observer, Progress as Iteration, SphereData};
use model::{Error as ModelError, Mlp, Network, PAPER_LAYERS, Provenance, Quality, Ratios};
use operators::{ComputeDevice, DeviceKind};
use report::Progress;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::partial::Partial;

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

impl NetworkSpec {
    /// A network by name, ratios and reference resolution.
    pub fn new(name: impl Into<String>, ratios: Ratios, cells: usize) -> Self {
        Self {
            name: name.into(),
            ratios,
            cells,
        }
    }

    /// The 2D networks of the paper: `n128`, `n256`, `n512` for `eps = 2^-6`, `tautilde = 2^-14`, and `inpainting`
    /// (`n = 1024`, `eps = 2^-8`, `tautilde = 2^-18`), which is trained at `n = 256` with the same ratios.
    pub fn paper() -> Vec<Self> {
        let ratios = |width, eps_over_h, step_over_h2| Ratios {
            dimension: 2,
            width,
            eps_over_h,
            step_over_h2,
        };
        vec![
            Self::new("n128", ratios(17, 2.0, 1.0), 128),
            Self::new("n256", ratios(33, 4.0, 4.0), 256),
            Self::new("n512", ratios(65, 8.0, 16.0), 512),
            Self::new("inpainting", ratios(17, 4.0, 4.0), 256),
        ]
    }

    /// The network of the surfaces: `n = 64` with `eps = 2^-5`, `tautilde = 2^-12`, and `n = 128` with half and a quarter of
    /// those. It is trained at `n = 128`, where the smallest sphere measures six cells.
    pub fn surfaces() -> Self {
        let ratios = Ratios {
            dimension: 3,
            width: 17,
            eps_over_h: 2.0,
            step_over_h2: 1.0,
        };
        Self::new("surfaces", ratios, 128)
    }

    /// The networks of the accurate recipe: those of the paper, and one for `eps = h`.
    pub fn accurate() -> Vec<Self> {
        let ratios = Ratios {
            dimension: 2,
            width: 9,
            eps_over_h: 1.0,
            step_over_h2: 0.25,
        };
        let mut all = vec![Self::new("n64", ratios, 64)];
        all.extend(Self::shipped());
        all
    }

    /// All networks of the paper's recipe that ship with the library.
    pub fn shipped() -> Vec<Self> {
        let mut all = Self::paper();
        all.push(Self::surfaces());
        all
    }

    /// Name of the weights file, by the ratios: `d2_k17_eps2_step1.safetensors`.
    pub fn file_name(&self) -> String {
        let Ratios {
            dimension,
            width,
            eps_over_h,
            step_over_h2,
        } = self.ratios;
        format!("d{dimension}_k{width}_eps{eps_over_h}_step{step_over_h2}.safetensors")
    }

    /// The training data.
    ///
    /// # Errors
    /// [`Error::Model`] for ratios that cannot be trained.
    pub fn data(&self, quick: bool) -> Result<SphereData, Error> {
        let mut data = SphereData::new(self.ratios, self.cells)?;
        if quick {
            data.count = 12;
        }
        Ok(data)
    }
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

/// A finished training.
#[derive(Clone, Debug)]
pub struct Trained {
    /// What was trained.
    pub spec: NetworkSpec,
    /// The network with its provenance.
    pub network: Network,
    /// How the loss went.
    pub curve: Vec<CurvePoint>,
    /// Measured quality.
    pub quality: Quality,
}

impl Trained {
    /// Wall time of the training.
    pub fn seconds(&self) -> f64 {
        self.curve.last().map_or(0.0, |point| point.seconds)
    }
}

/// Settings of a Levenberg-Marquardt training.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LmSettings {
    /// Settings of the method.
    pub params: LmParams,
    /// Seed of starts and samples.
    pub seed: u64,
    /// A smoke test: few radii, points and iterations.
    pub quick: bool,
}

impl LmSettings {
    /// The recipe of the shipped networks, or a smoke test.
    pub fn new(quick: bool, seed: u64) -> Self {
        let mut params = LmParams::default();
        if quick {
            params.iterations = 8;
            params.directions = 1;
            params.starts = 1;
        }
        Self {
            params,
            seed,
            quick,
        }
    }
}

/// Settings of a training by Adam.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AdamSettings {
    /// Settings of the method.
    pub params: AdamParams,
    /// Seed of start, radii and batches.
    pub seed: u64,
    /// A smoke test: few radii.
    pub quick: bool,
}

/// Settings of a training by the accurate recipe.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AccurateSettings {
    /// Settings of the recipe.
    pub params: LeastSquaresParams,
    /// Seed of samples and starts.
    pub seed: u64,
    /// A smoke test: one short start.
    pub quick: bool,
}

impl AccurateSettings {
    /// The recipe of the shipped networks, or a smoke test.
    pub fn new(quick: bool, seed: u64) -> Self {
        let mut params = LeastSquaresParams::default();
        if quick {
            params.distillation = Distillation {
                starts: 1,
                start_iterations: 10,
                iterations: 10,
            };
        }
        Self {
            params,
            seed,
            quick,
        }
    }
}

/// Training needs double precision: the given device if it has that, else a CPU.
///
/// # Errors
/// [`Error::Options`] if no CPU backend was compiled in.
pub fn training_device(device: &ComputeDevice) -> Result<ComputeDevice, Error> {
    let cpu = |kind: DeviceKind| matches!(kind, DeviceKind::Flex | DeviceKind::NdArray);
    if cpu(device.kind()) {
        return Ok(device.clone());
    }
    let kind = DeviceKind::compiled()
        .find(|&kind| cpu(kind))
        .ok_or_else(|| {
            Error::Options(
                "training needs double precision: build with the feature `flex` or `ndarray`"
                    .to_owned(),
            )
        })?;
    Ok(ComputeDevice::open(kind)?)
}

#[derive(Serialize, Deserialize)]
struct Checkpoint<State> {
    state: State,
    curve: Vec<CurvePoint>,
}

/// Records the learning curve, moves the progress bar, and stores checkpoints now and then.
struct Recorder<'a, K> {
    checkpoints: &'a Partial,
    name: String,
    key: K,
    bar: ProgressBar,
    curve: Vec<CurvePoint>,
    clock: Instant,
    before: f64,
    stored: Instant,
}

impl<'a, K: Serialize> Recorder<'a, K> {
    /// Finds the checkpoint of an earlier run, if there is one with the same key.
    fn open<State: for<'de> Deserialize<'de>>(
        checkpoints: &'a Partial,
        name: String,
        key: K,
        bar: ProgressBar,
    ) -> (Self, Option<State>) {
        let found: Option<Checkpoint<State>> = checkpoints.load(&name, &key);
        let (state, curve) = found.map_or((None, Vec::new()), |c| (Some(c.state), c.curve));
        bar.set_position(curve.len() as u64);
        bar.reset_eta();
        let recorder = Self {
            checkpoints,
            name,
            key,
            bar,
            before: curve.last().map_or(0.0, |point| point.seconds),
            curve,
            clock: Instant::now(),
            stored: Instant::now(),
        };
        (recorder, state)
    }

    fn store<State: Serialize + Clone>(&mut self, state: &State) -> Result<(), Error> {
        let checkpoint = Checkpoint {
            state: state.clone(),
            curve: self.curve.clone(),
        };
        self.checkpoints.store(&self.name, &self.key, &checkpoint)?;
        self.stored = Instant::now();
        Ok(())
    }
}

impl<K: Serialize, State: Serialize + Clone> Observer<State> for Recorder<'_, K> {
    fn observe(&mut self, progress: &Iteration, state: &State) -> Result<bool, ModelError> {
        self.curve.push(CurvePoint {
            iteration: progress.iteration,
            seconds: self.before + self.clock.elapsed().as_secs_f64(),
            training_loss: progress.training_loss,
            held_out_loss: progress.held_out_loss,
        });
        self.bar.set_length(progress.of as u64);
        self.bar.set_position(progress.iteration as u64);
        self.bar
            .set_message(format!("{}  {:.2e}", self.name, progress.held_out_loss));
        if self.stored.elapsed() >= CHECKPOINT_INTERVAL {
            self.store(state)
                .map_err(|error| ModelError::Training(error.line()))?;
        }
        Ok(true)
    }
}

/// Trains by Levenberg-Marquardt from the splitting scheme, continuing from a checkpoint.
///
/// # Errors
/// [`Error::Model`] if the training fails, [`Error::Report`] if a checkpoint cannot be stored.
pub fn levenberg_marquardt(
    spec: &NetworkSpec,
    settings: &LmSettings,
    device: &ComputeDevice,
    checkpoints: &Partial,
    progress: &Progress,
) -> Result<Trained, Error> {
    let device = training_device(device)?;
    let data = spec.data(settings.quick)?;
    let params = &settings.params;
    let name = format!("{}-lm", spec.name);
    let bar = progress.bar(name.clone(), params.iterations as u64);
    let key = (spec, settings, env!("CARGO_PKG_VERSION"));
    let (mut recorder, state) = Recorder::open::<LmState>(checkpoints, name, key, bar);
    let kernel = lm::heat_kernel(&data);
    let activation = match &state {
        // A resumed training does not look at the start.
        Some(state) => {
            let count = model::parameter_count(&PAPER_LAYERS).min(state.parameters.len());
            let tail = state.parameters.len() - count;
            Mlp::new(PAPER_LAYERS.to_vec(), state.parameters[tail..].to_vec())?
        }
        None => {
            let ratios = spec.ratios;
            let step_over_eps2 = ratios.step_over_h2 / ratios.eps_over_h.powi(2);
            lm::splitting_start(step_over_eps2, params, settings.seed, &device)?
        }
    };
    let start = (&kernel[..], &activation);
    let seed = settings.seed;
    let (kernel, activation, state) =
        lm::train(&data, params, start, seed, state, &device, &mut recorder)?;
    recorder.store(&state)?;
    recorder.bar.finish();
    let recipe = format!(
        "Levenberg-Marquardt, {} radii, {} x {} points each, {} iterations",
        data.count, params.shells, params.directions, state.iteration
    );
    let curve = recorder.curve;
    finished(
        spec,
        (kernel, activation),
        curve,
        &recipe,
        seed,
        (&data, &device),
    )
}

/// Trains by the paper's Adam from a start (`None`: the paper's random one), continuing from a checkpoint.
///
/// # Errors
/// As [`levenberg_marquardt`].
pub fn adam(
    spec: &NetworkSpec,
    settings: &AdamSettings,
    start: Option<&Network>,
    device: &ComputeDevice,
    checkpoints: &Partial,
    progress: &Progress,
) -> Result<Trained, Error> {
    let device = training_device(device)?;
    let data = spec.data(settings.quick)?;
    let params = &settings.params;
    let name = format!("{}-adam", spec.name);
    let bar = progress.bar(name.clone(), params.epochs as u64);
    let origin = start.map(crate::networks::checksum);
    let key = (spec, settings, origin, env!("CARGO_PKG_VERSION"));
    let (mut recorder, state) = Recorder::open::<AdamState>(checkpoints, name, key, bar);
    let (kernel, activation) = match start {
        Some(coarse) => {
            let (kernel, width) = adam::refine_kernel(
                coarse.kernel(),
                coarse.ratios().dimension,
                coarse.ratios().width,
            );
            if width != spec.ratios.width {
                return Err(Error::Options(format!(
                    "{} cannot be refined from a kernel of width {}",
                    spec.name,
                    coarse.ratios().width
                )));
            }
            (kernel, coarse.activation().clone())
        }
        None => adam::paper_start(&data, settings.seed),
    };
    let start = (&kernel[..], &activation);
    let seed = settings.seed;
    let (kernel, activation, state) =
        adam::train(&data, params, start, seed, state, &device, &mut recorder)?;
    recorder.store(&state)?;
    recorder.bar.finish();
    let recipe = format!(
        "Adam, {} radii, batches of {}, {} epochs, learning rate {} to {}",
        data.count, params.batch, state.epoch, params.learning_rate, params.final_learning_rate
    );
    let curve = recorder.curve;
    finished(
        spec,
        (kernel, activation),
        curve,
        &recipe,
        seed,
        (&data, &device),
    )
}

/// Trains by the accurate recipe: the heat kernel, an odd polynomial by linear least squares, and a perceptron that imitates it.
///
/// # Errors
/// [`Error::Model`] if the training fails.
pub fn accurate(
    spec: &NetworkSpec,
    settings: &AccurateSettings,
    device: &ComputeDevice,
    progress: &Progress,
) -> Result<Trained, Error> {
    let device = training_device(device)?;
    let data = spec.data(settings.quick)?;
    let params = &settings.params;
    let bar = progress.bar(format!("{}-accurate", spec.name), 1);
    let clock = Instant::now();
    let mut curve = Vec::new();
    let mut observer = |p: &Iteration, (): &()| {
        bar.set_length(p.of as u64);
        bar.set_position(p.iteration as u64);
        curve.push(CurvePoint {
            iteration: p.iteration,
            seconds: clock.elapsed().as_secs_f64(),
            training_loss: p.training_loss,
            held_out_loss: p.held_out_loss,
        });
        Ok(true)
    };
    let seed = settings.seed;
    let (kernel, activation, _) =
        least_squares::train(&data, params, seed, &device, &mut observer)?;
    bar.finish();
    let recipe = format!(
        "least squares, heat kernel, {} radii of {} to {} eps, {} x {} points each, {} flat interfaces, odd polynomial of degree {}",
        params.radii,
        params.range[0],
        params.range[1],
        params.shells,
        params.directions,
        params.normals,
        2 * params.terms - 1
    );
    finished(
        spec,
        (kernel, activation),
        curve,
        &recipe,
        seed,
        (&data, &device),
    )
}

/// Measures the result and puts the network together.
fn finished(
    spec: &NetworkSpec,
    (kernel, activation): (Vec<f64>, Mlp),
    curve: Vec<CurvePoint>,
    recipe: &str,
    seed: u64,
    (data, device): (&SphereData, &ComputeDevice),
) -> Result<Trained, Error> {
    let mut provenance = Provenance {
        recipe: recipe.to_owned(),
        reference_cells: spec.cells,
        seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        training_loss: curve.last().map_or(0.0, |point| point.training_loss),
        held_out_loss: 0.0,
        flipped_loss: 0.0,
    };
    let network = Network::new(spec.ratios, kernel, activation, provenance.clone())?;
    let quality = Quality::measure(&network, data, held_out_radii(data.count < 100), device)?;
    provenance.held_out_loss = quality.held_out_loss;
    provenance.flipped_loss = quality.flipped_loss;
    // Hardly trained networks have no flat interface, and do without.
    let calibration = network.calibrate().ok();
    Ok(Trained {
        spec: spec.clone(),
        network: network
            .with_provenance(provenance)
            .with_calibration(calibration),
        curve,
        quality,
    })
}

/// Number of held-out radii for measuring quality.
pub fn held_out_radii(quick: bool) -> usize {
    if quick { 4 } else { 20 }
}

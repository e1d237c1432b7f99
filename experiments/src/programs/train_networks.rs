use crate::prelude::*;
use crate::session::{load, remove_folder, store};
use crate::training::{METRICS, NetworkSpec, held_out_radii, in_double_precision, quality};
use model::Network;
use model::training::adam::AdamParams;
use model::training::least_squares::LeastSquaresParams;
use model::training::levenberg_marquardt::LmParams;
use model::training::{self, Checkpoint, CurvePoint, Trained, Training};
use std::time::Duration;

pub const EXPERIMENT: Experiment = Experiment {
    name: "train_networks",
    summary: "Trains the networks that ship with the library.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[
        ResultFolder {
            name: "train_networks",
            title: "Training",
            description: "How the shipped networks were trained, by Levenberg-Marquardt and, for comparison, by the paper's \
                 Adam.",
            figures: FIGURES,
            options: Some("--recipe both --adam-epochs 120"),
        },
        ResultFolder {
            name: "train_n128",
            title: "Training at n = 128",
            description: "The network for n = 128 trained once more, with its learning curves.",
            figures: FIGURES,
            options: Some("--only n128"),
        },
    ],
    metrics: &[&METRICS],
    words: &[],
};

const FIGURES: Figures = &[(
    "learning_curves",
    "Losses on training data and on data held out.",
)];

const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(3);

#[derive(ValueEnum, Serialize, Clone, Copy, Debug, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
enum Recipe {
    /// Levenberg-Marquardt from the splitting scheme
    Lm,
    /// The paper's: Adam from a random start at n = 128, refined to n = 256 and 512
    Adam,
    /// The heat kernel and an odd activation by least squares, for the calibrated Willmore scheme
    Accurate,
    /// Levenberg-Marquardt and Adam, with the learning curves side by side; Adam for n = 128, 256 and 512 only
    Both,
}

/// Trains the networks: n = 128 to 1024 of the convergence tests, the one for inpainting, and the one for surfaces in 3D.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    /// How to train
    #[arg(long, value_enum, default_value_t = Recipe::Lm)]
    recipe: Recipe,

    /// Train this network alone: n128, n256, n512, n1024, inpainting or surfaces, with --recipe accurate also n64; can be repeated
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,

    /// Epochs of Adam at n = 128; every refinement gets a quarter of the epochs before it
    #[arg(long, value_name = "COUNT", default_value_t = 200)]
    adam_epochs: usize,
}

impl Recipe {
    /// Name in data, metrics and checkpoints, name in the legend, how its curves look, and prefix of files.
    fn look(self) -> (&'static str, &'static str, LineStyle, &'static str) {
        let distilled = "distillation of the least-squares fit";
        match self {
            Self::Lm | Self::Both => ("lm", "Levenberg-Marquardt", LineStyle::Solid, ""),
            Self::Adam => ("adam", "Adam", LineStyle::Dashed, "adam_"),
            Self::Accurate => ("accurate", distilled, LineStyle::DashDotDot, "accurate_"),
        }
    }
}

fn program(options: &Options) -> Result<()> {
    let all = match options.recipe {
        Recipe::Accurate => NetworkSpec::ACCURATE,
        Recipe::Lm | Recipe::Adam | Recipe::Both => NetworkSpec::PAPER,
    };
    let (names, mut chosen): (Vec<&str>, Vec<_>) =
        all.iter().map(|&spec| (spec.name, spec)).unzip();
    for name in &options.only {
        let listed = names.join(", ");
        let message = format!("no network is called '{name}'; there are {listed}");
        require(names.contains(&name.as_str()), message)?;
    }
    if !options.only.is_empty() {
        chosen.retain(|spec| options.only.iter().any(|name| name == spec.name));
    }
    require(options.adam_epochs > 0, "--adam-epochs must be at least 1")?;
    let run = &in_double_precision(&options.run)?;
    let (lm, accurate) = (LmParams::new(run.quick), LeastSquaresParams::new(run.quick));
    let adam = AdamParams {
        epochs: if run.quick { 2 } else { options.adam_epochs },
        ..AdamParams::default()
    };
    let parameters = json!({
        "recipe": options.recipe, "networks": chosen,
        "levenberg_marquardt": lm, "adam": adam, "accurate": accurate,
    });
    let session = Session::open(EXPERIMENT.name, run, parameters)?;
    let mut trainings = Trainings {
        checkpoints: session.output.subfolder("checkpoints")?,
        folder: session.output.subfolder("networks")?,
        session,
        chosen: chosen.clone(),
        finished: Vec::new(),
    };
    for spec in &chosen {
        match options.recipe {
            Recipe::Lm | Recipe::Both => trainings.train(Recipe::Lm, spec, &lm)?,
            Recipe::Accurate => trainings.train(Recipe::Accurate, spec, &accurate)?,
            Recipe::Adam => break,
        };
    }
    match options.recipe {
        Recipe::Adam => trainings.progressively(&adam, true)?,
        Recipe::Both => trainings.progressively(&adam, !options.only.is_empty())?,
        Recipe::Lm | Recipe::Accurate => {}
    }
    let (mut session, all) = (trainings.session, trainings.finished);
    session.figure(figure(&all), "learning_curves")?;
    let mut points: Vec<(&Finished, &CurvePoint)> = Vec::new();
    for one in &all {
        points.extend(one.trained.curve.iter().map(|at| (one, at)));
    }
    let curves = Sheet::of(&points)
        .data("network", |(one, _)| one.spec.name)
        .data("recipe", |(one, _)| one.recipe.look().0)
        .data("iteration", |(_, at)| at.iteration)
        .data("seconds", |(_, at)| at.seconds)
        .data("training_loss", |(_, at)| at.training_loss)
        .data("held_out_loss", |(_, at)| at.held_out_loss);
    session.csv(curves, "learning_curves")?;
    for one in &all {
        let quality = &one.trained.quality;
        session.summary.insert_record(&one.key(), quality)?;
    }
    let sheet = Sheet::of(&all)
        .keyed(|one, name| format!("{}.{name}", one.key()))
        .text("network", |one| one.spec.name)
        .text("recipe", |one| one.recipe.look().0)
        .metric("seconds", |one| one.trained.seconds())
        .metric("iterations", |one| one.trained.curve.len());
    let sheet = quality(sheet, |one| &one.trained.quality);
    session.sheet(sheet, "quality")?;
    remove_folder(&trainings.checkpoints)?;
    let folder = trainings.folder.as_path().display();
    session.remark(format!("Networks are in {folder}"));
    session.finish("Quality of the trained networks")
}

/// Trainings one after the other. Those of the chosen networks are kept and saved at once.
struct Trainings {
    session: Session,
    /// Where interrupted trainings are kept until all are finished.
    checkpoints: OutputDir,
    folder: OutputDir,
    chosen: Vec<NetworkSpec>,
    finished: Vec<Finished>,
}

struct Finished {
    recipe: Recipe,
    spec: NetworkSpec,
    trained: Trained,
}

impl Trainings {
    /// Trains a network by a recipe, continuing from its checkpoint.
    fn train<R: training::Recipe>(
        &mut self,
        recipe: Recipe,
        spec: &NetworkSpec,
        params: &R,
    ) -> Result<Network> {
        let (key, label, _, prefix) = recipe.look();
        let file = (self.checkpoints).path(&format!("{}-{key}.json", spec.name))?;
        let title = format!("{} by {label}", spec.name);
        let trained = self.session.phase(title, |stage| {
            let (options, bar) = (stage.options, &stage.bar);
            let training = Training {
                recipe: params,
                data: spec.data(options.quick)?,
                seed: options.seed,
                held_out: held_out_radii(options.quick),
            };
            let identity = serde_json::to_value((&training, env!("CARGO_PKG_VERSION")));
            let identity = identity.expect("settings are numbers and names");
            let mut checkpoint: Checkpoint<R::State> = load(&file, &identity).unwrap_or_default();
            bar.set_position(checkpoint.curve.len() as u64);
            bar.reset_eta();
            let mut stored = Instant::now();
            let mut observer = |at: &training::TrainingProgress,
                                checkpoint: &Checkpoint<R::State>| {
                bar.set_length(at.of as u64);
                bar.set_position(at.iteration as u64);
                bar.set_message(format!("{}  {:.2e}", spec.name, at.held_out_loss));
                if stored.elapsed() >= CHECKPOINT_INTERVAL {
                    let stores = store(&file, &identity, checkpoint);
                    stores.map_err(|e| model::Error::Training(e.to_string()))?;
                    stored = Instant::now();
                }
                Ok(true)
            };
            let trained = training.run(&mut checkpoint, stage.device, &mut observer)?;
            store(&file, &identity, &checkpoint)?;
            Ok(trained)
        })?;
        let network = trained.network.clone();
        if self.chosen.contains(spec) {
            let file = format!("{prefix}{}", spec.ratios.file_name());
            network.save(&self.folder.path(&file)?)?;
            self.finished.push(Finished {
                recipe,
                spec: *spec,
                trained,
            });
        }
        Ok(network)
    }

    /// The paper's progressive training up to the finest of the chosen networks: each starts from the refined kernel
    /// and the activation of the one before. The others have no coarser one and are trained `alone`, from a random start.
    fn progressively(&mut self, first: &AdamParams, alone: bool) -> Result<()> {
        let mut stages = NetworkSpec::CONVERGENCE.to_vec();
        let others = self.chosen.iter().filter(|spec| !stages.contains(spec));
        let others: Vec<_> = others.filter(|_| alone).copied().collect();
        while stages.pop_if(|spec| !self.chosen.contains(spec)).is_some() {}
        let mut params = first.clone();
        for spec in &stages {
            let network = self.train(Recipe::Adam, spec, &params)?;
            params = params.refined(&network);
        }
        for spec in &others {
            self.train(Recipe::Adam, spec, first)?;
        }
        Ok(())
    }
}

impl Finished {
    fn key(&self) -> String {
        match self.recipe {
            Recipe::Lm => format!("train.{}", self.spec.name),
            other => format!("train.{}.{}", self.spec.name, other.look().0),
        }
    }
}

/// Held-out loss over wall time and over iterations; colour: network, line style: recipe.
fn figure(all: &[Finished]) -> Figure {
    let mut names: Vec<&str> = all.iter().map(|one| one.spec.name).collect();
    let mut seen = BTreeSet::new();
    names.retain(|name| seen.insert(*name));
    let recipes = [Recipe::Lm, Recipe::Adam, Recipe::Accurate].into_iter();
    let used = |recipe: &Recipe| all.iter().any(|one| one.recipe == *recipe);
    let entry = |recipe: Recipe| LegendEntry::line(recipe.look().1, Colour::Black, recipe.look().2);
    let recipes: Vec<_> = recipes.filter(used).map(entry).collect();
    let network = |(k, name): (usize, &&str)| LegendEntry::line(*name, k, LineStyle::Solid);
    let networks: Vec<_> = names.iter().enumerate().map(network).collect();
    let chart = |label: &str, abscissa: fn(&CurvePoint) -> f64| {
        let curves = all.iter().map(|one| {
            let (key, _, style, _) = one.recipe.look();
            let colour = names.iter().position(|name| *name == one.spec.name);
            let name = format!("{} {key}", one.spec.name);
            let point = |at: &CurvePoint| [abscissa(at), at.held_out_loss];
            let curve = Series::of(name, &one.trained.curve, point).with_style(style);
            curve.with_colour(colour.unwrap_or(0))
        });
        LineChart::new("", Axis::log(label), Axis::log("held-out loss"))
            .with_curves(curves)
            .with_entries(recipes.clone())
            .with_entries(networks.clone())
    };
    Figure::new("Learning curves", 2)
        .with_panel(chart("wall time [s]", |point| point.seconds))
        .with_panel(chart("iteration or epoch", |point| point.iteration as f64))
        .with_shared_legend()
        .with_note(
            "Loss: mean squared nodal error on spheres not trained on. Levenberg-Marquardt uses all sampled points in each \
             iteration; an epoch of Adam is one pass over all radii in batches of 10 grids.",
        )
}

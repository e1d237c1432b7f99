//! Trains the networks that ship with the library.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use experiments::options::RunOptions;
use experiments::session::Session;
use experiments::training::{NetworkSpec, Trainer, training_device};
use experiments::{Error, harness, quality};
use model::Network;
use model::training::adam::AdamParams;
use model::training::least_squares::LeastSquaresParams;
use model::training::levenberg_marquardt::LmParams;
use model::training::{self, CurvePoint, Trained};
use report::{
    Axis, Colour, Figure, LegendEntry, LineChart, LineStyle, Manifest, OutputDir, Series, Table,
};
use serde::Serialize;
use serde_json::json;

const PROGRAM: &str = "train_networks";

/// How networks are trained.
#[derive(ValueEnum, Serialize, Clone, Copy, Debug, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
enum Recipe {
    /// Levenberg-Marquardt from the splitting scheme
    Lm,
    /// The paper's: Adam from a random start at n = 128, refined to n = 256 and 512
    Adam,
    /// The heat kernel and an odd activation by least squares, for the calibrated Willmore scheme
    Accurate,
    /// Levenberg-Marquardt and Adam, with the learning curves side by side; Adam only for the networks of the convergence tests
    Both,
}

/// Trains the networks: n = 128, 256, 512 of the convergence tests, the one for inpainting, and the one for surfaces in 3D.
///
/// An interrupted training continues from its last checkpoint.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    /// How to train
    #[arg(long, value_enum, default_value_t = Recipe::Lm)]
    recipe: Recipe,

    /// Train this network alone: n128, n256, n512, inpainting or surfaces, with --recipe accurate also n64; can be repeated
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,

    /// Epochs of Adam at n = 128; every refinement gets a quarter of the epochs before it
    #[arg(long, value_name = "COUNT", default_value_t = 200)]
    adam_epochs: usize,

    /// Learning rate of Adam's first epoch at n = 128; it falls to a twentieth, and every refinement starts with a quarter
    #[arg(long, value_name = "RATE", default_value_t = AdamParams::default().learning_rate)]
    adam_rate: f64,

    /// Copy the networks trained by Levenberg-Marquardt (with --recipe adam or accurate those) to this folder, too
    #[arg(long, value_name = "DIR")]
    install: Option<PathBuf>,

    /// Forget the checkpoints of an interrupted training
    #[arg(long)]
    restart: bool,
}

impl Recipe {
    /// Name in data, metrics and checkpoints, name in the legend, and how its curves look.
    fn look(self) -> (&'static str, &'static str, LineStyle) {
        match self {
            Self::Lm | Self::Both => ("lm", "Levenberg-Marquardt", LineStyle::Solid),
            Self::Adam => ("adam", "Adam", LineStyle::Dashed),
            Self::Accurate => {
                let label = "distillation of the least-squares fit";
                ("accurate", label, LineStyle::DashDotDot)
            }
        }
    }
}

fn main() -> ExitCode {
    harness::main(program)
}

fn program(options: &Options) -> Result<(), Error> {
    let run = &options.run;
    let specs = options.chosen()?;
    let device = training_device(&run.open_device()?)?;
    let settings = options.settings()?;
    let parameters = json!({
        "recipe": options.recipe,
        "networks": specs,
        "levenberg_marquardt": settings.lm,
        "adam": settings.adam,
        "accurate": settings.accurate,
    });
    let mut session = Session::open(PROGRAM, run, device.clone(), parameters)?;
    let install = (options.install.as_ref())
        .map(OutputDir::create)
        .transpose()?;
    let folder = session.output.subfolder("networks")?;
    let (output, progress) = (&session.output, &session.progress);
    let trainer = Trainer::open(run, &device, output, progress, options.restart)?;
    let mut trainings = Trainings {
        trainer,
        manifest: &mut session.manifest,
        chosen: &specs,
        folder: &folder,
        finished: Vec::new(),
    };
    trainings.by(options.recipe, &settings, !options.only.is_empty())?;
    let (all, checkpoints) = (trainings.finished, trainings.trainer.checkpoints);
    if let Some(install) = &install {
        for one in all.iter().filter(|one| one.recipe == all[0].recipe) {
            let accurate = one.recipe == Recipe::Accurate;
            one.save(install, if accurate { "accurate_" } else { "" })?;
        }
    }
    write(&all, &mut session)?;
    checkpoints.remove()?;
    session.remark(format!("Networks are in {}", folder.as_path().display()));
    session.finish("Quality of the trained networks")
}

/// Curves, figure, metrics and table.
fn write(all: &[Finished], session: &mut Session<'_>) -> Result<(), Error> {
    session.figure(figure(all), "learning_curves")?;
    let rows: Vec<CurveRow<'_>> = all.iter().flat_map(Finished::curve).collect();
    session.output.write_csv("learning_curves.csv", &rows)?;
    session.output.write_json("learning_curves.json", &rows)?;
    let summary = &mut session.summary;
    for one in all {
        let key = match one.recipe {
            Recipe::Lm => format!("train.{}", one.spec.name),
            _ => format!("train.{}.{}", one.spec.name, one.key()),
        };
        summary.insert_record(&key, &one.trained.quality)?;
        summary.insert(&format!("{key}.seconds"), one.trained.seconds())?;
        summary.insert_count(&format!("{key}.iterations"), one.trained.curve.len())?;
    }
    let table = Table::of(all)
        .text("network", |one| &one.spec.name)
        .text("recipe", Finished::key);
    session.table(
        quality::columns(table, |one| &one.trained.quality),
        "quality",
    )
}

/// The settings of every recipe.
struct Settings {
    lm: LmParams,
    adam: AdamParams,
    accurate: LeastSquaresParams,
}

impl Options {
    fn chosen(&self) -> Result<Vec<NetworkSpec>, Error> {
        let mut specs = match self.recipe {
            Recipe::Accurate => NetworkSpec::accurate(),
            Recipe::Lm | Recipe::Adam | Recipe::Both => NetworkSpec::paper(),
        };
        let names: Vec<&str> = specs.iter().map(|spec| &spec.name[..]).collect();
        if let Some(unknown) = self.only.iter().find(|name| !names.contains(&&name[..])) {
            return Err(Error::Options(format!(
                "no network is called '{unknown}'; there are {}",
                names.join(", ")
            )));
        }
        if !self.only.is_empty() {
            specs.retain(|spec| self.only.contains(&spec.name));
        }
        Ok(specs)
    }

    fn settings(&self) -> Result<Settings, Error> {
        let (quick, rate) = (self.run.quick, self.adam_rate);
        let epochs = if quick { 2 } else { self.adam_epochs };
        if epochs == 0 {
            return Err(Error::Options(
                "--adam-epochs must be at least 1".to_owned(),
            ));
        }
        if !(rate.is_finite() && rate > 0.0) {
            let message = format!("--adam-rate must be positive, not {rate}");
            return Err(Error::Options(message));
        }
        Ok(Settings {
            lm: LmParams::new(quick),
            adam: AdamParams {
                epochs,
                learning_rate: rate,
                final_learning_rate: 0.05 * rate,
                ..AdamParams::default()
            },
            accurate: LeastSquaresParams::new(quick),
        })
    }
}

/// Trainings one after the other. Those of the chosen networks are kept and saved at once.
struct Trainings<'a> {
    trainer: Trainer<'a>,
    manifest: &'a mut Manifest,
    chosen: &'a [NetworkSpec],
    folder: &'a OutputDir,
    finished: Vec<Finished>,
}

struct Finished {
    recipe: Recipe,
    spec: NetworkSpec,
    trained: Trained,
}

impl Trainings<'_> {
    /// All by one recipe. Compared with another, Adam trains networks outside of the progression only where they are `wanted`.
    fn by(&mut self, recipe: Recipe, settings: &Settings, wanted: bool) -> Result<(), Error> {
        for spec in self.chosen {
            match recipe {
                Recipe::Lm | Recipe::Both => self.train(Recipe::Lm, spec, &settings.lm)?,
                Recipe::Accurate => self.train(Recipe::Accurate, spec, &settings.accurate)?,
                Recipe::Adam => break,
            };
        }
        match recipe {
            Recipe::Adam => self.progressively(&settings.adam, true),
            Recipe::Both => self.progressively(&settings.adam, wanted),
            Recipe::Lm | Recipe::Accurate => Ok(()),
        }
    }

    fn train<R: training::Recipe>(
        &mut self,
        recipe: Recipe,
        spec: &NetworkSpec,
        params: &R,
    ) -> Result<Network, Error> {
        let (key, label, _) = recipe.look();
        let train = || self.trainer.train(spec, key, params);
        let trained = (self.manifest).phase(format!("{} by {label}", spec.name), train)?;
        let network = trained.network.clone();
        if self.chosen.contains(spec) {
            let finished = Finished {
                recipe,
                spec: spec.clone(),
                trained,
            };
            let prefix = match recipe {
                Recipe::Lm | Recipe::Both => "",
                Recipe::Adam => "adam_",
                Recipe::Accurate => "accurate_",
            };
            finished.save(self.folder, prefix)?;
            self.finished.push(finished);
        }
        Ok(network)
    }

    /// The paper's progressive training up to the finest of the chosen networks: each starts from the refined kernel
    /// and the activation of the one before. The others have no coarser one and are trained `alone`, from a random start.
    fn progressively(&mut self, first: &AdamParams, alone: bool) -> Result<(), Error> {
        let mut stages = NetworkSpec::convergence();
        let others = self.chosen.iter().filter(|spec| !stages.contains(spec));
        let others: Vec<_> = others.filter(|_| alone).cloned().collect();
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
    fn save(&self, folder: &OutputDir, prefix: &str) -> Result<(), Error> {
        let name = format!("{prefix}{}", self.spec.ratios.file_name());
        Ok(self.trained.network.save(&folder.path(&name)?)?)
    }

    fn key(&self) -> &'static str {
        self.recipe.look().0
    }

    fn curve(&self) -> impl Iterator<Item = CurveRow<'_>> {
        self.trained.curve.iter().map(|point| CurveRow {
            network: &self.spec.name,
            recipe: self.key(),
            iteration: point.iteration,
            seconds: point.seconds,
            training_loss: point.training_loss,
            held_out_loss: point.held_out_loss,
        })
    }
}

#[derive(Serialize)]
struct CurveRow<'a> {
    network: &'a str,
    recipe: &'static str,
    iteration: usize,
    seconds: f64,
    training_loss: f64,
    held_out_loss: f64,
}

/// Held-out loss over wall time and over iterations; colour: network, line style: recipe.
fn figure(all: &[Finished]) -> Figure {
    let mut names: Vec<&str> = Vec::new();
    for one in all {
        if !names.contains(&&one.spec.name[..]) {
            names.push(&one.spec.name);
        }
    }
    let recipes = [Recipe::Lm, Recipe::Adam, Recipe::Accurate];
    let recipes = recipes.map(|recipe| all.iter().find(|one| one.recipe == recipe));
    let legend = |chart: LineChart| {
        let recipes = recipes.iter().flatten().map(|one| {
            let (_, label, style) = one.recipe.look();
            LegendEntry::line(label, Colour::Black, style)
        });
        let networks = names.iter().enumerate();
        let networks = networks.map(|(k, name)| LegendEntry::line(*name, k, LineStyle::Solid));
        chart.with_entries(recipes).with_entries(networks)
    };
    let chart = |label: &str, abscissa: fn(&CurvePoint) -> f64| {
        let curves = all.iter().map(|one| {
            let (key, _, style) = one.recipe.look();
            let colour = names.iter().position(|name| *name == one.spec.name);
            let name = format!("{} {key}", one.spec.name);
            Series::of(name, &one.trained.curve, |at| {
                [abscissa(at), at.held_out_loss]
            })
            .with_colour(colour.unwrap_or(0))
            .with_style(style)
        });
        let chart = LineChart::new("", Axis::log(label), Axis::log("held-out loss"));
        legend(chart.with_curves(curves))
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

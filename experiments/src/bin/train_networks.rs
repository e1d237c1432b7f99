//! Trains the networks that ship with the library.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use experiments::options::RunOptions;
use experiments::partial::Partial;
use experiments::training::{
    self, AccurateSettings, AdamSettings, CurvePoint, LmSettings, NetworkSpec, Trained,
    training_device,
};
use experiments::{Error, harness, quality};
use model::training::adam::AdamParams;
use operators::ComputeDevice;
use report::{
    Axis, Colour, Figure, LegendEntry, LineChart, LineStyle, OutputDir, Progress, Series, Summary,
};
use serde::Serialize;

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

#[derive(Serialize)]
struct Parameters<'a> {
    recipe: Recipe,
    networks: &'a [NetworkSpec],
    levenberg_marquardt: &'a LmSettings,
    adam: &'a AdamSettings,
    accurate: &'a AccurateSettings,
    quick: bool,
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

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let run = &options.run;
    let specs = chosen(options.recipe, &options.only)?;
    let device = training_device(&run.open_device()?)?;
    let epochs = if run.quick { 2 } else { options.adam_epochs };
    if epochs == 0 {
        return Err(Error::Options(
            "--adam-epochs must be at least 1".to_owned(),
        ));
    }
    if !(options.adam_rate.is_finite() && options.adam_rate > 0.0) {
        return Err(Error::Options(format!(
            "--adam-rate must be positive, not {}",
            options.adam_rate
        )));
    }
    let settings = Settings {
        accurate: AccurateSettings::new(run.quick, run.seed),
        lm: LmSettings::new(run.quick, run.seed),
        adam: AdamSettings {
            params: AdamParams {
                epochs,
                learning_rate: options.adam_rate,
                final_learning_rate: 0.05 * options.adam_rate,
                ..AdamParams::default()
            },
            seed: run.seed,
            quick: run.quick,
        },
    };
    let output = run.open_output(PROGRAM)?;
    let install = options
        .install
        .as_ref()
        .map(OutputDir::create)
        .transpose()?;
    let folder = output.subfolder("networks")?;
    let mut checkpoints = Partial::open(&output, "checkpoints")?;
    if options.restart {
        checkpoints.remove()?;
        checkpoints = Partial::open(&output, "checkpoints")?;
    }
    let parameters = Parameters {
        recipe: options.recipe,
        networks: &specs,
        levenberg_marquardt: &settings.lm,
        adam: &settings.adam,
        accurate: &settings.accurate,
        quick: run.quick,
    };
    let mut manifest = run.manifest(PROGRAM, &parameters, &device)?;
    let progress = run.progress();

    let mut by_lm = Vec::new();
    if matches!(options.recipe, Recipe::Lm | Recipe::Both) {
        for spec in &specs {
            let trained =
                manifest.phase(format!("{} by Levenberg-Marquardt", spec.name), || {
                    training::levenberg_marquardt(
                        spec,
                        &settings.lm,
                        &device,
                        &checkpoints,
                        &progress,
                    )
                })?;
            let name = spec.file_name();
            trained.network.save(&folder.path(&name)?)?;
            by_lm.push(trained);
        }
    }
    let mut by_adam = Vec::new();
    if matches!(options.recipe, Recipe::Adam | Recipe::Both) {
        let mut compared = specs.clone();
        if options.recipe == Recipe::Both && options.only.is_empty() {
            compared.retain(in_the_chain);
        }
        by_adam = manifest.phase("Adam", || {
            settings.progressively(&compared, &device, &checkpoints, &progress)
        })?;
        for trained in &by_adam {
            let name = format!("adam_{}", trained.spec.file_name());
            trained.network.save(&folder.path(&name)?)?;
        }
    }
    let mut accurate = Vec::new();
    if options.recipe == Recipe::Accurate {
        for spec in &specs {
            let trained = manifest.phase(format!("{} by least squares", spec.name), || {
                training::accurate(spec, &settings.accurate, &device, &progress)
            })?;
            trained.network.save(&folder.path(&accurate_name(spec))?)?;
            accurate.push(trained);
        }
    }
    if let Some(install) = &install {
        let trained = if by_lm.is_empty() { &by_adam } else { &by_lm };
        for one in trained {
            one.network.save(&install.path(&one.spec.file_name())?)?;
        }
        for one in &accurate {
            one.network
                .save(&install.path(&accurate_name(&one.spec))?)?;
        }
    }

    let all: Vec<(&'static str, &Trained)> = by_lm
        .iter()
        .map(|trained| ("lm", trained))
        .chain(by_adam.iter().map(|trained| ("adam", trained)))
        .chain(accurate.iter().map(|trained| ("accurate", trained)))
        .collect();
    figure(run, &all).write(&output, "learning_curves")?;
    write_data(&output, &all)?;
    let mut table = quality::table(&["network", "recipe"]);
    let mut summary = Summary::new();
    for (recipe, trained) in &all {
        let name = &trained.spec.name;
        quality::push(&mut table, &[name, recipe], &trained.quality)?;
        let key = match *recipe {
            "lm" => format!("train.{name}"),
            other => format!("train.{name}.{other}"),
        };
        quality::insert(&mut summary, &key, &trained.quality)?;
        summary.insert(&format!("{key}.seconds"), trained.seconds())?;
        summary.insert_count(&format!("{key}.iterations"), trained.curve.len())?;
    }
    table.write(&output, "quality")?;
    summary.write(&output)?;
    manifest.write(&output)?;
    checkpoints.remove()?;
    progress.clear();
    run.say(&format!(
        "{}\n{}\nNetworks are in {}, results in {}",
        run.title("Quality of the trained networks"),
        table.to_markdown(),
        folder.as_path().display(),
        output.as_path().display()
    ));
    Ok(())
}

fn accurate_name(spec: &NetworkSpec) -> String {
    format!("accurate_{}", spec.file_name())
}

fn chosen(recipe: Recipe, only: &[String]) -> Result<Vec<NetworkSpec>, Error> {
    let mut specs = match recipe {
        Recipe::Accurate => NetworkSpec::accurate(),
        Recipe::Lm | Recipe::Adam | Recipe::Both => NetworkSpec::shipped(),
    };
    let names: Vec<&str> = specs.iter().map(|spec| &spec.name[..]).collect();
    if let Some(unknown) = only.iter().find(|name| !names.contains(&&name[..])) {
        return Err(Error::Options(format!(
            "no network is called '{unknown}'; there are {}",
            names.join(", ")
        )));
    }
    if !only.is_empty() {
        specs.retain(|spec| only.contains(&spec.name));
    }
    Ok(specs)
}

/// Whether a network belongs to the progressive refinement from n = 128 to n = 512.
fn in_the_chain(spec: &NetworkSpec) -> bool {
    !["inpainting", "surfaces"].contains(&&spec.name[..])
}

struct Settings {
    accurate: AccurateSettings,
    lm: LmSettings,
    adam: AdamSettings,
}

impl Settings {
    /// The paper's progressive training up to the finest of the chosen networks: each starts from the refined kernel
    /// and the activation of the one before. The others have no coarser one and start at random.
    fn progressively(
        &self,
        chosen: &[NetworkSpec],
        device: &ComputeDevice,
        checkpoints: &Partial,
        progress: &Progress,
    ) -> Result<Vec<Trained>, Error> {
        let mut finished: Vec<Trained> = Vec::new();
        let mut settings = self.adam.clone();
        let finest = chosen
            .iter()
            .filter(|s| in_the_chain(s))
            .map(|s| s.cells)
            .max()
            .unwrap_or(0);
        let stages = NetworkSpec::paper()
            .into_iter()
            .filter(|spec| in_the_chain(spec) && spec.cells <= finest);
        for spec in stages {
            let start = finished.last().map(|coarse| &coarse.network);
            finished.push(training::adam(
                &spec,
                &settings,
                start,
                device,
                checkpoints,
                progress,
            )?);
            settings.params.epochs = settings.params.epochs.div_ceil(4);
            // The entries of a refined kernel are 2^-D times as large, and Adam's steps do not scale with them.
            let shrinkage = 0.5_f64.powi(spec.ratios.dimension as i32);
            settings.params.learning_rate *= shrinkage;
            settings.params.final_learning_rate *= shrinkage;
        }
        finished.retain(|trained| chosen.contains(&trained.spec));
        for spec in chosen.iter().filter(|spec| !in_the_chain(spec)) {
            let settings = &self.adam;
            finished.push(training::adam(
                spec,
                settings,
                None,
                device,
                checkpoints,
                progress,
            )?);
        }
        Ok(finished)
    }
}

/// Held-out loss over wall time and over iterations; colour: network, line style: method.
fn figure(run: &RunOptions, all: &[(&'static str, &Trained)]) -> Figure {
    let mut names: Vec<&str> = Vec::new();
    for (_, trained) in all {
        if !names.contains(&&trained.spec.name[..]) {
            names.push(&trained.spec.name);
        }
    }
    let style = |recipe: &str| match recipe {
        "lm" => LineStyle::Solid,
        "accurate" => LineStyle::DashDotDot,
        _ => LineStyle::Dashed,
    };
    let mut figure = Figure::new(run.title("Learning curves"), 2);
    let abscissas: [(&str, fn(&CurvePoint) -> f64); 2] = [
        ("wall time [s]", |point| point.seconds),
        ("iteration or epoch", |point| point.iteration as f64),
    ];
    for (label, abscissa) in abscissas {
        let mut chart = LineChart::new("", Axis::log(label), Axis::log("held-out loss"));
        for (recipe, trained) in all {
            let points: Vec<[f64; 2]> = trained
                .curve
                .iter()
                .map(|point| [abscissa(point), point.held_out_loss])
                .collect();
            let colour = names.iter().position(|name| *name == trained.spec.name);
            chart = chart.with_series(
                Series::new(format!("{} {recipe}", trained.spec.name), points)
                    .with_colour(colour.unwrap_or(0))
                    .with_style(style(recipe)),
            );
        }
        let methods = [
            ("lm", "Levenberg-Marquardt"),
            ("adam", "Adam"),
            ("accurate", "distillation of the least-squares fit"),
        ]
        .into_iter()
        .filter(|(key, _)| all.iter().any(|(recipe, _)| recipe == key))
        .map(|(key, label)| LegendEntry::line(label, Colour::Black, style(key)));
        let networks = names
            .iter()
            .enumerate()
            .map(|(k, name)| LegendEntry::line(*name, k, LineStyle::Solid));
        figure = figure.with_panel(chart.with_entries(methods).with_entries(networks));
    }
    figure.with_shared_legend().with_note(
        "Loss: mean squared nodal error on spheres not trained on. Levenberg-Marquardt uses all sampled points in each \
         iteration; an epoch of Adam is one pass over all radii in batches of 10 grids.",
    )
}

fn write_data(output: &OutputDir, all: &[(&'static str, &Trained)]) -> Result<(), Error> {
    let rows: Vec<CurveRow<'_>> = all
        .iter()
        .flat_map(|(recipe, trained)| {
            trained.curve.iter().map(|point| CurveRow {
                network: &trained.spec.name,
                recipe,
                iteration: point.iteration,
                seconds: point.seconds,
                training_loss: point.training_loss,
                held_out_loss: point.held_out_loss,
            })
        })
        .collect();
    output.write("learning_curves.csv", report::data::to_csv(&rows)?)?;
    output.write("learning_curves.json", report::data::to_json(&rows)?)?;
    Ok(())
}

//! Pictures and quality of the learned 2D operators.

use std::collections::BTreeMap;
use std::process::ExitCode;

use clap::Parser;
use experiments::networks::{NetworkOptions, checksum};
use experiments::options::RunOptions;
use experiments::training::{NetworkSpec, held_out_radii};
use experiments::{Error, harness, quality};
use model::training::levenberg_marquardt::{heat_kernel, splitting_activation};
use model::{Network, Quality};
use report::{
    Axis, Colour, Figure, Heatmap, LineChart, LineStyle, Marker, OutputDir, Series, Summary,
};
use serde::Serialize;

const PROGRAM: &str = "learned_networks";

/// Kernels, activations, transfer functions and quality of the learned operators for n = 128, 256, 512.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    #[command(flatten)]
    networks: NetworkOptions,
}

#[derive(Serialize)]
struct Parameters {
    networks: BTreeMap<String, String>,
    held_out_radii: usize,
    quick: bool,
}

/// A network with the curves that show it.
struct Shown {
    spec: NetworkSpec,
    network: Network,
    heat: Vec<f64>,
    quality: Quality,
}

#[derive(Serialize)]
struct KernelRow {
    network: String,
    offset_x: isize,
    offset_y: isize,
    distance_over_eps: f64,
    kernel: f64,
    heat_kernel: f64,
}

#[derive(Serialize)]
struct ActivationRow {
    network: String,
    w: f64,
    activation: f64,
    splitting: f64,
}

#[derive(Serialize)]
struct TransferRow {
    network: String,
    direction: &'static str,
    eps_k: f64,
    transfer: f64,
    heat: f64,
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let run = &options.run;
    let mut specs = NetworkSpec::paper();
    specs.retain(|spec| spec.name != "inpainting" && (!run.quick || spec.name == "n128"));
    let device = run.open_device()?;
    let ratios: Vec<_> = specs.iter().map(|spec| spec.ratios).collect();
    let networks = options.networks.find(&ratios)?;
    let output = run.open_output(PROGRAM)?;

    let parameters = Parameters {
        networks: specs
            .iter()
            .zip(&networks)
            .map(|(spec, network)| (spec.name.clone(), checksum(network)))
            .collect(),
        held_out_radii: held_out_radii(run.quick),
        quick: run.quick,
    };
    let mut manifest = run.manifest(PROGRAM, &parameters, &device)?;
    let progress = run.progress();
    let bar = progress.bar("held-out losses", specs.len() as u64);
    let mut shown = Vec::new();
    for (spec, network) in specs.into_iter().zip(networks) {
        let data = spec.data(false)?;
        let quality = manifest.phase(format!("quality of {}", spec.name), || {
            Quality::measure(&network, &data, parameters.held_out_radii, &device)
        })?;
        shown.push(Shown {
            heat: heat_kernel(&data),
            spec,
            network,
            quality,
        });
        bar.inc(1);
    }
    bar.finish();

    let width = if shown.len() == 1 { 480.0 } else { 960.0 };
    for (figure, name) in [
        (networks_figure(run, &shown), "learned_networks"),
        (transfer_figure(run, &shown), "transfer"),
        (radial_figure(run, &shown), "radial_symmetry"),
    ] {
        figure.with_width(width).write(&output, name)?;
    }
    write_data(&output, &shown)?;
    let mut table = quality::table(&["network"]);
    let mut summary = Summary::new();
    for one in &shown {
        quality::push(&mut table, &[&one.spec.name], &one.quality)?;
        quality::insert(&mut summary, &one.spec.name, &one.quality)?;
    }
    table.write(&output, "quality")?;
    summary.write(&output)?;
    manifest.write(&output)?;
    progress.clear();
    run.say(&format!(
        "{}\n{}\nResults are in {}",
        run.title("Quality of the learned operators"),
        table.to_markdown(),
        output.as_path().display()
    ));
    Ok(())
}

impl Shown {
    fn title(&self) -> String {
        let width = self.spec.ratios.width;
        format!("n = {}, {width} × {width} kernel", self.spec.cells)
    }

    /// Half the kernel's side in units of `eps`.
    fn reach(&self) -> f64 {
        0.5 * self.spec.ratios.width as f64 / self.spec.ratios.eps_over_h
    }

    /// `K eps^2 / h^2` approximates `eps^2` times the kernel of a convolution integral: comparable across resolutions.
    fn density(&self) -> f64 {
        self.spec.ratios.eps_over_h.powi(2)
    }

    fn step_over_eps2(&self) -> f64 {
        self.spec.ratios.step_over_h2 / self.spec.ratios.eps_over_h.powi(2)
    }

    fn activation(&self) -> impl Iterator<Item = [f64; 3]> {
        (0..=400).map(|i| -1.0 + f64::from(i) / 200.0).map(|w| {
            let splitting = splitting_activation(self.step_over_eps2(), w);
            [w, self.network.activation().value(w), splitting]
        })
    }

    /// `[eps k, transfer function, exp(-tautilde k^2)]` along an axis (`false`) or a diagonal (`true`).
    fn transfer(&self, diagonal: bool) -> Vec<[f64; 3]> {
        let n = self.spec.cells;
        (0..=n / 2)
            .map(|j| {
                let wave = std::f64::consts::TAU * j as f64 / n as f64;
                // The imaginary part vanishes: learned kernels are symmetric.
                let transfer = self.radial().map(|([x, y], [_, kernel, _])| {
                    let steps = if diagonal { x + y } else { x };
                    kernel * (wave * steps as f64).cos()
                });
                let length = wave * if diagonal { 2.0_f64.sqrt() } else { 1.0 };
                let heat = (-self.spec.ratios.step_over_h2 * length * length).exp();
                [length * self.spec.ratios.eps_over_h, transfer.sum(), heat]
            })
            .collect()
    }

    /// `[distance / eps, kernel, heat kernel]` with the offset of every entry.
    fn radial(&self) -> impl Iterator<Item = ([isize; 2], [f64; 3])> {
        let width = self.spec.ratios.width;
        let middle = (width / 2).cast_signed();
        self.network
            .kernel()
            .iter()
            .zip(&self.heat)
            .enumerate()
            .map(move |(i, (&kernel, &heat))| {
                let offset = [i / width, i % width].map(|k| k.cast_signed() - middle);
                let distance = offset.map(|b| b as f64);
                let distance = distance[0].hypot(distance[1]) / self.spec.ratios.eps_over_h;
                (offset, [distance, kernel, heat])
            })
    }
}

/// Kernels as colours above the activations, as in the paper.
fn networks_figure(run: &RunOptions, shown: &[Shown]) -> Figure {
    let mut figure = Figure::new(run.title("Learned operators V[u] = F(K∗u)"), shown.len());
    let highest = shown
        .iter()
        .flat_map(|one| one.network.kernel().iter().map(|k| k * one.density()))
        .fold(0.0, f64::max);
    for one in shown {
        let width = one.spec.ratios.width;
        let values: Vec<f64> = one
            .network
            .kernel()
            .iter()
            .map(|k| k * one.density())
            .collect();
        let axis = |label: &str| Axis::linear(label).with_range(-one.reach(), one.reach());
        figure = figure.with_panel(
            Heatmap::new(one.title(), [width, width], values)
                .with_axes(axis("x / ε"), axis("y / ε"))
                .with_bar(Axis::linear("K ε²/h²").with_range(0.0, highest)),
        );
    }
    for one in shown {
        let learned: Vec<[f64; 2]> = one.activation().map(|[w, f, _]| [w, f]).collect();
        let splitting: Vec<[f64; 2]> = one.activation().map(|[w, _, s]| [w, s]).collect();
        let chart = LineChart::new("", Axis::linear("w"), Axis::linear("F(w)"))
            .with_series(Series::new("learned F", learned).with_width(3.6))
            .with_series(
                Series::new("splitting scheme", splitting)
                    .with_colour(Colour::Black)
                    .with_style(LineStyle::Dashed)
                    .with_width(1.5),
            );
        figure = figure.with_panel(chart);
    }
    figure.with_shared_legend().with_note(
        "The kernels are scaled by ε²/h², so that they approximate one density. Splitting scheme: a heat \
         kernel, then an implicit step of the reaction.",
    )
}

/// The kernels' transfer functions beside that of the heat kernel.
fn transfer_figure(run: &RunOptions, shown: &[Shown]) -> Figure {
    let mut figure = Figure::new(
        run.title("Transfer functions of the learned kernels"),
        shown.len(),
    );
    for one in shown {
        let curve = |diagonal: bool, k: usize| -> Vec<[f64; 2]> {
            let points = one.transfer(diagonal);
            points
                .iter()
                .map(|p| [p[0], p[k]])
                .filter(|p| p[0] <= 9.0)
                .collect()
        };
        let chart = LineChart::new(
            one.title(),
            Axis::linear("ε |k|").with_range(0.0, 9.0),
            Axis::linear("transfer function").with_range(-0.05, 1.05),
        )
        .with_series(Series::new("along an axis", curve(false, 1)).with_width(3.6))
        .with_series(
            Series::new("along a diagonal", curve(true, 1))
                .with_colour(1)
                .with_style(LineStyle::Dashed),
        )
        .with_series(
            Series::new("heat kernel exp(−τ̃ k²)", curve(true, 2))
                .with_colour(Colour::Black)
                .with_style(LineStyle::Dotted)
                .with_width(1.5),
        );
        figure = figure.with_panel(chart);
    }
    for one in shown {
        let curve = |diagonal: bool| -> Vec<[f64; 2]> {
            let points = one.transfer(diagonal);
            points
                .iter()
                .map(|p| [p[0], p[1] - p[2]])
                .filter(|p| p[0] <= 9.0)
                .collect()
        };
        let chart = LineChart::new(
            "",
            Axis::linear("ε |k|").with_range(0.0, 9.0),
            Axis::linear("difference to the heat kernel"),
        )
        .with_series(Series::new("along an axis", curve(false)))
        .with_series(
            Series::new("along a diagonal", curve(true))
                .with_colour(1)
                .with_style(LineStyle::Dashed),
        );
        figure = figure.with_panel(chart);
    }
    figure.with_shared_legend()
}

/// Kernel values over the distance from the centre: one curve, if the kernel is radially symmetric.
fn radial_figure(run: &RunOptions, shown: &[Shown]) -> Figure {
    let mut figure = Figure::new(
        run.title("Radial symmetry of the learned kernels"),
        shown.len(),
    );
    for one in shown {
        let entries: Vec<[f64; 2]> = one
            .radial()
            .map(|(_, p)| [p[0], p[1] * one.density()])
            .filter(|p| p[0] <= 4.0)
            .collect();
        let variance = 4.0 * one.step_over_eps2();
        let heat: Vec<[f64; 2]> = (0..=200)
            .map(|i| f64::from(i) / 50.0)
            .map(|x| {
                [
                    x,
                    (-x * x / variance).exp() / (std::f64::consts::PI * variance),
                ]
            })
            .collect();
        let chart = LineChart::new(
            one.title(),
            Axis::linear("distance / ε").with_range(0.0, 4.0),
            Axis::linear("K ε²/h²"),
        )
        .with_series(
            Series::new("kernel entries", entries)
                .with_style(LineStyle::None)
                .with_marker(Marker::Circle),
        )
        .with_series(
            Series::new("heat kernel", heat)
                .with_colour(Colour::Black)
                .with_style(LineStyle::Dashed)
                .with_width(1.5),
        )
        .with_note(format!(
            "Spread at equal distance: {:.1e} of the largest entry.",
            one.quality.radial_asymmetry
        ));
        figure = figure.with_panel(chart);
    }
    figure.with_shared_legend()
}

fn write_data(output: &OutputDir, shown: &[Shown]) -> Result<(), Error> {
    let (mut kernels, mut activations, mut transfers) = (Vec::new(), Vec::new(), Vec::new());
    for one in shown {
        let network = || one.spec.name.clone();
        for ([offset_x, offset_y], [distance_over_eps, kernel, heat_kernel]) in one.radial() {
            kernels.push(KernelRow {
                network: network(),
                offset_x,
                offset_y,
                distance_over_eps,
                kernel,
                heat_kernel,
            });
        }
        for [w, activation, splitting] in one.activation() {
            activations.push(ActivationRow {
                network: network(),
                w,
                activation,
                splitting,
            });
        }
        for (direction, diagonal) in [("axis", false), ("diagonal", true)] {
            for [eps_k, transfer, heat] in one.transfer(diagonal) {
                transfers.push(TransferRow {
                    network: network(),
                    direction,
                    eps_k,
                    transfer,
                    heat,
                });
            }
        }
    }
    output.write("kernels.csv", report::data::to_csv(&kernels)?)?;
    output.write("activations.csv", report::data::to_csv(&activations)?)?;
    output.write("transfer.csv", report::data::to_csv(&transfers)?)?;
    let all: BTreeMap<&str, (&Quality, &model::Provenance)> = shown
        .iter()
        .map(|one| (&one.spec.name[..], (&one.quality, one.network.provenance())))
        .collect();
    output.write("networks.json", report::data::to_json(&all)?)?;
    Ok(())
}

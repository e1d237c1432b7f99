//! Pictures and quality of the learned 2D operators.

use std::f64::consts::{SQRT_2, TAU};

use crate::prelude::*;
use crate::quality;
use crate::training::{NetworkSpec, held_out_radii};
use model::training::levenberg_marquardt::{heat_kernel, splitting_activation};
use model::{NeededNetwork, Network, Quality};
use report::Heatmap;

const PROGRAM: &str = "learned_networks";

/// Kernels, activations, transfer functions and quality of the learned operators for n = 128, 256, 512.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
pub struct Options {
    #[command(flatten)]
    run: RunOptions,

    #[command(flatten)]
    networks: NetworkOptions,
}

pub fn program(options: &Options) -> Result<(), Error> {
    let run = &options.run;
    let mut specs = NetworkSpec::convergence();
    specs.truncate(if run.quick { 1 } else { specs.len() });
    let device = run.open_device()?;
    let needs: Vec<_> = (specs.iter().map(|spec| NeededNetwork::exactly(spec.ratios))).collect();
    let chosen = options.networks.load(&needs)?;
    let find = |need| Ok(chosen.find(Scheme::Paper, need)?.network);
    let networks: Vec<Network> = needs.iter().map(find).collect::<Result<_, Error>>()?;
    let fingerprints = networks.iter().map(Network::fingerprint);
    let names = specs.iter().map(|spec| spec.name);
    let checksums: BTreeMap<_, _> = names.zip(fingerprints).collect();
    let held_out_radii = held_out_radii(run.quick);
    let parameters = json!({"networks": checksums, "held_out_radii": held_out_radii});
    let mut session = Session::open(PROGRAM, run, device, parameters)?;
    let mut shown = Vec::new();
    for (spec, network) in specs.iter().zip(&networks) {
        let data = spec.data(false)?;
        let quality = session.phase(format!("quality of {}", spec.name), |stage| {
            Ok(Quality::measure(
                network,
                &data,
                held_out_radii,
                stage.device,
            )?)
        })?;
        session.summary.insert_record(spec.name, &quality)?;
        shown.push(Shown::new(spec, network, &heat_kernel(&data), quality));
    }

    let width = if shown.len() == 1 { 480.0 } else { 960.0 };
    for (figure, name) in [
        (operators_figure(&shown), "learned_networks"),
        (transfer_figure(&shown), "transfer"),
        (radial_figure(&shown), "radial_symmetry"),
    ] {
        session.figure(figure.with_width(width), name)?;
    }
    let all = || shown.iter();
    let output = &session.output;
    output.write_csv("kernels.csv", all().flat_map(|one| &one.kernel))?;
    output.write_csv("activations.csv", all().flat_map(|one| &one.activation))?;
    output.write_csv("transfer.csv", all().flat_map(|one| &one.transfer))?;
    let origins: BTreeMap<_, _> = all()
        .map(|one| (one.spec.name, (&one.quality, one.network.provenance())))
        .collect();
    output.write_json("networks.json", &origins)?;
    let table = Sheet::of(&shown).text("network", |one| one.spec.name);
    session.sheet(quality::columns(table, |one| &one.quality), "quality")?;
    session.finish("Quality of the learned operators")
}

struct Shown<'a> {
    spec: &'a NetworkSpec,
    network: &'a Network,
    quality: Quality,
    kernel: Vec<KernelRow<'a>>,
    activation: Vec<ActivationRow<'a>>,
    transfer: Vec<TransferRow<'a>>,
}

#[derive(Serialize)]
struct KernelRow<'a> {
    network: &'a str,
    offset_x: isize,
    offset_y: isize,
    distance_over_eps: f64,
    kernel: f64,
    heat_kernel: f64,
    /// `K eps^2 / h^2` approximates `eps^2` times the kernel of a convolution integral: comparable across resolutions.
    #[serde(skip)]
    density: f64,
}

#[derive(Serialize)]
struct ActivationRow<'a> {
    network: &'a str,
    w: f64,
    activation: f64,
    splitting: f64,
}

#[derive(Serialize)]
struct TransferRow<'a> {
    network: &'a str,
    direction: &'static str,
    eps_k: f64,
    transfer: f64,
    heat: f64,
}

impl<'a> Shown<'a> {
    fn new(spec: &'a NetworkSpec, network: &'a Network, heat: &[f64], quality: Quality) -> Self {
        let kernel = kernel_rows(spec, network, heat);
        let activation = (0..=400).map(|i| -1.0 + f64::from(i) / 200.0);
        let activation = activation.map(|w| ActivationRow {
            network: spec.name,
            w,
            activation: network.activation().value(w),
            splitting: splitting_activation(spec.ratios.step_over_eps2(), w),
        });
        let mut transfer = transfer_rows(spec, &kernel, false);
        transfer.extend(transfer_rows(spec, &kernel, true));
        Self {
            activation: activation.collect(),
            kernel,
            network,
            quality,
            spec,
            transfer,
        }
    }

    fn title(&self) -> String {
        let width = self.spec.ratios.width;
        format!("n = {}, {width} × {width} kernel", self.spec.cells)
    }
}

fn kernel_rows<'a>(spec: &'a NetworkSpec, network: &Network, heat: &[f64]) -> Vec<KernelRow<'a>> {
    let (width, eps_over_h) = (spec.ratios.width, spec.ratios.eps_over_h);
    let middle = (width / 2).cast_signed();
    let row = |(i, (&kernel, &heat_kernel)): (usize, (&f64, &f64))| {
        let [offset_x, offset_y] = [i / width, i % width].map(|k| k.cast_signed() - middle);
        KernelRow {
            network: spec.name,
            offset_x,
            offset_y,
            distance_over_eps: (offset_x as f64).hypot(offset_y as f64) / eps_over_h,
            kernel,
            heat_kernel,
            density: kernel * eps_over_h.powi(2),
        }
    };
    let entries = network.kernel().iter().zip(heat).enumerate();
    entries.map(row).collect()
}

/// Transfer functions along an axis or a diagonal, that of the heat kernel being `exp(-tautilde k^2)`.
fn transfer_rows<'a>(
    spec: &'a NetworkSpec,
    kernel: &[KernelRow<'_>],
    diagonal: bool,
) -> Vec<TransferRow<'a>> {
    let n = spec.cells;
    let row = |j: usize| {
        let wave = TAU * j as f64 / n as f64;
        // The imaginary part vanishes: learned kernels are symmetric.
        let transfer = kernel.iter().map(|row| {
            let steps = row.offset_x + if diagonal { row.offset_y } else { 0 };
            row.kernel * (wave * steps as f64).cos()
        });
        let length = wave * if diagonal { SQRT_2 } else { 1.0 };
        TransferRow {
            network: spec.name,
            direction: if diagonal { "diagonal" } else { "axis" },
            eps_k: length * spec.ratios.eps_over_h,
            transfer: transfer.sum(),
            heat: (-spec.ratios.step_over_h2 * length * length).exp(),
        }
    };
    (0..=n / 2).map(row).collect()
}

fn thin(curve: Series, style: LineStyle) -> Series {
    let curve = curve.with_colour(Colour::Black);
    curve.with_style(style).with_width(1.5)
}

/// Kernels as colours above the activations, as in the paper.
fn operators_figure(shown: &[Shown<'_>]) -> Figure {
    let densities = |one: &Shown<'_>| one.kernel.iter().map(|row| row.density).collect();
    let all: Vec<Vec<f64>> = shown.iter().map(densities).collect();
    let highest = all.iter().flatten().copied().fold(0.0, f64::max);
    let kernel = |(one, values): (&Shown<'_>, Vec<f64>)| {
        let width = one.spec.ratios.width;
        let reach = 0.5 * width as f64 / one.spec.ratios.eps_over_h;
        let axis = |label| Axis::linear(label).with_range(-reach, reach);
        Heatmap::new(one.title(), [width, width], values)
            .with_axes(axis("x / ε"), axis("y / ε"))
            .with_bar(Axis::linear("K ε²/h²").with_range(0.0, highest))
    };
    let activation = |one: &Shown<'_>| {
        let rows = &one.activation;
        let learned = Series::of("learned F", rows, |row| [row.w, row.activation]);
        let splitting = Series::of("splitting scheme", rows, |row| [row.w, row.splitting]);
        LineChart::new("", Axis::linear("w"), Axis::linear("F(w)"))
            .with_series(learned.with_width(3.6))
            .with_series(thin(splitting, LineStyle::Dashed))
    };
    Figure::new("Learned operators V[u] = F(K∗u)", shown.len())
        .with_panels(shown.iter().zip(all).map(kernel))
        .with_panels(shown.iter().map(activation))
        .with_shared_legend()
        .with_note(
            "The kernels are scaled by ε²/h², so that they approximate one density. Splitting scheme: a heat kernel, then \
             an implicit step of the reaction.",
        )
}

/// The kernels' transfer functions beside that of the heat kernel.
fn transfer_figure(shown: &[Shown<'_>]) -> Figure {
    let curve = |one: &Shown<'_>, name, direction, value: fn(&TransferRow<'_>) -> f64| {
        let in_sight = |row: &&TransferRow<'_>| row.direction == direction && row.eps_k <= 9.0;
        let rows = one.transfer.iter().filter(in_sight);
        Series::of(name, rows, |row| [row.eps_k, value(row)])
    };
    let directions = |one: &Shown<'_>, value| {
        let diagonal = curve(one, "along a diagonal", "diagonal", value);
        let diagonal = diagonal.with_colour(1).with_style(LineStyle::Dashed);
        [curve(one, "along an axis", "axis", value), diagonal]
    };
    let axis = || Axis::linear("ε |k|").with_range(0.0, 9.0);
    let transfer = |one: &Shown<'_>| {
        let [along_axis, along_diagonal] = directions(one, |row| row.transfer);
        let heat = curve(one, "heat kernel exp(−τ̃ k²)", "diagonal", |row| {
            row.heat
        });
        let value = Axis::linear("transfer function").with_range(-0.05, 1.05);
        LineChart::new(one.title(), axis(), value)
            .with_series(along_axis.with_width(3.6))
            .with_series(along_diagonal)
            .with_series(thin(heat, LineStyle::Dotted))
    };
    let difference = |one: &Shown<'_>| {
        LineChart::new("", axis(), Axis::linear("difference to the heat kernel"))
            .with_curves(directions(one, |row| row.transfer - row.heat))
    };
    Figure::new("Transfer functions of the learned kernels", shown.len())
        .with_panels(shown.iter().map(transfer))
        .with_panels(shown.iter().map(difference))
        .with_shared_legend()
}

/// Kernel values over the distance from the centre: one curve, if the kernel is radially symmetric.
fn radial_figure(shown: &[Shown<'_>]) -> Figure {
    let panel = |one: &Shown<'_>| {
        let near = one.kernel.iter().filter(|row| row.distance_over_eps <= 4.0);
        let point = |row: &KernelRow<'_>| [row.distance_over_eps, row.density];
        let entries = Series::of("kernel entries", near, point);
        let variance = 4.0 * one.spec.ratios.step_over_eps2();
        let heat = Series::of("heat kernel", 0..=200, |i| {
            let x = f64::from(i) / 50.0;
            [x, (-x * x / variance).exp() / (PI * variance)]
        });
        let distance = Axis::linear("distance / ε").with_range(0.0, 4.0);
        LineChart::new(one.title(), distance, Axis::linear("K ε²/h²"))
            .with_series(entries.with_symbols(Marker::Circle))
            .with_series(thin(heat, LineStyle::Dashed))
            .with_note(format!(
                "Spread at equal distance: {:.1e} of the largest entry.",
                one.quality.radial_asymmetry
            ))
    };
    Figure::new("Radial symmetry of the learned kernels", shown.len())
        .with_panels(shown.iter().map(panel))
        .with_shared_legend()
}

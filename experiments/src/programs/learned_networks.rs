use std::f64::consts::{SQRT_2, TAU};

use crate::prelude::*;
use crate::training::{self, NetworkSpec, held_out_radii, quality};
use model::training::levenberg_marquardt::{heat_kernel, splitting_activation};
use model::{NeededNetwork, Network, Quality};
use report::Heatmap;

pub const EXPERIMENT: Experiment = Experiment {
    name: "learned_networks",
    summary: "Pictures and quality of the learned 2D operators.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "learned_networks",
        title: "Learned networks",
        description: "Kernels, activations and transfer functions of the trained mean curvature operators V[u] = F(K∗u), \
                 and how well they fit.",
        figures: &[
            (
                "learned_networks",
                "Kernels and activations beside those of a splitting scheme.",
            ),
            (
                "radial_symmetry",
                "Entries of the kernels against their distance from the centre.",
            ),
            ("transfer", "Transfer functions of the kernels."),
        ],
        options: Some(""),
    }],
    metrics: &[&training::METRICS],
    words: &[],
};

/// Kernels, activations, transfer functions and quality of the learned operators for n = 128, 256, 512.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    #[command(flatten)]
    networks: NetworkOptions,
}

fn program(options: &Options) -> Result<()> {
    let run = &options.run;
    let specs = &NetworkSpec::CONVERGENCE[..run.either(1, 3)];
    let needs: Vec<_> = (specs.iter().map(|spec| NeededNetwork::exactly(spec.ratios))).collect();
    let chosen = options.networks.load(&needs)?;
    let mut networks: Vec<(NetworkSpec, Network)> = Vec::new();
    for (&spec, need) in specs.iter().zip(&needs) {
        networks.push((spec, chosen.find(Formulation::Paper, need)?.network));
    }
    let checksums = (networks.iter()).map(|(spec, network)| (spec.name, network.fingerprint()));
    let checksums: BTreeMap<_, _> = checksums.collect();
    let parameters = json!({"networks": checksums, "held_out_radii": held_out_radii(run.quick)});
    let mut session = Session::open(EXPERIMENT.name, run, parameters)?;
    let mut shown = Vec::new();
    for (spec, network) in networks {
        let quality = spec.measure(&mut session, &network)?;
        shown.push(Shown {
            entries: entries(spec, &network),
            spec,
            network,
            quality,
        });
    }

    let width = if shown.len() == 1 { 480.0 } else { 960.0 };
    for (figure, name) in [
        (operators_figure(&shown), "learned_networks"),
        (transfer_figure(&shown), "transfer"),
        (radial_figure(&shown), "radial_symmetry"),
    ] {
        session.figure(figure.with_width(width), name)?;
    }
    let kernels: Vec<&Entry> = shown.iter().flat_map(|one| &one.entries).collect();
    let kernels = Sheet::of(&kernels)
        .data("network", |at| at.network)
        .data("offset_x", |at| at.offset_x as f64)
        .data("offset_y", |at| at.offset_y as f64)
        .data("distance_over_eps", |at| at.distance_over_eps)
        .data("kernel", |at| at.kernel)
        .data("heat_kernel", |at| at.heat_kernel);
    session.csv(kernels, "kernels")?;
    let points = |one| arguments().map(move |w| (one, w));
    let activations: Vec<(&Shown, f64)> = shown.iter().flat_map(points).collect();
    let activations = Sheet::of(&activations)
        .data("network", |(one, _)| one.spec.name)
        .data("w", |(_, w)| *w)
        .data("activation", |(one, w)| one.activation(*w))
        .data("splitting", |(one, w)| one.splitting(*w));
    session.csv(activations, "activations")?;
    let both = |one| ["axis", "diagonal"].map(|direction| Shown::transfer(one, direction));
    let transfers: Vec<TransferRow> = shown.iter().flat_map(both).flatten().collect();
    let transfers = Sheet::of(&transfers)
        .data("network", |at| at.network)
        .data("direction", |at| at.direction)
        .data("eps_k", |at| at.eps_k)
        .data("transfer", |at| at.transfer)
        .data("heat", |at| at.heat);
    session.csv(transfers, "transfer")?;
    let origins: BTreeMap<_, _> = (shown.iter())
        .map(|one| (one.spec.name, (&one.quality, &one.network.provenance)))
        .collect();
    session.output.write_json("networks.json", &origins)?;
    let table = Sheet::of(&shown).text("network", |one| one.spec.name);
    session.sheet(quality(table, |one| &one.quality), "quality")?;
    session.finish("Quality of the learned operators")
}

struct Shown {
    spec: NetworkSpec,
    network: Network,
    quality: Quality,
    entries: Vec<Entry>,
}

/// An entry of a kernel.
struct Entry {
    network: &'static str,
    offset_x: isize,
    offset_y: isize,
    distance_over_eps: f64,
    kernel: f64,
    heat_kernel: f64,
    /// `K eps^2 / h^2` approximates `eps^2` times the kernel of a convolution integral: comparable across resolutions.
    density: f64,
}

fn entries(spec: NetworkSpec, network: &Network) -> Vec<Entry> {
    let (width, eps_over_h) = (spec.ratios.width, spec.ratios.eps_over_h);
    let (middle, heat) = ((width / 2).cast_signed(), heat_kernel(spec.ratios));
    let entry = |(i, (&kernel, &heat_kernel)): (usize, (&f64, &f64))| {
        let [offset_x, offset_y] = [i / width, i % width].map(|k| k.cast_signed() - middle);
        Entry {
            network: spec.name,
            offset_x,
            offset_y,
            distance_over_eps: (offset_x as f64).hypot(offset_y as f64) / eps_over_h,
            kernel,
            heat_kernel,
            density: kernel * eps_over_h.powi(2),
        }
    };
    let entries = network.kernel().iter().zip(&heat).enumerate();
    entries.map(entry).collect()
}

/// The transfer function of a kernel along an axis or a diagonal, and `exp(-tautilde k^2)` of the heat kernel.
struct TransferRow {
    network: &'static str,
    direction: &'static str,
    eps_k: f64,
    transfer: f64,
    heat: f64,
}

/// The arguments `w` at which activations are tabulated and drawn.
fn arguments() -> impl Iterator<Item = f64> {
    (0..=400).map(|i| -1.0 + f64::from(i) / 200.0)
}

impl Shown {
    fn title(&self) -> String {
        let width = self.spec.ratios.width;
        format!("n = {}, {width} × {width} kernel", self.spec.cells)
    }

    fn activation(&self, w: f64) -> f64 {
        self.network.activation().value(w)
    }

    /// The activation of the splitting scheme.
    fn splitting(&self, w: f64) -> f64 {
        splitting_activation(self.spec.ratios.step_over_eps2(), w)
    }

    fn transfer(&self, direction: &'static str) -> impl Iterator<Item = TransferRow> {
        let (n, diagonal) = (self.spec.cells, direction == "diagonal");
        (0..=n / 2).map(move |j| {
            let wave = TAU * j as f64 / n as f64;
            // The imaginary part vanishes: learned kernels are symmetric.
            let transfer = self.entries.iter().map(|entry| {
                let steps = entry.offset_x + if diagonal { entry.offset_y } else { 0 };
                entry.kernel * (wave * steps as f64).cos()
            });
            let length = wave * if diagonal { SQRT_2 } else { 1.0 };
            TransferRow {
                network: self.spec.name,
                direction,
                eps_k: length * self.spec.ratios.eps_over_h,
                transfer: transfer.sum(),
                heat: (-self.spec.ratios.step_over_h2 * length * length).exp(),
            }
        })
    }
}

fn thin(curve: Series, style: LineStyle) -> Series {
    let curve = curve.with_colour(Colour::Black);
    curve.with_style(style).with_width(1.5)
}

/// Kernels as colours above the activations, as in the paper.
fn operators_figure(shown: &[Shown]) -> Figure {
    let densities = |one: &Shown| one.entries.iter().map(|entry| entry.density).collect();
    let all: Vec<Vec<f64>> = shown.iter().map(densities).collect();
    let highest = all.iter().flatten().copied().fold(0.0, f64::max);
    let kernel = |(one, values): (&Shown, Vec<f64>)| {
        let width = one.spec.ratios.width;
        let reach = 0.5 * width as f64 / one.spec.ratios.eps_over_h;
        let axis = |label| Axis::linear(label).with_range(-reach, reach);
        let bar = Axis::linear("K ε²/h²").with_range(0.0, highest);
        let axes = [axis("x / ε"), axis("y / ε"), bar];
        Heatmap::new(one.title(), axes, [width, width], values)
    };
    let activation = |one: &Shown| {
        let learned = Series::of("learned F", arguments(), |w| [w, one.activation(w)]);
        let splitting = |w| [w, one.splitting(w)];
        let splitting = Series::of("splitting scheme", arguments(), splitting);
        LineChart::new("", Axis::linear("w"), Axis::linear("F(w)"))
            .with_curves([learned.with_width(3.6), thin(splitting, LineStyle::Dashed)])
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
fn transfer_figure(shown: &[Shown]) -> Figure {
    let curve = |one: &Shown, name, direction, value: fn(&TransferRow) -> f64| {
        let in_sight = one.transfer(direction).filter(|at| at.eps_k <= 9.0);
        Series::of(name, in_sight, |at| [at.eps_k, value(&at)])
    };
    let directions = |one: &Shown, value| {
        let diagonal = curve(one, "along a diagonal", "diagonal", value);
        let diagonal = diagonal.with_colour(1).with_style(LineStyle::Dashed);
        [curve(one, "along an axis", "axis", value), diagonal]
    };
    let axis = || Axis::linear("ε |k|").with_range(0.0, 9.0);
    let transfer = |one: &Shown| {
        let [along_axis, along_diagonal] = directions(one, |at| at.transfer);
        let heat = curve(one, "heat kernel exp(−τ̃ k²)", "diagonal", |at| {
            at.heat
        });
        let value = Axis::linear("transfer function").with_range(-0.05, 1.05);
        LineChart::new(one.title(), axis(), value).with_curves([
            along_axis.with_width(3.6),
            along_diagonal,
            thin(heat, LineStyle::Dotted),
        ])
    };
    let difference = |one: &Shown| {
        LineChart::new("", axis(), Axis::linear("difference to the heat kernel"))
            .with_curves(directions(one, |at| at.transfer - at.heat))
    };
    Figure::new("Transfer functions of the learned kernels", shown.len())
        .with_panels(shown.iter().map(transfer))
        .with_panels(shown.iter().map(difference))
        .with_shared_legend()
}

/// Kernel values over the distance from the centre: one curve, if the kernel is radially symmetric.
fn radial_figure(shown: &[Shown]) -> Figure {
    let panel = |one: &Shown| {
        let near = one.entries.iter().filter(|at| at.distance_over_eps <= 4.0);
        let entries = Series::of("kernel entries", near, |at| {
            [at.distance_over_eps, at.density]
        });
        let variance = 4.0 * one.spec.ratios.step_over_eps2();
        let heat = Series::of("heat kernel", 0..=200, |i| {
            let x = f64::from(i) / 50.0;
            [x, (-x * x / variance).exp() / (PI * variance)]
        });
        let distance = Axis::linear("distance / ε").with_range(0.0, 4.0);
        LineChart::new(one.title(), distance, Axis::linear("K ε²/h²"))
            .with_curves([
                entries.with_symbols(Marker::Circle),
                thin(heat, LineStyle::Dashed),
            ])
            .with_note(format!(
                "Spread at equal distance: {:.1e} of the largest entry.",
                one.quality.radial_asymmetry
            ))
    };
    Figure::new("Radial symmetry of the learned kernels", shown.len())
        .with_panels(shown.iter().map(panel))
        .with_shared_legend()
}

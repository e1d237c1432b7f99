//! Draws one picture of every kind: `cargo run -p report --example gallery -- <folder>`.

use std::f64::consts::TAU;

use report::{
    Axis, Colour, ColourMap, Curve, Error, Figure, Heatmap, Legend, LegendEntry, LineChart,
    LineStyle, Marker, OutputDir, Reference, Series, Shapes,
};

const STYLES: [LineStyle; 4] = [
    LineStyle::Solid,
    LineStyle::Dashed,
    LineStyle::DashDot,
    LineStyle::Dotted,
];

/// Error over time for several methods (line style) and resolutions (colour).
fn error_over_time() -> LineChart {
    let methods = ["learned", "implicit FEM", "semi-implicit FEM"];
    let sizes = [64_u32, 128, 256, 512];
    let mut chart = LineChart::new(
        "Radius error of a growing circle",
        Axis::linear("time t / R₀⁴"),
        Axis::log("|R(t) − R*(t)| / R₀"),
    );
    for (m, (&style, factor)) in STYLES.iter().zip([1.0, 3.0, 9.0]).enumerate() {
        for (k, &n) in sizes.iter().enumerate() {
            let h = 1.0 / f64::from(n);
            let points: Vec<[f64; 2]> = (0..=200)
                .map(|i| {
                    let t = f64::from(i) / 1000.0;
                    let growth = 1.0 - (-t / 0.03).exp();
                    [t, h * h * 20.0 * factor * growth * (1.0 + 4.0 * t)]
                })
                .collect();
            chart = chart.with_series(
                Series::new(format!("{} N = {n}", methods[m]), points)
                    .with_colour(k)
                    .with_style(style),
            );
        }
    }
    chart
        .with_entries(
            methods
                .iter()
                .zip(STYLES)
                .map(|(name, style)| LegendEntry::line(*name, Colour::Black, style)),
        )
        .with_entries(
            (0_usize..)
                .zip(sizes)
                .map(|(k, n)| LegendEntry::line(format!("N = {n}"), k, LineStyle::Solid)),
        )
        .with_reference(Reference::horizontal(1.0 / 512.0, "grid spacing h = 1/512"))
        .with_note("Line style: method. Colour: resolution. ε = 2h, τ = ε⁴.")
}

fn convergence() -> LineChart {
    let steps: Vec<f64> = (5..=10).map(|k| 0.5_f64.powi(k)).collect();
    let curve =
        |f: &dyn Fn(f64) -> f64| -> Vec<[f64; 2]> { steps.iter().map(|&h| [h, f(h)]).collect() };
    LineChart::new(
        "Convergence in space",
        Axis::log("h / L"),
        Axis::log("L² error of u(T)"),
    )
    .with_series(Series::new("learned", curve(&|h| 3.0 * h.powf(2.05))).with_marker(Marker::Circle))
    .with_series(
        Series::new("implicit FEM", curve(&|h| 1.1 * h.powf(1.9)))
            .with_colour(1)
            .with_marker(Marker::Square),
    )
    .with_series(
        Series::new("semi-implicit FEM", curve(&|h| 0.5 * h))
            .with_colour(2)
            .with_marker(Marker::Triangle),
    )
    .with_series(
        Series::new("order 2", curve(&|h| 6.0 * h * h))
            .with_colour(Colour::Grey)
            .with_style(LineStyle::Dotted),
    )
}

fn energy() -> LineChart {
    let curve = |rate: f64| -> Vec<[f64; 2]> {
        (0..=300)
            .map(|i| f64::from(i) * 1e-6)
            .map(|t| [t, 1.2e-5 + 4e-5 * (-rate * t).exp()])
            .collect()
    };
    LineChart::new(
        "Willmore energy",
        Axis::linear("time"),
        Axis::linear("W(t) − W(∞)"),
    )
    .with_series(Series::new("learned", curve(3e4)))
    .with_series(
        Series::new("implicit FEM", curve(2e4))
            .with_colour(1)
            .with_style(LineStyle::Dashed),
    )
    .with_reference(Reference::horizontal(1.2e-5, "minimum"))
    .with_reference(Reference::vertical(1.5e-4, "topology change"))
}

fn field(n: usize, f: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let at = |k: usize| (k as f64 + 0.5) / n as f64;
    (0..n * n).map(|k| f(at(k / n), at(k % n))).collect()
}

fn blob(phase: f64, size: f64, lobes: f64) -> Vec<[f64; 2]> {
    (0..240)
        .map(|k| {
            let angle = TAU * f64::from(k) / 240.0;
            let r = 0.3 * (1.0 + size * (lobes * angle + phase).cos());
            [0.5 + r * angle.cos(), 0.5 + r * angle.sin()]
        })
        .collect()
}

fn evolution() -> Figure {
    let times = ["t = 0", "t = 10⁻⁵", "t = 10⁻⁴", "t = 10⁻³"];
    let mut figure = Figure::new("A clover relaxes to a circle", times.len())
        .with_column_labels(times)
        .with_row_labels(["learned", "implicit FEM"])
        .with_note("Filled: the set u > 0. Dashed: the exact interface.");
    for row in 0..2 {
        for column in 0..4 {
            let size = 0.3 * 0.45_f64.powi(column);
            let hole: Vec<[f64; 2]> = blob(0.0, 0.0, 1.0)
                .iter()
                .map(|p| p.map(|c| 0.5 + 0.25 * (c - 0.5)))
                .collect();
            let set = Curve::new(vec![blob(0.1 * f64::from(row), size, 4.0), hole])
                .with_colour(row as usize)
                .filled(Colour::LightGrey)
                .with_label(["learned", "implicit FEM"][row as usize]);
            let exact = Curve::new(vec![blob(0.0, size, 4.0)])
                .with_style(LineStyle::Dashed)
                .with_label("exact");
            figure = figure.with_panel(Shapes::new("").with_curve(set).with_curve(exact));
        }
    }
    figure
}

fn main() -> Result<(), Error> {
    let path = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "gallery".to_owned());
    let folder = OutputDir::create(path)?;
    Figure::from(error_over_time()).write(&folder, "error_over_time")?;
    Figure::from(convergence()).write(&folder, "convergence")?;

    let wave = |x: f64, y: f64| (TAU * x).sin() * (TAU * y).cos() * (1.0 + x);
    let phase = |x: f64, y: f64| (30.0 * (0.3 - (x - 0.5).hypot(y - 0.5))).tanh();
    let map = Heatmap::new("Phase field u", [64, 64], field(64, phase))
        .with_bar(Axis::linear("u"))
        .with_curve(Curve::new(vec![blob(0.0, 0.0, 1.0)]).with_colour(report::Rgb(255, 255, 255)));
    let signed = Heatmap::new(
        "Mean curvature",
        [96, 96],
        field(96, |x, y| 1e-4 * wave(x, y)),
    )
    .with_map(ColourMap::BlueWhiteRed)
    .with_bar(Axis::linear("error of V[u]"));
    let logarithmic = Heatmap::new(
        "Residual",
        [48, 48],
        field(48, |x, y| wave(x, y).abs().powi(3)),
    )
    .with_bar(Axis::log("|residual|"));
    Figure::from(signed.clone())
        .with_width(560.0)
        .write(&folder, "heatmap")?;

    Figure::new("One circle in four views", 2)
        .with_panel(convergence())
        .with_panel(energy())
        .with_panel(map.clone())
        .with_panel(signed.clone())
        .write(&folder, "panels")?;
    Figure::new("Three heat maps", 3)
        .with_panel(map)
        .with_panel(signed)
        .with_panel(logarithmic)
        .write(&folder, "three_maps")?;
    evolution().write(&folder, "evolution")?;

    let mut crowded = LineChart::new(
        "A plot too full for a legend inside, with a title so long that it has to be wrapped",
        Axis::linear("x"),
        Axis::linear("y"),
    );
    for k in 0..8_usize {
        let points: Vec<[f64; 2]> = (0..=400)
            .map(|i| f64::from(i) / 40.0)
            .map(|x| [x, (x * (1.0 + 0.3 * k as f64)).sin() * (k + 1) as f64])
            .collect();
        crowded = crowded.with_series(
            Series::new(format!("frequency {}", k + 1), points)
                .with_colour(k)
                .with_style(STYLES[k % 4]),
        );
    }
    Figure::from(crowded.clone()).write(&folder, "crowded")?;
    Figure::from(error_over_time().with_legend(Legend::Right)).write(&folder, "right")?;
    Figure::new("Shared legend, three columns", 3)
        .with_panel(convergence())
        .with_panel(convergence())
        .with_panel(convergence())
        .with_shared_legend()
        .write(&folder, "shared")
}

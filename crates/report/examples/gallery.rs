//! Draws a picture of every kind: `cargo run -p report --example gallery -- <folder>`.

use std::f64::consts::TAU;

use report::{
    Axis, Colour, Curve, Error, Figure, Heatmap, LegendEntry, LineChart, LineStyle, Marker,
    OutputDir, Raster, Series, Shapes,
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
    for (&style, factor) in STYLES.iter().zip([1.0, 3.0, 9.0]) {
        for (k, &n) in sizes.iter().enumerate() {
            let scale = 20.0 * factor / f64::from(n).powi(2);
            let curve = Series::of("", (0..=200).map(|i| f64::from(i) / 1000.0), |t| {
                [t, scale * (1.0 - (-t / 0.03).exp()) * (1.0 + 4.0 * t)]
            });
            chart = chart.with_series(curve.with_colour(k).with_style(style));
        }
    }
    let named = methods.iter().zip(STYLES);
    let sized = sizes.iter().enumerate();
    chart
        .with_entries(named.map(|(name, style)| LegendEntry::line(*name, Colour::Black, style)))
        .with_entries(
            sized.map(|(k, n)| LegendEntry::line(format!("N = {n}"), k, LineStyle::Solid)),
        )
        .with_note("Line style: method. Colour: resolution. ε = 2h, τ = ε⁴.")
}

fn convergence() -> LineChart {
    let steps: Vec<f64> = (5..=10).map(|k| 0.5_f64.powi(k)).collect();
    let power = |name, factor: f64, order: f64| {
        Series::of(name, &steps, move |h| [*h, factor * h.powf(order)])
    };
    let guide = power("order 2", 6.0, 2.0).with_colour(Colour::Grey);
    LineChart::new(
        "Convergence",
        Axis::log("h / L"),
        Axis::log("L² error of u(T)"),
    )
    .with_curves([
        power("learned", 3.0, 2.05).with_marker(Marker::Circle),
        power("implicit FEM", 1.1, 1.9)
            .with_colour(1)
            .with_marker(Marker::Square),
        power("semi-implicit FEM", 0.5, 1.0)
            .with_colour(2)
            .with_marker(Marker::Triangle),
        guide.with_style(LineStyle::Dotted),
    ])
}

fn energy() -> LineChart {
    let curve = |name, rate: f64| {
        let times = (0..=300).map(|i| f64::from(i) * 1e-6);
        Series::of(name, times, move |t| [t, 1.2e-5 + 4e-5 * (-rate * t).exp()])
    };
    LineChart::new(
        "Willmore energy",
        Axis::linear("time"),
        Axis::linear("W(t) − W(∞)"),
    )
    .with_series(curve("learned", 3e4))
    .with_series(
        curve("implicit FEM", 2e4)
            .with_colour(1)
            .with_style(LineStyle::Dashed),
    )
}

fn map(title: &str, n: usize, value: impl Fn(f64, f64) -> f64) -> Heatmap {
    let at = |k: usize| (k as f64 + 0.5) / n as f64;
    let values: Vec<f64> = (0..n * n).map(|k| value(at(k / n), at(k % n))).collect();
    Heatmap::new(title, [n, n], values)
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
    for row in 0..2_usize {
        for column in 0..4 {
            let size = 0.3 * 0.45_f64.powi(column);
            let smaller = |p: &[f64; 2]| p.map(|c| 0.5 + 0.25 * (c - 0.5));
            let hole: Vec<[f64; 2]> = blob(0.0, 0.0, 1.0).iter().map(smaller).collect();
            let set = Curve::new(vec![blob(0.1 * row as f64, size, 4.0), hole])
                .with_colour(row)
                .filled(Colour::LightGrey);
            let exact = Curve::new(vec![blob(0.0, size, 4.0)]).with_style(LineStyle::Dashed);
            let panel = Shapes::new("").with_window([0.0, 1.0], [0.0, 1.0]);
            figure = figure.with_panel(panel.with_curve(set).with_curve(exact));
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
    evolution().write(&folder, "evolution")?;

    let wave = |x: f64, y: f64| (TAU * x).sin() * (TAU * y).cos() * (1.0 + x);
    let phase = |x: f64, y: f64| (30.0 * (0.3 - (x - 0.5).hypot(y - 0.5))).tanh();
    let field = map("Phase field u", 64, phase).with_bar(Axis::linear("u"));
    let error = map("Error", 96, |x, y| 1e-4 * wave(x, y)).with_bar(Axis::linear("error of V[u]"));
    let residual = map("Residual", 48, |x, y| wave(x, y).abs().powi(3));
    Figure::from(error.clone())
        .with_width(560.0)
        .write(&folder, "heatmap")?;
    let shaded: Vec<[u8; 4]> = (0..90_u8)
        .flat_map(|row| [[2 * row, 90, 160, 255]; 120])
        .collect();
    Figure::new("One circle in six views", 3)
        .with_panels([convergence(), energy()])
        .with_panel(Raster::new([120, 90], shaded).with_caption("a picture"))
        .with_panels([field, error, residual.with_bar(Axis::log("|residual|"))])
        .write(&folder, "panels")?;

    let title =
        "A plot with a title so long that it has to be wrapped and a legend of many entries";
    let mut crowded = LineChart::new(title, Axis::linear("x"), Axis::linear("y"));
    for k in 0..8_usize {
        let curve = Series::of(format!("frequency {}", k + 1), 0..=400, |i| {
            let x = f64::from(i) / 40.0;
            [x, (x * (1.0 + 0.3 * k as f64)).sin() * (k + 1) as f64]
        });
        crowded = crowded.with_series(curve.with_colour(k).with_style(STYLES[k % 4]));
    }
    Figure::from(crowded).write(&folder, "crowded")?;
    Figure::new("Shared legend, three columns", 3)
        .with_panels([convergence(), convergence(), convergence()])
        .with_shared_legend()
        .write(&folder, "shared")
}

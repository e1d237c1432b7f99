//! Figures of flows of circles: colours stand for methods, and panels for resolutions, whose curves would cover each other.

use crate::circles::Averages;
use crate::prelude::*;

/// Width of a panel beside others, in layout units.
const PANEL: f64 = 260.0;

/// What the figures show.
pub struct Drawing {
    pub averages: Vec<Averages>,
    /// How far the exact solutions move.
    pub scales: Vec<(Flow, f64)>,
}

impl Drawing {
    /// All figures, and their names.
    pub fn figures(&self) -> [(&'static str, Figure); 5] {
        let note = format!("{}\n{}", self.scheme(), self.scale());
        [
            ("convergence", self.convergence().with_note(&note)),
            ("error_over_time", self.over_time().with_note(&note)),
            ("error_over_radius", self.over_radius()),
            ("work_per_step", self.work()),
            ("error_over_cost", self.cost()),
        ]
    }

    fn convergence(&self) -> Figure {
        let charts = Flow::ALL.map(|flow| {
            let n = Axis::log("cells per unit length n");
            let chart = LineChart::new(flow.title(), n, Axis::log("mean L² error"));
            let point = |one: &Averages| [one.variant.n as f64, one.error()];
            self.with_curves(chart, self.over_resolutions(flow, point))
        });
        let title = format!("Error on circles at t = {:.4}", self.end());
        (Figure::new(title, 2).with_panels(charts)).with_shared_legend()
    }

    fn over_time(&self) -> Figure {
        let rows = Flow::ALL.map(|flow| {
            let labels = ["time t", "mean L² error"];
            let points = |one: &Averages| at_times(0, &one.errors);
            self.panels(flow, flow.title(), labels, log, points)
        });
        Self::grid("Error on circles over time", rows)
    }

    fn over_radius(&self) -> Figure {
        let rows = Flow::ALL.map(|flow| {
            let labels = ["initial radius r", "L² error"];
            self.panels(flow, flow.title(), labels, log, |one| one.ends.clone())
        });
        let title = format!("Error on circles at t = {:.4} over the radius", self.end());
        Self::grid(&title, rows)
    }

    fn work(&self) -> Figure {
        let rows = ["Hessian-vector products", "Newton steps"].into_iter();
        let rows = rows.enumerate().map(|(i, title)| {
            let points = |one: &Averages| {
                let counts: Vec<f64> = one.work.iter().map(|counts| counts[i]).collect();
                at_times(1, &counts)
            };
            self.panels(
                Flow::Willmore,
                title,
                ["time t", "per step"],
                from_zero,
                points,
            )
        });
        Self::grid(
            "Work per step of Willmore flow, mean over the circles",
            rows,
        )
    }

    /// Error at the end over the mean wall time of a circle.
    fn cost(&self) -> Figure {
        let error = Axis::log(format!("mean L² error at t = {:.4}", self.end()));
        let chart = LineChart::new("", Axis::log("wall time per circle [s]"), error);
        let point = |one: &Averages| [one.seconds, one.error()];
        Figure::new("Willmore flow of circles: accuracy against cost", 1)
            .with_panel(chart.with_curves(self.over_resolutions(Flow::Willmore, point)))
            .with_shared_legend()
            .with_note(format!(
                "{} time steps; mean over {} circles, each on one core.",
                self.averages[0].errors.len() - 1,
                self.averages[0].ends.len()
            ))
    }

    fn end(&self) -> f64 {
        time(self.averages[0].errors.len() - 1)
    }

    fn scheme(&self) -> String {
        let ends = &self.averages[0].ends;
        let (count, first, last) = (ends.len(), ends[0][0], ends[ends.len() - 1][0]);
        format!(
            "ε = 2⁻⁶, τ = 2⁻¹⁴, h = 1/n; mean over {count} circles with radii between {first:.3} and {last:.3}."
        )
    }

    fn scale(&self) -> String {
        let scale = |(flow, scale): &(Flow, f64)| format!("{}: {scale:.3}", flow.title());
        let scales: Vec<String> = self.scales.iter().map(scale).collect();
        let (end, scales) = (self.end(), scales.join("; "));
        format!("For scale, mean ‖u(t) − u(0)‖ at t = {end:.4}. {scales}.")
    }

    fn of_flow(&self, flow: Flow) -> impl Iterator<Item = &Averages> {
        (self.averages.iter()).filter(move |one| one.variant.flow == flow)
    }

    /// Adds curves, and a legend of all methods of all panels.
    fn with_curves(&self, chart: LineChart, curves: impl IntoIterator<Item = Series>) -> LineChart {
        let has = |one: &Discretization| {
            let mut variants = self.averages.iter().map(|averages| averages.variant);
            variants.any(|variant| variant.discretization == *one)
        };
        let methods = study::discretizations().filter(has);
        let entries =
            methods.map(|one| LegendEntry::line(one.label(), study::colour(one), LineStyle::Solid));
        chart.with_curves(curves).with_entries(entries)
    }

    /// A curve for each method, a point for each of its resolutions, which the name of the curve has.
    fn over_resolutions(&self, flow: Flow, point: impl Fn(&Averages) -> [f64; 2]) -> Vec<Series> {
        let own = |discretization| {
            let averages = self.of_flow(flow);
            averages.filter(move |one| one.variant.discretization == discretization)
        };
        let shown = study::discretizations().filter(|&one| own(one).next().is_some());
        let curve = |discretization: Discretization| {
            let cells: Vec<String> = own(discretization)
                .map(|one| one.variant.n.to_string())
                .collect();
            let name = format!("{}, n = {}", discretization.label(), cells.join(", "));
            Series::of(name, own(discretization), &point)
                .with_colour(study::colour(discretization))
                .with_marker(Marker::Circle)
        };
        shown.map(curve).collect()
    }

    /// A panel for each resolution, a curve for each method. All have the same range of values.
    fn panels(
        &self,
        flow: Flow,
        title: &str,
        [x, y]: [&str; 2],
        axis: impl Fn(&str, [f64; 2]) -> Axis,
        points: impl Fn(&Averages) -> Vec<[f64; 2]>,
    ) -> Vec<LineChart> {
        let mut panels: BTreeMap<usize, Vec<Series>> = BTreeMap::new();
        let mut range = [f64::INFINITY, 0.0];
        for one in self.of_flow(flow) {
            let points = points(one);
            for value in points
                .iter()
                .map(|point| point[1])
                .filter(|value| *value > 0.0)
            {
                range = [value.min(range[0]), value.max(range[1])];
            }
            let curve = Series::new(one.variant.label(), points);
            let curve = curve.with_colour(study::colour(one.variant.discretization));
            panels.entry(one.variant.n).or_default().push(curve);
        }
        let panel = |(n, curves)| {
            let title = format!("{title}, n = {n}");
            let chart = LineChart::new(title, Axis::linear(x), axis(y, range));
            self.with_curves(chart, curves)
        };
        panels.into_iter().map(panel).collect()
    }

    /// Rows of panels; a single one of each is beside the other.
    fn grid(title: &str, rows: impl IntoIterator<Item = Vec<LineChart>>) -> Figure {
        let rows: Vec<Vec<LineChart>> = rows.into_iter().collect();
        let columns = rows.iter().map(Vec::len).max().unwrap_or(0).max(2);
        Figure::new(title, columns)
            .with_panels(rows.into_iter().flatten())
            .with_width((columns as f64 * PANEL).max(800.0))
            .with_shared_legend()
    }
}

/// Values of the steps from `first` on, over their times.
fn at_times(first: usize, values: &[f64]) -> Vec<[f64; 2]> {
    let values = values.iter().enumerate();
    values.map(|(k, value)| [time(first + k), *value]).collect()
}

fn log(label: &str, [low, high]: [f64; 2]) -> Axis {
    Axis::log(label).with_range(low / 1.2, 1.2 * high)
}

fn from_zero(label: &str, [_, high]: [f64; 2]) -> Axis {
    Axis::linear(label).with_range(0.0, 1.1 * high)
}

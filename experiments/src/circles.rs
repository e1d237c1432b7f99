//! Circles under mean curvature flow and Willmore flow, compared with the exact solutions
//! (eq:analyticSolutionMCFCircle and `R(t) = (r^4 + 2t)^(1/4)`).

use std::f64::consts::PI;

use fem::LinearSolver;
use geometry::exact::{mean_curvature_radius, willmore_radius};
use geometry::measure::l2_distance;
use geometry::shapes::Ball;
use geometry::{Field, Grid, phase_field};
use indicatif::ProgressBar;
use model::Network;
use operators::ComputeDevice;
use serde::{Deserialize, Serialize};
use solver::{Factors, FlowParams, NewtonParams, StepRecord};

use crate::Error;
use crate::harness::{in_parallel, workers};
use crate::method::{Method, Scheme};
use crate::networks::checksum;
use crate::partial::Partial;

/// Interface width `eps = 2^-6`.
pub const EPS: f64 = 1.0 / 64.0;
/// Time step `tau = tautilde = 2^-14` of both flows.
pub const STEP: f64 = 1.0 / 16384.0;
/// Number of circles.
pub const COUNT: usize = 30;
/// Number of time steps.
pub const STEPS: usize = 64;
/// Distance of the interface to the box's boundary, `19.2 eps`: the profile's tails are below `1e-12` there.
const MARGIN: f64 = 0.3;

/// The geometric flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Flow {
    /// Mean curvature flow.
    #[serde(rename = "mcf")]
    MeanCurvature,
    /// Willmore flow.
    Willmore,
}

impl Flow {
    /// Both flows.
    pub const ALL: [Self; 2] = [Self::MeanCurvature, Self::Willmore];

    /// Name in files and metrics.
    pub fn key(self) -> &'static str {
        match self {
            Self::MeanCurvature => "mcf",
            Self::Willmore => "willmore",
        }
    }

    /// Name in titles.
    pub fn title(self) -> &'static str {
        match self {
            Self::MeanCurvature => "Mean curvature flow",
            Self::Willmore => "Willmore flow",
        }
    }

    /// Radius of a circle at time `t`.
    pub fn radius(self, r: f64, t: f64) -> f64 {
        match self {
            Self::MeanCurvature => mean_curvature_radius(r, t, 2),
            Self::Willmore => willmore_radius(r, t, 2),
        }
    }
}

/// `count` of the radii `r_i = 0.05 pi + 0.15 pi i / 30`, `i = 0..29`, evenly chosen.
pub fn radii(count: usize) -> Vec<f64> {
    (0..count)
        .map(|k| k * COUNT / count)
        .map(|i| 0.05 * PI + 0.15 * PI * i as f64 / COUNT as f64)
        .collect()
}

/// Cells per side of the smallest suitable box for a circle: the interface stays 0.3 away from the boundary, and the
/// number is even and a product of 2, 3 and 5, good for Fourier transforms.
pub fn box_cells(flow: Flow, radius: f64, steps: usize, cells_per_unit: usize) -> usize {
    let last = flow.radius(radius, steps as f64 * STEP);
    let side = 2.0 * (radius.max(last) + MARGIN);
    let mut cells = (side * cells_per_unit as f64).ceil() as usize;
    cells += cells % 2;
    while !is_smooth(cells) {
        cells += 2;
    }
    cells
}

fn is_smooth(mut number: usize) -> bool {
    for prime in [2, 3, 5] {
        while number.is_multiple_of(prime) {
            number /= prime;
        }
    }
    number == 1
}

/// One circle, with everything its result depends on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Circle {
    /// Which flow.
    pub flow: Flow,
    /// Which method.
    pub method: Method,
    /// Which scheme of Willmore flow.
    pub scheme: Scheme,
    /// Cells per unit length.
    pub cells_per_unit: usize,
    /// Number in the list of radii.
    pub index: usize,
    /// Initial radius.
    pub radius: f64,
    /// Cells per side of the box.
    pub box_cells: usize,
    /// Time steps.
    pub steps: usize,
    /// Size of a time step.
    pub step: f64,
    /// Scales and settings of the flow.
    pub params: FlowParams,
    /// Device and precision.
    pub device: String,
    /// Checksum of the network, if the method has one.
    pub network: Option<String>,
    /// Version of the program.
    pub version: &'static str,
}

/// What came out for one circle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CircleResult {
    /// `L2` distance to the exact solution at `t = 0` and after every step.
    pub errors: Vec<f64>,
    /// Exact `L2` distance between the last and the first time, for scale.
    pub travelled: f64,
    /// Records of the steps of Willmore flow; empty for mean curvature flow.
    pub records: Vec<StepRecord>,
}

impl Circle {
    fn name(&self) -> String {
        format!(
            "{}-{}-n{}-{:02}",
            self.flow.key(),
            self.method.key_in(self.scheme),
            self.cells_per_unit,
            self.index
        )
    }

    fn run(
        &self,
        network: Option<&Network>,
        device: &ComputeDevice,
        bar: &ProgressBar,
    ) -> Result<CircleResult, Error> {
        let failed = |source: solver::Error| Error::Run {
            run: format!(
                "{} of the circle r = {:.4} by {} at n = {}",
                self.flow.title(),
                self.radius,
                self.method.label_in(self.scheme),
                self.cells_per_unit
            ),
            source: Box::new(source),
        };
        let side = self.box_cells as f64 / self.cells_per_unit as f64;
        let grid = Grid::<2>::centred(self.box_cells, side)?;
        let exact = |k: usize| -> Result<Field<2>, Error> {
            let radius = self.flow.radius(self.radius, k as f64 * self.step);
            if radius <= 0.0 {
                return Ok(Field::constant(grid, -1.0));
            }
            Ok(phase_field(grid, &Ball::new([0.0, 0.0], radius)?, EPS)?)
        };
        let initial = exact(0)?;
        let mut errors = vec![0.0];
        let mut records = Vec::new();
        match self.flow {
            Flow::MeanCurvature => {
                let mut flow =
                    self.method
                        .mean_curvature_flow(network, &initial, &self.params, device)?;
                for k in 1..=self.steps {
                    flow.advance().map_err(failed)?;
                    errors.push(l2_distance(&flow.field().map_err(failed)?, &exact(k)?)?);
                    bar.inc(1);
                }
            }
            Flow::Willmore => {
                let linear = LinearSolver::default();
                let mut flow =
                    self.method
                        .willmore_flow(network, &initial, self.params, linear, device)?;
                for k in 1..=self.steps {
                    records.push(flow.advance(self.step).map_err(failed)?);
                    errors.push(l2_distance(&flow.field().map_err(failed)?, &exact(k)?)?);
                    bar.inc(1);
                }
            }
        }
        let travelled = l2_distance(&exact(self.steps)?, &initial)?;
        Ok(CircleResult {
            errors,
            travelled,
            records,
        })
    }
}

/// All circles of one flow, method, scheme and resolution.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ensemble {
    /// Which flow.
    pub flow: Flow,
    /// Which method.
    pub method: Method,
    /// Which scheme of Willmore flow.
    pub scheme: Scheme,
    /// Cells per unit length.
    pub n: usize,
    /// Initial radii.
    pub radii: Vec<f64>,
    /// Results in the order of the radii.
    pub results: Vec<CircleResult>,
}

impl Ensemble {
    /// Runs the circles side by side, largest first, with results of an interrupted run where there are any.
    ///
    /// # Errors
    /// [`Error::Run`] of the first circle that fails; [`Error::Report`] if a part cannot be stored.
    pub fn run(
        (flow, method, scheme, n): (Flow, Method, Scheme, usize),
        (count, steps): (usize, usize),
        network: Option<&Network>,
        device: &ComputeDevice,
        partial: &Partial,
        bar: &ProgressBar,
    ) -> Result<Self, Error> {
        let mut params = FlowParams {
            eps: EPS,
            mcf_step: STEP,
            newton: NewtonParams::default(),
            calibration: Factors::PAPER,
        };
        let grid = Grid::<2>::per_unit(n, 1.0)?;
        let (network, factors) = method.prepare(scheme, network, &grid, &params)?;
        let network = network.as_ref();
        let network_checksum = network.map(checksum);
        params.calibration = factors;
        let circles: Vec<Circle> = radii(count)
            .into_iter()
            .enumerate()
            .map(|(index, radius)| Circle {
                flow,
                method,
                scheme,
                cells_per_unit: n,
                index,
                radius,
                box_cells: box_cells(flow, radius, steps, n),
                steps,
                step: STEP,
                params,
                device: format!("{} {:?}", device.kind(), device.dtype()),
                network: network_checksum.clone(),
                version: env!("CARGO_PKG_VERSION"),
            })
            .collect();
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|&i| std::cmp::Reverse(circles[i].box_cells));
        let results = in_parallel(&order, workers(device), |i| {
            let circle = &circles[i];
            let name = circle.name();
            if let Some(result) = partial.load(&name, circle) {
                bar.inc(steps as u64);
                return Ok(result);
            }
            let result = circle.run(network, device, bar)?;
            partial.store(&name, circle, &result)?;
            Ok(result)
        })?;
        Ok(Self {
            flow,
            method,
            scheme,
            n,
            radii: circles.iter().map(|circle| circle.radius).collect(),
            results,
        })
    }

    /// Time steps.
    pub fn steps(&self) -> usize {
        self.results.first().map_or(0, |r| r.errors.len() - 1)
    }

    /// Mean of a quantity over the circles.
    pub fn mean(&self, f: impl Fn(&CircleResult) -> f64) -> f64 {
        self.results.iter().map(f).sum::<f64>() / self.results.len().max(1) as f64
    }

    /// Mean error after `k` steps.
    pub fn mean_error(&self, k: usize) -> f64 {
        self.mean(|result| result.errors[k])
    }

    /// Largest and smallest error after `k` steps.
    pub fn error_range(&self, k: usize) -> [f64; 2] {
        let errors = || self.results.iter().map(|result| result.errors[k]);
        [
            errors().fold(f64::INFINITY, f64::min),
            errors().fold(0.0, f64::max),
        ]
    }

    /// Mean exact distance between the last and the first time.
    pub fn scale(&self) -> f64 {
        self.mean(|result| result.travelled)
    }

    /// All records with the radius they belong to.
    pub fn records(&self) -> impl Iterator<Item = (f64, &StepRecord)> {
        let pairs = self.radii.iter().zip(&self.results);
        pairs.flat_map(|(&radius, result)| result.records.iter().map(move |r| (radius, r)))
    }

    /// Mean of a quantity over all steps of all circles.
    pub fn mean_of_records(&self, f: impl Fn(&StepRecord) -> f64) -> f64 {
        let (sum, count) = self.records().fold((0.0, 0_usize), |(sum, count), (_, r)| {
            (sum + f(r), count + 1)
        });
        sum / count.max(1) as f64
    }

    /// Steps that did not lower the energy `E[u_k, .]`, or that raised the Willmore energy.
    pub fn energy_increases(&self) -> usize {
        self.records()
            .filter(|(_, r)| {
                let willmore_before = r.energy_before / (2.0 * r.tau);
                r.energy >= r.energy_before || r.willmore_energy > willmore_before
            })
            .count()
    }

    /// Linear solves that met negative curvature.
    pub fn negative_curvature(&self) -> usize {
        self.records()
            .map(|(_, r)| r.newton.negative_curvature)
            .sum()
    }

    /// Name in metrics, such as `willmore.n128.hybrid_calibrated`.
    pub fn key(&self) -> String {
        let method = self.method.key_in(self.scheme);
        format!("{}.n{}.{method}", self.flow.key(), self.n)
    }

    /// Name of method and scheme in legends.
    pub fn label(&self) -> String {
        self.method.label_in(self.scheme)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radii_are_the_papers() {
        let all = radii(COUNT);
        assert!((all[0] - 0.05 * PI).abs() < 1e-15 && (all[29] - 0.195 * PI).abs() < 1e-15);
        for r in radii(4) {
            assert!(all.contains(&r));
        }
    }

    #[test]
    fn boxes_hold_the_whole_motion_and_suit_fourier_transforms() {
        for n in [128, 256, 512] {
            for r in radii(COUNT) {
                for flow in Flow::ALL {
                    let cells = box_cells(flow, r, STEPS, n);
                    let last = flow.radius(r, STEPS as f64 * STEP);
                    let gap = 0.5 * cells as f64 / n as f64 - r.max(last);
                    assert!((MARGIN..MARGIN + 0.15).contains(&gap), "{gap}");
                    assert!(cells.is_multiple_of(2) && is_smooth(cells));
                    assert!(1.0 + geometry::optimal_profile(gap, EPS) < 1e-12);
                }
            }
        }
    }
}

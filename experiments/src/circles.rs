//! Circles under mean curvature flow and Willmore flow, compared with the exact solutions
//! `R(t) = (r^2 - 2t)^(1/2)` and `R(t) = (r^4 + 2t)^(1/4)`.

use geometry::exact::{mean_curvature_radius, willmore_radius};
use runs::Interrupt;

use crate::harness::{in_parallel, workers};
use crate::prelude::*;

pub const COUNT: usize = 30;
pub const STEPS: usize = 64;
/// Distance of the interface to the box's boundary, `19.2 eps`: the profile's tails are below `1e-12` there.
const MARGIN: f64 = 0.3;

pub fn radius_at(flow: Flow, r: f64, t: f64) -> f64 {
    match flow {
        Flow::MeanCurvature => mean_curvature_radius(r, t, 2),
        Flow::Willmore => willmore_radius(r, t, 2),
    }
}

/// `count` of the radii `r_i = 0.05 pi + 0.15 pi i / 30`, `i = 0..29`, evenly chosen.
pub fn radii(count: usize) -> Vec<f64> {
    let chosen = (0..count).map(|k| k * COUNT / count);
    let radius = |i| 0.05 * PI + 0.15 * PI * i as f64 / COUNT as f64;
    chosen.map(radius).collect()
}

/// The smallest suitable box about the centre of a circle: the interface stays 0.3 away from the boundary, and the number of cells per
/// side is even and a product of 2, 3 and 5, good for Fourier transforms.
pub fn grid(flow: Flow, radius: f64, steps: usize, n: usize) -> Result<Grid<2>> {
    let side = 2.0 * (radius.max(radius_at(flow, radius, time(steps))) + MARGIN);
    let mut cells = (side * n as f64).ceil() as usize;
    cells += cells % 2;
    while !is_smooth(cells) {
        cells += 2;
    }
    Ok(Grid::centred(cells, cells as f64 / n as f64)?)
}

fn is_smooth(mut number: usize) -> bool {
    for prime in [2, 3, 5] {
        while number.is_multiple_of(prime) {
            number /= prime;
        }
    }
    number == 1
}

/// The phase field of a circle that had this radius at `t = 0`.
fn exact(flow: Flow, radius: f64, grid: Grid<2>, time: f64) -> Result<Field<2>, geometry::Error> {
    let radius = radius_at(flow, radius, time);
    if radius <= 0.0 {
        return Ok(Field::constant(grid, -1.0));
    }
    phase_field(grid, &Ball::new([0.0, 0.0], radius)?, EPS)
}

pub struct Circle {
    pub radius: f64,
    /// Exact `L2` distance between the last and the first time, for scale.
    pub travelled: f64,
    pub trajectory: Trajectory<2>,
}

impl Circle {
    /// `L2` distance to the exact solution after `k` steps.
    pub fn error(&self, k: usize) -> f64 {
        self.trajectory.measures(k).expect("all steps are made")["l2"]
    }
}

/// All circles of one variant, in the order of their radii.
pub struct Ensemble {
    pub variant: Variant,
    pub circles: Vec<Circle>,
}

impl Ensemble {
    /// Runs `count` circles side by side for so many steps of `2^-14`; those of an interrupted run are in a `folder` of the output.
    pub fn run(
        planned: &Planned,
        count: usize,
        steps: usize,
        folder: &str,
        stage: &Stage<'_>,
    ) -> Result<Self> {
        let (device, folder) = (stage.device, stage.output.subfolder(folder)?);
        stage.bar.set_length(count as u64);
        let Planned { variant, operator } = planned;
        let Variant { flow, n, .. } = *variant;
        let radii = radii(count);
        let circles = in_parallel(count, workers(device), |i| {
            let (radius, grid) = (radii[i], grid(flow, radii[i], steps, n)?);
            let exact = move |grid, time| exact(flow, radius, grid, time);
            let shape = format!("circle r = {radius:.4}");
            let (initial, last) = (exact(grid, 0.0)?, exact(grid, time(steps))?);
            let mut case = planar_flow(flow, operator, &shape, initial, STEP, steps);
            case.measures = Measure::size(EPS);
            case.measures.push(Measure::distance_to(exact));
            let name = format!("{flow}-n{n}-{}-{i:02}", operator.key());
            let folder = folder.as_path().join(name);
            let (ends, never) = (Samples::every(usize::MAX), Interrupt::never());
            let trajectory = Trajectory::of(case, device, &folder, &ends, &mut [], &never)?;
            let trajectory = trajectory.expect("nobody interrupts it");
            stage.bar.inc(1);
            Ok(Circle {
                radius,
                travelled: l2_distance(&last, &trajectory.case.initial.field()?)?,
                trajectory,
            })
        })?;
        Ok(Self {
            variant: *variant,
            circles,
        })
    }

    pub fn mean(&self, f: impl Fn(&Circle) -> f64) -> f64 {
        self.circles.iter().map(f).sum::<f64>() / self.circles.len().max(1) as f64
    }

    pub fn mean_error(&self, k: usize) -> f64 {
        self.mean(|circle| circle.error(k))
    }

    pub fn errors(&self, k: usize) -> impl Iterator<Item = f64> {
        self.circles.iter().map(move |circle| circle.error(k))
    }

    pub fn seconds(&self) -> f64 {
        self.mean(|circle| circle.trajectory.seconds())
    }

    fn steps(&self) -> usize {
        self.circles[0].trajectory.records.len()
    }

    pub fn seconds_per_step(&self) -> f64 {
        self.seconds() / self.steps() as f64
    }

    pub fn minimizations(&self) -> impl Iterator<Item = &StepRecord> {
        let records = self.circles.iter().map(|circle| &circle.trajectory.records);
        records.flat_map(|records| minimizations(records))
    }

    /// A number summed over all minimizations; nothing for mean curvature flow.
    pub fn total(&self, of: impl Fn(&StepRecord) -> usize) -> Option<usize> {
        self.minimizations().map(of).reduce(|a, b| a + b)
    }

    pub fn averages(&self) -> Averages {
        let steps = self.steps();
        let count = |k: usize, of: fn(&StepRecord) -> f64| {
            self.mean(|circle| {
                let made = &circle.trajectory.records[k].minimization;
                made.as_ref().map_or(0.0, of)
            })
        };
        let work = |k| {
            [
                count(k, StepRecord::hvp),
                count(k, |r| r.newton.newton as f64),
            ]
        };
        let ends = self.circles.iter();
        Averages {
            variant: self.variant,
            errors: (0..=steps).map(|k| self.mean_error(k)).collect(),
            ends: ends.map(|c| [c.radius, c.error(steps)]).collect(),
            work: (0..steps).map(work).collect(),
            seconds: self.seconds(),
        }
    }
}

/// Means over all circles of one variant.
pub struct Averages {
    pub variant: Variant,
    /// `L2` error after no, one, ... steps.
    pub errors: Vec<f64>,
    /// Of each circle, the radius and the error at the end.
    pub ends: Vec<[f64; 2]>,
    /// Of each step, Hessian-vector products and Newton steps.
    pub work: Vec<[f64; 2]>,
    /// Wall time of all steps of a circle.
    pub seconds: f64,
}

impl Averages {
    /// At the end.
    pub fn error(&self) -> f64 {
        self.errors[self.errors.len() - 1]
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
                    let cells = grid(flow, r, STEPS, n).unwrap().cells();
                    let last = radius_at(flow, r, time(STEPS));
                    let gap = 0.5 * cells as f64 / n as f64 - r.max(last);
                    assert!((MARGIN..MARGIN + 0.15).contains(&gap), "{gap}");
                    assert!(cells.is_multiple_of(2) && is_smooth(cells));
                    // Less than in a box of side 2.
                    assert!(n > 128 || cells < 256, "{cells}");
                    assert!(1.0 + geometry::optimal_profile(gap, EPS) < 1e-12);
                }
            }
        }
    }
}

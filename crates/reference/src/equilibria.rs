//! Equilibria: axisymmetric vesicles and closed elastic curves.
//!
//! Vesicles are stationary points of `w = 1/2 int (kappa - c0)^2` for given area and volume (Canham 1970, Helfrich 1973; Seifert,
//! Berndl, Lipowsky, Phys. Rev. A 44, 1991), those of `w + tension A + pressure V`:
//!
//! `-Laplace kappa - kappa (|A|^2 - kappa^2 / 2) - 2 c0 K + (c0^2 / 2 + tension) kappa + pressure = 0`,
//!
//! where `kappa` is the sum and `K` the product of the principal curvatures. Closed elastic curves are those of `1/2 int kappa^2 + tension L + pressure A`
//! for given length and area: the same equation with `K = 0`. It is solved by Newton's method for the sine series of
//! the tangent angle at equal arc length, along branches from nearly round shapes.

use std::f64::consts::PI;
use std::sync::Arc;

use crate::dense::Newton;
use crate::error::below_one;
use crate::flow::Nodes;
use crate::revolution::Surface;
use crate::shape::MOST_ROUNDING;
use crate::spectral::{Grid, collect, odd, sines};
use crate::{Curve, Error, Flow, Shape};

/// A branch of vesicles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branch {
    /// Long shapes with an equator: cigars and dumbbells.
    Prolate,
    /// Flat shapes with an equator: lenses and red blood cells. Without spontaneous curvature they pass through themselves below
    /// a reduced volume of about 0.503.
    Oblate,
    /// Cups, up to where their branch turns back towards the oblate shapes; without spontaneous curvature that is at a reduced volume of
    /// about 0.66.
    Stomatocyte,
}

/// A vesicle in equilibrium, of area `4 pi`.
#[derive(Clone)]
pub struct Vesicle {
    /// Its shape.
    pub surface: Surface,
    /// Spontaneous curvature `c0`.
    pub spontaneous_curvature: f64,
    /// Minus the derivative of the energy by the volume.
    pub pressure: f64,
    /// Minus the derivative of the energy by the area.
    pub tension: f64,
}

impl Vesicle {
    /// `w = 1/2 int (kappa - c0)^2`.
    pub fn energy(&self) -> f64 {
        let (c, surface) = (self.spontaneous_curvature, &self.surface);
        surface.energy() - c * surface.mean_curvature() + c * c / 2.0 * surface.area()
    }
}

/// A closed elastic curve with two symmetry axes, of length `2 pi`.
#[derive(Clone)]
pub struct Elastica {
    /// Its shape.
    pub curve: Curve,
    /// Minus the derivative of the energy by the area.
    pub pressure: f64,
    /// Minus the derivative of the energy by the length.
    pub tension: f64,
}

/// The vesicles of a branch with the given spontaneous curvature, in units of the inverse radius of the sphere of the same area, and
/// reduced volumes (volume over that of this sphere).
///
/// ```
/// use reference::equilibria::{Branch, vesicles};
///
/// let cell = &vesicles(Branch::Oblate, 0.0, &[0.65])?[0];
/// assert!((cell.energy() / (8.0 * std::f64::consts::PI) - 1.8262).abs() < 1e-4);
/// # Ok::<(), reference::Error>(())
/// ```
///
/// # Errors
/// Reduced volumes must be between 0 and 1; [`Error::NoEquilibrium`] beyond the ends of a branch.
pub fn vesicles(
    branch: Branch,
    spontaneous_curvature: f64,
    reduced_volumes: &[f64],
) -> Result<Vec<Vesicle>, Error> {
    let mut path = match branch {
        Branch::Prolate => Path::new(Kind::Vesicle, &Shape::ellipse(1.0, 1.5)?)?,
        Branch::Oblate => Path::new(Kind::Vesicle, &Shape::ellipse(1.5, 1.0)?)?,
        Branch::Stomatocyte => Path::new(Kind::Vesicle, &Shape::ellipse(1.5, 1.0)?)?.cups()?,
    };
    path.bend(spontaneous_curvature)?;
    let vesicle = |&ratio: &f64| {
        path.follow(below_one("reduced volume", ratio)?)?;
        let scale = path.problem.scale(&path.state);
        let [minus_pressure, tension] = path.problem.multipliers(&path.state);
        Ok(Vesicle {
            surface: path.problem.surface(&path.state, scale),
            spontaneous_curvature,
            pressure: -minus_pressure / scale.powi(3),
            tension: tension / scale.powi(2),
        })
    };
    reduced_volumes.iter().map(vesicle).collect()
}

/// The elastic curves with the given isoperimetric quotients `4 pi area / length^2`.
///
/// # Errors
/// Quotients must be between 0 and 1; [`Error::NoEquilibrium`] beyond the ends of the branch.
pub fn elastica(quotients: &[f64]) -> Result<Vec<Elastica>, Error> {
    let mut path = Path::new(Kind::Elastica, &Shape::ellipse(1.5, 1.0)?)?;
    let curve = |&ratio: &f64| {
        path.follow(below_one("isoperimetric quotient", ratio)?)?;
        let [minus_pressure, tension] = path.problem.multipliers(&path.state);
        Ok(Elastica {
            curve: path.problem.curve(&path.state, 1.0),
            pressure: -minus_pressure,
            tension,
        })
    };
    quotients.iter().map(curve).collect()
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Vesicle,
    Elastica,
}

/// The last equation.
#[derive(Clone, Copy)]
enum Condition {
    /// Of the reduced volume or the isoperimetric quotient.
    Ratio(f64),
    /// Of the first sine of the tangent angle, which is zero for shapes with an equator.
    Asymmetry(f64),
}

/// The equations of a curve scaled to length `2 pi`. The state is the sines of the tangent angle, then minus the pressure and the tension, then, of
/// shapes without an equator, a force along the axis that is zero in equilibrium: the curve is closed by it, which is one equation
/// more.
#[derive(Clone)]
struct Problem {
    kind: Kind,
    grid: Arc<Grid>,
    spontaneous_curvature: f64,
}

impl Problem {
    fn sines(&self) -> usize {
        self.grid.points / 2 - 1
    }

    fn multipliers(&self, state: &[f64]) -> [f64; 2] {
        [state[self.sines()], state[self.sines() + 1]]
    }

    fn curve(&self, state: &[f64], scale: f64) -> Curve {
        Curve {
            grid: self.grid.clone(),
            angle: odd(&state[..self.sines()]),
            scale,
            centre: [0.0; 2],
            time: 0.0,
        }
    }

    fn surface(&self, state: &[f64], scale: f64) -> Surface {
        Surface::about_axis(self.curve(state, scale)).expect("sines are symmetric about the axis")
    }

    /// The scale at which the area is `4 pi`.
    fn scale(&self, state: &[f64]) -> f64 {
        (4.0 * PI / self.surface(state, 1.0).area()).sqrt()
    }

    fn ratio(&self, state: &[f64]) -> f64 {
        match self.kind {
            Kind::Vesicle => self.surface(state, 1.0).reduced_volume(),
            Kind::Elastica => self.curve(state, 1.0).area() / PI,
        }
    }

    fn residual(&self, state: &[f64], condition: Condition) -> Vec<f64> {
        let (axis, bend) = match self.kind {
            Kind::Vesicle => (Some(0.0), self.spontaneous_curvature * self.scale(state)),
            Kind::Elastica => (None, 0.0),
        };
        let nodes = Nodes::new(&self.grid, &odd(&state[..self.sines()]), axis);
        let [minus_pressure, tension] = self.multipliers(state);
        let force = state.get(self.sines() + 2).copied().unwrap_or(0.0);
        let velocity = nodes.willmore(&self.grid);
        let equation = self.grid.expand(|i| {
            let product = nodes.curvature[i] * nodes.parallel[i];
            let stretch = (bend * bend / 2.0 + tension) * nodes.h[i];
            stretch - velocity[i] - 2.0 * bend * product - minus_pressure
                + force * nodes.tangent[i].re
        });
        let mut result = collect(self.grid.points / 2, |j| equation[j].re);
        if self.grid.folds == 1 {
            result.push(nodes.tangent.iter().map(|t| t.re).sum::<f64>() / self.grid.points as f64);
        }
        result.push(match condition {
            Condition::Ratio(ratio) => self.ratio(state) - ratio,
            Condition::Asymmetry(asymmetry) => state[0] - asymmetry,
        });
        result
    }

    /// The solution near the start: one farther away is on another branch.
    fn solve(&self, start: &[f64], condition: Condition) -> Result<Vec<f64>, Error> {
        const TOLERANCE: f64 = 1e-8;
        const NEAR: f64 = 0.5;
        let residual = |state: &[f64]| self.residual(state, condition);
        let newton = Newton::solve(&residual, start.to_vec(), TOLERANCE);
        let moved = |i: usize| (newton.solution[i] - start[i]).abs();
        let near = (0..self.sines()).all(|i| moved(i) < NEAR);
        if near && newton.step <= TOLERANCE {
            return Ok(newton.solution);
        }
        Err(Error::NoEquilibrium {
            ratio: match condition {
                Condition::Ratio(ratio) => ratio,
                Condition::Asymmetry(_) => self.ratio(&newton.solution),
            },
            residual: newton.step,
            iterations: newton.iterations,
        })
    }
}

/// An equilibrium on its way along a branch.
struct Path {
    problem: Problem,
    state: Vec<f64>,
}

impl Path {
    fn new(kind: Kind, shape: &Shape) -> Result<Self, Error> {
        const POINTS: usize = 64;
        let curve = shape
            .curve(Flow::Willmore, MOST_ROUNDING, 2)?
            .with_points(POINTS);
        let problem = Problem {
            kind,
            grid: curve.grid.clone(),
            spontaneous_curvature: 0.0,
        };
        let state: Vec<f64> = sines(&curve.angle).chain([0.0; 2]).collect();
        let ratio = problem.ratio(&state);
        let state = problem.solve(&state, Condition::Ratio(ratio))?;
        Ok(Self { problem, state })
    }

    /// The shape with the given ratio, by continuation.
    fn follow(&mut self, ratio: f64) -> Result<(), Error> {
        self.proceed(self.problem.ratio(&self.state), ratio, 0.02, |_, value| {
            Condition::Ratio(value)
        })
    }

    /// The shape with the given spontaneous curvature and the same ratio.
    fn bend(&mut self, spontaneous_curvature: f64) -> Result<(), Error> {
        let ratio = self.problem.ratio(&self.state);
        self.proceed(0.0, spontaneous_curvature, 0.2, |problem, value| {
            problem.spontaneous_curvature = value;
            Condition::Ratio(ratio)
        })
    }

    /// From one value of a parameter to another in steps of at most the given length, halved where Newton's method fails.
    fn proceed(
        &mut self,
        from: f64,
        to: f64,
        longest: f64,
        mut set: impl FnMut(&mut Problem, f64) -> Condition,
    ) -> Result<(), Error> {
        const SHORTEST: f64 = 1e-2;
        let mut left = to - from;
        let mut length = longest;
        while left != 0.0 {
            let step = left.clamp(-length, length);
            let condition = set(&mut self.problem, to - (left - step));
            match self.problem.solve(&self.state, condition) {
                Ok(state) => {
                    self.state = state;
                    self.refine(condition)?;
                    left -= step;
                    length = (1.5 * length).min(longest);
                }
                Err(error) if length < SHORTEST * longest => return Err(error),
                Err(_) => length /= 2.0,
            }
        }
        Ok(())
    }

    /// More points where the shape needs them.
    fn refine(&mut self, condition: Condition) -> Result<(), Error> {
        const RESOLVED: f64 = 1e-7;
        loop {
            let curve = self.problem.curve(&self.state, 1.0);
            let fitted = curve.fitted(RESOLVED)?;
            if fitted.grid.points <= curve.grid.points {
                return Ok(());
            }
            let multipliers = self.state[self.problem.sines()..].to_vec();
            self.state = sines(&fitted.angle).chain(multipliers).collect();
            self.problem.grid = fitted.grid;
            self.state = self.problem.solve(&self.state, condition)?;
        }
    }

    /// From the oblate shapes to those without an equator: along the branch by its asymmetry, until the volume falls.
    fn cups(mut self) -> Result<Self, Error> {
        const BIFURCATION: f64 = 0.51;
        const STEP: f64 = 0.1;
        self.follow(BIFURCATION)?;
        let oblate = self.problem.curve(&self.state, 1.0).unfolded();
        let [minus_pressure, tension] = self.problem.multipliers(&self.state);
        let rest = [minus_pressure, tension, 0.0];
        self.state = sines(&oblate.angle).chain(rest).collect();
        self.problem.grid = oblate.grid;
        // At no asymmetry at all the equations are singular.
        let mut asymmetry = STEP / 2.0;
        self.state[0] = asymmetry;
        let mut before = 0.0;
        loop {
            self.proceed(asymmetry, asymmetry + STEP, STEP, |_, value| {
                Condition::Asymmetry(value)
            })?;
            asymmetry += STEP;
            let ratio = self.problem.ratio(&self.state);
            if ratio < before {
                return Ok(self);
            }
            before = ratio;
        }
    }
}

//! Perimeter and volume held at targets, by Lagrange multipliers inside the minimization of each step.
//!
//! With `C` the perimeter and the volume of the zero set ([`geometry::zero_set`]) and `C*` their targets, a step minimizes its energy `E`
//! under `C(u) = C*`. All iterates fulfil that, up to what the multipliers correct, so that the energy alone says which is better:
//!
//! - Conjugate gradients solve `H p = -(g + A lambda)` for motions with `A^T p = 0`, `A` being the gradients of `C`, `g` that of `E`, and
//!   `H` the second derivative of `E + lambda C`. For that the preconditioner `P` is projected, `P - P A (A^T P A)^-1 A^T P`, whose spectrum
//!   with `H` lies within that of `P`: constraints cost no iterations. What is left of the residual corrects the multipliers.
//! - Every trial is [restored](Restoring::restored) to `C = C*` by Newton's method for one or two numbers: displacements of the interface along its
//!   normal that are constant (for the volume) and proportional to the mean curvature (for the perimeter; `kappa exp(-(eps kappa)^4)`, so that bends
//!   that the interface does not resolve stay), which keep the profile. A perimeter that is held alone is restored by the shorter one of both,
//!   since the second one sharpens edges. Where a correction takes off less than a quarter of what it should, the targets are out of reach: a
//!   trial that long is dropped, and so is the minimization if only steps that gain next to nothing are left. Then a shorter time step is tried.

use burn::tensor::Tensor;
use geometry::zero_set::{
    SizeHessian, Sizes, ball_perimeter, ball_volume, least_perimeter, reduced_volume,
};
use geometry::{Field, Grid, Stored, positive};
use operators::{
    ComputeDevice, HostUpdate, Real, SharedUpdate, inner_product, retract, update_on_host,
};
use serde::{Deserialize, Serialize};

use crate::cg::{CgLimits, CgSolution, Quadratic, Solved, conjugate_gradients, dot};
use crate::region::Region;
use crate::{DeviceField, Error};

/// How exactly targets are met in the end, relative to them, in double precision.
const TOLERANCE: f64 = 1e-12;
/// The same during the minimization: energies are corrected for what is missing.
const ITERATES: f64 = 1e-7;
/// The least of both in units of the precision of the device.
const ROUNDINGS: f64 = 16.0;
/// Root mean square of motions that are nothing but the noise of restoring, in units of the tolerance.
const NOISE: f64 = 100.0;
/// Corrections after which a target counts as out of reach.
const CORRECTIONS: usize = 16;
/// Longest displacement of one correction, in units of `4 eps / 3`.
const LONGEST: f64 = 0.5;
/// After shorter ones the derivatives of the measures are not computed again, in the same units.
const NEAR: f64 = 0.02;
/// Unless the violation falls by less than this factor.
const FAST: f64 = 0.1;
/// The least part of what a correction should take off the violation.
const WORTHWHILE: f64 = 0.25;
/// After a correction that takes off less the targets count as out of reach, if the violation is larger than this.
const FAR: f64 = 1e-3;
/// Gradients that differ by less than this part are the same constraint.
const DEPENDENT: f64 = 1e-12;
/// The least distance of two interfaces in units of `eps`; below about three, no stationary profile lies between them.
const NEAREST: f64 = 2.0;
/// Balls that are measured are round to this part of their perimeter.
const SLACK: f64 = 1e-4;
/// The usual names of perimeter and volume.
pub(crate) const fn names<const D: usize>() -> [&'static str; 2] {
    match D {
        2 => ["length", "area"],
        _ => ["area", "volume"],
    }
}

/// Values at which perimeter and volume of the zero set, as [`geometry::zero_set`] measures them, are held in the following steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Constraints {
    /// The length (2D) or area (3D), if it is held.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub perimeter: Option<f64>,
    /// The area (2D) or volume (3D) of the inside, if it is held.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume: Option<f64>,
}

impl Constraints {
    /// Perimeter and volume of a phase field of interface width `eps`: both are kept.
    ///
    /// # Errors
    /// [`Error::Geometry`] for values that are not finite.
    pub fn keeping<const D: usize>(u: &Field<D>, eps: f64) -> Result<Self, Error> {
        let sizes = Sizes::of(u, eps)?;
        Ok(Self {
            perimeter: Some(sizes.perimeter()),
            volume: Some(sizes.volume()),
        })
    }

    /// Whether nothing is held.
    pub fn is_empty(&self) -> bool {
        self.targets() == [None; 2]
    }

    fn targets(&self) -> [Option<f64>; 2] {
        [self.perimeter, self.volume]
    }

    /// Refuses targets that no set in the periodic box has, or none with an interface of width `eps`.
    ///
    /// # Errors
    /// [`Error::Geometry`] for a target that is not positive and finite, [`Error::VolumeTooLarge`] for the volume of the whole box or more,
    /// [`Error::PerimeterTooSmall`] for a perimeter below the least that encloses the volume; [`Error::SizeTooSmall`] for a size below that of
    /// the ball of radius `eps`, [`Error::PerimeterTooLarge`] for more than interfaces have that fill the box at distances of `2 eps`.
    pub fn check<const D: usize>(&self, grid: &Grid<D>, eps: f64) -> Result<(), Error> {
        let smallest = ball_volume(D, eps);
        let least = [ball_perimeter(D, smallest), smallest];
        let names = names::<D>();
        for ((measure, target), least) in names.into_iter().zip(self.targets()).zip(least) {
            if let Some(target) = target
                && positive(measure, target)? < least
            {
                return Err(Error::SizeTooSmall {
                    measure,
                    target,
                    least,
                    eps,
                });
            }
        }
        let most = grid.side().powi(D as i32) / (NEAREST * eps);
        if let Some(perimeter) = self.perimeter.filter(|perimeter| *perimeter > most) {
            return Err(Error::PerimeterTooLarge {
                measure: names[0],
                perimeter,
                most,
                eps,
            });
        }
        let Some(volume) = self.volume else {
            return Ok(());
        };
        let box_volume = grid.side().powi(D as i32);
        if volume >= box_volume {
            return Err(Error::VolumeTooLarge {
                measure: names[1],
                volume,
                box_volume,
            });
        }
        match self.perimeter {
            Some(perimeter) if perimeter < (1.0 - SLACK) * least_perimeter(grid, volume) => {
                Err(Error::PerimeterTooSmall {
                    names,
                    perimeter,
                    volume,
                    least: least_perimeter(grid, volume),
                    reduced_volume: reduced_volume(D, perimeter, volume),
                })
            }
            _ => Ok(()),
        }
    }

    /// The energy of what a minimization may miss of the targets `C*`, with these multipliers: the sum of `1e-7 |lambda C*|`.
    pub(crate) fn energy_error(&self, multipliers: [f64; 2]) -> f64 {
        let parts = multipliers.into_iter().zip(self.targets());
        let parts = parts.map(|(multiplier, target)| multiplier * target.unwrap_or_default());
        ITERATES * parts.map(f64::abs).sum::<f64>()
    }

    /// The targets after this part of a step from `u`, which approaches them evenly. Where `u` fulfils them, they stay.
    pub(crate) fn after<const D: usize>(
        &self,
        part: f64,
        u: &Stored<D>,
        eps: f64,
    ) -> Result<Self, Error> {
        if self.is_empty() {
            return Ok(*self);
        }
        let sizes = Sizes::of(u, eps)?;
        let after = |target: f64, from: f64| {
            if (from / target - 1.0).abs() <= ITERATES {
                target
            } else {
                from + part * (target - from)
            }
        };
        Ok(Self {
            perimeter: self.perimeter.map(|to| after(to, sizes.perimeter())),
            volume: self.volume.map(|to| after(to, sizes.volume())),
        })
    }

    /// The targets in proportion to what is measured on another grid: `u` is a phase field of this one, `other` of that.
    pub(crate) fn carried<const D: usize>(
        &self,
        u: &Field<D>,
        other: &Field<D>,
        eps: f64,
    ) -> Result<Self, Error> {
        let (here, there) = (Self::keeping(u, eps)?, Self::keeping(other, eps)?);
        let carried = |target: Option<f64>, here: Option<f64>, there: Option<f64>| {
            Some(target? * there? / here?)
        };
        Ok(Self {
            perimeter: carried(self.perimeter, here.perimeter, there.perimeter),
            volume: carried(self.volume, here.volume, there.volume),
        })
    }
}

/// Perimeter and volume during one minimization.
pub(crate) struct Restoring<'a, const D: usize> {
    /// The phase field of the start, where values are stored as in all others.
    like: &'a DeviceField<D>,
    eps: f64,
    targets: [Option<f64>; 2],
    region: Option<&'a Region<D>>,
    device: &'a ComputeDevice,
    /// Multipliers of perimeter and volume in the energy that is minimized; zero where nothing is held.
    pub(crate) multipliers: [f64; 2],
    /// Whether they are from a linear solve, which knows them better than an estimate does.
    solved: bool,
}

/// A phase field that fulfils the constraints, with what they are like there.
pub(crate) struct Place<const D: usize> {
    pub(crate) u: Tensor<D>,
    pub(crate) tangent: Option<Tangent<D>>,
}

/// The constraints at one phase field.
pub(crate) struct Tangent<const D: usize> {
    u: Vec<f64>,
    sizes: Sizes<D>,
    parts: Vec<Part>,
}

/// A measure that is held, at one phase field.
#[derive(Clone, Copy)]
struct Part {
    /// Its place in [`names`].
    measure: usize,
    value: f64,
    target: f64,
}

impl<'a, const D: usize> Restoring<'a, D> {
    /// Holds the constraints, if there are any, for phase fields of interface width `eps` that are stored `like` this one.
    pub(crate) fn new(
        constraints: &Constraints,
        like: &'a DeviceField<D>,
        eps: f64,
        region: Option<&'a Region<D>>,
    ) -> Option<Self> {
        (!constraints.is_empty()).then(|| Self {
            like,
            eps,
            targets: constraints.targets(),
            region,
            device: like.device(),
            multipliers: [0.0; 2],
            solved: false,
        })
    }

    fn tolerance(&self) -> f64 {
        TOLERANCE.max(ROUNDINGS * self.device.epsilon())
    }

    /// The smallest motion, as a root mean square, that means anything.
    pub(crate) fn noise(&self) -> f64 {
        NOISE * self.tolerance()
    }

    /// What is missing to the targets, by the multipliers: with it, the energy does not depend to first order on how exactly they are met.
    pub(crate) fn excess(&self, tangent: &Tangent<D>) -> f64 {
        let excess = |part: &Part| self.multipliers[part.measure] * (part.value - part.target);
        tangent.parts.iter().map(excess).sum()
    }

    /// The phase field near `u` that fulfils the constraints well enough for an iterate, or `exactly`, if there is one. Moves it by displacements
    /// of the interface; `hold` puts back what may not move.
    pub(crate) fn restored(
        &self,
        mut u: Tensor<D>,
        exactly: bool,
        hold: impl Fn(Tensor<D>) -> Tensor<D>,
    ) -> Result<Option<Place<D>>, Error> {
        let exact = self.tolerance();
        let tolerance = if exactly { exact } else { exact.max(ITERATES) };
        let mut found: Option<Correction> = None;
        let (mut before, mut wanted) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..CORRECTIONS {
            let Some(tangent) = self.tangent(&u)? else {
                return Ok(None);
            };
            if tangent.violation() <= tolerance {
                let tangent = Some(tangent);
                return Ok(Some(Place { u, tangent }));
            }
            let violation = tangent.violation();
            // Where holes come and go under a correction, it may lead farther away, and so do those after it.
            if violation > wanted && violation > FAR {
                return Ok(None);
            }
            // Near the targets the derivatives change little, but where holes come and go.
            let serves = violation <= FAST * before;
            before = violation;
            let known = found.take().filter(|_| serves);
            let correction = known.unwrap_or_else(|| self.correction(&tangent));
            let Some(Motion {
                values,
                part,
                is_short,
            }) = correction.motion(&tangent)
            else {
                return Ok(None);
            };
            wanted = violation * (1.0 - WORTHWHILE * part);
            found = is_short.then_some(correction);
            let motion = self.device.tensor(&values, u.dims());
            u = hold(retract(&u, &motion, 1.0));
        }
        Ok(None)
    }

    /// What the constraints add to the gradient of the energy at a phase field, with these multipliers.
    pub(crate) fn pull(&self, u: &Tensor<D>, multipliers: [f64; 2]) -> Result<Vec<f64>, Error> {
        let Some(tangent) = self.tangent(u)? else {
            return Err(Error::non_finite(0, "phase field"));
        };
        let mut pull = vec![0.0; tangent.u.len()];
        for (part, gradient) in tangent.parts.iter().zip(self.gradients(&tangent)) {
            for (pull, slope) in pull.iter_mut().zip(gradient) {
                *pull += multipliers[part.measure] * slope;
            }
        }
        Ok(pull)
    }

    /// The error where nothing near `u` fulfils the constraints.
    pub(crate) fn lost(&self, u: &Tensor<D>) -> Result<Error, Error> {
        let parts = self
            .tangent(u)?
            .map_or_else(Vec::new, |tangent| tangent.parts);
        let worst = parts
            .iter()
            .max_by(|a, b| a.violation().total_cmp(&b.violation()));
        let (measure, value, target) = worst.map_or((0, f64::NAN, f64::NAN), |part| {
            (part.measure, part.value, part.target)
        });
        Ok(Error::NotHeld {
            step: 0,
            measure: names::<D>()[measure],
            value,
            target,
        })
    }

    /// None for values that are not finite.
    fn tangent(&self, u: &Tensor<D>) -> Result<Option<Tangent<D>>, Error> {
        let stored = self.like.with(u.clone()).stored()?;
        let sizes = match Sizes::of(&stored, self.eps) {
            Err(geometry::Error::NonFinite { .. }) => return Ok(None),
            sizes => sizes?,
        };
        let held = self.targets.iter().enumerate();
        let parts = held.filter_map(|(measure, target)| {
            target.map(|target| Part {
                measure,
                value: match measure {
                    0 => sizes.perimeter(),
                    _ => sizes.volume(),
                },
                target,
            })
        });
        Ok(Some(Tangent {
            parts: parts.collect(),
            sizes,
            u: stored.into_values(),
        }))
    }

    /// The motions that restore the measures: displacements of the interface, constant for the volume and proportional to the mean curvature
    /// for the perimeter (for one that is held alone, the shorter one of both), times `1 - u^2`.
    fn motions(&self, tangent: &Tangent<D>, gradients: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let wells: Vec<f64> = tangent.u.iter().map(|u| (1.0 - u * u).max(0.0)).collect();
        let constant = || self.inside(wells.clone());
        let bent = || {
            // Sharper bends than the interface is wide are corners and narrow holes, which would move most: they would become sharper, or close.
            let resolved = |k: f64| k * (-(self.eps * k).powi(4)).exp();
            let curvature = tangent.sizes.mean_curvature();
            let bends = curvature.into_iter().map(resolved);
            self.inside(wells.iter().zip(bends).map(|(well, k)| well * k).collect())
        };
        if let ([part], [gradient]) = (&tangent.parts[..], gradients)
            && part.measure == 0
        {
            let (constant, bent) = (constant(), bent());
            let longest = longest_displacement(&tangent.u, &bent);
            let shorter =
                product(gradient, &constant).abs() * longest > product(gradient, &bent).abs();
            return vec![if shorter { constant } else { bent }];
        }
        let motion = |part: &Part| match part.measure {
            0 => bent(),
            _ => constant(),
        };
        tangent.parts.iter().map(motion).collect()
    }

    /// Zero where nothing may move.
    fn inside(&self, mut values: Vec<f64>) -> Vec<f64> {
        if let Some(region) = self.region {
            for (value, inside) in values.iter_mut().zip(&*region.marks) {
                if !inside {
                    *value = 0.0;
                }
            }
        }
        values
    }

    /// The derivatives of the measures that are held by the values that may move.
    fn gradients(&self, tangent: &Tangent<D>) -> Vec<Vec<f64>> {
        let gradient = |part: &Part| match part.measure {
            0 => tangent.sizes.perimeter_gradient(),
            _ => tangent.sizes.volume_gradient(),
        };
        let parts = tangent.parts.iter();
        parts.map(|part| self.inside(gradient(part))).collect()
    }

    /// The motions that restore the constraints at a phase field, with what they change.
    fn correction(&self, tangent: &Tangent<D>) -> Correction {
        let gradients = self.gradients(tangent);
        let motions = self.motions(tangent, &gradients);
        let mut changes = [[0.0; 2]; 2];
        for (row, gradient) in changes.iter_mut().zip(&gradients) {
            for (change, motion) in row.iter_mut().zip(&motions) {
                *change = product(gradient, motion);
            }
        }
        Correction { motions, changes }
    }

    /// The multipliers for which the Lagrangian does not change along the motions that restore the constraints.
    fn estimate(&self, tangent: &Tangent<D>, gradients: &[Vec<f64>], force: &[f64]) -> [f64; 2] {
        let (parts, motions) = (&tangent.parts, self.motions(tangent, gradients));
        let found = solve(
            parts.len(),
            |row| -product(force, &motions[row]),
            |row, column| product(&gradients[column], &motions[row]),
        );
        let mut multipliers = [0.0; 2];
        for (part, value) in parts.iter().zip(found.unwrap_or_default()) {
            multipliers[part.measure] = value;
        }
        multipliers
    }

    /// Solves for the motion that minimizes a quadratic model of the energy among those tangential to the constraints. With `keep`, what is found out about the multipliers is remembered; without, the motion only cleans the profile.
    pub(crate) fn solve(
        &mut self,
        quadratic: Quadratic<'_, D>,
        tangent: &Tangent<D>,
        precondition: &dyn Fn(&Tensor<D>) -> Tensor<D>,
        limits: CgLimits,
        keep: bool,
    ) -> Result<CgSolution<D>, Error> {
        let Quadratic {
            gradient,
            product: of_energy,
            dtype,
            unit,
        } = quadratic;
        let parts = &tangent.parts;
        let gradients = self.gradients(tangent);
        if !self.solved {
            let force = self.device.values(gradient.clone())?;
            self.multipliers = self.estimate(tangent, &gradients, &force);
        }
        let multipliers = self.multipliers;
        let (mut lagrangian, mut normals) = (gradient.clone(), Vec::new());
        for (part, values) in parts.iter().zip(&gradients) {
            let normal = self.device.tensor::<D>(values, gradient.dims());
            lagrangian = lagrangian + normal.clone() * multipliers[part.measure];
            normals.push((part.measure, normal.cast(dtype)));
        }
        let projection = Projection::new(normals, precondition, self.device)?;
        // To clean the profile, which is much stiffer, it is not needed.
        let curvature = keep
            .then(|| SharedUpdate::new(Curvature(tangent.sizes.second_derivative(multipliers))));
        let mut product = |p: &Tensor<D>| {
            let product = of_energy(p)?;
            Ok(match &curvature {
                Some(curvature) => {
                    Region::project(self.region, update_on_host(p, product, curvature))
                }
                None => product,
            })
        };
        let quadratic = Quadratic {
            gradient: &lagrangian,
            product: &mut product,
            dtype,
            unit,
        };
        let projected = |r: &Tensor<D>| projection.apply(precondition(r));
        let Solved { solution, residual } =
            conjugate_gradients(quadratic, &projected, limits, self.device)?;
        if keep {
            self.solved = !solution.negative_curvature;
        }
        if keep && self.solved {
            let change = projection.multipliers(&residual, self.device)?;
            for (multiplier, change) in self.multipliers.iter_mut().zip(change) {
                *multiplier += change;
            }
        }
        Ok(solution)
    }
}

/// Motions of the interface, and the derivatives along them of what is held; the first index is that of the measure.
struct Correction {
    motions: Vec<Vec<f64>>,
    changes: [[f64; 2]; 2],
}

/// A motion towards the targets.
struct Motion {
    values: Vec<f64>,
    /// The part of the way to first order that it goes; less than one where the whole would be too long.
    part: f64,
    is_short: bool,
}

impl Correction {
    /// The motion to first order that restores the constraints; none if they depend on each other, or on nothing that may move.
    fn motion<const D: usize>(&self, tangent: &Tangent<D>) -> Option<Motion> {
        let parts = &tangent.parts;
        let factors = solve(
            parts.len(),
            |row| parts[row].target - parts[row].value,
            |row, column| self.changes[row][column],
        )?;
        let mut motion = vec![0.0; tangent.u.len()];
        for (direction, factor) in self.motions.iter().zip(factors) {
            for (sum, value) in motion.iter_mut().zip(direction) {
                *sum += factor * value;
            }
        }
        let longest = longest_displacement(&tangent.u, &motion);
        let part = if longest > LONGEST {
            LONGEST / longest
        } else {
            1.0
        };
        if part < 1.0 {
            for value in &mut motion {
                *value *= part;
            }
        }
        Some(Motion {
            values: motion,
            part,
            is_short: longest <= NEAR,
        })
    }
}

impl Part {
    fn violation(&self) -> f64 {
        (self.value / self.target - 1.0).abs()
    }
}

impl<const D: usize> Tangent<D> {
    fn violation(&self) -> f64 {
        let violations = self.parts.iter().map(Part::violation);
        // A NaN must not pass for zero.
        violations.fold(0.0, |worst: f64, v| {
            if v <= worst || worst.is_nan() {
                worst
            } else {
                v
            }
        })
    }
}

/// Solves a system of one or two equations.
fn solve(
    equations: usize,
    right: impl Fn(usize) -> f64,
    matrix: impl Fn(usize, usize) -> f64,
) -> Option<[f64; 2]> {
    if equations == 1 {
        let pivot = matrix(0, 0);
        return (pivot != 0.0).then(|| [right(0) / pivot, 0.0]);
    }
    let [[a, b], [c, d]] = [0, 1].map(|row| [matrix(row, 0), matrix(row, 1)]);
    let determinant = a * d - b * c;
    let (r, s) = (right(0), right(1));
    let independent = determinant.abs() > DEPENDENT * (a * d).abs();
    independent.then(|| [(d * r - b * s) / determinant, (a * s - c * r) / determinant])
}

/// Of the interface, where `1 - u^2 > 1/2`: there, the displacement is the motion over `1 - u^2`.
fn longest_displacement(u: &[f64], motion: &[f64]) -> f64 {
    let wells = u.iter().map(|u| 1.0 - u * u);
    let shifts = motion.iter().zip(wells).filter(|(_, well)| *well > 0.5);
    shifts.fold(0.0, |longest: f64, (motion, well)| {
        longest.max((motion / well).abs())
    })
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The projection `P - P A (A^T P A)^-1 A^T P` of a preconditioner.
struct Projection<const D: usize> {
    /// Combinations of the gradients that are orthonormal with respect to `P`.
    normals: Vec<Normal<D>>,
}

struct Normal<const D: usize> {
    vector: Tensor<D>,
    preconditioned: Tensor<D>,
    /// The vector as a combination of the gradients of perimeter and volume.
    combination: [f64; 2],
}

impl<const D: usize> Projection<D> {
    /// Onto the motions that are orthogonal to `gradients`, each with its place in [`names`].
    fn new(
        gradients: Vec<(usize, Tensor<D>)>,
        precondition: &dyn Fn(&Tensor<D>) -> Tensor<D>,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        let mut normals: Vec<Normal<D>> = Vec::new();
        for (measure, mut vector) in gradients {
            let mut preconditioned = precondition(&vector);
            let whole = dot(&vector, &preconditioned, device)?;
            let mut combination = [0.0; 2];
            combination[measure] = 1.0;
            for other in &normals {
                let along = dot(&other.preconditioned, &vector, device)?;
                vector = vector - other.vector.clone() * along;
                preconditioned = preconditioned - other.preconditioned.clone() * along;
                for (c, o) in combination.iter_mut().zip(other.combination) {
                    *c -= along * o;
                }
            }
            let square = dot(&vector, &preconditioned, device)?;
            if square > whole * DEPENDENT {
                let factor = square.sqrt().recip();
                normals.push(Normal {
                    vector: vector * factor,
                    preconditioned: preconditioned * factor,
                    combination: combination.map(|c| c * factor),
                });
            }
        }
        Ok(Self { normals })
    }

    /// Takes the part out of a preconditioned vector that changes the measures.
    fn apply(&self, mut z: Tensor<D>) -> Tensor<D> {
        for normal in &self.normals {
            let along = inner_product(&normal.vector, &z).cast(z.dtype());
            z = z - normal.preconditioned.clone() * along.reshape([1; D]);
        }
        z
    }

    /// The multipliers with which the gradients make up the residual, as far as they can.
    fn multipliers(&self, residual: &Tensor<D>, device: &ComputeDevice) -> Result<[f64; 2], Error> {
        let mut multipliers = [0.0; 2];
        for normal in &self.normals {
            let along = dot(&normal.preconditioned, residual, device)?;
            for (multiplier, part) in multipliers.iter_mut().zip(normal.combination) {
                *multiplier += along * part;
            }
        }
        Ok(multipliers)
    }
}

/// Adds a product with the second derivative of the constraints.
struct Curvature<const D: usize>(SizeHessian<D>);

impl<const D: usize> HostUpdate for Curvature<D> {
    fn update<T: Real>(&self, p: &[T], product: &mut [T]) {
        let add = |node: usize, value| product[node] = product[node] + T::of(value);
        self.0.multiply(|node| p[node].double(), add);
    }
}

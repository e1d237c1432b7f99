//! One step of mean curvature flow by finite elements, on the host.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use geometry::{positive, require};
use operators::SpectralFilter;
use operators::slices::{dot, zip_apply};

use crate::direct::{Factorization, Pair, Symbolic};
use crate::element::{self, Stencil};
use crate::{Error, LinearSolver, Tolerances};

/// Matrices of the last points, for products at the same point.
const CACHED_SYSTEMS: usize = 2;
/// A limit that no well-posed step comes near.
const NEWTON_LIMIT: usize = 40;

/// How a step of mean curvature flow treats the nonlinear term.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TimeDiscretization {
    Implicit,
    SemiImplicit,
}

/// How much work the inner solvers did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Newton iterations of implicit steps.
    pub newton: usize,
    /// Linear systems solved, those of Newton's method included.
    pub solves: usize,
    /// Conjugate-gradient iterations.
    pub cg: usize,
    /// Matrix factorizations.
    pub factorizations: usize,
}

/// Multilinear finite elements for the implicit step of the paper and its semi-implicit relative, on `cells^D` nodes.
///
/// With the mass matrix `M` and the stiffness matrix `S` of the periodic grid, `kappa = tautilde/(2 eps^2)` and
/// `Psi'(v) = 9/4 (v^3 - v)`:
///
/// - implicit: `M (v - u) + tautilde S v + kappa b(v) = 0`, the minimizer of `eps |u - v|^2 + 2 tautilde P_eps[v]`, where `b(v)` is
///   `Psi'(v)` integrated exactly against the basis functions,
/// - semi-implicit: `M (v - u) + tautilde S v + kappa M Psi'(u) = 0`, with `Psi'` interpolated at the nodes.
///
/// All matrices are divided by `h^D`.
pub struct FiniteElements<const D: usize> {
    cells: usize,
    /// `tautilde / h^2`.
    diffusion: f64,
    /// `9/4 kappa`.
    reaction: f64,
    tolerances: Mutex<Tolerances>,
    solver: LinearSolver,
    /// `(M + tautilde S)^-1`.
    heat: SpectralFilter,
    /// Inverse of the linearized implicit step in the pure phases.
    phase: SpectralFilter,
    systems: Mutex<Vec<(Vec<f64>, Arc<System<D>>)>>,
    symbolic: Mutex<Option<Arc<Symbolic>>>,
    statistics: Mutex<Statistics>,
    failure: Mutex<Option<Error>>,
}

/// The matrix `A(v)` of the linearized implicit step, as its solver wants it.
enum System<const D: usize> {
    Matrix(Stencil<D>),
    Factored(Factorization),
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<const D: usize> FiniteElements<D> {
    /// Finite elements on a grid of `cells` per side and spacing `h`.
    ///
    /// # Errors
    /// [`Error::Geometry`] for fewer than 4 cells or scales that are not positive; [`Error::StepTooLarge`].
    pub fn new(
        cells: usize,
        spacing: f64,
        eps: f64,
        step: f64,
        solver: LinearSolver,
    ) -> Result<Self, Error> {
        require("cells per side", cells as f64, "at least 4", |n| n >= 4.0)?;
        for (name, value) in [("h", spacing), ("eps", eps), ("tautilde", step)] {
            positive(name, value)?;
        }
        let bound = 8.0 / 9.0 * eps * eps;
        if step >= bound {
            return Err(Error::StepTooLarge { step, eps, bound });
        }
        let diffusion = step / (spacing * spacing);
        let reaction = 9.0 / 8.0 * step / (eps * eps);
        let inverse = |reaction: f64| {
            SpectralFilter::from_symbol(&[cells; D], |theta| {
                let (mass, stiffness) = element::symbols(theta);
                1.0 / ((1.0 + reaction) * mass + diffusion * stiffness)
            })
        };
        Ok(Self {
            cells,
            diffusion,
            reaction,
            tolerances: Mutex::new(Tolerances::default()),
            solver,
            heat: inverse(0.0),
            phase: inverse(2.0 * reaction),
            systems: Mutex::new(Vec::new()),
            symbolic: Mutex::new(None),
            statistics: Mutex::default(),
            failure: Mutex::new(None),
        })
    }

    /// Symbols of `M`, and of the derivative `J` of the step in the pure phases.
    pub(crate) fn phase_symbols(
        &self,
        discretization: TimeDiscretization,
        theta: &[f64],
    ) -> (f64, f64) {
        let (mass, stiffness) = element::symbols(theta);
        let diffusion = self.diffusion * stiffness;
        let derivative = match discretization {
            TimeDiscretization::Implicit => mass / (mass * (1.0 + 2.0 * self.reaction) + diffusion),
            TimeDiscretization::SemiImplicit => {
                mass * (1.0 - 2.0 * self.reaction) / (mass + diffusion)
            }
        };
        (mass, derivative)
    }

    /// How linear systems are solved.
    pub fn solver(&self) -> LinearSolver {
        self.solver
    }

    /// Sets how accurately the inner systems are solved.
    pub fn set_tolerances(&self, tolerances: Tolerances) {
        *lock(&self.tolerances) = tolerances;
    }

    /// How accurately the inner systems are solved.
    pub fn tolerances(&self) -> Tolerances {
        *lock(&self.tolerances)
    }

    /// Work of the inner solvers so far.
    pub fn statistics(&self) -> Statistics {
        *lock(&self.statistics)
    }

    /// The first failure since the last call, if there was one.
    pub fn take_failure(&self) -> Option<Error> {
        lock(&self.failure).take()
    }

    /// Remembers a failure and gives a field of NaN in place of the result.
    pub(crate) fn or_nan(&self, result: Result<Vec<f64>, Error>) -> Vec<f64> {
        result.unwrap_or_else(|error| {
            lock(&self.failure).get_or_insert(error);
            vec![f64::NAN; self.cells.pow(D as u32)]
        })
    }

    /// `M x`.
    pub fn mass(&self, x: &[f64]) -> Vec<f64> {
        element::mass::<D>(self.cells, x)
    }

    /// `(M + tautilde S)^-1 x`.
    pub fn heat_solve(&self, x: &[f64]) -> Vec<f64> {
        self.heat.apply(x)
    }

    /// `int a b c phi_i / h^D`.
    pub fn product(&self, a: &[f64], b: &[f64], c: &[f64]) -> Vec<f64> {
        element::product::<D>(self.cells, a, b, c)
    }

    /// `9/4 kappa`: `kappa b(v) = reaction (int v^3 phi - M v)`.
    pub fn reaction(&self) -> f64 {
        self.reaction
    }

    /// The semi-implicit step: one circulant system.
    pub fn semi_implicit_step(&self, u: &[f64]) -> Vec<f64> {
        let r = self.reaction;
        let explicit: Vec<f64> = u.iter().map(|u| u * (1.0 + r - r * u * u)).collect();
        self.heat_solve(&self.mass(&explicit))
    }

    /// The implicit step: Newton's method from `u`, whose result depends on nothing else but the [tolerances](Tolerances).
    ///
    /// # Errors
    /// [`Error::NotConverged`] with the residual, [`Error::NonFinite`], [`Error::Factorization`].
    pub fn implicit_step(&self, u: &[f64]) -> Result<Vec<f64>, Error> {
        const SOLVER: &str = "Newton's method of the implicit step";
        let tolerances = self.tolerances();
        let r = self.reaction;
        let constant = Stencil::<D>::constant(self.cells, 1.0 - r, self.diffusion);
        let source = self.mass(u);
        let mut v = u.to_vec();
        let scale = dot(u, &source).sqrt().max(f64::MIN_POSITIVE);
        let mut residual = f64::INFINITY;
        for iteration in 0..=NEWTON_LIMIT {
            // Minus the residual of the equation.
            let mut right = constant.apply(&v);
            let cubic = self.product(&v, &v, &v);
            zip_apply(&mut right, &cubic, |linear, cubic| -linear - r * cubic);
            zip_apply(&mut right, &source, |right, source| right + source);
            let start = self.phase.apply(&right);
            let square = dot(&start, &right);
            let now = square.max(0.0).sqrt() / scale;
            if !square.is_finite() || !now.is_finite() {
                return Err(Error::NonFinite {
                    field: "the residual",
                    solver: SOLVER,
                });
            }
            // Newton's method converges quadratically: when the residual no longer falls, rounding has the word.
            let stalled = now > 0.3 * residual && now <= 1e-12;
            residual = now;
            if residual <= tolerances.newton || stalled {
                return Ok(v);
            }
            if iteration == NEWTON_LIMIT {
                break;
            }
            lock(&self.statistics).newton += 1;
            let accuracy = residual.clamp(tolerances.linear.min(1e-2), 1e-2);
            let update = self.solve(&self.system(&v)?, &right, accuracy)?;
            zip_apply(&mut v, &update, |v, d| v + d);
        }
        Err(Error::NotConverged {
            solver: SOLVER,
            iterations: NEWTON_LIMIT,
            residual,
            tolerance: tolerances.newton,
        })
    }

    /// `A(v)^-1 g`, with `A(v) = M + tautilde S + kappa int Psi''(v) phi phi` the derivative of the implicit equation: the
    /// derivative of the step in direction `p` is `A(v)^-1 M p`, its transpose `M A(v)^-1`.
    ///
    /// # Errors
    /// As [`Self::implicit_step`].
    pub fn linearized_solve(&self, v: &[f64], g: &[f64]) -> Result<Vec<f64>, Error> {
        let system = self.cached_system(v)?;
        self.solve(&system, g, self.tolerances().linear)
    }

    /// `A(v) x`, for tests and estimates.
    pub fn linearized(&self, v: &[f64], x: &[f64]) -> Vec<f64> {
        self.matrix(v).apply(x)
    }

    fn matrix(&self, v: &[f64]) -> Stencil<D> {
        let r = self.reaction;
        Stencil::with_square(self.cells, 1.0 - r, self.diffusion, 3.0 * r, v)
    }

    fn system(&self, v: &[f64]) -> Result<System<D>, Error> {
        let matrix = self.matrix(v);
        Ok(match self.solver {
            LinearSolver::Direct => System::Factored(self.factorize(&matrix)?),
            LinearSolver::ConjugateGradients => System::Matrix(matrix),
        })
    }

    fn cached_system(&self, v: &[f64]) -> Result<Arc<System<D>>, Error> {
        let found = (lock(&self.systems).iter())
            .find(|(at, _)| at == v)
            .map(|(_, system)| system.clone());
        if let Some(system) = found {
            return Ok(system);
        }
        // Made on all cores, and so without the lock: a thread that waits for others may take up work that needs it.
        let system = Arc::new(self.system(v)?);
        let mut systems = lock(&self.systems);
        if systems.len() >= CACHED_SYSTEMS {
            systems.remove(0);
        }
        systems.push((v.to_vec(), system.clone()));
        Ok(system)
    }

    fn factorize(&self, matrix: &Stencil<D>) -> Result<Factorization, Error> {
        // Used without the lock, as in `cached_system`.
        let known = lock(&self.symbolic).clone();
        let symbolic = match known {
            Some(symbolic) => symbolic,
            None => {
                let places = matrix
                    .lower_entries()
                    .map(|(row, col, _)| Pair { row, col });
                let places: Vec<Pair<usize, usize>> = places.collect();
                let symbolic = Arc::new(Symbolic::new(matrix.diagonal().len(), &places)?);
                lock(&self.symbolic).insert(symbolic).clone()
            }
        };
        lock(&self.statistics).factorizations += 1;
        let entries: Vec<f64> = matrix.lower_entries().map(|(.., value)| value).collect();
        symbolic.factorize(&entries)
    }

    fn solve(&self, system: &System<D>, right: &[f64], tolerance: f64) -> Result<Vec<f64>, Error> {
        lock(&self.statistics).solves += 1;
        match system {
            System::Factored(factorization) => Ok(factorization.solve(right)),
            System::Matrix(matrix) => self.conjugate_gradients(matrix, right, tolerance),
        }
    }

    /// Conjugate gradients with the exact inverse in the pure phases as preconditioner, until the residual in its norm is
    /// reduced by `tolerance`.
    fn conjugate_gradients(
        &self,
        matrix: &Stencil<D>,
        right: &[f64],
        tolerance: f64,
    ) -> Result<Vec<f64>, Error> {
        const SOLVER: &str = "conjugate gradients for the linearized step";
        let limit = self.tolerances().iterations;
        let mut residual = right.to_vec();
        let mut direction = self.phase.apply(&residual);
        let mut rz = dot(&residual, &direction);
        let first = rz;
        let mut solution = vec![0.0; right.len()];
        if first == 0.0 {
            return Ok(solution);
        }
        for _ in 0..limit {
            let product = matrix.apply(&direction);
            let curvature = dot(&direction, &product);
            if !(curvature.is_finite() && curvature > 0.0) {
                return Err(Error::NonFinite {
                    field: "the curvature, which must be positive,",
                    solver: SOLVER,
                });
            }
            let alpha = rz / curvature;
            zip_apply(&mut solution, &direction, |s, d| s + alpha * d);
            zip_apply(&mut residual, &product, |r, p| r - alpha * p);
            let z = self.phase.apply(&residual);
            let next = dot(&residual, &z);
            lock(&self.statistics).cg += 1;
            if next <= tolerance * tolerance * first {
                return Ok(solution);
            }
            let beta = next / rz;
            rz = next;
            zip_apply(&mut direction, &z, |d, z| z + beta * d);
        }
        Err(Error::NotConverged {
            solver: SOLVER,
            iterations: limit,
            residual: (rz / first).sqrt(),
            tolerance,
        })
    }
}

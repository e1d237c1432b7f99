//! Finite-element steps of mean curvature flow, for comparison with the learned operator.
//!
//! The nested scheme of Franken, Rumpf and Wirth puts a finite-element step of mean curvature flow into the
//! minimizing-movement energy. [`FiniteElementStep`] is the inner step, fully implicit or semi-implicit. `solver::Euler` makes the time steps.
//! It minimizes the energy of a time step by the same Newton method as with the learned operator:
//!
//! ```
//! use fem::FiniteElementStep;
//! use geometry::{Grid, phase_field, shapes::Ball};
//! use operators::ComputeDevice;
//! use solver::{FlowParams, Problem, Stepper};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let grid = Grid::<2>::per_unit(64, 1.0)?;
//! let params = FlowParams::paper(2.0 * grid.spacing(), grid.spacing().powi(2));
//! let disc = phase_field(grid, &Ball::new([0.0, 0.0], 0.2)?, params.eps)?;
//! let step = FiniteElementStep::implicit(&grid, params.eps, params.mcf_step)?;
//! let device = ComputeDevice::default_compiled()?;
//! let problem = Problem::new(step.clone(), &grid, params, &device)?;
//! let start = problem.start(&disc)?;
//! let mut flow = Stepper::new(problem, start);
//! let record = flow.step(params.mcf_step)?;
//! assert!(record.energy < record.energy_before);
//! println!("w = {:.2}, {:?}", step.willmore_energy(&flow.field()?)?, step.statistics());
//! # Ok(())
//! # }
//! ```
//!
//! # Discretization
//!
//! The elements are multilinear (Q1) on the periodic grid, with one code for two and three dimensions ([`element`]). Mass and stiffness
//! matrices are consistent. The double well $`\Psi(v) = \frac{9}{16} (1 - v^2)^2`$ is integrated exactly (three Gauss points per axis). Only the
//! explicit term of the semi-implicit step is interpolated at the nodes.
//!
//! Conjugate gradients solve the linear systems. Their preconditioner is the exact inverse in the pure phases, by Fourier transforms. With
//! the width $`\varepsilon`$ of the interface, the size $`\tilde\tau`$ of the step and $`s = \tilde\tau / \varepsilon^2`$, the spectrum of the
//! preconditioned matrix lies between $`(1 - \frac{9}{8} s) / (1 + \frac{9}{4} s)`$ and 1, independent of the grid. [`LinearSolver::Direct`] is a
//! sparse Cholesky factorization. It takes the place of PARDISO, the direct solver in the comparisons of Rumpf, Sassen and Norden-Smoch (2026).
//!
//! # Derivatives
//!
//! Let $`\varphi_i`$ be the basis functions, $`M`$ the mass matrix and $`S`$ the stiffness matrix. The implicit step $`v[u]`$ solves
//!
//! ```math
//! M (v - u) + \tilde\tau S v + \frac{\tilde\tau}{2 \varepsilon^2} b(v) = 0, \qquad b_i(v) = \int \Psi'(v) \, \varphi_i .
//! ```
//!
//! Let $`A(v)`$ be the derivative of the left side in $`v`$. It depends on $`v`$ through $`\int v^2 \varphi_i \varphi_j`$. Then
//! $`v'[u] \, p = A(v)^{-1} M p`$, and the transpose of $`v'[u]`$ is $`M A(v)^{-1}`$.
//!
//! So all derivatives are compositions of five operations, which are closed under differentiation: the mass matrix, the inverse of
//! $`M + \tilde\tau S`$, the symmetric product $`\int a b c \, \varphi_i`$, the step, and $`A(v)^{-1} g`$. Gradients come from Burn's autodiff, and
//! Hessian-vector products from `linearize`.

// Burn 0.22 deprecates its ndarray backend in favour of flex; it stays selectable here until it is gone.
#![cfg_attr(feature = "ndarray", allow(deprecated))]

mod backends;
mod direct;
pub mod element;
mod error;
mod finite_elements;
mod ops;
mod planar;
mod rules;
mod step;

pub use error::Error;
pub use finite_elements::{FiniteElements, Statistics};
pub use ops::{FemOps, Operation};
pub use rules::extensions;
pub use step::FiniteElementStep;

/// How linear systems of the implicit step are solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LinearSolver {
    /// Conjugate gradients with a Fourier preconditioner.
    #[default]
    ConjugateGradients,
    /// Sparse Cholesky factorization on two threads, in place of the direct solver of the paper's comparison.
    Direct,
}

/// How accurately the inner systems are solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// Reduction of the residual of linear systems, in the norm of the preconditioner.
    pub linear: f64,
    /// Residual of the implicit equation relative to the phase field, in the same norm.
    pub newton: f64,
    /// Limit of the iterations of one linear solve.
    pub iterations: usize,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self {
            linear: 1e-10,
            newton: 1e-12,
            iterations: 400,
        }
    }
}

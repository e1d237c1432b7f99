//! The finite-element operations as a Burn backend trait, with their autodiff and capture implementations.
//!
//! Finite elements on a grid have a number, under which they are found again when an operation runs: operations carry numbers only.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use burn::backend::{Backend, ExtensionType, backend_extension, tensor::FloatTensor};
use burn_autodiff::{Autodiff, checkpoint::strategy::CheckpointStrategy};
use burn_backend::TensorMetadata;
use burn_capture::CaptureBackend;
use burn_ir::ScalarIr;
use operators::recording::{Pullback, captured, on_tape};

use self::Operation::{HeatSolve, ImplicitStep, LinearizedSolve, Mass, Product};
use crate::FiniteElements;

pub(crate) const MASS: &str = "fem::mass";
pub(crate) const HEAT: &str = "fem::heat_solve";
pub(crate) const PRODUCT: &str = "fem::product";
pub(crate) const IMPLICIT: &str = "fem::implicit_step";
pub(crate) const LINEARIZED: &str = "fem::linearized_solve";

/// Finite elements of any dimension, as operations see them.
pub(crate) trait Host: Send + Sync {
    /// The operation of this identifier.
    fn run(&self, id: &str, inputs: &[Vec<f64>]) -> Vec<f64>;
    fn reaction(&self) -> f64;
}

impl<const D: usize> Host for FiniteElements<D> {
    fn run(&self, id: &str, inputs: &[Vec<f64>]) -> Vec<f64> {
        match (id, inputs) {
            (MASS, [x]) => self.mass(x),
            (HEAT, [x]) => self.heat_solve(x),
            (PRODUCT, [a, b, c]) => self.product(a, b, c),
            (IMPLICIT, [u]) => self.or_nan(self.implicit_step(u)),
            (LINEARIZED, [v, g]) => self.or_nan(self.linearized_solve(v, g)),
            _ => unreachable!(
                "finite elements have no operation {id} of {} inputs",
                inputs.len()
            ),
        }
    }

    fn reaction(&self) -> f64 {
        FiniteElements::reaction(self)
    }
}

/// The finite elements in use, by number.
fn registry() -> MutexGuard<'static, BTreeMap<u64, Weak<dyn Host>>> {
    static IN_USE: Mutex<BTreeMap<u64, Weak<dyn Host>>> = Mutex::new(BTreeMap::new());
    // A map of weak references is valid wherever a panic could have left it.
    IN_USE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The number of finite elements, under which they are found as long as they have an owner.
pub(crate) fn register<const D: usize>(elements: &Arc<FiniteElements<D>>) -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let host: Arc<dyn Host> = elements.clone();
    let mut in_use = registry();
    in_use.retain(|_, elements| elements.strong_count() > 0);
    in_use.insert(number, Arc::downgrade(&host));
    number
}

/// The finite elements of that number.
pub(crate) fn host(number: u64) -> Arc<dyn Host> {
    registry()
        .get(&number)
        .and_then(Weak::upgrade)
        .expect("a step keeps its elements alive as long as graphs of it run")
}

/// An operation of finite elements on its arguments.
#[derive(ExtensionType)]
pub enum Operation<B: Backend> {
    /// `M x`.
    Mass(FloatTensor<B>),
    /// `(M + tautilde S)^-1 x`.
    HeatSolve(FloatTensor<B>),
    /// `int a b c phi_i`.
    Product(FloatTensor<B>, FloatTensor<B>, FloatTensor<B>),
    /// The implicit step of mean curvature flow, `v[u]`.
    ImplicitStep(FloatTensor<B>),
    /// `A(v)^-1 g`, of `v` and `g`.
    LinearizedSolve(FloatTensor<B>, FloatTensor<B>),
}

impl<B: Backend> Operation<B> {
    /// The identifier and the arguments.
    pub(crate) fn parts(self) -> (&'static str, Vec<FloatTensor<B>>) {
        match self {
            Mass(x) => (MASS, vec![x]),
            HeatSolve(x) => (HEAT, vec![x]),
            Product(a, b, c) => (PRODUCT, vec![a, b, c]),
            ImplicitStep(u) => (IMPLICIT, vec![u]),
            LinearizedSolve(v, g) => (LINEARIZED, vec![v, g]),
        }
    }
}

/// Finite elements on a backend; their operations are closed under differentiation in both modes.
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(any(feature = "wgpu", feature = "cuda")),
    Capture,
    Autodiff
)]
pub trait FemOps: Backend {
    /// An operation of the finite elements of this number; the result has the shape of the arguments.
    fn fem(#[extension_type] operation: Operation<Self>, elements: u64) -> FloatTensor<Self>;
}

impl FemOps for CaptureBackend {
    fn fem(operation: Operation<Self>, elements: u64) -> FloatTensor<Self> {
        let (id, inputs) = operation.parts();
        let shape = inputs[0].shape();
        captured(id, inputs, shape, vec![ScalarIr::UInt(elements)])
    }
}

impl<B: Backend + FemOps, C: CheckpointStrategy> FemOps for Autodiff<B, C> {
    #[allow(clippy::redundant_closure_for_method_calls)] // the tensor's type cannot be named
    fn fem(operation: Operation<Self>, elements: u64) -> FloatTensor<Self> {
        let run = move |operation| B::fem(operation, elements);
        match operation {
            // Self-adjoint.
            Mass(x) => {
                let (node, x) = (x.node(), x.into_primitive());
                let to_x = Pullback::new(move |g| run(Mass(g)));
                on_tape::<B, C, 1>([node], run(Mass(x)), [to_x])
            }
            HeatSolve(x) => {
                let (node, x) = (x.node(), x.into_primitive());
                let to_x = Pullback::new(move |g| run(HeatSolve(g)));
                on_tape::<B, C, 1>([node], run(HeatSolve(x)), [to_x])
            }
            // Symmetric in all four places: the gradient with respect to one factor has the cotangent in its place.
            Product(a, b, c) => {
                let nodes = [a.node(), b.node(), c.node()];
                let [a, b, c] = [a, b, c].map(|x| x.into_primitive());
                let pullbacks = [(&b, &c), (&c, &a), (&a, &b)].map(|(x, y)| {
                    let (x, y) = (x.clone(), y.clone());
                    Pullback::new(move |g| run(Product(x.clone(), y.clone(), g)))
                });
                on_tape::<B, C, 3>(nodes, run(Product(a, b, c)), pullbacks)
            }
            // The gradient is by the adjoint of `A(v)^-1 M`.
            ImplicitStep(u) => {
                let (node, u) = (u.node(), u.into_primitive());
                let v = run(ImplicitStep(u));
                let at = v.clone();
                let to_u = Pullback::new(move |g| run(Mass(run(LinearizedSolve(at.clone(), g)))));
                on_tape::<B, C, 1>([node], v, [to_u])
            }
            // With `y = A(v)^-1 g`: `g` gets `z = A(v)^-1 w`, and `v` gets `-6 reaction int v y z phi`.
            LinearizedSolve(v, g) => {
                let nodes = [v.node(), g.node()];
                let (v, g) = (v.into_primitive(), g.into_primitive());
                let y = run(LinearizedSolve(v.clone(), g));
                let (at, solution) = (v.clone(), y.clone());
                let to_v = Pullback::new(move |w| {
                    let factor = -6.0 * host(elements).reaction();
                    let z = run(LinearizedSolve(at.clone(), w));
                    let product = run(Product(at.clone(), solution.clone(), z));
                    B::float_mul_scalar(product, factor.into())
                });
                let to_g = Pullback::new(move |w| run(LinearizedSolve(v.clone(), w)));
                on_tape::<B, C, 2>(nodes, y, [to_v, to_g])
            }
        }
    }
}

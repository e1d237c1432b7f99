//! The finite-element operations as a Burn backend trait, with their autodiff and capture implementations.
//!
//! A scheme has a number, under which it is found again when an operation runs: operations carry numbers only.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};

use burn::backend::{Backend, backend_extension, tensor::FloatTensor};
use burn_autodiff::{
    Autodiff,
    checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
    grads::Gradients,
    ops::{Backward, Ops, OpsKind, binary, unary},
};
use burn_backend::TensorMetadata;
use burn_capture::CaptureBackend;
use burn_ir::{CustomOpIr, OperationIr, OperationOutput, ScalarIr, TensorIr};
use burn_router::{RouterClient, RouterTensor};

use crate::Scheme;

pub(crate) const MASS: &str = "fem::mass";
pub(crate) const HEAT: &str = "fem::heat_solve";
pub(crate) const PRODUCT: &str = "fem::product";
pub(crate) const IMPLICIT: &str = "fem::implicit_step";
pub(crate) const LINEARIZED: &str = "fem::linearized_solve";

/// A scheme of any dimension, as operations see it.
pub(crate) trait Host: Send + Sync {
    fn mass(&self, x: &[f64]) -> Vec<f64>;
    fn heat_solve(&self, x: &[f64]) -> Vec<f64>;
    fn product(&self, a: &[f64], b: &[f64], c: &[f64]) -> Vec<f64>;
    fn implicit_step(&self, u: &[f64]) -> Vec<f64>;
    fn linearized_solve(&self, v: &[f64], g: &[f64]) -> Vec<f64>;
    fn reaction(&self) -> f64;
}

impl<const D: usize> Host for Scheme<D> {
    fn mass(&self, x: &[f64]) -> Vec<f64> {
        Scheme::mass(self, x)
    }

    fn heat_solve(&self, x: &[f64]) -> Vec<f64> {
        Scheme::heat_solve(self, x)
    }

    fn product(&self, a: &[f64], b: &[f64], c: &[f64]) -> Vec<f64> {
        Scheme::product(self, a, b, c)
    }

    fn implicit_step(&self, u: &[f64]) -> Vec<f64> {
        self.or_nan(Scheme::implicit_step(self, u))
    }

    fn linearized_solve(&self, v: &[f64], g: &[f64]) -> Vec<f64> {
        self.or_nan(Scheme::linearized_solve(self, v, g))
    }

    fn reaction(&self) -> f64 {
        Scheme::reaction(self)
    }
}

/// The schemes in use, by number.
fn registry() -> MutexGuard<'static, HashMap<u64, Weak<dyn Host>>> {
    static SCHEMES: OnceLock<Mutex<HashMap<u64, Weak<dyn Host>>>> = OnceLock::new();
    // A map of weak references is valid wherever a panic could have left it.
    SCHEMES
        .get_or_init(Mutex::default)
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
}

/// A scheme with its number; leaves the registry when the last clone is dropped.
#[derive(Clone)]
pub(crate) struct Registered<const D: usize>(Arc<Entry<D>>);

struct Entry<const D: usize> {
    number: u64,
    scheme: Arc<Scheme<D>>,
}

impl<const D: usize> Registered<D> {
    pub(crate) fn new(scheme: Scheme<D>) -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let scheme = Arc::new(scheme);
        let host: Arc<dyn Host> = scheme.clone();
        registry().insert(number, Arc::downgrade(&host));
        Self(Arc::new(Entry { number, scheme }))
    }

    pub(crate) fn number(&self) -> u64 {
        self.0.number
    }

    pub(crate) fn scheme(&self) -> &Scheme<D> {
        &self.0.scheme
    }
}

impl<const D: usize> Drop for Entry<D> {
    fn drop(&mut self) {
        registry().remove(&self.number);
    }
}

/// The scheme of that number.
pub(crate) fn host(number: u64) -> Arc<dyn Host> {
    registry()
        .get(&number)
        .and_then(Weak::upgrade)
        .expect("a step keeps its scheme alive as long as graphs of it run")
}

/// Operations of finite-element schemes, closed under differentiation in both modes.
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(any(feature = "wgpu", feature = "cuda")),
    Capture,
    Autodiff
)]
pub trait FemOps: Backend {
    /// `M x`.
    fn fem_mass(x: FloatTensor<Self>, scheme: u64) -> FloatTensor<Self>;
    /// `(M + tautilde S)^-1 x`.
    fn fem_heat_solve(x: FloatTensor<Self>, scheme: u64) -> FloatTensor<Self>;
    /// `int a b c phi_i`.
    fn fem_product(
        a: FloatTensor<Self>,
        b: FloatTensor<Self>,
        c: FloatTensor<Self>,
        scheme: u64,
    ) -> FloatTensor<Self>;
    /// The implicit step of mean curvature flow.
    fn fem_implicit_step(u: FloatTensor<Self>, scheme: u64) -> FloatTensor<Self>;
    /// `A(v)^-1 g`.
    fn fem_linearized_solve(
        v: FloatTensor<Self>,
        g: FloatTensor<Self>,
        scheme: u64,
    ) -> FloatTensor<Self>;
}

fn record(
    id: &'static str,
    inputs: Vec<FloatTensor<CaptureBackend>>,
    scheme: u64,
) -> FloatTensor<CaptureBackend> {
    let first = &inputs[0];
    let (client, shape, dtype) = (first.client.clone(), first.shape(), first.dtype());
    let inputs: Vec<TensorIr> = inputs.into_iter().map(RouterTensor::into_ir).collect();
    let output = TensorIr::uninit(client.create_empty_handle(), shape, dtype);
    let operation = CustomOpIr::with_scalars(id, &inputs, &[output], vec![ScalarIr::UInt(scheme)]);
    client.register(OperationIr::Custom(operation)).output()
}

impl FemOps for CaptureBackend {
    fn fem_mass(x: FloatTensor<Self>, scheme: u64) -> FloatTensor<Self> {
        record(MASS, vec![x], scheme)
    }

    fn fem_heat_solve(x: FloatTensor<Self>, scheme: u64) -> FloatTensor<Self> {
        record(HEAT, vec![x], scheme)
    }

    fn fem_product(
        a: FloatTensor<Self>,
        b: FloatTensor<Self>,
        c: FloatTensor<Self>,
        scheme: u64,
    ) -> FloatTensor<Self> {
        record(PRODUCT, vec![a, b, c], scheme)
    }

    fn fem_implicit_step(u: FloatTensor<Self>, scheme: u64) -> FloatTensor<Self> {
        record(IMPLICIT, vec![u], scheme)
    }

    fn fem_linearized_solve(
        v: FloatTensor<Self>,
        g: FloatTensor<Self>,
        scheme: u64,
    ) -> FloatTensor<Self> {
        record(LINEARIZED, vec![v, g], scheme)
    }
}

/// `factor * x`
fn scaled<B: Backend>(x: FloatTensor<B>, factor: f64) -> FloatTensor<B> {
    B::float_mul_scalar(x, factor.into())
}

/// Self-adjoint linear operations: their gradient is themselves.
macro_rules! self_adjoint {
    ($name:ident, $node:ident) => {
        fn $name(x: FloatTensor<Self>, scheme: u64) -> FloatTensor<Self> {
            #[derive(Debug)]
            struct $node;
            impl<B: Backend + FemOps> Backward<B, 1> for $node {
                type State = u64;
                fn backward(
                    self,
                    ops: Ops<u64, 1>,
                    grads: &mut Gradients,
                    _checkpointer: &mut Checkpointer,
                ) {
                    let scheme = ops.state;
                    unary::<B, _>(ops.parents, ops.node, grads, |g| B::$name(g, scheme));
                }
            }
            let node = x.node();
            let y = B::$name(x.into_primitive(), scheme);
            match $node.prepare::<C>([node]).compute_bound().stateful() {
                OpsKind::Tracked(prepared) => prepared.finish(scheme, y),
                OpsKind::UnTracked(prepared) => prepared.finish(y),
            }
        }
    };
}

impl<B: Backend + FemOps, C: CheckpointStrategy> FemOps for Autodiff<B, C> {
    self_adjoint!(fem_mass, Mass);
    self_adjoint!(fem_heat_solve, HeatSolve);

    #[allow(clippy::redundant_closure_for_method_calls)] // the tensor's type cannot be named
    fn fem_product(
        a: FloatTensor<Self>,
        b: FloatTensor<Self>,
        c: FloatTensor<Self>,
        scheme: u64,
    ) -> FloatTensor<Self> {
        /// Symmetric in all four places: the gradient with respect to one factor has the cotangent in its place.
        #[derive(Debug)]
        struct Product;
        impl<B: Backend + FemOps> Backward<B, 3> for Product {
            type State = ([FloatTensor<B>; 3], u64);
            fn backward(
                self,
                ops: Ops<Self::State, 3>,
                grads: &mut Gradients,
                _checkpointer: &mut Checkpointer,
            ) {
                let g = grads.consume::<B>(&ops.node);
                let (factors, scheme) = ops.state;
                for (i, parent) in ops.parents.into_iter().enumerate() {
                    let Some(parent) = parent else { continue };
                    let [x, y] = [(i + 1) % 3, (i + 2) % 3].map(|k| factors[k].clone());
                    let gradient = B::fem_product(x, y, g.clone(), scheme);
                    grads.register::<B>(parent.id, gradient);
                }
            }
        }
        let nodes = [a.node(), b.node(), c.node()];
        let factors = [a, b, c].map(|x| x.into_primitive());
        let [x, y, z] = factors.clone();
        let result = B::fem_product(x, y, z, scheme);
        match Product.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => prepared.finish((factors, scheme), result),
            OpsKind::UnTracked(prepared) => prepared.finish(result),
        }
    }

    fn fem_implicit_step(u: FloatTensor<Self>, scheme: u64) -> FloatTensor<Self> {
        /// The adjoint of `A(v)^-1 M`.
        #[derive(Debug)]
        struct ImplicitStep;
        impl<B: Backend + FemOps> Backward<B, 1> for ImplicitStep {
            type State = (FloatTensor<B>, u64);
            fn backward(
                self,
                ops: Ops<Self::State, 1>,
                grads: &mut Gradients,
                _checkpointer: &mut Checkpointer,
            ) {
                let (v, scheme) = ops.state;
                unary::<B, _>(ops.parents, ops.node, grads, |g| {
                    B::fem_mass(B::fem_linearized_solve(v, g, scheme), scheme)
                });
            }
        }
        let node = u.node();
        let v = B::fem_implicit_step(u.into_primitive(), scheme);
        match ImplicitStep.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => prepared.finish((v.clone(), scheme), v),
            OpsKind::UnTracked(prepared) => prepared.finish(v),
        }
    }

    fn fem_linearized_solve(
        v: FloatTensor<Self>,
        g: FloatTensor<Self>,
        scheme: u64,
    ) -> FloatTensor<Self> {
        /// With `y = A(v)^-1 g`: `g` gets `z = A(v)^-1 w`, and `v` gets `-6 reaction int v y z phi`.
        #[derive(Debug)]
        struct LinearizedSolve;
        impl<B: Backend + FemOps> Backward<B, 2> for LinearizedSolve {
            type State = (FloatTensor<B>, FloatTensor<B>, u64);
            fn backward(
                self,
                ops: Ops<Self::State, 2>,
                grads: &mut Gradients,
                _checkpointer: &mut Checkpointer,
            ) {
                let (v, y, scheme) = ops.state;
                let factor = -6.0 * host(scheme).reaction();
                let at = v.clone();
                binary::<B, _, _>(
                    ops.parents,
                    ops.node,
                    grads,
                    |w| {
                        let z = B::fem_linearized_solve(at.clone(), w, scheme);
                        scaled::<B>(B::fem_product(at, y, z, scheme), factor)
                    },
                    |w| B::fem_linearized_solve(v, w, scheme),
                );
            }
        }
        let nodes = [v.node(), g.node()];
        let (v, g) = (v.into_primitive(), g.into_primitive());
        let y = B::fem_linearized_solve(v.clone(), g, scheme);
        match LinearizedSolve
            .prepare::<C>(nodes)
            .compute_bound()
            .stateful()
        {
            OpsKind::Tracked(prepared) => prepared.finish((v, y.clone(), scheme), y),
            OpsKind::UnTracked(prepared) => prepared.finish(y),
        }
    }
}

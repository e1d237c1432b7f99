//! Custom operations: a circular convolution and the derivatives of a pointwise function, written as
//! a backend extension, and an energy that uses both.
use crate::common::{distance, random, vec};
use burn::backend::autodiff::Autodiff;
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind, unary};
use burn::backend::capture::CaptureBackend;
use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, Flex, FlexDevice, TensorMetadata, backend_extension};
use burn::tensor::{Device, Tensor, TensorData};
use burn_linearize::dual::{self, Dual};
use burn_linearize::taylor::{halvings, remainder};
use burn_linearize::{
    Builder, CustomOpIr, Error, Extensions, Graph, OperationIr, ScalarIr, TensorIr, Value,
    multilinear,
};
use burn_router::RouterClient;

#[backend_extension(Flex, Capture, Autodiff)]
trait Blur: Backend {
    /// `yᵢ = ½ xᵢ + ½ xᵢ₊₁` in row-major order, cyclically, or its adjoint.
    fn blur(x: FloatTensor<Self>, adjoint: bool) -> FloatTensor<Self>;
    /// The `order`-th derivative of `sin`.
    fn wave(x: FloatTensor<Self>, order: u64) -> FloatTensor<Self>;
}

fn map(x: FloatTensor<Flex>, f: impl Fn(&[f64]) -> Vec<f64>) -> FloatTensor<Flex> {
    let shape = x.shape();
    let data = Tensor::<1>::from_primitive::<Flex>(x).into_data();
    let data: Vec<f64> = data.try_into_vec().unwrap();
    Flex::float_from_data(TensorData::new(f(&data), shape), &FlexDevice)
}

impl Blur for Flex {
    fn blur(x: FloatTensor<Self>, adjoint: bool) -> FloatTensor<Self> {
        map(x, |x| {
            let n = x.len();
            let step = if adjoint { n - 1 } else { 1 };
            (0..n).map(|i| 0.5 * (x[i] + x[(i + step) % n])).collect()
        })
    }

    fn wave(x: FloatTensor<Self>, order: u64) -> FloatTensor<Self> {
        let phase = order as f64 * std::f64::consts::FRAC_PI_2;
        map(x, |x| x.iter().map(|x| (x + phase).sin()).collect())
    }
}

fn record(
    x: FloatTensor<CaptureBackend>,
    id: &str,
    scalar: ScalarIr,
) -> FloatTensor<CaptureBackend> {
    use burn_router::RouterTensor;
    let client = x.client.clone();
    let (shape, dtype) = (x.shape(), x.dtype());
    let out = RouterTensor::new(
        client.create_empty_handle(),
        shape.clone(),
        dtype,
        client.clone(),
    );
    client.register_op(OperationIr::Custom(CustomOpIr {
        id: id.to_owned(),
        inputs: vec![x.into_ir()],
        outputs: vec![TensorIr::uninit(out.id(), shape, dtype)],
        scalars: vec![scalar],
    }));
    out
}

impl Blur for CaptureBackend {
    fn blur(x: FloatTensor<Self>, adjoint: bool) -> FloatTensor<Self> {
        record(x, "blur", ScalarIr::Bool(adjoint))
    }

    fn wave(x: FloatTensor<Self>, order: u64) -> FloatTensor<Self> {
        record(x, "wave", ScalarIr::UInt(order))
    }
}

impl<B: Blur, C: CheckpointStrategy> Blur for Autodiff<B, C> {
    fn blur(x: FloatTensor<Self>, adjoint: bool) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Step;
        impl<B: Blur> Backward<B, 1> for Step {
            type State = bool;
            fn backward(self, ops: Ops<bool, 1>, g: &mut Gradients, _: &mut Checkpointer) {
                unary::<B, _>(ops.parents, ops.node, g, |d| B::blur(d, !ops.state));
            }
        }
        let (x, node) = x.into_parts();
        let y = B::blur(x, adjoint);
        match Step.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(adjoint, y),
            OpsKind::UnTracked(prep) => prep.finish(y),
        }
    }

    fn wave(x: FloatTensor<Self>, order: u64) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Step;
        impl<B: Blur> Backward<B, 1> for Step {
            type State = (FloatTensor<B>, u64);
            fn backward(self, ops: Ops<Self::State, 1>, g: &mut Gradients, _: &mut Checkpointer) {
                let (x, order) = ops.state;
                unary::<B, _>(ops.parents, ops.node, g, |d| {
                    B::float_mul(d, B::wave(x, order + 1))
                });
            }
        }
        let (x, node) = x.into_parts();
        let y = B::wave(x.clone(), order);
        match Step.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((x, order), y),
            OpsKind::UnTracked(prep) => prep.finish(y),
        }
    }
}

fn blur<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    Tensor::from_dispatch(<Dispatch as Blur>::blur(x.into_dispatch(), false))
}

fn wave<const D: usize>(x: Tensor<D>, order: u64) -> Tensor<D> {
    Tensor::from_dispatch(<Dispatch as Blur>::wave(x.into_dispatch(), order))
}

fn rules() -> Extensions {
    let mut extensions = Extensions::new();
    extensions.rule("blur", multilinear).rule(
        "wave",
        |operation: &CustomOpIr, tangents: &[Option<TensorIr>], build: &mut Builder| {
            let Some(tangent) = &tangents[0] else {
                return Ok(vec![None]);
            };
            let order = operation.scalars[0].elem::<u64>();
            let slope = build.primal(CustomOpIr {
                scalars: vec![ScalarIr::UInt(order + 1)],
                ..operation.clone()
            });
            Ok(vec![Some(build.mul(&slope, tangent))])
        },
    );
    extensions
}

fn handlers(extensions: &mut Extensions) {
    (extensions.flex).register("blur", |handles, operation, _| {
        let x = handles.get_float_tensor::<Flex>(&operation.inputs[0]);
        let adjoint = operation.scalars[0] == ScalarIr::Bool(true);
        let y = Flex::blur(x, adjoint);
        handles.register_float_tensor::<Flex>(&operation.outputs[0].id, y);
    });
    (extensions.flex).register("wave", |handles, operation, _| {
        let x = handles.get_float_tensor::<Flex>(&operation.inputs[0]);
        let y = Flex::wave(x, operation.scalars[0].elem());
        handles.register_float_tensor::<Flex>(&operation.outputs[0].id, y);
    });
}

/// `½ Σ (u − f)² + c/2 Σ (sin(blur u) − u)²`
fn energy<const D: usize>(u: Tensor<D>, f: Tensor<D>, c: Tensor<1>) -> Tensor<1> {
    let proximal = u.clone() - f;
    let residual = wave(blur(u.clone()), 0) - u;
    proximal.powi_scalar(2).sum() * 0.5 + residual.powi_scalar(2).sum() * c * 0.5
}

fn problem<const D: usize>(shape: [usize; D]) -> (Tensor<D>, Tensor<D>, Tensor<1>, Graph) {
    let device = Device::flex();
    let u = random(&device, shape, 1, -1.0, 1.0);
    let f = random(&device, shape, 2, -1.0, 1.0);
    let c = random(&device, [1], 3, 0.5, 1.0);
    let graph = Graph::gradient(&[(&u).into()], &[(&f).into(), (&c).into()], |i| {
        energy(i.variable::<D>(0), i.parameter::<D>(0), i.parameter(1))
    })
    .unwrap();
    (u, f, c, graph)
}

fn against_duals<const D: usize>(shape: [usize; D]) {
    let (u, f, c, graph) = problem(shape);
    let device = u.device();
    let mut extensions = rules();
    handlers(&mut extensions);
    let program = graph.linearize(&extensions, None).unwrap();
    let mut lin = program.on(&device, &extensions).unwrap();
    let parameters = [Value::from(&f), Value::from(&c)];
    let at = lin.at(&[(&u).into()], &parameters).unwrap();
    let p: Tensor<D> = random(&device, shape, 4, -1.0, 1.0);
    let product = lin.apply(&[(&p).into()]).unwrap().remove(0);
    let weight = vec(&c)[0];
    let expected = dual::hessian_vector_product(&u, &p, |u| {
        let proximal = u.clone() - f.clone().autodiff();
        let w = u.clone().linear(blur);
        let (value, slope) = (wave(w.primal.clone(), 0), wave(w.primal.clone(), 1));
        let residual: Dual<D> = w.pointwise(value, slope) - u;
        proximal.powi(2).sum() * 0.5 + residual.powi(2).sum() * (weight * 0.5)
    });
    let error = distance(&product.to_vec(), &vec(&expected));
    assert!(error < 1e-12, "off by {error:e}");

    let along = [&at.gradients[0], &product].map(|v| v.dot(&(&p).into()));
    let mut value = |t: f64| {
        let there = u.clone() + p.clone() * t;
        lin.value(&[there.into()], &parameters).unwrap().to_vec()[0]
    };
    let steps = halvings(0.25, 12);
    let taylor = remainder(&mut value, &along[..1], &steps, f64::EPSILON);
    assert!((taylor.rate().unwrap() - 2.0).abs() < 0.1, "{taylor:?}");
    let taylor = remainder(&mut value, &along, &steps, f64::EPSILON);
    assert!(taylor.is_consistent(0.2), "{taylor:?}");
}

#[test]
fn custom_operations_differentiate_in_2d_and_3d() {
    against_duals([6, 5]);
    against_duals([3, 4, 5]);
}

/// Forward and adjoint transform, and little else: this is the cost of a conjugate-gradient step.
#[test]
fn the_tangent_program_is_two_transforms_and_a_few_passes() {
    let (_, _, _, graph) = problem([6, 5]);
    let program = graph.linearize(&rules(), None).unwrap();
    let statistics = program.statistics();
    let total: usize = statistics.tangent.values().sum();
    assert_eq!(statistics.tangent["blur"], 2);
    assert!(!statistics.tangent.contains_key("wave"), "{statistics:?}");
    assert!((5..=12).contains(&total), "{statistics:?}");
    // sin, cos, −sin at the same point, each once.
    assert_eq!(statistics.primal["wave"], 3, "{statistics:?}");
    assert_eq!(statistics.primal["blur"], 2, "{statistics:?}");
    assert_eq!(statistics.value["wave"], 1, "{statistics:?}");
    assert!(statistics.saved <= 3, "{statistics:?}");
}

#[test]
fn missing_rules_and_handlers_name_the_operation() {
    let (u, _, _, graph) = problem([6, 5]);
    let error = graph.linearize(&Extensions::new(), None).unwrap_err();
    assert!(
        matches!(&error, Error::NoRule { operation } if operation == "blur"),
        "{error}"
    );
    let program = graph.linearize(&rules(), None).unwrap();
    let error = program.on(&u.device(), &rules()).err().unwrap();
    assert!(
        matches!(&error, Error::NoHandler { operation, backend: "flex" }
            if operation == "blur" || operation == "wave"),
        "{error}"
    );
}

#[test]
fn wrong_rules_are_refused() {
    let (_, _, _, graph) = problem([6, 5]);
    let mut extensions = rules();
    extensions.rule(
        "blur",
        |_: &CustomOpIr, _: &[Option<TensorIr>], _: &mut Builder| Ok(vec![]),
    );
    let error = graph.linearize(&extensions, None).unwrap_err();
    assert!(
        matches!(&error, Error::Rule { operation } if operation == "blur"),
        "{error}"
    );
}

/// What a rule can build: sums, differences, multiples, and operations on tangents.
#[test]
fn rules_combine_tangents() {
    let device = Device::flex();
    let u: Tensor<2> = random(&device, [4, 4], 1, -1.0, 1.0);
    let graph = Graph::trace(&[(&u).into()], &[], |i| {
        vec![blur(i.variable::<2>(0)).into()]
    })
    .unwrap();
    let mut extensions = rules();
    handlers(&mut extensions);
    // 3·blur(ẋ) − ẋ + u⊙ẋ − 2·0: not the derivative of anything, but linear.
    extensions.rule(
        "blur",
        |operation: &CustomOpIr, tangents: &[Option<TensorIr>], build: &mut Builder| {
            let tangent = tangents[0].clone().unwrap();
            let blurred = build.tangent(CustomOpIr {
                inputs: vec![tangent.clone()],
                ..operation.clone()
            });
            let tripled = build.scale(&blurred, 3.0);
            let negative = build.scale(&tangent, -1.0);
            let difference = build.add(&tripled, &negative);
            let weighted = build.mul(&operation.inputs[0], &tangent);
            let sum = build.add(&difference, &weighted);
            let zero = build.scale(&tangent, 0.0);
            let nothing = build.scale(&zero, -1.0);
            Ok(vec![Some(build.add(&sum, &nothing))])
        },
    );
    let mut lin = graph
        .linearize(&extensions, None)
        .unwrap()
        .on(&device, &extensions)
        .unwrap();
    lin.at(&[(&u).into()], &[]).unwrap();
    let p: Tensor<2> = random(&device, [4, 4], 2, -1.0, 1.0);
    let found = lin.apply(&[(&p).into()]).unwrap()[0].to_vec();
    let expected = blur(p.clone()) * 3.0 - p.clone() + u * p;
    assert!(distance(&found, &vec(&expected)) < 1e-14);
    assert_eq!(found.len(), 16);
    assert_eq!(lin.program().statistics().saved, 1);
}

//! Whole energies as a user would write them, against duals (reverse over forward), which share no
//! code with the linearized programs; and how long the programs are.
#![allow(
    clippy::needless_pass_by_value,
    reason = "energies consume tensors, as Burn's methods do"
)]

use crate::common::{self, check, devices, distance, linearization, random, vec};
use burn::tensor::module::conv2d;
use burn::tensor::ops::ConvOptions;
use burn::tensor::{Device, Tensor};
use burn_linearize::dual::{self, Dual};
use burn_linearize::taylor::{halvings, remainder};
use burn_linearize::{Extensions, Graph, Statistics, Value};

/// Periodic shift by one along an axis, by slicing and concatenating.
fn shift<const D: usize>(u: Tensor<D>, axis: usize) -> Tensor<D> {
    let n = u.dims()[axis];
    Tensor::cat(
        vec![u.clone().narrow(axis, 1, n - 1), u.narrow(axis, 0, 1)],
        axis,
    )
}

/// The width `ε` of interfaces.
const EPS: f64 = 0.3;

/// `Σ ε/2 |∇u|² + W(u)/ε`, `W(u) = 9/16 (1 − u²)²`, unit grid spacing.
fn ginzburg_landau<const D: usize>(u: Tensor<D>) -> Tensor<1> {
    let mut energy = {
        let well = u.clone().square().neg() + 1.0;
        well.square().sum() * (9.0 / 16.0 / EPS)
    };
    for axis in 0..D {
        let slope = shift(u.clone(), axis) - u.clone();
        energy = energy + slope.powi_scalar(2).sum() * (0.5 * EPS);
    }
    energy
}

fn dual_ginzburg_landau<const D: usize>(u: Dual<D>) -> Dual<1> {
    let well = (-(u.clone() * u.clone())) + 1.0;
    let mut energy = (well.clone() * well).sum() * (9.0 / 16.0 / EPS);
    for axis in 0..D {
        let slope = u.clone().linear(|t| shift(t, axis)) - u.clone();
        energy = energy + (slope.clone() * slope).sum() * (0.5 * EPS);
    }
    energy
}

const P: f64 = 1.5;

/// `Σ (δ² + |∇u|²)^(p/2)`
fn p_laplacian<const D: usize>(u: Tensor<D>) -> Tensor<1> {
    let mut norm = u.zeros_like() + 0.1;
    for axis in 0..D {
        let slope = shift(u.clone(), axis) - u.clone();
        norm = norm + slope.clone() * slope;
    }
    norm.powf_scalar(P / 2.0).sum()
}

fn dual_p_laplacian<const D: usize>(u: Dual<D>) -> Dual<1> {
    let mut norm = Dual::constant(u.primal.zeros_like() + 0.1);
    for axis in 0..D {
        let slope = u.clone().linear(|t| shift(t, axis)) - u.clone();
        norm = norm + slope.clone() * slope;
    }
    norm.powf(P / 2.0).sum()
}

/// Hessian-vector product of a program and by duals.
fn against_duals<const D: usize>(
    u: &Tensor<D>,
    energy: impl Fn(Tensor<D>) -> Tensor<1>,
    duals: impl Fn(Dual<D>) -> Dual<1>,
) -> Statistics {
    let device = u.device();
    let graph = Graph::gradient(&[u.into()], &[], |i| energy(i.variable(0))).unwrap();
    let mut lin = linearization(&graph, &device);
    lin.at(&[u.into()], &[]).unwrap();
    for seed in 0..3 {
        let p: Tensor<D> = random(&device, u.dims(), 90 + seed, -1.0, 1.0);
        let product = lin.apply(&[(&p).into()]).unwrap()[0].to_vec();
        let expected = vec(&dual::hessian_vector_product(u, &p, &duals));
        let error = distance(&product, &expected);
        assert!(error < 1e-12, "off by {error:e}");
    }
    lin.program().statistics()
}

fn total(counts: &std::collections::BTreeMap<String, usize>) -> usize {
    counts.values().sum()
}

#[test]
fn ginzburg_landau_in_2d_and_3d() {
    for device in devices() {
        let u: Tensor<2> = random(&device, [8, 6], 1, -1.0, 1.0);
        against_duals(&u, ginzburg_landau, dual_ginzburg_landau);
        check("Ginzburg-Landau 2D", &u, ginzburg_landau);
        let u: Tensor<3> = random(&device, [4, 5, 6], 1, -1.0, 1.0);
        against_duals(&u, ginzburg_landau, dual_ginzburg_landau);
        check("Ginzburg-Landau 3D", &u, ginzburg_landau);
    }
}

#[test]
fn p_laplacian_in_2d_and_3d() {
    for device in devices() {
        let u: Tensor<2> = random(&device, [7, 6], 2, -1.0, 1.0);
        against_duals(&u, p_laplacian, dual_p_laplacian);
        let u: Tensor<3> = random(&device, [4, 5, 6], 2, -1.0, 1.0);
        against_duals(&u, p_laplacian, dual_p_laplacian);
        check("p-Laplacian 3D", &u, p_laplacian);
    }
}

/// All pointwise second derivatives merge into one product with a primal coefficient.
#[test]
fn the_tangent_of_a_local_energy_is_one_product() {
    for device in devices() {
        let u: Tensor<2> = random(&device, [8, 8], 3, -1.0, 1.0);
        let statistics = against_duals(
            &u,
            |u| {
                let well = u.clone().square().neg() + 1.0;
                well.square().sum() * 0.7 + (u.clone() * u.tanh()).mean()
            },
            |u| {
                let well = (-(u.clone() * u.clone())) + 1.0;
                (well.clone() * well).sum() * 0.7 + (u.clone() * u.tanh()).mean()
            },
        );
        assert_eq!(total(&statistics.tangent), 1, "{statistics:?}");
        assert_eq!(statistics.tangent["Mul"], 1);
        assert_eq!(statistics.saved, 1);
    }
}

/// A product of a tensor with itself and an integer power leave the same programs, and a parameter
/// multiplied into a sum costs nothing per element beyond one product.
#[test]
fn squares_simplify_alike_and_scalars_are_not_spread() {
    for device in devices() {
        let u: Tensor<2> = random(&device, [8, 8], 4, -1.0, 1.0);
        let uk: Tensor<2> = random(&device, [8, 8], 5, -1.0, 1.0);
        let c: Tensor<1> = random(&device, [1], 6, 0.5, 1.0);
        let programs = [false, true].map(|power| {
            let square = move |t: Tensor<2>| {
                if power {
                    t.powi_scalar(2)
                } else {
                    t.clone() * t
                }
            };
            let graph = Graph::gradient(&[(&u).into()], &[(&uk).into(), (&c).into()], |i| {
                let u = i.variable::<2>(0);
                let proximal = square(u.clone() - i.parameter::<2>(0)).sum() * 0.5;
                let flat = shift(u.clone(), 0) - u;
                proximal + i.parameter::<1>(1) * square(flat).sum() * 0.5
            })
            .unwrap();
            graph.linearize(&Extensions::new(), None).unwrap()
        });
        assert_eq!(programs[0].statistics(), programs[1].statistics());
        let statistics = programs[0].statistics();
        // One product with c; the rest are shifts, their adjoints, and sums.
        assert_eq!(statistics.tangent["Mul"], 1, "{statistics:?}");
        assert!(
            !statistics.tangent.contains_key("MulScalar"),
            "{statistics:?}"
        );
        assert!(!statistics.tangent.contains_key("Expand"));
        assert!(total(&statistics.tangent) <= 14, "{statistics:?}");
        assert_eq!(statistics.saved_elements, 1, "only c is kept");
        // The value needs no gradient: two squares, their differences, sums and factors.
        assert!(total(&statistics.value) <= 14, "{statistics:?}");
    }
}

/// A network with a hidden layer applied to every pixel.
#[test]
fn perceptron_with_matrix_products() {
    for device in devices() {
        let u: Tensor<2> = random(&device, [6, 5], 7, -1.0, 1.0);
        let weights = |device: &Device| {
            let w: Tensor<2> = random(device, [1, 8], 8, -1.0, 1.0);
            let b: Tensor<2> = random(device, [1, 8], 9, -1.0, 1.0);
            let v: Tensor<2> = random(device, [8, 1], 10, -1.0, 1.0);
            (w, b, v)
        };
        let energy = |u: Tensor<2>| {
            let (w, b, v) = weights(&u.device());
            let hidden = u.clone().reshape([30, 1]).matmul(w) + b;
            let hidden = (hidden.clone() * hidden).neg().exp();
            let out = hidden.matmul(v).reshape([6, 5]);
            let misfit = out - u;
            (misfit.clone() * misfit).mean()
        };
        let duals = |u: Dual<2>| {
            let (w, b, v) = weights(&device);
            let (w, v) = (w.autodiff(), v.autodiff());
            let hidden = u.clone().linear(|t| t.reshape([30, 1]).matmul(w.clone()));
            let hidden = hidden + b.autodiff();
            let hidden = (-(hidden.clone() * hidden)).exp();
            let out = hidden.linear(|t| t.matmul(v.clone()).reshape([6, 5]));
            let misfit = out - u;
            (misfit.clone() * misfit).mean()
        };
        against_duals(&u, energy, duals);
        check("perceptron", &u, energy);
    }
}

/// Training: the weights are the variables, of different ranks.
#[test]
fn several_variables_of_different_ranks() {
    for device in devices() {
        let w: Tensor<2> = random(&device, [4, 3], 11, -1.0, 1.0);
        let b: Tensor<1> = random(&device, [3], 12, -1.0, 1.0);
        let x: Tensor<2> = random(&device, [5, 4], 13, -1.0, 1.0);
        let loss = |w: Tensor<2>, b: Tensor<1>, x: Tensor<2>| {
            let y = (x.matmul(w) + b.unsqueeze()).tanh();
            (y.clone() * y).mean()
        };
        let variables = [Value::from(&w), Value::from(&b)];
        let graph = Graph::gradient(&variables, &[(&x).into()], |i| {
            loss(i.variable(0), i.variable(1), i.parameter(0))
        })
        .unwrap();
        let mut lin = linearization(&graph, &device);
        let parameters = [Value::from(&x)];
        let evaluation = lin.at(&variables, &parameters).unwrap();
        assert_eq!(evaluation.gradients[0].shape(), [4, 3]);
        assert_eq!(evaluation.gradients[1].shape(), [3]);

        let directions = [
            Value::from(random::<2>(&device, [4, 3], 14, -1.0, 1.0)),
            Value::from(random::<1>(&device, [3], 15, -1.0, 1.0)),
        ];
        let others = [
            Value::from(random::<2>(&device, [4, 3], 16, -1.0, 1.0)),
            Value::from(random::<1>(&device, [3], 17, -1.0, 1.0)),
        ];
        let products = lin.apply(&directions).unwrap();
        let reversed = lin.apply(&others).unwrap();
        let dot =
            |a: &[Value], b: &[Value]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(b)).sum() };
        let (left, right) = (dot(&products, &others), dot(&reversed, &directions));
        assert!((left - right).abs() < 1e-14, "{left} {right}");

        let along = [&evaluation.gradients, &products].map(|v| dot(v, &directions));
        let (dw, db) = (directions[0].tensor::<2>(), directions[1].tensor::<1>());
        let (dw, db) = (dw.unwrap(), db.unwrap());
        let mut value = |t: f64| {
            let moved = [
                Value::from(w.clone() + dw.clone() * t),
                Value::from(b.clone() + db.clone() * t),
            ];
            lin.value(&moved, &parameters).unwrap().to_vec()[0]
        };
        let steps = halvings(0.25, 12);
        for (order, tolerance) in [(1, 0.1), (2, 0.2)] {
            let taylor = remainder(&mut value, &along[..order], &steps, f64::EPSILON);
            let rate = taylor.rate().unwrap();
            assert!((rate - 1.0 - order as f64).abs() < tolerance, "{taylor:?}");
        }
    }
}

/// Blur by a convolution layer and compare with the image.
#[test]
fn energy_with_a_convolution() {
    for device in devices() {
        let u: Tensor<2> = random(&device, [7, 6], 18, -1.0, 1.0);
        let blur = |u: Tensor<2>| {
            let kernel: Tensor<4> = random(&u.device(), [1, 1, 3, 3], 19, 0.0, 0.2);
            let options = ConvOptions::new([1, 1], [1, 1], [1, 1], 1);
            conv2d(u.reshape([1, 1, 7, 6]), kernel, None, options).reshape([7, 6])
        };
        let energy = |u: Tensor<2>| {
            let misfit = blur(u.clone()).tanh() - u;
            misfit.powi_scalar(2).sum()
        };
        let duals = |u: Dual<2>| {
            let misfit = u.clone().linear(blur).tanh() - u;
            misfit.powi(2).sum()
        };
        let statistics = against_duals(&u, energy, duals);
        assert_eq!(statistics.tangent["Conv2d"], 1);
        assert_eq!(statistics.tangent["Conv2dXBackward"], 1);
        assert!(total(&statistics.tangent) <= 16, "{statistics:?}");
        check("convolution", &u, energy);
    }
}

/// Rosenbrock's function: the Hessian is known in closed form.
#[test]
fn rosenbrock() {
    for device in devices() {
        let x: Tensor<1> = common::tensor(&device, vec![-1.2, 1.0], [2]);
        let energy = |x: Tensor<1>| {
            let (a, b) = (x.clone().narrow(0, 0, 1), x.narrow(0, 1, 1));
            let valley = b - a.clone() * a.clone();
            valley.powi_scalar(2) * 100.0 + (a.neg() + 1.0).powi_scalar(2)
        };
        let graph = Graph::gradient(&[(&x).into()], &[], |i| energy(i.variable(0))).unwrap();
        let mut lin = linearization(&graph, &device);
        let evaluation = lin.at(&[(&x).into()], &[]).unwrap();
        assert!(distance(&evaluation.value.to_vec(), &[24.2]) < 1e-14);
        assert!(distance(&evaluation.gradients[0].to_vec(), &[-215.6, -88.0]) < 1e-14);
        // ∇²E = [[1200 a² − 400 b + 2, −400 a], [−400 a, 200]]
        for (p, expected) in [([1.0, 0.0], [1330.0, 480.0]), ([0.0, 1.0], [480.0, 200.0])] {
            let p: Tensor<1> = common::tensor(&device, p.to_vec(), [2]);
            let product = lin.apply(&[p.into()]).unwrap()[0].to_vec();
            assert!(distance(&product, &expected) < 1e-14, "{product:?}");
        }
    }
}

//! Every rule, inside an energy, against Burn's autodiff and finite differences of it.

use crate::common::{check, devices, distance, linearization, random, separated, tensor, vec};
use burn::tensor::IndexingUpdateOp::Add;
use burn::tensor::module::{avg_pool2d, conv_transpose2d, conv1d, conv2d, conv3d, linear};
use burn::tensor::ops::{AvgPoolOptions, ConvOptions, ConvTransposeOptions, PadMode};
use burn::tensor::{Bool, DType, Int, Tensor, TensorData, activation};

type Energy<const D: usize> = (&'static str, fn(Tensor<D>) -> Tensor<1>);

/// Constants in the traced function, of another shape on request.
fn constant<const D: usize>(like: &Tensor<D>, shape: [usize; D], seed: u64) -> Tensor<D> {
    random(&like.device(), shape, seed, 0.5, 1.5)
}

/// Weights that make every element's gradient different, and not constant.
fn weigh<const D: usize>(t: Tensor<D>) -> Tensor<1> {
    let w = constant(&t, t.dims(), 3);
    (t.clone() * t * w.clone()).sum() + w.sum()
}

/// A tensor that depends on `u` in every element and is nonlinear.
fn bend<const D: usize>(u: &Tensor<D>) -> Tensor<D> {
    u.clone().sin() + u.clone() * u.clone()
}

/// `g(u) · u`, so that the tangents of both factors meet.
fn mix<const D: usize>(u: &Tensor<D>, g: Tensor<D>) -> Tensor<1> {
    (g * bend(u)).sum()
}

// Elementwise functions; u is in (0.2, 0.8).
const POINTWISE: &[Energy<2>] = &[
    ("add", |u| weigh(u.clone() + bend(&u))),
    ("add scalar", |u| weigh(u + 0.7)),
    ("sub", |u| weigh(bend(&u) - u)),
    ("sub itself", |u| weigh(u.clone() - u.clone() + bend(&u))),
    ("sub scalar", |u| weigh(u - 0.7)),
    ("mul", |u| weigh(u.clone() * bend(&u))),
    ("mul scalar", |u| weigh(bend(&u) * -1.7)),
    ("mul zero", |u| weigh(bend(&u) + u * 0.0)),
    ("div", |u| weigh(bend(&u) / (u + 1.0))),
    ("div scalar", |u| weigh(bend(&u) / 4.0)),
    ("scalar over", |u| weigh(u.clone().recip() * 2.0 + bend(&u))),
    ("neg", |u| weigh(-bend(&u) + u.exp())),
    ("remainder", |u| {
        // The quotient stays between 1 and 2.
        let r = bend(&u) * 0.1 + 1.5;
        weigh((bend(&u) + 1.8).remainder(r))
    }),
    ("remainder scalar", |u| {
        weigh((bend(&u) * 3.0).remainder_scalar(0.7))
    }),
    ("abs", |u| weigh((u.clone() - 0.5).abs() * bend(&u))),
    ("sign", |u| mix(&u.clone(), (u - 0.5).sign())),
    ("powi 2", |u| weigh(u.powi_scalar(2))),
    ("powi 3", |u| weigh(u.powi_scalar(3))),
    ("powi 4", |u| weigh(u.powi_scalar(4))),
    ("powi 5", |u| weigh(u.powi_scalar(5))),
    ("powi -1", |u| weigh(u.powi_scalar(-1))),
    ("powi -2", |u| weigh(u.powi_scalar(-2))),
    ("powi -3", |u| weigh(u.powi_scalar(-3))),
    ("powi 0", |u| weigh(u.clone().powi_scalar(0) + bend(&u))),
    ("square", |u| weigh(bend(&u).square())),
    ("powf", |u| weigh(u.powf_scalar(2.5))),
    ("powf integer", |u| weigh(u.powf_scalar(3.0))),
    ("powf tensor", |u| weigh(u.clone().powf(bend(&u)))),
    ("powf constant exponent", |u| {
        weigh(u.clone().powf(constant(&u, u.dims(), 5)))
    }),
    ("exp", |u| weigh(u.exp())),
    ("log", |u| weigh(u.log())),
    ("log1p", |u| weigh(u.log1p())),
    ("erf", |u| weigh(u.erf())),
    ("sqrt", |u| weigh(u.sqrt())),
    ("sin", |u| weigh(u.sin())),
    ("cos", |u| weigh(u.cos())),
    ("tan", |u| weigh(u.tan())),
    ("sinh", |u| weigh(u.sinh())),
    ("cosh", |u| weigh(u.cosh())),
    ("tanh", |u| weigh(u.tanh())),
    ("asin", |u| weigh(u.asin())),
    ("acos", |u| weigh(u.acos())),
    ("atan", |u| weigh(u.atan())),
    ("asinh", |u| weigh(u.asinh())),
    ("acosh", |u| weigh((u + 1.5).acosh())),
    ("atanh", |u| weigh(u.atanh())),
    ("atan2", |u| weigh(u.clone().atan2(bend(&u)))),
    ("hypot", |u| weigh(u.clone().hypot(bend(&u)))),
    ("recip", |u| weigh(u.recip())),
    ("floor", |u| mix(&u.clone(), (u * 5.0).floor())),
    ("round", |u| mix(&u.clone(), (u * 5.0).round())),
    ("clamp", |u| weigh(bend(&u).clamp(0.4, 1.1))),
    ("clamp min", |u| weigh(bend(&u).clamp_min(0.7))),
    ("clamp max", |u| weigh(bend(&u).clamp_max(0.7))),
    ("max pair", |u| {
        weigh(bend(&u).max_pair(constant(&u, u.dims(), 9) - 0.4))
    }),
    ("relu", |u| weigh(activation::relu(bend(&u) - 0.7))),
    ("leaky relu", |u| {
        weigh(activation::leaky_relu(bend(&u) - 0.7, 0.1))
    }),
    ("sigmoid", |u| weigh(activation::sigmoid(bend(&u)))),
    ("log sigmoid", |u| weigh(activation::log_sigmoid(bend(&u)))),
    ("softplus", |u| weigh(activation::softplus(bend(&u), 1.0))),
    ("silu", |u| weigh(activation::silu(bend(&u)))),
    ("gelu", |u| weigh(activation::gelu(bend(&u)))),
    ("softmax", |u| weigh(activation::softmax(bend(&u) * 2.0, 1))),
    ("log softmax", |u| {
        weigh(activation::log_softmax(bend(&u), 0))
    }),
];

#[test]
fn pointwise() {
    for device in devices() {
        let u = separated(&device, [3, 4], 1, 0.2, 0.8);
        for (name, energy) in POINTWISE {
            // Burn's own are in single precision, or wrong, on this backend.
            let inexact = ["sigmoid", "silu", "gelu"].contains(name);
            if !(inexact && format!("{device:?}").contains("NdArray")) {
                check(name, &u, energy);
            }
        }
    }
}

#[test]
fn activations_have_full_precision_on_every_backend() {
    use burn_linearize::{Graph, taylor};
    type Scalar = fn(f64) -> f64;
    let sigmoid: Scalar = |x| 1.0 / (1.0 + (-x).exp());
    let silu: Scalar = |x| x / (1.0 + (-x).exp());
    let slopes: [(Energy<2>, Scalar, Scalar); 2] = [
        (
            ("sigmoid", |u| activation::sigmoid(u).sum()),
            sigmoid,
            |x| (-x).exp() / (1.0 + (-x).exp()).powi(2),
        ),
        (("silu", |u| activation::silu(u).sum()), silu, |x| {
            let y = 1.0 / (1.0 + (-x).exp());
            y + x * y * (1.0 - y)
        }),
    ];
    for device in devices() {
        let u: Tensor<2> = random(&device, [3, 4], 1, -2.0, 2.0);
        let p: Tensor<2> = random(&device, [3, 4], 2, -0.1, 0.1);
        for ((name, energy), value, slope) in slopes {
            let graph = Graph::gradient(&[(&u).into()], &[], |i| energy(i.variable(0))).unwrap();
            let mut lin = linearization(&graph, &device);
            let at = lin.at(&[(&u).into()], &[]).unwrap();
            let exact: f64 = vec(&u).into_iter().map(value).sum();
            assert!(distance(&at.value.to_vec(), &[exact]) < 1e-14, "{name}");
            let exact: Vec<f64> = vec(&u).into_iter().map(slope).collect();
            let error = distance(&at.gradients[0].to_vec(), &exact);
            assert!(error < 1e-14, "{name}");
        }
        let gelu = |i: &burn_linearize::Inputs| activation::gelu(i.variable::<2>(0)).sum();
        let graph = Graph::gradient(&[(&u).into()], &[], gelu).unwrap();
        let mut lin = linearization(&graph, &device);
        let at = lin.at(&[(&u).into()], &[]).unwrap();
        let product = lin.apply(&[(&p).into()]).unwrap().remove(0);
        let along = [&at.gradients[0], &product].map(|v| v.dot(&(&p).into()));
        let mut value = |t: f64| {
            let there = u.clone() + p.clone() * t;
            lin.value(&[there.into()], &[]).unwrap().to_vec()[0]
        };
        let steps = taylor::halvings(1.0, 14);
        for (order, tolerance) in [(1, 0.2), (2, 0.3)] {
            let taylor = taylor::remainder(&mut value, &along[..order], &steps, f64::EPSILON);
            let rate = taylor.rate().unwrap();
            assert!((rate - 1.0 - order as f64).abs() < tolerance, "{taylor:?}");
        }
    }
}

const REDUCTIONS: &[Energy<3>] = &[
    ("sum", |u| bend(&u).sum().powi_scalar(2)),
    ("sum spread", |u| {
        let s = bend(&u).sum().reshape([1, 1, 1]).exp() * 1e-2;
        weigh(u * s)
    }),
    ("mean", |u| bend(&u).mean().exp()),
    ("centred", |u| {
        let m = u.clone().mean().reshape([1, 1, 1]);
        weigh(bend(&u) - m)
    }),
    ("sum dim", |u| weigh(bend(&u).sum_dim(1))),
    ("sum of a single slice", |u| {
        weigh(bend(&u).sum_dim(1).sum_dim(1))
    }),
    ("mean dim", |u| weigh(bend(&u).mean_dim(2))),
    ("sum dims", |u| weigh(bend(&u).sum_dims(&[0, 2]))),
    ("mean dims", |u| weigh(bend(&u).mean_dims(&[0, 2]))),
    ("var", |u| weigh(bend(&u).var(1))),
    ("cumsum", |u| weigh(bend(&u).cumsum(1))),
    ("max dim", |u| weigh(bend(&u).max_dim(1))),
    ("min dim", |u| weigh(bend(&u).min_dim(2))),
    ("max", |u| weigh(bend(&u).max())),
    ("sort", |u| weigh(bend(&u).sort(1))),
    ("nothing in common", |u| (bend(&u) * 0.0).sum()),
];

#[test]
fn reductions() {
    for device in devices() {
        let u = separated(&device, [2, 3, 4], 11, 0.2, 0.8);
        for (name, energy) in REDUCTIONS {
            check(name, &u, energy);
        }
    }
}

/// Several rows for the single one of `u`.
fn rows(u: &Tensor<2>) -> Tensor<2> {
    constant(u, [5, 4], 6)
}

const BROADCASTS: &[Energy<2>] = &[
    ("add", |u| weigh(bend(&u) + rows(&u))),
    ("sub", |u| weigh(rows(&u) - bend(&u))),
    ("mul", |u| weigh(bend(&u) * rows(&u))),
    ("div", |u| weigh(rows(&u) / bend(&u))),
    ("outer product", |u| weigh(bend(&u) * u.transpose().exp())),
    ("expand", |u| weigh(bend(&u).expand([3, 4]) * 0.5)),
    ("remainder", |u| weigh(bend(&u).remainder(rows(&u)))),
    ("atan2", |u| weigh(bend(&u).atan2(rows(&u)))),
    ("add blocks in zeros", |u| {
        let many = (rows(&u).zeros_like()).slice_assign([1..2, 0..4], bend(&u));
        let block = bend(&u).slice([0..1, 0..2]);
        weigh(many + u.zeros_like().slice_assign([0..1, 0..2], block))
    }),
];

#[test]
fn broadcasting() {
    for device in devices() {
        let u = separated(&device, [1, 4], 21, 0.2, 0.8);
        for (name, energy) in BROADCASTS {
            check(name, &u, energy);
        }
    }
}

fn indices(like: &Tensor<3>, data: &[i64]) -> Tensor<1, Int> {
    Tensor::from_data(TensorData::new(data.to_vec(), [data.len()]), &like.device())
}

fn mask(like: &Tensor<3>) -> Tensor<3, Bool> {
    constant(like, like.dims(), 13).greater_elem(1.0)
}

const MOVES: &[Energy<3>] = &[
    ("reshape", |u| weigh(bend(&u).reshape([6, 4]))),
    ("flatten", |u| weigh(bend(&u).flatten::<1>(0, 2))),
    ("permute", |u| weigh(bend(&u).permute([2, 0, 1]))),
    ("swap dims", |u| weigh(bend(&u).swap_dims(0, 2))),
    ("flip", |u| weigh(bend(&u).flip([0, 2]) * u)),
    ("slice", |u| weigh(bend(&u).slice([0..2, 1..3, 0..3]))),
    ("slice with steps", |u| {
        weigh(bend(&u).slice(burn::tensor::s![.., .., 0..4;2]))
    }),
    ("slice assign", |u| {
        let value = bend(&u).slice([0..1, 0..2, 0..3]);
        weigh(u.exp().slice_assign([1..2, 1..3, 0..3], value))
    }),
    ("slice fill", |u| {
        weigh(bend(&u).slice_fill([0..1, 0..2, 0..3], 0.3))
    }),
    ("narrow", |u| weigh(bend(&u).narrow(2, 1, 2))),
    ("cat", |u| {
        weigh(Tensor::cat(vec![bend(&u), u.clone(), u.exp()], 1))
    }),
    ("cat with a constant", |u| {
        let c = constant(&u, [2, 1, 4], 4);
        weigh(Tensor::cat(vec![bend(&u), c], 1))
    }),
    ("stack", |u| {
        weigh(Tensor::stack::<4>(vec![bend(&u), u.exp()], 1))
    }),
    ("roll", |u| weigh(bend(&u).roll_dim(1, 2) * u)),
    ("repeat dim", |u| weigh(bend(&u).repeat_dim(1, 3))),
    ("repeat", |u| weigh(bend(&u).repeat(&[1, 2, 2]))),
    ("unsqueeze", |u| {
        weigh(bend(&u).unsqueeze::<4>().expand([3, 2, 3, 4]))
    }),
    ("select", |u| {
        weigh(bend(&u).select(1, indices(&u, &[2, 0, 2])))
    }),
    ("select assign", |u| {
        let i = indices(&u, &[2, 0]);
        let v = bend(&u).narrow(1, 0, 2);
        weigh(u.exp().select_assign(1, i, v, Add))
    }),
    ("gather", |u| {
        let i = indices(&u, &[0, 1, 2, 0, 1, 2, 1, 1]).reshape([2, 1, 4]);
        weigh(bend(&u).gather(1, i))
    }),
    ("scatter", |u| {
        let i = indices(&u, &[0, 1, 2, 0, 1, 2, 1, 1]).reshape([2, 1, 4]);
        let v = bend(&u).narrow(1, 1, 1);
        weigh(u.exp().scatter(1, i, v, Add))
    }),
    ("mask where", |u| {
        weigh(bend(&u).mask_where(mask(&u), u.exp()))
    }),
    ("mask where constant", |u| {
        let (m, c) = (mask(&u), constant(&u, u.dims(), 2));
        weigh(bend(&u).mask_where(m, c))
    }),
    ("mask fill", |u| weigh(bend(&u).mask_fill(mask(&u), 0.3))),
    ("mask from the input", |u| {
        let m = u.clone().lower_elem(0.5);
        weigh(bend(&u).mask_where(m, u.exp()))
    }),
    ("bool into float", |u| {
        mix(&u, u.clone().greater_elem(0.5).float().cast(DType::F64))
    }),
    ("pad", |u| {
        weigh(bend(&u).pad((1, 2, 0, 1), PadMode::Constant(0.5)))
    }),
    ("pad by reflection", |u| {
        weigh(bend(&u).pad((1, 2, 0, 1), PadMode::Reflect))
    }),
    ("unfold", |u| weigh(bend(&u).unfold::<4, _>(2, 2, 1))),
    ("diagonal part", |u| weigh(bend(&u).tril(0))),
];

#[test]
fn moving_data() {
    for device in devices() {
        let u = separated(&device, [2, 3, 4], 31, 0.2, 0.8);
        for (name, energy) in MOVES {
            check(name, &u, energy);
        }
    }
}

fn options<const N: usize>(stride: usize, padding: usize) -> ConvOptions<N> {
    ConvOptions::new([stride; N], [padding; N], [1; N], 1)
}

const PRODUCTS: &[Energy<2>] = &[
    ("matmul", |u| {
        weigh(bend(&u).matmul(constant(&u, [4, 5], 8)))
    }),
    ("matmul with itself", |u| {
        weigh(u.clone().matmul(u.transpose()))
    }),
    ("matmul of functions", |u| {
        weigh(bend(&u).matmul(u.transpose().exp()))
    }),
    ("linear", |u| {
        let w = u.clone().slice([0..3, 0..4]).transpose();
        let b = u.clone().slice([0..1, 0..3]).reshape([3]).exp();
        weigh(linear(bend(&u), w, Some(b)))
    }),
    ("batched matmul", |u| {
        let a = bend(&u).reshape([2, 2, 3]);
        let b = u.exp().reshape([2, 3, 2]);
        weigh(a.matmul(b))
    }),
    ("conv1d", |u| {
        let w = u.clone().slice([0..2, 0..2]).reshape([2, 1, 2]).exp();
        let b = u.clone().slice([0..1, 0..2]).reshape([2]);
        let x = bend(&u).reshape([1, 1, 12]);
        weigh(conv1d(x, w, Some(b), options(1, 1)))
    }),
    ("conv2d", |u| {
        let w = u.clone().slice([0..2, 0..2]).reshape([1, 1, 2, 2]).exp();
        let b = u.clone().slice([0..1, 0..1]).reshape([1]);
        let x = bend(&u).reshape([1, 1, 3, 4]);
        weigh(conv2d(x, w, Some(b), options(1, 1)))
    }),
    ("conv2d with stride", |u| {
        let w = constant(&u, [2, 2], 3).reshape([1, 1, 2, 2]);
        let x = bend(&u).reshape([1, 1, 3, 4]);
        weigh(conv2d(x, w, None, options(2, 0)))
    }),
    ("conv3d", |u| {
        let w = u.clone().slice([0..2, 0..2]).reshape([1, 1, 1, 2, 2]).exp();
        let b = u.clone().slice([0..1, 0..1]).reshape([1]);
        let x = bend(&u).reshape([1, 1, 2, 2, 3]);
        weigh(conv3d(x, w, Some(b), options(1, 0)))
    }),
    ("transposed conv2d", |u| {
        let w = u.clone().slice([0..2, 0..2]).reshape([1, 1, 2, 2]).exp();
        let o = ConvTransposeOptions::new([2, 2], [0, 0], [0, 0], [1, 1], 1);
        weigh(conv_transpose2d(bend(&u).reshape([1, 1, 3, 4]), w, None, o))
    }),
    ("average pooling", |u| {
        let x = bend(&u).reshape([1, 1, 3, 4]);
        weigh(avg_pool2d(x, AvgPoolOptions::new([2, 2])))
    }),
];

#[test]
fn products() {
    for device in devices() {
        let u = separated(&device, [3, 4], 41, 0.2, 0.8);
        for (name, energy) in PRODUCTS {
            check(name, &u, energy);
        }
    }
}

/// Without autodiff before it, a traced function contains other operations.
#[test]
fn jacobian_vector_products_of_traced_functions() {
    use burn_linearize::{Extensions, Graph};
    type Map = (&'static str, fn(Tensor<2>) -> Tensor<2>);
    let maps: &[Map] = &[
        ("softmax", |u| activation::softmax(u, 1)),
        ("log softmax", |u| activation::log_softmax(u, 1)),
        ("clamp", |u| (u * 2.0).clamp(0.5, 1.3)),
        ("log sigmoid", activation::log_sigmoid),
        ("gelu", activation::gelu),
        ("relu", |u| activation::relu(u - 0.5)),
        ("prod of two", |u| u.clone() * u.exp()),
        ("max", |u| u.clone().max_dim(1) * u),
        ("identity", |u| u),
        ("constant", |u| random(&u.device(), [3, 4], 2, 0.0, 1.0)),
    ];
    for device in devices() {
        let u: Tensor<2> = separated(&device, [3, 4], 51, 0.2, 0.8);
        let p: Tensor<2> = random(&device, [3, 4], 52, -1.0, 1.0);
        for (name, map) in maps {
            let graph =
                Graph::trace(&[(&u).into()], &[], |i| vec![map(i.variable(0)).into()]).unwrap();
            let extensions = Extensions::new();
            let program = graph
                .linearize(&extensions, None)
                .unwrap_or_else(|e| panic!("{name}: {e}"));
            let mut lin = program.on(&device, &extensions).unwrap();
            let at = lin.at(&[(&u).into()], &[]).unwrap();
            let value = vec(&map(u.clone()));
            for found in [&at.value, &at.gradients[0]] {
                assert!(distance(&found.to_vec(), &value) < 1e-13, "{name}");
            }
            let jvp = lin.apply(&[(&p).into()]).unwrap()[0].to_vec();
            let h = 1e-3;
            let at = |t: f64| map(u.clone() + p.clone() * t);
            // Fourth order.
            let near = at(h) - at(-h);
            let far = at(2.0 * h) - at(-2.0 * h);
            let expected = vec(&((near * 8.0 - far) / (12.0 * h)));
            let error = distance(&jvp, &expected);
            assert!(error < 1e-9, "{name}: {error:e}");
        }
    }
}

/// Burn's own gradient of a division by a number that has no short binary expansion is only good to
/// single precision; a traced one is not.
#[test]
fn division_by_a_number_keeps_double_precision() {
    use burn_linearize::{Graph, dual};
    for device in devices() {
        let u: Tensor<2> = random(&device, [3, 4], 61, 0.2, 0.8);
        let energy = |u: Tensor<2>| (u.exp() / 1.7).sum();
        let graph = Graph::gradient(&[(&u).into()], &[], |i| energy(i.variable(0))).unwrap();
        let mut lin = linearization(&graph, &device);
        let gradient = lin.at(&[(&u).into()], &[]).unwrap().gradients[0].to_vec();
        let exact: Vec<f64> = vec(&u).iter().map(|x| x.exp() / 1.7).collect();
        assert!(distance(&gradient, &exact) < 1e-14);
        // The reason: if this fails, Burn is fixed, and so can be the repair in `trace.rs`.
        let rounded = vec(&dual::gradient(&u, energy));
        assert!(distance(&rounded, &exact) > 1e-9);
    }
}

#[test]
fn tensor_helper_is_row_major() {
    for device in devices() {
        let t: Tensor<2> = tensor(&device, vec![1.0, 2.0, 3.0, 4.0], [2, 2]);
        assert_eq!(vec(&t.slice([0..1, 0..2])), [1.0, 2.0]);
    }
}

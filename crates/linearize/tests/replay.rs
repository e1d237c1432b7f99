//! Programs as objects: parameters, points, errors, memory, threads.

use crate::common::{self, devices, distance, linearization, random, vec};
use burn::tensor::{DType, Device, Distribution, Int, Tensor, TensorData};
use burn_linearize::{Error, Extensions, Graph, Linearization, Value};

/// `Σ c (u − f)² + u⁴`
fn graph(u: &Tensor<2>, f: &Tensor<2>, c: &Tensor<1>) -> Graph {
    Graph::gradient(&[u.into()], &[f.into(), c.into()], |i| {
        let u = i.variable::<2>(0);
        let misfit = u.clone() - i.parameter::<2>(0);
        (misfit.clone() * misfit).sum() * i.parameter::<1>(1) + u.powi_scalar(4).sum()
    })
    .unwrap()
}

/// A point, a parameter that could be a direction too, a weight, and the energy of these.
fn problem(device: &Device) -> (Tensor<2>, Tensor<2>, Tensor<1>, Linearization) {
    let u: Tensor<2> = random(device, [4, 4], 1, -1.0, 1.0);
    let f: Tensor<2> = random(device, [4, 4], 2, -1.0, 1.0);
    let c: Tensor<1> = random(device, [1], 3, 0.5, 1.0);
    let lin = linearization(&graph(&u, &f, &c), device);
    (u, f, c, lin)
}

#[test]
fn parameters_change_without_tracing_again() {
    for device in devices() {
        let (u, p, _, mut lin) = problem(&device);
        for seed in 5..9 {
            let f: Tensor<2> = random(&device, [4, 4], seed, -1.0, 1.0);
            let c: Tensor<1> = random(&device, [1], seed, 0.5, 1.0);
            let parameters = [Value::from(&f), Value::from(&c)];
            let evaluation = lin.at(&[(&u).into()], &parameters).unwrap();
            let (u, p, f, c) = (vec(&u), vec(&p), vec(&f), vec(&c)[0]);
            let gradient: Vec<f64> = (u.iter().zip(&f))
                .map(|(u, f)| 2.0 * c * (u - f) + 4.0 * u.powi(3))
                .collect();
            assert!(distance(&evaluation.gradients[0].to_vec(), &gradient) < 1e-14);
            let product: Vec<f64> = (u.iter().zip(&p))
                .map(|(u, p)| (2.0 * c + 12.0 * u * u) * p)
                .collect();
            let p: Tensor<2> = common::tensor(&device, p, [4, 4]);
            let found = lin.apply(&[p.into()]).unwrap()[0].to_vec();
            assert!(distance(&found, &product) < 1e-14);
        }
    }
}

/// The value program may run between `at` and `apply`, at another point.
#[test]
fn evaluating_elsewhere_leaves_the_point_alone() {
    for device in devices() {
        let (u, v, c, mut lin) = problem(&device);
        let parameters = [Value::from(&v), Value::from(&c)];
        lin.at(&[(&u).into()], &parameters).unwrap();
        let before = lin.apply(&[(&v).into()]).unwrap()[0].to_vec();
        lin.value(&[(&v).into()], &parameters).unwrap();
        let after = lin.apply(&[(&v).into()]).unwrap()[0].to_vec();
        assert_eq!(before, after);
    }
}

/// Results belong to the caller: later runs do not write into them, nor into directions.
#[test]
fn results_and_arguments_are_never_overwritten() {
    for device in devices() {
        let (u, p, c, mut lin) = problem(&device);
        let parameters = [Value::from(&p), Value::from(&c)];
        let first = lin.at(&[(&u).into()], &parameters).unwrap();
        let (value, gradient) = (first.value.to_vec(), first.gradients[0].to_vec());
        let product = lin.apply(&[(&p).into()]).unwrap().remove(0);
        let copy = product.to_vec();
        let (u_before, p_before) = (vec(&u), vec(&p));
        for _ in 0..3 {
            lin.apply(std::slice::from_ref(&product)).unwrap();
            lin.at(std::slice::from_ref(&product), &parameters).unwrap();
        }
        assert_eq!(first.value.to_vec(), value);
        assert_eq!(first.gradients[0].to_vec(), gradient);
        assert_eq!(product.to_vec(), copy);
        assert_eq!((vec(&u), vec(&p)), (u_before, p_before));
    }
}

#[test]
fn same_input_same_bytes() {
    for device in devices() {
        let u: Tensor<2> = random(&device, [16, 16], 1, -1.0, 1.0);
        let c: Tensor<1> = random(&device, [1], 3, 0.5, 1.0);
        let run = || {
            let mut lin = linearization(&graph(&u, &u, &c), &device);
            lin.at(&[(&u).into()], &[(&u).into(), (&c).into()]).unwrap();
            lin.apply(&[(&u).into()]).unwrap()[0].to_vec()
        };
        assert_eq!(run(), run());
        let program = || {
            let program = graph(&u, &u, &c).linearize(&Extensions::new(), None);
            format!("{:?}", program.unwrap())
        };
        assert_eq!(program(), program());
    }
}

#[test]
fn random_tensors_are_not_shared() {
    for device in devices() {
        let u: Tensor<2> = random(&device, [4, 4], 1, -1.0, 1.0);
        let graph = Graph::trace(&[(&u).into()], &[], |i| {
            let (shape, device) = ([4_usize; 2], i.device());
            let real = || Tensor::<2>::random(shape, Distribution::Default, &device);
            let wide = Distribution::Uniform(0.0, 1e6);
            let whole = || {
                Tensor::<2, Int>::random(shape, wide, &device)
                    .float()
                    .cast(DType::F64)
            };
            let noise = [real(), real(), whole(), whole()];
            noise
                .map(|noise| Value::from(i.variable::<2>(0) + noise))
                .into()
        });
        let mut lin = linearization(&graph.unwrap(), &device);
        let outputs = lin.at(&[(&u).into()], &[]).unwrap().gradients;
        for pair in outputs.chunks(2) {
            assert_ne!(pair[0].to_vec(), pair[1].to_vec());
        }
    }
}

/// A refused input, with a message that begins like this.
fn assert_is<T>(result: Result<T, Error>, message: &str) {
    let error = result.err().unwrap();
    assert!(matches!(error, Error::Input { .. }), "{error:?}");
    assert!(error.to_string().starts_with(message), "{error}");
}

#[test]
fn wrong_arguments_are_named() {
    for device in devices() {
        let (u, _, c, mut lin) = problem(&device);
        let (v, c) = (Value::from(&u), Value::from(&c));
        let early = lin.apply(std::slice::from_ref(&v));
        assert!(matches!(early, Err(Error::NotEvaluated)));
        let error = lin.at(std::slice::from_ref(&v), std::slice::from_ref(&v));
        assert_is(error, "parameters: expected 2, found 1");
        let wide: Value = random::<2>(&device, [4, 5], 1, 0.0, 1.0).into();
        let error = lin.at(std::slice::from_ref(&v), &[wide.clone(), c.clone()]);
        assert_is(
            error,
            "parameter 0: expected [4, 4] of F64, found [4, 5] of F64",
        );
        let single =
            Tensor::<2>::from_data(TensorData::from([[0.5_f32; 4]; 4]), (&device, DType::F32));
        let error = lin.value(&[single.into()], &[v.clone(), c.clone()]);
        assert_is(
            error,
            "variable 0: expected [4, 4] of F64, found [4, 4] of F32",
        );
        lin.at(std::slice::from_ref(&v), &[v.clone(), c.clone()])
            .unwrap();
        let error = lin.apply(&[wide]);
        assert_is(
            error,
            "direction 0: expected [4, 4] of F64, found [4, 5] of F64",
        );
        assert!(matches!(
            v.tensor::<3>(),
            Err(Error::Rank {
                expected: 3,
                found: 2
            })
        ));
        let tracked: Value = u.clone().autodiff().into();
        let error = lin.at(&[tracked], &[v, c]);
        assert_is(error, "variable 0: expected the program's backend, found ");
        // A failed call leaves no point behind.
        let later = lin.apply(&[(&u).into()]);
        assert!(matches!(later, Err(Error::NotEvaluated)));
    }
}

#[cfg(all(feature = "flex", feature = "ndarray"))]
#[test]
fn tensors_of_another_backend_are_refused() {
    let [flex, ndarray] = devices().try_into().unwrap();
    let u: Tensor<2> = random(&flex, [4, 4], 1, -1.0, 1.0);
    let graph = Graph::gradient(&[(&u).into()], &[], |i| i.variable::<2>(0).exp().sum()).unwrap();
    let mut lin = linearization(&graph, &ndarray);
    let error = lin.at(&[(&u).into()], &[]);
    assert_is(error, "variable 0: expected the program's backend, found ");
    // One graph serves all backends.
    let v: Tensor<2> = common::tensor(&ndarray, vec(&u), [4, 4]);
    let there = lin.at(&[v.into()], &[]).unwrap();
    let here = linearization(&graph, &flex).at(&[u.into()], &[]).unwrap();
    assert!(distance(&there.value.to_vec(), &here.value.to_vec()) < 1e-14);
}

#[test]
fn functions_that_cannot_be_traced_are_errors() {
    for device in devices() {
        let u: Tensor<2> = random(&device, [4, 4], 1, -1.0, 1.0);
        let vector = Graph::gradient(&[(&u).into()], &[], |i| i.variable::<2>(0).flatten(0, 1));
        assert!(matches!(vector, Err(Error::NotScalar { shape }) if shape == [16]));
        let elsewhere = Graph::gradient(&[(&u).into()], &[], |_| u.clone().sum());
        assert!(matches!(
            elsewhere,
            Err(Error::OutputDevice { index: 0, .. })
        ));
        assert!(matches!(
            Graph::trace(&[(&u).into()], &[], |_| vec![]),
            Err(Error::NoOutputs)
        ));
        // The device is free again after each failure.
        Graph::gradient(&[(&u).into()], &[], |i| i.variable::<2>(0).sum()).unwrap();
    }
}

#[test]
fn a_missing_rule_names_the_operation() {
    for device in devices() {
        let u: Tensor<2> = random(&device, [4, 4], 1, 0.5, 1.0);
        let trace = |product: fn(Tensor<2>) -> Tensor<1>| {
            Graph::trace(&[(&u).into()], &[(&u).into()], |i| {
                vec![(i.variable::<2>(0).sum() * product(i.parameter::<2>(0))).into()]
            })
        };
        let graph = Graph::trace(&[(&u).into()], &[], |i| {
            vec![i.variable::<2>(0).prod().into()]
        });
        let error = graph
            .unwrap()
            .linearize(&Extensions::new(), None)
            .unwrap_err();
        assert!(
            matches!(&error, Error::NoRule { operation } if operation == "Prod"),
            "{error}"
        );
        assert!(error.to_string().contains("`Prod`"));
        // Without a tangent through it, it passes.
        trace(Tensor::prod)
            .unwrap()
            .linearize(&Extensions::new(), None)
            .unwrap();
    }
}

#[test]
fn variables_without_influence_have_zero_gradients() {
    for device in devices() {
        let u: Tensor<2> = random(&device, [4, 4], 1, -1.0, 1.0);
        let v: Tensor<1> = random(&device, [3], 1, -1.0, 1.0);
        let inputs = [Value::from(&u), Value::from(&v)];
        let graph = Graph::gradient(&inputs, &[], |i| i.variable::<2>(0).exp().sum()).unwrap();
        let mut lin = linearization(&graph, &device);
        assert_eq!(
            lin.at(&inputs, &[]).unwrap().gradients[1].to_vec(),
            [0.0; 3]
        );
        assert_eq!(lin.apply(&inputs).unwrap()[1].to_vec(), [0.0; 3]);
        // An energy of parameters alone.
        let graph = Graph::gradient(&inputs, &inputs, |i| i.parameter::<1>(1).sum()).unwrap();
        let mut lin = linearization(&graph, &device);
        assert_eq!(
            lin.at(&inputs, &inputs).unwrap().gradients[0].to_vec(),
            [0.0; 16]
        );
        assert_eq!(lin.apply(&inputs).unwrap()[0].to_vec(), [0.0; 16]);
        // Two variables with one gradient.
        let twice = [Value::from(&u), Value::from(&u)];
        let graph = Graph::gradient(&twice, &[], |i| {
            (i.variable::<2>(0) + i.variable::<2>(1))
                .powi_scalar(2)
                .sum()
        })
        .unwrap();
        let mut lin = linearization(&graph, &device);
        let gradients = lin.at(&twice, &[]).unwrap().gradients;
        assert_eq!(gradients[0].to_vec(), gradients[1].to_vec());
        let products = lin.apply(&twice).unwrap();
        let expected: Vec<f64> = vec(&u).iter().map(|x| 4.0 * x).collect();
        assert!(distance(&products[0].to_vec(), &expected) < 1e-14);
        assert_eq!(products[0].to_vec(), products[1].to_vec());
    }
}

/// Precision follows the variables, and constants created by the function follow that.
#[test]
fn double_precision_stays_double() {
    for device in devices() {
        let u: Tensor<1> = common::tensor(&device, vec![1.0 / 3.0; 4], [4]);
        let graph = Graph::gradient(&[(&u).into()], &[], |i| {
            let u = i.variable::<1>(0);
            let shift = Tensor::<1>::from_floats([0.1, 0.2, 0.3, 0.4], &i.device());
            assert_eq!(shift.dtype(), DType::F64);
            (u.powi_scalar(2) * 0.1 + shift).sum()
        })
        .unwrap();
        let mut lin = linearization(&graph, &device);
        let evaluation = lin.at(&[(&u).into()], &[]).unwrap();
        assert_eq!(evaluation.value.dtype(), DType::F64);
        let expected = 1.0 + 4.0 * 0.1 / 9.0;
        assert!(
            (evaluation.value.to_vec()[0] - expected).abs() < 1e-7,
            "from_floats is single"
        );
        assert!(distance(&evaluation.gradients[0].to_vec(), &[0.2 / 3.0; 4]) < 1e-15);
        let single = Tensor::<1>::from_data(TensorData::from([0.25_f32; 4]), (&device, DType::F32));
        let graph =
            Graph::gradient(&[(&single).into()], &[], |i| i.variable::<1>(0).exp().sum()).unwrap();
        let mut lin = linearization(&graph, &device);
        let product = {
            lin.at(&[(&single).into()], &[]).unwrap();
            lin.apply(&[(&single).into()]).unwrap().remove(0)
        };
        assert_eq!(product.dtype(), DType::F32);
        let expected = [0.25 * 0.25_f64.exp(); 4];
        assert!(distance(&product.to_vec(), &expected) < 1e-6);
    }
}

/// Only products change their precision: values and gradients are the same bytes.
#[test]
fn products_in_single_precision() {
    for device in devices() {
        let u: Tensor<2> = random(&device, [16, 16], 1, -1.0, 1.0);
        let f: Tensor<2> = random(&device, [16, 16], 2, -1.0, 1.0);
        let c: Tensor<1> = random(&device, [1], 3, 0.5, 1.0);
        let p: Tensor<2> = random(&device, [16, 16], 4, -1.0, 1.0);
        let graph = graph(&u, &f, &c);
        let program = graph
            .linearize(&Extensions::new(), Some(DType::F32))
            .unwrap();
        let mut mixed = program.on(&device, &Extensions::new()).unwrap();
        let mut double = linearization(&graph, &device);
        for scale in [1.0, 0.5] {
            let point = [Value::from(u.clone() * scale)];
            let parameters = [Value::from(&f), Value::from(&c)];
            let (one, other) = (
                mixed.at(&point, &parameters).unwrap(),
                double.at(&point, &parameters).unwrap(),
            );
            assert_eq!(one.value.to_vec(), other.value.to_vec());
            assert_eq!(one.gradients[0].to_vec(), other.gradients[0].to_vec());
            let exact = double.apply(&[(&p).into()]).unwrap()[0].to_vec();
            let single = mixed.apply(&[(p.clone().cast(DType::F32)).into()]).unwrap();
            assert_eq!(single[0].dtype(), DType::F32);
            let error = distance(&single[0].to_vec(), &exact);
            assert!(error > 0.0 && error < 1e-5, "{error:e}");
            let error = mixed.apply(&[(&p).into()]);
            assert_is(
                error,
                "direction 0: expected [16, 16] of F32, found [16, 16] of F64",
            );
        }
    }
}

#[test]
fn linearizations_run_on_several_threads_at_once() {
    fn is_send<T: Send>() {}
    fn is_shared<T: Send + Sync>() {}
    is_send::<Linearization>();
    is_shared::<Graph>();
    is_shared::<burn_linearize::Program>();
    is_shared::<Extensions>();
    for device in devices() {
        let work = |seed: u64| {
            let u: Tensor<2> = random(&device, [8, 8], seed, -1.0, 1.0);
            let c: Tensor<1> = random(&device, [1], seed, 0.5, 1.0);
            let mut results = Vec::new();
            for _ in 0..4 {
                let mut lin = linearization(&graph(&u, &u, &c), &device);
                lin.at(&[(&u).into()], &[(&u).into(), (&c).into()]).unwrap();
                results.push(lin.apply(&[(&u).into()]).unwrap()[0].to_vec());
            }
            results
        };
        let alone: Vec<_> = (0..4).map(work).collect();
        let together: Vec<_> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..4).map(|seed| scope.spawn(move || work(seed))).collect();
            threads.into_iter().map(|t| t.join().unwrap()).collect()
        });
        assert_eq!(alone, together);
    }
}

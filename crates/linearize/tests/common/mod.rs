//! What the tests share: data, devices, and an oracle that knows nothing of this crate.
use burn::tensor::{DType, Device, Tensor, TensorData};
use burn_linearize::{Extensions, Graph, Linearization, Value, dual, taylor};

/// Every CPU backend compiled in.
pub fn devices() -> Vec<Device> {
    vec![
        #[cfg(feature = "flex")]
        Device::flex(),
        #[cfg(feature = "ndarray")]
        #[allow(
            deprecated,
            reason = "burn deprecates the backend, which we still offer"
        )]
        Device::ndarray(),
    ]
}

/// Reproducible numbers in `[low, high)`. Numbers of another generator may lie where an energy here has a kink.
pub fn numbers(count: usize, seed: u64, low: f64, high: f64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    (0..count)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            low + (high - low) * ((state >> 11) as f64 / (1_u64 << 53) as f64)
        })
        .collect()
}

pub fn tensor<const D: usize>(device: &Device, data: Vec<f64>, shape: [usize; D]) -> Tensor<D> {
    Tensor::from_data(TensorData::new(data, shape), (device, DType::F64))
}

pub fn random<const D: usize>(
    device: &Device,
    shape: [usize; D],
    seed: u64,
    low: f64,
    high: f64,
) -> Tensor<D> {
    tensor(
        device,
        numbers(shape.iter().product(), seed, low, high),
        shape,
    )
}

/// The same as [`random`], with all elements at least `(high − low)/count` apart, so that no two swap
/// places and none crosses the middle under small perturbations.
pub fn separated<const D: usize>(
    device: &Device,
    shape: [usize; D],
    seed: u64,
    low: f64,
    high: f64,
) -> Tensor<D> {
    let count: usize = shape.iter().product();
    let keys = numbers(count, seed, 0.0, 1.0);
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|i, j| keys[*i].total_cmp(&keys[*j]));
    let spacing = (high - low) / count as f64;
    let data = order.into_iter().map(|k| low + spacing * (k as f64 + 0.5));
    tensor(device, data.collect(), shape)
}

pub fn vec<const D: usize>(t: &Tensor<D>) -> Vec<f64> {
    assert_eq!(t.dtype(), DType::F64);
    t.clone().into_data().try_into_vec().unwrap()
}

pub fn value_vec(v: &Value) -> Vec<f64> {
    assert_eq!(v.dtype(), DType::F64);
    v.to_vec()
}

/// Largest difference relative to the largest element.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let scale = b.iter().fold(1e-3_f64, |m, x| m.max(x.abs()));
    // NaN if there is one.
    let differences = a.iter().zip(b).map(|(x, y)| (x - y).abs());
    differences.max_by(f64::total_cmp).unwrap_or(0.0) / scale
}

pub fn linearization(graph: &Graph, device: &Device) -> Linearization {
    let extensions = Extensions::new();
    let program = graph.linearize(&extensions, None).unwrap();
    program.on(device, &extensions).unwrap()
}

/// Central difference of order eight of Burn's own gradient: truncation and rounding errors are
/// about 1e-11 for functions and data of order one.
pub fn differences<const D: usize>(
    u: &Tensor<D>,
    p: &Tensor<D>,
    energy: impl Fn(Tensor<D>) -> Tensor<1>,
) -> Vec<f64> {
    const STENCIL: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    let h = 0.002;
    let mut sum = u.zeros_like();
    for (k, weight) in STENCIL.iter().enumerate() {
        let shift = p.clone() * (h * (k + 1) as f64);
        let forward = dual::gradient(&(u.clone() + shift.clone()), &energy);
        let backward = dual::gradient(&(u.clone() - shift), &energy);
        sum = sum + (forward - backward) * (weight / h);
    }
    vec(&sum)
}

/// Gradient and Hessian-vector products of `energy` at `u`, against Burn's autodiff, finite
/// differences, Taylor expansions, and symmetry.
pub fn check<const D: usize>(name: &str, u: &Tensor<D>, energy: impl Fn(Tensor<D>) -> Tensor<1>) {
    let device = u.device();
    let shape = u.dims();
    let graph = Graph::gradient(&[u.into()], &[], |inputs| energy(inputs.variable::<D>(0)))
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    let extensions = Extensions::new();
    let program = graph
        .linearize(&extensions, None)
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    let mut linearization = program.on(&device, &extensions).unwrap();

    let before = vec(u);
    let evaluation = linearization.at(&[u.into()], &[]).unwrap();
    let direct = vec(&energy(u.clone()));
    let error = distance(&value_vec(&evaluation.value), &direct);
    assert!(error < 1e-13, "{name}: value off by {error:e}");
    let alone = linearization.value(&[u.into()], &[]).unwrap();
    assert!(
        distance(&value_vec(&alone), &direct) < 1e-13,
        "{name}: value alone"
    );
    let reverse = vec(&dual::gradient(u, &energy));
    let error = distance(&value_vec(&evaluation.gradients[0]), &reverse);
    assert!(error < 1e-12, "{name}: gradient off by {error:e}");

    let p: Tensor<D> = random(&device, shape, 77, -1.0, 1.0);
    let q: Tensor<D> = random(&device, shape, 78, -1.0, 1.0);
    let hp = linearization.apply(&[(&p).into()]).unwrap().remove(0);
    let expected = differences(u, &p, &energy);
    let error = distance(&value_vec(&hp), &expected);
    assert!(error < 2e-9, "{name}: Hessian off by {error:e}");

    let hq = linearization.apply(&[(&q).into()]).unwrap().remove(0);
    let (left, right) = (Value::from(&q).dot(&hp), Value::from(&p).dot(&hq));
    let scale = value_vec(&hp).iter().map(|x| x.abs()).sum::<f64>() + 1e-12;
    assert!(
        (left - right).abs() < 1e-12 * scale,
        "{name}: not symmetric"
    );

    let steps = taylor::halvings(0.01, 14);
    let along = [&evaluation.gradients[0], &hp].map(|v| v.dot(&Value::from(&p)));
    let mut value = |t: f64| {
        let there = u.clone() + p.clone() * t;
        value_vec(&linearization.value(&[there.into()], &[]).unwrap())[0]
    };
    for (order, tolerance) in [(1, 0.15), (2, 0.3)] {
        let taylor = taylor::remainder(&mut value, &along[..order], &steps, f64::EPSILON);
        let rates = taylor.rates();
        assert!(taylor.is_consistent(tolerance), "{name}: {rates:?}");
    }
    assert_eq!(before, vec(u), "{name}: the input was overwritten");
}

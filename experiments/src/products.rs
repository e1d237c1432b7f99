//! What a Hessian-vector product costs through Burn: replayed from a trace, against the same product written by hand, and against
//! its Fourier transforms alone, in the same run.
//!
//! By hand, with `w = K*u`, `r = F(w) - u` and the caches `F'(w)`, `F''(w) r`:
//!
//! `H p = p + c (K^T (F' s + F'' r dw) - s)`, `dw = K*p`, `s = F' dw - p`,
//!
//! that is two convolutions and two loops on `Vec<f64>`.

use std::hint::black_box;
use std::sync::Arc;

use burn::tensor::{DType, Tensor};
use model::{MeanCurvatureOperator, Network};
use operators::{SpectralFilter, Transform, kernel_symbol, spectral_filter};
use rayon::prelude::*;
use rustfft::num_complex::Complex;
use solver::{Domain, DomainScales, MinimizingMovement, MovementGraph, Objective, Precision};

use crate::prelude::*;
use crate::timing;

/// `c = tau / tautilde^2` of a typical step: `tau = tautilde = 2^-14`.
const STIFFNESS: f64 = 16384.0;
/// Least length of a loop of its own in a thread.
const CHUNK: usize = 1 << 13;

/// The product by hand: caches at one point.
struct ByHand {
    plan: Arc<Transform<f64>>,
    symbol: Arc<Vec<Complex<f64>>>,
    /// `F'(w)`.
    slope: Vec<f64>,
    /// `F''(w) r`.
    bend: Vec<f64>,
}

impl ByHand {
    fn new(network: &Network, shape: &[usize], u: &[f64]) -> Result<Self> {
        let plan = Transform::of_shape(shape);
        let symbol = kernel_symbol(shape, network.kernel(), network.ratios().width);
        let table = network.table()?;
        let w = plan.filter(u, &symbol, false);
        let [value, slope, mut bend] = [0, 1, 2].map(|order| table.derivatives(&w, order));
        for ((bend, value), u) in bend.iter_mut().zip(value).zip(u) {
            *bend *= value - u;
        }
        Ok(Self {
            plan,
            symbol,
            slope,
            bend,
        })
    }

    fn product(&self, p: &[f64]) -> Vec<f64> {
        // After the first loop: `dw` holds `F' s + F'' r dw`, `s` the defect `F' dw - p`.
        let mut dw = self.plan.filter(p, &self.symbol, false);
        let mut s = vec![0.0; p.len()];
        let caches = self.slope.par_iter().zip(&self.bend);
        let loops = (dw.par_iter_mut().zip(&mut s)).zip(p.par_iter().zip(caches));
        (loops.with_min_len(CHUNK)).for_each(|((dw, s), (p, (slope, bend)))| {
            *s = slope * *dw - p;
            *dw = slope * *s + bend * *dw;
        });
        let mut result = self.plan.filter(&dw, &self.symbol, true);
        let loops = result.par_iter_mut().zip(s.par_iter().zip(p));
        (loops.with_min_len(CHUNK)).for_each(|(result, (s, p))| {
            *result = p + STIFFNESS * (*result - s);
        });
        result
    }
}

/// Measures everything at the phase field `u` with one direction on a CPU, in turns for at least so many seconds and eleven turns: medians in
/// milliseconds of the product through Burn in double and in single precision, `ms` and `single_ms`, of that `by_hand_ms`, of two pairs of
/// transforms, the least that a product needs, `floor_ms` and `floor_single_ms`, and of energy and gradient, `evaluate_ms`; the median `ratio`
/// of the product through Burn to that by hand in the same turn, and what the former costs `over_floor`, its transforms alone.
///
/// # Errors
/// If the products disagree; what the solver raises.
pub fn measure<const D: usize>(
    network: &Network,
    u: &Field<D>,
    device: &ComputeDevice,
    seconds: f64,
) -> Result<Numbers> {
    const LEAST: usize = 11;
    let grid = *u.grid();
    let direction = |(i, u): (usize, &f64)| (1.0 - u.powi(2)) + 0.1 * (0.37 * i as f64).sin();
    let on_host: Vec<f64> = u.values().iter().enumerate().map(direction).collect();
    let tensor = |x: &[f64]| -> Tensor<D> { device.tensor(x, grid.shape()) };
    let previous: Vec<f64> = u.values().iter().map(|u| 0.99 * u).collect();
    let operator = Arc::new(MeanCurvatureOperator::<D>::new(network, device)?);
    let (ratios, h) = (network.ratios(), grid.spacing());
    let scales = DomainScales {
        eps: ratios.eps_over_h * h,
        mcf_step: ratios.step_over_h2 * h * h,
        response: 1.0,
    };
    let domain = Domain::new(grid.into(), [-1.0, 1.0], scales, device);
    let energy = |precision| -> Result<_> {
        let mut energy = MinimizingMovement::traced(MovementGraph {
            step: operator.clone(),
            domain: &domain,
            terms: &[],
            unit: 1.0,
            products: precision,
            weighted: false,
        })?;
        energy.set(&tensor(&previous), STIFFNESS)?;
        energy.evaluate(&tensor(u.values()))?;
        Ok(energy)
    };
    let (mut double, mut single) = (energy(Precision::Device)?, energy(Precision::Single)?);
    let mut evaluated = energy(Precision::Device)?;
    let by_hand = ByHand::new(network, &grid.shape(), u.values())?;
    let width = network.ratios().width;
    let floor = SpectralFilter::from_kernel(&grid.shape(), network.kernel(), width, |k| k.re);
    let (p, u) = (tensor(&on_host), tensor(u.values()));
    let p_single = p.clone().cast(DType::F32);

    let hand = by_hand.product(&on_host);
    let burn = device.values(double.hessian_vector_product(&p)?)?;
    let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let defect: Vec<f64> = burn.iter().zip(&hand).map(|(a, b)| a - b).collect();
    let difference = norm(&defect) / norm(&hand);
    let message = format!("the products through Burn and by hand differ by {difference:.1e}");
    require(difference <= 1e-12, message)?;
    let [floor, floor_single] = [p.clone(), p_single.clone()].map(|p| {
        let floor = floor.clone();
        move || spectral_filter(spectral_filter(black_box(p.clone()), &floor), &floor)
    });
    let once = "it worked once";
    let burn = || double.hessian_vector_product(black_box(&p)).expect(once);
    let burn_single = || single.hessian_vector_product(&p_single).expect(once);
    let mut contenders = [
        ("ms", work(burn)),
        ("single_ms", work(burn_single)),
        ("by_hand_ms", work(|| by_hand.product(black_box(&on_host)))),
        ("floor_ms", work(floor)),
        ("floor_single_ms", work(floor_single)),
        ("evaluate_ms", work(|| evaluated.evaluate(&u).expect(once))),
    ];
    // In turns, so that whatever else the machine does burdens all alike.
    let (clock, mut rounds) = (Instant::now(), Vec::new());
    while rounds.len() < LEAST || clock.elapsed().as_secs_f64() < seconds {
        rounds.push(contenders.each_mut().map(|(_, work)| {
            let clock = Instant::now();
            work();
            1e3 * clock.elapsed().as_secs_f64()
        }));
    }
    let median = |of: &dyn Fn(&[f64; 6]) -> f64| timing::median(rounds.iter().map(of).collect());
    let names = contenders.iter().map(|(name, _)| *name).enumerate();
    let mut numbers: Numbers = names.map(|(k, name)| (name, median(&|ms| ms[k]))).collect();
    numbers.insert("ratio", median(&|ms| ms[0] / ms[2]));
    numbers.insert("over_floor", numbers["ms"] / numbers["floor_ms"]);
    Ok(numbers)
}

fn work<'a, R>(mut of: impl FnMut() -> R + 'a) -> Box<dyn FnMut() + 'a> {
    Box::new(move || drop(black_box(of())))
}

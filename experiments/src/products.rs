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
use std::time::{Duration, Instant};

use burn::tensor::{DType, Tensor};
use geometry::Field;
use model::{MeanCurvatureOperator, Network};
use operators::{ComputeDevice, SpectralFilter, Transform, kernel_symbol};
use rayon::prelude::*;
use rustfft::num_complex::Complex;
use solver::{MinimizingMovement, Objective, Precision};

use crate::Error;
use crate::timing::{Numbers, median, take_turns};

/// `c = tau / tautilde^2` of a typical step: `tau = tautilde = 2^-14`.
const STIFFNESS: f64 = 16384.0;
const PARALLEL_FROM: usize = 1 << 15;
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
    fn new(network: &Network, shape: &[usize], u: &[f64]) -> Result<Self, Error> {
        let plan = Transform::of_shape(shape);
        let symbol = kernel_symbol(shape, network.kernel(), network.ratios().width);
        let table = network.activation().table()?;
        let w = plan.filter(u, &symbol, false);
        let [value, slope, bend] = [0, 1, 2].map(|order| table.derivatives(&w, order));
        let residual = value.iter().zip(u).map(|(value, u)| value - u);
        let bend = bend
            .iter()
            .zip(residual)
            .map(|(bend, r)| bend * r)
            .collect();
        Ok(Self {
            plan,
            symbol,
            slope,
            bend,
        })
    }

    fn product(&self, p: &[f64]) -> Vec<f64> {
        let chunk = if p.len() >= PARALLEL_FROM {
            CHUNK
        } else {
            p.len()
        };
        // After the first loop: `dw` holds `F' s + F'' r dw`, `s` the defect `F' dw - p`.
        let mut dw = self.plan.filter(p, &self.symbol, false);
        let mut s = vec![0.0; p.len()];
        dw.par_chunks_mut(chunk)
            .zip(s.par_chunks_mut(chunk))
            .enumerate()
            .for_each(|(i, (dw, s))| {
                let part = i * chunk..i * chunk + dw.len();
                let caches = self.slope[part.clone()]
                    .iter()
                    .zip(&self.bend[part.clone()]);
                let data = dw.iter_mut().zip(s).zip(&p[part]);
                for (((dw, s), p), (slope, bend)) in data.zip(caches) {
                    *s = slope * *dw - p;
                    *dw = slope * *s + bend * *dw;
                }
            });
        let mut result = self.plan.filter(&dw, &self.symbol, true);
        result
            .par_chunks_mut(chunk)
            .enumerate()
            .for_each(|(i, result)| {
                let part = i * chunk..i * chunk + result.len();
                for ((result, s), p) in result.iter_mut().zip(&s[part.clone()]).zip(&p[part]) {
                    *result = p + STIFFNESS * (*result - s);
                }
            });
        result
    }
}

/// What takes turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// The product through Burn in double precision.
    Burn,
    /// The product through Burn in single precision.
    BurnSingle,
    /// The product by hand in double precision.
    ByHand,
    /// Two pairs of transforms, the least that a product needs, in double precision.
    Floor,
    /// Two pairs of transforms in single precision.
    FloorSingle,
    /// Energy and gradient.
    Evaluate,
}

/// All of it, with the names of the times.
const ALL: [(Work, &str); 6] = [
    (Work::Burn, "ms"),
    (Work::BurnSingle, "single_ms"),
    (Work::ByHand, "by_hand_ms"),
    (Work::Floor, "floor_ms"),
    (Work::FloorSingle, "floor_single_ms"),
    (Work::Evaluate, "evaluate_ms"),
];

/// All candidates at one point, with one direction.
pub struct Candidates<const D: usize> {
    double: MinimizingMovement<D>,
    single: MinimizingMovement<D>,
    by_hand: ByHand,
    floor: SpectralFilter,
    u: Tensor<D>,
    p: Tensor<D>,
    p_single: Tensor<D>,
    p_host: Vec<f64>,
}

impl<const D: usize> Candidates<D> {
    /// Everything at the phase field `u`, for a CPU device.
    ///
    /// # Errors
    /// [`Error::Options`] if the candidates disagree; what the solver raises.
    pub fn new(network: &Network, u: &Field<D>, device: &ComputeDevice) -> Result<Self, Error> {
        let grid = *u.grid();
        let p_host: Vec<f64> = (0..grid.len())
            .map(|i| (1.0 - u.values()[i].powi(2)) + 0.1 * (0.37 * i as f64).sin())
            .collect();
        let tensor = |x: &[f64]| -> Tensor<D> { device.tensor(x, grid.shape()) };
        let previous: Vec<f64> = u.values().iter().map(|u| 0.99 * u).collect();
        let operator = Arc::new(MeanCurvatureOperator::<D>::new(network, device)?);
        let energy = |precision| -> Result<_, Error> {
            let mut energy = MinimizingMovement::with_precision(
                operator.clone(),
                grid.cells(),
                precision,
                device,
            )?;
            energy.set(&tensor(&previous), STIFFNESS)?;
            energy.evaluate(&tensor(u.values()))?;
            Ok(energy)
        };
        let p = tensor(&p_host);
        let width = network.ratios().width;
        let mut candidates = Self {
            double: energy(Precision::Device)?,
            single: energy(Precision::Single)?,
            by_hand: ByHand::new(network, &grid.shape(), u.values())?,
            floor: SpectralFilter::from_kernel(&grid.shape(), network.kernel(), width, |k| k.re),
            u: tensor(u.values()),
            p_single: p.clone().cast(DType::F32),
            p,
            p_host,
        };
        let hand = candidates.by_hand.product(&candidates.p_host);
        let burn = candidates.double.hessian_vector_product(&candidates.p)?;
        let burn = device.values(burn)?;
        let norm = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>().sqrt();
        let difference =
            norm(&mut burn.iter().zip(&hand).map(|(a, b)| a - b)) / norm(&mut hand.iter().copied());
        if difference > 1e-12 {
            return Err(Error::Options(format!(
                "the products through Burn and by hand differ by {difference:.1e}: nothing to compare"
            )));
        }
        Ok(candidates)
    }

    /// Does a piece of work once.
    pub fn run(&mut self, work: Work) {
        let filtered = |p: &Tensor<D>| {
            let once = operators::spectral_filter(black_box(p.clone()), &self.floor);
            black_box(operators::spectral_filter(once, &self.floor));
        };
        match work {
            Work::Burn => {
                let product = self.double.hessian_vector_product(black_box(&self.p));
                black_box(product.expect("worked in the constructor"));
            }
            Work::BurnSingle => {
                let product = (self.single).hessian_vector_product(black_box(&self.p_single));
                black_box(product.expect("the same as in double precision"));
            }
            Work::ByHand => {
                black_box(self.by_hand.product(black_box(&self.p_host)));
            }
            Work::Floor => filtered(&self.p),
            Work::FloorSingle => filtered(&self.p_single),
            Work::Evaluate => {
                let evaluation = self.double.evaluate(black_box(&self.u));
                black_box(evaluation.expect("worked in the constructor"));
            }
        }
    }

    /// Measures all candidates in turns, for at least this time and eleven turns: medians in milliseconds, the median `ratio` of the
    /// product through Burn to that by hand in the same turn, and what the former costs `over_floor`, its transforms alone.
    pub fn measure(&mut self, budget: Duration) -> Result<Numbers, Error> {
        const LEAST: usize = 11;
        let clock = Instant::now();
        let mut contenders = ALL.map(|(work, _)| (work, Vec::new()));
        let goes_on =
            |(_, times): &(Work, Vec<f64>)| times.len() < LEAST || clock.elapsed() < budget;
        take_turns(&mut contenders, goes_on, |(work, times)| {
            let clock = Instant::now();
            self.run(*work);
            times.push(1e3 * clock.elapsed().as_secs_f64());
            Ok(())
        })?;
        let times = contenders.map(|(_, times)| times);
        let ratios = times[0].iter().zip(&times[2]).map(|(a, b)| a / b).collect();
        let names = ALL.map(|(_, name)| name).into_iter();
        let mut numbers: Numbers = names.zip(times.map(median)).collect();
        numbers.insert("ratio", median(ratios));
        numbers.insert("over_floor", numbers["ms"] / numbers["floor_ms"]);
        Ok(numbers)
    }
}

//! What it costs to go through Burn: Hessian-vector products of the minimizing-movement energy, replayed from a trace,
//! against the same product written by hand on `Vec<f64>`, in the same run.
//!
//! By hand, with `w = K*u`, `r = F(w) - u` and the caches `F'(w)`, `F''(w) r`:
//!
//! `H p = p + c (K^T (F' s + F'' r dw) - s)`, `dw = K*p`, `s = F' dw - p`,
//!
//! that is two convolutions and two loops. With `BENCH_TABLE=path` it writes a Markdown table of medians instead, for which the
//! candidates take turns so that both see the same machine.

use std::error::Error;
use std::fmt::Write as _;
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

use burn::tensor::Tensor;
use divan::Bencher;
use geometry::{Grid, phase_field, shapes::Ball};
use model::training::{SphereData, levenberg_marquardt::heat_kernel};
use model::{MeanCurvatureOperator, Network, Ratios, pretrained};
use operators::{ComputeDevice, DeviceKind, Transform, kernel_symbol};
use rayon::prelude::*;
use rustfft::num_complex::Complex;
use solver::{MinimizingMovement, Objective};

/// `c = tau / tautilde^2` of a typical step: `tau = tautilde = 2^-14`.
const STIFFNESS: f64 = 16384.0;
/// Ratios of the networks: `n_K = 17`, `eps = 2h`, `tautilde = h^2`.
const WIDTH: usize = 17;
const EPS_OVER_H: f64 = 2.0;
const PARALLEL_FROM: usize = 1 << 15;
const CHUNK: usize = 1 << 13;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// The operator of the 2D network, or its splitting-scheme relative in 3D: the cost does not depend on the weights.
fn network(dimension: usize) -> Outcome<Network> {
    let ratios = |dimension| Ratios {
        dimension,
        width: WIDTH,
        eps_over_h: EPS_OVER_H,
        step_over_h2: 1.0,
    };
    let flat = pretrained::find(ratios(2))?;
    if dimension == 2 {
        return Ok(flat);
    }
    let data = SphereData::new(ratios(dimension), 64)?;
    let activation = flat.activation().clone();
    Ok(Network::new(
        ratios(dimension),
        heat_kernel(&data),
        activation,
        flat.provenance().clone(),
    )?)
}

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
    fn new(network: &Network, shape: &[usize], u: &[f64]) -> Outcome<Self> {
        let plan = Transform::of_shape(shape);
        let symbol = kernel_symbol(shape, network.kernel(), WIDTH);
        let table = network.activation().table()?;
        let w = plan.filter(u, &symbol, false);
        let slope = w.iter().map(|&w| table.derivative(w, 1)).collect();
        let bend = w
            .iter()
            .zip(u)
            .map(|(&w, u)| table.derivative(w, 2) * (table.derivative(w, 0) - u))
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

/// Both candidates at one point, with one direction.
struct Candidates<const D: usize> {
    energy: MinimizingMovement<D>,
    by_hand: ByHand,
    u: Tensor<D>,
    p: Tensor<D>,
    p_host: Vec<f64>,
}

impl<const D: usize> Candidates<D> {
    fn new(cells: usize) -> Outcome<Self> {
        let device = ComputeDevice::open(DeviceKind::Flex)?;
        let network = network(D)?;
        let grid = Grid::<D>::centred(cells, 1.0)?;
        let eps = EPS_OVER_H * grid.spacing();
        let ball = |radius| phase_field(grid, &Ball::new([0.0; D], radius)?, eps);
        let (u, previous) = (ball(0.3)?, ball(0.3 - 0.2 * grid.spacing())?);
        let p_host: Vec<f64> = (0..grid.len())
            .map(|i| (1.0 - u.values()[i].powi(2)) + 0.1 * (0.37 * i as f64).sin())
            .collect();
        let operator = MeanCurvatureOperator::<D>::new(&network, &device)?;
        let mut energy =
            MinimizingMovement::new(std::sync::Arc::new(operator.clone()), cells, &device)?;
        energy.set(&device.tensor(previous.values(), grid.shape()), STIFFNESS)?;
        let mut candidates = Self {
            energy,
            by_hand: ByHand::new(&network, &grid.shape(), u.values())?,
            u: device.tensor(u.values(), grid.shape()),
            p: device.tensor(&p_host, grid.shape()),
            p_host,
        };
        candidates.energy.evaluate(&candidates.u)?;
        let burn = device.values(candidates.energy.hessian_vector_product(&candidates.p)?)?;
        let hand = candidates.by_hand.product(&candidates.p_host);
        let norm = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>().sqrt();
        let difference =
            norm(&mut burn.iter().zip(&hand).map(|(a, b)| a - b)) / norm(&mut hand.iter().copied());
        if difference > 1e-12 {
            return Err(
                format!("the candidates differ by {difference:.1e}: nothing to compare").into(),
            );
        }
        Ok(candidates)
    }

    fn burn(&mut self) {
        black_box(
            self.energy
                .hessian_vector_product(black_box(&self.p))
                .expect("worked in the constructor"),
        );
    }

    fn hand(&mut self) {
        black_box(self.by_hand.product(black_box(&self.p_host)));
    }

    fn evaluate(&mut self) {
        black_box(
            self.energy
                .evaluate(black_box(&self.u))
                .expect("worked in the constructor"),
        );
    }

    fn value(&mut self) {
        black_box(
            self.energy
                .value(black_box(&self.u))
                .expect("worked in the constructor"),
        );
    }

    /// One row of the table.
    fn row(&mut self, table: &mut String, name: &str) -> Outcome<()> {
        const BUDGET: Duration = Duration::from_secs(6);
        const LEAST: usize = 11;
        let parts: [fn(&mut Self); 4] = [Self::burn, Self::hand, Self::evaluate, Self::value];
        let mut times: [Vec<f64>; 4] = Default::default();
        let clock = Instant::now();
        while times[0].len() < LEAST || clock.elapsed() < BUDGET {
            for (part, times) in parts.iter().zip(&mut times) {
                let clock = Instant::now();
                part(self);
                times.push(clock.elapsed().as_secs_f64());
            }
        }
        let ratio = |a: &[f64]| median(a.iter().zip(&times[0]).map(|(a, burn)| a / burn).collect());
        let (overhead, evaluate, value) =
            (ratio(&times[1]).recip(), ratio(&times[2]), ratio(&times[3]));
        let [burn, hand, ..] = times.map(|times| 1e3 * median(times));
        writeln!(
            table,
            "| {name} | {burn:.2} | {hand:.2} | {overhead:.2} | {evaluate:.2} | {value:.2} |"
        )?;
        Ok(())
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

const CELLS: [usize; 3] = [256, 512, 1024];
const SOLID: usize = 64;

fn bench<const D: usize>(bencher: Bencher<'_, '_>, cells: usize, part: fn(&mut Candidates<D>)) {
    let mut candidates = Candidates::<D>::new(cells).expect("a device and a network");
    bencher.bench_local(|| part(&mut candidates));
}

/// The product through Burn.
#[divan::bench(args = CELLS)]
fn burn_2d(bencher: Bencher<'_, '_>, cells: usize) {
    bench::<2>(bencher, cells, Candidates::burn);
}

/// The product by hand.
#[divan::bench(args = CELLS)]
fn by_hand_2d(bencher: Bencher<'_, '_>, cells: usize) {
    bench::<2>(bencher, cells, Candidates::hand);
}

/// Energy and gradient.
#[divan::bench(args = CELLS)]
fn evaluate_2d(bencher: Bencher<'_, '_>, cells: usize) {
    bench::<2>(bencher, cells, Candidates::evaluate);
}

/// The product through Burn.
#[divan::bench(args = [SOLID])]
fn burn_3d(bencher: Bencher<'_, '_>, cells: usize) {
    bench::<3>(bencher, cells, Candidates::burn);
}

/// The product by hand.
#[divan::bench(args = [SOLID])]
fn by_hand_3d(bencher: Bencher<'_, '_>, cells: usize) {
    bench::<3>(bencher, cells, Candidates::hand);
}

fn table(path: &str) -> Outcome<()> {
    let mut table = format!(
        "Hessian-vector products in milliseconds (median, {} threads); `evaluate` (energy and gradient) and `value` \
         in units of one product.\n\n\
         | grid | Burn | by hand | ratio | evaluate | value |\n|---|---|---|---|---|---|\n",
        rayon::current_num_threads()
    );
    for cells in CELLS {
        Candidates::<2>::new(cells)?.row(&mut table, &format!("{cells}^2"))?;
    }
    Candidates::<3>::new(SOLID)?.row(&mut table, &format!("{SOLID}^3"))?;
    println!("{table}");
    std::fs::write(path, table)?;
    Ok(())
}

fn main() -> Outcome<()> {
    match std::env::var("BENCH_TABLE") {
        Ok(path) => table(&path),
        Err(_) => {
            divan::main();
            Ok(())
        }
    }
}

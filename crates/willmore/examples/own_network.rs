//! A network of one's own inside: residual layers of convolutions, trained by Burn's Adam on shrinking circles. What else a flow needs is measured.

use std::f64::consts::PI;
use std::sync::OnceLock;
use std::time::Instant;

use burn::module::{Module, Param};
use burn::optim::{AdamConfig, GradientsParams};
use burn::tensor::Tensor;
use willmore::prelude::*;

type Failure = Box<dyn std::error::Error>;

/// Cells along a side of the kernels.
const WIDTH: usize = 9;
/// Cells of the interface width `eps`.
const EPS_OVER_H: f64 = 2.0;
/// Steps of the training, their first and their last size.
const UPDATES: u32 = 600;
const RATES: [f64; 2] = [3e-3, 1e-4];

/// `v = u + A * u + C * tanh(B * u) - rest u`, with `rest` such that `v = u` in the pure phases. It is odd, so it treats both phases alike.
#[derive(Module, Debug)]
pub struct Residual {
    /// The kernels `A`, `B` and `C`.
    kernels: Vec<Param<Tensor<2>>>,
}

impl Residual {
    /// Before the training, a splitting of the Allen-Cahn equation: diffusion, and a reaction that sharpens the profile.
    fn new(device: &ComputeDevice) -> Self {
        let gaussian = |variance: f64, sum: f64, middle: f64| {
            let half = (WIDTH / 2) as f64;
            let at = |i: usize| (-((i % WIDTH) as f64 - half).powi(2) / (2.0 * variance)).exp();
            let mut values: Vec<f64> = (0..WIDTH * WIDTH).map(|i| at(i) * at(i / WIDTH)).collect();
            let total: f64 = values.iter().sum();
            values.iter_mut().for_each(|value| *value *= sum / total);
            values[WIDTH * WIDTH / 2] += middle;
            Param::from_tensor(device.tensor(&values, [WIDTH; 2]))
        };
        Self {
            kernels: vec![
                gaussian(2.0, 1.0, -1.0),
                gaussian(1.0, 1.5, 0.0),
                gaussian(0.5, 0.5, 0.0),
            ],
        }
    }

    /// The network on fields, or on batches of them.
    fn forward<const R: usize>(&self, u: Tensor<R>) -> Tensor<R> {
        let kernels: Vec<Tensor<2>> = self.kernels.iter().map(|k| symmetric(k.val())).collect();
        let [a, b, c] = [0, 1, 2].map(|i| kernels[i].clone().to_device(&u.device()));
        let [sum_a, sum_b, sum_c] = [&a, &b, &c].map(|kernel| kernel.clone().sum());
        let rest = sum_a + sum_c * sum_b.tanh();
        let hidden = circular_convolution(u.clone(), b, false).tanh();
        u.clone() + circular_convolution(u.clone(), a, false)
            + circular_convolution(hidden, c, false)
            - u * rest.reshape([1; R])
    }

    /// The mean square of its error.
    fn loss(&self, before: Tensor<3>, after: Tensor<3>) -> Tensor<1> {
        let error = self.forward(before) - after;
        (error.clone() * error).mean()
    }

    /// The trained network, and its loss over that of the identity map on other circles.
    fn train(device: &ComputeDevice) -> Result<(Self, f64), Failure> {
        let ratios = Ratios {
            dimension: 2,
            width: WIDTH,
            eps_over_h: EPS_OVER_H,
            step_over_h2: 0.25 * EPS_OVER_H * EPS_OVER_H,
        };
        let data = SphereData::new(ratios, 64)?;
        let radii: Vec<f64> = (0..30).map(|i| 0.1 + 0.01 * f64::from(i)).collect();
        let (mut network, mut adam) = (Self::new(device).train(), AdamConfig::new().with_epsilon(1e-10).init());
        for update in 0..UPDATES {
            let chosen = [0, 1, 2].map(|i| radii[(update as usize * 7 + 10 * i) % 30]);
            let (before, after) = data.pairs(&chosen, device);
            let gradients = network.loss(before, after).backward();
            let gradients = GradientsParams::from_grads(gradients, &network);
            let progress = f64::from(update) / f64::from(UPDATES);
            let rate = RATES[0] * (RATES[1] / RATES[0]).powf(progress);
            network = adam.step(rate, network, gradients);
        }
        let network = network.valid();
        let (before, after) = data.pairs(&[0.115, 0.205, 0.305], device);
        let motion = before.clone() - after.clone();
        let identity = device.scalar((motion.clone() * motion).mean())?;
        let loss = device.scalar(network.loss(before, after))?;
        println!("loss {loss:.2e}, of the identity map {identity:.2e}");
        Ok((network, loss / identity))
    }
}

/// The mean of a kernel over the symmetries of the grid.
fn symmetric(kernel: Tensor<2>) -> Tensor<2> {
    let kernel = kernel.clone() + kernel.flip([0]);
    let kernel = kernel.clone() + kernel.flip([1]);
    (kernel.clone() + kernel.transpose()) / 8.0
}

impl MeanCurvatureStep<2> for Residual {
    fn apply(&self, u: Tensor<2>) -> Tensor<2> {
        self.forward(u)
    }

    fn identity(&self) -> Identity {
        let values = |kernel: &Param<Tensor<2>>| kernel.val().into_data().iter().collect::<Vec<f64>>();
        let kernels: Vec<_> = self.kernels.iter().map(values).collect();
        Identity::new("residual network", json!({ "kernels": kernels }))
    }
}

/// The network and its loss over that of the identity map. It is trained once.
fn trained() -> &'static (Residual, f64) {
    static TRAINED: OnceLock<(Residual, f64)> = OnceLock::new();
    TRAINED.get_or_init(|| {
        let device = ComputeDevice::default_compiled().expect("a device");
        Residual::train(&device).expect("a training")
    })
}

/// A flow with the network inside.
pub fn flow() -> Result<Willmore<2>, Failure> {
    let flow = Willmore::on(Grid::per_unit(128, 1.0)?).eps_over_h(EPS_OVER_H);
    Ok(flow.operator(trained().0.clone()))
}

/// Runs the example; a test does, too.
pub fn main() -> Result<(), Failure> {
    let start = Instant::now();
    let (network, loss) = trained();
    println!("trained in {:.1} s", start.elapsed().as_secs_f64());
    let scales = flow()?.scales();
    let scales = StepScales::on(&Grid::<2>::per_unit(128, 1.0)?, scales.eps, scales.mcf_step);
    println!("{:#?}", network.calibrate(&scales, &ComputeDevice::default_compiled()?));
    println!("calibrated {:.1} s", start.elapsed().as_secs_f64());

    let mut flow = flow()?
        .until(Stop::Time(5e-4))
        .start(&Ball::new([0.0; 2], 0.2)?)?;
    let mut energies = Vec::new();
    while let Some(record) = flow.step()?.cloned() {
        energies.extend(record.willmore_energy());
        let radius = (zero_set_volume(&flow.current()) / PI).sqrt();
        let exact = exact::willmore_radius(0.2, record.time, 2);
        println!("t = {:.2e}: radius {radius:.5}, exact {exact:.5} energy {:?} {:.1}", record.time, record.willmore_energy(), start.elapsed().as_secs_f64());
    }
    assert!(*loss < 0.01);
    assert!(energies.windows(2).all(|pair| pair[1] < pair[0]));
    Ok(())
}

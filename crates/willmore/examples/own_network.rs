//! A network of one's own inside: two layers of convolutions beside a linear one, trained by Burn's Adam on shrinking circles. Its inverse in the pure phases
//! and its calibration are measured.

use std::f64::consts::PI;
use std::sync::Mutex;

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
const UPDATES: u32 = 1000;
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
            for value in &mut values {
                *value *= sum / total;
            }
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
        u.clone()
            + circular_convolution(u.clone(), a, false)
            + circular_convolution(hidden, c, false)
            - u * rest.reshape([1; R])
    }

    /// The mean square of its error on circles before and after a step.
    fn loss(&self, before: Tensor<3>, after: Tensor<3>) -> Tensor<1> {
        let error = self.forward(before) - after;
        (error.clone() * error).mean()
    }
}

/// Circles that shrink, on a grid of 64 cells. The network depends on lengths in cells only.
fn data() -> Result<SphereData, Failure> {
    let ratios = Ratios {
        dimension: 2,
        width: WIDTH,
        eps_over_h: EPS_OVER_H,
        step_over_h2: EPS_OVER_H.powi(2) / 4.0,
    };
    Ok(SphereData::new(ratios, 64)?)
}

/// A trained network. Nothing is random: on a processor, each training gives the same bytes.
fn train(device: &ComputeDevice) -> Result<Residual, Failure> {
    let data = data()?;
    let mut network = Residual::new(device).train();
    let mut adam = AdamConfig::new().with_epsilon(1e-10).init();
    for update in 0..UPDATES {
        let radii = [0.1, 0.2, 0.3].map(|r| r + 0.01 * f64::from(7 * update % 10));
        let (before, after) = data.pairs(&radii, device);
        let loss = network.loss(before, after);
        let gradients = GradientsParams::from_grads(loss.backward(), &network);
        let progress = f64::from(update) / f64::from(UPDATES);
        let rate = RATES[0] * (RATES[1] / RATES[0]).powf(progress);
        network = adam.step(rate, network, gradients);
    }
    Ok(network.valid())
}

/// The loss over that of the identity map, on circles that are not in the training.
fn relative_loss(network: &Residual, device: &ComputeDevice) -> Result<f64, Failure> {
    let (before, after) = data()?.pairs(&[0.115, 0.205, 0.305], device);
    let motion = after.clone() - before.clone();
    let identity = device.scalar((motion.clone() * motion).mean())?;
    Ok(device.scalar(network.loss(before, after))? / identity)
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
        let values =
            |kernel: &Param<Tensor<2>>| kernel.val().into_data().iter().collect::<Vec<f64>>();
        let kernels: Vec<_> = self.kernels.iter().map(values).collect();
        Identity::new("residual network", json!({ "kernels": kernels }))
    }
}

/// The trained network; a program trains it once.
fn trained(device: &ComputeDevice) -> Result<Residual, Failure> {
    static TRAINED: Mutex<Option<Residual>> = Mutex::new(None);
    let mut kept = TRAINED.lock().map_err(|_| "the training failed")?;
    if kept.is_none() {
        *kept = Some(train(device)?);
    }
    Ok(kept.clone().ok_or("no network")?)
}

/// A flow with the network inside.
///
/// # Errors
/// Those of the training and of the flow.
pub fn flow() -> Result<Willmore<2>, Failure> {
    let device = ComputeDevice::default_compiled()?;
    let flow = Willmore::on(Grid::per_unit(128, 1.0)?).eps_over_h(EPS_OVER_H);
    Ok(flow.operator(trained(&device)?).device(&device))
}

/// Runs the example; a test does, too.
///
/// # Errors
/// Those of the training and of the flow.
pub fn main() -> Result<(), Failure> {
    let device = ComputeDevice::default_compiled()?;
    let network = trained(&device)?;
    let start = relative_loss(&Residual::new(&device), &device)?;
    let loss = relative_loss(&network, &device)?;
    println!(
        "loss over that of the identity map: {start:.1e} before the training, {loss:.1e} after it"
    );
    assert!(loss < 0.02);

    let mut flow = flow()?
        .until(Stop::Time(5e-4))
        .start(&Ball::new([0.0; 2], 0.2)?)?;
    let mut energies = Vec::new();
    while let Some(record) = flow.step()? {
        let (time, energy) = (record.time, record.willmore_energy());
        energies.extend(energy);
        let radius = (zero_set_volume(&flow.current()) / PI).sqrt();
        let exact = exact::willmore_radius(0.2, time, 2);
        println!("t = {time:.2e}: radius {radius:.5}, exact {exact:.5}");
        // The radius grows by 0.026.
        assert!((radius - exact).abs() < 2e-4);
    }
    assert!(energies.windows(2).all(|pair| pair[1] < pair[0]));
    Ok(())
}

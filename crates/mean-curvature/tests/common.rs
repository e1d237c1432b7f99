//! Steps that the tests share.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::{Bricks, Nodes};
use mean_curvature::{Identity, MeanCurvatureStep, StepFailure};
use operators::{ComputeDevice, brick_convolution, circular_convolution};
use serde_json::json;

pub fn device() -> ComputeDevice {
    ComputeDevice::default_compiled().unwrap()
}

/// An explicit step of the Allen-Cahn equation on the grid of spacing 1: `v = u + t (Laplace u + 9/8 (u - u^3) / eps^2)`.
#[derive(Clone)]
pub struct Explicit {
    pub eps: f64,
    pub mcf_step: f64,
    /// Whether it can be put on other grids.
    pub moves: bool,
}

impl Explicit {
    pub fn reaction(&self) -> f64 {
        1.125 / (self.eps * self.eps)
    }

    /// The symbol of its derivative where `u` is 1 or -1.
    pub fn symbol(&self, angles: &[f64]) -> f64 {
        let laplacian: f64 = angles.iter().map(|k| 2.0 * (k.cos() - 1.0)).sum();
        1.0 + self.mcf_step * (laplacian - 2.0 * self.reaction())
    }
}

/// The values at the next nodes along an axis, periodically; with `back`, at those before.
fn shifted<const D: usize>(u: &Tensor<D>, axis: usize, back: bool) -> Tensor<D> {
    let n = u.dims()[axis];
    let at = if back { n - 1 } else { 1 };
    let parts = vec![
        u.clone().narrow(axis, at, n - at),
        u.clone().narrow(axis, 0, at),
    ];
    Tensor::cat(parts, axis)
}

impl<const D: usize> MeanCurvatureStep<D> for Explicit {
    fn apply(&self, u: Tensor<D>) -> Tensor<D> {
        let neighbours = (0..D).flat_map(|axis| [(axis, false), (axis, true)]);
        let sum = neighbours.map(|(axis, back)| shifted(&u, axis, back));
        let laplacian =
            sum.reduce(|a, b| a + b).expect("there are some") - u.clone() * (2 * D) as f64;
        let cube = u.clone() * u.clone() * u.clone();
        let reaction = (u.clone() - cube) * self.reaction();
        u + (laplacian + reaction) * self.mcf_step
    }

    fn identity(&self) -> Identity {
        let parameters = json!({ "eps": self.eps, "step": self.mcf_step });
        Identity::new("explicit Allen-Cahn", parameters)
    }

    fn on(&self, nodes: &Nodes<D>) -> Result<Arc<dyn MeanCurvatureStep<D>>, StepFailure> {
        if self.moves && nodes.bricks().is_none() {
            return Ok(Arc::new(self.clone()));
        }
        Err("it stays where it is".into())
    }
}

/// A Gaussian and a pointwise reaction, `v = s + r (s - s^3)` with `s = K * u`, on a grid or on bricks.
#[derive(Clone)]
pub struct Splitting<const D: usize> {
    pub taps: Vec<f64>,
    pub reaction: f64,
    place: Place<D>,
}

#[derive(Clone)]
#[expect(clippy::large_enum_variant, reason = "there are few")]
enum Place<const D: usize> {
    Grid(Tensor<D>),
    Bricks {
        taps: Tensor<1>,
        neighbours: Tensor<2>,
        outside: Tensor<D>,
    },
}

impl<const D: usize> Splitting<D> {
    /// With a kernel of this variance, in cells.
    pub fn new(variance: f64, reaction: f64) -> Self {
        let taps: Vec<f64> = (-8..=8)
            .map(|x| (-0.5 * f64::from(x * x) / variance).exp())
            .collect();
        let sum: f64 = taps.iter().sum();
        let taps: Vec<f64> = taps.iter().map(|tap| tap / sum).collect();
        let width = taps.len();
        let kernel: Vec<f64> = (0..width.pow(D as u32))
            .map(|i| {
                let along = (0..D).map(|axis| taps[i / width.pow(axis as u32) % width]);
                along.product()
            })
            .collect();
        let kernel = device().tensor(&kernel, [width; D]);
        let place = Place::Grid(kernel);
        Self {
            taps,
            reaction,
            place,
        }
    }

    /// The symbol of its derivative where `u` is 1 or -1.
    pub fn symbol(&self, angles: &[f64]) -> f64 {
        let along = |k: &f64| -> f64 {
            let places = self.taps.iter().zip(-8..=8);
            places.map(|(tap, x)| tap * (k * f64::from(x)).cos()).sum()
        };
        (1.0 - 2.0 * self.reaction) * angles.iter().map(along).product::<f64>()
    }

    fn on_bricks(&self, bricks: &Bricks<D>) -> Self {
        let (side, neighbours) = (bricks.side(), bricks.neighbours());
        let phase_values = [-1.0, 1.0];
        let outside =
            operators::convolution_of_outside::<D>(side, &neighbours, &self.taps, phase_values);
        let count = bricks.places().len();
        let place = Place::Bricks {
            taps: device().tensor(&self.taps, [self.taps.len()]),
            neighbours: device().tensor(&neighbours, [count, 2 * D]),
            outside: device().tensor(&outside, bricks.shape()),
        };
        Self {
            place,
            ..self.clone()
        }
    }
}

impl<const D: usize> MeanCurvatureStep<D> for Splitting<D> {
    fn apply(&self, u: Tensor<D>) -> Tensor<D> {
        let device = u.device();
        let smoothed = match &self.place {
            Place::Grid(kernel) => {
                circular_convolution(u, kernel.clone().to_device(&device), false)
            }
            Place::Bricks {
                taps,
                neighbours,
                outside,
            } => {
                let taps = taps.clone().to_device(&device);
                let neighbours = neighbours.clone().to_device(&device);
                let outside = outside.clone().to_device(&device);
                brick_convolution(u, taps, neighbours, false) + outside
            }
        };
        let cube = smoothed.clone() * smoothed.clone() * smoothed.clone();
        smoothed.clone() + (smoothed - cube) * self.reaction
    }

    fn identity(&self) -> Identity {
        Identity::new(
            "splitting",
            json!({ "taps": self.taps, "reaction": self.reaction }),
        )
    }

    fn brick_side(&self) -> Option<usize> {
        Some(8)
    }

    fn on(&self, nodes: &Nodes<D>) -> Result<Arc<dyn MeanCurvatureStep<D>>, StepFailure> {
        Ok(Arc::new(match nodes.bricks() {
            None => self.clone(),
            Some(bricks) => self.on_bricks(bricks),
        }))
    }
}

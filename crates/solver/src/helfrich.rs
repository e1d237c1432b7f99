//! Spontaneous curvature, tension and pressure: what the energy has besides bending.

use burn::tensor::Tensor;
use geometry::Grid;
use operators::{ComputeDevice, brick_convolution, circular_convolution, convolution_of_outside};
use serde::{Deserialize, Serialize};

use crate::active::Active;
use crate::{Error, FlowParams};

/// The second derivative by central differences of eighth order: weights of the node and of its neighbours.
const SECOND_DIFFERENCE: [f64; 5] = [
    -205.0 / 72.0,
    8.0 / 5.0,
    -1.0 / 5.0,
    8.0 / 315.0,
    -1.0 / 560.0,
];
/// Width of the kernel of the Laplacian.
const WIDTH: usize = 2 * SECOND_DIFFERENCE.len() - 1;
/// Part of a second difference in the two [products](DirichletForm) whose difference is the Laplacian on bricks.
const SMALL: f64 = 1.0 / 128.0;

/// The terms of the energy of Canham and Helfrich, `w = 1/2 int (kappa - c0)^2 + sigma A + p V`, with `kappa` the sum of the principal
/// curvatures, positive where the phase `u = 1` is convex (a ball of radius `R` has `(D - 1) / R`), `A` the perimeter, and `V` the volume of that phase.
///
/// All zero is the Willmore energy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Helfrich {
    /// `c0`, one over a length.
    pub spontaneous_curvature: f64,
    /// `sigma`, energy per length (2D) or area (3D); positive draws the interface together.
    pub tension: f64,
    /// `p`, energy per area (2D) or volume (3D); positive makes the inside smaller.
    pub pressure: f64,
}

impl Helfrich {
    /// Whether the energy is that of bending alone, without spontaneous curvature.
    pub fn is_willmore(&self) -> bool {
        *self == Self::default()
    }

    fn check(&self) -> Result<(), Error> {
        for (name, value) in [
            ("spontaneous curvature", self.spontaneous_curvature),
            ("tension", self.tension),
            ("pressure", self.pressure),
        ] {
            geometry::require(name, value, "finite", |_| true)?;
        }
        Ok(())
    }
}

/// The terms of [`Helfrich`] in phase fields, as the energy of a step has them.
///
/// With the factor `c` and the response `g` of the step to curvature ([`mean_curvature::Calibration`]), and `q' = 3/(4 eps) (1 - u^2)` for the slope of
/// the optimal profile, the residual becomes `V[u] - u + g tautilde c0 q'`, and
///
/// `A = int eps/2 |grad u|^2 + Psi(u)/(2 eps)`, `Psi(u) = 9/16 (1 - u^2)^2`,    `V = int (2 + 3 u - u^3)/4`.
///
/// On the optimal profile the derivatives of both by `u` are displacements, `kappa eps q'` and `eps q'`, so that they do not bend it; see
/// `docs/algorithm.md`.
#[derive(Clone, Debug)]
pub struct HelfrichTerms<const D: usize> {
    eps: f64,
    /// Factor of `1 - u^2` in the residual.
    shift: f64,
    /// Factors of the densities of `A` and `V`, relative to `1/2 (V[u] - u)^2`.
    tension: f64,
    pressure: f64,
    /// Kernel of the negative Laplacian, and what takes its place on active bricks.
    laplacian: Tensor<D>,
    on_bricks: Option<Box<DirichletForm<D>>>,
    /// Cells of the inside that are not stored.
    inside: f64,
}

/// The Dirichlet form `sum u (-Laplace u)` over the whole grid, from values on active bricks, with second differences `d` along the axes.
///
/// On bricks convolutions are products of the same taps along all axes. With those of `1 - s d` and of `1 + s d` the negative
/// Laplacian is `(P_- - P_+) / (2 s h^2)`, exactly in the plane, and in space up to `s^2 d_1 d_2 d_3`, which is a millionth of it.
#[derive(Clone, Debug)]
struct DirichletForm<const D: usize> {
    /// Those of both products.
    taps: [Tensor<1>; 2],
    neighbours: Tensor<2>,
    /// Twice what the values outside add to `P_- - P_+`: the form has as much from the nodes outside.
    outside: Tensor<D>,
    /// What the values outside alone add to the form, over its scale.
    rest: f64,
    /// `1 / (2 s h^2)`
    scale: f64,
}

impl<const D: usize> DirichletForm<D> {
    fn new(active: &Active<D>, device: &ComputeDevice) -> Self {
        let bricks = &active.bricks;
        let (side, neighbours) = (bricks.side(), bricks.neighbours());
        let taps = [-SMALL, SMALL].map(|part| {
            let mut taps = second_difference().map(|weight| part * weight);
            taps[WIDTH / 2] += 1.0;
            taps
        });
        let of_outside = |values: [f64; 2]| -> Vec<f64> {
            let [minus, plus] =
                taps.map(|taps| convolution_of_outside::<D>(side, &neighbours, &taps, values));
            minus.iter().zip(&plus).map(|(a, b)| a - b).collect()
        };
        let rests = active.rests();
        let outside: Vec<f64> = of_outside(rests).iter().map(|x| 2.0 * x).collect();
        // Near the edge of the bricks all nodes are in one phase, and second differences of constants vanish.
        let rest = -of_outside(rests.map(|rest| rest * rest))
            .iter()
            .sum::<f64>();
        Self {
            taps: taps.map(|taps| device.tensor(&taps, [WIDTH])),
            neighbours: device.tensor(&neighbours, [bricks.places().len(), 2 * D]),
            outside: device.tensor(&outside, bricks.shape()),
            rest,
            scale: 1.0 / (2.0 * SMALL * active.grid.spacing().powi(2)),
        }
    }

    fn of(&self, u: &Tensor<D>) -> Tensor<1> {
        let device = u.device();
        let product = |taps: &Tensor<1>| {
            let taps = taps.clone().to_device(&device);
            let neighbours = self.neighbours.clone().to_device(&device);
            brick_convolution(u.clone(), taps, neighbours, false)
        };
        let [minus, plus] = self.taps.each_ref().map(product);
        let sum = minus - plus + self.outside.clone().to_device(&device);
        ((u.clone() * sum).sum() + self.rest) * self.scale
    }
}

impl<const D: usize> HelfrichTerms<D> {
    /// The terms in a flow with these parameters, by a step with this response to curvature.
    ///
    /// # Errors
    /// [`Error::Geometry`] for values that are not finite.
    pub fn new(
        helfrich: Helfrich,
        response: f64,
        params: &FlowParams,
        grid: &Grid<D>,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        helfrich.check()?;
        let (eps, tautilde) = (params.eps, params.mcf_step);
        // A step weighs 1/2 |V[u] - u|^2 by tau m / (c tautilde^2), and the energy by tau m / eps.
        let unit = params.calibration.energy * tautilde * tautilde / eps;
        Ok(Self {
            eps,
            shift: 0.75 / eps * response * tautilde * helfrich.spontaneous_curvature,
            tension: unit * helfrich.tension,
            pressure: unit * helfrich.pressure,
            laplacian: device.tensor(&negative_laplacian::<D>(grid.spacing()), [WIDTH; D]),
            on_bricks: None,
            inside: 0.0,
        })
    }

    /// The same for phase fields on active bricks.
    pub(crate) fn on(&self, active: &Active<D>, device: &ComputeDevice) -> Self {
        let dirichlet = || Box::new(DirichletForm::new(active, device));
        Self {
            on_bricks: (self.tension != 0.0).then(dirichlet),
            inside: active.bricks.outside()[1] as f64,
            ..self.clone()
        }
    }

    /// The residual that vanishes at the spontaneous curvature.
    pub(crate) fn shifted(&self, residual: Tensor<D>, u: &Tensor<D>) -> Tensor<D> {
        if self.shift == 0.0 {
            return residual;
        }
        residual + well(u) * self.shift
    }

    /// `sum u (-Laplace u)` over the whole grid.
    fn dirichlet_form(&self, u: &Tensor<D>) -> Tensor<1> {
        if let Some(form) = &self.on_bricks {
            return form.of(u);
        }
        let kernel = self.laplacian.clone().to_device(&u.device());
        (u.clone() * circular_convolution(u.clone(), kernel, false)).sum()
    }

    /// `sigma A + p V`, if there is any of it.
    pub(crate) fn sizes(&self, u: &Tensor<D>) -> Option<Tensor<1>> {
        let tension = (self.tension != 0.0).then(|| {
            let well = well(u);
            let double_well = (well.clone() * well).sum() * (9.0 / 16.0);
            (self.dirichlet_form(u) * self.eps + double_well / self.eps) * (0.5 * self.tension)
        });
        let pressure = (self.pressure != 0.0).then(|| {
            let cube = u.clone() * u.clone() * u.clone();
            let volume = ((u.clone() * 3.0 - cube) + 2.0).sum() * 0.25 + self.inside;
            volume * self.pressure
        });
        let parts = tension.into_iter().chain(pressure);
        parts.reduce(|tension, pressure| tension + pressure)
    }
}

/// `1 - u^2`
fn well<const D: usize>(u: &Tensor<D>) -> Tensor<D> {
    (u.clone() * u.clone()).neg() + 1.0
}

/// The weights of a second difference from end to end.
fn second_difference() -> [f64; WIDTH] {
    std::array::from_fn(|offset| SECOND_DIFFERENCE[offset.abs_diff(WIDTH / 2)])
}

/// Row-major kernel of minus the sum of second differences along the axes.
fn negative_laplacian<const D: usize>(spacing: f64) -> Vec<f64> {
    let centre = WIDTH / 2;
    let mut kernel = vec![0.0; WIDTH.pow(D as u32)];
    let middle = centre * (0..D).map(|axis| WIDTH.pow(axis as u32)).sum::<usize>();
    for axis in 0..D {
        let stride = WIDTH.pow(axis as u32);
        for (offset, weight) in second_difference().into_iter().enumerate() {
            kernel[middle + offset * stride - centre * stride] -= weight / (spacing * spacing);
        }
    }
    kernel
}

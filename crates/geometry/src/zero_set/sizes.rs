//! Perimeter and volume as functions of the nodal values, with their derivatives.

use rayon::prelude::*;

use super::layer::Layer;
use crate::{Error, Field, vector};

/// Perimeter and volume of the zero set as functions of the nodal values, at one phase field: values, gradients, and products with
/// second derivatives.
///
/// Derivatives are those of the sums, by adjoint differences: `<gradient, p>` is the derivative along `p` to rounding.
pub struct Sizes<const D: usize> {
    layer: Layer<D>,
    normals: Vec<[f64; D]>,
    /// First and second derivative of the distance variable by the value at the node, at the places of the layer.
    slopes: Vec<[f64; 2]>,
}

impl<const D: usize> Sizes<D> {
    /// At the phase field `u` of interface width `eps`.
    ///
    /// # Errors
    /// `eps` must be finite and positive, and the values finite.
    pub fn of(u: &Field<D>, eps: f64) -> Result<Self, Error> {
        let layer = Layer::new(u, eps)?;
        let values = u.values();
        let slopes = layer.map(|place| {
            let u = values[layer.nodes[place] as usize];
            let well = 1.0 - u * u;
            // Beyond the clamp of the profile the distance variable is constant.
            if well <= f64::EPSILON {
                return [0.0; 2];
            }
            let slope = -4.0 / 3.0 * eps / well;
            [slope, slope * 2.0 * u / well]
        });
        Ok(Self {
            normals: layer.normals(),
            layer,
            slopes,
        })
    }

    /// Length (2D) or area (3D) of the zero set.
    pub fn perimeter(&self) -> f64 {
        self.layer.perimeter()
    }

    /// Area (2D) or volume (3D) of the inside.
    pub fn volume(&self) -> f64 {
        self.layer.volume()
    }

    /// Derivatives of the perimeter by the nodal values.
    pub fn perimeter_gradient(&self) -> Vec<f64> {
        self.gradient([1.0, 0.0])
    }

    /// Derivatives of the volume by the nodal values.
    pub fn volume_gradient(&self) -> Vec<f64> {
        self.gradient([0.0, 1.0])
    }

    /// The mean curvature `k` at the nodes with a weight, zero elsewhere.
    pub fn mean_curvature(&self) -> Vec<f64> {
        self.spread(self.layer.map(|place| match self.layer.near(place) {
            Some(_) => self.layer.divergence_at(place, &self.normals),
            None => 0.0,
        }))
    }

    /// The second derivative of `weights[0] perimeter + weights[1] volume`.
    pub fn second_derivative(self, weights: [f64; 2]) -> SizeHessian<D> {
        let first = self.by_distance(weights);
        SizeHessian {
            sizes: self,
            weights,
            first,
        }
    }

    fn gradient(&self, weights: [f64; 2]) -> Vec<f64> {
        let by_distance = self.by_distance(weights);
        let by_value = self
            .slopes
            .iter()
            .zip(by_distance)
            .map(|([slope, _], d)| slope * d);
        self.spread(by_value.collect())
    }

    /// Derivatives of `weights[0] perimeter + weights[1] volume` by the distance variable, at the places of the layer.
    fn by_distance(&self, [perimeter, volume]: [f64; 2]) -> Vec<f64> {
        let (layer, kernel, cell) = (
            &self.layer,
            self.layer.kernel,
            self.layer.grid.cell_volume(),
        );
        let fluxes = layer.map(|place| match layer.near(place) {
            Some(d) => vector::scale(self.normals[place], perimeter * kernel.value(d)),
            None => [0.0; D],
        });
        layer.map(|place| {
            let own = layer.near(place).map_or(0.0, |d| {
                let gradient = vector::norm(layer.gradients[place]);
                perimeter * kernel.slope(d) * gradient - volume * kernel.value(d)
            });
            cell * (own - layer.divergence_at(place, &fluxes))
        })
    }

    /// Values at the places of the layer as values at the nodes of the grid.
    fn spread(&self, values: Vec<f64>) -> Vec<f64> {
        let mut all = vec![0.0; self.layer.grid.len()];
        for (node, value) in self.layer.nodes.iter().zip(values) {
            all[*node as usize] = value;
        }
        all
    }
}

/// The second derivative of a combination of perimeter and volume at one phase field.
pub struct SizeHessian<const D: usize> {
    sizes: Sizes<D>,
    weights: [f64; 2],
    /// First derivatives by the distance variable.
    first: Vec<f64>,
}

impl<const D: usize> SizeHessian<D> {
    /// Calls `add` with each node that the product with `p` changes, and by how much.
    pub fn multiply(&self, p: impl Fn(usize) -> f64 + Sync, mut add: impl FnMut(usize, f64)) {
        let (layer, slopes) = (&self.sizes.layer, &self.sizes.slopes);
        let shift = layer.map(|place| slopes[place][0] * p(layer.nodes[place] as usize));
        let (own, fluxes): (Vec<f64>, Vec<[f64; D]>) = (0..layer.nodes.len())
            .into_par_iter()
            .map(|place| self.change(place, &shift))
            .unzip();
        let cell = layer.grid.cell_volume();
        let product = layer.map(|place| {
            let straight = cell * (own[place] - layer.divergence_at(place, &fluxes));
            let bent = self.first[place] * slopes[place][1] * p(layer.nodes[place] as usize);
            slopes[place][0] * straight + bent
        });
        for (node, value) in layer.nodes.iter().zip(product) {
            add(*node as usize, value);
        }
    }

    /// How the derivatives by distance and by gradient of distance at one node change with the distances.
    fn change(&self, place: usize, shift: &[f64]) -> (f64, [f64; D]) {
        let (layer, [perimeter, volume]) = (&self.sizes.layer, self.weights);
        let Some(d) = layer.near(place) else {
            return (0.0, [0.0; D]);
        };
        let (kernel, normal) = (layer.kernel, self.sizes.normals[place]);
        let gradient = vector::norm(layer.gradients[place]).max(f64::MIN_POSITIVE);
        let turn = layer.gradient_at(place, shift);
        let along = vector::dot(normal, turn);
        let tangential = vector::sub(turn, vector::scale(normal, along));
        let (value, slope) = (kernel.value(d), kernel.slope(d));
        let own = perimeter * (kernel.curvature(d) * gradient * shift[place] + slope * along)
            - volume * slope * shift[place];
        let flux = vector::add(
            vector::scale(normal, perimeter * slope * shift[place]),
            vector::scale(tangential, perimeter * value / gradient),
        );
        (own, flux)
    }
}

//! Perimeter and volume as functions of the nodal values, with their derivatives.

use rayon::prelude::*;

use super::layer::{Layer, NEIGHBOURS};
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

    /// The second derivative of `weights[0] perimeter + weights[1] volume`, without the nodes farther than six spacings from the zero set,
    /// which contribute less than a part in ten thousand.
    pub fn second_derivative(&self, weights: [f64; 2]) -> SizeHessian<D> {
        SizeHessian::new(self, weights)
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
        // Without the perimeter there is nothing to differentiate.
        let fluxes = (perimeter != 0.0).then(|| {
            layer.map(|place| match layer.near(place) {
                Some(d) => vector::scale(self.normals[place], perimeter * kernel.value(d)),
                None => [0.0; D],
            })
        });
        layer.map(|place| {
            let own = layer.near(place).map_or(0.0, |d| {
                let gradient = vector::norm(layer.gradients[place]);
                perimeter * kernel.slope(d) * gradient - volume * kernel.value(d)
            });
            let around = fluxes.as_ref();
            cell * (own - around.map_or(0.0, |fluxes| layer.divergence_at(place, fluxes)))
        })
    }

    /// Second derivatives at one node with a weight: by the distance variable, by that and the gradient along the normal, and by the
    /// tangential gradient.
    fn second_at(&self, place: usize, [perimeter, volume]: [f64; 2]) -> [f64; 3] {
        let (layer, kernel, cell) = (
            &self.layer,
            self.layer.kernel,
            self.layer.grid.cell_volume(),
        );
        let d = layer.near(place).unwrap_or(f64::INFINITY);
        let gradient = vector::norm(layer.gradients[place]).max(f64::MIN_POSITIVE);
        let own = perimeter * kernel.curvature(d) * gradient - volume * kernel.slope(d);
        [
            own,
            perimeter * kernel.slope(d),
            perimeter * kernel.value(d) / gradient,
        ]
        .map(|v| cell * v)
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
///
/// With the displacement `x = d' p` of the distance variable, the products are `d' (y - div F) + d'' p` times first derivatives, where
/// `y` and `F` are what the derivatives by `d` and by `grad d` change with `x` and `grad x`.
pub struct SizeHessian<const D: usize> {
    sites: Vec<Site<D>>,
    /// Weights of the neighbours in a difference.
    weights: [f64; NEIGHBOURS],
}

/// One node, and what it contributes.
struct Site<const D: usize> {
    node: u32,
    /// Its neighbours among the sites; beyond the last where there is none.
    around: [[u32; NEIGHBOURS]; D],
    /// The derivative of the distance variable by the value.
    slope: f64,
    /// The first derivative by the distance variable, times the second of that by the value.
    bent: f64,
    normal: [f64; D],
    /// Second derivatives by the distance variable, by that and the gradient along the normal, and by the tangential gradient.
    second: [f64; 3],
}

impl<const D: usize> SizeHessian<D> {
    fn new(sizes: &Sizes<D>, weights: [f64; 2]) -> Self {
        /// In spacings.
        const REACH: f64 = 6.0;
        let layer = &sizes.layer;
        let reach = REACH * layer.grid.spacing();
        let active: Vec<bool> =
            layer.map(|place| layer.near(place).is_some_and(|d| d.abs() < reach));
        let around = layer.map(|place| layer.places_around(place));
        let mut sites_of = vec![u32::MAX; active.len()];
        let mut places = Vec::new();
        for (place, around) in around.iter().enumerate() {
            let is_active = |place: u32| active.get(place as usize).copied().unwrap_or(false);
            if active[place] || around.as_flattened().iter().any(|other| is_active(*other)) {
                sites_of[place] = places.len() as u32;
                places.push(place);
            }
        }
        let first = sizes.by_distance(weights);
        let site_of = |place: u32| sites_of.get(place as usize).copied().unwrap_or(u32::MAX);
        let site = |&place: &usize| {
            let [slope, curvature] = sizes.slopes[place];
            Site {
                node: layer.nodes[place],
                around: around[place].map(|axis| axis.map(site_of)),
                slope,
                bent: first[place] * curvature,
                normal: sizes.normals[place],
                second: if active[place] {
                    sizes.second_at(place, weights)
                } else {
                    [0.0; 3]
                },
            }
        };
        Self {
            sites: places.iter().map(site).collect(),
            weights: layer.weights(),
        }
    }

    /// Calls `add` with each node that the product with `p` changes, and by how much.
    pub fn multiply(&self, p: impl Fn(usize) -> f64 + Sync, mut add: impl FnMut(usize, f64)) {
        let sites = &self.sites;
        let of = |site: &Site<D>| p(site.node as usize);
        let shifts: Vec<f64> = sites.iter().map(|site| site.slope * of(site)).collect();
        let changes = map(sites, |index, site| {
            site.change(shifts[index], &shifts, &self.weights)
        });
        let products = map(sites, |index, site| {
            let (own, _) = changes[index];
            let mut divergence = 0.0;
            for (axis, around) in site.around.iter().enumerate() {
                for (weight, other) in self.weights.iter().zip(around) {
                    if let Some((_, flux)) = changes.get(*other as usize) {
                        divergence += weight * flux[axis];
                    }
                }
            }
            site.slope * (own - divergence) + site.bent * of(site)
        });
        for (site, product) in sites.iter().zip(products) {
            add(site.node as usize, product);
        }
    }
}

impl<const D: usize> Site<D> {
    /// How the derivatives by the distance variable and by its gradient change with it.
    fn change(&self, shift: f64, shifts: &[f64], weights: &[f64; NEIGHBOURS]) -> (f64, [f64; D]) {
        let [own, mixed, tangential] = self.second;
        let turn: [f64; D] = self.around.map(|around| {
            let values = around
                .iter()
                .map(|other| shifts.get(*other as usize).unwrap_or(&0.0));
            values
                .zip(weights)
                .map(|(value, weight)| weight * value)
                .sum()
        });
        let along = vector::dot(self.normal, turn);
        let sideways = vector::sub(turn, vector::scale(self.normal, along));
        let flux = vector::add(
            vector::scale(self.normal, mixed * shift),
            vector::scale(sideways, tangential),
        );
        (own * shift + mixed * along, flux)
    }
}

/// A function of the sites, in parallel if there are many.
fn map<const D: usize, T: Send>(
    sites: &[Site<D>],
    f: impl Fn(usize, &Site<D>) -> T + Send + Sync,
) -> Vec<T> {
    const SHARE: usize = 1 << 13;
    let sites = sites.par_iter().with_min_len(SHARE).enumerate();
    sites.map(|(index, site)| f(index, site)).collect()
}

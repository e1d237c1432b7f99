//! Perimeter and volume as functions of the nodal values, with their derivatives.

use std::sync::OnceLock;

use super::layer::{Around, Layer, NEIGHBOURS, SHARE, Steepness};
use crate::{Error, PhaseField, parallel, vector};

/// Perimeter and volume of the zero set as functions of the nodal values, at one phase field: values, gradients, and products with
/// second derivatives.
///
/// Derivatives are those of the sums, by adjoint differences: `<gradient, p>` is the derivative along `p` to rounding.
pub struct Sizes<const D: usize> {
    layer: Layer<D>,
    /// First and second derivative of the distance variable by the value at the node, at the places of the layer.
    slopes: Vec<[f64; 2]>,
    /// Derivatives of perimeter and volume by the distance variable, at the places of the layer.
    by_distance: [OnceLock<Vec<f64>>; 2],
}

impl<const D: usize> Sizes<D> {
    /// At the phase field `u` of interface width `eps`.
    ///
    /// # Errors
    /// `eps` must be finite and positive, and the values finite.
    pub fn of(u: &impl PhaseField<D>, eps: f64) -> Result<Self, Error> {
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
            layer,
            slopes,
            by_distance: Default::default(),
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

    /// Derivatives of the perimeter by the stored values.
    pub fn perimeter_gradient(&self) -> Vec<f64> {
        self.gradient(self.perimeter_by_distance())
    }

    /// Derivatives of the volume by the stored values.
    pub fn volume_gradient(&self) -> Vec<f64> {
        self.gradient(self.volume_by_distance())
    }

    /// The mean curvature `kappa` at the nodes with a weight, zero elsewhere.
    pub fn mean_curvature(&self) -> Vec<f64> {
        let (around, normals) = (self.layer.around(), self.layer.normals());
        self.spread(self.layer.map(|place| match self.layer.near(place) {
            Some(_) => self.layer.divergence(&around[place], normals),
            None => 0.0,
        }))
    }

    /// The second derivative of `weights[0] perimeter + weights[1] volume`, without the nodes farther than six spacings from the zero set,
    /// which contribute less than a part in ten thousand.
    pub fn second_derivative(&self, weights: [f64; 2]) -> SizeHessian<D> {
        SizeHessian::new(self, weights)
    }

    fn gradient(&self, by_distance: &[f64]) -> Vec<f64> {
        let pairs = self.slopes.iter().zip(by_distance);
        self.spread(pairs.map(|([slope, _], d)| slope * d).collect())
    }

    fn perimeter_by_distance(&self) -> &[f64] {
        self.by_distance[0].get_or_init(|| {
            let (layer, kernel) = (&self.layer, self.layer.kernel);
            let (around, gradients, normals) = (layer.around(), layer.gradients(), layer.normals());
            let fluxes = layer.map(|place| match layer.near(place) {
                Some(d) => {
                    let steepness = Steepness::of(gradients[place]);
                    vector::scale(normals[place], kernel.value(d) * steepness.slope)
                }
                None => [0.0; D],
            });
            layer.map(|place| {
                let own = (layer.near(place)).map_or(0.0, |d| {
                    kernel.slope(d) * Steepness::of(gradients[place]).value
                });
                layer.grid.cell_volume() * (own - layer.divergence(&around[place], &fluxes))
            })
        })
    }

    fn volume_by_distance(&self) -> &[f64] {
        self.by_distance[1].get_or_init(|| {
            let layer = &self.layer;
            layer.map(|place| {
                let weight = |d| -layer.grid.cell_volume() * layer.kernel.value(d);
                layer.near(place).map_or(0.0, weight)
            })
        })
    }

    /// Derivatives of `weights[0] perimeter + weights[1] volume` by the distance variable, at the places of the layer.
    fn by_distance(&self, weights: [f64; 2]) -> Vec<f64> {
        let mut sums = vec![0.0; self.layer.nodes.len()];
        for (k, weight) in weights.into_iter().enumerate() {
            // What is not asked for is not computed.
            if weight != 0.0 {
                let values = match k {
                    0 => self.perimeter_by_distance(),
                    _ => self.volume_by_distance(),
                };
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum += weight * value;
                }
            }
        }
        sums
    }

    /// Second derivatives at one node with a weight: by the distance variable, by that and the gradient along the normal, by the
    /// tangential gradient, and by that along the normal.
    fn second_at(
        &self,
        (place, gradient): (usize, [f64; D]),
        [perimeter, volume]: [f64; 2],
    ) -> [f64; 4] {
        let (kernel, cell) = (self.layer.kernel, self.layer.grid.cell_volume());
        let d = self.layer.near(place).unwrap_or(f64::INFINITY);
        let steepness = Steepness::of(gradient);
        let own = perimeter * kernel.curvature(d) * steepness.value - volume * kernel.slope(d);
        [
            own,
            perimeter * kernel.slope(d) * steepness.slope,
            perimeter * kernel.value(d) * steepness.ratio,
            perimeter * kernel.value(d) * steepness.curvature,
        ]
        .map(|v| cell * v)
    }

    /// Values at the places of the layer as values at all stored nodes.
    fn spread(&self, values: Vec<f64>) -> Vec<f64> {
        let mut all = vec![0.0; self.layer.stored_len()];
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
    /// Weights of the neighbours in a difference; none for the volume alone, whose second derivative is diagonal.
    weights: Option<[f64; NEIGHBOURS]>,
}

/// The distance variable at a place of a layer, if that counts in second derivatives.
fn counts<const D: usize>(layer: &Layer<D>, place: usize) -> Option<f64> {
    /// In spacings.
    const REACH: f64 = 6.0;
    let near = layer.near(place);
    near.filter(|d| d.abs() < REACH * layer.grid.spacing())
}

/// One node, and what it contributes.
struct Site<const D: usize> {
    node: u32,
    /// Its neighbours among the sites; beyond the last where there is none.
    around: Around<D>,
    /// The derivative of the distance variable by the value.
    slope: f64,
    /// The first derivative by the distance variable, times the second of that by the value.
    bent: f64,
    normal: [f64; D],
    /// Second derivatives by the distance variable, by that and the gradient along the normal, by the tangential gradient, and by that along the normal.
    second: [f64; 4],
}

impl<const D: usize> SizeHessian<D> {
    fn new(sizes: &Sizes<D>, weights: [f64; 2]) -> Self {
        let layer = &sizes.layer;
        if weights[0] == 0.0 {
            return Self::of_volume(sizes, weights[1]);
        }
        let active: Vec<bool> = layer.map(|place| counts(layer, place).is_some());
        let around = layer.around();
        let mut sites_of = vec![u32::MAX; active.len()];
        let mut places = Vec::new();
        for (place, around) in around.iter().enumerate() {
            let is_active = |place: u32| active.get(place as usize).copied().unwrap_or(false);
            if active[place] || around.as_flattened().iter().any(|other| is_active(*other)) {
                sites_of[place] = places.len() as u32;
                places.push(place);
            }
        }
        let (first, gradients) = (sizes.by_distance(weights), layer.gradients());
        let normals = layer.normals();
        let site_of = |place: u32| sites_of.get(place as usize).copied().unwrap_or(u32::MAX);
        let site = |index: usize| {
            let place = places[index];
            let [slope, curvature] = sizes.slopes[place];
            Site {
                node: layer.nodes[place],
                around: around[place].map(|axis| axis.map(site_of)),
                slope,
                bent: first[place] * curvature,
                normal: normals[place],
                second: if active[place] {
                    sizes.second_at((place, gradients[place]), weights)
                } else {
                    [0.0; 4]
                },
            }
        };
        Self {
            sites: parallel::map(places.len(), SHARE, &site),
            weights: Some(layer.weights()),
        }
    }

    fn of_volume(sizes: &Sizes<D>, weight: f64) -> Self {
        let (layer, first) = (&sizes.layer, sizes.by_distance([0.0, weight]));
        let site = |place: usize| {
            let [slope, curvature] = sizes.slopes[place];
            layer.near(place).map(|_| Site {
                node: layer.nodes[place],
                around: [[u32::MAX; NEIGHBOURS]; D],
                slope,
                bent: first[place] * curvature,
                normal: [0.0; D],
                second: counts(layer, place).map_or([0.0; 4], |d| {
                    let own = -weight * layer.kernel.slope(d);
                    [layer.grid.cell_volume() * own, 0.0, 0.0, 0.0]
                }),
            })
        };
        Self {
            sites: parallel::filter_map(layer.nodes.len(), SHARE, &site),
            weights: None,
        }
    }

    /// Calls `add` with each node whose value the product with `p` changes, and by how much.
    pub fn multiply(&self, p: impl Fn(usize) -> f64 + Sync, mut add: impl FnMut(usize, f64)) {
        let sites = &self.sites;
        let of = |site: &Site<D>| p(site.node as usize);
        let products = match &self.weights {
            None => map(sites, |_, site| {
                (site.slope * site.second[0] * site.slope + site.bent) * of(site)
            }),
            Some(weights) => {
                let shifts: Vec<f64> = sites.iter().map(|site| site.slope * of(site)).collect();
                let changes = map(sites, |index, site| {
                    site.change(shifts[index], &shifts, weights)
                });
                map(sites, |index, site| {
                    let own = changes[index].0 - site.divergence(&changes, weights);
                    site.slope * own + site.bent * of(site)
                })
            }
        };
        for (site, product) in sites.iter().zip(products) {
            add(site.node as usize, product);
        }
    }
}

impl<const D: usize> Site<D> {
    /// How the derivatives by the distance variable and by its gradient change with it.
    fn change(&self, shift: f64, shifts: &[f64], weights: &[f64; NEIGHBOURS]) -> (f64, [f64; D]) {
        let [own, mixed, tangential, steep] = self.second;
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
            vector::scale(self.normal, mixed * shift + steep * along),
            vector::scale(sideways, tangential),
        );
        (own * shift + mixed * along, flux)
    }

    /// The divergence of what the derivatives by the gradient change.
    fn divergence(&self, changes: &[(f64, [f64; D])], weights: &[f64; NEIGHBOURS]) -> f64 {
        let mut sum = 0.0;
        for (axis, around) in self.around.iter().enumerate() {
            for (weight, other) in weights.iter().zip(around) {
                if let Some((_, flux)) = changes.get(*other as usize) {
                    sum += weight * flux[axis];
                }
            }
        }
        sum
    }
}

/// A function of the sites, in parallel if there are many.
fn map<const D: usize, T: Send>(
    sites: &[Site<D>],
    f: impl Fn(usize, &Site<D>) -> T + Send + Sync,
) -> Vec<T> {
    parallel::map(sites.len(), SHARE, &|index| f(index, &sites[index]))
}

//! Convolutions and differences of stored values, as Burn graphs.

use burn::tensor::{Device, Tensor};
use geometry::{Bricks, Error, require};
use operators::{
    brick_convolution, brick_pass, circular_convolution, convolution_of_outside, pass_of_outside,
};

use super::Domain;

/// The first derivative by central differences of eighth order: weights of the neighbours after the node, minus those of the ones before.
const FIRST_DIFFERENCE: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
/// The second derivative by central differences of eighth order: weights of the node and of its neighbours.
const SECOND_DIFFERENCE: [f64; 5] = [
    -205.0 / 72.0,
    8.0 / 5.0,
    -1.0 / 5.0,
    8.0 / 315.0,
    -1.0 / 560.0,
];
/// How many weights both have from end to end.
const WIDTH: usize = 2 * SECOND_DIFFERENCE.len() - 1;
/// Part of a second difference in the two [products](BrickLaplacian) whose difference is the Laplacian on bricks.
const SMALL: f64 = 1.0 / 128.0;

impl<const D: usize> Domain<D> {
    /// `y_a = sum t_b .. t_c u_{a+(b,..,c)}`: the same taps along every axis, periodic, with the centre in the middle.
    /// On bricks these are passes along one axis after the other, in which what is not stored takes part with its constants: the same up to how far the field
    /// is from constants where the bricks end.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] unless the taps are odd in number, and on bricks reach no further than the next brick.
    pub fn convolve(&self, u: &Tensor<D>, taps: &[f64]) -> Result<Tensor<D>, Error> {
        let odd = taps.len() % 2 == 1;
        require("taps", taps.len() as f64, "odd in number", |_| odd)?;
        let device = u.device();
        let Some(bricks) = self.nodes().bricks() else {
            let kernel = product_kernel::<D>(taps);
            let kernel = self.constant(&kernel, [taps.len(); D], &device);
            return Ok(circular_convolution(u.clone(), kernel, false));
        };
        let fits = taps.len() / 2 <= bricks.side();
        let fitting = "so few that they reach no further than the next brick";
        require("taps", taps.len() as f64, fitting, |_| fits)?;
        let neighbours = bricks.neighbours();
        let outside =
            convolution_of_outside::<D>(bricks.side(), &neighbours, taps, self.phase_values());
        let outside = self.constant(&outside, bricks.shape(), &device);
        Ok(self.product(u, taps, &neighbours) + outside)
    }

    /// The gradient by central differences of eighth order, `sum_k w_k (u_{i+k} - u_{i-k}) / h` along each axis, periodic.
    ///
    /// # Panics
    /// On grids of fewer than nine cells per side.
    pub fn gradient(&self, u: &Tensor<D>) -> [Tensor<D>; D] {
        std::array::from_fn(|axis| self.derivative(u, axis))
    }

    /// One component of the [gradient](Self::gradient).
    ///
    /// # Panics
    /// On grids of fewer than nine cells per side.
    pub fn derivative(&self, u: &Tensor<D>, axis: usize) -> Tensor<D> {
        let (device, taps) = (u.device(), first_difference(self.spacing()));
        let Some(bricks) = self.nodes().bricks() else {
            let kernel = kernel_along::<D>(&taps, axis);
            let kernel = self.constant(&kernel, [taps.len(); D], &device);
            return circular_convolution(u.clone(), kernel, false);
        };
        let neighbours = bricks.neighbours();
        let outside =
            pass_of_outside::<D>(bricks.side(), &neighbours, &taps, axis, self.phase_values());
        let outside = self.constant(&outside, bricks.shape(), &device);
        let (taps, neighbours) = self.tables(&taps, &neighbours, &device);
        brick_pass(u.clone(), taps, neighbours, axis) + outside
    }

    /// The Laplacian by central differences of eighth order, periodic. On bricks it is made of [convolutions](Self::convolve), in space up to
    /// `h^4/128^2` times the product of the second derivatives along the axes: a millionth of it where `u` is a phase field.
    pub fn laplacian(&self, u: &Tensor<D>) -> Tensor<D> {
        let Some(bricks) = self.nodes().bricks() else {
            return self.negative_laplacian(u).neg();
        };
        let device = u.device();
        let form = BrickLaplacian::new(self, bricks);
        let outside = self.constant(&form.outside(self.phase_values()), bricks.shape(), &device);
        (form.products(u) + outside) * -form.scale
    }

    /// `int |grad u|^2` over the whole grid, what is not stored included, as `-h^D sum u Laplace u`.
    pub fn dirichlet(&self, u: &Tensor<D>) -> Tensor<1> {
        let volume = self.cell_volume();
        let Some(bricks) = self.nodes().bricks() else {
            return (u.clone() * self.negative_laplacian(u)).sum() * volume;
        };
        let form = BrickLaplacian::new(self, bricks);
        // The form has as much from the nodes outside as from what they add inside.
        let outside = form.outside(self.phase_values());
        let outside: Vec<f64> = outside.iter().map(|x| 2.0 * x).collect();
        let outside = self.constant(&outside, bricks.shape(), &u.device());
        // Near the edge of the bricks all nodes are in one phase, and second differences of constants vanish.
        let squares = self.phase_values().map(|rest| rest * rest);
        let rest = -form.outside(squares).iter().sum::<f64>();
        let sum = form.products(u) + outside;
        ((u.clone() * sum).sum() + rest) * (form.scale * volume)
    }

    /// On the whole grid.
    fn negative_laplacian(&self, u: &Tensor<D>) -> Tensor<D> {
        let kernel = negative_laplacian::<D>(self.spacing());
        let kernel = self.constant(&kernel, [WIDTH; D], &u.device());
        circular_convolution(u.clone(), kernel, false)
    }

    /// On bricks with this table of neighbours, without what the constants outside add.
    fn product(&self, u: &Tensor<D>, taps: &[f64], neighbours: &[f64]) -> Tensor<D> {
        let (taps, neighbours) = self.tables(taps, neighbours, &u.device());
        brick_convolution(u.clone(), taps, neighbours, false)
    }

    /// Taps and table of neighbours as tensors.
    fn tables(&self, taps: &[f64], neighbours: &[f64], device: &Device) -> (Tensor<1>, Tensor<2>) {
        let rows = neighbours.len() / (2 * D);
        let taps = self.constant(taps, [taps.len()], device);
        (taps, self.constant(neighbours, [rows, 2 * D], device))
    }
}

/// The negative Laplacian on bricks, with second differences `d` along the axes.
///
/// On bricks convolutions are products of the same taps along all axes. With those of `1 - s d` and of `1 + s d` the negative
/// Laplacian is `(P_- - P_+) / (2 s h^2)`, exactly in the plane, and in space up to `s^2 d_1 d_2 d_3`, which is a millionth of it.
struct BrickLaplacian<'a, const D: usize> {
    domain: &'a Domain<D>,
    side: usize,
    neighbours: Vec<f64>,
    /// Those of both products.
    taps: [[f64; WIDTH]; 2],
    /// `1 / (2 s h^2)`
    scale: f64,
}

impl<'a, const D: usize> BrickLaplacian<'a, D> {
    fn new(domain: &'a Domain<D>, bricks: &Bricks<D>) -> Self {
        let taps = [-SMALL, SMALL].map(|part| {
            let mut taps = second_difference().map(|weight| part * weight);
            taps[WIDTH / 2] += 1.0;
            taps
        });
        Self {
            domain,
            side: bricks.side(),
            neighbours: bricks.neighbours(),
            taps,
            scale: 1.0 / (2.0 * SMALL * domain.spacing().powi(2)),
        }
    }

    /// `P_- u - P_+ u`, without what the constants outside add.
    fn products(&self, u: &Tensor<D>) -> Tensor<D> {
        let product = |taps: &[f64; WIDTH]| self.domain.product(u, taps, &self.neighbours);
        let [minus, plus] = self.taps.each_ref().map(product);
        minus - plus
    }

    /// What these constants outside add to that.
    fn outside(&self, phase_values: [f64; 2]) -> Vec<f64> {
        let [minus, plus] = (self.taps).map(|taps| {
            convolution_of_outside::<D>(self.side, &self.neighbours, &taps, phase_values)
        });
        minus.iter().zip(&plus).map(|(a, b)| a - b).collect()
    }
}

/// The weights of a first difference from end to end, for this distance of the nodes.
fn first_difference(spacing: f64) -> [f64; WIDTH] {
    let mut taps = [0.0; WIDTH];
    for (weight, k) in FIRST_DIFFERENCE.into_iter().zip(1..) {
        taps[WIDTH / 2 + k] = weight / spacing;
        taps[WIDTH / 2 - k] = -weight / spacing;
    }
    taps
}

/// The weights of a second difference from end to end.
fn second_difference() -> [f64; WIDTH] {
    std::array::from_fn(|offset| SECOND_DIFFERENCE[offset.abs_diff(WIDTH / 2)])
}

/// Row-major kernel of the product of the same taps along all axes.
fn product_kernel<const D: usize>(taps: &[f64]) -> Vec<f64> {
    (1..D).fold(taps.to_vec(), |kernel, _| {
        let rows = kernel
            .iter()
            .map(|weight| taps.iter().map(move |tap| weight * tap));
        rows.flatten().collect()
    })
}

/// Row-major kernel of these taps along one axis.
fn kernel_along<const D: usize>(taps: &[f64; WIDTH], axis: usize) -> Vec<f64> {
    let stride = |axis: usize| WIDTH.pow((D - 1 - axis) as u32);
    let first = (0..D).filter(|&other| other != axis);
    let first = first.map(|other| WIDTH / 2 * stride(other)).sum::<usize>();
    let mut kernel = vec![0.0; WIDTH.pow(D as u32)];
    for (offset, tap) in taps.iter().enumerate() {
        kernel[first + offset * stride(axis)] = *tap;
    }
    kernel
}

/// Row-major kernel of minus the sum of second differences along the axes.
fn negative_laplacian<const D: usize>(spacing: f64) -> Vec<f64> {
    let taps = second_difference().map(|weight| -weight / (spacing * spacing));
    let mut kernel = vec![0.0; WIDTH.pow(D as u32)];
    for axis in 0..D {
        for (sum, weight) in kernel.iter_mut().zip(kernel_along::<D>(&taps, axis)) {
            *sum += weight;
        }
    }
    kernel
}

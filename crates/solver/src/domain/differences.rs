//! Convolutions and differences of stored values, as Burn graphs.

use std::ops::Range;

use burn::tensor::{Int, Tensor, TensorData};
use geometry::{Bricks, Error, require};
use operators::{brick_convolution, circular_convolution, convolution_of_outside};

use super::Domain;

/// The first derivative by central differences of eighth order: weights of the neighbours after the node, minus those of the ones before.
const FIRST_DIFFERENCE: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
/// How far it reaches.
const REACH: usize = FIRST_DIFFERENCE.len();
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
    /// On grids of fewer than four cells per side.
    pub fn gradient(&self, u: &Tensor<D>) -> [Tensor<D>; D] {
        std::array::from_fn(|axis| self.derivative(u, axis))
    }

    /// One component of the [gradient](Self::gradient).
    ///
    /// # Panics
    /// On grids of fewer than four cells per side.
    pub fn derivative(&self, u: &Tensor<D>, axis: usize) -> Tensor<D> {
        let extended = self.extended(u, axis);
        let side = extended.dims()[2] - 2 * REACH;
        let from = |start: usize| extended.clone().slice_dim(2, start..start + side);
        let differences = FIRST_DIFFERENCE
            .iter()
            .zip(1..)
            .map(|(weight, k)| (from(REACH + k) - from(REACH - k)) * (weight / self.spacing()));
        let sum = differences.reduce(|sum, difference| sum + difference);
        sum.expect("there are weights").reshape(self.shape())
    }

    /// The values as cubes, the whole grid or one brick each, `[cubes, cells before the axis, cells along it, cells after it]`, with those that
    /// the first difference reaches beyond them.
    fn extended(&self, u: &Tensor<D>, axis: usize) -> Tensor<4> {
        let [count, side] = match self.nodes().bricks() {
            Some(bricks) => [bricks.places().len(), bricks.side()],
            None => [1, self.grid().cells()],
        };
        let [outer, inner] = [axis, D - 1 - axis].map(|axes| side.pow(axes as u32));
        let cubes = u.clone().reshape([count, outer, side, inner]);
        let beside = |layers: Range<usize>, column: usize| {
            let faces = cubes.clone().slice_dim(2, layers);
            match self.nodes().bricks() {
                Some(bricks) => self.of_neighbours(faces, bricks, column),
                None => faces,
            }
        };
        let before = beside(side - REACH..side, 2 * axis);
        let after = beside(0..REACH, 2 * axis + 1);
        Tensor::cat(vec![before, cubes, after], 2)
    }

    /// For every brick the faces of its neighbour in this column of the table of neighbours, constant where that is not active.
    fn of_neighbours(&self, faces: Tensor<4>, bricks: &Bricks<D>, column: usize) -> Tensor<4> {
        let [count, outer, layers, inner] = faces.dims();
        let device = faces.device();
        let phase_values = self.constant(&self.phase_values(), [2, 1, 1, 1], &device);
        let phase_values = phase_values.expand([2, outer, layers, inner]);
        let neighbours = bricks.neighbours();
        let numbers = neighbours.iter().skip(column).step_by(2 * D);
        // Behind the bricks lie the constants of the negative phase, -2 in the table, and of the positive one, -1.
        let place = |number: &f64| match *number as i64 {
            number if number < 0 => count as i64 + number + 2,
            number => number,
        };
        let places: Vec<i64> = numbers.map(place).collect();
        let places = Tensor::<1, Int>::from_data(TensorData::new(places, [count]), &device);
        Tensor::cat(vec![faces, phase_values], 0).select(0, places)
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
        let device = u.device();
        let taps = self.constant(taps, [taps.len()], &device);
        let rows = neighbours.len() / (2 * D);
        let neighbours = self.constant(neighbours, [rows, 2 * D], &device);
        brick_convolution(u.clone(), taps, neighbours, false)
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

//! Interpolation between the corners of lattice cells, and its arrays on a device.
#![cfg_attr(not(any(feature = "wgpu", feature = "cuda")), allow(dead_code))]

use burn::tensor::{DType, Device, Int, Tensor, TensorData};

/// Entries of a vector, its samples, as values between those at the `2^axes` corners of the cells of a lattice: a sample is its weight times the
/// multilinear interpolant at its place in the cell. Bit `k` of the number of a corner says that it is at the upper end along axis `k`.
pub struct Interpolation {
    /// Axes of the lattice.
    pub axes: usize,
    /// The samples of cell `i` are those from `starts[i]` to `starts[i + 1]`.
    pub starts: Vec<u32>,
    /// Which entry of the vector each sample is; none of them twice.
    pub entries: Vec<u32>,
    /// Of each sample its weight, and its place along each axis, from 0 to 1.
    pub places: Vec<f64>,
}

/// An [`Interpolation`] in the memory of a device, in the precision of its vectors.
pub(crate) struct DeviceInterpolation {
    pub(crate) axes: usize,
    pub(crate) starts: Tensor<1, Int>,
    pub(crate) entries: Tensor<1, Int>,
    /// The cell of each sample.
    pub(crate) cell: Tensor<1, Int>,
    pub(crate) places: Tensor<1>,
}

impl DeviceInterpolation {
    pub(crate) fn new(interpolation: Interpolation, device: &Device, dtype: DType) -> Self {
        let Interpolation {
            axes,
            starts,
            entries,
            places,
        } = interpolation;
        let cells = starts.windows(2).zip(0..).flat_map(|(ends, cell)| {
            let samples = ends[1] - ends[0];
            std::iter::repeat_n(cell, samples as usize)
        });
        let cells = cells.collect();
        let whole = |numbers: Vec<u32>| {
            let count = numbers.len();
            let numbers: Vec<i32> = bytemuck::allocation::cast_vec(numbers);
            Tensor::from_data(TensorData::new(numbers, [count]), (device, DType::I32))
        };
        let count = places.len();
        Self {
            axes,
            starts: whole(starts),
            entries: whole(entries),
            cell: whole(cells),
            places: Tensor::from_data(TensorData::new(places, [count]), (device, dtype)),
        }
    }

    pub(crate) fn cells(&self) -> usize {
        self.starts.dims()[0] - 1
    }

    pub(crate) fn samples(&self) -> usize {
        self.entries.dims()[0]
    }
}

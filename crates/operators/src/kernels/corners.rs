//! The transpose of an interpolation between the corners of lattice cells, and that interpolation.
#![expect(clippy::used_underscore_binding, reason = "the macro does it")]

use burn_backend::TensorMetadata;
use burn_backend::cubecl::dtype_to_storage_type;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use super::launch::{numbers, threads_for, values};
use crate::interpolation::DeviceInterpolation;

/// For each corner of a cell, this many threads sum its samples.
const PARTS: usize = 16;

/// `Z^T x` before cells that share a corner are added up: `[cells, parts, 2^axes]`, to be summed over the parts.
pub(crate) fn restricted(x: CubeTensor, interpolation: &DeviceInterpolation) -> CubeTensor {
    let (cells, corners) = (interpolation.cells(), 1 << interpolation.axes);
    let (client, dtype) = (x.client.clone(), x.dtype);
    let shape = [cells, PARTS, corners];
    let parts =
        empty_device_contiguous_dtype(client.clone(), x.device.clone(), shape.into(), dtype);
    let len = shape.iter().product();
    let (count, threads) = threads_for(&client, len);
    corner_sum::launch(
        &client,
        count,
        threads,
        values(x, dtype),
        numbers(&interpolation.starts),
        numbers(&interpolation.entries),
        numbers(&interpolation.places),
        values(parts.clone(), dtype),
        len,
        interpolation.axes,
        dtype_to_storage_type(dtype),
    );
    parts
}

#[cube(launch)]
fn corner_sum<E: Float>(
    x: &[E],
    starts: &[i32],
    entries: &[i32],
    places: &[E],
    sums: &mut [E],
    len: usize,
    #[comptime] axes: usize,
    #[define(E)] _dtype: ElemType,
) {
    if ABSOLUTE_POS >= len {
        terminate!();
    }
    let corners = comptime!(1usize << axes);
    let corner = ABSOLUTE_POS % corners;
    let part = (ABSOLUTE_POS / corners) % PARTS;
    let cell = ABSOLUTE_POS / (corners * PARTS);
    let end = usize::cast_from(starts[cell + 1]);
    let mut sample = usize::cast_from(starts[cell]) + part;
    let mut sum = E::new(0.0);
    while sample < end {
        let entry = usize::cast_from(entries[sample]);
        sum += x[entry] * hat::<E>(places, sample, corner, axes);
        sample += PARTS;
    }
    sums[ABSOLUTE_POS] = sum;
}

/// `z + Z v` for the values `v` at the corners of all cells, in the memory of `z` if nobody else holds it.
pub(crate) fn prolonged(
    z: CubeTensor,
    at_corners: CubeTensor,
    interpolation: &DeviceInterpolation,
) -> CubeTensor {
    let z = into_contiguous(if z.can_mut() { z } else { z.copy() });
    let (samples, dtype) = (interpolation.samples(), z.dtype());
    let (count, threads) = threads_for(&z.client, samples);
    add_interpolant::launch(
        &z.client,
        count,
        threads,
        values(z.clone(), dtype),
        values(at_corners, dtype),
        numbers(&interpolation.cell),
        numbers(&interpolation.entries),
        numbers(&interpolation.places),
        samples,
        interpolation.axes,
        dtype_to_storage_type(dtype),
    );
    z
}

#[cube(launch)]
fn add_interpolant<E: Float>(
    z: &mut [E],
    values: &[E],
    cells: &[i32],
    entries: &[i32],
    places: &[E],
    len: usize,
    #[comptime] axes: usize,
    #[define(E)] _dtype: ElemType,
) {
    let sample = ABSOLUTE_POS;
    if sample >= len {
        terminate!();
    }
    let corners = comptime!(1usize << axes);
    let first = usize::cast_from(cells[sample]) * corners;
    let mut sum = E::new(0.0);
    #[unroll]
    for corner in 0..corners {
        sum += values[first + corner] * hat::<E>(places, sample, corner, axes);
    }
    z[usize::cast_from(entries[sample])] += sum;
}

/// The weight of a sample times the hat function of a corner of its cell.
#[cube]
fn hat<E: Float>(places: &[E], sample: usize, corner: usize, #[comptime] axes: usize) -> E {
    let first = sample * (axes + 1);
    let mut product = places[first];
    #[unroll]
    for axis in 0..axes {
        let place = places[first + 1 + axis];
        let upper = (corner >> axis) % 2 == 1;
        product *= select(upper, place, E::new(1.0) - place);
    }
    product
}

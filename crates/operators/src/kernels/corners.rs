//! Interpolation between the corners of lattice cells, and its transpose.
#![expect(clippy::used_underscore_binding, reason = "the macro does it")]

use burn_backend::Shape;
use burn_backend::cubecl::dtype_to_storage_type;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use super::launch::{buffer, launch, primitive};
use crate::interpolation::OnDevice;

/// Samples of a cell are summed in so many parts.
const PARTS: usize = 16;

/// `Z^T x` before cells that share a corner are added up: `[cells, 2^axes]`.
pub(crate) fn corner_sums(x: CubeTensor, interpolation: &OnDevice) -> CubeTensor {
    let x = into_contiguous(x);
    let (cells, corners) = (interpolation.starts.dims()[0] - 1, 1 << interpolation.axes);
    let (client, device, dtype) = (x.client.clone(), x.device.clone(), x.dtype);
    let empty =
        |shape: Shape| empty_device_contiguous_dtype(client.clone(), device.clone(), shape, dtype);
    let parts = empty([cells, PARTS, corners].into());
    let sums = empty([cells, corners].into());
    let element = dtype_to_storage_type(dtype);
    let (count, threads) = launch(&parts);
    corner_sum::launch(
        &client,
        count,
        threads,
        x.into_buffer_arg(),
        buffer(&interpolation.starts),
        buffer(&interpolation.entries),
        buffer(&interpolation.places),
        parts.clone().into_buffer_arg(),
        cells * PARTS * corners,
        interpolation.axes,
        element,
    );
    let (count, threads) = launch(&sums);
    sum_of_parts::launch(
        &client,
        count,
        threads,
        parts.into_buffer_arg(),
        sums.clone().into_buffer_arg(),
        cells * corners,
        corners,
        element,
    );
    sums
}

#[cube(launch)]
fn sum_of_parts<E: Float>(
    parts: &[E],
    sums: &mut [E],
    len: usize,
    #[comptime] corners: usize,
    #[define(E)] _dtype: ElemType,
) {
    let place = ABSOLUTE_POS;
    if place >= len {
        terminate!();
    }
    let first = (place / corners) * PARTS * corners + place % corners;
    let mut sum = E::new(0.0);
    for part in 0..PARTS {
        sum += parts[first + part * corners];
    }
    sums[place] = sum;
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

/// `z + Z v` for values at the corners of all cells.
pub(crate) fn add_interpolated(
    z: CubeTensor,
    values: CubeTensor,
    interpolation: &OnDevice,
) -> CubeTensor {
    let z = into_contiguous(if z.can_mut() { z } else { z.copy() });
    let (count, threads) = launch(&primitive(&interpolation.entries));
    let dtype = dtype_to_storage_type(z.dtype);
    add_interpolant::launch(
        &z.client,
        count,
        threads,
        z.clone().into_buffer_arg(),
        values.into_buffer_arg(),
        buffer(&interpolation.cells),
        buffer(&interpolation.entries),
        buffer(&interpolation.places),
        interpolation.entries.dims()[0],
        interpolation.axes,
        dtype,
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

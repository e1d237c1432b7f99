//! Tabulated functions.
#![expect(clippy::used_underscore_binding, reason = "the macro does it")]

use burn_backend::TensorMetadata;
use burn_backend::cubecl::dtype_to_storage_type;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use super::launch::{like, threads_for, values};
use crate::table::{COEFFICIENTS, TableRange, factor};

/// See [`crate::tabulated`].
pub(crate) fn tabulated(
    w: CubeTensor,
    table: CubeTensor,
    range: TableRange,
    order: usize,
) -> CubeTensor {
    let result = like(&w);
    let (client, dtype, len) = (w.client.clone(), w.dtype, w.shape().num_elements());
    let element = dtype_to_storage_type(dtype);
    let (count, threads) = threads_for(&client, len);
    table_value::launch(
        &client,
        count,
        threads,
        values(w, dtype),
        values(table, dtype),
        values(result.clone(), dtype),
        len,
        InputScalar::new(range.low, element),
        InputScalar::new(range.width(), element),
        range.cells,
        order,
        element,
    );
    result
}

/// The `order`-th derivative of a [table](crate::HermiteTable) at every value, beyond its ends that of the Taylor polynomial of degree 2.
#[cube(launch)]
fn table_value<E: Float>(
    w: &[E],
    table: &[E],
    result: &mut [E],
    len: usize,
    low: InputScalar,
    width: InputScalar,
    cells: usize,
    #[comptime] order: usize,
    #[define(E)] _dtype: ElemType,
) {
    let place = ABSOLUTE_POS;
    if place >= len {
        terminate!();
    }
    let width = width.get::<E>();
    let s = (w[place] - low.get::<E>()) / width;
    let inside = clamp(s, E::new(0.0), E::cast_from(cells));
    let cell = clamp_max(usize::cast_from(inside), cells - 1);
    let t = inside - E::cast_from(cell);
    let first = cell * COEFFICIENTS;
    // In units of cells; zero inside.
    let beyond = s - inside;
    let mut sum = derivative::<E>(table, first, t, order);
    if comptime!(order > 2) {
        sum = select(beyond == E::new(0.0), sum, E::new(0.0));
    }
    if comptime!(order < 2) {
        sum += derivative::<E>(table, first, t, order + 1) * beyond;
    }
    if comptime!(order == 0) {
        sum += derivative::<E>(table, first, t, order + 2) * beyond * beyond * E::new(0.5);
    }
    #[unroll]
    for _ in 0..order {
        sum /= width;
    }
    result[place] = sum;
}

/// The `order`-th derivative in `t` of the polynomial whose coefficients begin at `first`.
#[cube]
fn derivative<E: Float>(table: &[E], first: usize, t: E, #[comptime] order: usize) -> E {
    let mut sum = E::new(0.0);
    #[unroll]
    for k in 0..comptime!(COEFFICIENTS.saturating_sub(order)) {
        let j = comptime!(COEFFICIENTS - 1 - k);
        let factor = comptime!(factor(1.0, j, order) as f32);
        sum = sum * t + table[first + j] * E::new(factor);
    }
    sum
}

//! Values of voxels.

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use willmore::volumes;

/// Values in a row, the first axis fastest.
#[derive(FromPyObject)]
pub enum Values<'py> {
    U8(PyReadonlyArray1<'py, u8>),
    I32(PyReadonlyArray1<'py, i32>),
    F32(PyReadonlyArray1<'py, f32>),
    F64(PyReadonlyArray1<'py, f64>),
}

impl Values<'_> {
    pub fn owned(&self) -> volumes::Values {
        match self {
            Self::U8(values) => volumes::Values::U8(values.as_array().to_vec()),
            Self::I32(values) => volumes::Values::I32(values.as_array().to_vec()),
            Self::F32(values) => volumes::Values::F32(values.as_array().to_vec()),
            Self::F64(values) => volumes::Values::F64(values.as_array().to_vec()),
        }
    }
}

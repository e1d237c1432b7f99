//! A tangent program in another precision than the primal program.

use std::collections::HashMap;

use burn::backend::ir::{BaseOperationIr, CastOpIr, OperationIr, TensorId, TensorIr};
use burn::tensor::DType;

use crate::ir::{CAST_IDS, each_tensor, read_only, tensor};

/// Changes the type of all float tensors of operations, and says how to convert what they read from elsewhere.
pub(crate) struct Conversion {
    dtype: DType,
    /// Names of the converted tensors.
    converted: HashMap<TensorId, TensorId>,
}

impl Conversion {
    pub(crate) fn to(dtype: DType) -> Self {
        Self {
            dtype,
            converted: HashMap::new(),
        }
    }

    /// Gives tensors computed elsewhere a converted copy: returns the operations, and the copies in place of the originals.
    pub(crate) fn cast(&mut self, tensors: &mut [TensorIr]) -> Vec<OperationIr> {
        let mut operations = Vec::new();
        for t in tensors {
            if !t.dtype.is_float() || t.dtype == self.dtype {
                continue;
            }
            let id = CAST_IDS + self.converted.len() as u64;
            let out = tensor(id, t.shape.clone(), self.dtype);
            self.converted.insert(t.id, out.id);
            operations.push(OperationIr::BaseFloat(BaseOperationIr::Cast(CastOpIr {
                input: t.clone(),
                out: out.clone(),
            })));
            *t = read_only(&out);
        }
        operations
    }

    /// The same operation on converted tensors.
    pub(crate) fn rewrite(&self, operation: &mut OperationIr) {
        if let OperationIr::NumericFloat(dtype, _) | OperationIr::Float(dtype, _) = operation {
            *dtype = self.dtype;
        }
        each_tensor(operation, |t| self.convert(t));
    }

    /// The name and type of a tensor after the conversion.
    pub(crate) fn convert(&self, t: &mut TensorIr) {
        if let Some(id) = self.converted.get(&t.id) {
            t.id = *id;
        }
        if t.dtype.is_float() {
            t.dtype = self.dtype;
        }
    }
}

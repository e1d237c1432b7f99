//! A float tensor whose rank is a run-time value.

use burn::backend::ops::FloatTensorOps;
use burn::backend::{Dispatch, DispatchTensor, TensorMetadata};
use burn::tensor::{DType, Tensor};

use crate::Error;

/// Rank-erased float tensor, so that functions of tensors of different ranks fit one signature.
///
/// Cloning is cheap: the data is shared.
#[derive(Clone, Debug)]
pub struct Value(pub(crate) DispatchTensor);

impl<const D: usize> From<Tensor<D>> for Value {
    fn from(tensor: Tensor<D>) -> Self {
        Self(tensor.into_dispatch())
    }
}

impl<const D: usize> From<&Tensor<D>> for Value {
    fn from(tensor: &Tensor<D>) -> Self {
        tensor.clone().into()
    }
}

impl Value {
    /// The tensor with its rank.
    ///
    /// # Errors
    /// [`Error::Rank`] if the tensor does not have `D` axes.
    pub fn tensor<const D: usize>(&self) -> Result<Tensor<D>, Error> {
        let found = self.0.shape().num_dims();
        if found == D {
            Ok(Tensor::from_dispatch(self.0.clone()))
        } else {
            Err(Error::Rank { expected: D, found })
        }
    }

    /// Number of elements along each axis.
    pub fn shape(&self) -> Vec<usize> {
        self.0.shape().to_vec()
    }

    /// Element type.
    pub fn dtype(&self) -> DType {
        self.0.dtype()
    }

    /// Euclidean inner product of values of equal shape on one device, summed in the elements' own
    /// precision.
    pub fn dot(&self, other: &Self) -> f64 {
        let product = Dispatch::float_mul(self.0.clone(), other.0.clone());
        let sum: Tensor<1> = Tensor::from_dispatch(Dispatch::float_sum(product));
        sum.into_data().iter::<f64>().sum()
    }

    /// All elements in row-major order.
    pub fn to_vec(&self) -> Vec<f64> {
        let elements = self.0.shape().num_elements();
        let flat = Dispatch::float_reshape(self.0.clone(), [elements].into());
        Tensor::<1>::from_dispatch(flat)
            .into_data()
            .iter::<f64>()
            .collect()
    }
}

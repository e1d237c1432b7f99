//! Devices by name, opened, and tensors of the right precision on them.

use std::fmt;
use std::str::FromStr;

use burn::tensor::{DType, Device, Tensor, TensorData};

use crate::Error;
use crate::fresh::PARALLEL_FROM;
use crate::vector::scaled_as;

/// The backends a device can belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, derive_more::Display)]
#[display("{}", self.name())]
pub enum DeviceKind {
    /// burn-flex on the CPU, `f64`.
    Flex,
    /// burn-ndarray on the CPU, `f64`.
    NdArray,
    /// burn-wgpu (Vulkan, Metal, DX12) on a GPU, `f32`.
    Wgpu,
    /// burn-cuda on an NVIDIA GPU: `f64` where that agrees with the CPU, or else `f32`.
    Cuda,
}

impl DeviceKind {
    /// All kinds, compiled in or not.
    pub const ALL: [Self; 4] = [Self::Flex, Self::NdArray, Self::Wgpu, Self::Cuda];

    /// The name in options and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Flex => "flex",
            Self::NdArray => "ndarray",
            Self::Wgpu => "wgpu",
            Self::Cuda => "cuda",
        }
    }

    /// Whether it computes on the processor, in double precision.
    pub fn is_cpu(self) -> bool {
        matches!(self, Self::Flex | Self::NdArray)
    }

    /// Whether this build contains the backend.
    pub fn is_compiled(self) -> bool {
        match self {
            Self::Flex => cfg!(feature = "flex"),
            Self::NdArray => cfg!(feature = "ndarray"),
            Self::Wgpu => cfg!(feature = "wgpu"),
            Self::Cuda => cfg!(feature = "cuda"),
        }
    }

    /// The kinds in this build, the default one first.
    pub fn compiled() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|kind| kind.is_compiled())
    }

    pub(crate) fn not_compiled(self) -> Error {
        Error::NotCompiled {
            name: self.name(),
            compiled: compiled_names(),
        }
    }
}

impl FromStr for DeviceKind {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        let kind = Self::ALL
            .into_iter()
            .find(|kind| kind.name() == name)
            .ok_or_else(|| Error::UnknownDevice {
                name: name.to_owned(),
                compiled: compiled_names(),
            })?;
        if kind.is_compiled() {
            Ok(kind)
        } else {
            Err(kind.not_compiled())
        }
    }
}

fn compiled_names() -> String {
    DeviceKind::compiled()
        .map(DeviceKind::name)
        .collect::<Vec<_>>()
        .join(", ")
}

/// An opened device with its working precision.
#[derive(Clone, Debug)]
pub struct ComputeDevice {
    kind: DeviceKind,
    device: Device,
    dtype: DType,
}

impl ComputeDevice {
    pub(crate) fn new(kind: DeviceKind, device: Device) -> Self {
        let dtype = if kind.is_cpu() {
            DType::F64
        } else {
            DType::F32
        };
        Self {
            kind,
            device,
            dtype,
        }
    }

    pub(crate) fn in_precision(self, dtype: DType) -> Self {
        Self { dtype, ..self }
    }

    /// The backend.
    pub fn kind(&self) -> DeviceKind {
        self.kind
    }

    /// Burn's device.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Precision of the tensors made here.
    pub fn dtype(&self) -> DType {
        self.dtype
    }

    /// Unit roundoff of that precision.
    pub fn epsilon(&self) -> f64 {
        if self.dtype == DType::F64 {
            f64::EPSILON
        } else {
            f64::from(f32::EPSILON)
        }
    }

    /// A tensor with these values in the device's working precision, which may differ from Burn's default.
    pub fn tensor<const R: usize>(&self, values: &[f64], shape: [usize; R]) -> Tensor<R> {
        // On CUDA the rows of what is uploaded are padded, which kernels would have to undo.
        let data = TensorData::new(values.to_vec(), [values.len()]);
        Tensor::<1>::from_data(data, (&self.device, self.dtype)).reshape(shape)
    }

    /// A tensor's values in double precision.
    ///
    /// # Errors
    /// [`Error::Read`] if the device was lost.
    pub fn values<const R: usize>(&self, tensor: Tensor<R>) -> Result<Vec<f64>, Error> {
        let read = |e: &dyn fmt::Debug| Error::Read {
            reason: format!("{e:?}"),
        };
        // Burn copies what is shared three times, on one core.
        let plain = self.kind.is_cpu() && !tensor.device().is_autodiff();
        let tensor = match tensor.shape().num_elements() {
            len if plain && len >= PARALLEL_FROM => scaled_as(&tensor, 1.0, DType::F64),
            _ => tensor,
        };
        let data = tensor
            .try_into_data_dtype(DType::F64)
            .map_err(|e| read(&e))?;
        data.try_into_vec::<f64>().map_err(|e| read(&e))
    }

    /// The single value of a tensor.
    ///
    /// # Errors
    /// As [`Self::values`].
    pub fn scalar<const R: usize>(&self, tensor: Tensor<R>) -> Result<f64, Error> {
        let values = self.values(tensor)?;
        match values[..] {
            [value] => Ok(value),
            _ => Err(Error::Read {
                reason: format!("expected one value, got {}", values.len()),
            }),
        }
    }
}

//! Opening devices.

use burn::tensor::{DType, Device};

#[cfg(any(feature = "wgpu", feature = "cuda"))]
use crate::device_check;
use crate::{ComputeDevice, DeviceKind, Error};

impl ComputeDevice {
    /// Opens a device. A GPU is compared with the CPU first, on operations that drivers and tuned kernels have been
    /// seen to get wrong. `cuda` computes in double precision if it agrees in that, too, or else in single precision.
    ///
    /// # Errors
    /// [`Error::NotCompiled`], [`Error::Unavailable`] without a usable adapter, [`Error::WrongArithmetic`].
    pub fn open(kind: DeviceKind) -> Result<Self, Error> {
        match kind {
            #[cfg(feature = "flex")]
            DeviceKind::Flex => Ok(Self::new(kind, Device::flex())),
            #[cfg(feature = "ndarray")]
            DeviceKind::NdArray => Ok(Self::new(kind, Device::ndarray())),
            #[cfg(feature = "wgpu")]
            DeviceKind::Wgpu => device_check::open_gpu(kind, || {
                Device::wgpu(burn::tensor::DeviceKind::DefaultDevice)
            }),
            #[cfg(feature = "cuda")]
            DeviceKind::Cuda => {
                let single = device_check::open_gpu(kind, || Device::cuda(0))?;
                match single.clone().with_dtype(DType::F64) {
                    Err(Error::WrongArithmetic { .. }) => Ok(single),
                    double => double,
                }
            }
            #[allow(unreachable_patterns)] // reachable unless every backend is compiled in
            _ => Err(kind.not_compiled()),
        }
    }

    /// The first device compiled in: `flex` unless default features are off.
    ///
    /// # Errors
    /// As [`Self::open`]; [`Error::UnknownDevice`] if no backend was compiled in at all.
    pub fn default_compiled() -> Result<Self, Error> {
        let kind = DeviceKind::compiled()
            .next()
            .ok_or_else(|| Error::UnknownDevice {
                name: "default".to_owned(),
                compiled: "no backend".to_owned(),
            })?;
        Self::open(kind)
    }

    /// The device of this name, or else the first one compiled in.
    ///
    /// # Errors
    /// As [`Self::open`]; [`Error::UnknownDevice`] for a name of no device, and if no backend was compiled in at all.
    pub fn named(name: Option<&str>) -> Result<Self, Error> {
        name.map_or_else(Self::default_compiled, |name| Self::open(name.parse()?))
    }
    /// The same device in another precision: `f32`, for comparisons, or `f64`, in which `cuda` is compared with the CPU first.
    ///
    /// # Errors
    /// [`Error::Unavailable`] for all but `f32` and `f64`, and for `f64` on `wgpu`, which computes wrongly there; [`Error::WrongArithmetic`].
    pub fn with_dtype(self, dtype: DType) -> Result<Self, Error> {
        let reason = match dtype {
            DType::F32 => None,
            DType::F64 if self.kind() != DeviceKind::Wgpu => None,
            DType::F64 => Some("is not reliable there; use f32"),
            _ => Some("has no operations there; use f32 or f64"),
        };
        if let Some(reason) = reason {
            return Err(Error::Unavailable {
                name: self.kind().name(),
                reason: format!("{dtype:?} {reason}"),
            });
        }
        let device = self.in_precision(dtype);
        #[cfg(feature = "cuda")]
        if device.kind() == DeviceKind::Cuda {
            device_check::check(&device)?;
        }
        Ok(device)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn precisions_without_operations_are_refused() {
        let device = ComputeDevice::default_compiled().unwrap();
        assert!(device.clone().with_dtype(DType::F32).is_ok());
        for dtype in [DType::F16, DType::BF16, DType::I64] {
            let error = device.clone().with_dtype(dtype).unwrap_err();
            assert!(matches!(error, Error::Unavailable { .. }), "{error}");
            assert!(error.to_string().contains(&format!("{dtype:?}")), "{error}");
        }
    }
}

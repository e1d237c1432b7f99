//! Opening devices.

use burn::tensor::Device;

#[cfg(any(feature = "wgpu", feature = "cuda"))]
use crate::device_check;
use crate::{ComputeDevice, DeviceKind, Error};

impl ComputeDevice {
    /// Opens a device. A GPU is compared with the CPU first, on operations that drivers and tuned kernels have been
    /// seen to get wrong.
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
            DeviceKind::Cuda => device_check::open_gpu(kind, || Device::cuda(0)),
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
}

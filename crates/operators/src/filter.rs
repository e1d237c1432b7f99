//! Symmetric circulant matrices given by their real spectrum: preconditioners.

use std::sync::{Arc, Mutex};

use burn::tensor::{DType, Device, Tensor, TensorData};

use crate::convolution::kernel_symbol;
use crate::fft::{Real, Transform, is_f64, lock};

/// A real, even symbol on the frequencies of a periodic grid; cheap to clone.
#[derive(Clone, derive_more::Debug)]
#[debug("SpectralFilter({:?})", _0.shape)]
pub struct SpectralFilter(Arc<Symbol>);

struct Symbol {
    shape: Vec<usize>,
    /// Normalised by the number of grid points, in the order of [`Transform`]'s spectra.
    double: Vec<f64>,
    single: Vec<f32>,
    /// The whole symbol on the device where it was needed last.
    uploaded: Mutex<Option<(Device, DType, Tensor<1>)>>,
}

impl SpectralFilter {
    /// The filter whose symbol is `f(k)` with `k` the complex symbol of a convolution kernel at each frequency
    /// (`kernel`: `width^D` values, row-major, centre in the middle).
    pub fn from_kernel(
        shape: &[usize],
        kernel: &[f64],
        width: usize,
        f: impl Fn(rustfft::num_complex::Complex<f64>) -> f64,
    ) -> Self {
        let points = Transform::<f64>::of_shape(shape).len() as f64;
        let symbol = kernel_symbol(shape, kernel, width);
        Self::from_ordered(
            shape,
            symbol.iter().map(|k| f(k.scale(points)) / points).collect(),
        )
    }

    /// The filter whose symbol is `f(theta)` at the frequencies `theta = 2 pi k / n` of every axis.
    pub fn from_symbol(shape: &[usize], f: impl Fn(&[f64]) -> f64) -> Self {
        let points: usize = shape.iter().product();
        let columns = Transform::<f64>::of_shape(shape).spectrum_len() / shape[0];
        let angle = |k: usize, n: usize| std::f64::consts::TAU * k as f64 / n as f64;
        let half = shape[shape.len() - 1] / 2 + 1;
        let mut theta = vec![0.0; shape.len()];
        let mut double = Vec::with_capacity(columns * shape[0]);
        for column in 0..columns {
            let mut rest = column;
            for axis in (1..shape.len()).rev() {
                let extent = if axis + 1 == shape.len() {
                    half
                } else {
                    shape[axis]
                };
                theta[axis] = angle(rest % extent, shape[axis]);
                rest /= extent;
            }
            for k in 0..shape[0] {
                theta[0] = angle(k, shape[0]);
                double.push(f(&theta) / points as f64);
            }
        }
        Self::from_ordered(shape, double)
    }

    /// The filter whose symbol has these values, in the order of a [`Transform`]'s spectra; even, as that of a real response.
    ///
    /// # Panics
    /// Unless there is a value for each frequency.
    pub fn from_spectrum(shape: &[usize], values: impl Iterator<Item = f64>) -> Self {
        let transform = Transform::<f64>::of_shape(shape);
        let points = transform.len() as f64;
        let values: Vec<f64> = values.map(|value| value / points).collect();
        assert_eq!(values.len(), transform.spectrum_len());
        Self::from_ordered(shape, values)
    }

    fn from_ordered(shape: &[usize], double: Vec<f64>) -> Self {
        let single = double.iter().map(|&v| v as f32).collect();
        Self(Arc::new(Symbol {
            shape: shape.to_vec(),
            double,
            single,
            uploaded: Mutex::new(None),
        }))
    }

    /// The filtered grid, on the host.
    ///
    /// # Panics
    /// If `x` is not of the filter's shape.
    pub fn apply(&self, x: &[f64]) -> Vec<f64> {
        Transform::of_shape(&self.0.shape).filter_real(x, &self.0.double)
    }

    pub(crate) fn symbol<T: Real>(&self) -> &[T] {
        if is_f64::<T>() {
            bytemuck::cast_slice(&self.0.double)
        } else {
            bytemuck::cast_slice(&self.0.single)
        }
    }

    /// The symbol at all frequencies, row-major and not normalized, as a tensor.
    #[cfg_attr(not(any(feature = "wgpu", feature = "cuda")), allow(dead_code))]
    pub(crate) fn on_device(&self, device: &Device, dtype: DType) -> Tensor<1> {
        let mut uploaded = lock(&self.0.uploaded);
        if let Some((at, of, symbol)) = uploaded.as_ref()
            && at == device
            && *of == dtype
        {
            return symbol.clone();
        }
        let values = full_symbol(&self.0.shape, &self.0.double);
        let length = values.len();
        let symbol = Tensor::from_data(TensorData::new(values, [length]), (device, dtype));
        *uploaded = Some((device.clone(), dtype, symbol.clone()));
        symbol
    }
}

/// Extends an even symbol from the order of [`Transform`]'s spectra, divided by the number of grid points, to all frequencies,
/// row-major.
fn full_symbol(dims: &[usize], half: &[f64]) -> Vec<f64> {
    let (n0, last) = (dims[0], dims[dims.len() - 1]);
    let total: usize = dims.iter().product();
    (0..total)
        .map(|i| {
            let mirrored = i % last > last / 2;
            let mut rest = i;
            let mut place = |n: usize| {
                let k = rest % n;
                rest /= n;
                if mirrored { (n - k) % n } else { k }
            };
            let (mut column, mut stride) = (0, 1);
            for (axis, &n) in dims.iter().enumerate().skip(1).rev() {
                column += place(n) * stride;
                stride *= if axis == dims.len() - 1 { n / 2 + 1 } else { n };
            }
            half[column * n0 + place(n0)] * total as f64
        })
        .collect()
}

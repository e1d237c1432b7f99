//! Vector operations of iterative solvers, on a CPU each one pass over memory on all cores, and work on the host in between.
//!
//! They are not differentiated, so neither captured nor on the tape.
#![cfg_attr(not(any(feature = "wgpu", feature = "cuda")), allow(dead_code))]

use std::sync::{Arc, Mutex};

use burn::backend::{Backend, Dispatch, backend_extension, tensor::FloatTensor};
use burn::tensor::{DType, Device, Tensor};

use crate::fft::{Real, is_f64, lock};
use crate::filter::SpectralFilter;
use crate::interpolation::{DeviceInterpolation, Interpolation};

/// A change of one vector that depends on another and is computed on the host, such as a sparse correction.
pub trait HostUpdate: Send + Sync {
    /// Changes `z`, given `x`, in the precision of their tensors.
    fn update<T: Real>(&self, x: &[T], z: &mut [T]);

    /// Where it is `z += Z S Z^T x`, with interpolation `Z` from the corners of lattice cells: that interpolation. A GPU does it itself,
    /// and only values at corners visit the host, for [`Self::at_corners`]. Without it whole vectors do.
    fn interpolation(&self) -> Option<Interpolation> {
        None
    }

    /// Applies `S` where there is an interpolation: replaces the sums at the corners of each cell by the values there.
    fn at_corners(&self, _sums: &mut [f64]) {
        unreachable!("what has an interpolation has values at its corners");
    }
}

/// A [`HostUpdate`] of any type.
trait AnyUpdate: Send + Sync {
    fn double(&self, x: &[f64], z: &mut [f64]);
    fn single(&self, x: &[f32], z: &mut [f32]);
    fn interpolation(&self) -> Option<Interpolation>;
    fn at_corners(&self, sums: &mut [f64]);
}

impl<U: HostUpdate> AnyUpdate for U {
    fn interpolation(&self) -> Option<Interpolation> {
        HostUpdate::interpolation(self)
    }

    fn at_corners(&self, sums: &mut [f64]) {
        HostUpdate::at_corners(self, sums);
    }

    fn double(&self, x: &[f64], z: &mut [f64]) {
        self.update(x, z);
    }

    fn single(&self, x: &[f32], z: &mut [f32]) {
        self.update(x, z);
    }
}

/// A shared [`HostUpdate`].
#[derive(Clone, derive_more::Debug)]
#[debug("SharedUpdate")]
pub struct SharedUpdate {
    update: Arc<dyn AnyUpdate>,
    /// Its interpolation where it ran last, if it has one.
    on_device: Arc<Mutex<Option<(Device, DType, Arc<DeviceInterpolation>)>>>,
}

impl SharedUpdate {
    /// Shares an update.
    pub fn new(update: impl HostUpdate + 'static) -> Self {
        Self {
            update: Arc::new(update),
            on_device: Arc::default(),
        }
    }

    /// Its interpolation, taken to the device in this precision the first time.
    pub(crate) fn on_device(
        &self,
        device: &Device,
        dtype: DType,
    ) -> Option<Arc<DeviceInterpolation>> {
        let mut kept = lock(&self.on_device);
        if let Some((at, of, arrays)) = kept.as_ref()
            && (at, *of) == (device, dtype)
        {
            return Some(arrays.clone());
        }
        let arrays = Arc::new(DeviceInterpolation::new(
            self.update.interpolation()?,
            device,
            dtype,
        ));
        *kept = Some((device.clone(), dtype, arrays.clone()));
        Some(arrays)
    }

    /// See [`HostUpdate::at_corners`].
    pub(crate) fn at_corners(&self, sums: &mut [f64]) {
        self.update.at_corners(sums);
    }
}

/// How a vector moves by another, entry by entry.
#[derive(Clone, Copy, Debug)]
pub enum Motion {
    /// [`add_scaled`], by this factor.
    Straight(f64),
    /// [`combined`], with these factors of both.
    Combined(f64, f64),
    /// [`retract`], by this factor.
    Retracted(f64),
    /// [`extrapolate`], by this factor.
    Extrapolated(f64),
}

/// Vector operations of iterative solvers.
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(any(feature = "wgpu", feature = "cuda"))
)]
pub trait VectorOps: Backend {
    /// `sum a b`, shape `[1]`; accumulated and returned in double precision on a CPU.
    fn inner_product(a: FloatTensor<Self>, b: FloatTensor<Self>) -> FloatTensor<Self>;
    /// `sum (a - b)^2`, likewise.
    fn squared_distance(a: FloatTensor<Self>, b: FloatTensor<Self>) -> FloatTensor<Self>;
    /// `a x`, in this precision.
    fn scaled(x: FloatTensor<Self>, a: f64, dtype: DType) -> FloatTensor<Self>;
    /// [`spectral_filter`] on primitives.
    fn spectral_filter(x: FloatTensor<Self>, filter: SpectralFilter) -> FloatTensor<Self>;
    /// A vector moved by another.
    fn moved(x: FloatTensor<Self>, y: FloatTensor<Self>, motion: Motion) -> FloatTensor<Self>;
    /// [`update_on_host`] on primitives.
    fn update_on_host(
        x: FloatTensor<Self>,
        z: FloatTensor<Self>,
        update: SharedUpdate,
    ) -> FloatTensor<Self>;
}

/// `sum a b` as a tensor of one element, accumulated and returned in double precision on a CPU.
pub fn inner_product<const R: usize>(a: &Tensor<R>, b: &Tensor<R>) -> Tensor<1> {
    let (a, b) = (a.clone().into_dispatch(), b.clone().into_dispatch());
    Tensor::from_dispatch(<Dispatch as VectorOps>::inner_product(a, b))
}

/// Applies a symmetric circulant matrix given by its spectrum.
pub fn spectral_filter<const R: usize>(x: Tensor<R>, filter: &SpectralFilter) -> Tensor<R> {
    let (x, filter) = (x.into_dispatch(), filter.clone());
    Tensor::from_dispatch(<Dispatch as VectorOps>::spectral_filter(x, filter))
}

/// `sum (a - b)^2` as a tensor of one element, accumulated and returned in double precision on a CPU.
pub fn squared_distance<const R: usize>(a: &Tensor<R>, b: &Tensor<R>) -> Tensor<1> {
    let (a, b) = (a.clone().into_dispatch(), b.clone().into_dispatch());
    Tensor::from_dispatch(<Dispatch as VectorOps>::squared_distance(a, b))
}

/// `a x`
pub fn scaled<const R: usize>(x: &Tensor<R>, a: f64) -> Tensor<R> {
    scaled_as(x, a, x.dtype())
}

/// `a x`, computed in the precision of `x` and rounded to another one.
pub fn scaled_as<const R: usize>(x: &Tensor<R>, a: f64, dtype: DType) -> Tensor<R> {
    let x = x.clone().into_dispatch();
    Tensor::from_dispatch(<Dispatch as VectorOps>::scaled(x, a, dtype))
}

/// `x + alpha y`, in place on a CPU if nobody else holds `x`.
pub fn add_scaled<const R: usize>(x: Tensor<R>, y: &Tensor<R>, alpha: f64) -> Tensor<R> {
    moved(x, y, Motion::Straight(alpha))
}

/// `a x + b y`, in place on a CPU if nobody else holds `x`.
pub fn combined<const R: usize>(x: Tensor<R>, a: f64, y: &Tensor<R>, b: f64) -> Tensor<R> {
    moved(x, y, Motion::Combined(a, b))
}

/// A phase field `u` moved along `p`: in `atanh u`, which is the distance, where the interface is, straight elsewhere.
///
/// A time step moves the interface by a fraction of `eps`. A straight update `u + t p` leaves the `tanh` profile; the same motion
/// in the variable `atanh u` does not. With `q = 1 - u^2` and `d = t p q / (q^2 + 0.05^2)`, limited to 1.5, the interface part of
/// the motion becomes the translation of `atanh u` by `d`; what is left of `t p` is added straight. Agrees with `u + t p` to first
/// order in `t`.
pub fn retract<const R: usize>(u: &Tensor<R>, p: &Tensor<R>, t: f64) -> Tensor<R> {
    moved(u.clone(), p, Motion::Retracted(t))
}

/// The phase field after `factor` more steps like the last one, extrapolated in `atanh u`.
///
/// `(u + s w) / (1 + u s w)` with `s = factor (u - u_previous) / (1 - u u_previous)`, limited to 0.9, windowed to the interface by
/// `w = q^2 / (q^2 + 0.05^2)`, `q = 1 - u^2`.
pub fn extrapolate<const R: usize>(u: &Tensor<R>, previous: &Tensor<R>, factor: f64) -> Tensor<R> {
    moved(u.clone(), previous, Motion::Extrapolated(factor))
}

fn moved<const R: usize>(x: Tensor<R>, y: &Tensor<R>, motion: Motion) -> Tensor<R> {
    let (x, y) = (x.into_dispatch(), y.clone().into_dispatch());
    Tensor::from_dispatch(<Dispatch as VectorOps>::moved(x, y, motion))
}

/// Changes `z` by a host computation that depends on `x`. On a CPU nothing is copied if nobody else holds `z`.
pub fn update_on_host<const R: usize>(
    x: &Tensor<R>,
    z: Tensor<R>,
    update: &SharedUpdate,
) -> Tensor<R> {
    let (x, z) = (x.clone().into_dispatch(), z.into_dispatch());
    let update = update.clone();
    Tensor::from_dispatch(<Dispatch as VectorOps>::update_on_host(x, z, update))
}

/// Calls an update with slices of either precision.
pub(crate) fn call<T: Real>(update: &SharedUpdate, x: &[T], z: &mut [T]) {
    if is_f64::<T>() {
        (update.update).double(bytemuck::cast_slice(x), bytemuck::cast_slice_mut(z));
    } else {
        (update.update).single(bytemuck::cast_slice(x), bytemuck::cast_slice_mut(z));
    }
}

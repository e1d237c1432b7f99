//! Comparison of a GPU with the CPU before it is trusted with a run.
//!
//! GPU drivers and auto-tuned kernels have returned wrong numbers without an error; a run that starts on such a
//! device wastes hours. The check takes less than a second.

use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};

use burn::tensor::Device;

use crate::convolution::convolve;
use crate::{ComputeDevice, DeviceKind, Error, circular_convolution};

/// Difference to the CPU that is accepted, in units of rounding, for values of size 1.
const LIMIT: f64 = 1e3;

pub(crate) fn open_gpu(
    kind: DeviceKind,
    device: impl FnOnce() -> Device,
) -> Result<ComputeDevice, Error> {
    // Burn panics when there is no adapter; a user gets one line instead, and nothing of the panic.
    let hook = take_hook();
    set_hook(Box::new(|_| ()));
    let opened = catch_unwind(AssertUnwindSafe(|| {
        let device = ComputeDevice::new(kind, device());
        let one = device.scalar(device.tensor::<1>(&[1.0], [1]))?;
        Ok((device, one))
    }));
    set_hook(hook);
    let (device, _) = opened.map_err(|_| Error::Unavailable {
        name: kind.name(),
        reason: "no adapter could be opened (is a GPU driver installed?)".to_owned(),
    })??;
    check(&device)?;
    Ok(device)
}

pub(crate) fn check(device: &ComputeDevice) -> Result<(), Error> {
    const N: usize = 24;
    let u: Vec<f64> = (0..N * N).map(|i| (0.37 * i as f64).sin()).collect();
    let kernel: Vec<f64> = (0..25).map(|i| 0.04 + 0.01 * f64::from(i).cos()).collect();
    let x = device.tensor::<2>(&u, [N, N]);

    let expected = convolve(&u, &[N, N], &kernel, 5, false);
    let k = device.tensor::<2>(&kernel, [5, 5]);
    compare(
        device,
        "a circular convolution",
        circular_convolution(x.clone(), k, false),
        &expected,
    )?;

    let expected: Vec<f64> = u.iter().map(|v| v.exp().tanh()).collect();
    compare(device, "exp and tanh", x.clone().exp().tanh(), &expected)?;

    let sum = |column: usize| u.iter().skip(column).step_by(N).sum();
    let expected: Vec<f64> = (0..N).map(sum).collect();
    compare(device, "sums along an axis", x.sum_dim(0), &expected)
}

fn compare(
    device: &ComputeDevice,
    operation: &'static str,
    result: burn::tensor::Tensor<2>,
    expected: &[f64],
) -> Result<(), Error> {
    let difference = device
        .values(result)?
        .iter()
        .zip(expected)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, |m, d| {
            if d.is_nan() {
                f64::INFINITY
            } else {
                f64::max(m, d)
            }
        });
    let limit = LIMIT * device.epsilon();
    if difference > limit {
        return Err(Error::WrongArithmetic {
            name: device.kind().name(),
            operation,
            difference,
            limit,
        });
    }
    Ok(())
}

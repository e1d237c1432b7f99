//! Comparison of a GPU with the CPU before it is trusted with a run.
//!
//! GPU drivers and auto-tuned kernels have returned wrong numbers without an error; a run that starts on such a
//! device wastes hours. The check takes less than a second.

use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::{Arc, Mutex, OnceLock};

use burn::tensor::Device;

use crate::convolution::convolve;
use crate::fft::lock;
use crate::{ComputeDevice, DeviceKind, Error, circular_convolution};

/// Difference to the CPU that is accepted, in units of rounding, for values of size 1.
const LIMIT: f64 = 1e3;

pub(crate) fn open_gpu(
    kind: DeviceKind,
    device: impl FnOnce() -> Device,
) -> Result<ComputeDevice, Error> {
    // Burn panics when there is no adapter; a user gets one line instead.
    let opened = quietly(|| {
        let device = ComputeDevice::new(kind, device());
        let one = device.scalar(device.tensor::<1>(&[1.0], [1]))?;
        Ok((device, one))
    });
    let (device, _) = opened.map_err(|message| Error::Unavailable {
        name: kind.name(),
        reason: format!("no adapter could be opened (is a GPU driver installed?): {message}"),
    })??;
    check(&device)?;
    Ok(device)
}

/// The result, or the first line of the first message of a panic, which is not shown.
fn quietly<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    /// One at a time, since the hook belongs to the process.
    static HOOK: Mutex<()> = Mutex::new(());
    let _alone = lock(&HOOK);
    let first = Arc::new(OnceLock::new());
    let hook = take_hook();
    let seen = first.clone();
    set_hook(Box::new(move |panic| {
        let message = panic.payload_as_str().unwrap_or("no message");
        let _ = seen.set(message.lines().next().unwrap_or_default().to_owned());
    }));
    let result = catch_unwind(AssertUnwindSafe(work));
    set_hook(hook);
    result.map_err(|_| first.get().cloned().unwrap_or_default())
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

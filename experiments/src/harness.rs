//! The outermost layer of every program, and running many independent tasks.

use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use operators::{ComputeDevice, memory};

use crate::Error;

/// Runs a program: success is exit code 0, a failure one line on standard error and exit code 2.
pub fn run(program: impl FnOnce() -> Result<(), Error>) -> ExitCode {
    memory::keep_freed();
    match program() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", error.line());
            ExitCode::from(2)
        }
    }
}

/// How many tasks run side by side: one per processor, or one on a GPU, which they would only share.
pub fn workers(device: &ComputeDevice) -> usize {
    if device.kind().is_cpu() {
        rayon::current_num_threads()
    } else {
        1
    }
}

/// Runs `count` tasks, started in the given order on `workers` threads; results come back by task number.
///
/// Each worker is a pool of its own, so that the parallel loops inside a task stay on its thread: a task waiting in
/// such a loop would otherwise take up another whole task.
///
/// # Errors
/// That of the failed task with the lowest number; no new tasks are started after a failure.
pub fn in_parallel<R: Send>(
    order: &[usize],
    workers: usize,
    task: impl Fn(usize) -> Result<R, Error> + Sync,
) -> Result<Vec<R>, Error> {
    let next = AtomicUsize::new(0);
    let failed = AtomicBool::new(false);
    let results = Mutex::new(Vec::with_capacity(order.len()));
    let work = || {
        while !failed.load(Ordering::Relaxed) {
            let Some(&number) = order.get(next.fetch_add(1, Ordering::Relaxed)) else {
                break;
            };
            let result = task(number);
            if result.is_err() {
                failed.store(true, Ordering::Relaxed);
            }
            let mut results = results
                .lock()
                .unwrap_or_else(std::sync::PoisonError::into_inner);
            results.push((number, result));
        }
    };
    if workers <= 1 {
        work();
    } else {
        let pools = (0..workers.min(order.len()).max(1))
            .map(|_| rayon::ThreadPoolBuilder::new().num_threads(1).build())
            .collect::<Result<Vec<_>, _>>()
            .map_err(|error| Error::Options(format!("cannot start threads: {error}")))?;
        std::thread::scope(|scope| {
            for pool in &pools {
                scope.spawn(|| pool.install(work));
            }
        });
    }
    let mut results = results
        .into_inner()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    results.sort_by_key(|(number, _)| *number);
    results.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_back_in_order_whatever_the_schedule() {
        let order: Vec<usize> = (0..50).rev().collect();
        let squares = in_parallel(&order, 3, |i| Ok(i * i)).unwrap();
        assert_eq!(squares, (0..50).map(|i| i * i).collect::<Vec<_>>());
    }

    #[test]
    fn a_failure_stops_the_rest() {
        let started = AtomicUsize::new(0);
        let error = in_parallel(&(0..1000).collect::<Vec<_>>(), 2, |i| {
            started.fetch_add(1, Ordering::Relaxed);
            if i == 3 {
                return Err(Error::Options("task 3".to_owned()));
            }
            std::thread::sleep(std::time::Duration::from_millis(2));
            Ok(i)
        })
        .unwrap_err();
        assert_eq!(error.line(), "task 3");
        assert!(started.load(Ordering::Relaxed) < 100);
    }
}

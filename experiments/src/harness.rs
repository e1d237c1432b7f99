//! The outermost layer of every program, and running many independent tasks.

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use clap::Parser;
use operators::{ComputeDevice, memory};

use crate::Error;

/// Runs a program with the options of the command line.
pub fn main<O: Parser>(program: impl FnOnce(&O) -> Result<(), Error>) -> ExitCode {
    let options = O::parse();
    run(|| program(&options))
}

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
    let (next, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    let work = || {
        let mut results = Vec::new();
        while !failed.load(Ordering::Relaxed) {
            let Some(&number) = order.get(next.fetch_add(1, Ordering::Relaxed)) else {
                break;
            };
            let result = task(number);
            failed.fetch_or(result.is_err(), Ordering::Relaxed);
            results.push((number, result));
        }
        results
    };
    let mut results = if workers <= 1 {
        work()
    } else {
        let pools = (0..workers.min(order.len()).max(1))
            .map(|_| rayon::ThreadPoolBuilder::new().num_threads(1).build())
            .collect::<Result<Vec<_>, _>>()
            .map_err(|error| Error::Options(format!("cannot start threads: {error}")))?;
        std::thread::scope(|scope| {
            let threads: Vec<_> = (pools.iter())
                .map(|pool| scope.spawn(move || pool.install(work)))
                .collect();
            let results = threads.into_iter().map(std::thread::ScopedJoinHandle::join);
            results
                .flat_map(|of| of.expect("tasks do not panic"))
                .collect()
        })
    };
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

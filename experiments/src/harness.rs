//! The outermost layer of every program, and running many independent tasks.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::{Command, Parser};
use operators::{ComputeDevice, memory};

use crate::Result;

/// Runs a program with the options of the command line: success is exit code 0, a failure one line on standard error and exit code 2.
pub fn main<O: Parser>(command: Command, program: impl FnOnce(&O) -> Result<()>) -> ExitCode {
    let matches = command.get_matches();
    let options = O::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    memory::keep_freed();
    match program(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", files::with_causes(&*error));
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

/// Runs `count` tasks on `workers` threads, the last one first; results come back by task number.
///
/// Each worker is a pool of its own, so that the parallel loops inside a task stay on its thread: a task waiting in
/// such a loop would otherwise take up another whole task.
pub fn in_parallel<R: Send>(
    count: usize,
    workers: usize,
    task: impl Fn(usize) -> Result<R> + Sync,
) -> Result<Vec<R>> {
    let (started, results) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    let work = || {
        while let Some(number) = count.checked_sub(1 + started.fetch_add(1, Ordering::Relaxed)) {
            let result = task(number);
            if result.is_err() {
                started.store(count, Ordering::Relaxed);
            }
            results
                .lock()
                .expect("tasks do not panic")
                .insert(number, result);
        }
    };
    if workers <= 1 {
        work();
    } else {
        let pool = |_| rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pools = (0..workers.min(count))
            .map(pool)
            .collect::<Result<Vec<_>, _>>();
        let pools = pools.map_err(|e| format!("cannot start threads: {e}"))?;
        std::thread::scope(|scope| {
            for pool in &pools {
                scope.spawn(|| pool.install(work));
            }
        });
    }
    let results = results.into_inner().expect("tasks do not panic");
    results.into_values().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_back_in_order_whatever_the_schedule() {
        let squares = in_parallel(50, 3, |i| Ok(i * i)).unwrap();
        assert_eq!(squares, (0..50).map(|i| i * i).collect::<Vec<_>>());
    }

    #[test]
    fn a_failure_stops_the_rest() {
        let started = AtomicUsize::new(0);
        let error = in_parallel(1000, 2, |i| {
            started.fetch_add(1, Ordering::Relaxed);
            if i == 996 {
                return Err("task 996".into());
            }
            std::thread::sleep(std::time::Duration::from_millis(2));
            Ok(i)
        })
        .unwrap_err();
        assert_eq!(error.to_string(), "task 996");
        assert!(started.load(Ordering::Relaxed) < 100);
    }
}

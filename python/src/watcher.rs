//! Progress, warnings and Ctrl-C.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use pyo3::prelude::*;
use willmore::jobs::{self, Note, Progress, Warning, Watcher};
use willmore::runs::{self, Interrupt};

use crate::error::{detached, in_python, of_job};

/// Does long work of the library without the interpreter's lock, and returns what its watcher has heard, too.
pub fn watched<T: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&PyWatcher) -> Result<T, jobs::Error> + Send,
) -> PyResult<(T, PyWatcher)> {
    let watcher = PyWatcher::new(progress);
    let done = detached(py, || work(&watcher).map_err(of_job));
    Ok((watcher.check(done)?, watcher))
}

/// Collects warnings and notes, calls `progress(title, done, parts)`, and ends a job between two steps when Python has a signal to handle.
pub struct PyWatcher {
    progress: Option<Arc<Py<PyAny>>>,
    interrupt: Interrupt,
    warnings: Mutex<Vec<String>>,
    notes: Mutex<Vec<String>>,
    raised: Arc<Mutex<Option<PyErr>>>,
}

impl PyWatcher {
    fn new(progress: Option<Py<PyAny>>) -> Self {
        Self {
            progress: progress.map(Arc::new),
            interrupt: Interrupt::never(),
            warnings: Mutex::default(),
            notes: Mutex::default(),
            raised: Arc::default(),
        }
    }

    pub fn warnings(&self) -> Vec<String> {
        locked(&self.warnings).clone()
    }

    pub fn notes(&self) -> Vec<String> {
        locked(&self.notes).clone()
    }

    /// What a signal or the callback raised, in place of the interruption that it caused.
    fn check<T>(&self, done: PyResult<T>) -> PyResult<T> {
        match locked(&self.raised).take() {
            Some(error) => Err(error),
            None => done,
        }
    }
}

impl Watcher for PyWatcher {
    fn warning(&self, warning: &Warning) {
        locked(&self.warnings).push(in_python(&warning.to_string()));
    }

    fn note(&self, note: &Note) {
        locked(&self.notes).push(in_python(&note.to_string()));
    }

    fn begins(&self, title: &str, parts: u64) -> Box<dyn Progress> {
        Box::new(Bar {
            title: title.to_owned(),
            parts,
            done: AtomicU64::new(0),
            told: Mutex::default(),
            progress: self.progress.clone(),
            interrupt: self.interrupt.clone(),
            raised: self.raised.clone(),
        })
    }

    fn interrupt(&self) -> Result<Interrupt, runs::Error> {
        Ok(self.interrupt.clone())
    }
}

struct Bar {
    title: String,
    parts: u64,
    done: AtomicU64,
    told: Mutex<Option<u64>>,
    progress: Option<Arc<Py<PyAny>>>,
    interrupt: Interrupt,
    raised: Arc<Mutex<Option<PyErr>>>,
}

impl Bar {
    /// Threads of a pool arrive in any order, and what is told never goes back.
    fn tell(&self, done: u64) {
        let mut last = locked(&self.told);
        if last.is_some_and(|last| done <= last) {
            return;
        }
        *last = Some(done);
        let told = Python::attach(|py| {
            py.check_signals()?;
            match &self.progress {
                Some(progress) => progress
                    .call1(py, (&self.title, done, self.parts))
                    .map(drop),
                None => Ok(()),
            }
        });
        if let Err(error) = told {
            locked(&self.raised).get_or_insert(error);
            self.interrupt.request();
        }
    }
}

impl Progress for Bar {
    fn reach(&self, parts: u64) {
        self.done.store(parts, Ordering::Relaxed);
        self.tell(parts);
    }

    fn advance(&self) {
        let done = 1 + self.done.fetch_add(1, Ordering::Relaxed);
        // Threads of a pool must not wait for the interpreter where nobody listens.
        if self.progress.is_some() {
            self.tell(done);
        }
    }
}

fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

//! What Python raises.

use std::panic::{AssertUnwindSafe, catch_unwind};

use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;
use willmore::jobs;

pyo3::create_exception!(
    willmore,
    Error,
    PyValueError,
    "A refused input or option, or a flow that cannot go on. The message says what to do."
);

/// An error of the library with all its causes on one line.
pub fn raised(error: &(dyn std::error::Error + 'static)) -> PyErr {
    Error::new_err(in_python(&files::with_causes(error)))
}

/// What stops a job.
pub fn of_job(error: jobs::Error) -> PyErr {
    match error {
        jobs::Error::Interrupted => PyKeyboardInterrupt::new_err(()),
        error => raised(&error),
    }
}

/// Messages name the parameters of the library. In Python some have other names.
pub fn in_python(message: &str) -> String {
    // How to type a value that looks like an option is no advice here.
    let (message, _) = message.split_once("; to pass `").unwrap_or((message, ""));
    message
        .replace("`keep`", "`fixed`")
        .replace("`label` all", "no `label`")
        .replace(
            "`willmore resume` goes on with more `steps`",
            "a flow with more `steps` goes on",
        )
}

/// Does long work without the interpreter's lock. A panic, which is a bug, becomes an [`Error`] too: it must not end a session.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> PyResult<T> + Send) -> PyResult<T> {
    py.detach(|| {
        catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
            let text = (panic.downcast_ref::<String>().map(String::as_str))
                .or_else(|| panic.downcast_ref::<&str>().copied())
                .unwrap_or("no reason given");
            Err(Error::new_err(format!(
                "a bug in willmore: {text}; please report it"
            )))
        })
    })
}

//! The extension module of the Python package `willmore`: arrays in, arrays out. What people call is written in Python, in `willmore/`.

#![expect(clippy::needless_pass_by_value, reason = "PyO3 hands arguments over")]

mod error;
mod exact;
mod input;
mod job;
mod shape;
mod shared;
mod training;
mod volume;
mod watcher;

use pyo3::prelude::*;

/// Does as the program `willmore`, with the arguments behind its name, and returns its exit code.
#[pyfunction]
fn program(py: Python<'_>, arguments: Vec<String>) -> u8 {
    let arguments = std::iter::once("willmore".to_owned()).chain(arguments);
    let arguments: Vec<_> = arguments.map(Into::into).collect();
    py.detach(|| willmore_cli::main(&arguments, willmore_cli::Console::standard()))
}

#[pymodule]
mod _willmore {
    #[pymodule_export]
    use crate::error::Error;
    #[pymodule_export]
    use crate::exact::{
        PyCurve, PyExactShape, PySurface, PyVesicle, exact_curves, exact_surfaces, exact_vesicles,
    };
    #[pymodule_export]
    use crate::input::Input;
    #[pymodule_export]
    use crate::job::{PyResults, PyState, PySteps, begin, labels, resume, run, run_in_folder};
    #[pymodule_export]
    use crate::program;
    #[pymodule_export]
    use crate::shape::{PyShape, read_mesh, repair, signed_distances, zero_curves, zero_surface};
    #[pymodule_export]
    use crate::shared::{PySharedLabels, shared_labels};

    #[pymodule_export]
    use crate::training::{PyNetwork, train};

    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
}

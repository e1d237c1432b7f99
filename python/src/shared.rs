//! All labels of a segmentation at once, with shared walls.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use willmore::jobs::{self, SharedLabels};

use crate::error::{detached, of_job};
use crate::input::Input;
use crate::job::{Options, json, named};
use crate::shape::arrays;
use crate::watcher::watched;

/// Vertices and faces.
type Triangles<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>);

/// Smooth labels that fill space.
#[pyclass(frozen, module = "willmore._willmore", name = "SharedLabels")]
pub struct PySharedLabels {
    made: SharedLabels,
    #[pyo3(get)]
    warnings: Vec<String>,
    #[pyo3(get)]
    notes: Vec<String>,
}

#[pymethods]
impl PySharedLabels {
    /// What became of the labels, as JSON.
    #[getter]
    fn report(&self) -> PyResult<String> {
        json(&self.made.report)
    }

    /// Vertices and faces of all walls.
    #[getter]
    fn walls<'py>(&self, py: Python<'py>) -> PyResult<Triangles<'py>> {
        arrays(py, &self.made.walls.mesh)
    }

    /// The labels behind and ahead of every face.
    #[getter]
    fn sides<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        let sides = self.made.walls.sides.as_flattened().iter();
        let labels = sides.map(|&side| self.made.names[side as usize]);
        PyArray1::from_iter(py, labels).reshape([self.made.walls.sides.len(), 2])
    }

    /// Vertices and faces of the surface of one label.
    fn surface<'py>(&self, py: Python<'py>, label: i32) -> PyResult<Option<Triangles<'py>>> {
        let surface = self.made.surface(label);
        surface.map(|mesh| arrays(py, &mesh)).transpose()
    }

    /// The labels of all voxels in a row, the first axis fastest.
    #[getter]
    fn voxels<'py>(&self, py: Python<'py>) -> (Bound<'py, PyArray1<i32>>, [usize; 3]) {
        let labels = self.made.voxels.values().map(|label| label as i32);
        (PyArray1::from_iter(py, labels), self.made.voxels.size())
    }

    /// Writes a file by its extension.
    fn save(&self, py: Python<'_>, path: &str) -> PyResult<()> {
        detached(py, || self.made.save(path).map_err(of_job))
    }
}

/// Smooths all labels together.
#[pyfunction]
#[pyo3(signature = (input, options, progress=None))]
pub fn shared_labels(
    py: Python<'_>,
    input: &Input,
    options: Options,
    progress: Option<Py<PyAny>>,
) -> PyResult<PySharedLabels> {
    let options: jobs::FairOptions = jobs::options_of(named(&options)).map_err(of_job)?;
    let options = jobs::FairOptions {
        input: jobs::InputOptions {
            input: Some(input.0.clone()),
            ..options.input
        },
        ..options
    };
    let (made, watcher) = watched(py, progress, |watcher| {
        jobs::shared_labels(options, watcher)
    })?;
    Ok(PySharedLabels {
        made,
        warnings: watcher.warnings(),
        notes: watcher.notes(),
    })
}

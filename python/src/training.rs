//! Learned operators.

use numpy::PyArray1;
use pyo3::prelude::*;
use willmore::jobs::{self, TrainOptions};
use willmore::model::{self, Shipped};

use crate::error::{Error, raised};
use crate::job::{Options, json, named};
use crate::watcher::watched;

/// A learned step of mean curvature flow.
#[pyclass(frozen, module = "willmore._willmore", name = "NetworkData")]
pub struct PyNetwork(model::Network);

#[pymethods]
impl PyNetwork {
    #[staticmethod]
    fn load(path: &str) -> PyResult<Self> {
        model::Network::load(path.as_ref())
            .map(Self)
            .map_err(|error| raised(&error))
    }

    /// One of those that come with the package, by its name in the list of `willmore networks`.
    #[staticmethod]
    fn shipped(name: &str) -> PyResult<Self> {
        let all = [Shipped::Accurate, Shipped::Paper].map(Shipped::all);
        for shipped in all {
            let shipped = shipped.map_err(|error| raised(&error))?;
            let mut named = shipped.into_iter();
            if let Some((_, network)) =
                named.find(|(of, _)| of.trim_end_matches(".safetensors") == name)
            {
                return Ok(Self(network));
            }
        }
        Err(Error::new_err(format!(
            "there is no network {name:?}: `willmore networks` lists them"
        )))
    }

    fn save(&self, path: &str) -> PyResult<()> {
        self.0.save(path.as_ref()).map_err(|error| raised(&error))
    }

    /// Dimension, width of the kernel in cells, interface width in cells, and time step in squared cells, as JSON.
    #[getter]
    fn ratios(&self) -> PyResult<String> {
        json(&self.0.ratios())
    }

    #[getter]
    fn calibration(&self) -> PyResult<String> {
        json(&self.0.calibration().map_err(|error| raised(&error))?)
    }

    #[getter]
    fn provenance(&self) -> PyResult<String> {
        json(&self.0.provenance)
    }

    /// The values of the kernel in a row.
    #[getter]
    fn kernel<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.kernel())
    }
}

/// Trains a network, and returns it with its loss on spheres that it has not seen.
#[pyfunction]
#[pyo3(signature = (options, progress=None))]
pub fn train(
    py: Python<'_>,
    options: Options,
    progress: Option<Py<PyAny>>,
) -> PyResult<(PyNetwork, f64)> {
    let (trained, _) = watched(py, progress, |watcher| {
        let options: TrainOptions = jobs::options_of(named(&options))?;
        jobs::train(options, watcher)
    })?;
    Ok((PyNetwork(trained.network), trained.held_out_loss))
}

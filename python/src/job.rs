//! Jobs: in memory, step by step, and in folders.

use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use willmore::jobs::{self, Job, Opened, Results, StepState, Steps, settings};
use willmore::prelude as w;

use crate::error::{Error, detached, in_python, of_job, raised};
use crate::input::Input;
use crate::shape::{FieldArray, PyShape, field_array};
use crate::watcher::watched;

/// Options by the names of the library. None stands for a flag.
pub type Options = Vec<(String, Option<String>)>;

/// Options as the library reads them.
pub fn named(options: &Options) -> impl Iterator<Item = (&str, Option<String>)> {
    options.iter().map(|(name, value)| (&**name, value.clone()))
}

/// A job from its name, its options, and the mask of an inpainting.
fn job(name: &str, input: &Input, options: &Options, mask: Option<&Input>) -> PyResult<Job> {
    let mut job = Job::of_named(name, named(options)).map_err(of_job)?;
    job.input().input = Some(input.0.clone());
    if let Job::Inpaint(inpaint) = &mut job {
        inpaint.mask = mask.map(|mask| mask.0.clone());
    } else if mask.is_some() {
        let message =
            format!("`mask` is the region of `inpaint`, and the job is {name}: leave it out");
        return Err(Error::new_err(message));
    }
    Ok(job)
}

pub fn json(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| raised(&error))
}

/// The results of a job.
#[pyclass(frozen, module = "willmore._willmore", name = "Results")]
pub struct PyResults {
    results: Results,
    #[pyo3(get)]
    warnings: Vec<String>,
    #[pyo3(get)]
    notes: Vec<String>,
}

impl PyResults {
    /// What may have gone wrong is told with what was told before.
    fn new(results: Results, mut warnings: Vec<String>, notes: Vec<String>) -> Self {
        warnings.extend(results.summary().doubts().into_iter().map(in_python));
        Self {
            results,
            warnings,
            notes,
        }
    }
}

#[pymethods]
impl PyResults {
    /// What is known of the run, as JSON.
    #[getter]
    fn report(&self) -> PyResult<String> {
        json(self.results.summary())
    }

    /// Energies, sizes and costs of every step, as JSON.
    #[getter]
    fn records(&self) -> PyResult<String> {
        json(&self.results.records())
    }

    /// The rule that ended the run.
    #[getter]
    fn ended(&self) -> Option<String> {
        let ended = match &self.results {
            Results::Plane(made) => &made.ended,
            Results::Space(made) => &made.ended,
        };
        ended.as_ref().map(ToString::to_string)
    }

    #[getter]
    fn shape(&self) -> PyShape {
        PyShape(self.results.shape().cloned())
    }

    #[getter]
    fn field<'py>(&self, py: Python<'py>) -> PyResult<FieldArray<'py>> {
        match &self.results {
            Results::Plane(made) => field_array(py, &made.field),
            Results::Space(made) => field_array(py, &made.field),
        }
    }
}

/// Does a job in memory.
#[pyfunction]
#[pyo3(signature = (name, input, options, progress=None, mask=None))]
pub fn run(
    py: Python<'_>,
    name: &str,
    input: &Input,
    options: Options,
    progress: Option<Py<PyAny>>,
    mask: Option<&Input>,
) -> PyResult<PyResults> {
    let job = job(name, input, &options, mask)?;
    let (results, watcher) = watched(py, progress, |watcher| jobs::run_in_memory(job, watcher))?;
    Ok(PyResults::new(results, watcher.warnings(), watcher.notes()))
}

/// The labels of a segmentation but 0, of which there must be some. It is read with these options of `fair`.
#[pyfunction]
pub fn labels(py: Python<'_>, input: &Input, options: Options) -> PyResult<Vec<i64>> {
    let options: jobs::FairOptions = jobs::options_of(named(&options)).map_err(of_job)?;
    let options = jobs::InputOptions {
        input: Some(input.0.clone()),
        label: Some(w::Label::All),
        ..options.input
    };
    let labels = detached(py, || jobs::labels(&options).map_err(of_job))?;
    Ok(labels.unwrap_or_default())
}

/// Does a job in a folder, and returns what came out, as JSON. Interrupted, it can be resumed.
#[pyfunction]
#[pyo3(signature = (name, input, options, progress=None, mask=None))]
pub fn run_in_folder(
    py: Python<'_>,
    name: &str,
    input: &Input,
    options: Options,
    progress: Option<Py<PyAny>>,
    mask: Option<&Input>,
) -> PyResult<(String, Vec<String>)> {
    let job = job(name, input, &options, mask)?;
    let (outcome, watcher) = watched(py, progress, |watcher| jobs::run_in_folder(job, watcher))?;
    Ok((outcome.to_json().to_string(), watcher.warnings()))
}

/// Continues the run in a folder, perhaps to more steps.
#[pyfunction]
#[pyo3(signature = (folder, steps=None, progress=None))]
pub fn resume(
    py: Python<'_>,
    folder: &str,
    steps: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, Vec<String>)> {
    let (outcome, watcher) = watched(py, progress, |watcher| {
        let stored = w::RunDirectory::open(folder)?;
        let mut job = settings::job_of(&stored)?;
        // A run that was over may have written the file of `save` itself.
        job.run().force.force |= stored.is_finished();
        jobs::resume(job, stored, steps, watcher)
    })?;
    Ok((outcome.to_json().to_string(), watcher.warnings()))
}

/// A job that makes a step when it is asked for one.
#[pyclass(frozen, module = "willmore._willmore", name = "Steps")]
pub struct PySteps {
    steps: Mutex<Steps>,
    #[pyo3(get)]
    dimension: usize,
    #[pyo3(get)]
    warnings: Vec<String>,
    #[pyo3(get)]
    notes: Vec<String>,
}

impl PySteps {
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut Steps) -> PyResult<T> + Send,
    ) -> PyResult<T> {
        detached(py, || {
            act(&mut self.steps.lock().unwrap_or_else(PoisonError::into_inner))
        })
    }
}

#[pymethods]
impl PySteps {
    /// Makes a step, unless the flow is over, and says whether it made one.
    fn step(&self, py: Python<'_>) -> PyResult<bool> {
        self.with(py, |steps| {
            Ok(steps.next().transpose().map_err(of_job)?.is_some())
        })
    }

    /// The number of records so far.
    #[getter]
    fn made(&self, py: Python<'_>) -> PyResult<usize> {
        self.with(py, |steps| Ok(steps.records().len()))
    }

    /// A record, as JSON.
    fn record(&self, py: Python<'_>, number: usize) -> PyResult<Option<String>> {
        self.with(py, |steps| {
            steps.records().get(number).map(json).transpose()
        })
    }

    /// Says when parts or holes have come or gone since it was asked last.
    fn change(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.with(py, |steps| {
            Ok(steps.change().map(|change| in_python(&change.to_string())))
        })
    }

    /// Whether the shape touches the side of the box, or has come so near to it that this ended the flow.
    #[getter]
    fn touches_box(&self, py: Python<'_>) -> PyResult<bool> {
        self.with(py, |steps| {
            Ok(steps.touches_box() || steps.ended() == Some(w::Stop::AtTheSide))
        })
    }

    /// The energy at the beginning, once the first step has measured it.
    #[getter]
    fn first_energy(&self, py: Python<'_>) -> PyResult<Option<f64>> {
        self.with(py, |steps| {
            Ok(steps.records().first().and_then(w::Record::energy_at_rest))
        })
    }

    /// The measures at the beginning, as JSON.
    #[getter]
    fn start(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |steps| json(steps.start()))
    }

    #[getter]
    fn state(&self, py: Python<'_>) -> PyResult<PyState> {
        self.with(py, |steps| Ok(PyState(steps.state())))
    }

    #[getter]
    fn ended(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.with(py, |steps| {
            Ok(steps.ended().as_ref().map(w::Stop::to_string))
        })
    }

    /// The results so far.
    fn results(&self, py: Python<'_>) -> PyResult<PyResults> {
        let results = self.with(py, |steps| steps.results().map_err(of_job))?;
        Ok(PyResults::new(
            results,
            self.warnings.clone(),
            self.notes.clone(),
        ))
    }
}

/// Begins a job whose steps are made one at a time.
#[pyfunction]
#[pyo3(signature = (name, input, options, progress=None))]
pub fn begin(
    py: Python<'_>,
    name: &str,
    input: &Input,
    options: Options,
    progress: Option<Py<PyAny>>,
) -> PyResult<PySteps> {
    let job = job(name, input, &options, None)?;
    let (steps, watcher) = watched(py, progress, |watcher| jobs::begin(job, watcher))?;
    Ok(PySteps {
        dimension: steps.dimension(),
        steps: Mutex::new(steps),
        warnings: watcher.warnings(),
        notes: watcher.notes(),
    })
}

/// The shape after a step.
#[pyclass(frozen, module = "willmore._willmore", name = "State")]
pub struct PyState(StepState);

#[pymethods]
impl PyState {
    #[getter]
    fn field<'py>(&self, py: Python<'py>) -> PyResult<FieldArray<'py>> {
        match self.0.field() {
            Opened::Plane(u) => field_array(py, &u),
            Opened::Space(u) => field_array(py, &u),
        }
    }

    #[getter]
    fn shape(&self, py: Python<'_>) -> PyResult<PyShape> {
        detached(py, || self.0.shape().map(PyShape).map_err(of_job))
    }
}

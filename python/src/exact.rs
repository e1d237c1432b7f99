//! Exact references.

use numpy::{AllowTypeChange, PyArray1, PyArray2, PyArrayLike2, PyArrayMethods};
use pyo3::prelude::*;
use reference::equilibria::{self, Branch};
use reference::{Accuracy, Curve, Flow, Shape, planar, revolution};

use crate::error::{Error, detached, raised};

fn flow(name: &str) -> PyResult<Flow> {
    match name {
        "willmore" => Ok(Flow::Willmore),
        "mean-curvature" => Ok(Flow::MeanCurvature),
        _ => Err(Error::new_err(format!(
            "`flow` {name:?} is unknown: give \"willmore\" or \"mean-curvature\""
        ))),
    }
}

fn accuracy(usual: Accuracy, tolerance: Option<f64>) -> Accuracy {
    Accuracy {
        tolerance: tolerance.unwrap_or(usual.tolerance),
        ..usual
    }
}

/// The shape that an exact flow begins with.
#[pyclass(frozen, module = "willmore._willmore", name = "ExactShape")]
pub struct PyExactShape(Shape);

impl PyExactShape {
    fn new(shape: Result<Shape, reference::Error>) -> PyResult<Self> {
        shape.map(Self).map_err(|error| raised(&error))
    }
}

#[pymethods]
impl PyExactShape {
    #[staticmethod]
    fn circle(centre: [f64; 2], radius: f64) -> PyResult<Self> {
        Self::new(Shape::circle(centre, radius))
    }

    #[staticmethod]
    fn ellipse(a: f64, b: f64) -> PyResult<Self> {
        Self::new(Shape::ellipse(a, b))
    }

    #[staticmethod]
    fn rectangle(half_width: f64, half_height: f64) -> PyResult<Self> {
        Self::new(Shape::rectangle(half_width, half_height))
    }

    #[staticmethod]
    fn cross(half_length: f64, half_width: f64) -> PyResult<Self> {
        Self::new(Shape::cross(half_length, half_width))
    }

    #[staticmethod]
    fn polygon(points: Points<'_>) -> PyResult<Self> {
        Self::new(Shape::polygon(rows(&points)?))
    }

    #[staticmethod]
    fn smooth(points: Points<'_>) -> PyResult<Self> {
        Self::new(Shape::smooth(&rows(&points)?))
    }
}

/// An array of numbers, or what numpy makes one of.
type Points<'py> = PyArrayLike2<'py, f64, AllowTypeChange>;

fn rows(points: &Points<'_>) -> PyResult<Vec<[f64; 2]>> {
    let points = points.as_array();
    if points.ncols() != 2 {
        return Err(Error::new_err(format!(
            "points must be an array of shape (n, 2), not {:?}",
            points.dim()
        )));
    }
    Ok(points.rows().into_iter().map(|x| [x[0], x[1]]).collect())
}

fn points<'py>(py: Python<'py>, curve: &Curve) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let points = curve.points();
    PyArray1::from_slice(py, points.as_flattened()).reshape([points.len(), 2])
}

/// A plane curve at a time.
#[pyclass(frozen, module = "willmore.exact", name = "Curve")]
pub struct PyCurve(Curve);

#[pymethods]
impl PyCurve {
    #[getter]
    fn time(&self) -> f64 {
        self.0.time()
    }

    #[getter]
    fn length(&self) -> f64 {
        self.0.length()
    }

    #[getter]
    fn area(&self) -> f64 {
        self.0.area()
    }

    #[getter]
    fn energy(&self) -> f64 {
        self.0.energy()
    }

    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        points(py, &self.0)
    }
}

/// A surface of revolution about the y axis at a time.
#[pyclass(frozen, module = "willmore.exact", name = "Surface")]
pub struct PySurface(revolution::Surface);

#[pymethods]
impl PySurface {
    #[getter]
    fn time(&self) -> f64 {
        self.0.time()
    }

    #[getter]
    fn area(&self) -> f64 {
        self.0.area()
    }

    #[getter]
    fn volume(&self) -> f64 {
        self.0.volume()
    }

    #[getter]
    fn energy(&self) -> f64 {
        self.0.energy()
    }

    #[getter]
    fn reduced_volume(&self) -> f64 {
        self.0.reduced_volume()
    }

    #[getter]
    fn profile<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        points(py, self.0.profile())
    }
}

/// A vesicle in equilibrium.
#[pyclass(frozen, module = "willmore.exact", name = "Vesicle")]
pub struct PyVesicle(equilibria::Vesicle);

#[pymethods]
impl PyVesicle {
    #[getter]
    fn surface(&self) -> PySurface {
        PySurface(self.0.surface.clone())
    }

    #[getter]
    fn energy(&self) -> f64 {
        self.0.energy()
    }

    #[getter]
    fn spontaneous_curvature(&self) -> f64 {
        self.0.spontaneous_curvature
    }

    #[getter]
    fn pressure(&self) -> f64 {
        self.0.pressure
    }

    #[getter]
    fn tension(&self) -> f64 {
        self.0.tension
    }
}

#[pyfunction]
#[pyo3(signature = (shape, times, flow, tolerance=None))]
pub fn exact_curves(
    py: Python<'_>,
    shape: &PyExactShape,
    times: Vec<f64>,
    flow: &str,
    tolerance: Option<f64>,
) -> PyResult<Vec<PyCurve>> {
    let (flow, accuracy) = (self::flow(flow)?, accuracy(planar::ACCURACY, tolerance));
    let curves = detached(py, || {
        planar::evolve(&shape.0, flow, &times, &accuracy).map_err(|error| raised(&error))
    })?;
    Ok(curves.into_iter().map(PyCurve).collect())
}

#[pyfunction]
#[pyo3(signature = (shape, times, flow, tolerance=None))]
pub fn exact_surfaces(
    py: Python<'_>,
    shape: &PyExactShape,
    times: Vec<f64>,
    flow: &str,
    tolerance: Option<f64>,
) -> PyResult<Vec<PySurface>> {
    let (flow, accuracy) = (self::flow(flow)?, accuracy(revolution::ACCURACY, tolerance));
    let surfaces = detached(py, || {
        revolution::evolve(&shape.0, flow, &times, &accuracy).map_err(|error| raised(&error))
    })?;
    Ok(surfaces.into_iter().map(PySurface).collect())
}

#[pyfunction]
pub fn exact_vesicles(
    py: Python<'_>,
    reduced_volumes: Vec<f64>,
    branch: &str,
    spontaneous_curvature: f64,
) -> PyResult<Vec<PyVesicle>> {
    let branch = match branch {
        "prolate" => Branch::Prolate,
        "oblate" => Branch::Oblate,
        "stomatocyte" => Branch::Stomatocyte,
        _ => {
            return Err(Error::new_err(format!(
                "`branch` {branch:?} is unknown: give \"prolate\", \"oblate\" or \"stomatocyte\""
            )));
        }
    };
    let vesicles = detached(py, || {
        equilibria::vesicles(branch, spontaneous_curvature, &reduced_volumes)
            .map_err(|error| raised(&error))
    })?;
    Ok(vesicles.into_iter().map(PyVesicle).collect())
}

//! Shapes and fields as arrays of numpy.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use willmore::jobs::Shape;
use willmore::prelude as w;

use crate::error::{Error, detached, of_job, raised};
use crate::input::{field, mesh};

/// A curve or a surface, with nothing of either where it has vanished.
#[pyclass(frozen, module = "willmore._willmore", name = "Shape")]
pub struct PyShape(pub Option<Shape>);

#[pymethods]
impl PyShape {
    /// Vertices and faces of a surface.
    #[getter]
    fn mesh<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<Option<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>)>> {
        let mesh = self.0.as_ref().and_then(Shape::mesh);
        mesh.map(|mesh| arrays(py, mesh)).transpose()
    }

    /// The pixels of the picture of a curve, with four bytes each, and its size.
    #[getter]
    fn picture<'py>(&self, py: Python<'py>) -> Option<(Bound<'py, PyArray1<u8>>, [u32; 2])> {
        match &self.0 {
            Some(Shape::Curve(curve)) => {
                let pixels = curve.picture.pixels().concat();
                Some((PyArray1::from_vec(py, pixels), curve.picture.size()))
            }
            _ => None,
        }
    }

    /// The bytes of a file. Of a mesh that came in as arrays there are only the triangles, and not the marks of the vertices that stay.
    fn encode<'py>(
        &self,
        py: Python<'py>,
        format: &str,
        of_arrays: bool,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let Some(shape) = &self.0 else {
            return Err(Error::new_err(
                "the shape has vanished: there is nothing to save",
            ));
        };
        if let (Shape::Surface(surface), true) = (shape, of_arrays) {
            let name = format!("mesh.{format}");
            let bytes = surfaces::encode_with_up(name, &surface.mesh, surface.up);
            return Ok(PyBytes::new(py, &bytes.map_err(|error| raised(&error))?));
        }
        Ok(PyBytes::new(py, &shape.encode(format).map_err(of_job)?))
    }
}

/// A phase field as a flat array, its cells along each side, its spacing and its origin.
pub type FieldArray<'py> = (Bound<'py, PyArray1<f64>>, usize, f64, Vec<f64>);

pub fn field_array<'py, const D: usize>(
    py: Python<'py>,
    u: &w::Stored<D>,
) -> PyResult<FieldArray<'py>> {
    let grid = *u.grid();
    let field = detached(py, || u.field().map_err(|error| raised(&error)))?;
    let values = PyArray1::from_vec(py, field.into_values());
    Ok((values, grid.cells(), grid.spacing(), grid.origin().to_vec()))
}

pub fn arrays<'py>(
    py: Python<'py>,
    mesh: &w::TriangleMesh,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>)> {
    let vertices = PyArray1::from_slice(py, mesh.vertices.as_flattened());
    let faces = PyArray1::from_slice(py, mesh.faces.as_flattened());
    Ok((
        vertices.reshape([mesh.vertices.len(), 3])?,
        faces.reshape([mesh.faces.len(), 3])?,
    ))
}

/// Vertices and faces of a file.
#[pyfunction]
pub fn read_mesh<'py>(
    py: Python<'py>,
    path: &str,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>)> {
    let mesh = detached(py, || surfaces::read(path).map_err(|error| raised(&error)))?;
    arrays(py, &mesh)
}

fn closed(mesh: w::TriangleMesh) -> PyResult<w::ClosedMesh> {
    let closed = w::ClosedMesh::new(mesh).map_err(|error| raised(&error))?;
    Ok(closed.0)
}

/// The signed distances of points from a closed mesh, negative inside.
#[pyfunction]
pub fn signed_distances<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArray2<'py, f64>,
    faces: PyReadonlyArray2<'py, u32>,
    points: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let mesh = mesh(&vertices, &faces);
    let points = points.as_array();
    let points: Vec<[f64; 3]> = points
        .rows()
        .into_iter()
        .map(|x| [x[0], x[1], x[2]])
        .collect();
    let distances = detached(py, move || {
        Ok(surfaces::MeshDistance::new(&closed(mesh)?).signed_distances(&points))
    })?;
    Ok(PyArray1::from_vec(py, distances))
}

/// A closed mesh of one that bounds nothing, and what was changed, in words.
#[pyfunction]
pub fn repair<'py>(
    py: Python<'py>,
    input: &crate::input::Input,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>, String)> {
    let repaired = detached(py, || willmore::jobs::repair(&input.0).map_err(of_job))?;
    let (vertices, faces) = arrays(py, repaired.mesh.mesh())?;
    Ok((vertices, faces, repaired.changes.to_string()))
}

/// The closed curves that are the zero level of a field in the plane.
#[pyfunction]
pub fn zero_curves<'py>(
    py: Python<'py>,
    values: PyReadonlyArray2<'py, f64>,
    spacing: f64,
    origin: [f64; 2],
) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
    let cells = values.as_array().nrows();
    let field = field(
        cells,
        spacing,
        origin,
        values.as_array().iter().copied().collect(),
    )?;
    let outline = images::Outline::of_phase_field(&field).map_err(|error| raised(&error))?;
    let curves = outline.curves().iter().map(|curve| {
        let points: Vec<[f64; 2]> = curve.points.clone();
        PyArray1::from_slice(py, points.as_flattened()).reshape([points.len(), 2])
    });
    curves.collect()
}

/// The closed surface that is the zero level of a field in space.
#[pyfunction]
pub fn zero_surface<'py>(
    py: Python<'py>,
    values: PyReadonlyArray3<'py, f64>,
    spacing: f64,
    origin: [f64; 3],
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>)> {
    let cells = values.as_array().dim().0;
    // A surface is where distances are zero, which are negative inside.
    let distances = values.as_array().iter().map(|u| -u).collect();
    let field = field(cells, spacing, origin, distances)?;
    let mesh = detached(py, || {
        surfaces::isosurface(&field).map_err(|error| raised(&error))
    })?;
    arrays(py, &mesh)
}

//! Arrays of numpy as inputs.

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use willmore::prelude as w;

use crate::error::{of_job, raised};
use crate::volume::Values;

/// The input of a job.
#[pyclass(frozen, module = "willmore._willmore")]
pub struct Input(pub w::Input);

#[pymethods]
impl Input {
    /// A file, a built-in shape or a region by its name.
    #[staticmethod]
    fn named(name: &str) -> Self {
        Self(name.into())
    }

    /// A mesh of triangles. With `fixed`, the vertices that stay are red.
    #[staticmethod]
    #[pyo3(signature = (vertices, faces, fixed=None))]
    fn mesh(
        vertices: PyReadonlyArray2<'_, f64>,
        faces: PyReadonlyArray2<'_, u32>,
        fixed: Option<PyReadonlyArray1<'_, bool>>,
    ) -> PyResult<Self> {
        let mesh = mesh(&vertices, &faces);
        if let Some(fixed) = fixed {
            let fixed: Vec<bool> = fixed.as_array().iter().copied().collect();
            return Ok(Self(w::Input::bytes("mesh.ply", coloured(&mesh, &fixed))));
        }
        w::Input::mesh("mesh", &mesh).map(Self).map_err(of_job)
    }

    /// A field in the plane, on a grid of squares from `origin`.
    #[staticmethod]
    fn plane(values: PyReadonlyArray2<'_, f64>, spacing: f64, origin: [f64; 2]) -> PyResult<Self> {
        let cells = values.shape()[0];
        let values = values.as_array().iter().copied().collect();
        let field = field(cells, spacing, origin, values)?;
        Ok(Self(w::Input::plane_field("field", field)))
    }

    /// A field in space, on a grid of cubes from `origin`.
    #[staticmethod]
    fn space(values: PyReadonlyArray3<'_, f64>, spacing: f64, origin: [f64; 3]) -> PyResult<Self> {
        let cells = values.shape()[0];
        let values = values.as_array().iter().copied().collect();
        let field = field(cells, spacing, origin, values)?;
        Ok(Self(w::Input::space_field("field", field)))
    }

    /// A picture of rows from the top, each pixel with red, green, blue and opacity.
    #[staticmethod]
    fn picture(pixels: PyReadonlyArray3<'_, u8>) -> PyResult<Self> {
        let picture = picture(&pixels)?;
        w::Input::picture("image", &picture)
            .map(Self)
            .map_err(of_job)
    }

    /// The values of voxels, and the map from their indices to positions.
    #[staticmethod]
    fn volume(size: [usize; 3], affine: [[f64; 4]; 3], values: Values<'_>) -> PyResult<Self> {
        let volume = w::Volume::of_values(size, affine, &values.owned());
        let volume = volume.map_err(|error| raised(&error))?;
        Ok(Self(w::Input::volume("volume", volume)))
    }
}

pub fn mesh(
    vertices: &PyReadonlyArray2<'_, f64>,
    faces: &PyReadonlyArray2<'_, u32>,
) -> w::TriangleMesh {
    let (vertices, faces) = (vertices.as_array(), faces.as_array());
    w::TriangleMesh {
        vertices: vertices
            .rows()
            .into_iter()
            .map(|x| [x[0], x[1], x[2]])
            .collect(),
        faces: faces
            .rows()
            .into_iter()
            .map(|f| [f[0], f[1], f[2]])
            .collect(),
        normals: None,
    }
}

pub fn picture(pixels: &PyReadonlyArray3<'_, u8>) -> PyResult<render::Picture> {
    let shape = pixels.shape();
    let pixels = pixels.as_array();
    let all: Vec<u8> = pixels.iter().copied().collect();
    let (pixels, _) = all.as_chunks::<4>();
    let size = [shape[1], shape[0]].map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    render::Picture::new(size, pixels.to_vec()).map_err(|error| raised(&error))
}

pub fn field<const D: usize>(
    cells: usize,
    spacing: f64,
    origin: [f64; D],
    values: Vec<f64>,
) -> PyResult<w::Field<D>> {
    let grid =
        w::Grid::new(cells, cells as f64 * spacing).and_then(|grid| grid.with_origin(origin));
    let field = grid.and_then(|grid| w::Field::from_values(grid, values));
    field.map_err(|error| raised(&error))
}

/// The bytes of a PLY file in which the vertices that stay are red, and all others black.
fn coloured(mesh: &w::TriangleMesh, fixed: &[bool]) -> Vec<u8> {
    let (vertices, faces) = (mesh.vertices.len(), mesh.faces.len());
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty double x\nproperty double y\nproperty double z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nelement face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
    )
    .into_bytes();
    for (x, &fixed) in mesh.vertices.iter().zip(fixed) {
        bytes.extend(x.iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend([if fixed { 255 } else { 0 }, 0, 0]);
    }
    for face in &mesh.faces {
        bytes.push(3);
        bytes.extend(face.iter().flat_map(|v| v.to_le_bytes()));
    }
    bytes
}

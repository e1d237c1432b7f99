//! What comparisons of smoothings of meshes share.

use render::{Scene, View};

use crate::prelude::*;
use crate::surfaces::raster;

/// Factors of Laplacian smoothing.
pub const LAPLACIAN: [f64; 2] = [0.5, 0.0];

/// Root of the mean square distance of the vertices of a mesh to a shape.
pub fn rms_distance(mesh: &TriangleMesh, shape: &dyn SignedDistance<3>) -> f64 {
    let vertices = mesh.vertices.iter();
    let squares = vertices.map(|&x| shape.signed_distance(x).powi(2));
    (squares.sum::<f64>() / mesh.vertices.len() as f64).sqrt()
}

/// A mesh after one round of smoothing, after two, and so on.
pub fn rounds(mesh: &TriangleMesh, [lambda, mu]: [f64; 2]) -> impl Iterator<Item = TriangleMesh> {
    let round = move |mesh: &TriangleMesh| Some(mesh.smoothed(1, lambda, mu));
    std::iter::successors(round(mesh), round)
}

/// A picture of a mesh in a frame.
pub fn mesh_raster(
    mesh: &TriangleMesh,
    up: UpAxis,
    frame: BoundingBox<3>,
    caption: impl Into<String>,
) -> Result<Raster> {
    let scene = (Scene::of_mesh(mesh.clone()).within(frame)).view(View::from_front_left(up));
    Ok(raster(&scene.render([420; 2])?, caption))
}

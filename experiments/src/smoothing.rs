//! What comparisons of smoothings of meshes share.

use render::{Scene, View};
use surfaces::Fairing;

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

/// Willmore flow from signed distances as `willmore fair` makes it, without its ends and measures.
pub fn fairing_flow(title: &str, distance: Field<3>) -> Result<Case<3>> {
    let (distance, _) = surfaces::mend_signs(Stored::whole(distance));
    let (grid, spacing) = (*distance.grid(), distance.grid().spacing());
    let scales = Scales::of_grid(spacing, 2.0);
    let initial = distance.map(|s| optimal_profile(s, scales.eps));
    let rule = StepRule::Graded {
        first: Fairing::first_step(spacing),
        part: Fairing::GROWTH,
    };
    let mut operator = operator(ACCURATE, &grid, &scales)?;
    operator.storage = Storage::Auto;
    Ok(Case::willmore(title, initial, operator, scales, rule, 0))
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

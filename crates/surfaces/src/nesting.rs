//! How the parts of a surface lie in each other.

use std::f64::consts::PI;

use geometry::measure::BoundingBox;
use rayon::prelude::*;

use crate::TriangleMesh;
use crate::hierarchy::{Hierarchy, bounds};
use crate::triangle::Triangle;
use crate::vector::{Vector, solid_angle};

/// About so many points, the solid angles of all faces are sooner found than a hierarchy of them.
const FEW: usize = 16;
/// Rays that are tried one after the other. No lattice has planes along them.
const DIRECTIONS: [Vector; 3] = [
    Vector::new(0.592371684218357, 0.388197432651927, 0.705972115836471),
    Vector::new(-0.471836190527413, 0.823041775936258, 0.316190472853691),
    Vector::new(0.289417506183725, -0.640728351946172, 0.711130628471593),
];
/// Below this part of the product of lengths, the sign of a product of vectors is rounding.
const ROUNDING: f64 = 1e-12;

/// A part in whose box a point is.
pub(crate) struct Winding {
    pub(crate) part: usize,
    /// How often the part winds about the point.
    pub(crate) number: f64,
}

/// For the first vertex of every part, the winding numbers of the other parts in whose box it is, in the order of the parts.
///
/// There may be many parts in one with many faces, such as pinholes in an organ.
pub(crate) fn windings(mesh: &TriangleMesh, parts: &[Vec<[u32; 3]>]) -> Vec<Vec<Winding>> {
    let first = |faces: &Vec<[u32; 3]>| Vector::from_array(mesh.vertices[faces[0][0] as usize]);
    let points: Vec<Vector> = parts.iter().map(first).collect();
    let places: Vec<Triangle> = points.iter().map(|&x| [x; 3]).collect();
    let (places, order) = Hierarchy::new(&places);
    let numbers = parts.par_iter().enumerate().map(|(part, faces)| {
        let triangles: Vec<Triangle> = faces.iter().map(|&face| mesh.corners(face)).collect();
        let bounds = bounds(&triangles);
        let mut within: Vec<usize> = Vec::new();
        places.any_touching(&bounds, &mut |place| {
            let other = order[place];
            let is_within = other != part && bounds.contains(points[other].to_array());
            within.extend(is_within.then_some(other));
            false
        });
        let solid = Solid::new(triangles, within.len());
        let number = |&other: &usize| (other, solid.winding(points[other]));
        within.par_iter().map(number).collect::<Vec<_>>()
    });
    let numbers: Vec<_> = numbers.collect();
    let mut windings: Vec<Vec<Winding>> = parts.iter().map(|_| Vec::new()).collect();
    for (part, of_others) in numbers.into_iter().enumerate() {
        for (other, number) in of_others {
            windings[other].push(Winding { part, number });
        }
    }
    windings
}

/// For every part, the others around it, however they are oriented.
pub(crate) fn enclosing(mesh: &TriangleMesh, parts: &[Vec<[u32; 3]>]) -> Vec<Vec<usize>> {
    let around = |windings: &Vec<Winding>| {
        let around = windings.iter().filter(|winding| winding.number.abs() > 0.5);
        around.map(|winding| winding.part).collect::<Vec<_>>()
    };
    windings(mesh, parts).iter().map(around).collect()
}

/// A closed surface that is asked for winding numbers.
struct Solid {
    triangles: Vec<Triangle>,
    tree: Option<Hierarchy>,
}

impl Solid {
    /// For so many points.
    fn new(triangles: Vec<Triangle>, points: usize) -> Self {
        let tree = (points > FEW).then(|| Hierarchy::new(&triangles).0);
        Self { triangles, tree }
    }

    fn winding(&self, x: Vector) -> f64 {
        let along_rays = |tree: &Hierarchy| {
            let mut directions = DIRECTIONS.into_iter();
            directions.find_map(|direction| along_ray(tree, Ray { from: x, direction }))
        };
        let found = self.tree.as_ref().and_then(along_rays);
        found.unwrap_or_else(|| by_solid_angles(&self.triangles, x))
    }
}

/// The winding number about any point; on the surface it is not whole.
fn by_solid_angles(triangles: &[Triangle], x: Vector) -> f64 {
    let seen = triangles.iter().map(|t| solid_angle(t.map(|v| v - x)));
    seen.sum::<f64>() / (4.0 * PI)
}

/// The winding number about the start of a ray: how often it leaves the solid, less how often it enters it. None if rounding decides about a triangle,
/// as it does about those that the start is on.
fn along_ray(tree: &Hierarchy, ray: Ray) -> Option<f64> {
    let mut sum = 0;
    let is_unknown = tree.any_meeting(
        &|bounds: &BoundingBox<3>| ray.meets(bounds),
        &mut |triangle| {
            let leaves = ray.leaves_by(&tree.triangles[triangle]);
            sum += leaves.unwrap_or_default();
            leaves.is_none()
        },
    );
    (!is_unknown).then_some(f64::from(sum))
}

#[derive(Clone, Copy)]
struct Ray {
    from: Vector,
    /// A unit vector up to some digits, without zeros.
    direction: Vector,
}

impl Ray {
    /// Whether it meets a box, or passes by within rounding.
    fn meets(self, bounds: &BoundingBox<3>) -> bool {
        let ends = [bounds.lower, bounds.upper];
        let [a, b] = ends.map(|end| (Vector::from_array(end) - self.from) / self.direction);
        let near = a.min(b).max_element().max(0.0);
        let far = a.max(b).min_element();
        near <= far * (1.0 + ROUNDING)
    }

    /// 1 if it passes the triangle to the side of its normal, -1 if to the other side, and 0 if it passes by; none if rounding decides.
    fn leaves_by(self, triangle: &Triangle) -> Option<i32> {
        let [a, b, c] = triangle.map(|corner| corner - self.from);
        let lengths = [a, b, c].map(Vector::length);
        // On which side of each edge the line of the ray is.
        let sides = [
            sign(self.direction.dot(a.cross(b)), lengths[0] * lengths[1]),
            sign(self.direction.dot(b.cross(c)), lengths[1] * lengths[2]),
            sign(self.direction.dot(c.cross(a)), lengths[2] * lengths[0]),
        ];
        if sides.contains(&1) && sides.contains(&-1) {
            return Some(0);
        }
        let corners = [a, b, c].into_iter().zip(lengths);
        let mut ahead = corners.map(|(corner, length)| sign(self.direction.dot(corner), length));
        if ahead.all(|side| side == -1) {
            return Some(0);
        }
        let height = sign(a.dot(b.cross(c)), lengths.iter().product());
        if height == 0 || sides.contains(&0) {
            return None;
        }
        // Behind the start, the plane is passed from the side on which the start is.
        Some(if height == sides[0] { height } else { 0 })
    }
}

/// The sign of a product of vectors with this product of lengths; 0 within rounding.
fn sign(product: f64, lengths: f64) -> i32 {
    let rounding = ROUNDING * lengths;
    i32::from(product > rounding) - i32::from(product < -rounding)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    /// Points in the box of a surface, and those of its vertices.
    fn points(triangles: &[Triangle]) -> Vec<Vector> {
        let bounds = bounds(triangles);
        let [lower, upper] = [bounds.lower, bounds.upper].map(Vector::from_array);
        let steps = (0..1000).map(|n: i32| [n % 10, n / 10 % 10, n / 100].map(f64::from));
        let inside = steps.map(|step| lower + (upper - lower) * Vector::from_array(step) / 9.0);
        let vertices = triangles.iter().step_by(triangles.len() / 50);
        inside.chain(vertices.map(|t| t[0])).collect()
    }

    /// Of a lattice that rays could graze, and of a smooth surface.
    #[test]
    fn rays_find_the_winding_numbers_of_solid_angles() {
        let voxels = |node: usize| {
            let place = [node / 400, node / 20 % 20, node % 20];
            let is_inside = place.iter().all(|i| (3..16).contains(i));
            let is_hole = place.iter().all(|i| (7..11).contains(i));
            if is_inside && !is_hole { -0.5 } else { 0.5 }
        };
        let values: Vec<f64> = (0..8000).map(voxels).collect();
        let lattice = crate::lattice_surface([20; 3], &values).unwrap();
        let smooth = samples::lever(48).unwrap().into_mesh();
        for mesh in [lattice, smooth] {
            let corners = mesh.faces.iter().map(|&face| mesh.corners(face));
            let solid = Solid::new(corners.collect(), FEW + 1);
            for x in points(&solid.triangles) {
                let exact = by_solid_angles(&solid.triangles, x);
                let found = solid.winding(x);
                assert!((found - exact).abs() < 1e-9, "{x}: {found} for {exact}");
            }
        }
    }

    #[test]
    fn a_ray_looks_at_few_triangles() {
        let mesh = samples::lever(96).unwrap().into_mesh();
        let corners = mesh.faces.iter().map(|&face| mesh.corners(face));
        let solid = Solid::new(corners.collect(), FEW + 1);
        let (tree, mut looked_at) = (solid.tree.as_ref().unwrap(), 0);
        let points = points(&solid.triangles);
        for &from in &points {
            let direction = DIRECTIONS[0];
            let ray = Ray { from, direction };
            tree.any_meeting(&|bounds: &BoundingBox<3>| ray.meets(bounds), &mut |_| {
                looked_at += 1;
                false
            });
        }
        let all = mesh.faces.len() * points.len();
        assert!(20 * looked_at < all, "{looked_at} of {all}");
    }
}

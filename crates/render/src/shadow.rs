//! How much of the light arrives at the vertices of a surface.
//!
//! The subject is drawn from every direction that light comes from, as parallel rays see it, and a
//! vertex is in the light of a direction unless something is nearer. What is drawn are the faces
//! that the light leaves a body through, so that no body casts a shadow on its own lit side by
//! rounding (L. Williams: Casting curved shadows on curved surfaces, 1978).

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use crate::light::{Lights, all_around};
use crate::model::{Model, Vertex};
use crate::raster::Triangle;

/// Maps that are kept at a time.
const AT_ONCE: usize = 16;
/// Lookups start this far from the surface, in pixels of a map.
const OFFSET: f64 = 0.75;
/// Vertices in a cube of so many pixels of a map are one for it, where it does not tell most of them apart.
const CLUSTER: f64 = 0.5;

/// For every vertex the visible part of the key light and the arriving part of the surroundings'
/// light, from 0 to 1, given the numbers of directions to look in and the pixels a side of a map.
pub(crate) fn arriving(
    model: &Model,
    lights: &Lights,
    [sky, key]: [usize; 2],
    map_side: usize,
) -> Vec<[f64; 2]> {
    // Vertices of no triangle are not seen.
    let corners = || model.triangles.as_flattened().iter();
    let places = || corners().map(|&vertex| model.vertices[vertex as usize].place);
    let low = places().fold(DVec3::INFINITY, DVec3::min);
    let high = places().fold(DVec3::NEG_INFINITY, DVec3::max);
    let (centre, radius) = (low.midpoint(high), 0.5 * low.distance(high));
    let clusters = Clusters::of(model, CLUSTER * 2.0 * radius / map_side as f64);
    let model = clusters.as_ref().map_or(model, |clusters| &clusters.model);
    let parts = |directions: &[DVec3], weight: &(dyn Fn(DVec3, DVec3) -> f64 + Sync)| {
        // Light that arrives, and that would without obstacles.
        let mut sums = vec![[0.0, 0.0]; model.vertices.len()];
        for directions in directions.chunks(AT_ONCE) {
            let maps: Vec<Map> = directions
                .par_iter()
                .map(|&towards| Map::new(model, centre, radius, towards, map_side))
                .collect();
            let vertices = sums.par_iter_mut().zip(&model.vertices);
            vertices.for_each(|([lit, all], vertex)| {
                for map in &maps {
                    let weight = weight(vertex.normal, map.towards);
                    if weight > 0.0 {
                        *all += weight;
                        *lit += weight * map.visibility(vertex.place, vertex.normal);
                    }
                }
            });
        }
        sums.into_iter()
            .map(|[lit, all]| if all > 0.0 { lit / all } else { 0.0 })
            .collect::<Vec<f64>>()
    };
    let key = parts(&lights.towards_key(key), &|n, d| {
        f64::from(u8::from(n.dot(d) > 0.0))
    });
    let sky = parts(&all_around(sky), &|n, d| {
        n.dot(d).max(0.0) * lights.radiance(d)
    });
    let arriving: Vec<[f64; 2]> = (key.into_iter().zip(sky))
        .map(|(key, open)| [key, open])
        .collect();
    match &clusters {
        Some(clusters) => clusters
            .of_vertices
            .iter()
            .map(|&c| arriving[c as usize])
            .collect(),
        None => arriving,
    }
}

/// Groups of vertices that are so near to each other that a map does not tell them apart.
struct Clusters {
    /// A vertex for each group, in the middle of them, and the triangles between different groups.
    model: Model,
    /// The group of each vertex.
    of_vertices: Vec<u32>,
}

impl Clusters {
    /// Those in a cube of this side that look to the same one of its six sides; none if they are more than half as many as the vertices.
    fn of(model: &Model, side: f64) -> Option<Self> {
        let mut known = HashMap::new();
        let mut vertices: Vec<Vertex> = Vec::new();
        let mut counts: Vec<f64> = Vec::new();
        let mut of_vertices = Vec::with_capacity(model.vertices.len());
        for &Vertex {
            place,
            normal,
            colour,
        } in &model.vertices
        {
            let cube = (place / side).floor().to_array().map(|v| v as i64);
            let axis = normal.abs().max_position();
            let cluster = *known
                .entry((cube, axis, normal[axis] > 0.0, colour))
                .or_insert_with(|| {
                    counts.push(0.0);
                    vertices.push(Vertex {
                        place: DVec3::ZERO,
                        normal: DVec3::ZERO,
                        colour,
                    });
                    counts.len() - 1
                });
            counts[cluster] += 1.0;
            vertices[cluster].place += place;
            vertices[cluster].normal += normal;
            if 2 * counts.len() > model.vertices.len() {
                return None;
            }
            of_vertices.push(cluster as u32);
        }
        for (vertex, count) in vertices.iter_mut().zip(counts) {
            vertex.place /= count;
            vertex.normal = vertex.normal.normalize_or_zero();
        }
        let triangles = model.triangles.iter();
        let triangles = triangles.map(|corners| corners.map(|v| of_vertices[v as usize]));
        let triangles = triangles
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .collect();
        Some(Self {
            model: Model {
                vertices,
                triangles,
            },
            of_vertices,
        })
    }
}

/// What parallel rays see from one direction.
struct Map {
    towards: DVec3,
    axes: [DVec3; 2],
    centre: DVec3,
    /// In units of length.
    pixel: f64,
    side: usize,
    /// How far towards the light what is nearest to it lies.
    nearest: Vec<f32>,
}

impl Map {
    fn new(model: &Model, centre: DVec3, radius: f64, towards: DVec3, side: usize) -> Self {
        let (a, b) = towards.any_orthonormal_pair();
        let mut map = Self {
            towards,
            axes: [a, b],
            centre,
            pixel: 2.0 * radius / side as f64,
            side,
            nearest: vec![f32::NEG_INFINITY; side * side],
        };
        let places: Vec<[f64; 3]> = (model.vertices.iter())
            .map(|vertex| map.project(vertex.place))
            .collect();
        for triangle in &model.triangles {
            let triangle = Triangle::new(triangle.map(|vertex| places[vertex as usize]));
            // Seen from behind: both axes and the direction are right-handed.
            if triangle.area < 0.0 {
                triangle.scan(side, 0..side, |x, y, near| {
                    let nearest = &mut map.nearest[y * side + x];
                    *nearest = nearest.max(near as f32);
                });
            }
        }
        map
    }

    fn project(&self, place: DVec3) -> [f64; 3] {
        let offset = place - self.centre;
        let [x, y] = self
            .axes
            .map(|axis| offset.dot(axis) / self.pixel + 0.5 * self.side as f64);
        [x, y, offset.dot(self.towards)]
    }

    /// The part of the four pixels around a place that the light passes, weighted as bilinear
    /// interpolation does.
    fn visibility(&self, place: DVec3, normal: DVec3) -> f64 {
        let [x, y, near] = self.project(place + OFFSET * self.pixel * normal);
        let [x, y] = [x - 0.5, y - 0.5];
        let passes = |x: f64, y: f64| {
            let inside = |v: f64| v >= 0.0 && v < self.side as f64;
            let free = !inside(x)
                || !inside(y)
                || f64::from(self.nearest[y as usize * self.side + x as usize]) <= near;
            f64::from(u8::from(free))
        };
        let ([left, low], [s, t]) = ([x.floor(), y.floor()], [x - x.floor(), y - y.floor()]);
        let row = |y: f64| (1.0 - s) * passes(left, y) + s * passes(left + 1.0, y);
        (1.0 - t) * row(low) + t * row(low + 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::View;
    use surfaces::TriangleMesh;

    /// A ball on a floor, in so many steps.
    fn scene(steps: u32) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        let patch = |mesh: &mut TriangleMesh, place: &dyn Fn(f64, f64) -> [f64; 3]| {
            let first = mesh.vertices.len() as u32;
            for i in 0..=steps {
                for j in 0..=steps {
                    let [s, t] = [i, j].map(|k| f64::from(k) / f64::from(steps));
                    mesh.vertices.push(place(s, t));
                }
            }
            for i in 0..steps {
                for j in 0..steps {
                    let a = first + i * (steps + 1) + j;
                    let (b, c) = (a + steps + 1, a + steps + 2);
                    mesh.faces.extend([[a, b, c], [a, c, a + 1]]);
                }
            }
        };
        patch(&mut mesh, &|s, t| [4.0 * s - 2.0, 4.0 * t - 2.0, -1.0]);
        patch(&mut mesh, &|s, t| {
            let (low, round) = (std::f64::consts::PI * (1.0 - s), std::f64::consts::TAU * t);
            [low.sin() * round.cos(), low.sin() * round.sin(), low.cos()].map(|v| 0.6 * v)
        });
        mesh
    }

    #[test]
    fn light_on_fine_meshes_is_that_on_coarser_ones() {
        let lights = Lights::new(&View::default().orientation().unwrap());
        let light = |steps: u32| {
            let model = Model::new(&scene(steps));
            let is_clustered = Clusters::of(&model, CLUSTER * 2.0 * 2.9 / 60.0).is_some();
            (arriving(&model, &lights, [48, 8], 60), is_clustered)
        };
        let ((coarse, few), (fine, many)) = (light(40), light(320));
        assert!(!few && many);
        // Every eighth vertex along both sides of a patch is one of the coarse mesh.
        let place = |k: usize, steps: usize, scale: usize| {
            let side = steps + 1;
            let (patch, rest) = (k / (side * side), k % (side * side));
            let fine_side = steps * scale + 1;
            patch * fine_side * fine_side + (rest / side * scale) * fine_side + rest % side * scale
        };
        let far = |part: usize| {
            let differences =
                (0..coarse.len()).map(|k| (coarse[k][part] - fine[place(k, 40, 8)][part]).abs());
            differences.sum::<f64>() / coarse.len() as f64
        };
        // There is shade, and it is in the same places.
        assert!(coarse.iter().filter(|[key, _]| *key < 0.5).count() > coarse.len() / 20);
        let (key, sky) = (far(0), far(1));
        assert!(key < 0.03 && sky < 0.03, "{key} {sky}");
    }
}

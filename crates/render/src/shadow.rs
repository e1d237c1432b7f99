//! How much of the light arrives at the vertices of a surface.
//!
//! The subject is drawn from every direction that light comes from, as parallel rays see it, and a
//! vertex is in the light of a direction unless something is nearer. What is drawn are the faces
//! that the light leaves a body through, so that no body casts a shadow on its own lit side by
//! rounding (L. Williams: Casting curved shadows on curved surfaces, 1978).

use glam::DVec3;
use rayon::prelude::*;

use crate::light::{Lights, all_around};
use crate::model::Model;
use crate::raster::Triangle;

/// Maps that are kept at a time.
const AT_ONCE: usize = 16;
/// Lookups start this far from the surface, in pixels of a map.
const OFFSET: f64 = 0.75;

/// For every vertex the visible part of the key light and the arriving part of the surroundings'
/// light, from 0 to 1, given the numbers of directions to look in and the pixels a side of a map.
pub(crate) fn arriving(
    model: &Model,
    lights: &Lights,
    [sky, key]: [usize; 2],
    map_side: usize,
) -> Vec<[f64; 2]> {
    let places = || model.vertices.iter().map(|vertex| vertex.place);
    let low = places().fold(DVec3::INFINITY, DVec3::min);
    let high = places().fold(DVec3::NEG_INFINITY, DVec3::max);
    let (centre, radius) = (low.midpoint(high), 0.5 * low.distance(high));
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
    key.into_iter()
        .zip(sky)
        .map(|(key, open)| [key, open])
        .collect()
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

//! Faces that cross other faces.

use std::sync::atomic::{AtomicBool, Ordering};

use derive_more::Display;
use rayon::prelude::*;

use crate::closed::Seams;
use crate::hierarchy::{Hierarchy, bounds};
use crate::triangle::Triangle;
use crate::vector::{Vector, scaled_normal};
use crate::{ClosedMesh, TriangleMesh};

/// Distances from planes below this part of the lengths are rounding.
const ROUNDING: f64 = 1e-12;
/// Triangles that have less than this part of their sides in common touch each other.
const TOUCHING: f64 = 1e-6;

/// Bodies that reach into each other, or share a side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Display)]
#[display(
    "{parts} parts overlap: {faces} faces cross or touch those of another part, such as face {} that of face {}, so that inside and outside are not \
     defined there; unite them",
    first[0], first[1]
)]
pub struct Overlap {
    /// Parts that do.
    pub parts: usize,
    /// Faces of one part that cross, or lie on, those of another.
    pub faces: usize,
    /// The first of them, and one that it crosses.
    pub first: [usize; 2],
}

impl TriangleMesh {
    /// For each face, whether it crosses others, beyond what neighbours have in common.
    pub fn crossing_faces(&self) -> Vec<bool> {
        self.crossing_among(|_, _| true)
    }

    /// The same of those pairs of faces alone that count.
    pub(crate) fn crossing_among(&self, counts: impl Fn(usize, usize) -> bool + Sync) -> Vec<bool> {
        let near = Faces::of(self);
        let crossed: Vec<_> = self.faces.iter().map(|_| AtomicBool::new(false)).collect();
        // Each pair once, beginning with faces that are near each other.
        near.order.par_iter().for_each(|&face| {
            near.any(face, |other| {
                if face < other
                    && counts(face, other)
                    && near.share_less_than_an_edge(face, other)
                    && near.touch(face, other)
                    && near.cross(face, other)
                {
                    for crossed in [&crossed[face], &crossed[other]] {
                        crossed.store(true, Ordering::Relaxed);
                    }
                }
                false
            });
        });
        crossed.into_iter().map(AtomicBool::into_inner).collect()
    }

    /// The faces that cross others and are not among those that did before, and the faces that they cross.
    pub fn newly_crossing(&self, before: &[bool]) -> Vec<bool> {
        let mut new = self.crossing_faces();
        for (new, before) in new.iter_mut().zip(before) {
            *new &= !before;
        }
        if new.contains(&true) {
            self.crossing_among(|a, b| new[a] || new[b])
        } else {
            new
        }
    }

    /// The mesh with those vertices nearer to where they were in `before`, a mesh of the same faces, whose faces cross others now and did not cross any
    /// there: in the end at their old places. So no face crosses others that did not before. If `before` crosses itself in so many places that this leaves
    /// nothing, the result is the one with the fewest faces that cross others, fewer than in `before`.
    pub fn untangled(mut self, before: &Self) -> Self {
        /// Rounds in which such vertices go half of their way back, before they and more and more of their neighbours go all of it.
        const HALVINGS: usize = 4;
        const ROUNDS: usize = 30;
        let count = |crosses: &[bool]| crosses.iter().filter(|crosses| **crosses).count();
        let mut crossed_before = None;
        let mut fewest: Option<(usize, Self)> = None;
        for round in 0..ROUNDS {
            let crosses = self.crossing_faces();
            if !crosses.contains(&true) {
                return self;
            }
            let now = count(&crosses);
            if fewest.as_ref().is_none_or(|(least, _)| now < *least) {
                fewest = Some((now, self.clone()));
            }
            let crossed = crossed_before.get_or_insert_with(|| before.crossing_faces());
            let mut goes_back = vec![false; self.vertices.len()];
            let tangled = (self.faces.iter().zip(&crosses).zip(&*crossed))
                .filter(|((_, now), before)| **now && !**before);
            for ((face, _), _) in tangled {
                mark(&mut goes_back, face);
            }
            if !goes_back.contains(&true) {
                return self;
            }
            for _ in 0..round.saturating_sub(HALVINGS) {
                let near = goes_back.clone();
                for face in self
                    .faces
                    .iter()
                    .filter(|f| f.iter().any(|&v| near[v as usize]))
                {
                    mark(&mut goes_back, face);
                }
            }
            let part = if round < HALVINGS { 0.5 } else { 0.0 };
            let pairs = self
                .vertices
                .iter_mut()
                .zip(&before.vertices)
                .zip(goes_back);
            for ((x, from), _) in pairs.filter(|(_, goes_back)| *goes_back) {
                *x = [0, 1, 2].map(|i| from[i] + part * (x[i] - from[i]));
            }
        }
        let before_them = crossed_before.map_or(0, |crossed| count(&crossed));
        match fewest {
            Some((now, mesh)) if now < before_them => mesh,
            _ => before.clone(),
        }
    }
}

impl ClosedMesh {
    /// The parts that overlap, if some do: where they do, the mesh does not say what is inside.
    pub fn overlap(&self) -> Option<Overlap> {
        if self.components() < 2 {
            return None;
        }
        let seams = Seams::find(self.mesh()).expect("the mesh is closed");
        Overlap::of(self.mesh(), &seams)
    }
}

impl Overlap {
    /// Of the parts of a mesh.
    pub(crate) fn of(mesh: &TriangleMesh, seams: &Seams) -> Option<Self> {
        let part = &seams.component;
        let near = Faces::of(mesh);
        let faces = (0..mesh.faces.len()).into_par_iter();
        let crossed = faces.map(|face| {
            let mut found = None;
            near.any(face, |other| {
                let crosses = part[face] != part[other] && near.overlap(face, other);
                found = crosses.then_some(other);
                crosses
            });
            found
        });
        let crossed: Vec<Option<usize>> = crossed.collect();
        let first = crossed.iter().position(Option::is_some)?;
        let mut parts = vec![false; seams.components];
        for (face, _) in crossed
            .iter()
            .enumerate()
            .filter(|(_, other)| other.is_some())
        {
            parts[part[face] as usize] = true;
        }
        Some(Self {
            parts: parts.iter().filter(|overlaps| **overlaps).count(),
            faces: crossed.iter().flatten().count(),
            first: [first, crossed[first]?],
        })
    }
}

/// The pairs of patches of faces that cross or touch each other, each once or more.
pub(crate) fn touching(mesh: &TriangleMesh, patch: &[usize]) -> Vec<[usize; 2]> {
    let near = Faces::of(mesh);
    let faces = (0..mesh.faces.len()).into_par_iter();
    let pairs = faces.map(|face| {
        let mut found: Vec<[usize; 2]> = Vec::new();
        near.any(face, |other| {
            let pair = [patch[face], patch[other]];
            if pair[0] < pair[1] && !found.contains(&pair) && near.overlap(face, other) {
                found.push(pair);
            }
            false
        });
        found
    });
    pairs.collect::<Vec<_>>().concat()
}

fn mark(marks: &mut [bool], face: &[u32; 3]) {
    for &vertex in face {
        marks[vertex as usize] = true;
    }
}

/// The faces of a mesh, and which of them are near each other.
struct Faces<'a> {
    mesh: &'a TriangleMesh,
    triangles: Vec<Triangle>,
    /// None without faces.
    hierarchy: Option<Hierarchy>,
    /// The faces in the order of the hierarchy.
    order: Vec<usize>,
}

impl<'a> Faces<'a> {
    fn of(mesh: &'a TriangleMesh) -> Self {
        let triangles: Vec<_> = mesh.faces.iter().map(|&face| mesh.corners(face)).collect();
        let ordered = (!triangles.is_empty()).then(|| Hierarchy::new(&triangles));
        let (hierarchy, order) = ordered.unzip();
        Self {
            mesh,
            triangles,
            hierarchy,
            order: order.unwrap_or_default(),
        }
    }

    /// Whether this holds for any face near a face.
    fn any(&self, face: usize, mut holds: impl FnMut(usize) -> bool) -> bool {
        let bounds = bounds([&self.triangles[face]]);
        let mut is_other = |place: usize| {
            let other = self.order[place];
            other != face && holds(other)
        };
        (self.hierarchy.as_ref())
            .is_some_and(|hierarchy| hierarchy.any_touching(&bounds, &mut is_other))
    }

    /// Neighbours across an edge have no more in common, unless they lie on each other.
    fn share_less_than_an_edge(&self, face: usize, other: usize) -> bool {
        let vertices = self.mesh.faces[other];
        let shared = self.mesh.faces[face]
            .iter()
            .filter(|v| vertices.contains(v));
        shared.count() < 2
    }

    /// Whether the boxes around two faces have a point in common.
    fn touch(&self, one: usize, other: usize) -> bool {
        let [one, other] = [one, other].map(|face| {
            let [a, b, c] = self.triangles[face];
            [a.min(b).min(c), a.max(b).max(c)]
        });
        one[0].cmple(other[1]).all() && other[0].cmple(one[1]).all()
    }

    /// Whether both have a piece of the line in common in which their planes meet, and reach to both sides of the other one there.
    fn cross(&self, one: usize, other: usize) -> bool {
        cross(self.triangles[one], self.triangles[other])
    }

    /// Whether they cross, or lie in a plane and on each other.
    fn overlap(&self, one: usize, other: usize) -> bool {
        let [a, b] = [one, other].map(|face| self.triangles[face]);
        self.cross(one, other) || lie_on_each_other(a, b)
    }
}

/// Whether two triangles cross: touching is no crossing. T. Möller: A fast triangle-triangle intersection test. J. Graph. Tools 2 (1997).
fn cross(one: [Vector; 3], other: [Vector; 3]) -> bool {
    let (Some(of_one), Some(of_other)) = (heights(other, one), heights(one, other)) else {
        return false;
    };
    let line = scaled_normal(one)
        .cross(scaled_normal(other))
        .normalize_or_zero();
    let [low, high] = common(piece(one, of_one, line), piece(other, of_other, line));
    high - low > TOUCHING * size(one).min(size(other))
}

/// The heights of the corners of a triangle over the plane of another one, if there are some on both sides.
fn heights(base: [Vector; 3], triangle: [Vector; 3]) -> Option<[f64; 3]> {
    let normal = scaled_normal(base).try_normalize()?;
    let least = ROUNDING * (size(base) + size(triangle) + (triangle[0] - base[0]).length());
    let heights = triangle.map(|x| normal.dot(x - base[0]));
    let heights = heights.map(|height| if height.abs() > least { height } else { 0.0 });
    let is_between = heights.iter().any(|h| *h > 0.0) && heights.iter().any(|h| *h < 0.0);
    is_between.then_some(heights)
}

/// Where along a line the points of height zero of a triangle are.
fn piece(triangle: [Vector; 3], heights: [f64; 3], line: Vector) -> [f64; 2] {
    let mut piece = [f64::INFINITY, f64::NEG_INFINITY];
    for i in 0..3 {
        let j = (i + 1) % 3;
        let (s, t) = (heights[i], heights[j]);
        let point = if s == 0.0 {
            triangle[i]
        } else if s * t < 0.0 {
            triangle[i].lerp(triangle[j], s / (s - t))
        } else {
            continue;
        };
        let place = line.dot(point - triangle[0]) + line.dot(triangle[0]);
        piece = [piece[0].min(place), piece[1].max(place)];
    }
    piece
}

/// What two pieces of a line have in common.
fn common(one: [f64; 2], other: [f64; 2]) -> [f64; 2] {
    [one[0].max(other[0]), one[1].min(other[1])]
}

/// The longest side.
fn size([a, b, c]: [Vector; 3]) -> f64 {
    (b - a).length().max((c - b).length()).max((a - c).length())
}

/// Whether two triangles lie in a plane, and the middle of one, or a side of it, in the other.
fn lie_on_each_other(one: [Vector; 3], other: [Vector; 3]) -> bool {
    let normal = scaled_normal(one);
    let length = normal.length();
    let size = (one[1] - one[0]).length() + (other[1] - other[0]).length();
    let far = |x: &Vector| normal.dot(*x - one[0]).abs() > 1e-9 * length * size;
    if length == 0.0 || other.iter().any(far) {
        return false;
    }
    let unit = normal / length;
    let is_in = |x: Vector, [a, b, c]: [Vector; 3]| {
        let area = scaled_normal([a, b, c]).dot(unit);
        let part = |p: Vector, q: Vector| unit.dot((q - p).cross(x - p)) / area;
        let parts = [part(a, b), part(b, c), part(c, a)];
        area != 0.0 && parts.iter().all(|part| *part > 1e-6)
    };
    let middle = |t: [Vector; 3]| (t[0] + t[1] + t[2]) / 3.0;
    let sides_cross = || {
        let sides = |t: [Vector; 3]| [0, 1, 2].map(|i| [t[i], t[(i + 1) % 3]]);
        let apart = |[p, q]: [Vector; 2], [a, b]: [Vector; 2]| {
            let [s, t] = [a, b].map(|x| unit.dot((q - p).cross(x - p)));
            let least = 1e-6 * (q - p).length() * (b - a).length();
            s.abs() > least && t.abs() > least && (s > 0.0) != (t > 0.0)
        };
        let sides = [sides(one), sides(other)];
        (sides[0].iter()).any(|&p| sides[1].iter().any(|&q| apart(p, q) && apart(q, p)))
    };
    is_in(middle(other), one) || is_in(middle(one), other) || sides_cross()
}

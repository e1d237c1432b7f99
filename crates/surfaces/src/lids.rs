//! Holes of a surface, closed by smooth lids.

use std::collections::{BTreeSet, HashMap};
use std::f64::consts::{PI, TAU};
use std::ops::Range;

use crate::vector::{Vector, scaled_normal};
use crate::{Error, TriangleMesh};

/// Most rings of vertices in a lid.
const MOST_RINGS: usize = 40;
/// Times that the metric of a lid becomes that of its shape.
const METRICS: usize = 4;
/// Most iterations for one shape, and the part of the residual that is left.
const ITERATIONS: usize = 3000;
const ACCURACY: f64 = 1e-10;

/// A surface with its holes closed.
#[derive(Clone, Debug)]
pub struct Lids {
    /// The surface with the lids: what was given comes first, then the vertices and the faces of the lids.
    pub mesh: TriangleMesh,
    /// How many holes there were.
    pub holes: usize,
    /// For each vertex that was given, whether it is at a hole.
    pub rim: Vec<bool>,
    /// The lids, one for each hole.
    pub(crate) each: Vec<Lid>,
}

/// A lid on a hole.
#[derive(Clone, Debug)]
pub(crate) struct Lid {
    /// Its faces.
    pub(crate) faces: Range<usize>,
    /// Its vertices beside those of the rim.
    pub(crate) vertices: Range<usize>,
    /// Where they are on straight lines from the rim to the middle, and which part of such a line is behind them: 1 at the rim, 0 in the middle.
    straight: Vec<(Vector, f64)>,
    /// The area that the rim goes around, as a vector.
    area: Vector,
}

impl Lid {
    /// How large the hole is.
    pub(crate) fn area(&self) -> f64 {
        self.area.length()
    }

    /// Makes it a dome: a paraboloid over the rim, as high as this part of the radius of a disc of the same area.
    pub(crate) fn make_dome(&self, mesh: &mut TriangleMesh, height: f64) {
        let radius = (self.area() / PI).sqrt();
        let up = self.area.normalize_or_zero() * (height * radius);
        let vertices = &mut mesh.vertices[self.vertices.clone()];
        for (x, (straight, part)) in vertices.iter_mut().zip(&self.straight) {
            *x = (*straight + up * (1.0 - part * part)).to_array();
        }
    }
}

impl TriangleMesh {
    /// The surface with all holes closed, each by a lid of triangles as large as those at its rim, which goes on from the surface without a crease and
    /// is bent as little as possible.
    ///
    /// # Errors
    /// [`Error::NonManifold`] and [`Error::MixedOrientation`] for edges with more faces, or with two in the same direction.
    pub fn with_lids(&self) -> Result<Lids, Error> {
        let mut lids = self.with_straight_lids()?;
        let mut free = vec![false; self.vertices.len()];
        free.resize(lids.mesh.vertices.len(), true);
        lids.mesh.bend_least(&free);
        Ok(lids)
    }

    /// The same with lids on straight lines from the rims to their middles.
    pub(crate) fn with_straight_lids(&self) -> Result<Lids, Error> {
        let loops = Rims::of(self)?.loops();
        let mut mesh = Self {
            normals: None,
            ..self.clone()
        };
        let mut rim = vec![false; self.vertices.len()];
        for &vertex in loops.iter().flatten() {
            rim[vertex as usize] = true;
        }
        let lids = loops.iter().map(|around| add_lid(&mut mesh, around));
        Ok(Lids {
            each: lids.collect(),
            mesh,
            holes: loops.len(),
            rim,
        })
    }

    /// Moves the free vertices so that the surface is bent as little as possible, without a crease towards the others, which stay.
    ///
    /// The sum of the squares of the Laplacians at the free vertices and at those next to them, `sum |L x|^2 / A`, in the metric of the shape before,
    /// some times over: M. Botsch, L. Kobbelt: An intuitive framework for real-time freeform modeling. ACM Trans. Graph. 23 (2004).
    pub fn bend_least(&mut self, free: &[bool]) {
        self.bend_least_beside(free, &[]);
    }

    /// The same where the surface does not go on smoothly from some vertices, the Laplacians at which do not count.
    pub fn bend_least_beside(&mut self, free: &[bool], creases: &[bool]) {
        for _ in 0..METRICS {
            let system = Bending::of(self, free, creases);
            if system.unknowns.is_empty() {
                return;
            }
            system.solve(&mut self.vertices);
        }
    }
}

/// The edges of one face, by their start.
struct Rims<'a> {
    mesh: &'a TriangleMesh,
    /// The corner at which an edge begins, by its ends.
    corners: HashMap<[u32; 2], usize>,
}

impl<'a> Rims<'a> {
    fn of(mesh: &'a TriangleMesh) -> Result<Self, Error> {
        let mut corners = HashMap::with_capacity(3 * mesh.faces.len());
        for (face, vertices) in mesh.faces.iter().enumerate() {
            for i in 0..3 {
                let edge = [vertices[i], vertices[(i + 1) % 3]];
                if let Some(known) = corners.insert(edge, 3 * face + i) {
                    let [from, to] = edge.map(|v| mesh.vertices[v as usize]);
                    return Err(Error::MixedOrientation {
                        edges: 1,
                        first: known / 3,
                        second: face,
                        from,
                        to,
                    });
                }
            }
        }
        Ok(Self { mesh, corners })
    }

    /// The vertices of each hole in a row, so that its lid goes along them.
    fn loops(&self) -> Vec<Vec<u32>> {
        let is_rim = |&[a, b]: &[u32; 2]| !self.corners.contains_key(&[b, a]);
        // In order, so that lids do not depend on chance.
        let mut open: BTreeSet<[u32; 2]> = self.corners.keys().copied().filter(is_rim).collect();
        let mut loops = Vec::new();
        while let Some(first) = open.pop_first() {
            let (mut around, mut edge) = (vec![first[0]], first);
            loop {
                edge = self.next(edge);
                if edge == first || !open.remove(&edge) {
                    break;
                }
                around.push(edge[0]);
            }
            around.reverse();
            loops.extend(simple(&around));
        }
        loops
    }

    /// The edge of the same rim behind another one: that at the end of the faces around its end.
    fn next(&self, [mut from, at]: [u32; 2]) -> [u32; 2] {
        loop {
            let corner = self.corners[&[from, at]];
            let to = self.mesh.faces[corner / 3][(corner + 2) % 3];
            if !self.corners.contains_key(&[to, at]) {
                return [at, to];
            }
            from = to;
        }
    }
}

/// The rims of which one consists that goes through some vertices several times: holes that meet there.
fn simple(around: &[u32]) -> Vec<Vec<u32>> {
    let (mut rims, mut open): (Vec<Vec<u32>>, Vec<u32>) = (Vec::new(), Vec::new());
    let mut place: HashMap<u32, usize> = HashMap::new();
    for &vertex in around {
        if let Some(&first) = place.get(&vertex) {
            let rim = open.split_off(first);
            place.retain(|_, at| *at < first);
            rims.push(rim);
        }
        place.insert(vertex, open.len());
        open.push(vertex);
    }
    rims.push(open);
    rims.retain(|rim| rim.len() > 2);
    rims
}

/// Adds a lid along the vertices of a hole: rings of fewer and fewer vertices, on straight lines to the middle.
fn add_lid(mesh: &mut TriangleMesh, around: &[u32]) -> Lid {
    let begin = [mesh.vertices.len(), mesh.faces.len()];
    let point = |v: u32| Vector::from_array(mesh.vertices[v as usize]);
    let rim: Vec<Vector> = around.iter().map(|&v| point(v)).collect();
    let count = rim.len();
    let sides = (0..count).map(|i| (rim[i] - rim[0]).cross(rim[(i + 1) % count] - rim[0]));
    let area = 0.5 * sides.sum::<Vector>();
    let mut parts = Vec::new();
    if let [a, b, c] = *around {
        mesh.faces.push([a, b, c]);
    } else {
        add_rings(mesh, around, &rim, &mut parts);
    }
    let vertices = begin[0]..mesh.vertices.len();
    let straight = mesh.vertices[vertices.clone()].iter();
    Lid {
        faces: begin[1]..mesh.faces.len(),
        straight: straight
            .map(|&x| Vector::from_array(x))
            .zip(parts)
            .collect(),
        vertices,
        area,
    }
}

/// Adds the rings and the middle of a lid; `parts` get how far they are from the middle to the rim.
fn add_rings(mesh: &mut TriangleMesh, around: &[u32], rim: &[Vector], parts: &mut Vec<f64>) {
    let count = rim.len();
    let middle = rim.iter().sum::<Vector>() / count as f64;
    let rings = ((count as f64 / TAU).round() as usize).clamp(1, MOST_RINGS);
    let mut outer = around.to_vec();
    for ring in 1..rings {
        let part = 1.0 - ring as f64 / rings as f64;
        let size = ((count as f64 * part).round() as usize).max(3);
        let begin = mesh.vertices.len() as u32;
        for i in 0..size {
            let place = i as f64 / size as f64 * count as f64;
            let (before, weight) = (place as usize, place.fract());
            let on_rim = rim[before % count].lerp(rim[(before + 1) % count], weight);
            mesh.vertices.push(middle.lerp(on_rim, part).to_array());
            parts.push(part);
        }
        let inner: Vec<u32> = (begin..begin + size as u32).collect();
        add_band(&mut mesh.faces, &outer, &inner);
        outer = inner;
    }
    let centre = mesh.vertices.len() as u32;
    mesh.vertices.push(middle.to_array());
    parts.push(0.0);
    for i in 0..outer.len() {
        mesh.faces
            .push([outer[i], outer[(i + 1) % outer.len()], centre]);
    }
}

/// Adds the faces between two rings.
fn add_band(faces: &mut Vec<[u32; 3]>, outer: &[u32], inner: &[u32]) {
    let (mut i, mut j) = (0, 0);
    while i < outer.len() || j < inner.len() {
        let (a, b) = (outer[i % outer.len()], inner[j % inner.len()]);
        // The next vertex is that which comes first on the way round.
        let goes_outside = (2 * i + 1) * inner.len() <= (2 * j + 1) * outer.len();
        if i < outer.len() && (goes_outside || j == inner.len()) {
            i += 1;
            faces.push([a, outer[i % outer.len()], b]);
        } else {
            j += 1;
            faces.push([a, inner[j % inner.len()], b]);
        }
    }
}

/// The equations of the shape that is bent least.
struct Bending {
    /// The vertices that move.
    unknowns: Vec<usize>,
    /// The number of each among them.
    number: Vec<usize>,
    /// The Laplacians that count: vertices with weights, over the root of the area.
    rows: Vec<Vec<(usize, f64)>>,
}

/// What no unknown has for its number.
const FIXED: usize = usize::MAX;

impl Bending {
    fn of(mesh: &TriangleMesh, free: &[bool], creases: &[bool]) -> Self {
        let count = mesh.vertices.len();
        let mut counts = free.to_vec();
        for face in &mesh.faces {
            if face.iter().any(|&v| free[v as usize]) {
                for &vertex in face {
                    counts[vertex as usize] = true;
                }
            }
        }
        for (counts, is_crease) in counts.iter_mut().zip(creases) {
            *counts &= !is_crease;
        }
        let mut weights: Vec<Vec<(usize, f64)>> = vec![Vec::new(); count];
        let mut areas = vec![0.0; count];
        for &face in &mesh.faces {
            let corners = mesh.corners(face);
            let double = scaled_normal(corners).length();
            for i in 0..3 {
                let [here, next, last] = [i, (i + 1) % 3, (i + 2) % 3];
                let (a, b) = (corners[next] - corners[here], corners[last] - corners[here]);
                areas[face[here] as usize] += double / 6.0;
                // Half the cotangent of the angle here, for the side across. Very flat faces count as others.
                let cotangent =
                    (0.5 * a.dot(b) / double.max(1e-12 * a.length() * b.length())).clamp(0.02, 5.0);
                let [v, w] = [next, last].map(|k| face[k] as usize);
                for (from, to) in [(v, w), (w, v)] {
                    if counts[from] {
                        weights[from].push((to, cotangent));
                    }
                }
            }
        }
        let mut number = vec![FIXED; count];
        let unknowns: Vec<usize> = (0..count).filter(|&v| free[v]).collect();
        for (k, &vertex) in unknowns.iter().enumerate() {
            number[vertex] = k;
        }
        let rows = (0..count).filter(|&v| counts[v]).map(|vertex| {
            let scale = areas[vertex].max(f64::MIN_POSITIVE).sqrt().recip();
            let mut row: Vec<(usize, f64)> = weights[vertex].clone();
            let sum: f64 = row.iter().map(|(_, weight)| weight).sum();
            row.push((vertex, -sum));
            for (_, weight) in &mut row {
                *weight *= scale;
            }
            row
        });
        Self {
            rows: rows.collect(),
            unknowns,
            number,
        }
    }

    /// `M^T M p` for the unknowns, with the columns of all rows.
    fn product(&self, p: &[Vector]) -> Vec<Vector> {
        let mut image = vec![Vector::ZERO; p.len()];
        for row in &self.rows {
            let value: Vector = (row.iter())
                .filter(|(v, _)| self.number[*v] != FIXED)
                .map(|(v, weight)| p[self.number[*v]] * *weight)
                .sum();
            for (v, weight) in row.iter().filter(|(v, _)| self.number[*v] != FIXED) {
                image[self.number[*v]] += value * *weight;
            }
        }
        image
    }

    /// Conjugate gradients, with the diagonal for a preconditioner, for the three coordinates together.
    fn solve(&self, vertices: &mut [[f64; 3]]) {
        let mut residual = vec![Vector::ZERO; self.unknowns.len()];
        let mut diagonal = vec![0.0; self.unknowns.len()];
        for row in &self.rows {
            let value: Vector = (row.iter())
                .map(|(v, weight)| Vector::from_array(vertices[*v]) * *weight)
                .sum();
            for (v, weight) in row.iter().filter(|(v, _)| self.number[*v] != FIXED) {
                residual[self.number[*v]] -= value * *weight;
                diagonal[self.number[*v]] += weight * weight;
            }
        }
        let precondition = |r: &[Vector]| -> Vec<Vector> {
            r.iter()
                .zip(&diagonal)
                .map(|(r, d)| *r / d.max(f64::MIN_POSITIVE))
                .collect()
        };
        let dot =
            |a: &[Vector], b: &[Vector]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum() };
        let mut ways = vec![Vector::ZERO; self.unknowns.len()];
        let z = precondition(&residual);
        let mut rz = dot(&residual, &z);
        let least = ACCURACY * ACCURACY * rz;
        let mut direction = z;
        for _ in 0..ITERATIONS {
            if rz <= least {
                break;
            }
            let image = self.product(&direction);
            let alpha = rz / dot(&direction, &image);
            for (k, p) in direction.iter().enumerate() {
                ways[k] += alpha * *p;
                residual[k] -= alpha * image[k];
            }
            let z = precondition(&residual);
            let next = dot(&residual, &z);
            let beta = next / rz;
            rz = next;
            for (p, z) in direction.iter_mut().zip(z) {
                *p = z + beta * *p;
            }
        }
        for (&vertex, way) in self.unknowns.iter().zip(ways) {
            let x = Vector::from_array(vertices[vertex]) + way;
            if x.is_finite() {
                vertices[vertex] = x.to_array();
            }
        }
    }
}

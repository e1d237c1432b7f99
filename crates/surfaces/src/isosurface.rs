//! Zero level sets of fields as closed triangle meshes.

use std::collections::HashMap;

use geometry::{PhaseField, check_values, distances_from_phase_field};
use rayon::prelude::*;

use crate::vector::Vector;
use crate::{Error, TriangleMesh};

/// The surface `{u = 0}` of a phase field, around `{u > 0}`.
///
/// It is the [`isosurface`] of the distances `-(4 eps/3) atanh u`, which are nearly linear across
/// the interface, whatever the ratio of `eps` to the spacing.
///
/// # Errors
/// `eps` must be finite and positive; otherwise as [`isosurface`].
pub fn phase_field_surface(u: &impl PhaseField<3>, eps: f64) -> Result<TriangleMesh, Error> {
    isosurface(&distances_from_phase_field(u, eps)?)
}

/// The surface `{s = 0}` of a field, around `{s < 0}`, by marching tetrahedra; without faces where
/// `s` does not change its sign.
///
/// **Topology.** Every cell is cut into six tetrahedra around a diagonal, which runs from the
/// corner with even indices to that with odd ones (Todd's triangulation J1). Vertices belong to
/// the edges of this triangulation of space and are shared: the surface is a closed oriented
/// manifold, always. It has the symmetries of the field under reflections at planes of nodes and
/// exchange of axes. Nodes with `s = 0` count as outside. The periodic grid is treated as a
/// picture: where the inside reaches the first or last nodes, it is closed by a cap there.
///
/// **Accuracy.** Along an edge `s` is quadratic: the second difference is the smaller of those at
/// its ends, zero if they differ in sign (so that kinks and plateaus next to the surface do no
/// harm), as in C. Min: On reinitializing level set functions. J. Comput. Phys. 229 (2010). For a
/// smooth distance the vertices are off by `O(h^3)`, and area and volume by `O(h^2)`, because the
/// faces are chords. Vertices keep `1/1024` of the length of their edge from its ends, so that no
/// two coincide, also in single precision.
///
/// **Normals** are the gradient of `s` by central differences, interpolated along the edge.
///
/// # Errors
/// [`geometry::Error::NonFinite`]; [`Error::TooLarge`].
pub fn isosurface(s: &impl PhaseField<3>) -> Result<TriangleMesh, Error> {
    s.check_finite()?;
    let grid = s.nodes().grid();
    marched(&Lattice {
        size: grid.shape(),
        value_at: &|place| s.at(place),
        origin: grid.origin(),
        spacing: [grid.side(), grid.cells() as f64],
    })
}

/// The same of values on a lattice of any size, the last axis fastest, whose nodes have their indices as coordinates: not of a grid in a
/// cube, but of the voxels of a volume.
///
/// # Errors
/// [`geometry::Error::ValueCount`], [`geometry::Error::NonFinite`]; [`Error::TooLarge`].
pub fn lattice_surface(size: [usize; 3], values: &[f64]) -> Result<TriangleMesh, Error> {
    check_values(values, size.iter().product())?;
    marched(&Lattice {
        size,
        value_at: &|[i, j, k]| values[(i * size[1] + j) * size[2] + k],
        origin: [0.0; 3],
        spacing: [1.0; 2],
    })
}

fn marched(lattice: &Lattice<'_>) -> Result<TriangleMesh, Error> {
    let mut surface = Surface {
        lattice,
        vertex_of: HashMap::new(),
        vertices: Vec::new(),
        normals: Vec::new(),
        faces: Vec::new(),
    };
    for cell in lattice.mixed_cells() {
        // The corner whose index is odd along the axes with a bit.
        let corner = |bits: usize| -> Node {
            let is_odd = |axis: usize| bits >> axis & 1;
            std::array::from_fn(|axis| cell[axis] + ((cell[axis] % 2) ^ is_odd(axis)))
        };
        let reflected = cell.iter().map(|c| c % 2).sum::<usize>() % 2 == 1;
        for (corners, positive) in TETRAHEDRA {
            surface.cut(corners.map(corner), positive != reflected);
        }
    }
    surface.finish()
}

/// Indices of a node, counted from one: 0 and one more than the last are the layers outside.
type Node = [usize; 3];

/// Vertices keep this part of the length of their edge from its ends.
const CLEARANCE: f64 = 1.0 / 1024.0;

/// The nodes with a layer of outside around them.
struct Lattice<'a> {
    size: [usize; 3],
    value_at: &'a (dyn Fn([usize; 3]) -> f64 + Sync),
    origin: [f64; 3],
    /// So many nodes along each axis are so long: length and number.
    spacing: [f64; 2],
}

impl Lattice<'_> {
    fn layers(&self) -> [usize; 3] {
        self.size.map(|n| n + 2)
    }

    fn index(&self, [i, j, k]: Node) -> usize {
        let [_, rows, columns] = self.layers();
        (i * rows + j) * columns + k
    }

    fn is_inside(&self, node: Node) -> bool {
        self.value(node.map(|i| i as isize))
            .is_some_and(|value| value < 0.0)
    }

    /// Which nodes of a layer of the first axis are inside.
    fn inside(&self, i: usize) -> Vec<bool> {
        let [_, rows, columns] = self.layers();
        let mut inside = vec![false; rows * columns];
        if (1..=self.size[0]).contains(&i) {
            for j in 1..rows - 1 {
                for k in 1..columns - 1 {
                    inside[j * columns + k] = (self.value_at)([i - 1, j - 1, k - 1]) < 0.0;
                }
            }
        }
        inside
    }

    /// First corners of the cells with corners on both sides, in order.
    fn mixed_cells(&self) -> Vec<Node> {
        let [layers, rows, columns] = self.layers();
        let of_layer = |i: usize| {
            let (layers, mut mixed) = ([i, i + 1].map(|i| self.inside(i)), Vec::new());
            for j in 0..rows - 1 {
                let row = |di: usize, dj: usize| &layers[di][(j + dj) * columns..][..columns];
                let rows = [row(0, 0), row(0, 1), row(1, 0), row(1, 1)];
                let column = |k: usize| rows.iter().map(|row| u8::from(row[k])).sum::<u8>();
                let mut left = column(0);
                for k in 0..columns - 1 {
                    let right = column(k + 1);
                    if !matches!(left + right, 0 | 8) {
                        mixed.push([i, j, k]);
                    }
                    left = right;
                }
            }
            mixed
        };
        let by_layer: Vec<Vec<Node>> = (0..layers - 1).into_par_iter().map(of_layer).collect();
        by_layer.concat()
    }

    /// The value at a node, `None` outside the grid.
    fn value(&self, node: [isize; 3]) -> Option<f64> {
        let mut place = [0; 3];
        for (axis, i) in node.into_iter().enumerate() {
            place[axis] = (usize::try_from(i - 1).ok()).filter(|&i| i < self.size[axis])?;
        }
        Some((self.value_at)(place))
    }

    fn position(&self, node: Node) -> Vector {
        let along = |axis: usize| {
            // As `Grid::coordinate`, from one layer before the first.
            let [side, cells] = self.spacing;
            self.origin[axis] + side * ((node[axis] as f64 - 1.0) / cells)
        };
        Vector::new(along(0), along(1), along(2))
    }

    /// The gradient times the spacing, by central differences, one-sided at the border.
    fn gradient(&self, node: Node) -> Vector {
        let node = node.map(|i| i as isize);
        let centre = self.value(node).unwrap_or(0.0);
        let along = |axis: usize| {
            let at = |step: isize| {
                let mut shifted = node;
                shifted[axis] += step;
                self.value(shifted)
            };
            match (at(-1), at(1)) {
                (Some(before), Some(after)) => 0.5 * (after - before),
                (Some(before), None) => centre - before,
                (None, Some(after)) => after - centre,
                (None, None) => 0.0,
            }
        };
        Vector::new(along(0), along(1), along(2))
    }

    /// Where on the edge from `a` to `b` the surface passes, and its normal there.
    fn crossing(&self, a: Node, b: Node) -> (Vector, Vector) {
        let step: [isize; 3] = std::array::from_fn(|i| b[i] as isize - a[i] as isize);
        let at = |k: isize| {
            let node: [isize; 3] = std::array::from_fn(|i| a[i] as isize + k * step[i]);
            self.value(node)
        };
        let (part, gradient) = match (at(0), at(1)) {
            (Some(va), Some(vb)) => {
                // Second differences at both ends.
                let here = at(-1).map_or(0.0, |before| before - 2.0 * va + vb);
                let there = at(2).map_or(0.0, |after| va - 2.0 * vb + after);
                let part = root(va, vb, smaller(here, there)).clamp(CLEARANCE, 1.0 - CLEARANCE);
                (part, self.gradient(a).lerp(self.gradient(b), part))
            }
            // A cap at the border of the grid.
            (Some(_), None) => (CLEARANCE, Vector::ZERO),
            (None, _) => (1.0 - CLEARANCE, Vector::ZERO),
        };
        let (xa, xb) = (self.position(a), self.position(b));
        let outwards = if self.is_inside(a) { xb - xa } else { xa - xb };
        let normal = gradient
            .try_normalize()
            .unwrap_or_else(|| outwards.normalize());
        (xa.lerp(xb, part), normal)
    }
}

/// The one of smaller magnitude, zero if the signs differ.
fn smaller(a: f64, b: f64) -> f64 {
    if a * b <= 0.0 {
        0.0
    } else if a.abs() < b.abs() {
        a
    } else {
        b
    }
}

/// The root in `[0, 1]` of `va + (vb - va) t - bend/2 t (1 - t)`; `va` and `vb` differ in sign.
fn root(va: f64, vb: f64, bend: f64) -> f64 {
    if va == 0.0 {
        return 0.0;
    }
    let (a, b, c) = (0.5 * bend, vb - va - 0.5 * bend, va);
    // The root with a slope of the sign of vb - va, without cancellation. The discriminant is not
    // negative, because there is a change of sign.
    let slope = (b * b - 4.0 * a * c).max(0.0).sqrt().copysign(vb - va);
    if b * slope >= 0.0 {
        -2.0 * c / (b + slope)
    } else {
        (slope - b) / (2.0 * a)
    }
}

/// The tetrahedra of a cell: their corners on a way along its edges to the opposite corner, with a bit for every axis, and whether they
/// are positively oriented in that order.
const TETRAHEDRA: [([usize; 4], bool); 6] = [
    ([0, 1, 3, 7], true),
    ([0, 2, 6, 7], true),
    ([0, 4, 5, 7], true),
    ([0, 1, 5, 7], false),
    ([0, 4, 6, 7], false),
    ([0, 2, 3, 7], false),
];

/// The mesh as it grows.
struct Surface<'a> {
    lattice: &'a Lattice<'a>,
    /// The vertex on the edge between two nodes.
    vertex_of: HashMap<[usize; 2], u32>,
    vertices: Vec<[f64; 3]>,
    normals: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
}

impl Surface<'_> {
    /// Adds the surface in a tetrahedron; `positive` is its orientation.
    fn cut(&mut self, corners: [Node; 4], positive: bool) {
        let inside = corners.map(|node| self.lattice.is_inside(node));
        let where_is = |side: bool| (0..4).filter(move |&c| inside[c] == side);
        match where_is(true).count() {
            1 | 3 => {
                // One corner alone, and the others in order: an odd place is an odd permutation.
                let minority = where_is(true).count() == 1;
                let alone = where_is(minority).next().expect("there is one");
                let mut edges = where_is(!minority).map(|other| [alone, other]);
                let triangle = [(); 3].map(|()| edges.next().expect("there are three"));
                let outwards = (positive == (alone % 2 == 0)) == minority;
                let triangle = triangle.map(|edge| self.vertex(edge.map(|c| corners[c])));
                self.push(triangle, outwards);
            }
            2 => {
                let mut order = where_is(true).chain(where_is(false));
                let [a, b, c, d] = [(); 4].map(|()| order.next().expect("there are four"));
                // Inversions of the order (a, b, c, d).
                let outwards = positive == ((a + b - 1) % 2 == 0);
                let quadrilateral = [[a, c], [a, d], [b, d], [b, c]];
                let [p, q, r, s] = quadrilateral.map(|edge| self.vertex(edge.map(|c| corners[c])));
                self.push([p, q, r], outwards);
                self.push([p, r, s], outwards);
            }
            _ => {}
        }
    }

    fn push(&mut self, [a, b, c]: [u32; 3], outwards: bool) {
        self.faces
            .push(if outwards { [a, b, c] } else { [a, c, b] });
    }

    fn vertex(&mut self, [p, q]: [Node; 2]) -> u32 {
        // From the corner with more even indices: the same in all tetrahedra around the edge.
        let odd = |node: Node| node.iter().filter(|&i| i % 2 == 1).count();
        let (a, b) = if odd(p) < odd(q) { (p, q) } else { (q, p) };
        let key = [self.lattice.index(a), self.lattice.index(b)];
        *self.vertex_of.entry(key).or_insert_with(|| {
            let (position, normal) = self.lattice.crossing(a, b);
            self.vertices.push(position.to_array());
            self.normals.push(normal.to_array());
            // Wraps if there are too many, which `finish` sees.
            self.vertices.len() as u32 - 1
        })
    }

    fn finish(self) -> Result<TriangleMesh, Error> {
        if u32::try_from(self.vertices.len()).is_err() {
            return Err(Error::TooLarge {
                elements: "vertices",
                count: self.vertices.len(),
            });
        }
        Ok(TriangleMesh {
            vertices: self.vertices,
            faces: self.faces,
            normals: Some(self.normals),
        })
    }
}

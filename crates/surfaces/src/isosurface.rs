//! Zero level sets of fields as closed triangle meshes.

use geometry::{PhaseField, check_values, distances_from_phase_field};

use crate::tetrahedra::{Lattice, LevelSet, Node, Scaled, Values, march};
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
    marched(&Geometry {
        lattice: Lattice {
            size: grid.shape(),
            values: &Scaled {
                field: s,
                factor: 1.0,
            },
        },
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
    marched(&Geometry {
        lattice: Lattice {
            size,
            values: &Rows { size, values },
        },
        origin: [0.0; 3],
        spacing: [1.0; 2],
    })
}

struct Rows<'a> {
    size: [usize; 3],
    values: &'a [f64],
}

impl Rows<'_> {
    fn start(&self, [i, j]: [usize; 2]) -> usize {
        (i * self.size[1] + j) * self.size[2]
    }
}

impl Values for Rows<'_> {
    fn at(&self, [i, j, k]: [usize; 3]) -> f64 {
        self.values[self.start([i, j]) + k]
    }

    fn read_row(&self, place: [usize; 2], row: &mut [f64]) {
        row.copy_from_slice(&self.values[self.start(place)..][..row.len()]);
    }
}

fn marched(geometry: &Geometry<'_>) -> Result<TriangleMesh, Error> {
    let mut mesh = Mesh {
        geometry,
        vertices: Vec::new(),
        normals: Vec::new(),
        faces: Vec::new(),
    };
    march(&geometry.lattice, &mut mesh)?;
    Ok(TriangleMesh {
        vertices: mesh.vertices,
        faces: mesh.faces,
        normals: Some(mesh.normals),
    })
}

/// The mesh as it grows.
struct Mesh<'a> {
    geometry: &'a Geometry<'a>,
    vertices: Vec<[f64; 3]>,
    normals: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
}

impl LevelSet for Mesh<'_> {
    fn add_vertex(&mut self, [p, q]: [Node; 2]) {
        // From the corner with more even indices: the same in all tetrahedra around the edge.
        let odd = |node: Node| node.iter().filter(|&i| i % 2 == 1).count();
        let (a, b) = if odd(p) < odd(q) { (p, q) } else { (q, p) };
        let (position, normal) = self.geometry.crossing(a, b);
        self.vertices.push(position.to_array());
        self.normals.push(normal.to_array());
    }

    fn add_face(&mut self, vertices: [u32; 3]) {
        self.faces.push(vertices);
    }
}

/// Vertices keep this part of the length of their edge from its ends.
const CLEARANCE: f64 = 1.0 / 1024.0;

/// A lattice in space.
struct Geometry<'a> {
    lattice: Lattice<'a>,
    origin: [f64; 3],
    /// So many nodes along each axis are so long: length and number.
    spacing: [f64; 2],
}

impl Geometry<'_> {
    fn value(&self, node: [isize; 3]) -> Option<f64> {
        self.lattice.value(node)
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
        let outwards = if self.lattice.is_inside(a) {
            xb - xa
        } else {
            xa - xb
        };
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

//! Walls in the tetrahedra of a triangulation of space.

use std::collections::HashMap;

use rayon::prelude::*;

use super::{BACKGROUND, LabelMesh};
use crate::tetrahedra::TETRAHEDRA;
use crate::vector::{Vector, scaled_normal};
use crate::{Error, TriangleMesh};

/// The label of every node of a lattice. Beyond it is the background.
#[derive(Clone, Debug)]
pub struct LabelLattice {
    /// Nodes along each axis.
    pub size: [usize; 3],
    /// The first node.
    pub origin: [f64; 3],
    /// From node to node.
    pub spacing: f64,
    /// The last axis fastest.
    pub labels: Vec<u32>,
}

impl LabelLattice {
    /// Where a node is.
    pub fn position(&self, node: [usize; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| self.spacing.mul_add(node[axis] as f64, self.origin[axis]))
    }

    /// With a layer of background around it, so that every wall is closed.
    fn padded(&self) -> Self {
        let size = self.size.map(|n| n + 2);
        let mut labels = vec![BACKGROUND; size.iter().product()];
        for (row, from) in self.labels.chunks(self.size[2].max(1)).enumerate() {
            let (i, j) = (row / self.size[1] + 1, row % self.size[1] + 1);
            labels[(i * size[1] + j) * size[2] + 1..][..from.len()].copy_from_slice(from);
        }
        Self {
            size,
            origin: self.origin.map(|x| x - self.spacing),
            spacing: self.spacing,
            labels,
        }
    }

    fn number(&self, [i, j, k]: [usize; 3]) -> usize {
        (i * self.size[1] + j) * self.size[2] + k
    }

    fn node(&self, number: usize) -> [usize; 3] {
        let [_, rows, columns] = self.size;
        [
            number / (rows * columns),
            number / columns % rows,
            number % columns,
        ]
    }

    /// First corners of the cells of a layer with several labels, in order.
    fn mixed_cells(&self, i: usize) -> Vec<[usize; 3]> {
        let [_, rows, columns] = self.size;
        let places = (0..rows - 1).flat_map(|j| (0..columns - 1).map(move |k| [i, j, k]));
        let is_mixed = |cell: &[usize; 3]| {
            let label = self.labels[self.number(*cell)];
            let corners = (1..8).map(|bits| corner(*cell, bits));
            corners
                .into_iter()
                .any(|node| self.labels[self.number(node)] != label)
        };
        places.filter(is_mixed).collect()
    }

    /// The walls between labels, whose vertices are in the middle of edges, triangles and tetrahedra of a triangulation of space.
    ///
    /// Every cell is cut into the six tetrahedra of [`isosurface`](crate::isosurface()). In a tetrahedron with nodes of several labels, walls are made of pieces
    /// of the dual cells of its edges: they have a vertex in the middle of each edge between two labels, of each triangle between three, and of a
    /// tetrahedron between four. (G. M. Nielson, R. Franke: Computing the separating surface for segmented data. Visualization 1997.) The nodes
    /// of a label span a full subcomplex of the triangulation, and what is around them is a regular neighbourhood of it: the boundary of every
    /// label is a closed manifold, always.
    ///
    /// # Errors
    /// [`Error::TooLarge`].
    pub fn walls(&self) -> Result<LabelMesh, Error> {
        let lattice = self.padded();
        if u32::try_from(lattice.labels.len()).is_err() {
            return Err(Error::TooLarge {
                elements: "nodes",
                count: lattice.labels.len(),
            });
        }
        let layers = (0..lattice.size[0] - 1).into_par_iter();
        let cells: Vec<_> = layers.map(|i| lattice.mixed_cells(i)).collect();
        let mut march = March::new(&lattice);
        for cell in cells.into_iter().flatten() {
            // The corner whose index is odd along the axes with a bit.
            let corner = |bits: usize| -> [usize; 3] {
                std::array::from_fn(|axis| cell[axis] + ((cell[axis] % 2) ^ (bits >> axis & 1)))
            };
            for (corners, _) in TETRAHEDRA {
                march.tetrahedron(corners.map(|bits| lattice.number(corner(bits)) as u32));
            }
        }
        Ok(march.finish())
    }
}

/// A corner of a cell, with a bit for every axis.
fn corner(cell: [usize; 3], bits: usize) -> [usize; 3] {
    std::array::from_fn(|axis| cell[axis] + (bits >> axis & 1))
}

/// In the middle of up to four nodes, in ascending order; places that are not taken are of the largest number.
type Middle = [u32; 4];

struct March<'a> {
    lattice: &'a LabelLattice,
    numbers: HashMap<Middle, u32>,
    vertices: Vec<Vector>,
    meeting: Vec<Vec<u32>>,
    faces: Vec<[u32; 3]>,
    sides: Vec<[u32; 2]>,
}

impl<'a> March<'a> {
    fn new(lattice: &'a LabelLattice) -> Self {
        Self {
            lattice,
            numbers: HashMap::new(),
            vertices: Vec::new(),
            meeting: Vec::new(),
            faces: Vec::new(),
            sides: Vec::new(),
        }
    }

    fn label(&self, node: u32) -> u32 {
        self.lattice.labels[node as usize]
    }

    fn place(&self, node: u32) -> Vector {
        self.lattice
            .position(self.lattice.node(node as usize))
            .into()
    }

    /// Adds the walls between the labels of a tetrahedron.
    fn tetrahedron(&mut self, nodes: [u32; 4]) {
        let mut labels = nodes.map(|node| self.label(node));
        labels.sort_unstable();
        for (place, &a) in labels.iter().enumerate() {
            for (after, &b) in labels.iter().enumerate().skip(place + 1) {
                let is_first = |place: usize| place == 0 || labels[place - 1] != labels[place];
                if a != b && is_first(place) && is_first(after) {
                    self.wall([a, b], nodes);
                }
            }
        }
    }

    /// Adds the wall between two labels in a tetrahedron.
    fn wall(&mut self, [a, b]: [u32; 2], nodes: [u32; 4]) {
        let of = |label: u32| -> Vec<u32> {
            let nodes = nodes.into_iter();
            nodes.filter(|&node| self.label(node) == label).collect()
        };
        let (of_a, of_b) = (of(a), of(b));
        let others = nodes
            .into_iter()
            .filter(|n| !of_a.contains(n) && !of_b.contains(n));
        let others: Vec<u32> = others.collect();
        let corners: Vec<Vec<u32>> = match (&of_a[..], &of_b[..], &others[..]) {
            (&[p], some, []) | (some, &[p], []) => some.iter().map(|&q| vec![p, q]).collect(),
            (&[p, q], &[r, s], []) => vec![vec![p, r], vec![p, s], vec![q, s], vec![q, r]],
            (&[p], &[q, r], &[o]) | (&[q, r], &[p], &[o]) => {
                vec![vec![p, q], vec![p, r], vec![p, r, o], vec![p, q, o]]
            }
            (&[p], &[q], &[o, n]) if self.label(o) == self.label(n) => {
                vec![vec![p, q], vec![p, q, o], vec![p, q, n]]
            }
            (&[p], &[q], &[o, n]) => {
                vec![vec![p, q], vec![p, q, o], nodes.to_vec(), vec![p, q, n]]
            }
            _ => unreachable!("a tetrahedron has four nodes"),
        };
        let middle = |nodes: &[u32]| {
            nodes.iter().map(|&node| self.place(node)).sum::<Vector>() / nodes.len() as f64
        };
        let towards_b = middle(&of_b) - middle(&of_a);
        // The background is in front.
        let (sides, forwards) = match a {
            BACKGROUND => ([b, a], -towards_b),
            _ => ([a, b], towards_b),
        };
        let corners: Vec<u32> = corners.iter().map(|nodes| self.vertex(nodes)).collect();
        for pair in corners[1..].windows(2) {
            self.push([corners[0], pair[0], pair[1]], sides, forwards);
        }
    }

    fn push(&mut self, [a, b, c]: [u32; 3], sides: [u32; 2], forwards: Vector) {
        let normal = scaled_normal([a, b, c].map(|v| self.vertices[v as usize]));
        let is_turned = normal.dot(forwards) < 0.0;
        self.faces
            .push(if is_turned { [a, c, b] } else { [a, b, c] });
        self.sides.push(sides);
    }

    /// The vertex in the middle of some nodes.
    fn vertex(&mut self, nodes: &[u32]) -> u32 {
        let mut key = [u32::MAX; 4];
        key[..nodes.len()].copy_from_slice(nodes);
        key.sort_unstable();
        if let Some(&number) = self.numbers.get(&key) {
            return number;
        }
        let number = self.vertices.len() as u32;
        self.numbers.insert(key, number);
        let sum: Vector = key[..nodes.len()]
            .iter()
            .map(|&node| self.place(node))
            .sum();
        self.vertices.push(sum / nodes.len() as f64);
        let mut labels: Vec<u32> = nodes.iter().map(|&node| self.label(node)).collect();
        labels.sort_unstable();
        labels.dedup();
        self.meeting.push(labels);
        number
    }

    fn finish(self) -> LabelMesh {
        LabelMesh {
            mesh: TriangleMesh {
                vertices: self.vertices.iter().map(Vector::to_array).collect(),
                faces: self.faces,
                normals: None,
            },
            sides: self.sides,
            meeting: self.meeting,
            spacing: self.lattice.spacing,
        }
    }
}

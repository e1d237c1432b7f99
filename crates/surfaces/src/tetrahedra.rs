//! Zero level sets of values on a lattice, in the tetrahedra of a triangulation of space.

use geometry::PhaseField;
use rayon::prelude::*;

use crate::Error;

/// Indices of a node, counted from one: 0 and one more than the last are the layers outside.
pub type Node = [usize; 3];

/// Layers of cells that are searched at once, on all threads.
const LAYERS: usize = 32;

/// Values on nodes, with a layer of outside around them. They are negative inside.
pub struct Lattice<'a> {
    pub size: [usize; 3],
    pub values: &'a dyn Values,
}

/// The values on the nodes of a lattice.
pub trait Values: Sync {
    fn at(&self, place: [usize; 3]) -> f64;

    /// Writes those of the row with these indices along the first two axes.
    fn read_row(&self, place: [usize; 2], row: &mut [f64]);
}

/// A field times a number.
pub struct Scaled<'a, F> {
    pub field: &'a F,
    pub factor: f64,
}

impl<F: PhaseField<3>> Values for Scaled<'_, F> {
    fn at(&self, place: [usize; 3]) -> f64 {
        self.factor * self.field.at(place)
    }

    fn read_row(&self, [i, j]: [usize; 2], row: &mut [f64]) {
        let rows = self.field.nodes().grid().cells();
        self.field.read((i * rows + j) * row.len(), row);
        for value in row {
            *value *= self.factor;
        }
    }
}

/// What becomes of the level set.
pub trait LevelSet {
    /// The next vertex, on the edge between two nodes.
    fn add_vertex(&mut self, edge: [Node; 2]);

    /// A face, counter-clockwise seen from outside.
    fn add_face(&mut self, vertices: [u32; 3]);
}

/// Adds the level set of the lattice to `set`: vertices before their first face, and each once.
///
/// # Errors
/// [`Error::TooLarge`].
pub fn march(lattice: &Lattice<'_>, set: &mut impl LevelSet) -> Result<(), Error> {
    let mut march = March {
        lattice,
        numbers: EdgeNumbers::new(lattice),
        set,
    };
    let layers = lattice.layers()[0] - 1;
    for first in (0..layers).step_by(LAYERS) {
        let batch = first..layers.min(first + LAYERS);
        let cells: Vec<Vec<Node>> = batch
            .into_par_iter()
            .map(|i| lattice.mixed_cells(i))
            .collect();
        for cell in cells.into_iter().flatten() {
            march.cell(cell);
        }
    }
    let count = march.numbers.count;
    match u32::try_from(count) {
        Ok(_) => Ok(()),
        Err(_) => Err(Error::TooLarge {
            elements: "vertices",
            count,
        }),
    }
}

impl Lattice<'_> {
    fn layers(&self) -> [usize; 3] {
        self.size.map(|n| n + 2)
    }

    pub fn is_inside(&self, node: Node) -> bool {
        self.value(node.map(|i| i as isize))
            .is_some_and(|value| value < 0.0)
    }

    /// The value at a node, `None` outside the grid.
    pub fn value(&self, node: [isize; 3]) -> Option<f64> {
        let mut place = [0; 3];
        for (axis, i) in node.into_iter().enumerate() {
            place[axis] = (usize::try_from(i - 1).ok()).filter(|&i| i < self.size[axis])?;
        }
        Some(self.values.at(place))
    }

    /// Which nodes of a layer of the first axis are inside.
    fn inside(&self, i: usize) -> Vec<bool> {
        let [_, rows, columns] = self.layers();
        let mut inside = vec![false; rows * columns];
        if !(1..=self.size[0]).contains(&i) {
            return inside;
        }
        let mut values = vec![0.0; self.size[2]];
        for j in 1..rows - 1 {
            self.values.read_row([i - 1, j - 1], &mut values);
            let row = &mut inside[j * columns + 1..][..values.len()];
            for (inside, value) in row.iter_mut().zip(&values) {
                *inside = *value < 0.0;
            }
        }
        inside
    }

    /// First corners of the cells of a layer with corners on both sides, in order.
    fn mixed_cells(&self, i: usize) -> Vec<Node> {
        let [_, rows, columns] = self.layers();
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
    }
}

/// The tetrahedra of a cell: their corners on a way along its edges to the opposite corner, with a bit for every axis, and whether they
/// are positively oriented in that order.
pub const TETRAHEDRA: [([usize; 4], bool); 6] = [
    ([0, 1, 3, 7], true),
    ([0, 2, 6, 7], true),
    ([0, 4, 5, 7], true),
    ([0, 1, 5, 7], false),
    ([0, 4, 6, 7], false),
    ([0, 2, 3, 7], false),
];

struct March<'a, S> {
    lattice: &'a Lattice<'a>,
    numbers: EdgeNumbers,
    set: &'a mut S,
}

impl<S: LevelSet> March<'_, S> {
    fn cell(&mut self, cell: Node) {
        self.numbers.reach(cell[0]);
        // The corner whose index is odd along the axes with a bit.
        let corner = |bits: usize| -> Node {
            let is_odd = |axis: usize| bits >> axis & 1;
            std::array::from_fn(|axis| cell[axis] + ((cell[axis] % 2) ^ is_odd(axis)))
        };
        let reflected = cell.iter().map(|c| c % 2).sum::<usize>() % 2 == 1;
        for (corners, positive) in TETRAHEDRA {
            self.cut(corners.map(corner), positive != reflected);
        }
    }

    /// Adds the level set in a tetrahedron; `positive` is its orientation.
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
        let face = if outwards { [a, b, c] } else { [a, c, b] };
        self.set.add_face(face);
    }

    fn vertex(&mut self, edge: [Node; 2]) -> u32 {
        let (number, is_new) = self.numbers.of(edge);
        if is_new {
            self.set.add_vertex(edge);
        }
        number
    }
}

/// Numbers of edges in the order in which they are asked for.
///
/// Cells come layer by layer, and an edge is known by its smallest indices and the axes along which it runs. So the numbers of two layers are
/// enough.
struct EdgeNumbers {
    columns: usize,
    /// One more than the number of each edge, in the even and in the odd layer.
    layers: [Vec<u32>; 2],
    /// Entries up to this one are left from earlier layers.
    stale: [usize; 2],
    layer: usize,
    count: usize,
}

impl EdgeNumbers {
    fn new(lattice: &Lattice<'_>) -> Self {
        let [_, rows, columns] = lattice.layers();
        let layer = || vec![0; 7 * rows * columns];
        Self {
            columns,
            layers: [layer(), layer()],
            stale: [0; 2],
            layer: 0,
            count: 0,
        }
    }

    /// Lets cells between the nodes of this layer and the next one come.
    fn reach(&mut self, layer: usize) {
        if layer > self.layer {
            self.stale[(layer + 1) % 2] = self.count;
            if layer > self.layer + 1 {
                self.stale[layer % 2] = self.count;
            }
            self.layer = layer;
        }
    }

    /// The number of an edge, and whether it is new.
    fn of(&mut self, [a, b]: [Node; 2]) -> (u32, bool) {
        let [i, j, k] = std::array::from_fn(|axis| a[axis].min(b[axis]));
        let along = |axis: usize| usize::from(a[axis] != b[axis]) << axis;
        let axes = along(0) + along(1) + along(2);
        let place = (j * self.columns + k) * 7 + axes - 1;
        let number = &mut self.layers[i % 2][place];
        let is_new = *number as usize <= self.stale[i % 2];
        if is_new {
            self.count += 1;
            // Wraps if there are too many, which is refused in the end.
            *number = self.count as u32;
        }
        (number.wrapping_sub(1), is_new)
    }
}

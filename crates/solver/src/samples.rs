//! The grid nodes of an interface, with their foot points on it, in the cells of a coarse lattice.

use geometry::{Grid, Nodes, Row, parallel};
use operators::Interpolation;

/// Corners of a cell of the lattice in 3D; in 2D the first four count.
pub(crate) const MOST_CORNERS: usize = 8;
/// Nodes are worked on in pieces of this many.
const CHUNK: usize = 1 << 14;
/// Where the distance to the interface changes less than this per unit length, there is no normal.
const FLAT: f64 = 1e-3;
/// Nodes beside those of the interface have this part of `1 - u^2` at least where the profile is the optimal one.
const BESIDE: f64 = 0.2;

/// A grid node of the interface.
pub(crate) struct Sample<const D: usize> {
    pub node: u32,
    /// Number of the lattice cell in which the foot point lies, in order of first appearance.
    pub cell: u32,
    /// Place of the foot point in that cell.
    fraction: [f64; D],
    normal: [f64; D],
    /// `1 - u^2`
    pub weight: f64,
    pub curvature: f64,
}

impl<const D: usize> Sample<D> {
    /// Values of the hat functions of the cell's corners at the foot point.
    pub(crate) fn hats(&self) -> [f64; MOST_CORNERS] {
        let mut hats = [0.0; MOST_CORNERS];
        hats[0] = 1.0;
        for (axis, fraction) in self.fraction.iter().enumerate() {
            let (lower, upper) = hats.split_at_mut(1 << axis);
            for (lower, upper) in lower.iter_mut().zip(upper) {
                *upper = *lower * fraction;
                *lower *= 1.0 - fraction;
            }
        }
        hats
    }

    /// Tangential gradients of the hat functions, in units of the lattice.
    pub(crate) fn slopes(&self) -> [[f64; D]; MOST_CORNERS] {
        let mut slopes = [[0.0; D]; MOST_CORNERS];
        for (corner, slope) in slopes.iter_mut().enumerate().take(1 << D) {
            let gradient: [f64; D] = std::array::from_fn(|k| {
                (0..D)
                    .map(|axis| {
                        let (value, change) = along(corner, axis, self.fraction[axis]);
                        if axis == k { change } else { value }
                    })
                    .product()
            });
            let across: f64 = gradient.iter().zip(&self.normal).map(|(a, n)| a * n).sum();
            *slope = std::array::from_fn(|k| gradient[k] - across * self.normal[k]);
        }
        slopes
    }
}

/// Value and derivative along one axis of the hat function of a corner.
fn along(corner: usize, axis: usize, fraction: f64) -> (f64, f64) {
    if corner >> axis & 1 == 1 {
        (fraction, 1.0)
    } else {
        (1.0 - fraction, -1.0)
    }
}

/// All nodes of an interface, and the lattice cells that hold their foot points.
pub(crate) struct Samples<const D: usize> {
    /// The nodes in the order of storage.
    pub nodes: Vec<Sample<D>>,
    /// Positions in `nodes`, cell by cell, and where each cell begins.
    order: Vec<u32>,
    starts: Vec<u32>,
    /// Numbers of the hat functions at the corners of each cell.
    pub corners: Vec<[u32; MOST_CORNERS]>,
    /// Places on the lattice of all hat functions.
    pub columns: Vec<[u32; D]>,
    /// Lattice cells per side of the box.
    pub cells: usize,
    /// Side of a lattice cell.
    pub spacing: f64,
}

impl<const D: usize> Samples<D> {
    /// The interface of `u`, whose values lie at some nodes of the grid and whose width is `eps`, on a lattice of about the given
    /// spacing: its nodes are those with `1 - u^2` above `window`. With a `region`, only its nodes count.
    pub(crate) fn new(
        nodes: &Nodes<D>,
        u: &[f64],
        eps: f64,
        spacing: f64,
        window: f64,
        region: Option<&[bool]>,
    ) -> Option<Self> {
        let grid = nodes.grid();
        let cells = ((grid.side() / spacing).round() as usize).max(4);
        let lattice = Lattice {
            grid,
            eps,
            window,
            points: Grid::new(cells, grid.side()).ok()?,
            width: grid.cells() as f64 / cells as f64,
            distances: parallel::values(u.len(), |node| {
                let counts = 1.0 - u[node] * u[node] >= BESIDE * window;
                if counts {
                    distance(u[node], eps)
                } else {
                    f64::NAN
                }
            }),
        };
        let mut samples = lattice.samples(nodes, u, region);
        let mut cell_of = vec![u32::MAX; lattice.points.len()];
        let mut column_of = cell_of.clone();
        let mut corners: Vec<[u32; MOST_CORNERS]> = Vec::new();
        let mut columns = Vec::new();
        for sample in &mut samples {
            let cell = &mut cell_of[sample.cell as usize];
            if *cell == u32::MAX {
                *cell = corners.len() as u32;
                let mut ends = [0; MOST_CORNERS];
                let place = lattice.points.multi_index(sample.cell as usize);
                for (corner, end) in ends.iter_mut().enumerate().take(1 << D) {
                    let place = std::array::from_fn(|axis| place[axis] + (corner >> axis & 1));
                    let position = lattice.points.index(place);
                    let column = &mut column_of[position];
                    if *column == u32::MAX {
                        *column = columns.len() as u32;
                        let place = lattice.points.multi_index(position);
                        columns.push(place.map(|at| at as u32));
                    }
                    *end = *column;
                }
                corners.push(ends);
            }
            sample.cell = *cell;
        }
        let (order, starts) = grouped(&samples, corners.len());
        Some(Self {
            nodes: samples,
            order,
            starts,
            corners,
            columns,
            cells,
            spacing: lattice.width * grid.spacing(),
        })
    }

    /// How they interpolate.
    pub(crate) fn interpolation(&self) -> Interpolation {
        let samples = || self.order.iter().map(|&i| &self.nodes[i as usize]);
        let places = samples().flat_map(|sample| {
            let weight = std::iter::once(sample.weight);
            weight.chain(sample.fraction)
        });
        Interpolation {
            axes: D,
            starts: self.starts.clone(),
            entries: samples().map(|sample| sample.node).collect(),
            places: places.collect(),
        }
    }

    /// The samples of one lattice cell, in the order of the grid.
    pub(crate) fn of_cell(&self, cell: usize) -> impl Iterator<Item = &Sample<D>> {
        let range = self.starts[cell] as usize..self.starts[cell + 1] as usize;
        self.order[range].iter().map(|&i| &self.nodes[i as usize])
    }
}

/// Positions of the samples cell by cell, and where each cell begins.
fn grouped<const D: usize>(samples: &[Sample<D>], cells: usize) -> (Vec<u32>, Vec<u32>) {
    let mut starts = vec![0; cells + 1];
    for sample in samples {
        starts[sample.cell as usize + 1] += 1;
    }
    for cell in 0..cells {
        starts[cell + 1] += starts[cell];
    }
    let mut next = starts.clone();
    let mut order = vec![0; samples.len()];
    for (i, sample) in samples.iter().enumerate() {
        let place = &mut next[sample.cell as usize];
        order[*place as usize] = i as u32;
        *place += 1;
    }
    (order, starts)
}

struct Lattice<'a, const D: usize> {
    grid: &'a Grid<D>,
    eps: f64,
    window: f64,
    points: Grid<D>,
    /// Grid cells per lattice cell.
    width: f64,
    /// The distances from the interface of nodes near it, NaN of others.
    distances: Vec<f64>,
}

fn distance(u: f64, eps: f64) -> f64 {
    -4.0 / 3.0 * eps * u.clamp(-0.999_999, 0.999_999).atanh()
}

impl<const D: usize> Lattice<'_, D> {
    /// The samples of the nodes that may move, in the order of storage.
    fn samples(&self, nodes: &Nodes<D>, u: &[f64], region: Option<&[bool]>) -> Vec<Sample<D>> {
        let length = nodes.row_length();
        let share = CHUNK.next_multiple_of(length);
        let chunks = parallel::map(u.len().div_ceil(share), 1, &|chunk| {
            let end = u.len().min((chunk + 1) * share);
            let mut samples = Vec::new();
            for first in (chunk * share..end).step_by(length) {
                let near = u[first..][..length].iter().any(|&u| self.is_near(u));
                let row = near.then(|| nodes.row(first));
                for (row, at) in row
                    .iter()
                    .flat_map(|row| (0..length).map(move |at| (row, at)))
                {
                    if region.is_none_or(|region| region[first + at]) {
                        samples.extend(self.sample(row, at, u));
                    }
                }
            }
            samples
        });
        let mut samples = Vec::with_capacity(chunks.iter().map(Vec::len).sum());
        for mut chunk in chunks {
            samples.append(&mut chunk);
        }
        samples
    }

    /// Whether a node with this value belongs to the interface.
    fn is_near(&self, u: f64) -> bool {
        1.0 - u * u >= self.window
    }

    fn distance(&self, node: usize, u: &[f64]) -> f64 {
        let known = self.distances[node];
        if known.is_nan() {
            distance(u[node], self.eps)
        } else {
            known
        }
    }

    /// The sample of a node at a position in a row, if the node belongs to the interface, with all nodes beside it. Its cell is still that of the whole
    /// lattice.
    fn sample(&self, row: &Row<D>, position: usize, u: &[f64]) -> Option<Sample<D>> {
        let node = row.first + position;
        if !self.is_near(u[node]) {
            return None;
        }
        let spacing = self.grid.spacing();
        let mut index = row.place;
        index[D - 1] += position;
        let here = self.distance(node, u);
        let mut laplacian = 0.0;
        let mut normal = [0.0; D];
        for (axis, normal) in normal.iter_mut().enumerate() {
            let [before, after] = row.beside(position, axis);
            let at = |node: usize| self.distance(node, u);
            let (after, before) = (at(after.stored()?), at(before.stored()?));
            laplacian += after - 2.0 * here + before;
            *normal = after - before;
        }
        let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
        if length / (2.0 * spacing) < FLAT {
            return None;
        }
        for n in &mut normal {
            *n /= length;
        }
        // The foot point on the interface, in units of the lattice.
        let foot: [f64; D] = std::array::from_fn(|axis| {
            (index[axis] as f64 - here * normal[axis] / spacing) / self.width
        });
        let cells = self.points.cells() as f64;
        let low = foot.map(|x| x.floor().rem_euclid(cells) as usize);
        Some(Sample {
            node: node as u32,
            cell: self.points.index(low) as u32,
            fraction: foot.map(|x| x - x.floor()),
            normal,
            weight: 1.0 - u[node] * u[node],
            // For a distance function the Laplacian is the mean curvature.
            curvature: laplacian / (spacing * spacing),
        })
    }
}

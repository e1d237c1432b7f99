//! How much of the cells of a lattice a surface encloses, and surfaces that enclose as much near every place.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use glam::{DAffine3, DMat3};
use rayon::prelude::*;

use crate::TriangleMesh;
use crate::vector::{Vector, scaled_normal};

/// Rounds in which a surface takes on the volume near every place.
const ROUNDS: usize = 3;
/// A vertex moves by at most this part of the width of the average in a round.
const LONGEST: f64 = 0.25;
/// The side of the bins of the average, in its widths.
const BIN: f64 = 0.5;
/// How far before the first cell the first bin begins, in widths.
const OFFSET: f64 = 0.1237;
/// The average ends at this distance, in widths.
const REACH: f64 = 3.0;
/// Triangles over more cells than this along an axis are not cut: the cells would be far smaller than the triangles.
const MOST_CELLS: f64 = 256.0;
/// Cells are counted up to this number.
const FARTHEST: f64 = 1e9;
/// Triangles are cut in pieces of this many, on several threads.
const CHUNK: usize = 1 << 12;
/// Volumes of less than this part of a cell are rounding.
const ROUNDING: f64 = 1e-10;

/// A lattice whose cell `[i, j, k]` is the parallelepiped about `origin + i a + j b + k c` with the sides `a`, `b`, `c`.
#[derive(Clone, Copy, Debug)]
pub struct Cells(DAffine3);

impl Cells {
    /// The cells about an origin with these sides, which are linearly independent.
    pub fn new(origin: [f64; 3], sides: [[f64; 3]; 3]) -> Self {
        let [a, b, c] = sides.map(Vector::from_array);
        let matrix = DMat3::from_cols(a, b, c);
        Self(DAffine3::from_mat3_translation(matrix, origin.into()))
    }
}

/// How much of every cell of a lattice surfaces enclose.
#[derive(Clone, Debug)]
pub struct Filling {
    cells: Cells,
    pieces: Vec<Piece>,
}

/// What a piece of a surface in one cell adds: to this cell, and to each one before it along the last axis, in volumes of a cell.
#[derive(Clone, Copy, Debug)]
struct Piece {
    cell: [i64; 3],
    here: f64,
    before: f64,
}

impl Filling {
    /// By a closed surface: exactly, by the divergence theorem along the last axis, from its triangles cut at the cells. None if a triangle
    /// reaches over more than 256 cells along an axis.
    pub fn of(mesh: &TriangleMesh, cells: Cells) -> Option<Self> {
        let to_cells = cells.0.inverse();
        let sign = cells.0.matrix3.determinant().signum();
        let of_faces = |faces: &[[u32; 3]]| {
            let mut pieces = Vec::new();
            for &face in faces {
                let corners = mesh.corners(face).map(|x| to_cells.transform_point3(x));
                let [a, b, c] = corners;
                let reach = (b - a).abs().max((c - a).abs()).max_element();
                let is_near = corners.iter().all(|x| x.abs().max_element() < FARTHEST);
                if !(reach <= MOST_CELLS && is_near) {
                    return None;
                }
                cut(&corners, 0, [0; 3], &mut |cell, polygon| {
                    pieces.push(Piece::of(cell, polygon, sign));
                });
            }
            Some(pieces)
        };
        let pieces: Option<Vec<Vec<Piece>>> = mesh.faces.par_chunks(CHUNK).map(of_faces).collect();
        Some(Self {
            cells,
            pieces: pieces?.concat(),
        })
    }

    /// By whole cells in rows along the last axis: those up to each of these cells are added, or taken away.
    pub fn of_rows(cells: Cells, ends: impl Iterator<Item = ([i64; 3], bool)>) -> Self {
        let piece = |(cell, is_added)| {
            let whole = if is_added { 1.0 } else { -1.0 };
            Piece {
                cell,
                here: whole,
                before: whole,
            }
        };
        Self {
            cells,
            pieces: ends.map(piece).collect(),
        }
    }

    /// The cells of which more, or less, is filled than by another surface, and how much of them.
    fn excess_over(&self, other: &Self) -> Vec<([i64; 3], f64)> {
        let taken = other.pieces.iter().map(|piece| Piece {
            here: -piece.here,
            before: -piece.before,
            ..*piece
        });
        let mut pieces: Vec<Piece> = self.pieces.iter().copied().chain(taken).collect();
        // Along each row from its end.
        pieces.sort_by_key(|piece| ([piece.cell[0], piece.cell[1]], -piece.cell[2]));
        let mut found = Vec::new();
        for row in pieces.chunk_by(|a, b| a.cell[..2] == b.cell[..2]) {
            let mut behind = 0.0_f64;
            let mut last = row[0].cell;
            for group in row.chunk_by(|a, b| a.cell == b.cell) {
                let cell = group[0].cell;
                if behind.abs() > ROUNDING {
                    let most = cell[2].max(last[2] - MOST_CELLS as i64);
                    let between = (most + 1..last[2]).rev();
                    found.extend(between.map(|k| ([cell[0], cell[1], k], behind)));
                }
                let here = behind + group.iter().map(|piece| piece.here).sum::<f64>();
                found.push((cell, here));
                behind += group.iter().map(|piece| piece.before).sum::<f64>();
                last = cell;
            }
        }
        found.retain(|(_, part)| part.abs() > ROUNDING);
        found
    }
}

impl Piece {
    /// A polygon within a cell.
    fn of(cell: [i64; 3], polygon: &[Vector], sign: f64) -> Self {
        let bottom = cell[2] as f64 - 0.5;
        let (mut here, mut before) = (0.0, 0.0);
        for pair in polygon[1..].windows(2) {
            let corners = [polygon[0], pair[0], pair[1]];
            let area = 0.5 * sign * scaled_normal(corners).z;
            let height = corners.iter().map(|x| x.z - bottom).sum::<f64>() / 3.0;
            here += area * height;
            before += area;
        }
        Self { cell, here, before }
    }
}

/// Cuts a convex polygon at the sides of the cells, along this axis and those after it.
fn cut(
    polygon: &[Vector],
    axis: usize,
    mut cell: [i64; 3],
    emit: &mut dyn FnMut([i64; 3], &[Vector]),
) {
    if axis == 3 {
        emit(cell, polygon);
        return;
    }
    let of = |x: f64| (x + 0.5).floor() as i64;
    let along = polygon.iter().map(|x| x[axis]);
    let low = of(along.clone().fold(f64::INFINITY, f64::min));
    let high = of(along.fold(f64::NEG_INFINITY, f64::max));
    for place in low..=high {
        cell[axis] = place;
        if low == high {
            cut(polygon, axis + 1, cell, emit);
            continue;
        }
        let side = place as f64 - 0.5;
        let above = half(polygon, |x| x[axis] - side);
        let within = half(&above, |x| side + 1.0 - x[axis]);
        if within.len() > 2 {
            cut(&within, axis + 1, cell, emit);
        }
    }
}

/// The part of a convex polygon where a linear function is not negative.
fn half(polygon: &[Vector], function: impl Fn(Vector) -> f64) -> Vec<Vector> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &x) in polygon.iter().enumerate() {
        let y = polygon[(i + 1) % polygon.len()];
        let (a, b) = (function(x), function(y));
        if a >= 0.0 {
            kept.push(x);
        }
        if (a < 0.0) != (b < 0.0) {
            kept.push(x.lerp(y, a / (a - b)));
        }
    }
    kept
}

impl TriangleMesh {
    /// The closed surface moved along its normals so that near every place it encloses as much as `filling` says.
    ///
    /// A vertex goes by the average of the missing volume over that of the area, both weighted by a Gaussian of standard deviation `width`
    /// about it. So waves of the surface that are longer than some five widths stay with the cells, and shorter ones with the surface.
    pub fn with_filling(&self, filling: &Filling, width: f64) -> Self {
        let mut moved = self.clone();
        for _ in 0..ROUNDS {
            let Some(now) = Filling::of(&moved, filling.cells) else {
                break;
            };
            let missing = filling.excess_over(&now);
            let bins = Bins::of(&moved, filling.cells, &missing, width);
            let normals = moved.vertex_normals();
            let pairs = moved.vertices.par_iter().zip(&normals);
            let ways = pairs.map(|(&x, &normal)| {
                let length = bins.average(Vector::from_array(x));
                length.clamp(-LONGEST * width, LONGEST * width) * Vector::from_array(normal)
            });
            moved = moved.moved_by(&ways.collect::<Vec<_>>());
        }
        Self {
            normals: self.normals.clone(),
            ..moved
        }
    }
}

/// Missing volumes, and areas of a surface, added up in cubes, and taken to be in their middle there.
struct Bins {
    origin: Vector,
    width: f64,
    /// Of each bin, in ascending order.
    keys: Vec<[i64; 3]>,
    all: Vec<Bin>,
    /// The bins within reach of each bin.
    near: Vec<Vec<usize>>,
}

#[derive(Clone, Copy, Default)]
struct Bin {
    missing: Heap,
    area: Heap,
}

/// Weights at places.
#[derive(Clone, Copy, Default)]
struct Heap {
    sum: f64,
    /// The sum of the absolute values of the weights.
    size: f64,
    /// The sum of the absolute values of the weights times the places; after [`Heap::finish`] the middle of the places.
    middle: Vector,
}

impl Heap {
    fn add(&mut self, weight: f64, x: Vector) {
        self.sum += weight;
        self.size += weight.abs();
        self.middle += weight.abs() * x;
    }

    fn finish(&mut self) {
        if self.size > 0.0 {
            self.middle /= self.size;
        }
    }

    /// All that is there, times the value of a Gaussian about `x` in the middle.
    fn seen_from(&self, x: Vector, width: f64) -> f64 {
        if self.size > 0.0 {
            let far = x.distance(self.middle) / width;
            self.sum * (-0.5 * far * far).exp()
        } else {
            0.0
        }
    }
}

impl Bins {
    fn of(mesh: &TriangleMesh, cells: Cells, missing: &[([i64; 3], f64)], width: f64) -> Self {
        // They go with the cells, and no plane of cells lies on a side of them, where rounding would decide.
        let origin = cells.0.translation - OFFSET * width;
        let volume = cells.0.matrix3.determinant().abs();
        let missing = missing.iter().map(|(cell, part)| {
            let x = cells.0.transform_point3(cell.map(|i| i as f64).into());
            (x, part * volume)
        });
        // In the order of their places, so that sums do not depend on chance.
        let mut bins: BTreeMap<[i64; 3], Bin> = BTreeMap::new();
        for (x, volume) in missing {
            let bin = bins.entry(key(x - origin, width)).or_default();
            bin.missing.add(volume, x);
        }
        for &face in &mesh.faces {
            let corners = mesh.corners(face);
            let third = scaled_normal(corners).length() / 6.0;
            for x in corners {
                let bin = bins.entry(key(x - origin, width)).or_default();
                bin.area.add(third, x);
            }
        }
        for bin in bins.values_mut() {
            bin.missing.finish();
            bin.area.finish();
        }
        let (keys, all): (Vec<_>, Vec<_>) = bins.into_iter().unzip();
        Self {
            origin,
            width,
            near: near(&keys),
            keys,
            all,
        }
    }

    /// The missing volume over the area about a vertex.
    fn average(&self, x: Vector) -> f64 {
        let key = key(x - self.origin, self.width);
        let Ok(own) = self.keys.binary_search(&key) else {
            return 0.0;
        };
        let (mut missing, mut area) = (0.0, 0.0);
        for &near in &self.near[own] {
            let bin = &self.all[near];
            missing += bin.missing.seen_from(x, self.width);
            area += bin.area.seen_from(x, self.width);
        }
        if area > 0.0 { missing / area } else { 0.0 }
    }
}

/// The bin of a place, from where the bins begin.
fn key(x: Vector, width: f64) -> [i64; 3] {
    (x / (BIN * width)).floor().to_array().map(|i| i as i64)
}

/// The bins within reach of each bin, in order.
fn near(keys: &[[i64; 3]]) -> Vec<Vec<usize>> {
    let reach = (REACH / BIN).ceil() as i64;
    let mut rows: HashMap<[i64; 2], Range<usize>> = HashMap::new();
    for (number, &[i, j, _]) in keys.iter().enumerate() {
        let row = rows.entry([i, j]).or_insert(number..number);
        row.end = number + 1;
    }
    // Rows within reach, and how far along each of them.
    let steps = (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |j| [i, j]));
    let steps = steps.filter_map(|[i, j]| {
        let rest = reach * reach - i * i - j * j;
        (rest >= 0).then(|| ([i, j], rest.isqrt()))
    });
    let steps: Vec<([i64; 2], i64)> = steps.collect();
    let about = |&[i, j, k]: &[i64; 3]| -> Vec<usize> {
        let around = steps.iter().filter_map(|&([di, dj], along)| {
            let row = rows.get(&[i + di, j + dj])?.clone();
            let own = &keys[row.clone()];
            let first = own.partition_point(|key| key[2] < k - along);
            let after = own.partition_point(|key| key[2] <= k + along);
            Some(row.start + first..row.start + after)
        });
        around.flatten().collect()
    };
    keys.par_iter().map(about).collect()
}

//! Which bricks are active: those near the interface.

use std::sync::Arc;

use geometry::{Bricks, Lookup, Nodes, PhaseField, Row, Stored, parallel};

use crate::{DeviceField, Error};

/// Bricks nearer to the interface than this are active, in units of `eps`: the phase field ends where it differs from the pure phases by
/// `1e-5`, which changes a flow by a millionth of its motion.
pub const REACH: f64 = 8.0;
/// When the interface has come nearer to the edge than this, the set is too small.
const MARGIN: f64 = 5.0;
/// Nodes are worked on in pieces of this many.
const CHUNK: usize = 1 << 14;

/// Nodes in bricks of `side` cells near the interface of a phase field that may be stored in another way.
///
/// # Errors
/// [`Error::NoInterface`], [`Error::Geometry`] if the grid cannot be divided into such bricks.
pub(crate) fn near<const D: usize>(
    u: &impl PhaseField<D>,
    side: usize,
    eps: f64,
) -> Result<Nodes<D>, Error> {
    let grid = *u.nodes().grid();
    let all = Bricks::<D>::new(grid.cells(), side, |_| false, |_| false)?;
    let reached = reached(&all, u.nodes(), u.values(), REACH * eps);
    let bricks = Bricks::new(
        grid.cells(),
        side,
        |place| reached[all.flat(place)],
        |place| u.at(place.map(|at| at * side)) > 0.0,
    )?;
    if bricks.is_empty() {
        return Err(Error::NoInterface);
    }
    Ok(Nodes::on_bricks(grid, Arc::new(bricks)))
}

/// The nodes of the bricks near the interface of `u`, if it is on others. Where the interface has vanished, all stay.
pub(crate) fn following<const D: usize>(
    u: &DeviceField<D>,
    eps: f64,
) -> Result<Option<Nodes<D>>, Error> {
    let Some(bricks) = u.nodes().bricks() else {
        return Ok(None);
    };
    let stored = u.stored()?;
    let near = reached(bricks, u.nodes(), stored.values(), REACH * eps);
    if !near.contains(&true) {
        return Ok(None);
    }
    replaced(&stored, bricks, |place| near[bricks.flat(place)])
}

/// The nodes of those bricks and of the bricks near the interface of `u`, if that has come near their edge.
pub(crate) fn enlarged<const D: usize>(
    u: &DeviceField<D>,
    eps: f64,
) -> Result<Option<Nodes<D>>, Error> {
    let Some(bricks) = u.nodes().bricks() else {
        return Ok(None);
    };
    let stored = u.stored()?;
    let needed = reached(bricks, u.nodes(), stored.values(), MARGIN * eps);
    let places = (0..needed.len()).filter(|&brick| needed[brick]);
    let missing = places
        .map(|brick| bricks.place(brick))
        .any(|place| bricks.number(place).is_none());
    if !missing {
        return Ok(None);
    }
    let near = reached(bricks, u.nodes(), stored.values(), REACH * eps);
    replaced(&stored, bricks, |place| {
        near[bricks.flat(place)] || bricks.number(place).is_some()
    })
}

/// The nodes of the bricks that are `active`, in place of those of `u`, if they are others.
fn replaced<const D: usize>(
    u: &Stored<D>,
    bricks: &Bricks<D>,
    active: impl Fn([usize; D]) -> bool,
) -> Result<Option<Nodes<D>>, Error> {
    let positive = |place| match bricks.number(place) {
        Some(number) => u.values()[number * bricks.volume()] > 0.0,
        None => bricks.is_positive(place),
    };
    let next = Bricks::new(bricks.cells(), bricks.side(), active, positive)?;
    let nodes = |next| Nodes::on_bricks(*u.grid(), Arc::new(next));
    Ok((next != *bricks).then(|| nodes(next)))
}

/// For every place of a brick, whether a cell there is within `reach` of one beside a change of sign; which bricks are stored does not matter.
fn reached<const D: usize>(
    bricks: &Bricks<D>,
    nodes: &Nodes<D>,
    u: &[f64],
    reach: f64,
) -> Vec<bool> {
    let (side, per_axis) = (bricks.side(), bricks.per_axis());
    let mut cells_of = vec![Vec::new(); per_axis.pow(D as u32)];
    for place in interface(nodes, u) {
        let brick = bricks.flat(place.map(|at| at / side));
        cells_of[brick].push(place.map(|at| (at % side) as i64));
    }
    let reach = reach / nodes.grid().spacing();
    let furthest = (reach / side as f64).floor() as i64 + 1;
    let offsets = 2 * furthest + 1;
    let holders = (0..cells_of.len()).filter(|&brick| !cells_of[brick].is_empty());
    let holders: Vec<usize> = holders.collect();
    let offset = |mut number: i64| -> [i64; D] {
        std::array::from_fn(|_| {
            let offset = number % offsets - furthest;
            number /= offsets;
            offset
        })
    };
    let reached = parallel::map(holders.len(), 1, &|holder| -> Vec<usize> {
        let (cells, place) = (&cells_of[holders[holder]], bricks.place(holders[holder]));
        let bounds = bounds(cells);
        let within =
            |cells: [[i64; D]; 2], offset| distance(cells, offset, side as i64) <= reach * reach;
        (0..offsets.pow(D as u32))
            .map(offset)
            .filter(|&offset| {
                let mut cells = cells.iter();
                within(bounds, offset) && cells.any(|&cell| within([cell; 2], offset))
            })
            .map(|offset| {
                bricks.flat(std::array::from_fn(|axis| {
                    (place[axis] as i64 + offset[axis]).rem_euclid(per_axis as i64) as usize
                }))
            })
            .collect()
    });
    let mut near = vec![false; cells_of.len()];
    for brick in reached.into_iter().flatten() {
        near[brick] = true;
    }
    near
}

/// The least and the greatest place along each axis of some cells.
fn bounds<const D: usize>(cells: &[[i64; D]]) -> [[i64; D]; 2] {
    let along = |axis: usize| cells.iter().map(move |cell| cell[axis]);
    [
        std::array::from_fn(|axis| along(axis).min().unwrap_or_default()),
        std::array::from_fn(|axis| along(axis).max().unwrap_or_default()),
    ]
}

/// The square of the distance between the cells from the least to the greatest of these places and the brick that is so many bricks away.
fn distance<const D: usize>([least, greatest]: [[i64; D]; 2], offset: [i64; D], side: i64) -> f64 {
    let squares = (0..D).map(|axis| {
        let first = offset[axis] * side;
        let gap = (first - greatest[axis]).max(least[axis] - (first + side - 1));
        gap.max(0).pow(2)
    });
    squares.sum::<i64>() as f64
}

/// The places of the nodes beside which `u` changes its sign.
fn interface<const D: usize>(nodes: &Nodes<D>, u: &[f64]) -> Vec<[usize; D]> {
    let (length, share) = (nodes.row_length(), CHUNK / nodes.row_length());
    let Some(bricks) = nodes.bricks() else {
        let rows = parallel::map(u.len() / length, share, &|row| {
            changes_in_row(nodes, u, row * length)
        });
        return rows.concat();
    };
    let (volume, mixed) = (bricks.volume(), mixed_bricks(bricks, u));
    let found = parallel::map(mixed.len(), 1, &|number| -> Vec<[usize; D]> {
        let first = mixed[number] * volume;
        let rows = (first..first + volume).step_by(length);
        rows.flat_map(|first| changes_in_row(nodes, u, first))
            .collect()
    });
    found.concat()
}

/// The places in the row from `first` on beside which `u` changes its sign.
fn changes_in_row<const D: usize>(nodes: &Nodes<D>, u: &[f64], first: usize) -> Vec<[usize; D]> {
    let row = nodes.row(first);
    let mut changes = vec![false; row.length];
    mark_changes(&row, u, &mut changes);
    let changed = changes.iter().enumerate().filter(|(_, changes)| **changes);
    changed
        .map(|(at, _)| {
            let mut place = row.place;
            place[D - 1] += at;
            place
        })
        .collect()
}

/// Marks the nodes of a row beside which `u` changes its sign.
fn mark_changes<const D: usize>(row: &Row<D>, u: &[f64], changes: &mut [bool]) {
    let (last, values) = (row.length - 1, &u[row.first..][..row.length]);
    for axis in 0..D - 1 {
        for beside in row.beside(0, axis) {
            match beside {
                Lookup::Stored(first) => mark(changes, values, &u[first..][..row.length]),
                Lookup::Pure { positive } => {
                    let own = changes.iter_mut().zip(values);
                    own.for_each(|(changes, own)| *changes |= (*own > 0.0) != positive);
                }
            }
        }
    }
    mark(&mut changes[1..], &values[1..], values);
    mark(&mut changes[..last], values, &values[1..]);
    let ends = [row.beside(0, D - 1)[0], row.beside(last, D - 1)[1]];
    for (at, beside) in [0, last].into_iter().zip(ends) {
        changes[at] |= (values[at] > 0.0) != is_positive(u, beside);
    }
}

/// Marks where the signs of two rows differ.
fn mark(changes: &mut [bool], own: &[f64], beside: &[f64]) {
    for ((changes, own), beside) in changes.iter_mut().zip(own).zip(beside) {
        *changes |= (*own > 0.0) != (*beside > 0.0);
    }
}

/// Whether `u` is positive there.
fn is_positive(u: &[f64], found: Lookup) -> bool {
    match found {
        Lookup::Stored(node) => u[node] > 0.0,
        Lookup::Pure { positive } => positive,
    }
}

/// The numbers of the bricks that hold nodes beside which `u` may change its sign: those of one sign with others of that sign around them do not.
fn mixed_bricks<const D: usize>(bricks: &Bricks<D>, u: &[f64]) -> Vec<usize> {
    let volume = bricks.volume();
    let sign = |brick: usize| -> Option<bool> {
        let values = &u[brick * volume..][..volume];
        let positive = values.iter().filter(|u| **u > 0.0).count();
        (positive == 0 || positive == volume).then_some(positive > 0)
    };
    let signs = parallel::map(bricks.places().len(), 1, &sign);
    let beside = |place: [usize; D]| match bricks.number(place) {
        Some(number) => signs[number],
        None => Some(bricks.is_positive(place)),
    };
    let is_mixed = |brick: &usize| {
        let place = bricks.places()[*brick];
        signs[*brick].is_none()
            || (0..D).any(|axis| {
                [1, bricks.per_axis() - 1].into_iter().any(|step| {
                    let mut next = place;
                    next[axis] = (next[axis] + step) % bricks.per_axis();
                    beside(next) != signs[*brick]
                })
            })
    };
    (0..signs.len()).filter(is_mixed).collect()
}

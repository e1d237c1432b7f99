//! Which bricks are active: those near the interface.

use std::sync::Arc;

use geometry::{Bricks, Grid, Nodes, PhaseField, parallel};
use model::{BrickOperator, SeparableOperator};
use operators::ComputeDevice;

use crate::Error;

/// Bricks nearer to the interface than this are active, in units of `eps`: the phase field ends where it differs from the pure phases by
/// `1e-5`, which changes a flow by a millionth of its motion.
const REACH: f64 = 8.0;
/// When the interface has come nearer to the edge than this, the set is too small.
const MARGIN: f64 = 5.0;
/// Nodes are worked on in pieces of this many.
const CHUNK: usize = 1 << 14;

/// The active bricks of a flow.
#[derive(Clone)]
pub(crate) struct Active<const D: usize> {
    operator: SeparableOperator<D>,
    eps: f64,
    pub(crate) grid: Grid<D>,
    pub(crate) bricks: Arc<Bricks<D>>,
}

impl<const D: usize> Active<D> {
    /// The bricks near the interface of a phase field.
    pub(crate) fn new(
        operator: SeparableOperator<D>,
        initial: &impl PhaseField<D>,
        eps: f64,
    ) -> Result<Self, Error> {
        let grid = *initial.nodes().grid();
        let none = Bricks::new(grid.cells(), operator.brick_side(), |_| false, |_| false)?;
        let nothing = Self {
            operator,
            eps,
            grid,
            bricks: Arc::new(none),
        };
        nothing.following_field(initial)
    }

    /// These bricks.
    pub(crate) fn at(&self, bricks: Arc<Bricks<D>>) -> Self {
        Self {
            bricks,
            ..self.clone()
        }
    }

    /// Where their cells lie.
    pub(crate) fn nodes(&self) -> Nodes<D> {
        Nodes::on_bricks(self.grid, self.bricks.clone())
    }

    /// The step of mean curvature flow on them.
    pub(crate) fn step(&self, device: &ComputeDevice) -> BrickOperator<D> {
        self.operator.on(&self.bricks, device)
    }

    /// The values of a phase field in the negative and in the positive phase, where nothing is stored.
    pub(crate) fn rests(&self) -> [f64; 2] {
        self.operator.rests()
    }

    /// Those near the interface of a phase field that is stored in another way.
    pub(crate) fn following_field(&self, u: &impl PhaseField<D>) -> Result<Self, Error> {
        let near = self.near(u.nodes(), u.values(), REACH);
        let side = self.bricks.side();
        let bricks = Bricks::new(
            self.grid.cells(),
            side,
            |place| near[self.bricks.flat(place)],
            |place| u.at(place.map(|at| at * side)) > 0.0,
        )?;
        if bricks.is_empty() {
            return Err(Error::NoInterface);
        }
        Ok(self.at(Arc::new(bricks)))
    }

    /// Those near the interface of `u`, if they are others. Where the interface has vanished, all stay.
    pub(crate) fn following(&self, u: &[f64]) -> Result<Option<Self>, Error> {
        let near = self.near(&self.nodes(), u, REACH);
        if !near.contains(&true) {
            return Ok(None);
        }
        self.replaced(u, |place| near[self.bricks.flat(place)])
    }

    /// The set with the bricks near the interface of `u`, if that has come near its edge.
    pub(crate) fn enlarged(&self, u: &[f64]) -> Result<Option<Self>, Error> {
        let needed = self.near(&self.nodes(), u, MARGIN);
        let places = (0..needed.len()).filter(|&brick| needed[brick]);
        let missing = places
            .map(|brick| self.bricks.place(brick))
            .any(|place| self.bricks.number(place).is_none());
        if !missing {
            return Ok(None);
        }
        let near = self.near(&self.nodes(), u, REACH);
        self.replaced(u, |place| {
            near[self.bricks.flat(place)] || self.bricks.number(place).is_some()
        })
    }

    fn replaced(
        &self,
        u: &[f64],
        active: impl Fn([usize; D]) -> bool,
    ) -> Result<Option<Self>, Error> {
        let positive = |place| match self.bricks.number(place) {
            Some(number) => u[number * self.bricks.volume()] > 0.0,
            None => self.bricks.is_positive(place),
        };
        let bricks = Bricks::new(self.grid.cells(), self.bricks.side(), active, positive)?;
        Ok((bricks != *self.bricks).then(|| self.at(Arc::new(bricks))))
    }

    /// For every brick of the grid, whether a cell of it is within `reach eps` of one beside a change of sign.
    fn near(&self, nodes: &Nodes<D>, u: &[f64], reach: f64) -> Vec<bool> {
        let (side, per_axis) = (self.bricks.side(), self.bricks.per_axis());
        let mut cells_of = vec![Vec::new(); per_axis.pow(D as u32)];
        for place in interface(nodes, u) {
            let brick = self.bricks.flat(place.map(|at| at / side));
            cells_of[brick].push(place.map(|at| (at % side) as i64));
        }
        let reach = reach * self.eps / self.grid.spacing();
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
            let (cells, place) = (
                &cells_of[holders[holder]],
                self.bricks.place(holders[holder]),
            );
            (0..offsets.pow(D as u32))
                .map(offset)
                .filter(|offset| {
                    let mut cells = cells.iter();
                    cells.any(|cell| distance(*cell, *offset, side as i64) <= reach * reach)
                })
                .map(|offset| {
                    self.bricks.flat(std::array::from_fn(|axis| {
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
}

/// The square of the distance of a cell to the nearest one of the brick that is so many bricks away.
fn distance<const D: usize>(cell: [i64; D], offset: [i64; D], side: i64) -> f64 {
    let squares = (0..D).map(|axis| {
        let first = offset[axis] * side;
        let gap = (first - cell[axis]).max(cell[axis] - (first + side - 1));
        gap.max(0).pow(2)
    });
    squares.sum::<i64>() as f64
}

/// The places of the nodes beside which `u` changes its sign.
fn interface<const D: usize>(nodes: &Nodes<D>, u: &[f64]) -> Vec<[usize; D]> {
    parallel::filter_map(u.len(), CHUNK, &|node| {
        let place = nodes.place(node);
        let positive = u[node] > 0.0;
        let changes = (0..D).any(|axis| {
            let beside = nodes.along(node, place, axis, [-1, 1]);
            beside.into_iter().any(|beside| {
                positive != beside.map_or_else(|positive| positive, |node| u[node] > 0.0)
            })
        });
        changes.then_some(place)
    })
}

//! Which side of a mesh that folds over itself a node is on.

use std::sync::Arc;

use geometry::{Bricks, Lookup, Nodes, PhaseField, Stored};

/// Makes the signs of a distance agree where no surface is between: two neighbouring nodes that are both further than half a cell
/// from the surface are on the same side. Noise folds the triangles of a scan, and where they are folded the sign of the
/// distance is that of the wrong sheet, along whole rays. What is joined to the side of the box is outside; of other parts
/// the majority decides. Returns how many signs were changed, too.
pub fn mend_signs(distance: Stored<3>) -> (Stored<3>, usize) {
    let mut sides = Sides::of(distance);
    for start in 0..sides.inside.len() {
        if !std::mem::replace(&mut sides.seen[start], true) {
            sides.agree(start);
        }
    }
    sides.finish()
}

/// The sides that the nodes are on, and after them the bricks of which nothing is stored, by their places.
struct Sides {
    distance: Stored<3>,
    inside: Vec<bool>,
    /// Those near the surface, those that are settled, and bricks that are stored.
    seen: Vec<bool>,
    changed: usize,
}

impl Sides {
    fn of(distance: Stored<3>) -> Self {
        // A flat face in the middle between nodes, the farthest from both, is near the one and the other.
        let clear = 0.5 * (1.0 + 1e-9) * distance.grid().spacing();
        let values = distance.values();
        let mut inside: Vec<bool> = values.iter().map(|s| *s < 0.0).collect();
        let mut seen: Vec<bool> = values.iter().map(|s| s.abs() <= clear).collect();
        if let Some(bricks) = distance.nodes().bricks() {
            let places = (0..bricks.per_axis().pow(3)).map(|brick| bricks.place(brick));
            for place in places {
                inside.push(bricks.is_positive(place));
                seen.push(bricks.number(place).is_some());
            }
        }
        Self {
            distance,
            inside,
            seen,
            changed: 0,
        }
    }

    /// The nodes along each axis that a node or a brick has, and the first of them.
    fn extent(&self, one: usize) -> (usize, [usize; 3]) {
        let nodes = self.distance.nodes();
        match (one.checked_sub(nodes.len()), nodes.bricks()) {
            (Some(brick), Some(bricks)) => {
                let side = bricks.side();
                (side, bricks.place(brick).map(|i| i * side))
            }
            _ => (1, nodes.multi_index(one)),
        }
    }

    /// What is at a place of the grid.
    fn at(&self, place: [usize; 3]) -> usize {
        let nodes = self.distance.nodes();
        match (nodes.at(place), nodes.bricks()) {
            (Lookup::Stored(node), _) => node,
            (Lookup::Pure { .. }, Some(bricks)) => {
                nodes.len() + bricks.flat(place.map(|i| i / bricks.side()))
            }
            (Lookup::Pure { .. }, None) => unreachable!("all of the grid is stored"),
        }
    }

    /// Puts all that is joined to one of them on the same side.
    fn agree(&mut self, start: usize) {
        let cells = self.distance.grid().cells();
        let (mut part, mut next) = (vec![start], 0);
        let (mut inside, mut all, mut at_side) = (0, 0, false);
        while let Some(&one) = part.get(next) {
            next += 1;
            let (side, first) = self.extent(one);
            all += side.pow(3);
            inside += if self.inside[one] { side.pow(3) } else { 0 };
            for axis in 0..3 {
                let [before, after] = [first[axis].checked_sub(1), Some(first[axis] + side)];
                let after = after.filter(|&after| after < cells);
                at_side |= before.is_none() || after.is_none();
                for beyond in before.into_iter().chain(after) {
                    for k in 0..side * side {
                        let mut place = first;
                        place[axis] = beyond;
                        place[(axis + 1) % 3] += k / side;
                        place[(axis + 2) % 3] += k % side;
                        let neighbour = self.at(place);
                        if !std::mem::replace(&mut self.seen[neighbour], true) {
                            part.push(neighbour);
                        }
                    }
                }
            }
        }
        let is_inside = !at_side && 2 * inside > all;
        self.changed += if is_inside { all - inside } else { inside };
        for one in part {
            self.inside[one] = is_inside;
        }
    }

    fn finish(self) -> (Stored<3>, usize) {
        let Self {
            distance,
            inside,
            changed,
            ..
        } = self;
        let (mut nodes, phase_values) = (distance.nodes().clone(), distance.phase_values());
        let (of_nodes, of_bricks) = inside.split_at(nodes.len());
        if let Some(old) = nodes.bricks().filter(|_| changed > 0) {
            let bricks = Bricks::new(
                old.cells(),
                old.side(),
                |place| old.number(place).is_some(),
                |place| of_bricks[old.flat(place)],
            );
            let bricks = bricks.expect("they have been made before");
            nodes = Nodes::on_bricks(*nodes.grid(), Arc::new(bricks));
        }
        let values = distance.into_values().into_iter().zip(of_nodes);
        let values = values.map(|(s, inside)| if *inside { -s.abs() } else { s.abs() });
        (Stored::new(values.collect(), nodes, phase_values), changed)
    }
}

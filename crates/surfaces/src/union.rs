//! Distances of bodies that overlap.

use std::sync::Arc;

use geometry::{Bricks, Nodes, PhaseField, Stored};

/// The distance to the union of two bodies, by their distances on one grid: the lesser of both. It is exact outside, and within it is that to the nearest
/// surface of one of the bodies, also where that is within the other one.
pub fn united(one: &Stored<3>, other: &Stored<3>) -> Stored<3> {
    let nodes = nodes_of_both(one, other);
    let values = (0..nodes.len()).map(|node| {
        let place = nodes.multi_index(node);
        one.at(place).min(other.at(place))
    });
    Stored::new(values.collect(), nodes, one.phase_values())
}

/// The nodes that one of them stores.
fn nodes_of_both(one: &Stored<3>, other: &Stored<3>) -> Nodes<3> {
    let (Some(first), Some(second)) = (one.nodes().bricks(), other.nodes().bricks()) else {
        let is_whole = one.nodes().bricks().is_none();
        return (if is_whole { one } else { other }).nodes().clone();
    };
    let both = [first, second];
    let bricks = Bricks::new(
        first.cells(),
        first.side(),
        |place| both.iter().any(|bricks| bricks.number(place).is_some()),
        |place| both.iter().any(|bricks| bricks.is_positive(place)),
    );
    let bricks = bricks.expect("they fit the same grid");
    Nodes::on_bricks(*one.grid(), Arc::new(bricks))
}

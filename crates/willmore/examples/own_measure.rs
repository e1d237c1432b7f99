//! A measure of one's own, evaluated after every step: how far a shape reaches to the right.

use willmore::prelude::*;

/// The largest `x` of the nodes inside.
pub fn reach() -> Measure<2> {
    Measure::new("reach", |u, _time| {
        let nodes = u.nodes();
        let inside = (u.values().iter().enumerate()).filter(|(_, u)| **u > 0.0);
        let xs = inside.map(|(node, _)| nodes.grid().coordinate(0, nodes.multi_index(node)[0]));
        Ok(xs.reduce(f64::max))
    })
}

/// Runs the example; a test does, too.
///
/// # Errors
/// Those of the flow.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let grid = Grid::<2>::per_unit(64, 1.25)?;
    let mut flow = Willmore::on(grid)
        .measure(reach())
        .start(&Cuboid::new([0.3, 0.15])?)?;
    let start = flow.start()["reach"];
    for record in flow.take(5) {
        let record = record?;
        println!(
            "t = {:.2e}: reaches to {:.4}",
            record.time,
            record.measure("reach").unwrap()
        );
    }
    let end = flow.records().last().and_then(|last| last.measure("reach"));
    assert!((start - 0.3).abs() < 0.02 && end.is_some());
    Ok(())
}

//! A stop rule of one's own: the flow of a curve ends when it is nearly round.

use willmore::prelude::*;

/// Holds where the isoperimetric quotient `4 pi A / L^2`, 1 for a circle, has come to a value.
pub struct Round {
    /// The quotient at which the flow ends.
    pub quotient: f64,
}

impl StopRule<2> for Round {
    fn name(&self) -> String {
        format!("round to {}", self.quotient)
    }

    fn holds(&self, progress: &Progress<'_, 2>) -> bool {
        let last = progress.records.last();
        let sizes =
            last.and_then(|last| Some((last.measure("volume")?, last.measure("perimeter")?)));
        sizes.is_some_and(|(area, length)| {
            4.0 * std::f64::consts::PI * area / (length * length) >= self.quotient
        })
    }
}

/// Runs the example; a test does, too.
///
/// # Errors
/// Those of the flow.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let grid = Grid::<2>::per_unit(64, 1.25)?;
    let mut flow = Willmore::on(grid)
        .until_rule(Round { quotient: 0.98 })
        .start(&Ellipse::new([0.3, 0.2])?)?;
    while flow.step()?.is_some() {}
    let ended = flow.ended().expect("it is over");
    println!("{ended}, at t = {:.2e}", flow.time());
    assert_eq!(ended, Stop::Own("round to 0.98".to_owned()));
    Ok(())
}

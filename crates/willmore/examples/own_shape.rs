//! A shape of one's own: an egg, by its signed distance, negative inside.

use willmore::prelude::*;

/// Two discs of different radii, and all that is between them: the convex hull, with the exact distance.
pub struct Egg {
    /// Of the discs at both ends.
    pub radii: [f64; 2],
    /// From one centre to the other.
    pub length: f64,
}

impl SignedDistance<2> for Egg {
    /// That of a round cone (Quilez, *Distance functions*), symmetric about the first axis.
    fn signed_distance(&self, [x, y]: [f64; 2]) -> f64 {
        let [first, second] = self.radii;
        let (x, y) = (x + 0.5 * self.length, y.abs());
        let b = (first - second) / self.length;
        let a = (1.0 - b * b).sqrt();
        let along = a * x - b * y;
        if along < 0.0 {
            x.hypot(y) - first
        } else if along > a * self.length {
            (x - self.length).hypot(y) - second
        } else {
            b * x + a * y - first
        }
    }
}

/// Runs the example; a test does, too.
///
/// # Errors
/// Those of the flow.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let egg = Egg {
        radii: [0.25, 0.12],
        length: 0.3,
    };
    let grid = Grid::<2>::per_unit(64, 1.25)?;
    let mut flow = Willmore::on(grid).start(&egg)?;
    for record in flow.take(5) {
        let record = record?;
        println!(
            "t = {:.2e}: w = {:.3}",
            record.time,
            record.willmore_energy().unwrap()
        );
    }
    Ok(())
}

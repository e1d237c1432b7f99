//! A term of the energy of one's own: a drop that bends, weighs something and keeps its area, and sinks.

use burn::tensor::Tensor;
use willmore::prelude::*;

/// `g int y`, over the inside: it weighs `g` per area.
pub struct Gravity {
    /// Weight per area.
    pub g: f64,
}

impl EnergyTerm<2> for Gravity {
    fn density(&self, u: &Tensor<2>, on: &Domain<2>) -> Result<Option<Tensor<2>>, StepError> {
        Ok(Some(on.inside(u) * on.coordinate(1) * self.g))
    }

    fn identity(&self) -> Identity {
        Identity::new("gravity", json!({ "g": self.g }))
    }
}

/// The height of the centre of the inside.
pub fn height() -> Measure<2> {
    Measure::new("height", |u, _time| {
        let (grid, u) = (*u.nodes().grid(), u.field());
        let mut moments = [0.0; 2];
        for (node, u) in u.values().iter().enumerate() {
            let inside = 0.25 * (2.0 + 3.0 * u - u.powi(3));
            moments[0] += inside;
            moments[1] += inside * grid.node(node)[1];
        }
        Ok(Some(moments[1] / moments[0]))
    })
}

/// Runs the example; a test does, too.
///
/// # Errors
/// Those of the flow.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let grid = Grid::per_unit(64, 1.25)?;
    let mut flow = Willmore::on(grid)
        .with(Gravity { g: 2e4 })
        .keep_volume()
        .measure(height())
        .start(&Ellipse::new([0.3, 0.2])?)?;
    let mut last = flow.start()["height"];
    let mut energy = f64::INFINITY;
    for record in flow.take(8) {
        let record = record?;
        let (now, height) = (
            record.willmore_energy().unwrap(),
            record.measure("height").unwrap(),
        );
        println!(
            "t = {:.2e}: energy {now:.3}, height {height:.5}",
            record.time
        );
        assert!(now < energy && height < last);
        (energy, last) = (now, height);
    }
    Ok(())
}

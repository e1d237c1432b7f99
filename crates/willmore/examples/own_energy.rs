//! A term of the energy of one's own: a drop that bends, weighs something and keeps its area, and sinks.

use burn::tensor::Tensor;
use willmore::prelude::*;

/// `g int y`, over the inside: it weighs `g` per area.
pub struct Gravity {
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
pub fn height(u: &Field<2>) -> f64 {
    let inside = |u: f64| 0.25 * (2.0 + 3.0 * u - u.powi(3));
    let nodes = u.values().iter().enumerate();
    let [mass, moment] = nodes.fold([0.0; 2], |[mass, moment], (node, &u)| {
        let [_, y] = u_node(node);
        [mass + inside(u), moment + inside(u) * y]
    });
    moment / mass
}

/// The grid of the example.
pub fn grid() -> Grid<2> {
    Grid::per_unit(64, 1.25).expect("a grid of 80 cells")
}

fn u_node(node: usize) -> [f64; 2] {
    grid().node(node)
}

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let drop = Ellipse::new([0.3, 0.2])?;
    let mut flow = Willmore::on(grid())
        .with(Gravity { g: 2e4 })
        .keep_volume()
        .start(&drop)?;
    let start = height(flow.field());
    for record in flow.take(8) {
        let record = record?;
        println!("t = {:.2e}: energy {:.3}", record.time, record.willmore_energy().unwrap());
    }
    let energies: Vec<f64> = (flow.records().iter()).filter_map(Record::willmore_energy).collect();
    let sunk = start - height(flow.field());
    println!("it sank by {sunk:.4}");
    assert!(sunk > 0.0 && energies.windows(2).all(|pair| pair[1] < pair[0]));
    Ok(())
}

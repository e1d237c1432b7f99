//! Takes the noise off a closed mesh by Willmore flow: fair_mesh IN OUT, or the built-in lever with noise.

use engine::{Case, Discretization, Formulation, Method, Operator, Run, Scales, StepRule, Stop};
use geometry::{Grid, Placement, SignedDistance, optimal_profile};
use model::Networks;
use operators::ComputeDevice;
use surfaces::{ClosedMesh, Fairing, MeshDistance, samples};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut mesh = match arguments.next() {
        Some(file) => surfaces::read(&file)?,
        None => samples::lever(64)?.into_mesh(),
    };
    let out = arguments.next();
    if out.is_none() {
        mesh.roughen(0.005, 1);
    }
    let noise = mesh.noise();
    let fairing = Fairing::new(ClosedMesh::new(mesh)?.0, noise, |_| false);

    // The phase field: the mesh in the unit box, by its signed distance.
    let grid = Grid::<3>::per_unit(64, 1.0)?;
    let scales = Scales::of_grid(grid.spacing(), 2.0);
    let placement = Placement::fit(&fairing.start.bounding_box(), &grid, 0.8)?;
    let distance = MeshDistance::new(&fairing.start.placed(&placement));
    let initial = geometry::Field::from_fn(grid, |x| {
        optimal_profile(distance.signed_distance(x), scales.eps)
    });
    let followed = fairing.follow(placement, &initial, scales.eps)?;
    let networks = Networks::default();
    let needed = scales.needs(3, grid.spacing());
    let accurate = Discretization::new(Method::Hybrid, Formulation::Accurate);
    let operator = Operator::new(accurate, &networks, &needed, &grid, &scales)?;
    let steps = StepRule::Doubling(Fairing::first_step(grid.spacing()));
    let case = Case {
        stops: vec![Stop::Time(fairing.time(grid.spacing(), placement.scale()))],
        measures: Vec::new(),
        ..Case::willmore("mesh", initial, operator, scales, steps, 0)
    };
    let mut run = Run::new(case, &ComputeDevice::default_compiled()?)?;
    // As far as the noise is.
    while run.step()?.is_some()
        && fairing.displacement(&followed, run.field())? < fairing.farthest()
    {}
    let faired = fairing.faired(&followed, run.field())?;
    println!("noise about {noise:.5} before, {:.5} after", faired.noise());
    if let Some(out) = out {
        surfaces::write(out, &faired)?;
    }
    Ok(())
}

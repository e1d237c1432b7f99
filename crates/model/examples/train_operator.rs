//! Trains a learned mean-curvature operator by the accurate recipe in its quick form, and plots its activation `F` and its kernel.

use model::Ratios;
use model::training::least_squares::LeastSquaresParams;
use model::training::{Checkpoint, SphereData, Training, TrainingProgress};
use operators::ComputeDevice;
use report::{Axis, Figure, LineChart, OutputDir, Series};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let ratios = Ratios {
        dimension: 2,
        width: 17,
        eps_over_h: 2.0,
        step_over_h2: 1.0,
    };
    let training = Training {
        recipe: &LeastSquaresParams::new(true),
        data: SphereData::new(ratios, 128)?.quick(),
        seed: 1,
        held_out: 4,
    };
    let mut told = |at: &TrainingProgress, _: &Checkpoint<()>| {
        println!(
            "iteration {} of {}: loss {:.2e}",
            at.iteration, at.of, at.held_out_loss
        );
        Ok(true)
    };
    let device = ComputeDevice::default_compiled()?;
    let trained = training.run(&mut Checkpoint::default(), &device, &mut told)?;
    println!(
        "loss {:.2e}, of the identity map {:.2e}",
        trained.quality.held_out_loss, trained.quality.identity_loss
    );

    let network = &trained.network;
    let z = (-120..=120).map(|k| f64::from(k) / 100.0);
    let activation = z.map(|z| [z, network.activation().value(z)]);
    let half = ratios.width / 2;
    let middle = &network.kernel()[half * ratios.width..][..ratios.width];
    let kernel = (0..ratios.width).map(|i| [i as f64 - half as f64, middle[i]]);
    let chart = |title, x, y, points: Vec<[f64; 2]>| {
        let curve = Series::new("", points);
        LineChart::new(title, Axis::linear(x), Axis::linear(y)).with_curves([curve])
    };
    let figure = Figure::new("A learned operator", 2)
        .with_panel(chart("activation", "z", "F(z)", activation.collect()))
        .with_panel(chart(
            "kernel through its middle",
            "x / h",
            "K",
            kernel.collect(),
        ));
    let folder = std::env::temp_dir().join("learned_operator");
    figure.write(&OutputDir::create(&folder)?, "operator")?;
    println!("{} shows it", folder.join("operator.png").display());
    Ok(())
}

use engine::quarter_square;
use model::Ratios;
use model::training::least_squares::LeastSquaresParams;
use model::training::{Checkpoint, SphereData, Training, TrainingProgress};

use jobs::check_eps_over_h;
use runs::Interrupt;
use serde_json::json;

use crate::cli::TrainOptions;
use crate::console::Console;
use crate::error::{Error, Result};

/// Cells per unit length of the training grid for `eps = 2h`; it grows with the interface, so that the same spheres fit.
const CELLS: f64 = 128.0;
/// Radii on which the quality is measured.
const HELD_OUT: usize = 20;

pub fn run(mut options: TrainOptions, console: &Console) -> Result<()> {
    let missing = |name: &str| {
        Error::options(format!(
            "train needs --{name}; for example: willmore train --dimension 2 --width 25 --eps-over-h 3 --save mine.safetensors"
        ))
    };
    let eps_over_h = options.eps_over_h.ok_or_else(|| missing("eps-over-h"))?;
    check_eps_over_h(eps_over_h)?;
    let usual_step = quarter_square(eps_over_h);
    let ratios = Ratios {
        dimension: options.dimension.ok_or_else(|| missing("dimension"))?,
        width: options.width.ok_or_else(|| missing("width"))?,
        eps_over_h,
        step_over_h2: options.step_over_h2.unwrap_or(usual_step),
    };
    ratios.validate()?;
    let save = options.save.as_ref().ok_or_else(|| missing("save"))?;
    options.force.check(save)?;
    let device = options.common.open_device()?;
    let mut data = SphereData::new(ratios, (CELLS * eps_over_h / 2.0).round() as usize)?;
    if options.quick {
        data = data.quick();
    }
    let training = Training {
        recipe: &LeastSquaresParams::new(options.quick),
        data,
        seed: options.common.seed,
        held_out: if options.quick { 2 } else { HELD_OUT },
    };
    let interrupt = Interrupt::catch()?;
    let progress = console.progress();
    let bar = progress.bar("training", 1);
    let mut observer = |at: &TrainingProgress, _: &Checkpoint<()>| {
        bar.set_length(at.of as u64);
        bar.set_position(at.iteration as u64);
        Ok(!interrupt.requested())
    };
    let trained = training.run(&mut Checkpoint::default(), &device, &mut observer);
    bar.finish();
    progress.clear();
    if let Err(model::Error::Interrupted { .. }) = &trained {
        console.warn("interrupted: nothing of the training is kept");
    }
    let trained = trained?;
    let loss = trained.quality.held_out_loss;
    let calibration = trained.network.calibration()?;
    trained.network.save(save)?;
    let outcome = json!({
        "command": "train",
        "file": save.to_string_lossy(),
        "ratios": ratios,
        "held_out_loss": loss,
        "calibration": calibration,
    });
    let shown = save.display();
    let text = format!("{ratios}: held-out loss {loss:.2e}; written to {shown}");
    console.report(&outcome, &text)
}

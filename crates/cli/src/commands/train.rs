use jobs::TrainOptions;
use serde_json::json;

use crate::console::Console;
use crate::error::{Error, Result};

/// Trains a network and writes it to a file.
pub fn run(options: TrainOptions, console: &Console) -> Result<()> {
    let (file, trained) = match jobs::train_and_save(options, console) {
        Err(jobs::Error::Interrupted) => {
            console.warn("interrupted: nothing of the training is kept");
            return Err(Error::Interrupted);
        }
        trained => trained?,
    };
    let (ratios, loss) = (trained.ratios, trained.held_out_loss);
    let outcome = json!({
        "command": "train",
        "file": file.to_string_lossy(),
        "ratios": ratios,
        "held_out_loss": loss,
        "calibration": trained.calibration,
    });
    let shown = file.display();
    let text = format!("{ratios}: held-out loss {loss:.2e}; written to {shown}");
    console.report(&outcome, &text)
}

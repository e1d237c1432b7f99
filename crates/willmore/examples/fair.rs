//! Takes the noise off a mesh, whose vertices move while all else of its file stays: fair SCAN SMOOTH, or a noisy lever.

use std::path::Path;

use willmore::prelude::*;

/// Writes the smooth mesh, and returns how far its vertices have gone, root mean square.
///
/// # Errors
/// Those of the job.
pub fn take_off_noise(scan: &Path, smooth: &Path) -> Result<f64, JobError> {
    let mut options = FairOptions::of(scan);
    // A coarse grid, for an example of seconds; without it the grid is chosen.
    options.input.cells = Some(48);
    let made = fair(options, &Silent)?;
    if let Some(shape) = &made.shape {
        shape.save(smooth)?;
    }
    let moved = made.summary.mesh.map(|mesh| mesh.displacement_rms);
    Ok(moved.unwrap_or_default())
}

/// Runs the example.
///
/// # Errors
/// Those of the job.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut files = std::env::args().skip(1);
    let (scan, smooth) = match (files.next(), files.next()) {
        (Some(scan), Some(smooth)) => (scan.into(), smooth.into()),
        _ => {
            let folder = std::env::temp_dir();
            let name = |what: &str| format!("{what}-{}.obj", std::process::id());
            let (scan, smooth) = (folder.join(name("scan")), folder.join(name("smooth")));
            let mut lever = SampleOptions::of("builtin:lever", &scan);
            (lever.input.cells, lever.noise) = (Some(40), 0.005);
            sample(lever, &Silent)?;
            (scan, smooth)
        }
    };
    let moved = take_off_noise(&scan, &smooth)?;
    println!("vertices moved by {moved:.2e}: {}", smooth.display());
    Ok(())
}

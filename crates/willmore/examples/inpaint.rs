//! Fills a hole in a drawing: inpaint DRAWING MASK FILLED, or a ring with a gap.

use std::path::Path;

use willmore::prelude::*;

/// Writes the drawing with the region filled. Pixels outside of it stay bit for bit.
///
/// # Errors
/// Those of the job.
pub fn fill(drawing: &Path, region: &str, filled: &Path) -> Result<(), JobError> {
    let mut options = InpaintOptions::of(drawing, region);
    options.input.cells = Some(32);
    options.run.steps = Some(6);
    match inpaint(options, &Silent)?.shape() {
        Some(shape) => shape.save(filled),
        None => Ok(()),
    }
}

/// Runs the example.
///
/// # Errors
/// Those of the job.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    if let [drawing, mask, filled] = &files[..] {
        return Ok(fill(drawing.as_ref(), mask, filled.as_ref())?);
    }
    let folder = std::env::temp_dir();
    let name = |what: &str| folder.join(format!("{what}-{}.png", std::process::id()));
    let (drawing, filled) = (name("ring"), name("filled"));
    let mut ring = SampleOptions::of("builtin:ring", &drawing);
    ring.input.cells = Some(32);
    ring.without = vec!["ball:0.52,0.3,0.14".parse()?];
    sample(ring, &Silent)?;
    // In pixels from the lower left corner.
    fill(&drawing, "ball:389,333,60", &filled)?;
    println!("{}", filled.display());
    Ok(())
}

//! Smooth surfaces of all labels of a segmentation, each with the volume of its voxels.

use willmore::prelude::*;

/// Two organs, a ball and a box, in voxels of 2 mm.
///
/// # Errors
/// Those of volumes.
pub fn organs() -> Result<Volume, Box<dyn std::error::Error>> {
    let size = 16;
    let label = |voxel: usize| {
        let [x, y, z] = [1, size, size * size].map(|stride| (voxel / stride % size) as f64);
        let in_ball = (x - 4.5).hypot(y - 7.5).hypot(z - 7.5) < 3.5;
        let in_box = (9.0..14.0).contains(&x) && (y - 7.5).abs() < 5.0 && (z - 7.5).abs() < 3.0;
        u8::from(in_ball) + 2 * u8::from(in_box)
    };
    let labels = (0..size * size * size).map(label).collect();
    Ok(Volume::of_labels([size; 3], [0.0; 3], [2.0; 3], labels)?)
}

/// A surface of each label.
///
/// # Errors
/// Those of the job.
pub fn smooth_surfaces(segmentation: Input) -> Result<Vec<LabelSurface>, JobError> {
    let mut options = FairOptions::of(segmentation);
    options.input.cells = Some(32);
    surfaces_of_labels(options, &Silent)
}

/// Runs the example.
///
/// # Errors
/// Those of volumes and of the job.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    for LabelSurface { label, made } in smooth_surfaces(Input::volume("organs", organs()?))? {
        let volume = made.summary.measure("volume").unwrap_or_default();
        let mesh = made.shape.as_ref().and_then(Shape::mesh);
        let faces = mesh.map_or(0, |mesh| mesh.faces.len());
        println!("label {label}: {faces} triangles around {volume:.0} cubic millimetres");
    }
    Ok(())
}

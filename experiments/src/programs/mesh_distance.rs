use std::ffi::OsStr;
use std::io::Write;

use crate::meshes;
use crate::prelude::*;
use geometry::{npy, vti};

pub const EXPERIMENT: Experiment = Experiment {
    name: "mesh_distance",
    summary: "The signed distance of any mesh on any grid.",
    program: |own| own.run(program),
    quick: None,
    results: &[],
    metrics: &[],
    words: &[],
};

/// Writes the signed distance to a closed triangle mesh, negative inside, at the nodes i/n of the unit cube. The mesh is scaled so
/// that the longest side of its bounding box has the given length, and its bounding box is centred at (0.5, 0.5, 0.5).
/// `willmore` takes the file with `--holds distance`.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    /// The mesh: OBJ, OFF, STL or PLY
    #[arg(long, value_name = "FILE")]
    mesh: PathBuf,

    /// Cells per side of the box, n
    #[arg(long, value_name = "N", default_value_t = 64)]
    cells: usize,

    /// Longest side of the mesh in the box
    #[arg(long, value_name = "LENGTH", default_value_t = 0.8)]
    side_length: f64,

    /// The array to write: NPY, shape (n, n, n), f64, or a VTI file for ParaView
    #[arg(long, value_name = "FILE")]
    output: PathBuf,

    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

fn program(options: &Options) -> Result<()> {
    let (path, output) = (options.mesh.display(), options.output.display());
    let extension = options.output.extension().map(OsStr::to_ascii_lowercase);
    let volume = extension.as_ref().is_some_and(|name| name == "vti");
    let known = volume || extension.is_some_and(|name| name == "npy");
    require(known, format!("--output {output} must end in .npy or .vti"))?;
    let (mesh, warnings) = ClosedMesh::new(surfaces::read(&options.mesh)?)?;
    for warning in &warnings {
        eprintln!("warning: {path}: {warning}");
    }
    let grid = Grid::<3>::new(options.cells, 1.0)?;
    let progress = ProgressBars::new(options.quiet);
    let bar = progress.bar("signed distance".to_owned(), options.cells as u64);
    let placement = Placement::fit(&mesh.bounding_box(), &grid, options.side_length)?;
    let distance = MeshDistance::new(&mesh.placed(&placement));
    let distance = meshes::sampled(&distance, grid, &bar)?;
    bar.finish();
    if volume {
        vti::write(&options.output, "signed_distance", &distance)?;
    } else {
        npy::write(&options.output, &distance)?;
    }
    progress.clear();
    if !options.quiet {
        // A closed pipe is no failure.
        let _ = writeln!(
            std::io::stdout(),
            "{path}: {} vertices, {} faces, genus {}; signed distance in {output}",
            mesh.mesh().vertices.len(),
            mesh.mesh().faces.len(),
            mesh.genus()
        );
    }
    Ok(())
}

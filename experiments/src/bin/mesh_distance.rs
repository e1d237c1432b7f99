//! The signed distance of any mesh on any grid.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use experiments::{Error, harness, meshes};
use geometry::{Grid, Placement, npy, vti};
use report::Progress;
use surfaces::ClosedMesh;

/// Writes the signed distance to a closed triangle mesh, negative inside, at the nodes i/n of the unit cube. The mesh is scaled so
/// that the longest side of its bounding box has the given length, and its bounding box is centred at (0.5, 0.5, 0.5).
#[derive(Parser, Debug)]
#[command(name = "mesh_distance", version)]
struct Options {
    /// The mesh: OBJ, STL or PLY
    #[arg(long, value_name = "FILE")]
    mesh: PathBuf,

    /// Cells per side of the box, n
    #[arg(long, value_name = "N", default_value_t = 64)]
    cells: usize,

    /// Longest side of the mesh in the box
    #[arg(long, value_name = "LENGTH", default_value_t = 0.8)]
    side_length: f64,

    /// Least distance of the mesh from the faces of the box
    #[arg(long, value_name = "LENGTH", default_value_t = 0.0)]
    margin: f64,

    /// The array to write: NPY, shape (n, n, n), f64, or a VTI file for ParaView
    #[arg(long, value_name = "FILE")]
    output: PathBuf,

    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

fn main() -> ExitCode {
    harness::main(program)
}

fn program(options: &Options) -> Result<(), Error> {
    let extension = options.output.extension().map(OsStr::to_ascii_lowercase);
    let volume = match extension.as_deref().and_then(|e| e.to_str()) {
        Some("npy") => false,
        Some("vti") => true,
        _ => {
            return Err(Error::Options(format!(
                "--output {} must end in .npy or .vti",
                options.output.display()
            )));
        }
    };
    let (mesh, warnings) = ClosedMesh::new(surfaces::read(&options.mesh)?)?;
    for warning in &warnings {
        eprintln!("warning: {}: {warning}", options.mesh.display());
    }
    let grid = Grid::<3>::new(options.cells, 1.0)?;
    let progress = Progress::new(options.quiet);
    let bar = progress.bar("signed distance".to_owned(), options.cells as u64);
    let bounds = mesh.bounding_box();
    let placement = Placement::fit(&bounds, &grid, options.side_length, options.margin)?;
    let distance = meshes::signed_distance(&mesh.placed(&placement), grid, &bar)?;
    bar.finish();
    if volume {
        vti::write(&options.output, &[("signed_distance", &distance)])?;
    } else {
        npy::write(&options.output, &distance)?;
    }
    progress.clear();
    if !options.quiet {
        println!(
            "{}: {} vertices, {} faces, genus {}; signed distance in {}",
            options.mesh.display(),
            mesh.mesh().vertices.len(),
            mesh.mesh().faces.len(),
            mesh.genus(),
            options.output.display()
        );
    }
    Ok(())
}

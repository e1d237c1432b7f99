//! Triangle meshes as initial data.

use std::path::{Path, PathBuf};

use clap::Args;
use geometry::{Field, Grid, optimal_profile};
use indicatif::ProgressBar;
use serde::Serialize;
use sha2::{Digest, Sha256};
use surfaces::{ClosedMesh, MeshDistance, Placement, TriangleMesh};

use crate::Error;
use crate::surfaces::centred_box;

/// Names a folder that holds the meshes of the paper.
pub const FOLDER_VARIABLE: &str = "WORKBENCH_MESHES";
/// Where `scripts/fetch_meshes` puts them.
const FOLDER: &str = "meshes";

/// Options of programs that start from a mesh.
#[derive(Args, Clone, Debug, Default)]
pub struct MeshOptions {
    /// Start from this mesh (OBJ, STL or PLY) [default: that of the paper, from the folder named by WORKBENCH_MESHES or from
    /// meshes/, where scripts/fetch_meshes puts it]
    #[arg(long, value_name = "FILE", conflicts_with = "procedural")]
    pub mesh: Option<PathBuf>,

    /// Start from a built-in shape of the same genus: needs no file
    #[arg(long)]
    pub procedural: bool,

    /// Longest side of the mesh
    #[arg(long, value_name = "LENGTH")]
    pub side_length: Option<f64>,

    /// Side of the periodic box, in whose centre the mesh is put
    #[arg(long, value_name = "LENGTH")]
    pub box_side: Option<f64>,
}

/// A mesh of the paper, and what stands in for it.
pub struct KnownMesh {
    /// Name of the file.
    pub file: &'static str,
    /// Name in titles.
    pub title: &'static str,
    /// Longest side, unless chosen otherwise.
    pub side_length: f64,
    /// Side of the box, unless chosen otherwise.
    pub box_side: f64,
    /// Makes the built-in shape at a resolution.
    pub procedural: fn(usize) -> Result<ClosedMesh, surfaces::Error>,
    /// Its name in titles.
    pub procedural_title: &'static str,
}

/// The armadillo of the Stanford 3D Scanning Repository.
///
/// On `n = 128` it needs this size to keep its genus: smaller, a gap closes.
pub const ARMADILLO: KnownMesh = KnownMesh {
    file: "armadillo.obj",
    title: "armadillo",
    side_length: 0.9,
    box_side: 1.0,
    procedural: surfaces::samples::figure,
    procedural_title: "built-in figure",
};

/// A mesh with its provenance.
pub struct LoadedMesh {
    /// The mesh, closed and oriented outwards.
    pub mesh: ClosedMesh,
    /// What it is.
    pub about: AboutMesh,
}

/// Provenance of a mesh, for manifests.
#[derive(Clone, Debug, Serialize)]
pub struct AboutMesh {
    /// Name in titles.
    pub title: String,
    /// Name of the file, none for a built-in shape.
    pub file: Option<String>,
    /// SHA-256 of the file.
    pub sha256: Option<String>,
    /// Number of vertices.
    pub vertices: usize,
    /// Number of faces.
    pub faces: usize,
    /// `1 - chi / 2` of a connected surface.
    pub genus: i64,
    /// Longest side in the box.
    pub side_length: f64,
    /// What was mended.
    pub warnings: Vec<String>,
}

impl AboutMesh {
    /// What a stored run depends on.
    pub fn identity(&self) -> String {
        let source = self.sha256.as_ref().unwrap_or(&self.title);
        format!("{source}, longest side {}", self.side_length)
    }
}

/// Cells per side of the grid on which built-in shapes are made.
const PROCEDURAL_CELLS: usize = 96;

impl MeshOptions {
    /// The box around the point (0.5, 0.5, 0.5), with `n` cells per unit length.
    ///
    /// # Errors
    /// [`Error::Geometry`] unless `n` times its side is a whole number.
    pub fn grid(&self, known: &KnownMesh, n: usize) -> Result<Grid<3>, Error> {
        centred_box(n, self.box_side.unwrap_or(known.box_side))
    }

    /// The chosen mesh.
    ///
    /// # Errors
    /// [`Error::Options`] if it is nowhere, [`Error::Surfaces`] if it is no closed surface.
    pub fn load(&self, known: &KnownMesh) -> Result<LoadedMesh, Error> {
        let side_length = self.side_length.unwrap_or(known.side_length);
        if self.procedural {
            let mesh = (known.procedural)(PROCEDURAL_CELLS)?;
            return Ok(LoadedMesh::new(
                mesh,
                known.procedural_title,
                side_length,
                Vec::new(),
            ));
        }
        match self.find(known) {
            Some(path) => {
                let mut loaded = load(&path, side_length)?;
                if self.mesh.is_none() {
                    known.title.clone_into(&mut loaded.about.title);
                }
                Ok(loaded)
            }
            None => Err(Error::Options(format!(
                "{} is not here: run scripts/fetch_meshes, or set {FOLDER_VARIABLE} to a folder that holds it, or give --mesh FILE, \
                 or try the built-in shape with --procedural",
                known.file
            ))),
        }
    }

    /// The chosen mesh, or the built-in shape if none was chosen and that of the paper is not here.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_or_built_in(&self, known: &KnownMesh) -> Result<LoadedMesh, Error> {
        let procedural = self.procedural || self.find(known).is_none();
        Self {
            procedural,
            ..self.clone()
        }
        .load(known)
    }

    fn find(&self, known: &KnownMesh) -> Option<PathBuf> {
        if let Some(path) = &self.mesh {
            return Some(path.clone());
        }
        let named = std::env::var_os(FOLDER_VARIABLE).map(PathBuf::from);
        let folder = named.unwrap_or_else(|| PathBuf::from(FOLDER));
        Some(folder.join(known.file)).filter(|path| path.exists())
    }
}

/// Reads and checks a mesh.
///
/// # Errors
/// [`Error::Surfaces`] if it cannot be read or is no closed surface, [`Error::Io`].
pub fn load(path: &Path, side_length: f64) -> Result<LoadedMesh, Error> {
    let mesh: TriangleMesh = surfaces::read(path)?;
    let (mesh, warnings) = ClosedMesh::new(mesh)?;
    let name = path.file_name().unwrap_or(path.as_os_str());
    let name = name.to_string_lossy().into_owned();
    let warnings = warnings.iter().map(ToString::to_string).collect();
    let mut loaded = LoadedMesh::new(mesh, &name, side_length, warnings);
    let bytes = std::fs::read(path).map_err(|source| Error::Io {
        action: "read",
        path: path.to_owned(),
        source,
    })?;
    let hash = Sha256::digest(bytes);
    loaded.about.sha256 = Some(hash.iter().map(|byte| format!("{byte:02x}")).collect());
    loaded.about.file = Some(name);
    Ok(loaded)
}

impl LoadedMesh {
    fn new(mesh: ClosedMesh, title: &str, side_length: f64, warnings: Vec<String>) -> Self {
        let about = AboutMesh {
            title: title.to_owned(),
            file: None,
            sha256: None,
            vertices: mesh.mesh().vertices.len(),
            faces: mesh.mesh().faces.len(),
            genus: mesh.genus(),
            side_length,
            warnings,
        };
        Self { mesh, about }
    }

    /// Signed distances to the mesh, scaled to its side length and centred in the box of the grid, at least `margin` from its faces.
    ///
    /// # Errors
    /// [`Error::Surfaces`] if the mesh does not fit.
    pub fn signed_distance(
        &self,
        grid: Grid<3>,
        margin: f64,
        bar: &ProgressBar,
    ) -> Result<Field<3>, Error> {
        let placement = Placement::fit(&self.mesh, &grid, self.about.side_length, margin)?;
        bar.set_length(grid.cells() as u64);
        let distance = MeshDistance::new(&self.mesh.placed(&placement));
        Ok(distance.sample(grid, || bar.inc(1))?)
    }

    /// The phase field of the mesh.
    ///
    /// # Errors
    /// As [`Self::signed_distance`].
    pub fn phase_field(
        &self,
        grid: Grid<3>,
        eps: f64,
        bar: &ProgressBar,
    ) -> Result<Field<3>, Error> {
        let distance = self.signed_distance(grid, 0.0, bar)?;
        Ok(distance.map(|s| optimal_profile(s, eps)))
    }
}

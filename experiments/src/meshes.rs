//! Triangle meshes and volumes as initial data.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use geometry::{Field, Grid, Placement, npy, optimal_profile, vti};
use indicatif::ProgressBar;
use serde::Serialize;
use sha2::{Digest, Sha256};
use surfaces::{ClosedMesh, MeshDistance};

use crate::Error;
use crate::networks::hexadecimal;
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

    /// Start from values on the n^3 nodes of the box: NPY, or the first array of a VTI file
    #[arg(long, value_name = "FILE", conflicts_with_all = ["mesh", "procedural", "side_length"])]
    pub volume: Option<PathBuf>,

    /// What the values are
    #[arg(
        long,
        value_name = "KIND",
        value_enum,
        default_value_t,
        requires = "volume"
    )]
    pub volume_holds: VolumeKind,

    /// Longest side of the mesh
    #[arg(long, value_name = "LENGTH")]
    pub side_length: Option<f64>,

    /// Side of the periodic box, in whose centre the mesh is put
    #[arg(long, value_name = "LENGTH")]
    pub box_side: Option<f64>,
}

/// What the values of a volume are.
#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum VolumeKind {
    /// Signed distances, negative inside
    #[default]
    SignedDistance,
    /// A phase field, 1 inside and -1 outside
    PhaseField,
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

/// Initial data with their provenance.
pub struct Loaded {
    shape: Shape,
    /// What it is.
    pub about: About,
}

enum Shape {
    /// Closed and oriented outwards.
    Mesh(ClosedMesh),
    Volume(Field<3>),
}

/// Provenance of initial data, for manifests.
#[derive(Clone, Debug, Default, Serialize)]
pub struct About {
    /// Name in titles.
    pub title: String,
    /// Name of the file, none for a built-in shape.
    pub file: Option<String>,
    /// SHA-256 of the file.
    pub sha256: Option<String>,
    /// What a volume holds.
    pub holds: Option<VolumeKind>,
    /// Number of vertices of a mesh.
    pub vertices: Option<usize>,
    /// Number of faces.
    pub faces: Option<usize>,
    /// `1 - chi / 2` of a connected surface.
    pub genus: Option<i64>,
    /// Longest side of a mesh in the box.
    pub side_length: Option<f64>,
    /// What was mended.
    pub warnings: Vec<String>,
}

impl About {
    /// What a stored run depends on.
    pub fn identity(&self) -> String {
        let source = self.sha256.as_ref().unwrap_or(&self.title);
        match (self.side_length, self.holds) {
            (Some(side), _) => format!("{source}, longest side {side}"),
            (None, holds) => format!("{source}, {holds:?}"),
        }
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

    /// Whether nothing but the mesh of the paper was asked for.
    pub fn is_the_papers(&self) -> bool {
        self.mesh.is_none() && self.volume.is_none() && !self.procedural
    }

    /// The chosen mesh or volume, for runs on a grid.
    ///
    /// # Errors
    /// [`Error::Options`] if it is nowhere; [`Error::Surfaces`] if it is no closed surface; [`Error::Geometry`] if it does not fit the
    /// box; for a volume [`Error::Geometry`] if it cannot be read, [`Error::Options`] if it has another size or its values are no phase
    /// field.
    pub fn load(&self, known: &KnownMesh, grid: &Grid<3>) -> Result<Loaded, Error> {
        let side_length = self.side_length.unwrap_or(known.side_length);
        if let Some(path) = &self.volume {
            let about = About {
                holds: Some(self.volume_holds),
                ..About::of_file(path)?
            };
            let values = volume(path, *grid)?;
            if self.volume_holds == VolumeKind::PhaseField {
                check_phase_field(&values, path)?;
            }
            let shape = Shape::Volume(values);
            return Ok(Loaded { shape, about });
        }
        if self.procedural {
            let mesh = (known.procedural)(PROCEDURAL_CELLS)?;
            let about = About {
                title: known.procedural_title.to_owned(),
                ..About::default()
            };
            return Loaded::mesh(mesh, about, side_length).fitting(grid);
        }
        match self.find(known) {
            Some(path) => {
                let mut loaded = load(&path, side_length)?;
                if self.mesh.is_none() {
                    known.title.clone_into(&mut loaded.about.title);
                }
                loaded.fitting(grid)
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
    pub fn load_or_built_in(&self, known: &KnownMesh, grid: &Grid<3>) -> Result<Loaded, Error> {
        let nothing = self.volume.is_none() && self.find(known).is_none();
        let procedural = self.procedural || nothing;
        Self {
            procedural,
            ..self.clone()
        }
        .load(known, grid)
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
fn load(path: &Path, side_length: f64) -> Result<Loaded, Error> {
    let (mesh, warnings) = ClosedMesh::new(surfaces::read(path)?)?;
    let about = About {
        warnings: warnings.iter().map(ToString::to_string).collect(),
        ..About::of_file(path)?
    };
    Ok(Loaded::mesh(mesh, about, side_length))
}

impl About {
    fn of_file(path: &Path) -> Result<Self, Error> {
        let bytes = std::fs::read(path).map_err(|source| Error::Io {
            action: "read",
            path: path.to_owned(),
            source,
        })?;
        let hash = Sha256::digest(bytes);
        let name = path.file_name().unwrap_or(path.as_os_str());
        let name = name.to_string_lossy().into_owned();
        Ok(Self {
            title: name.clone(),
            file: Some(name),
            sha256: Some(hexadecimal(&hash)),
            ..Self::default()
        })
    }
}

impl Loaded {
    fn mesh(mesh: ClosedMesh, about: About, side_length: f64) -> Self {
        let about = About {
            vertices: Some(mesh.mesh().vertices.len()),
            faces: Some(mesh.mesh().faces.len()),
            genus: Some(mesh.genus()),
            side_length: Some(side_length),
            ..about
        };
        Self {
            shape: Shape::Mesh(mesh),
            about,
        }
    }

    fn fitting(self, grid: &Grid<3>) -> Result<Self, Error> {
        if let (Shape::Mesh(mesh), Some(side_length)) = (&self.shape, self.about.side_length) {
            Placement::fit(&mesh.bounding_box(), grid, side_length, 0.0)?;
        }
        Ok(self)
    }

    /// The phase field on the grid for which the data were loaded: of a mesh scaled to its side length and centred in the box, or of
    /// a volume.
    ///
    /// # Errors
    /// [`Error::Geometry`] if the mesh does not fit.
    pub fn phase_field(
        &self,
        grid: Grid<3>,
        eps: f64,
        bar: &ProgressBar,
    ) -> Result<Field<3>, Error> {
        let profile = |distance: Field<3>| distance.map(|s| optimal_profile(s, eps));
        match &self.shape {
            Shape::Mesh(mesh) => {
                let side_length = self.about.side_length.unwrap_or(1.0);
                let distance = signed_distance(mesh, grid, side_length, 0.0, bar)?;
                Ok(profile(distance))
            }
            Shape::Volume(values) => Ok(match self.about.holds {
                Some(VolumeKind::PhaseField) => values.clone(),
                _ => profile(values.clone()),
            }),
        }
    }
}

/// The values of a file on a grid, whatever box the file says.
fn volume(path: &Path, grid: Grid<3>) -> Result<Field<3>, Error> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    let field = match extension.to_ascii_lowercase().as_str() {
        "npy" => npy::read(path, |cells| Grid::new(cells, grid.side()))?,
        "vti" => {
            let mut arrays = vti::read::<3>(path)?;
            arrays.swap_remove(0).1
        }
        _ => {
            return Err(Error::Options(format!(
                "--volume {} must end in .npy or .vti",
                path.display()
            )));
        }
    };
    let (found, expected) = (field.grid().cells(), grid.cells());
    if found != expected {
        return Err(Error::Options(format!(
            "{} has {found} nodes per side, and the box {expected}: choose --cells and --box-side with a product of {found}",
            path.display()
        )));
    }
    Ok(Field::from_values(grid, field.into_values())?)
}

fn check_phase_field(u: &Field<3>, path: &Path) -> Result<(), Error> {
    /// Flows overshoot the phases a little.
    const LARGEST: f64 = 1.1;
    match u.values().iter().find(|u| u.abs() > LARGEST) {
        None => Ok(()),
        Some(value) => Err(Error::Options(format!(
            "{} holds the value {value}, which no phase field has; are they signed distances?",
            path.display()
        ))),
    }
}

/// Signed distances to a mesh, scaled to a longest side and centred in the box of the grid, at least `margin` from its faces.
///
/// # Errors
/// [`Error::Geometry`] if the mesh does not fit.
pub fn signed_distance(
    mesh: &ClosedMesh,
    grid: Grid<3>,
    side_length: f64,
    margin: f64,
    bar: &ProgressBar,
) -> Result<Field<3>, Error> {
    let placement = Placement::fit(&mesh.bounding_box(), &grid, side_length, margin)?;
    bar.set_length(grid.cells() as u64);
    let distance = MeshDistance::new(&mesh.placed(&placement));
    Ok(distance.sample(grid, || bar.inc(1))?)
}

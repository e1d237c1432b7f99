//! Triangle meshes and volumes as initial data.

use files::{Sha256, hexadecimal};
use geometry::{PURE_BEYOND, npy};

use crate::prelude::*;

/// Names a folder that holds the meshes of the paper.
const FOLDER_VARIABLE: &str = "WORKBENCH_MESHES";

/// Options of programs that start from a mesh.
#[derive(Args, Clone, Debug, Default)]
pub struct MeshOptions {
    /// Start from this mesh (OBJ, OFF, STL or PLY) [default: that of the paper, from the folder named by WORKBENCH_MESHES or from
    /// meshes/, where scripts/fetch_meshes puts it]
    #[arg(long, value_name = "FILE", conflicts_with = "procedural")]
    pub mesh: Option<PathBuf>,

    /// Start from a built-in shape of the same genus: needs no file
    #[arg(long)]
    pub procedural: bool,

    /// Start from values on the n^3 nodes of the box: NPY
    #[arg(long, value_name = "FILE", conflicts_with_all = ["mesh", "procedural", "side_length"])]
    pub volume: Option<PathBuf>,

    /// What the values are
    #[arg(long, value_name = "KIND", value_enum, default_value_t)]
    #[arg(requires = "volume")]
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
    pub file: &'static str,
    pub title: &'static str,
    /// Longest side, unless chosen otherwise.
    pub side_length: f64,
    /// Side of the box, unless chosen otherwise.
    pub box_side: f64,
    /// Makes the built-in shape at a resolution.
    pub procedural: fn(usize) -> Result<ClosedMesh, surfaces::Error>,
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

pub struct Loaded {
    shape: Shape,
    pub title: String,
    /// File with its checksum, measures, what was mended: for manifests.
    pub about: Value,
    /// Whether it is the mesh of the paper, with which its numbers can be compared.
    pub is_papers: bool,
}

enum Shape {
    Distance(MeshDistance),
    Volume(Field<3>, VolumeKind),
}

/// Cells per side of the grid on which built-in shapes are made.
const PROCEDURAL_CELLS: usize = 96;

impl MeshOptions {
    pub fn box_side(&self, known: &KnownMesh) -> f64 {
        self.box_side.unwrap_or(known.box_side)
    }

    /// The chosen mesh or volume, for runs on a grid.
    pub fn load(&self, known: &KnownMesh, grid: &Grid<3>) -> Result<Loaded> {
        if let Some(path) = &self.volume {
            let (title, mut about) = about_file(path)?;
            about["holds"] = json!(self.volume_holds);
            let values = volume(path, *grid, self.volume_holds)?;
            return Ok(Loaded {
                shape: Shape::Volume(values, self.volume_holds),
                title,
                about,
                is_papers: false,
            });
        }
        let (mesh, title, mut about) = if self.procedural {
            let title = known.procedural_title.to_owned();
            let about = json!({ "built_in": title });
            ((known.procedural)(PROCEDURAL_CELLS)?, title, about)
        } else {
            let path = self.find(known).ok_or_else(|| {
                format!(
                    "{} is not here: run scripts/fetch_meshes, or set {FOLDER_VARIABLE} to a folder that holds it, or give --mesh FILE, \
                     or try the built-in shape with --procedural",
                    known.file
                )
            })?;
            let (mesh, warnings) = ClosedMesh::new(surfaces::read(&path)?)?;
            let (name, mut about) = about_file(&path)?;
            about["warnings"] = warnings.iter().map(ToString::to_string).collect();
            let papers = self.mesh.is_none().then(|| known.title.to_owned());
            (mesh, papers.unwrap_or(name), about)
        };
        let side_length = self.side_length.unwrap_or(known.side_length);
        let placement = Placement::fit(&mesh.bounding_box(), grid, side_length)?;
        about["vertices"] = mesh.mesh().vertices.len().into();
        about["faces"] = mesh.mesh().faces.len().into();
        about["genus"] = mesh.genus().into();
        about["side_length"] = side_length.into();
        Ok(Loaded {
            shape: Shape::Distance(MeshDistance::new(&mesh.placed(&placement))),
            title,
            about,
            is_papers: self.mesh.is_none() && !self.procedural,
        })
    }

    /// The chosen mesh, or the built-in shape if none was chosen and that of the paper is not here.
    pub fn load_or_built_in(&self, known: &KnownMesh, grid: &Grid<3>) -> Result<Loaded> {
        let mut options = self.clone();
        options.procedural |= self.volume.is_none() && self.find(known).is_none();
        options.load(known, grid)
    }

    fn find(&self, known: &KnownMesh) -> Option<PathBuf> {
        let papers = Some(folder().join(known.file)).filter(|path| path.exists());
        self.mesh.clone().or(papers)
    }
}

/// The folder that holds the meshes of the paper, if they are here.
pub fn folder() -> PathBuf {
    let named = std::env::var_os(FOLDER_VARIABLE);
    named.unwrap_or_else(|| "meshes".into()).into()
}

fn about_file(path: &Path) -> Result<(String, Value)> {
    let bytes = files::read(path)?;
    let name = path.file_name().unwrap_or(path.as_os_str());
    let name = name.to_string_lossy().into_owned();
    let about = json!({ "file": name, "sha256": hexadecimal(Sha256::of(bytes)) });
    Ok((name, about))
}

impl Loaded {
    /// The phase field on the grid for which the data were loaded.
    pub fn phase_field(&self, grid: Grid<3>, eps: f64, bar: &ProgressBar) -> Result<Stored<3>> {
        let profile = |s| optimal_profile(s, eps);
        Ok(match &self.shape {
            Shape::Distance(distance) => {
                bar.set_length(grid.cells() as u64);
                let within = distance.sample_within(PURE_BEYOND * eps, grid, &|| bar.inc(1))?;
                within.map(profile)
            }
            Shape::Volume(values, VolumeKind::SignedDistance) => values.map(profile).into(),
            Shape::Volume(values, VolumeKind::PhaseField) => values.clone().into(),
        })
    }
}

/// The values of an NPY file on a grid.
fn volume(path: &Path, grid: Grid<3>, holds: VolumeKind) -> Result<Field<3>> {
    /// Flows overshoot the phases of a phase field a little.
    const LARGEST: f64 = 1.1;
    let name = path.display();
    let field = npy::read(path, |cells| Grid::<3>::new(cells, grid.side()))?;
    let (found, expected) = (field.grid().cells(), grid.cells());
    let message = format!(
        "{name} has {found} nodes per side, and the box {expected}: choose --cells and --box-side with a product of {found}"
    );
    require(found == expected, message)?;
    let largest = field.values().iter().map(|u| u.abs()).fold(0.0, f64::max);
    let message = format!(
        "{name} holds values up to {largest}, which no phase field has; are they signed distances?"
    );
    let possible = holds != VolumeKind::PhaseField || largest <= LARGEST;
    require(possible, message)?;
    Ok(Field::from_values(grid, field.into_values())?)
}

pub fn sampled(distance: &MeshDistance, grid: Grid<3>, bar: &ProgressBar) -> Result<Field<3>> {
    bar.set_length(grid.cells() as u64);
    Ok(distance.sample(grid, &|| bar.inc(1))?)
}

//! The results of a job in memory.

use crate::outcome::Summary;
use crate::paths::extension;
use crate::plane::Plane;
use crate::prelude::*;
use crate::presentation::Presentation;

/// The results of a job, in the dimension of its input.
#[derive(Clone, Debug)]
pub enum Results {
    /// Of a curve.
    Plane(Made<2>),
    /// Of a surface.
    Space(Made<3>),
}

impl Results {
    /// What is known of the run.
    pub fn summary(&self) -> &Summary {
        match self {
            Self::Plane(made) => &made.summary,
            Self::Space(made) => &made.summary,
        }
    }

    /// Energies, sizes and costs of every step.
    pub fn records(&self) -> &[Record] {
        match self {
            Self::Plane(made) => &made.records,
            Self::Space(made) => &made.records,
        }
    }

    /// The shape at the end, unless it has vanished.
    pub fn shape(&self) -> Option<&Shape> {
        match self {
            Self::Plane(made) => made.shape.as_ref(),
            Self::Space(made) => made.shape.as_ref(),
        }
    }
}

impl From<Made<2>> for Results {
    fn from(made: Made<2>) -> Self {
        Self::Plane(made)
    }
}

impl From<Made<3>> for Results {
    fn from(made: Made<3>) -> Self {
        Self::Space(made)
    }
}

/// The results of a job in `D` dimensions.
#[derive(Clone, Debug)]
pub struct Made<const D: usize> {
    /// What is known of the run.
    pub summary: Summary,
    /// The rule that ended it.
    pub ended: Option<Stop>,
    /// Energies, sizes and costs of every step.
    pub records: Vec<Record>,
    /// The phase field at the end.
    pub field: Stored<D>,
    /// The shape at the end, unless it has vanished.
    pub shape: Option<Shape>,
}

/// A curve or a surface.
#[derive(Clone, Debug)]
pub enum Shape {
    /// A curve.
    Curve(Curve),
    /// A surface.
    Surface(Surface),
}

/// A curve as people look at it.
#[derive(Clone, Debug)]
pub struct Curve {
    /// In pixels, those of the input if that is an image.
    pub picture: Picture,
    /// The text of an SVG file.
    pub svg: String,
}

/// A surface of triangles.
#[derive(Clone, Debug)]
pub struct Surface {
    /// The triangles.
    pub mesh: TriangleMesh,
    /// The axis that points up.
    pub up: UpAxis,
    /// The file of the input with its vertices moved, if they followed the flow.
    pub file: Option<MeshFile>,
}

impl Surface {
    /// The bytes of a mesh file: the file of the input in its own format, the triangles alone in another one.
    ///
    /// # Errors
    /// Formats other than `ply`, `obj`, `stl` and `off`; a mesh without faces.
    pub fn encode(&self, format: &str) -> Result<Vec<u8>> {
        match &self.file {
            Some(file) if file.format == format => Ok(file.bytes.clone()),
            _ => encoded(&self.mesh, self.up, format),
        }
    }
}

/// The file of a mesh.
#[derive(Clone, Debug)]
pub struct MeshFile {
    /// The extension of its name.
    pub format: String,
    /// What is in it.
    pub bytes: Vec<u8>,
}

impl Shape {
    /// The bytes of a file: `png` or `svg` of a curve, `ply`, `obj`, `stl` or `off` of a surface. The file of an input whose vertices followed the flow
    /// keeps everything else that it had.
    ///
    /// # Errors
    /// [`Error::Format`] for other formats.
    pub fn encode(&self, format: &str) -> Result<Vec<u8>> {
        match (self, format) {
            (Self::Curve(curve), "png") => Ok(curve.picture.to_png()?),
            (Self::Curve(curve), "svg") => Ok(curve.svg.clone().into_bytes()),
            (Self::Curve(_), _) => Err(Error::Format {
                path: PathBuf::from(format),
                dimension: 2,
                formats: Plane::SAVED,
            }),
            (Self::Surface(surface), _) => surface.encode(format),
        }
    }

    /// Writes such a file, by its extension.
    ///
    /// # Errors
    /// As [`Self::encode`], and a file that cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        let bytes = self.encode(&extension(path))?;
        Ok(files::write_atomically(path, |out| out.write_all(&bytes))?)
    }

    /// The triangles of a surface.
    pub fn mesh(&self) -> Option<&TriangleMesh> {
        match self {
            Self::Curve(_) => None,
            Self::Surface(surface) => Some(&surface.mesh),
        }
    }
}

/// The bytes of a file with a mesh.
pub(crate) fn encoded(mesh: &TriangleMesh, up: UpAxis, format: &str) -> Result<Vec<u8>> {
    let name = format!("mesh.{format}");
    Ok(surfaces::encode_with_up(name, mesh, up)?)
}

//! The mesh that a person gave: its vertices follow the flow.

use std::collections::HashMap;
use std::sync::Arc;

use engine::DISPLACEMENT;
use report::Figure;
use surfaces::hausdorff_distance;

use crate::displacement;
use crate::keep::{Keep, key, moving_nodes};
use crate::prelude::*;

/// The name of the copy of the input, without its extension.
pub const INPUT: &str = "input";

/// A mesh of which everything but the positions of its vertices stays: see [`Fairing`].
#[derive(Serialize, Deserialize, Clone, Debug)]
pub struct OwnMesh {
    /// The file in the folder of the run, a copy of the input.
    file: String,
    /// Standard deviation of the noise, in the units of the mesh.
    noise: f64,
    /// What stays where it is, in the coordinates of the mesh.
    keep: Option<String>,
    /// Whether it keeps its volume, also where vertices simply follow.
    #[serde(default)]
    pub keeps_volume: bool,
    /// Whether the zero level set takes its place in the end.
    #[serde(default)]
    pub is_new: bool,
    /// The name of the copy of the mask, if that is a mesh, and its bytes.
    #[serde(skip)]
    mask: Option<(String, Vec<u8>)>,
    #[serde(skip)]
    loaded: Option<Arc<Loaded>>,
}

#[derive(Debug)]
struct Loaded {
    bytes: Vec<u8>,
    mesh: TriangleMesh,
    fairing: Fairing,
}

/// The grid has the coordinates of the mesh.
fn in_place() -> Result<Placement<3>, Error> {
    Ok(Placement::about([0.0; 3], 1.0)?)
}

impl OwnMesh {
    /// Takes a mesh, and what noise is to be taken off, estimated unless it is given; without any vertices simply follow. The texts are what
    /// there is to warn of.
    pub fn new(
        path: &Path,
        bytes: Vec<u8>,
        noise: Option<f64>,
        keep: Option<String>,
    ) -> Result<(Self, Vec<String>), Error> {
        let mesh = surfaces::decode(&bytes, path)?;
        let (closed, warnings) = ClosedMesh::new(mesh.clone()).map_err(Error::mesh)?;
        let mut own = Self {
            file: format!("{INPUT}.{}", crate::input::extension(path)),
            noise: noise.unwrap_or_else(|| closed.mesh().noise()),
            keeps_volume: false,
            is_new: false,
            mask: None,
            keep,
            loaded: None,
        };
        if let Some(mask) = own.keep.as_deref().and_then(Keep::mask) {
            let bytes = std::fs::read(mask).map_err(Error::io("read", mask))?;
            own.mask = Some((Self::mask_file(mask), bytes));
        }
        own.load(bytes, mesh, closed)?;
        Ok((own, warnings.iter().map(ToString::to_string).collect()))
    }

    fn mask_file(mask: &Path) -> String {
        format!("keep.{}", crate::input::extension(mask))
    }

    fn load(
        &mut self,
        bytes: Vec<u8>,
        mesh: TriangleMesh,
        closed: ClosedMesh,
    ) -> Result<(), Error> {
        let mask = self.mask.as_ref().map(|(_, bytes)| &bytes[..]);
        let keep = self.keep.as_deref().map(|text| Keep::parse(text, mask));
        let fairing = match keep.transpose()? {
            Some(keep) => Fairing::new(closed, self.noise, keep.holds(&bytes, &self.file, &mesh)?),
            None => Fairing::new(closed, self.noise, |_| false),
        };
        let kept = fairing.keeps().iter().filter(|&&kept| kept).count();
        if kept == fairing.keeps().len() {
            return Err(Error::options(
                "--keep contains all of the mesh: nothing could move",
            ));
        }
        if self.keep.is_some() && kept == 0 {
            let bounds = fairing.rough().bounding_box();
            return Err(Error::options(format!(
                "--keep contains no vertex of the mesh, which goes from {:?} to {:?}",
                bounds.lower, bounds.upper
            )));
        }
        self.loaded = Some(Arc::new(Loaded {
            bytes,
            mesh,
            fairing,
        }));
        Ok(())
    }

    /// Takes the copy in the folder of a run.
    pub fn load_from(&mut self, stored: &StoredRun) -> Result<(), Error> {
        let path = stored.path().join(&self.file);
        let bytes = std::fs::read(&path).map_err(Error::io("read", &path))?;
        let mesh = surfaces::decode(&bytes, &path)?;
        let (closed, _) = ClosedMesh::new(mesh.clone())?;
        if let Some(mask) = self.keep.as_deref().and_then(Keep::mask) {
            let file = Self::mask_file(mask);
            let path = stored.path().join(&file);
            let bytes = std::fs::read(&path).map_err(Error::io("read", &path))?;
            self.mask = Some((file, bytes));
        }
        self.load(bytes, mesh, closed)
    }

    /// The copies of the input and of the mask for the folder of a run, with their names.
    pub fn inputs(&self) -> Vec<(&str, Vec<u8>)> {
        let input = (&*self.file, self.loaded().bytes.clone());
        let mask = self
            .mask
            .iter()
            .map(|(name, bytes)| (&**name, bytes.clone()));
        std::iter::once(input).chain(mask).collect()
    }

    fn loaded(&self) -> &Loaded {
        (self.loaded.as_deref()).expect("a mesh is loaded with its run")
    }

    /// What becomes of the vertices.
    pub fn fairing(&self) -> &Fairing {
        &self.loaded().fairing
    }

    pub fn longest_side(&self) -> f64 {
        self.fairing().rough().bounding_box().longest_side()
    }

    /// The nodes that may move, if not all.
    pub fn nodes(&self, field: &Field<3>) -> Result<Option<Vec<bool>>, Error> {
        let (grid, fairing) = (field.grid(), self.fairing());
        let Some(keep) = &self.keep else {
            return Ok(None);
        };
        let mask = self.mask.as_ref().map(|(_, bytes)| &bytes[..]);
        Ok(Some(match Keep::parse(keep, mask)? {
            Keep::Inside(shape) => (0..grid.len())
                .map(|node| shape.signed_distance(grid.node(node)) > 0.0)
                .collect(),
            Keep::Coloured(_) => {
                moving_nodes(grid, &fairing.rough().mesh().vertices, fairing.keeps())
            }
        }))
    }

    /// How far the vertices have gone along the normals, root of the mean square.
    pub fn measure(&self, start: &Field<3>, eps: f64) -> Result<Measure<3>, Error> {
        let fairing = self.fairing().clone();
        let followed = fairing.follow(in_place()?, start, eps)?;
        Ok(Measure::new(DISPLACEMENT, move |u, _| {
            // A field that is not finite stops the run elsewhere.
            Ok(fairing.displacement(&followed, u).ok())
        }))
    }

    /// When the noise is off.
    pub fn stops(&self, spacing: f64) -> Vec<Stop> {
        if self.noise == 0.0 {
            return Vec::new();
        }
        vec![
            Stop::Time(self.fairing().time(spacing, 1.0)),
            Stop::Displacement(self.fairing().farthest()),
        ]
    }

    /// The mesh with the vertices where the phase field `u` has taken them, or the new one in its place.
    pub fn faired(
        &self,
        start: &Field<3>,
        u: &Field<3>,
        eps: f64,
        up: UpAxis,
    ) -> Result<Faired, Error> {
        if self.is_new {
            return self.made_anew(u, eps, up);
        }
        let Loaded {
            bytes,
            mesh,
            fairing,
        } = self.loaded();
        let followed = fairing.follow(in_place()?, start, eps)?;
        let mut moved = fairing.faired(&followed, u)?;
        if self.keeps_volume {
            moved = moved.with_volume(fairing.rough().volume(), |v| !fairing.keeps()[v]);
        }
        let pairs = fairing.rough().mesh().vertices.iter().zip(&moved.vertices);
        let goes: HashMap<_, _> = pairs.map(|(from, to)| (key(*from), *to)).collect();
        let all = TriangleMesh {
            // Vertices of no face stay.
            vertices: (mesh.vertices.iter())
                .map(|x| goes.get(&key(*x)).copied().unwrap_or(*x))
                .collect(),
            faces: mesh.faces.clone(),
            normals: None,
        };
        let pairs = fairing.rough().mesh().vertices.iter().zip(&moved.vertices);
        let squares = pairs.map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>());
        let lengths: Vec<f64> = squares.map(f64::sqrt).collect();
        let lost = fairing.unresolved(&followed, Self::thinnest(start.grid()));
        let mut report = report(fairing.rough(), &moved, &lengths);
        report["noise"] = self.noise.into();
        report["left_behind_percent"] = (100.0 * followed.left_behind(u)?).into();
        Ok(Faired {
            extension: self.extension(),
            file: Some(surfaces::rewrite(bytes, &self.file, &all)?),
            mesh: all,
            displacement: displacement::figure(&moved, &lengths, &lost, up)?,
            report,
        })
    }

    /// The zero level set, with the volume that noise does not change.
    fn made_anew(&self, u: &Field<3>, eps: f64, up: UpAxis) -> Result<Faired, Error> {
        let rough = self.fairing().rough();
        let mut mesh = outlet::surface(u, eps)?;
        if self.noise > 0.0 || self.keeps_volume {
            mesh = mesh.with_volume(rough.volume(), |_| true);
        }
        let mut made = Faired::anew(rough, mesh, &self.extension(), up)?;
        made.report["noise"] = self.noise.into();
        Ok(made)
    }

    fn extension(&self) -> String {
        crate::input::extension(Path::new(&self.file))
    }

    /// Parts and gaps that are thinner than two cells come and go with the place of the grid.
    pub fn thinnest(grid: &Grid<3>) -> f64 {
        2.0 * grid.spacing()
    }
}

/// What became of a surface.
pub struct Faired {
    /// The extension of files that keep everything.
    pub extension: String,
    /// With everything that the input had, unless the mesh is new.
    file: Option<Vec<u8>>,
    mesh: TriangleMesh,
    pub displacement: Figure,
    pub report: Value,
}

/// How a mesh whose vertices are that far from where they were, or from the surface `before`, differs from that.
fn report(before: &ClosedMesh, after: &TriangleMesh, lengths: &[f64]) -> Value {
    let side = before.bounding_box().longest_side();
    let squares: f64 = lengths.iter().map(|length| length * length).sum();
    let rms = (squares / lengths.len().max(1) as f64).sqrt();
    let largest = lengths.iter().copied().fold(0.0, f64::max);
    let percent = |length: f64| 100.0 * length / side;
    let mut report = json!({
        "displacement_rms": rms,
        "displacement_rms_percent": percent(rms),
        "displacement_largest": largest,
        "displacement_largest_percent": percent(largest),
    });
    // A mesh that folds over itself is written all the same, and has no distance.
    if let Ok((after, _)) = ClosedMesh::new(after.clone()) {
        let relative = |after: f64, before: f64| 100.0 * (after / before - 1.0);
        let distance = hausdorff_distance(before, &after);
        report["volume_change_percent"] = relative(after.volume(), before.volume()).into();
        report["area_change_percent"] = relative(after.area(), before.area()).into();
        report["hausdorff_distance"] = distance.into();
        report["hausdorff_distance_percent"] = percent(distance).into();
    }
    report
}

impl Faired {
    /// A new mesh in place of a surface.
    pub fn anew(
        before: &ClosedMesh,
        mesh: TriangleMesh,
        extension: &str,
        up: UpAxis,
    ) -> Result<Self, Error> {
        let distance = MeshDistance::new(before);
        let lengths = distance.signed_distances(&mesh.vertices).into_iter();
        let lengths: Vec<f64> = lengths.map(f64::abs).collect();
        let none_lost = vec![false; lengths.len()];
        Ok(Self {
            extension: extension.to_owned(),
            file: None,
            displacement: displacement::figure(&mesh, &lengths, &none_lost, up)?,
            report: report(before, &mesh, &lengths),
            mesh,
        })
    }

    /// Writes a file: in the format of the input with everything that this had, in another one the triangles alone.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        let same = crate::input::extension(path) == self.extension;
        if let Some(file) = self.file.as_ref().filter(|_| same) {
            let written = files::write_atomically(path, |out| out.write_all(file));
            return Ok(written.map_err(geometry::Error::from)?);
        }
        Ok(surfaces::write(path, &self.mesh)?)
    }
}

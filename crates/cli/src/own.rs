//! The mesh that a person gave: its vertices follow the flow.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use engine::{DISPLACEMENT, Measure, Stop};
use geometry::file::write_atomically;
use geometry::{Field, Placement, SignedDistance};
use runs::StoredRun;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use surfaces::shapes::Region;
use surfaces::{ClosedMesh, Fairing, MeshDistance, TriangleMesh, root_mean_square};

use crate::error::Error;
use crate::outlet::Topology;

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
    #[serde(skip)]
    loaded: Option<Arc<Loaded>>,
}

#[derive(Debug)]
struct Loaded {
    bytes: Vec<u8>,
    /// As in the file.
    mesh: TriangleMesh,
    fairing: Fairing,
}

/// The grid has the coordinates of the mesh.
fn in_place() -> Result<Placement<3>, Error> {
    Ok(Placement::about([0.0; 3], 1.0)?)
}

/// What there is to take off.
#[derive(Clone, Copy)]
pub enum Noise {
    /// Nothing: the flow ends for another reason, and vertices simply follow.
    None,
    /// Noise of this standard deviation.
    Of(f64),
    /// As much as the mesh seems to have.
    Estimated,
}

impl OwnMesh {
    /// Takes a mesh, and what noise is to be taken off. The texts are what there is to warn of.
    pub fn new(
        path: &Path,
        bytes: Vec<u8>,
        noise: Noise,
        keep: Option<String>,
    ) -> Result<(Self, Vec<String>), Error> {
        let mesh = surfaces::decode(&bytes, path)?;
        let (closed, warnings) = ClosedMesh::new(mesh.clone()).map_err(Error::mesh)?;
        let mut own = Self {
            file: format!("{INPUT}.{}", crate::input::extension(path)),
            noise: match noise {
                Noise::None => 0.0,
                Noise::Of(length) => length,
                Noise::Estimated => closed.mesh().noise(),
            },
            keep,
            loaded: None,
        };
        own.load(bytes, mesh, closed)?;
        Ok((own, warnings.iter().map(ToString::to_string).collect()))
    }

    fn load(
        &mut self,
        bytes: Vec<u8>,
        mesh: TriangleMesh,
        closed: ClosedMesh,
    ) -> Result<(), Error> {
        let region = self.region()?;
        let fairing = Fairing::new(closed, self.noise, |x| {
            (region.as_ref()).is_some_and(|region| region.signed_distance(x) <= 0.0)
        });
        let kept = fairing.keeps().iter().filter(|&&kept| kept).count();
        if kept == fairing.keeps().len() {
            return Err(Error::options(
                "--keep contains all of the mesh: nothing could move",
            ));
        }
        if region.is_some() && kept == 0 {
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

    /// What is kept.
    fn region(&self) -> Result<Option<Box<dyn SignedDistance<3>>>, Error> {
        let Some(keep) = &self.keep else {
            return Ok(None);
        };
        let region: Region = keep
            .parse()
            .map_err(|reason| Error::options(format!("--keep: {reason}")))?;
        Ok(Some(region.shape::<3>()?))
    }

    /// Takes the copy in the folder of a run.
    pub fn load_from(&mut self, stored: &StoredRun) -> Result<(), Error> {
        let path = stored.path().join(&self.file);
        let bytes = std::fs::read(&path).map_err(Error::io("read", &path))?;
        let mesh = surfaces::decode(&bytes, &path)?;
        let (closed, _) = ClosedMesh::new(mesh.clone())?;
        self.load(bytes, mesh, closed)
    }

    /// The copy of the input for the folder of a run, and its name.
    pub fn input(&self) -> (&str, Vec<u8>) {
        (&self.file, self.loaded().bytes.clone())
    }

    fn loaded(&self) -> &Loaded {
        (self.loaded.as_deref()).expect("a mesh is loaded with its run")
    }

    /// What becomes of the vertices.
    pub fn fairing(&self) -> &Fairing {
        &self.loaded().fairing
    }

    /// The longest side of its bounding box.
    pub fn longest_side(&self) -> f64 {
        self.fairing().rough().bounding_box().longest_side()
    }

    /// The nodes that may move: those outside of what is kept.
    pub fn nodes(&self, field: &Field<3>) -> Result<Option<Vec<bool>>, Error> {
        let grid = field.grid();
        Ok(self.region()?.map(|region| {
            (0..grid.len())
                .map(|node| region.signed_distance(grid.node(node)) > 0.0)
                .collect()
        }))
    }

    /// Parts and holes.
    pub fn topology(&self) -> Topology {
        Topology::of(self.fairing().rough())
    }

    /// How far the vertices have gone, root of the mean square.
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

    /// The mesh with the vertices where the phase field `u` has taken them.
    pub fn faired(&self, start: &Field<3>, u: &Field<3>, eps: f64) -> Result<Faired, Error> {
        let Loaded {
            bytes,
            mesh,
            fairing,
        } = self.loaded();
        let followed = fairing.follow(in_place()?, start, eps)?;
        let moved = fairing.faired(&followed, u)?;
        let key = |x: &[f64; 3]| x.map(|v| (v + 0.0).to_bits());
        let pairs = fairing.rough().mesh().vertices.iter().zip(&moved.vertices);
        let goes: HashMap<_, _> = pairs.map(|(from, to)| (key(from), *to)).collect();
        let all = TriangleMesh {
            // Vertices of no face stay.
            vertices: (mesh.vertices.iter())
                .map(|x| goes.get(&key(x)).copied().unwrap_or(*x))
                .collect(),
            faces: mesh.faces.clone(),
            normals: None,
        };
        Ok(Faired {
            extension: crate::input::extension(Path::new(&self.file)),
            file: surfaces::rewrite(bytes, &self.file, &all)?,
            mesh: all,
            topology: self.topology(),
            report: self.report(&moved, followed.left_behind(u)?),
        })
    }

    fn report(&self, moved: &TriangleMesh, left_behind: f64) -> Value {
        let closed = self.fairing().rough();
        let (before, side) = (closed.mesh(), self.longest_side());
        let (rms, largest) = root_mean_square(&before.vertices, &moved.vertices);
        let percent = |length: f64| 100.0 * length / side;
        let mut report = json!({
            "noise": self.noise,
            "displacement_rms": rms,
            "displacement_rms_percent": percent(rms),
            "displacement_largest": largest,
            "displacement_largest_percent": percent(largest),
            "left_behind_percent": 100.0 * left_behind,
        });
        // A mesh that folds over itself is written all the same, and has no distance.
        if let Ok((after, _)) = ClosedMesh::new(moved.clone()) {
            let relative = |after: f64, before: f64| 100.0 * (after / before - 1.0);
            let far = |points: &TriangleMesh, from: &ClosedMesh| {
                let distance = MeshDistance::new(from);
                let of = |&x: &[f64; 3]| distance.signed_distance(x).abs();
                points.vertices.iter().map(of).fold(0.0, f64::max)
            };
            let distance = far(before, &after).max(far(moved, closed));
            report["volume_change_percent"] = relative(after.volume(), closed.volume()).into();
            report["area_change_percent"] = relative(after.area(), closed.area()).into();
            report["hausdorff_distance"] = distance.into();
            report["hausdorff_distance_percent"] = percent(distance).into();
        }
        report
    }
}

/// What becomes of a mesh.
pub struct Faired {
    /// The extension of files that keep everything.
    pub extension: String,
    file: Vec<u8>,
    mesh: TriangleMesh,
    /// Parts and holes, which stay.
    pub topology: Topology,
    /// What has changed.
    pub report: Value,
}

impl Faired {
    /// Writes a file: in the format of the input with everything that this had, in another one the triangles alone.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        if crate::input::extension(path) == self.extension {
            return Ok(write_atomically(path, |out| out.write_all(&self.file))?);
        }
        Ok(surfaces::write(path, &self.mesh)?)
    }
}

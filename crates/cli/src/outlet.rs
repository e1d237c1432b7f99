//! What people look at: pictures, meshes, drawings.

use std::fmt;

use geometry::measure::bounding_box;
use render::View;
use serde::de::DeserializeOwned;

use crate::own::Faired;
use crate::prelude::*;
use crate::volume::Voxels;

const PIXELS: u32 = 480;
/// Room around a surface for its flow, as a part of its longest side.
const ROOM: f64 = 0.06;
pub fn view(up: UpAxis) -> View {
    View {
        up,
        azimuth: -60.0,
        elevation: 25.0,
    }
}

/// The extensions of meshes, the usual one first.
pub const MESHES: [&str; 3] = ["ply", "obj", "stl"];
/// Names of files that hold the shape at the beginning, without their extension.
pub const START: &str = "start";
pub const FINAL: &str = "final";
pub const PICTURE: &str = "final.png";
pub const DISPLACEMENT: &str = "final.displacement.svg";
pub const FRAMES: &str = "frames";
/// The files of a frame without their extensions.
pub fn frame(step: usize) -> String {
    format!("{FRAMES}/step-{step:06}")
}
pub const ANIMATION: &str = "animation.png";
/// The fields of the frames with their times.
pub const SERIES: &str = "frames.pvd";
pub const SUMMARY: &str = "summary.json";

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Topology {
    /// Closed curves or surfaces.
    pub components: usize,
    /// Of all surfaces together.
    pub euler_characteristic: Option<i64>,
}

impl Topology {
    pub fn of(surface: &ClosedMesh) -> Self {
        Self {
            components: surface.components(),
            euler_characteristic: Some(surface.euler_characteristic()),
        }
    }
}

impl fmt::Display for Topology {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = if self.components == 1 { "" } else { "s" };
        write!(f, "{} closed part{plural}", self.components)?;
        match self.euler_characteristic {
            Some(number) => write!(f, " of Euler characteristic {number}"),
            None => Ok(()),
        }
    }
}

/// How phase fields in `D` dimensions are shown.
pub trait Outlet<const D: usize>: Serialize + DeserializeOwned {
    /// Lets the axis that was chosen point up, or says which one does.
    fn turn(&mut self, up: &mut Option<UpAxis>) -> Result<(), Error>;

    /// A picture, in the same frame for all steps of a flow from `start`.
    fn picture(&self, start: &Field<D>, u: &Field<D>, eps: f64) -> Result<Picture, Error>;

    fn topology(&self, u: &Field<D>, eps: f64) -> Result<Topology, Error>;

    /// The extensions of files that hold it,
    const SAVED: &'static [&'static str];
    /// and that of those in the folder of a run.
    const USUAL: &'static str;

    /// Refuses other files.
    fn check_saved(path: &Path) -> Result<(), Error> {
        if Self::SAVED.contains(&&*extension(path)) {
            return Ok(());
        }
        Err(Error::options(format!(
            "--save {}: a result in {D}D is saved as .{}",
            path.display(),
            Self::SAVED.join(" or .")
        )))
    }

    /// Writes the shape to any such file.
    fn save(&self, u: &Field<D>, eps: f64, path: &Path) -> Result<(), Error>;

    /// Writes the shape to a file `stem.*` of a run.
    fn write_shape(
        &self,
        u: &Field<D>,
        eps: f64,
        stem: &str,
        format: Option<&str>,
        run: &mut RunDirectory,
    ) -> Result<(), Error> {
        let name = format!("{stem}.{}", format.unwrap_or(Self::USUAL));
        self.save(u, eps, &run.path().join(&name))?;
        Ok(run.adopt_file(&name)?)
    }

    /// What becomes of a surface, and how far it has gone.
    fn faired(&self, _: &Field<D>, _: &Field<D>, _: f64) -> Result<Option<Faired>, Error> {
        Ok(None)
    }

    /// The parts and holes of the input, where these are known better than from the phase field.
    fn input(&self) -> Option<Topology> {
        None
    }

    /// The volume of the input, where that is known better than from the phase field.
    fn volume(&self) -> Option<f64> {
        None
    }

    /// What is measured besides,
    fn measures(&self, _: &Field<D>, _: f64) -> Result<Vec<Measure<D>>, Error> {
        Ok(Vec::new())
    }

    /// and what may end the flow besides.
    fn stops(&self, _: &Field<D>) -> Vec<Stop> {
        Vec::new()
    }

    /// Names and bytes of the files that it takes to resume a run,
    fn inputs(&self) -> Result<Vec<(&str, Vec<u8>)>, Error> {
        Ok(Vec::new())
    }

    /// and what becomes of them there.
    fn restore(&mut self, _: &StoredRun) -> Result<(), Error> {
        Ok(())
    }
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Space {
    up: UpAxis,
    /// The parts and holes of the mesh that it was, if it was one.
    #[serde(default)]
    pub input: Option<Topology>,
    /// The mesh whose vertices follow the flow, if it is one.
    #[serde(default)]
    pub own: Option<OwnMesh>,
    /// The voxels that it was, if it was some.
    #[serde(default)]
    pub voxels: Option<Voxels>,
}

impl Space {
    pub fn new(up: UpAxis) -> Self {
        Self {
            up,
            input: None,
            own: None,
            voxels: None,
        }
    }
}

impl Outlet<3> for Space {
    fn turn(&mut self, up: &mut Option<UpAxis>) -> Result<(), Error> {
        self.up = *up.get_or_insert(self.up);
        Ok(())
    }

    fn picture(&self, start: &Field<3>, u: &Field<3>, eps: f64) -> Result<Picture, Error> {
        let mut scene = Scene::new(u, eps)?.view(view(self.up));
        // Room to grow, and more only for what grows beyond it, so that the pictures of a film do not jump.
        let start = bounding_box(start).map(|bounds| {
            let room = ROOM * bounds.longest_side();
            [
                bounds.lower.map(|x| x - room),
                bounds.upper.map(|x| x + room),
            ]
        });
        let now = scene.bounds().map(|bounds| [bounds.lower, bounds.upper]);
        if let Some(frame) = BoundingBox::around(start.into_iter().chain(now).flatten()) {
            scene = scene.within(frame);
        }
        Ok(scene.render([PIXELS; 2])?)
    }

    fn topology(&self, u: &Field<3>, eps: f64) -> Result<Topology, Error> {
        let (closed, _) = ClosedMesh::new(surfaces::phase_field_surface(u, eps)?)?;
        Ok(Topology::of(&closed))
    }

    const SAVED: &'static [&'static str] = &MESHES;
    const USUAL: &'static str = MESHES[0];

    fn save(&self, u: &Field<3>, eps: f64, path: &Path) -> Result<(), Error> {
        Ok(surfaces::write(path, &surface(u, eps)?)?)
    }

    fn faired(&self, start: &Field<3>, u: &Field<3>, eps: f64) -> Result<Option<Faired>, Error> {
        if let Some(own) = &self.own {
            return own.faired(start, u, eps, self.up).map(Some);
        }
        // Sheets that touch each other are no surface from which another one could be far.
        let before = ClosedMesh::new(surfaces::phase_field_surface(start, eps)?).ok();
        let before = before.filter(|(before, _)| before.volume() > 0.0);
        let anew = |(before, _)| Faired::anew(&before, surface(u, eps)?, MESHES[0], self.up);
        before.map(anew).transpose()
    }

    fn input(&self) -> Option<Topology> {
        self.input
    }

    fn volume(&self) -> Option<f64> {
        let own = self.own.as_ref().filter(|own| own.keeps_volume);
        let own = own.map(|own| own.fairing().rough().volume());
        own.or_else(|| self.voxels.map(|voxels| voxels.volume))
    }

    fn measures(&self, start: &Field<3>, eps: f64) -> Result<Vec<Measure<3>>, Error> {
        let own = self.own.iter().map(|own| own.measure(start, eps));
        let voxels = self.voxels.iter();
        own.chain(voxels.map(|_| Ok(Measure::displacement(start, eps))))
            .collect()
    }

    fn stops(&self, start: &Field<3>) -> Vec<Stop> {
        let farthest = self.voxels.and_then(|voxels| voxels.farthest);
        let own = self.own.as_ref();
        let own = own.map_or(Vec::new(), |own| own.stops(start.grid().spacing()));
        own.into_iter()
            .chain(farthest.map(Stop::Displacement))
            .collect()
    }

    fn inputs(&self) -> Result<Vec<(&str, Vec<u8>)>, Error> {
        Ok(self.own.as_ref().map_or(Vec::new(), OwnMesh::inputs))
    }

    fn restore(&mut self, stored: &StoredRun) -> Result<(), Error> {
        self.own
            .as_mut()
            .map_or(Ok(()), |own| own.load_from(stored))
    }
}

/// The zero set as triangles, which would cut off what is round, with its volume where that can be measured.
pub fn surface(u: &Field<3>, eps: f64) -> Result<TriangleMesh, Error> {
    let mesh = surfaces::remeshed_surface(u, eps)?;
    let zero_set = ZeroSet::of(u, eps)?;
    Ok(if zero_set.sizes_hold() {
        mesh.with_volume(zero_set.volume, |_| true)
    } else {
        mesh
    })
}

/// Writes `final.npy`, `final.vti`, and, unless the shape has vanished, picture and shape, of which it returns the parts.
pub fn write_final<const D: usize, O: Outlet<D>>(
    outlet: &O,
    start: &Field<D>,
    u: &Field<D>,
    eps: f64,
    faired: Option<&Faired>,
    format: Option<&str>,
    run: &mut RunDirectory,
) -> Result<Topology, Error> {
    npy::write(run.path().join("final.npy"), u)?;
    run.adopt_file("final.npy")?;
    vti::write(run.path().join("final.vti"), "phase_field", u)?;
    run.adopt_file("final.vti")?;
    if !has_interface(u) {
        return Ok(Topology::default());
    }
    write_picture(&outlet.picture(start, u, eps)?, PICTURE, run)?;
    if let Some(faired) = faired {
        let name = format!("{FINAL}.{}", format.unwrap_or(&faired.extension));
        faired.write(&run.path().join(&name))?;
        run.adopt_file(&name)?;
        let text = faired.displacement.to_svg()?;
        run.write_file(DISPLACEMENT, |out| out.write_all(text.as_bytes()))?;
    } else {
        outlet.write_shape(u, eps, FINAL, format, run)?;
    }
    outlet.topology(u, eps)
}

/// Whether a file is written at the end of a run.
pub fn is_of_end(name: &str) -> bool {
    let stem = name.split('.').next();
    stem == Some(FINAL) || [SUMMARY, ANIMATION, SERIES].contains(&name)
}

pub fn write_picture(picture: &Picture, name: &str, run: &mut RunDirectory) -> Result<(), Error> {
    let bytes = picture.to_png()?;
    run.write_file(name, |out| out.write_all(&bytes))?;
    Ok(())
}

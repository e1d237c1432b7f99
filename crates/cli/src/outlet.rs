//! What people look at: pictures, meshes, drawings.

use std::fmt;
use std::path::Path;

use engine::{Measure, Stop};
use geometry::measure::{BoundingBox, bounding_box, has_interface};
use geometry::{Field, Placement, UpAxis, npy, vti};
use images::{Drawing, Frame, Interface, Outline, Svg};
use render::{Picture, Rgb, Scene, View};
use runs::{RunDirectory, StoredRun};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use surfaces::{ClosedMesh, TriangleMesh};

use crate::cli::MeshFormat;
use crate::error::Error;
use crate::own::{Faired, OwnMesh};

/// Pixels a side of pictures of surfaces.
const PIXELS: u32 = 480;
/// Room around a surface for its flow, as a part of its longest side.
const ROOM: f64 = 0.06;
/// From where surfaces are seen, with this axis pointing up.
pub fn view(up: UpAxis) -> View {
    View {
        up,
        azimuth: -60.0,
        elevation: 25.0,
    }
}

/// Names of files that hold the shape at the beginning, without their extension.
pub const START: &str = "start";
/// Names of files that hold the shape at the end, without their extension.
pub const FINAL: &str = "final";
/// The picture of the shape at the end.
pub const PICTURE: &str = "final.png";
/// The folder of pictures of the shape in between.
pub const FRAMES: &str = "frames";
/// The outcome of a run.
pub const SUMMARY: &str = "summary.json";

/// The parts of a shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    /// Closed curves or surfaces.
    pub components: usize,
    /// Of all surfaces together.
    pub euler_characteristic: Option<i64>,
}

impl Topology {
    /// Of a surface.
    pub fn of(surface: &ClosedMesh) -> Self {
        Self {
            components: surface.components(),
            euler_characteristic: Some(surface.euler_characteristic()),
        }
    }
}

impl fmt::Display for Topology {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} closed parts", self.components)?;
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

    /// The parts of the shape.
    fn topology(&self, u: &Field<D>, eps: f64) -> Result<Topology, Error>;

    /// Writes the shape to a file `stem.*`.
    fn write_shape(
        &self,
        u: &Field<D>,
        eps: f64,
        stem: &str,
        format: MeshFormat,
        run: &mut RunDirectory,
    ) -> Result<(), Error>;

    /// Writes the shape as a mesh to any file.
    fn save(&self, u: &Field<D>, eps: f64, path: &Path) -> Result<(), Error>;

    /// What becomes of the mesh whose vertices follow the flow, if there is one.
    fn faired(&self, _: &Field<D>, _: &Field<D>, _: f64) -> Result<Option<Faired>, Error> {
        Ok(None)
    }

    /// What is measured besides,
    fn measures(&self, _: &Field<D>, _: f64) -> Result<Vec<Measure<D>>, Error> {
        Ok(Vec::new())
    }

    /// and what may end the flow besides.
    fn stops(&self, _: &Field<D>) -> Vec<Stop> {
        Vec::new()
    }

    /// The name and the bytes of a file that it takes to resume a run, if there is one,
    fn input(&self) -> Option<(&str, &[u8])> {
        None
    }

    /// and what becomes of it there.
    fn restore(&mut self, _: &StoredRun) -> Result<(), Error> {
        Ok(())
    }
}

/// As the pixels of an image in the plane.
impl Outlet<2> for Frame {
    fn turn(&mut self, up: &mut Option<UpAxis>) -> Result<(), Error> {
        match up {
            None => Ok(()),
            Some(axis) => Err(Error::options(format!(
                "--up {axis} has no meaning in the plane: leave it out"
            ))),
        }
    }

    fn picture(&self, _: &Field<2>, u: &Field<2>, eps: f64) -> Result<Picture, Error> {
        let interface = Interface::new(u, eps)?;
        let drawing = Drawing::on_white(*self).filled(&interface, Rgb::BLACK);
        Ok(drawing.picture()?)
    }

    fn topology(&self, u: &Field<2>, _: f64) -> Result<Topology, Error> {
        Ok(Topology {
            components: Outline::of_phase_field(u)?.curves().len(),
            euler_characteristic: None,
        })
    }

    fn write_shape(
        &self,
        u: &Field<2>,
        _: f64,
        stem: &str,
        _: MeshFormat,
        run: &mut RunDirectory,
    ) -> Result<(), Error> {
        let name = format!("{stem}.svg");
        let outline = Outline::of_phase_field(u)?;
        Svg::on_white(*self)
            .filled(&outline, Rgb::BLACK)
            .write(run.path().join(&name))?;
        Ok(run.adopt_file(&name)?)
    }

    fn save(&self, _: &Field<2>, _: f64, path: &Path) -> Result<(), Error> {
        Err(Error::options(format!(
            "--save {} needs a surface in space",
            path.display()
        )))
    }
}

/// From the box to the coordinates of a mesh, `origin + unit p`, and its upward axis.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Space {
    origin: [f64; 3],
    unit: f64,
    up: UpAxis,
    /// The mesh whose vertices follow the flow, if it is one.
    #[serde(default)]
    pub own: Option<OwnMesh>,
}

impl Space {
    /// The coordinates of the box.
    pub fn identity() -> Self {
        Self {
            origin: [0.0; 3],
            unit: 1.0,
            up: UpAxis::default(),
            own: None,
        }
    }

    /// The coordinates of a mesh that was placed in the box.
    pub fn of(placement: &Placement<3>, up: UpAxis) -> Self {
        Self {
            origin: placement.apply_inverse([0.0; 3]),
            unit: placement.scale().recip(),
            up,
            own: None,
        }
    }

    /// The length in the mesh's units of a unit of the box.
    pub fn unit(&self) -> f64 {
        self.unit
    }

    /// A point of the box in the coordinates that the mesh came in,
    pub fn to_own(&self, x: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| self.unit.mul_add(x[i], self.origin[i]))
    }

    /// and the other way round.
    pub fn placement(&self) -> Result<Placement<3>, Error> {
        Ok(Placement::about(self.origin, self.unit.recip())?)
    }

    /// A mesh in the box, in the coordinates that it came in.
    pub fn in_own_coordinates(&self, mut mesh: TriangleMesh) -> TriangleMesh {
        for x in &mut mesh.vertices {
            *x = self.to_own(*x);
        }
        mesh
    }

    fn mesh(&self, u: &Field<3>, eps: f64) -> Result<TriangleMesh, Error> {
        Ok(self.in_own_coordinates(surfaces::remeshed_surface(u, eps)?))
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

    fn write_shape(
        &self,
        u: &Field<3>,
        eps: f64,
        stem: &str,
        format: MeshFormat,
        run: &mut RunDirectory,
    ) -> Result<(), Error> {
        let name = format!("{stem}.{format}");
        let mesh = self.mesh(u, eps)?;
        surfaces::write(run.path().join(&name), &mesh)?;
        Ok(run.adopt_file(&name)?)
    }

    fn save(&self, u: &Field<3>, eps: f64, path: &Path) -> Result<(), Error> {
        Ok(surfaces::write(path, &self.mesh(u, eps)?)?)
    }

    fn faired(&self, start: &Field<3>, u: &Field<3>, eps: f64) -> Result<Option<Faired>, Error> {
        let own = self.own.as_ref();
        own.map(|own| own.faired(start, u, eps, self)).transpose()
    }

    fn measures(&self, start: &Field<3>, eps: f64) -> Result<Vec<Measure<3>>, Error> {
        let own = self.own.iter();
        own.map(|own| own.measure(start, eps, self)).collect()
    }

    fn stops(&self, start: &Field<3>) -> Vec<Stop> {
        let own = self.own.as_ref();
        own.map_or(Vec::new(), |own| own.stops(start.grid().spacing(), self))
    }

    fn input(&self) -> Option<(&str, &[u8])> {
        self.own.as_ref().map(OwnMesh::input)
    }

    fn restore(&mut self, stored: &StoredRun) -> Result<(), Error> {
        self.own
            .as_mut()
            .map_or(Ok(()), |own| own.load_from(stored))
    }
}

/// Writes `final.npy`, `final.vti`, and, unless the shape has vanished, picture and shape, of which it returns the parts.
pub fn write_final<const D: usize, O: Outlet<D>>(
    outlet: &O,
    start: &Field<D>,
    u: &Field<D>,
    eps: f64,
    faired: Option<&Faired>,
    format: Option<MeshFormat>,
    run: &mut RunDirectory,
) -> Result<Topology, Error> {
    npy::write(run.path().join("final.npy"), u)?;
    run.adopt_file("final.npy")?;
    vti::write(run.path().join("final.vti"), &[("phase_field", u)])?;
    run.adopt_file("final.vti")?;
    if !has_interface(u) {
        return Ok(Topology::default());
    }
    write_picture(&outlet.picture(start, u, eps)?, PICTURE, run)?;
    if let Some(faired) = faired {
        let extension = format.map_or(faired.extension.clone(), |format| format.to_string());
        let name = format!("{FINAL}.{extension}");
        faired.write(&run.path().join(&name))?;
        run.adopt_file(&name)?;
    } else {
        outlet.write_shape(u, eps, FINAL, format.unwrap_or_default(), run)?;
    }
    outlet.topology(u, eps)
}

/// Adds a picture to a run.
pub fn write_picture(picture: &Picture, name: &str, run: &mut RunDirectory) -> Result<(), Error> {
    let bytes = picture.to_png()?;
    run.write_file(name, |out| out.write_all(&bytes))?;
    Ok(())
}

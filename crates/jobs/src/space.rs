//! Surfaces in space.

use geometry::measure::bounding_box;
use render::{Quality, View};

use crate::faired::{Faired, surface};
use crate::made::{Shape, Surface, encoded};
use crate::own::OwnMesh;
use crate::parts::Voxels;
use crate::paths::MESHES;
use crate::prelude::*;
use crate::presentation::{Known, Presentation, Topology};

const PIXELS: u32 = 480;
/// Room around a surface for its flow, as a part of its longest side.
const ROOM: f64 = 0.06;

#[derive(Default, Serialize, Deserialize)]
pub struct Space {
    pub up: UpAxis,
    /// The parts and holes of the mesh that it was, if it was one.
    pub input: Option<Topology>,
    /// The mesh whose vertices follow the flow, if it is one.
    pub own: Option<OwnMesh>,
    /// The voxels that it was, if it was some.
    pub voxels: Option<Voxels>,
}

impl Space {
    /// Whether what is taken off is noise, or the staircase of voxels, so that there is no growth to leave room for.
    fn hardly_moves(&self) -> bool {
        let ends_early = |voxels: &Voxels| voxels.time.is_some();
        self.own.is_some() || self.voxels.as_ref().is_some_and(ends_early)
    }
}

impl Presentation<3> for Space {
    const SAVED: &'static [&'static str] = &MESHES;
    const USUAL: &'static str = MESHES[0];

    fn extension(&self) -> &str {
        let own = self.own.as_ref();
        own.map_or(Self::USUAL, OwnMesh::extension)
    }

    fn of_box(_: &Grid<3>) -> Result<Self> {
        Ok(Self::default())
    }

    fn turn(&mut self, up: &mut Option<UpAxis>) -> Result<()> {
        self.up = *up.get_or_insert(self.up);
        Ok(())
    }

    fn picture(&self, start: &Stored<3>, u: &Stored<3>, eps: f64) -> Result<Picture> {
        let mut scene = Scene::new(u, eps)?.view(View::from_front_left(self.up));
        if self.hardly_moves() {
            let start = surfaces::phase_field_surface(start, eps)?;
            let scene = scene.beside(start.vertices).quality(Quality::Draft);
            return Ok(scene.render([PIXELS; 2])?);
        }
        // Room to grow, and more only for what grows beyond it, so that the pictures of a film do not jump.
        let start = bounding_box(start).map(|b| b.grown([ROOM * b.longest_side(); 3]));
        let both = start.into_iter().chain(scene.bounds());
        if let Some(frame) = BoundingBox::around(both.flat_map(|b| [b.lower, b.upper])) {
            scene = scene.within(frame);
        }
        Ok(scene.render([PIXELS; 2])?)
    }

    fn topology(&self, u: &Stored<3>) -> Result<Topology> {
        let flowing = surfaces::phase_field_topology(u)?.into();
        let voxels = self.voxels.as_ref();
        Ok(voxels.map_or(flowing, |voxels| voxels.with_small_parts(flowing)))
    }

    fn encode(&self, u: &Stored<3>, eps: f64, format: &str) -> Result<Vec<u8>> {
        let mesh = match &self.voxels {
            Some(voxels) => voxels.made(u, eps)?.0,
            None => surface(u, eps)?,
        };
        encoded(&mesh, self.up, format)
    }

    fn shape(&self, u: &Stored<3>, eps: f64, faired: Option<Faired>) -> Result<Shape> {
        Ok(Shape::Surface(match faired {
            Some(faired) => faired.surface,
            None => Surface {
                mesh: surface(u, eps)?,
                up: self.up,
                file: None,
            },
        }))
    }

    fn faired(&self, start: &Stored<3>, u: &Stored<3>, eps: f64) -> Result<Option<Faired>> {
        if let Some(own) = &self.own {
            return own.faired(start, u, eps, self.up).map(Some);
        }
        if let Some(voxels) = &self.voxels {
            return voxels.faired(u, eps, self.up).map(Some);
        }
        // Sheets that touch each other are no surface from which another one could be far. Both surfaces are made alike, so that nothing but
        // the flow tells them apart.
        match ClosedMesh::new(surface(start, eps)?) {
            Ok((before, _)) if before.volume() > 0.0 => {
                Ok(Some(Faired::anew(&before, surface(u, eps)?, self.up)))
            }
            _ => Ok(None),
        }
    }

    fn starts_as_input(&self) -> bool {
        self.own.is_some()
    }

    fn input(&self) -> Option<Topology> {
        self.input
    }

    fn known(&self, start: &Stored<3>, eps: f64) -> Result<Known<3>> {
        if let Some(own) = &self.own {
            return own.known(start, eps);
        }
        let mut known = Known::default();
        if let Some(voxels) = &self.voxels {
            known.volume = Some(voxels.volume);
            known.max_distance = voxels.max_distance;
            known.measures.push(Measure::displacement(start, eps));
            known.stops.extend(voxels.time.map(Stop::Time));
            known.stops.extend(voxels.farthest.map(Stop::Displacement));
        }
        Ok(known)
    }

    fn inputs(&self) -> Result<Vec<(String, Vec<u8>)>> {
        let mut inputs = self.own.as_ref().map_or(Vec::new(), OwnMesh::inputs);
        let voxels = self.voxels.as_ref().map(Voxels::input);
        inputs.extend(voxels.transpose()?);
        Ok(inputs)
    }

    fn restore(&mut self, stored: &StoredRun) -> Result<()> {
        if let Some(voxels) = &mut self.voxels {
            voxels.load_from(stored)?;
        }
        let own = self.own.as_mut();
        own.map_or(Ok(()), |own| own.load_from(stored))
    }
}

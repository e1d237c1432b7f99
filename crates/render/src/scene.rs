//! Scenes: a surface and how it is shown.

use std::sync::Arc;
use std::time::Duration;

use geometry::{Field, SignedDistance, UpAxis, distance_from_phase_field};
use glam::DVec3;
use srgb::Rgb;

use crate::camera::{Bounds, Camera, Framing, Projection, Subject};
use crate::error::{fraction, require};
use crate::film::{Film, GroundPlane, Quality};
use crate::light::{Lighting, Lights, Material};
use crate::picture::{Light, Picture, checked};
use crate::tube::{Tube, Tubes};
use crate::volume::{Lattice, Spline, Volume, padded};
use crate::{Animation, Error};

/// Distances from a phase field are trusted up to this many `eps`.
const TRUSTED: f64 = 3.0;
/// Signed distances are clamped at this many cells: the interpolant needs no more.
const NEEDED: f64 = 6.0;

/// What is behind the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Background {
    /// White.
    #[default]
    White,
    /// Nothing: the picture has an opacity channel.
    Transparent,
    /// One colour.
    Colour(Rgb),
}

/// A side of a square picture, or width and height, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size([u32; 2]);

impl From<u32> for Size {
    fn from(side: u32) -> Self {
        Self([side; 2])
    }
}

impl From<(u32, u32)> for Size {
    fn from((width, height): (u32, u32)) -> Self {
        Self([width, height])
    }
}

/// Colour of the part of the surface where a function of the position is negative.
#[derive(Clone)]
struct Highlight<'a> {
    region: Arc<dyn Fn(DVec3) -> f64 + Send + Sync + 'a>,
    colour: Rgb,
}

/// A surface, the view of it, and its looks.
///
/// Setters never fail; everything is checked by [`Scene::render`].
#[derive(Clone)]
pub struct Scene<'a> {
    lattice: Lattice,
    domain: Bounds,
    volume: Arc<Volume>,
    camera: Camera,
    material: Material,
    lighting: Lighting,
    background: Background,
    ground_shadow: Option<f64>,
    tubes: Vec<Tube>,
    highlights: Vec<Highlight<'a>>,
    quality: Quality,
}

impl<'a> Scene<'a> {
    /// The surface `u = 0` of a phase field, which is positive inside.
    ///
    /// The interface is found as the zero of the distance `-(4 eps / 3) atanh u`, smoothly clamped
    /// at `3 eps`; what `u` does further away is not seen. A cubic B-spline makes a smooth surface
    /// of it. The solid ends at the faces of the grid's box.
    ///
    /// # Errors
    /// `u` must be finite, and `eps` finite and positive.
    pub fn new(u: &Field<3>, eps: f64) -> Result<Self, Error> {
        require("eps", eps, "positive", |v| v > 0.0)?;
        let h = u.grid().spacing();
        let limit = TRUSTED * eps / h;
        Self::with_distance(u, limit, |v| distance_from_phase_field(v, eps) / h)
    }

    /// The surface of a signed distance, which is negative inside; only its zeros, and its slope
    /// there, matter.
    ///
    /// # Errors
    /// The field must be finite.
    pub fn from_signed_distance(distance: &Field<3>) -> Result<Self, Error> {
        let h = distance.grid().spacing();
        Self::with_distance(distance, NEEDED, |v| v / h)
    }

    fn with_distance(
        field: &Field<3>,
        limit: f64,
        distance: impl Fn(f64) -> f64 + Sync,
    ) -> Result<Self, Error> {
        field.check_finite()?;
        let grid = field.grid();
        Ok(Self {
            lattice: Lattice::new(grid),
            domain: Bounds {
                low: grid.origin(),
                high: grid.origin().map(|low| low + grid.side()),
            },
            volume: Arc::new(Volume::new(field, limit, distance)),
            camera: Camera::default(),
            material: Material::default(),
            lighting: Lighting::default(),
            background: Background::default(),
            ground_shadow: None,
            tubes: Vec::new(),
            highlights: Vec::new(),
            quality: Quality::default(),
        })
    }

    /// Sets the whole camera.
    #[must_use]
    pub fn camera(mut self, camera: Camera) -> Self {
        self.camera = camera;
        self
    }

    /// Sets the axis that points up.
    #[must_use]
    pub fn up(mut self, axis: UpAxis) -> Self {
        self.camera.up = axis;
        self
    }

    /// Sets the azimuth of the camera in degrees; see [`Camera`].
    #[must_use]
    pub fn azimuth(mut self, degrees: f64) -> Self {
        self.camera.azimuth = degrees;
        self
    }

    /// Sets the elevation of the camera in degrees.
    #[must_use]
    pub fn elevation(mut self, degrees: f64) -> Self {
        self.camera.elevation = degrees;
        self
    }

    /// Uses parallel rays.
    #[must_use]
    pub fn orthographic(mut self) -> Self {
        self.camera.projection = Projection::Orthographic;
        self
    }

    /// Uses rays from one point, for the given angle of view in degrees.
    #[must_use]
    pub fn perspective(mut self, field_of_view: f64) -> Self {
        self.camera.projection = Projection::Perspective { field_of_view };
        self
    }

    /// Sets what fills the picture.
    #[must_use]
    pub fn framing(mut self, framing: Framing) -> Self {
        self.camera.framing = framing;
        self
    }

    /// Sets the part of the picture left free on each side.
    #[must_use]
    pub fn margin(mut self, margin: f64) -> Self {
        self.camera.margin = margin;
        self
    }

    /// Sets the material of the surface.
    #[must_use]
    pub fn material(mut self, material: Material) -> Self {
        self.material = material;
        self
    }

    /// Sets the body colour of the surface.
    #[must_use]
    pub fn colour(mut self, colour: Rgb) -> Self {
        self.material.colour = colour;
        self
    }

    /// Sets the lights.
    #[must_use]
    pub fn lighting(mut self, lighting: Lighting) -> Self {
        self.lighting = lighting;
        self
    }

    /// Sets the background.
    #[must_use]
    pub fn background(mut self, background: Background) -> Self {
        self.background = background;
        self
    }

    /// Lets the surface stand on an invisible ground that receives its shadow, of the given
    /// strength from 0 (none) to 1 (full). The ground is seen from above only, and
    /// [`Framing::Surface`] makes room for the shadow.
    #[must_use]
    pub fn ground_shadow(mut self, strength: f64) -> Self {
        self.ground_shadow = Some(strength);
        self
    }

    /// Adds a tube.
    #[must_use]
    pub fn tube(mut self, tube: Tube) -> Self {
        self.tubes.push(tube);
        self
    }

    /// Adds tubes.
    #[must_use]
    pub fn tubes(mut self, tubes: impl IntoIterator<Item = Tube>) -> Self {
        self.tubes.extend(tubes);
        self
    }

    /// Gives another colour to the part of the surface inside a shape, where its signed distance
    /// (any function of its sign will do) is negative. Later calls win.
    #[must_use]
    pub fn highlight(mut self, shape: impl SignedDistance<3> + Send + 'a, colour: Rgb) -> Self {
        let lattice = self.lattice;
        self.highlights.push(Highlight {
            region: Arc::new(move |p| shape.signed_distance(lattice.position(p))),
            colour,
        });
        self
    }

    /// Gives another colour to the part of the surface where a mask of zeros and ones, smoothed
    /// over a cell by a cubic B-spline, exceeds one half: an inpainting domain, for example.
    ///
    /// # Errors
    /// The mask must be finite.
    pub fn highlight_mask(mut self, mask: &Field<3>, colour: Rgb) -> Result<Self, Error> {
        mask.check_finite()?;
        let (from, to) = (self.lattice, Lattice::new(mask.grid()));
        let (size, values) = padded(mask, |v| v);
        let spline = Spline::new(size, values);
        self.highlights.push(Highlight {
            region: Arc::new(move |p| 0.5 - spline.value(to.place(from.position(p)))),
            colour,
        });
        Ok(self)
    }

    /// Sets how many rays are spent.
    #[must_use]
    pub fn quality(mut self, quality: Quality) -> Self {
        self.quality = quality;
        self
    }

    /// The box around the surface, if there is one; tubes are left out. Found where the edges of
    /// the grid cross the surface, so it may be short of it by a small part of a cell.
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::around(
            self.volume
                .crossings
                .iter()
                .map(|&p| self.lattice.position(p)),
        )
    }

    /// Points that outline the surface and the tubes, in lattice coordinates.
    fn outline(&self, tubes: &Tubes) -> Vec<DVec3> {
        let mut points = self.volume.crossings.clone();
        points.extend(tubes.extent());
        points
    }

    /// What the camera is fitted to, in lattice coordinates.
    fn subject(
        &self,
        mut outline: Vec<DVec3>,
        ground: Option<&GroundPlane>,
        lights: &Lights,
    ) -> Result<Subject, Error> {
        let within = |bounds: &Bounds| {
            let [low, high] = [bounds.low, bounds.high].map(|p| self.lattice.place(p).to_array());
            Subject::bounds(&Bounds { low, high })
        };
        match &self.camera.framing {
            Framing::Surface => {
                if outline.is_empty() {
                    return Err(Error::NothingToFrame);
                }
                if let Some(ground) = ground {
                    let shadow: Vec<DVec3> = outline
                        .iter()
                        .filter_map(|&p| ground.shadow_of(p, lights.key))
                        .collect();
                    outline.extend(shadow);
                }
                Ok(Subject::Points(outline))
            }
            Framing::Domain => within(&self.domain),
            Framing::Within(bounds) => within(bounds),
            &Framing::Ball { centre, radius } => {
                let centre = self.lattice.place(centre).to_array();
                Subject::ball(centre, self.lattice.length(radius))
            }
        }
    }

    /// Draws the picture. It takes some 50 bytes of memory for each pixel.
    ///
    /// # Errors
    /// A number out of range, nothing to frame, or a size that cannot be drawn.
    pub fn render(&self, size: impl Into<Size>) -> Result<Picture, Error> {
        let size = checked(size.into().0)?;
        self.material.check()?;
        let tubes = Tubes::new(&self.tubes, &self.lattice)?;
        let orientation = self.camera.orientation()?;
        let lights = self.lighting.resolve(&orientation)?;
        let outline = self.outline(&tubes);
        let up = orientation.up;
        let ground = match self.ground_shadow {
            None => None,
            Some(strength) => Some(GroundPlane {
                up,
                height: outline
                    .iter()
                    .map(|p| p.dot(up))
                    .fold(f64::INFINITY, f64::min),
                strength: fraction("strength of the ground shadow", strength)?,
            }),
        };
        let subject = self.subject(outline, ground.as_ref(), &lights)?;
        let view = self.camera.view(&subject, size)?;
        // The last highlight that holds a point wins; colour 0 is that of the material.
        let region = |p: DVec3| {
            let holds = |h: &Highlight<'_>| (h.region)(p) < 0.0;
            self.highlights.iter().rposition(holds).map_or(0, |k| k + 1)
        };
        let highlights = self.highlights.iter().map(|h| h.colour);
        let film = Film {
            volume: &self.volume,
            view,
            lights,
            material: self.material,
            region: &region,
            surface_colours: std::iter::once(self.material.colour)
                .chain(highlights)
                .map(Rgb::linear)
                .collect(),
            tube_colours: self.tubes.iter().map(|t| t.colour.linear()).collect(),
            tubes,
            ground,
            background: match self.background {
                Background::White => Light::opaque(Rgb::WHITE.linear()),
                Background::Transparent => Light::default(),
                Background::Colour(colour) => Light::opaque(colour.linear()),
            },
            quality: self.quality,
            size,
        };
        Ok(film.draw())
    }

    /// Draws one turn about the upward axis, counter-clockwise seen from above, in `frames`
    /// pictures. The framing is replaced by the ball around the surface, so that nothing jumps.
    ///
    /// # Errors
    /// As [`Scene::render`] and [`Animation::new`].
    pub fn turntable(
        &self,
        frames: usize,
        size: impl Into<Size>,
        delay: Duration,
    ) -> Result<Animation, Error> {
        let size = size.into();
        let bounds = self.bounds().ok_or(Error::NothingToFrame)?;
        let framing = Framing::Ball {
            centre: bounds.centre(),
            radius: bounds.radius(),
        };
        let pictures = (0..frames).map(|k| {
            // The camera goes clockwise, so the subject seems to turn the other way.
            let turn = 360.0 * k as f64 / frames as f64;
            self.clone()
                .framing(framing)
                .azimuth(self.camera.azimuth - turn)
                .render(size)
        });
        Animation::new(pictures.collect::<Result<_, _>>()?, delay)
    }
}

//! Scenes: a surface and how it is shown.

use geometry::measure::BoundingBox;
use geometry::{Field, PhaseField, Stored, distances_from_phase_field, require};
use glam::DVec3;
use rayon::prelude::*;
use srgb::Rgb;
use surfaces::{TriangleMesh, isosurface};

use crate::Error;
use crate::camera::{Camera, View};
use crate::light::Lights;
use crate::model::{Model, Tube};
use crate::picture::{Picture, checked_size};
use crate::raster::Triangle;
use crate::shadow::arriving;

/// Rows of a picture drawn at once.
const BAND: usize = 8;

/// How much is spent on a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Quality {
    /// For tests and previews.
    Draft,
    /// For figures.
    #[default]
    Standard,
}

impl Quality {
    /// Numbers of directions to the surroundings and into the key light, pixels a side of a shadow map, and samples of a pixel of the
    /// picture along each axis.
    fn effort(self) -> [usize; 4] {
        match self {
            Self::Draft => [64, 8, 160, 3],
            Self::Standard => [160, 24, 400, 4],
        }
    }
}

/// A surface, the view of it, and its looks.
///
/// Setters never fail; everything is checked by [`Scene::render`].
#[must_use]
#[derive(Clone)]
pub struct Scene {
    mesh: TriangleMesh,
    view: View,
    framed: Option<BoundingBox<3>>,
    /// What is to fit into the picture besides, if nothing is framed.
    beside: Vec<DVec3>,
    colour: Rgb,
    tubes: Vec<Tube>,
    /// A colour, and where it is: where the value at a vertex, interpolated, exceeds one half.
    highlight: Option<(Vec<f64>, Rgb)>,
    /// Of the vertices of the surface, if it has not one for all.
    painted: Option<Vec<Rgb>>,
    quality: Quality,
}

impl Scene {
    /// The surface `u = 0` of a phase field, which is positive inside: that of the distances
    /// `-(4 eps / 3) atanh u`, smoothed a little, so that edges are rounded over two cells and have no
    /// teeth; what is smooth moves by `h^2 / 3` times the mean curvature, which no picture shows.
    pub fn new(u: &impl PhaseField<3>, eps: f64) -> Result<Self, Error> {
        let distance = distances_from_phase_field(u, eps)?;
        Ok(Self::of_mesh(isosurface(&distance.smoothed())?))
    }

    /// A mesh. Light is computed at its vertices: large triangles look flat.
    pub fn of_mesh(mesh: TriangleMesh) -> Self {
        Self {
            mesh,
            view: View::default(),
            framed: None,
            beside: Vec::new(),
            colour: Rgb::CLAY,
            tubes: Vec::new(),
            highlight: None,
            painted: None,
            quality: Quality::default(),
        }
    }

    /// Sets the direction of view (from the front right and a little above by default).
    pub fn view(mut self, view: View) -> Self {
        self.view = view;
        self
    }

    /// Lets a box fill the picture, such as that around the surfaces of several scenes, and not the
    /// surface with its tubes.
    pub fn within(mut self, bounds: BoundingBox<3>) -> Self {
        self.framed = Some(bounds);
        self
    }

    /// Lets the surface fill the picture together with other points, such as the vertices of a surface in another picture. A box around them
    /// would leave its corners free.
    pub fn beside(mut self, points: impl IntoIterator<Item = [f64; 3]>) -> Self {
        self.beside.extend(points.into_iter().map(DVec3::from));
        self
    }

    /// Sets the colour of the surface where no other is given ([`Rgb::CLAY`] by default).
    pub fn colour(mut self, colour: Rgb) -> Self {
        self.colour = colour;
        self
    }

    /// Adds tubes, which hide the surface and cast shadows on it.
    pub fn tubes(mut self, tubes: impl IntoIterator<Item = Tube>) -> Self {
        self.tubes.extend(tubes);
        self
    }

    /// Gives another colour to the part of the surface where a mask of zeros and ones, smoothed
    /// over a cell, exceeds one half: an inpainting domain, for example.
    pub fn highlight_mask(mut self, mask: &Field<3>, colour: Rgb) -> Result<Self, Error> {
        mask.check_finite()?;
        let mask = Stored::whole(mask.clone()).smoothed().field()?;
        let values = self.mesh.vertices.iter().map(|&x| mask.interpolate(x));
        self.highlight = Some((values.collect(), colour));
        Ok(self)
    }

    /// Gives every vertex of the surface its own colour, one for each, interpolated between them.
    pub fn painted(mut self, colours: Vec<Rgb>) -> Result<Self, Error> {
        let (count, vertices) = (colours.len(), self.mesh.vertices.len());
        let range = "that of the vertices";
        require("number of colours", count as f64, range, |_| {
            count == vertices
        })?;
        self.painted = Some(colours);
        Ok(self)
    }

    /// Sets how much is spent ([`Quality::Standard`] by default).
    pub fn quality(mut self, quality: Quality) -> Self {
        self.quality = quality;
        self
    }

    /// The box around the surface, if there is one; tubes are left out.
    pub fn bounds(&self) -> Option<BoundingBox<3>> {
        self.mesh.bounding_box()
    }

    /// Draws the picture of `[width, height]` pixels, as many as [`checked_size`] accepts. There must be something to draw.
    pub fn render(&self, size: [u32; 2]) -> Result<Picture, Error> {
        let size = checked_size(size)?;
        self.mesh.check(f64::MAX)?;
        let mut model = Model::new(&self.mesh);
        let mut colours = vec![self.colour.linear()];
        for (index, tube) in self.tubes.iter().enumerate() {
            model.push(tube, index, colours.len())?;
            colours.push(tube.colour.linear());
        }
        let [sky, key, map_side, per_side] = self.quality.effort();
        let camera = self.camera(&model, size.map(|side| per_side as u32 * side))?;
        let lights = Lights::new(&self.view.orientation()?);
        let drawing = Drawing {
            arriving: arriving(&model, &lights, [sky, key], map_side),
            triangles: (model.triangles.iter())
                .map(|corners| corners.map(|v| camera.project(model.vertices[v as usize].place)))
                .map(Triangle::new)
                .collect(),
            highlight: (self.highlight.as_ref()).map(|(mask, colour)| (&**mask, colour.linear())),
            painted: (self.painted.iter().flatten())
                .map(|colour| colour.linear())
                .collect(),
            per_side,
            model,
            colours,
            camera,
            lights,
            size: size.map(|side| side as usize),
        };
        Picture::new(size, drawing.pixels())
    }

    /// The camera, fitted to what is to fill the picture.
    fn camera(&self, model: &Model, size: [u32; 2]) -> Result<Camera, Error> {
        let points: Vec<DVec3> = match &self.framed {
            None => {
                // Vertices of no triangle are not seen.
                let mut seen = vec![false; model.vertices.len()];
                for &corner in model.triangles.as_flattened() {
                    seen[corner as usize] = true;
                }
                let own = model.vertices.iter().zip(seen).filter(|(_, seen)| *seen);
                let own = own.map(|(vertex, _)| vertex.place);
                own.chain(self.beside.iter().copied()).collect()
            }
            Some(bounds) => {
                for (low, extent) in bounds.lower.into_iter().zip(bounds.extent()) {
                    require("lower end of the framed box", low, "finite", |_| true)?;
                    let side = "side of the framed box";
                    require(side, extent, "at least 0", |v| v >= 0.0)?;
                }
                let corner =
                    |k: usize, axis: usize| [bounds.lower, bounds.upper][k >> axis & 1][axis];
                (0..8)
                    .map(|k| DVec3::from(std::array::from_fn(|axis| corner(k, axis))))
                    .collect()
            }
        };
        let sum: DVec3 = points.iter().sum();
        if points.is_empty() {
            return Err(Error::NothingToFrame);
        }
        let centre = sum / points.len() as f64;
        Camera::fit(self.view.orientation()?, &points, centre, size)
    }
}

/// Everything needed to draw.
struct Drawing<'a> {
    model: Model,
    /// As they are seen, in units of samples.
    triangles: Vec<Triangle>,
    arriving: Vec<[f64; 2]>,
    colours: Vec<[f32; 3]>,
    highlight: Option<(&'a [f64], [f32; 3])>,
    /// Of the first vertices, if those have their own.
    painted: Vec<[f32; 3]>,
    camera: Camera,
    lights: Lights,
    size: [usize; 2],
    per_side: usize,
}

impl Drawing<'_> {
    fn pixels(&self) -> Vec<[u8; 4]> {
        let [width, height] = self.size;
        let mut pixels = vec![[0; 4]; width * height];
        let triangles = self.triangles_of_bands();
        let bands = pixels.par_chunks_mut(BAND * width).zip(triangles);
        bands.enumerate().for_each(|(band, (pixels, triangles))| {
            self.band(BAND * band, &triangles, pixels);
        });
        pixels
    }

    /// The triangles that may be seen in each band.
    fn triangles_of_bands(&self) -> Vec<Vec<usize>> {
        let [_, height] = self.size;
        let samples = self.per_side * BAND;
        let mut bands = vec![Vec::new(); height.div_ceil(BAND)];
        for (index, triangle) in self.triangles.iter().enumerate() {
            let rows = triangle.rows(0..self.per_side * height);
            if !rows.is_empty() {
                for band in &mut bands[rows.start / samples..=(rows.end - 1) / samples] {
                    band.push(index);
                }
            }
        }
        bands
    }

    /// Some whole rows.
    fn band(&self, first: usize, triangles: &[usize], pixels: &mut [[u8; 4]]) {
        let per_side = self.per_side;
        let columns = per_side * self.size[0];
        let from = per_side * first;
        let rows = per_side * (pixels.len() / self.size[0]);
        // What is nearest, and how near.
        let mut samples = vec![(0.0, usize::MAX); columns * rows];
        for &index in triangles {
            self.triangles[index].scan(columns, from..from + rows, |x, y, near| {
                let sample = &mut samples[(y - from) * columns + x];
                if near > sample.0 {
                    *sample = (near, index);
                }
            });
        }
        for (at, pixel) in pixels.iter_mut().enumerate() {
            // Linear intensities.
            let mut sum = [0.0; 3];
            for part in 0..per_side * per_side {
                let x = at % self.size[0] * per_side + part % per_side;
                let y = at / self.size[0] * per_side + part / per_side;
                let (_, triangle) = samples[y * columns + x];
                let light = if triangle == usize::MAX {
                    [1.0; 3]
                } else {
                    self.shade(triangle, [x, y + from].map(|v| v as f64 + 0.5))
                };
                sum = std::array::from_fn(|c| sum[c] + light[c]);
            }
            let count = (per_side * per_side) as f32;
            let [r, g, b] = sum.map(|light| srgb::encode(light / count));
            *pixel = [r, g, b, 255];
        }
    }

    /// The colour of a triangle at a point of the picture.
    fn shade(&self, triangle: usize, [x, y]: [f64; 2]) -> [f32; 3] {
        let corners = self.model.triangles[triangle].map(|vertex| vertex as usize);
        let weights = self.triangles[triangle].perspective_weights(x, y);
        let vertices = corners.map(|vertex| &self.model.vertices[vertex]);
        let mean = |value: &dyn Fn(usize) -> DVec3| -> DVec3 {
            (0..3).map(|k| weights[k] * value(k)).sum()
        };
        let place = mean(&|k| vertices[k].place);
        let toward = (self.camera.position - place).normalize();
        let normal = mean(&|k| vertices[k].normal)
            .try_normalize()
            .unwrap_or(toward);
        let light = mean(&|k| {
            let [key, open] = self.arriving[corners[k]];
            DVec3::new(key, open, 0.0)
        });
        let body = match (self.highlight, vertices[0].colour) {
            (Some((mask, colour)), 0) if mean(&|k| DVec3::splat(mask[corners[k]])).x > 0.5 => {
                colour
            }
            (_, 0) if !self.painted.is_empty() => {
                let colour = |k: usize| DVec3::from(self.painted[corners[k]].map(f64::from));
                mean(&colour).to_array().map(|light| light as f32)
            }
            (_, colour) => self.colours[colour],
        };
        self.lights.shade(body, normal, toward, [light.x, light.y])
    }
}

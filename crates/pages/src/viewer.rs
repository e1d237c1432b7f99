//! Surfaces to turn.

use std::fmt::Write;

use render::Axis;
use surfaces::TriangleMesh;

use crate::error::{Error, Result};
use crate::escape::escaped;
use crate::image::Image;
use crate::surface::Surface;

/// From where surfaces are seen at first; the angles are those of [`render::Camera`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The axis that points up.
    pub up: Axis,
    /// Degrees about it.
    pub azimuth: f64,
    /// Degrees above the horizon, from -90 to 90.
    pub elevation: f64,
}

impl Default for View {
    /// That of [`render::Camera`].
    fn default() -> Self {
        let camera = render::Camera::default();
        Self {
            up: camera.up,
            azimuth: camera.azimuth,
            elevation: camera.elevation,
        }
    }
}

/// Surfaces, such as the steps of a flow, of which one is shown and can be turned. A picture stands
/// in for them until they are started, and wherever they cannot be: without JavaScript or WebGL,
/// and on paper.
#[derive(Clone, Debug, PartialEq)]
pub struct Viewer {
    caption: String,
    poster: Image,
    view: View,
    surfaces: Vec<Surface>,
}

impl Viewer {
    /// A viewer of surfaces with a label each. All are seen in one scale and from one direction.
    ///
    /// Positions are rounded to 1/65535 of the bounding box; normals are those of the triangles
    /// around a vertex, weighted by area.
    ///
    /// # Errors
    /// [`Error::Empty`] without surfaces; [`Error::NoFaces`], [`Error::Vertex`], [`Error::Index`]
    /// for meshes that cannot be shown; [`Error::View`].
    pub fn new<'a>(
        caption: impl Into<String>,
        poster: Image,
        view: View,
        surfaces: impl IntoIterator<Item = (&'a str, &'a TriangleMesh)>,
    ) -> Result<Self> {
        let caption = caption.into();
        let angles = [
            ("azimuth", view.azimuth, f64::MAX, "finite"),
            ("elevation", view.elevation, 90.0, "between -90 and 90"),
        ];
        for (name, value, limit, requirement) in angles {
            if value.is_nan() || value.abs() > limit {
                return Err(Error::View {
                    title: caption,
                    name,
                    value,
                    requirement,
                });
            }
        }
        let surfaces = surfaces
            .into_iter()
            .map(|(label, mesh)| Surface::new(label, mesh))
            .collect::<Result<Vec<_>>>()?;
        if surfaces.is_empty() {
            return Err(Error::Empty {
                what: "the viewer",
                title: caption,
                item: "surface",
            });
        }
        Ok(Self {
            caption,
            poster,
            view,
            surfaces,
        })
    }

    pub(crate) fn is_linked(&self) -> bool {
        self.poster.is_linked()
    }

    pub(crate) fn html(&self) -> String {
        let caption = escaped(&self.caption);
        let up = match self.view.up {
            Axis::X => 0,
            Axis::Y => 1,
            Axis::Z => 2,
        };
        let mut html = format!(
            "<figure class=\"viewer\" data-caption=\"{caption}\" data-up=\"{up}\" \
             data-azimuth=\"{}\" data-elevation=\"{}\">\n<div class=\"stage\">{}</div>\n",
            self.view.azimuth,
            self.view.elevation,
            self.poster.html(&self.caption)
        );
        let listed = |values: [f64; 3]| values.map(|v| format!("{v:e}")).join(" ");
        for surface in &self.surfaces {
            // No script: a block of data, which browsers neither run nor show.
            let _ = writeln!(
                html,
                "<script type=\"text/plain\" data-label=\"{}\" data-vertices=\"{}\" \
                 data-faces=\"{}\" data-low=\"{}\" data-step=\"{}\">{}</script>",
                escaped(&surface.label),
                surface.vertices,
                surface.faces,
                listed(surface.low),
                listed(surface.step()),
                surface.data
            );
        }
        let _ = writeln!(html, "<figcaption>{caption}</figcaption>\n</figure>");
        html
    }
}

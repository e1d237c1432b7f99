//! Surfaces to turn.

use std::fmt::Write;

use geometry::UpAxis;
use surfaces::TriangleMesh;

use crate::error::{Error, Result};
use crate::escape::escaped;
use crate::image::Image;
use crate::surface::Surface;

/// From where surfaces are seen at first; the angles are those of [`render::Camera`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The axis that points up.
    pub up: UpAxis,
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
    /// Of the ball that all surfaces lie in.
    centre: [f64; 3],
    radius: f64,
}

impl Viewer {
    /// A viewer of surfaces with a label each. All are seen in one scale and from one direction.
    ///
    /// Positions are rounded to 1/65535 of the bounding box. Where a mesh has no normals, they are
    /// those of the triangles around a vertex, weighted by area.
    ///
    /// # Errors
    /// [`Error::Empty`] without surfaces; [`Error::NoFaces`], [`Error::Vertex`], [`Error::Index`]
    /// [`Error::Normals`] for
    /// meshes that cannot be shown; [`Error::View`].
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
        let (mut encoded, mut points) = (Vec::new(), Vec::new());
        for (label, mesh) in surfaces {
            encoded.push(Surface::new(label, mesh)?);
            let corners = mesh.faces.as_flattened().iter();
            points.extend(corners.map(|&vertex| mesh.vertices[vertex as usize]));
        }
        let surfaces = encoded;
        if surfaces.is_empty() {
            return Err(Error::Empty {
                what: "the viewer",
                title: caption,
                item: "surface",
            });
        }
        let (centre, radius) = ball(&points);
        Ok(Self {
            caption,
            poster,
            view,
            surfaces,
            centre,
            radius,
        })
    }

    pub(crate) fn is_linked(&self) -> bool {
        self.poster.is_linked()
    }

    pub(crate) fn html(&self) -> String {
        let caption = escaped(&self.caption);
        let up = self.view.up.index();
        let mut html = format!(
            "<figure class=\"viewer\" data-caption=\"{caption}\" data-up=\"{up}\" \
             data-azimuth=\"{}\" data-elevation=\"{}\" data-centre=\"{}\" \
             data-radius=\"{:e}\">\n<div class=\"stage\">{}</div>\n",
            self.view.azimuth,
            self.view.elevation,
            listed(self.centre),
            self.radius,
            self.poster.html(&self.caption)
        );
        for surface in &self.surfaces {
            // No script: a block of data, which browsers neither run nor show.
            let _ = writeln!(
                html,
                "<script type=\"text/plain\" data-label=\"{}\" data-vertices=\"{}\" \
                 data-faces=\"{}\"{} data-low=\"{}\" data-step=\"{}\">{}</script>",
                escaped(&surface.label),
                surface.vertices,
                surface.faces,
                if surface.has_normals {
                    " data-normals"
                } else {
                    ""
                },
                listed(surface.low),
                listed(surface.step()),
                surface.data
            );
        }
        let _ = writeln!(html, "<figcaption>{caption}</figcaption>\n</figure>");
        html
    }
}

fn listed(values: [f64; 3]) -> String {
    values.map(|v| format!("{v:e}")).join(" ")
}

/// The ball around points with the centre of their bounding box.
fn ball(points: &[[f64; 3]]) -> ([f64; 3], f64) {
    let centre = std::array::from_fn(|i| {
        let values = points.iter().map(|x| x[i]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
        0.5 * (low + high)
    });
    let radius = points.iter().map(|x| {
        let squares = (0..3).map(|i| (x[i] - centre[i]).powi(2));
        squares.sum::<f64>().sqrt()
    });
    let radius = radius.fold(0.0, f64::max);
    // A single point is seen from somewhere, too.
    (centre, if radius > 0.0 { radius } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ball_is_around_all_points() {
        // All coordinates are exact.
        let bits = |x: [f64; 3], radius: f64| (x.map(f64::to_bits), radius.to_bits());
        let points = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 3.0, 0.0]];
        let (centre, radius) = ball(&points);
        assert_eq!(bits(centre, radius), bits([2.0, 1.5, 0.0], 2.5));
        let (centre, radius) = ball(&[[3.0; 3]]);
        assert_eq!(bits(centre, radius), bits([3.0; 3], 1.0));
    }
}

//! Where a picture is taken from.

use geometry::{UpAxis, require};
use glam::DVec3;

use crate::Error;

/// Angle that the shorter side of a picture subtends, in degrees: a mild perspective.
const FIELD_OF_VIEW: f64 = 22.0;
/// Part of the picture left free on each side.
const MARGIN: f64 = 0.02;

/// The direction that a surface is looked at from:
/// `cos(el) (cos(az) a + sin(az) b) + sin(el) up`, where `az` is the azimuth, `el` the elevation
/// and `up`, `a`, `b` are consecutive axes (`z`, `x`, `y` if `z` points up).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The axis that points up in the picture.
    pub up: UpAxis,
    /// Degrees about the upward axis.
    pub azimuth: f64,
    /// Degrees above the horizon, from -90 to 90.
    pub elevation: f64,
}

impl Default for View {
    /// From the front right and a little above, `z` pointing up.
    fn default() -> Self {
        Self {
            up: UpAxis::default(),
            azimuth: 35.0,
            elevation: 22.0,
        }
    }
}

impl View {
    /// The usual view of shapes from files: azimuth -60, elevation 25 degrees.
    pub fn from_front_left(up: UpAxis) -> Self {
        Self {
            up,
            azimuth: -60.0,
            elevation: 25.0,
        }
    }

    /// Accepts finite angles, and elevations from -90 to 90 degrees.
    pub fn check(&self) -> Result<(), Error> {
        require("azimuth", self.azimuth, "finite", |_| true)?;
        let range = "between -90 and 90 degrees";
        require("elevation", self.elevation, range, |v| v.abs() <= 90.0)?;
        Ok(())
    }

    /// The directions of the view.
    pub(crate) fn orientation(&self) -> Result<Orientation, Error> {
        self.check()?;
        let [up, a, b] = [0, 1, 2].map(|k| DVec3::AXES[(self.up.index() + k) % 3]);
        let (sin_az, cos_az) = self.azimuth.to_radians().sin_cos();
        let (sin_el, cos_el) = self.elevation.to_radians().sin_cos();
        let horizontal = cos_az * a + sin_az * b;
        Ok(Orientation {
            // Well defined at the poles too, unlike a cross product with the upward axis.
            right: cos_az * b - sin_az * a,
            above: cos_el * up - sin_el * horizontal,
            toward: cos_el * horizontal + sin_el * up,
            up,
        })
    }
}

/// Orthonormal directions seen from the subject, and the axis that points up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Orientation {
    /// Rightwards in the picture.
    pub right: DVec3,
    /// Upwards in the picture.
    pub above: DVec3,
    /// Towards the camera.
    pub toward: DVec3,
    pub up: DVec3,
}

/// A camera fitted to its subject.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Camera {
    orientation: Orientation,
    pub position: DVec3,
    /// Pixels for each unit of slope against the axis of view.
    focal: f64,
    middle: [f64; 2],
}

impl Camera {
    /// The camera that comes as close as it can with all points, which are around `centre`, in a
    /// picture of `size` pixels. The points must have an extent in it.
    pub fn fit(
        orientation: Orientation,
        points: &[DVec3],
        centre: DVec3,
        size: [u32; 2],
    ) -> Result<Self, Error> {
        let Orientation {
            right,
            above,
            toward,
            ..
        } = orientation;
        let size = size.map(f64::from);
        let shorter = size[0].min(size[1]);
        let tangent = (0.5 * FIELD_OF_VIEW).to_radians().tan();
        let slopes = size.map(|side| side / shorter * (1.0 - 2.0 * MARGIN) * tangent);
        let placed: Vec<DVec3> = points
            .iter()
            .map(|&p| p - centre)
            .map(|p| DVec3::new(p.dot(right), p.dot(above), p.dot(toward)))
            .collect();
        // Half the extent and the middle along one direction of the picture, seen through a slit
        // that opens towards the back with the given slope.
        let across = |axis: usize, slope: f64| {
            let most = |sign: f64| {
                let values = placed.iter().map(|p| sign * p[axis] + slope * p.z);
                values.fold(f64::NEG_INFINITY, f64::max)
            };
            let (after, before) = (most(1.0), most(-1.0));
            (0.5 * (after + before), 0.5 * (after - before))
        };
        // The eye is where the slits of both directions are wide enough.
        let wide = |axis: usize| across(axis, slopes[axis]).0 / slopes[axis];
        let eye = wide(0).max(wide(1));
        let depths = placed.iter().map(|p| p.z);
        let nearest = depths.fold(f64::NEG_INFINITY, f64::max);
        let range = "positive and not too small for its place";
        require("extent of what is framed", eye - nearest, range, |d| {
            d > 1e-9 * (1.0 + centre.length())
        })?;
        // Where the picture is wider than need be, centring takes a narrower slit.
        let centred = |axis: usize| {
            let narrowed = (0..4).fold(slopes[axis], |slope, _| across(axis, slope).0 / eye);
            across(axis, narrowed).1
        };
        Ok(Self {
            orientation,
            position: centre + centred(0) * right + centred(1) * above + eye * toward,
            focal: 0.5 * shorter / tangent,
            middle: size.map(|side| 0.5 * side),
        })
    }

    /// Place in the picture, in pixels from its upper left corner, and the reciprocal of the
    /// distance along the axis of view, which is linear in the picture; zero behind the camera.
    pub fn project(&self, p: DVec3) -> [f64; 3] {
        let offset = p - self.position;
        let near = (-offset.dot(self.orientation.toward)).recip().max(0.0);
        [
            self.middle[0] + self.focal * near * offset.dot(self.orientation.right),
            self.middle[1] - self.focal * near * offset.dot(self.orientation.above),
            near,
        ]
    }
}

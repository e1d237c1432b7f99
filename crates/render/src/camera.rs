//! Where a picture is taken from, and what it shows.

use geometry::UpAxis;
use glam::DVec3;

use crate::Error;
use crate::error::require;

/// How depth is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Parallel rays: no foreshortening, sizes in several pictures can be compared.
    Orthographic,
    /// Rays from one point.
    Perspective {
        /// Angle that the shorter side of the picture subtends, in degrees: from 1 to 120.
        field_of_view: f64,
    },
}

/// An axis-parallel box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub low: [f64; 3],
    /// Largest coordinates.
    pub high: [f64; 3],
}

impl Bounds {
    /// The smallest box around points, if there are any.
    pub fn around(points: impl IntoIterator<Item = [f64; 3]>) -> Option<Self> {
        points
            .into_iter()
            .map(|p| Self { low: p, high: p })
            .reduce(|a, b| a.union(&b))
    }

    /// The smallest box around two.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            low: std::array::from_fn(|i| self.low[i].min(other.low[i])),
            high: std::array::from_fn(|i| self.high[i].max(other.high[i])),
        }
    }

    /// The middle.
    pub fn centre(&self) -> [f64; 3] {
        std::array::from_fn(|i| 0.5 * (self.low[i] + self.high[i]))
    }

    /// Half the diagonal: the radius of the ball around the box.
    pub fn radius(&self) -> f64 {
        0.5 * DVec3::from(self.high).distance(self.low.into())
    }

    fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|k| {
            let pick = |axis: usize| {
                if k >> axis & 1 == 1 {
                    self.high[axis]
                } else {
                    self.low[axis]
                }
            };
            DVec3::new(pick(0), pick(1), pick(2))
        })
    }
}

/// What fills the picture.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Framing {
    /// The surface and the tubes, as tightly as the margin allows.
    #[default]
    Surface,
    /// The box of the grid: alike for all steps of a flow.
    Domain,
    /// A given box, such as the union of the [`bounds`](crate::Scene::bounds) of several scenes.
    Within(Bounds),
    /// A given ball: alike for all directions of view.
    Ball {
        /// Its centre.
        centre: [f64; 3],
        /// Its radius.
        radius: f64,
    },
}

/// Direction, projection and framing of a view.
///
/// The camera looks at the middle of what is framed from the direction
/// `cos(el) (cos(az) a + sin(az) b) + sin(el) up`, where `az` is the azimuth, `el` the elevation
/// and `up`, `a`, `b` are consecutive axes (`z`, `x`, `y` if `z` points up).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// The axis that points up in the picture.
    pub up: UpAxis,
    /// Degrees about the upward axis.
    pub azimuth: f64,
    /// Degrees above the horizon, from -90 to 90.
    pub elevation: f64,
    /// How depth is shown.
    pub projection: Projection,
    /// What fills the picture.
    pub framing: Framing,
    /// Part of the picture left free on each side, at least 0 and below 0.45.
    pub margin: f64,
}

impl Default for Camera {
    /// From the front right and a little above, in a mild perspective, `z` pointing up.
    fn default() -> Self {
        Self {
            up: UpAxis::default(),
            azimuth: 35.0,
            elevation: 22.0,
            projection: Projection::Perspective {
                field_of_view: 22.0,
            },
            framing: Framing::Surface,
            margin: 0.07,
        }
    }
}

/// A ray of unit direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    pub origin: DVec3,
    pub direction: DVec3,
}

impl Ray {
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
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
pub(crate) struct View {
    orientation: Orientation,
    target: DVec3,
    /// Distance of the eye from the target plane.
    distance: f64,
    orthographic: bool,
    /// Size of a pixel in the target plane.
    pixel: f64,
    size: [f64; 2],
}

/// What a camera is fitted to.
pub(crate) enum Subject {
    Points(Vec<DVec3>),
    Ball(DVec3, f64),
}

impl Subject {
    pub fn bounds(bounds: &Bounds) -> Result<Self, Error> {
        for (low, high) in bounds.low.into_iter().zip(bounds.high) {
            require("lower end of the framed box", low, "finite", |_| true)?;
            require("side of the framed box", high - low, "at least 0", |v| {
                v >= 0.0
            })?;
        }
        require(
            "diagonal of the framed box",
            bounds.radius(),
            "positive",
            |v| v > 0.0,
        )?;
        Ok(Self::Points(bounds.corners().into()))
    }

    pub fn ball(centre: [f64; 3], radius: f64) -> Result<Self, Error> {
        for value in centre {
            require("centre of the framed ball", value, "finite", |_| true)?;
        }
        require("radius of the framed ball", radius, "positive", |v| v > 0.0)?;
        Ok(Self::Ball(centre.into(), radius))
    }
}

impl Camera {
    /// Checks the numbers of the camera; those of the framing are checked with the subject.
    fn check(&self) -> Result<(), Error> {
        require("azimuth", self.azimuth, "finite", |_| true)?;
        require(
            "elevation",
            self.elevation,
            "between -90 and 90 degrees",
            |v| v.abs() <= 90.0,
        )?;
        require("margin", self.margin, "at least 0 and below 0.45", |v| {
            (0.0..0.45).contains(&v)
        })?;
        if let Projection::Perspective { field_of_view } = self.projection {
            let range = "between 1 and 120 degrees";
            require("field of view", field_of_view, range, |v| {
                (1.0..=120.0).contains(&v)
            })?;
        }
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

    /// Fits the camera to its subject in a picture of `size` pixels.
    pub(crate) fn view(&self, subject: &Subject, size: [u32; 2]) -> Result<View, Error> {
        let orientation = self.orientation()?;
        let Orientation {
            right,
            above,
            toward,
            ..
        } = orientation;
        let size = size.map(f64::from);
        let shorter = size[0].min(size[1]);
        let used = size.map(|side| side / shorter * (1.0 - 2.0 * self.margin));
        let tangent = match self.projection {
            Projection::Orthographic => None,
            Projection::Perspective { field_of_view } => {
                Some((0.5 * field_of_view).to_radians().tan())
            }
        };
        // Half the shorter side of the picture in the target plane, and the distance of the eye.
        let (target, half, distance) = match subject {
            Subject::Points(points) => {
                let placed = || {
                    points
                        .iter()
                        .map(|p| DVec3::new(p.dot(right), p.dot(above), p.dot(toward)))
                };
                // Over all points, the largest value of a function.
                let most =
                    |f: &dyn Fn(DVec3) -> f64| placed().map(f).fold(f64::NEG_INFINITY, f64::max);
                let nearest = most(&|p| p.z);
                let depth = nearest + most(&|p| -p.z);
                // Half the extent and the middle along one direction of the picture, seen through
                // a slit that opens towards the back with the given slope.
                let across = |axis: usize, slope: f64| {
                    let after = most(&|p| p[axis] + slope * p.z);
                    let before = most(&|p| -p[axis] + slope * p.z);
                    (0.5 * (after + before), 0.5 * (after - before))
                };
                let middle = nearest - 0.5 * depth;
                let (x, y, half, distance) = match tangent {
                    None => {
                        let ((a, x), (b, y)) = (across(0, 0.0), across(1, 0.0));
                        let half = (a / used[0]).max(b / used[1]);
                        (x, y, half, DVec3::new(a, b, depth).length())
                    }
                    Some(tangent) => {
                        // The eye is where the slits of both directions are wide enough.
                        let slopes = used.map(|side| side * tangent);
                        let wide = |axis: usize| across(axis, slopes[axis]).0 / slopes[axis];
                        let eye = wide(0).max(wide(1));
                        // Where the picture is wider than need be, centring takes a narrower slit.
                        let centred = |axis: usize| {
                            let narrowed =
                                (0..4).fold(slopes[axis], |slope, _| across(axis, slope).0 / eye);
                            across(axis, narrowed).1
                        };
                        let distance = eye - middle;
                        let (x, y) = (centred(0), centred(1));
                        (x, y, distance * tangent, distance)
                    }
                };
                (x * right + y * above + middle * toward, half, distance)
            }
            &Subject::Ball(centre, radius) => {
                let narrow = used[0].min(used[1]);
                match tangent {
                    None => (centre, radius / narrow, 2.0 * radius),
                    Some(tangent) => {
                        let distance = radius * (1.0 + (narrow * tangent).powi(-2)).sqrt();
                        (centre, distance * tangent, distance)
                    }
                }
            }
        };
        // A subject seen edge-on may have no extent in the picture.
        let half = require("extent of what is framed", half, "positive", |v| v > 0.0)?;
        Ok(View {
            orientation,
            target,
            distance,
            orthographic: tangent.is_none(),
            pixel: 2.0 * half / shorter,
            size,
        })
    }
}

impl View {
    /// The ray through the point `(x, y)` of the picture, in pixels from its upper left corner.
    pub fn ray(&self, x: f64, y: f64) -> Ray {
        let Orientation {
            right,
            above,
            toward,
            ..
        } = self.orientation;
        let sideways = self.pixel * (x - 0.5 * self.size[0]) * right
            + self.pixel * (0.5 * self.size[1] - y) * above;
        if self.orthographic {
            Ray {
                origin: self.target + sideways + self.distance * toward,
                direction: -toward,
            }
        } else {
            Ray {
                origin: self.target + self.distance * toward,
                direction: (sideways - self.distance * toward).normalize(),
            }
        }
    }

    /// Size of a pixel at the distance `t` along a ray.
    pub fn footprint(&self, t: f64) -> f64 {
        if self.orthographic {
            self.pixel
        } else {
            self.pixel * t / self.distance
        }
    }
}

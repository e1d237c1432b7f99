//! Tubes along polylines.

use glam::DVec3;
use srgb::Rgb;

use crate::Error;
use crate::camera::Ray;
use crate::error::require;
use crate::volume::Lattice;

/// A round tube along a polyline, with round ends and joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Tube {
    /// The points of the polyline. Repeated ones are passed over.
    pub points: Vec<[f64; 3]>,
    /// Whether the last point is joined to the first.
    pub closed: bool,
    /// Radius, in the units of the grid. Tubes much thinner than a pixel have gaps.
    pub radius: f64,
    /// Colour.
    pub colour: Rgb,
}

impl Tube {
    /// An open tube, near-black.
    pub fn new(points: impl Into<Vec<[f64; 3]>>, radius: f64) -> Self {
        Self {
            points: points.into(),
            closed: false,
            radius,
            colour: Rgb::INK,
        }
    }

    /// Joins the last point to the first.
    #[must_use]
    pub fn closed(mut self) -> Self {
        self.closed = true;
        self
    }

    /// Sets the colour.
    #[must_use]
    pub fn with_colour(mut self, colour: Rgb) -> Self {
        self.colour = colour;
        self
    }

    /// The twelve edges of a box.
    pub fn edges_of_box(low: [f64; 3], high: [f64; 3], radius: f64) -> Vec<Self> {
        let corner = |k: usize| -> [f64; 3] {
            std::array::from_fn(|axis| {
                if k >> axis & 1 == 1 {
                    high[axis]
                } else {
                    low[axis]
                }
            })
        };
        let ends = (0..8_usize).flat_map(|k| (0..3).map(move |axis| (k, k | 1 << axis)));
        ends.filter(|(a, b)| a != b)
            .map(|(a, b)| Self::new([corner(a), corner(b)], radius))
            .collect()
    }

    /// Segments in lattice coordinates.
    fn segments(&self, index: usize, lattice: &Lattice) -> Result<Vec<Segment>, Error> {
        require("radius of a tube", self.radius, "positive", |v| v > 0.0)?;
        for value in self.points.iter().flatten() {
            require("coordinate of a tube", *value, "finite", |_| true)?;
        }
        let mut points: Vec<DVec3> = self.points.iter().map(|&p| lattice.place(p)).collect();
        points.dedup();
        if self.closed && points.len() > 2 && points.first() != points.last() {
            points.push(points[0]);
        }
        if points.len() < 2 {
            return Err(Error::TubePoints {
                index,
                points: points.len(),
            });
        }
        let direction = |k: usize| (points[k + 1] - points[k]).normalize();
        let last = points.len() - 2;
        // Mean direction at a point, so that shading does not show the facets of a fine polyline.
        let tangent = |k: usize| {
            let ring = self.closed && last > 0;
            let before = match k {
                0 if ring => direction(last),
                0 => direction(0),
                _ => direction(k - 1),
            };
            let after = match k {
                _ if k <= last => direction(k),
                _ if ring => direction(0),
                _ => direction(last),
            };
            // Sharp bends keep their two directions.
            if before.dot(after) > 0.8 {
                Some((before + after).normalize())
            } else {
                None
            }
        };
        let segments = (0..=last).map(|k| Segment {
            ends: [points[k], points[k + 1]],
            tangents: [
                tangent(k).unwrap_or_else(|| direction(k)),
                tangent(k + 1).unwrap_or_else(|| direction(k)),
            ],
            radius: lattice.length(self.radius),
            tube: index,
        });
        Ok(segments.collect())
    }
}

/// A capsule.
#[derive(Clone, Copy, Debug)]
struct Segment {
    ends: [DVec3; 2],
    tangents: [DVec3; 2],
    radius: f64,
    tube: usize,
}

impl Segment {
    fn bounds(&self) -> (DVec3, DVec3) {
        let [a, b] = self.ends;
        (a.min(b) - self.radius, a.max(b) + self.radius)
    }

    /// Distance along the ray to the first point of the capsule's boundary, if it is positive.
    fn intersect(&self, ray: &Ray) -> Option<f64> {
        let [a, b] = self.ends;
        let axis = b - a;
        let from = ray.origin - a;
        let (along_ray, along_from) = (axis.dot(ray.direction), axis.dot(from));
        let length2 = axis.length_squared();
        // The infinite cylinder, by a quadratic equation.
        let qa = length2 - along_ray * along_ray;
        let qb = length2 * from.dot(ray.direction) - along_from * along_ray;
        let qc =
            length2 * (from.length_squared() - self.radius * self.radius) - along_from * along_from;
        let discriminant = qb * qb - qa * qc;
        if discriminant < 0.0 {
            return None;
        }
        let mut nearest = f64::INFINITY;
        if qa > 1e-12 * length2 {
            let t = (-qb - discriminant.sqrt()) / qa;
            let along = along_from + t * along_ray;
            if t > 0.0 && (0.0..=length2).contains(&along) {
                nearest = t;
            }
        }
        for end in self.ends {
            let from = ray.origin - end;
            let half = from.dot(ray.direction);
            let inside = half * half - from.length_squared() + self.radius * self.radius;
            if inside >= 0.0 {
                let t = -half - inside.sqrt();
                if t > 0.0 {
                    nearest = nearest.min(t);
                }
            }
        }
        (nearest < f64::INFINITY).then_some(nearest)
    }

    fn normal(&self, p: DVec3) -> DVec3 {
        let [a, b] = self.ends;
        let axis = b - a;
        let fraction = ((p - a).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
        let normal = (p - a - fraction * axis) / self.radius;
        if fraction > 0.0 && fraction < 1.0 {
            let tangent = self.tangents[0]
                .lerp(self.tangents[1], fraction)
                .normalize();
            (normal - normal.dot(tangent) * tangent).normalize()
        } else {
            normal.normalize()
        }
    }
}

/// Leaves hold at most this many segments.
const LEAF: usize = 4;

/// All tubes of a scene, in a tree of bounding boxes.
#[derive(Default)]
pub(crate) struct Tubes {
    segments: Vec<Segment>,
    nodes: Vec<Node>,
}

struct Node {
    low: DVec3,
    high: DVec3,
    content: Content,
}

enum Content {
    /// Range of segments.
    Leaf(usize, usize),
    /// The second child; the first follows its parent.
    Inner(usize),
}

impl Tubes {
    pub fn new(tubes: &[Tube], lattice: &Lattice) -> Result<Self, Error> {
        let mut segments = Vec::new();
        for (index, tube) in tubes.iter().enumerate() {
            segments.extend(tube.segments(index, lattice)?);
        }
        let mut tree = Self {
            nodes: Vec::new(),
            segments,
        };
        if !tree.segments.is_empty() {
            tree.build(0, tree.segments.len());
        }
        Ok(tree)
    }

    /// Corners of the boxes around the segments.
    pub fn extent(&self) -> impl Iterator<Item = DVec3> {
        self.segments.iter().flat_map(|s| {
            s.ends.into_iter().flat_map(move |end| {
                DVec3::AXES
                    .into_iter()
                    .flat_map(move |axis| [end - s.radius * axis, end + s.radius * axis])
            })
        })
    }

    fn build(&mut self, from: usize, to: usize) {
        let members = &mut self.segments[from..to];
        let (low, high) = members
            .iter()
            .map(Segment::bounds)
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
            .expect("nodes are not empty");
        let index = self.nodes.len();
        self.nodes.push(Node {
            low,
            high,
            content: Content::Leaf(from, to),
        });
        if to - from <= LEAF {
            return;
        }
        let axis = (high - low).max_position();
        let middle = |s: &Segment| s.ends[0][axis] + s.ends[1][axis];
        members.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
        let half = usize::midpoint(from, to);
        self.build(from, half);
        let second = self.nodes.len();
        self.build(half, to);
        self.nodes[index].content = Content::Inner(second);
    }

    /// Calls `visit` for the segments whose boxes the ray meets before the limit that it returns.
    fn walk(&self, ray: &Ray, mut limit: f64, mut visit: impl FnMut(&Segment) -> f64) {
        if self.nodes.is_empty() {
            return;
        }
        let inverse = ray.direction.recip();
        // A balanced tree over any number of segments in memory is less deep.
        let mut stack = [0; 64];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let index = stack[height];
            let node = &self.nodes[index];
            let (a, b) = (
                (node.low - ray.origin) * inverse,
                (node.high - ray.origin) * inverse,
            );
            let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
            if !(near <= far && far >= 0.0 && near < limit) {
                continue;
            }
            match node.content {
                Content::Leaf(from, to) => {
                    for segment in &self.segments[from..to] {
                        limit = limit.min(visit(segment));
                    }
                }
                Content::Inner(second) => {
                    (stack[height], stack[height + 1]) = (second, index + 1);
                    height += 2;
                }
            }
        }
    }

    /// Distance, normal and tube of the first hit before `limit`.
    pub fn intersect(&self, ray: &Ray, limit: f64) -> Option<(f64, DVec3, usize)> {
        let mut best: Option<(f64, Segment)> = None;
        self.walk(ray, limit, |segment| {
            let nearest = best.map_or(limit, |(t, _)| t);
            if let Some(t) = segment.intersect(ray).filter(|&t| t < nearest) {
                best = Some((t, *segment));
            }
            best.map_or(limit, |(t, _)| t)
        });
        best.map(|(t, segment)| (t, segment.normal(ray.at(t)), segment.tube))
    }

    /// Whether a ray of light meets a tube.
    pub fn blocks(&self, ray: &Ray) -> bool {
        let mut hit = false;
        self.walk(ray, f64::INFINITY, |segment| {
            hit = hit || segment.intersect(ray).is_some();
            if hit {
                f64::NEG_INFINITY
            } else {
                f64::INFINITY
            }
        });
        hit
    }
}

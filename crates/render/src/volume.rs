//! The surface: a smooth approximation of the clamped distance, and rays against it.
//!
//! Positions are in cells of a padded lattice: node `i` of the grid is at `i + PAD`, and the
//! periodic image of its first layer closes the box.

use geometry::{Field, Grid};
use glam::DVec3;
use rayon::prelude::*;

use crate::camera::Ray;
use crate::emptiness::Emptiness;
use crate::spline;

/// Layers of nodes added on each side: support for the cubic spline in the space around the box.
const PAD: usize = 4;
/// Steps in cells that may hold the surface: for rays from the camera, and for rays of light.
const FINE_STEP: f64 = 0.35;
const COARSE_STEP: f64 = 0.5;
/// Rays of light leave the surface they start from before they are looked at.
const HEAD_START: f64 = 0.5;
/// Width of the space left around the surface, which holds the crossings on lattice edges, in
/// cells: it cannot bulge further between them.
const MARGIN: f64 = 1.5;
/// Added after leaving an empty cube, so that the next cell is another one.
const NUDGE: f64 = 1e-5;

/// From positions in space to cells of the lattice and back.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lattice {
    origin: DVec3,
    spacing: f64,
}

impl Lattice {
    pub fn new(grid: &Grid<3>) -> Self {
        Self {
            origin: grid.origin().into(),
            spacing: grid.spacing(),
        }
    }

    pub fn place(&self, x: [f64; 3]) -> DVec3 {
        (DVec3::from(x) - self.origin) / self.spacing + PAD as f64
    }

    pub fn position(&self, p: DVec3) -> [f64; 3] {
        (self.origin + self.spacing * (p - PAD as f64)).to_array()
    }

    pub fn length(&self, length: f64) -> f64 {
        length / self.spacing
    }
}

/// A cubic B-spline on the padded lattice with the nodal values as coefficients.
///
/// It smooths them a little: a surface moves by `h^2 / 6` times its mean curvature, which no
/// picture shows. In return it neither rings nor overshoots at creases and clamps, as a spline
/// through the values does.
pub(crate) struct Spline {
    size: usize,
    coefficients: Vec<f32>,
}

impl Spline {
    /// The spline that has the samples as coefficients.
    pub fn new(size: usize, samples: Vec<f32>) -> Self {
        Self {
            size,
            coefficients: samples,
        }
    }

    /// The cell, kept where its support is inside the lattice, and the place in it.
    fn locate(&self, p: DVec3) -> ([usize; 3], [f32; 3]) {
        locate(p, 1, self.size - 3)
    }

    pub fn value(&self, p: DVec3) -> f64 {
        let (cell, local) = self.locate(p);
        f64::from(spline::value(&self.coefficients, self.size, cell, local))
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        let (cell, local) = self.locate(p);
        let [x, y, z] = spline::gradient(&self.coefficients, self.size, cell, local);
        DVec3::new(x.into(), y.into(), z.into())
    }
}

fn locate(p: DVec3, low: usize, high: usize) -> ([usize; 3], [f32; 3]) {
    let p = p.to_array();
    // Half as many instructions as a cast to `usize` takes.
    let cell = p.map(|c| (c as i32 as usize).clamp(low, high));
    let local = std::array::from_fn(|k| (p[k] - cell[k] as f64).clamp(0.0, 1.0) as f32);
    (cell, local)
}

/// Nodal values in the lattice: those of the grid in its box, periodic images around it.
pub(crate) fn padded(field: &Field<3>, value: impl Fn(f64) -> f64 + Sync) -> (usize, Vec<f32>) {
    let cells = field.grid().cells();
    let size = cells + 1 + 2 * PAD;
    let source = |k: usize| (k + 2 * cells - PAD) % cells;
    let values = (0..size * size)
        .into_par_iter()
        .flat_map_iter(|row| {
            let start = field
                .grid()
                .index([source(row / size), source(row % size), 0]);
            let value = &value;
            (0..size).map(move |k| value(field.values()[start + source(k)]) as f32)
        })
        .collect();
    (size, values)
}

/// The surface `f = 0`; `f < 0` inside, in cells.
pub(crate) struct Volume {
    /// Rays are followed in here alone.
    box_around: [DVec3; 2],
    spline: Spline,
    /// The values at the nodes, for rays of light.
    samples: Vec<f32>,
    /// Empty space for the spline, and for the trilinear interpolant of the samples.
    around_spline: Emptiness,
    around_samples: Emptiness,
    /// Where lattice edges cross the surface.
    pub crossings: Vec<DVec3>,
}

impl Volume {
    /// From signed distances, in cells. They are clamped softly at `limit` and intersected with
    /// the box of the grid.
    ///
    /// `limit tanh(s / limit)` has the zeros and the slope of `s` there, and no kink.
    pub fn new(field: &Field<3>, limit: f64, distance: impl Fn(f64) -> f64 + Sync) -> Self {
        let (size, mut samples) = padded(field, |v| limit * (distance(v) / limit).tanh());
        let last = (size - 1 - PAD) as f64;
        samples.par_iter_mut().enumerate().for_each(|(at, value)| {
            let place = [at / size / size, at / size % size, at % size];
            let outside = place
                .iter()
                .map(|&k| (PAD as f64 - k as f64).max(k as f64 - last))
                .fold(f64::NEG_INFINITY, f64::max);
            *value = value.max((limit * (outside / limit).tanh()) as f32);
        });
        let spline = Spline::new(size, samples);
        let samples = spline::nodal(&spline.coefficients, size);
        // The values of a spline lie between its coefficients, those of the other between samples.
        let (around_spline, around_samples) = rayon::join(
            || Emptiness::new(&spline.coefficients, size, 1, 2),
            || Emptiness::new(&samples, size, 0, 1),
        );
        let crossings = crossings(&samples, size);
        let box_around = crossings
            .iter()
            .map(|&p| [p - MARGIN, p + MARGIN])
            .reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])
            // No ray spends time in an empty box.
            .unwrap_or_default();
        Self {
            box_around,
            spline,
            samples,
            around_spline,
            around_samples,
            crossings,
        }
    }

    /// The part of a ray inside the box around the surface.
    fn clip(&self, ray: &Ray, inverse: DVec3) -> (f64, f64) {
        let [low, high] = self
            .box_around
            .map(|corner| (corner - ray.origin) * inverse);
        (
            low.min(high).max_element().max(0.0),
            low.max(high).min_element(),
        )
    }

    /// Where a ray from outside first meets the surface.
    pub fn intersect(&self, ray: &Ray) -> Option<f64> {
        let inverse = inverse(ray.direction);
        let (mut t, end) = self.clip(ray, inverse);
        let (origin, direction) = (ray.origin.to_array(), ray.direction.to_array());
        let inverse = inverse.to_array();
        // The last place known to be outside.
        let mut outside = t;
        while t < end {
            let p = ray.at(t);
            let (cell, _) = self.spline.locate(p);
            let k = self.around_spline.at(cell);
            if k > 0 {
                outside = t;
                t = Emptiness::exit(cell, k, origin, direction, inverse).max(t) + NUDGE;
                continue;
            }
            let value = self.spline.value(p);
            if value <= 0.0 {
                return Some(self.root(ray, outside, t, value));
            }
            outside = t;
            t += FINE_STEP;
        }
        None
    }

    /// Narrows down a sign change by the Illinois variant of regula falsi.
    fn root(&self, ray: &Ray, outside: f64, inside: f64, value: f64) -> f64 {
        const ITERATIONS: usize = 12;
        const TOLERANCE: f64 = 1e-5;
        let f = |t: f64| self.spline.value(ray.at(t));
        let (mut a, mut fa, mut b, mut fb) = (outside, f(outside), inside, value);
        if fa <= 0.0 {
            return outside;
        }
        let mut last = 0_i8;
        for _ in 0..ITERATIONS {
            let t = (a * fb - b * fa) / (fb - fa);
            let value = f(t);
            if value.abs() < TOLERANCE {
                return t;
            }
            if value > 0.0 {
                (a, fa) = (t, value);
                if last == 1 {
                    fb *= 0.5;
                }
                last = 1;
            } else {
                (b, fb) = (t, value);
                if last == -1 {
                    fa *= 0.5;
                }
                last = -1;
            }
        }
        0.5 * (a + b)
    }

    /// The outer unit normal.
    pub fn normal(&self, p: DVec3) -> Option<DVec3> {
        self.spline.gradient(p).try_normalize()
    }

    /// Whether a ray of light that starts outside meets the surface.
    ///
    /// Here the trilinear interpolant of the samples will do: its distance from the spline is a
    /// small part of a cell, and it costs an eighth.
    pub fn blocks(&self, ray: &Ray) -> bool {
        let inverse = inverse(ray.direction);
        let (start, end) = self.clip(ray, inverse);
        let mut t = start.max(HEAD_START);
        let (origin, direction) = (ray.origin.to_array(), ray.direction.to_array());
        let inverse = inverse.to_array();
        while t < end {
            let (cell, local) = locate(ray.at(t), 1, self.spline.size - 3);
            let k = self.around_samples.at(cell);
            if k > 0 {
                t = Emptiness::exit(cell, k, origin, direction, inverse).max(t) + NUDGE;
                continue;
            }
            let value = f64::from(self.trilinear(cell, local));
            if value <= 0.0 {
                return true;
            }
            // About the distance, which lets rays skim along the surface quickly.
            t += value.max(COARSE_STEP);
        }
        false
    }

    fn trilinear(&self, [i, j, k]: [usize; 3], [x, y, z]: [f32; 3]) -> f32 {
        let along = |i: usize, j: usize| {
            let at = (i * self.spline.size + j) * self.spline.size + k;
            let pair: &[f32; 2] = self.samples[at..]
                .first_chunk()
                .expect("inside the lattice");
            pair[0] + z * (pair[1] - pair[0])
        };
        let across = |i: usize| {
            let (a, b) = (along(i, j), along(i, j + 1));
            a + y * (b - a)
        };
        let (a, b) = (across(i), across(i + 1));
        a + x * (b - a)
    }
}

/// Reciprocals of the components, finite where they vanish.
fn inverse(direction: DVec3) -> DVec3 {
    direction.map(|c| if c.abs() < 1e-30 { 1e30 } else { 1.0 / c })
}

/// Where the linear interpolant vanishes on the edges of the lattice.
fn crossings(samples: &[f32], size: usize) -> Vec<DVec3> {
    let strides = [size * size, size, 1];
    (0..size)
        .into_par_iter()
        .flat_map_iter(|i| {
            (0..size * size).flat_map(move |rest| {
                let place = [i, rest / size, rest % size];
                let at = i * size * size + rest;
                let a = samples[at];
                (0..3).filter_map(move |axis| {
                    if place[axis] + 1 == size {
                        return None;
                    }
                    let b = samples[at + strides[axis]];
                    ((a <= 0.0) != (b <= 0.0)).then(|| {
                        let mut p = DVec3::from(place.map(|k| k as f64));
                        p[axis] += f64::from(a / (a - b));
                        p
                    })
                })
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::shapes::Ball;
    use geometry::{distance_from_phase_field, phase_field};

    const CENTRE: [f64; 3] = [0.52, 0.47, 0.5];
    const RADIUS: f64 = 0.3;

    /// The ball at n = 64 with `u` spoilt where it is nearly saturated, as a flow leaves it.
    fn ball() -> (Lattice, Volume) {
        let grid = Grid::new(64, 1.0).unwrap();
        let (h, eps) = (grid.spacing(), 2.0 * grid.spacing());
        let ball = Ball::new(CENTRE, RADIUS).unwrap();
        let u = phase_field(grid, &ball, eps).unwrap();
        let u = u.map(|v| {
            if v.abs() > 0.97 {
                v.signum() * (0.985 + 0.02 * v.sin())
            } else {
                v
            }
        });
        let volume = Volume::new(&u, 3.0 * eps / h, |v| distance_from_phase_field(v, eps) / h);
        (Lattice::new(&grid), volume)
    }

    /// Directions all over the sphere.
    fn directions() -> impl Iterator<Item = DVec3> {
        (0..500).map(|k| {
            let z = 1.0 - (f64::from(k) + 0.5) / 250.0;
            let (sin, cos) = (2.4 * f64::from(k)).sin_cos();
            let ring = (1.0 - z * z).sqrt();
            DVec3::new(ring * cos, ring * sin, z)
        })
    }

    #[test]
    fn a_sphere_is_hit_where_it_is_and_has_its_normals() {
        let (lattice, volume) = ball();
        for outward in directions() {
            let ray = Ray {
                origin: lattice.place(CENTRE) + 100.0 * outward,
                direction: -outward,
            };
            let p = ray.at(volume.intersect(&ray).expect("the ball is in the way"));
            let radius = lattice.place(CENTRE).distance(p) / lattice.length(1.0);
            // h^2 / 6 times the mean curvature 2 / R is 2.7e-4.
            assert!((radius - RADIUS).abs() < 6e-4, "{outward}: {radius}");
            let angle = volume
                .normal(p)
                .unwrap()
                .angle_between(outward)
                .to_degrees();
            assert!(angle < 0.25, "{outward}: {angle} degrees");
        }
    }

    #[test]
    fn light_is_blocked_by_what_is_in_the_way_alone() {
        let (lattice, volume) = ball();
        let centre = lattice.place(CENTRE);
        for outward in directions() {
            let start = centre + (lattice.length(RADIUS) + 0.2) * outward;
            let blocks = |direction: DVec3| {
                volume.blocks(&Ray {
                    origin: start,
                    direction,
                })
            };
            let sideways = outward.any_orthonormal_vector();
            assert!(!blocks(outward) && blocks(-outward), "{outward}");
            assert!(
                !blocks((sideways + 0.15 * outward).normalize()),
                "{outward}"
            );
            assert!(blocks((sideways - 0.3 * outward).normalize()), "{outward}");
        }
    }

    #[test]
    fn a_solid_ends_at_the_box() {
        let grid = Grid::new(16, 1.0).unwrap();
        let full = Field::constant(grid, -1.0);
        let volume = Volume::new(&full, 6.0, |v| v * 16.0);
        let lattice = Lattice::new(&grid);
        for (axis, sign) in [
            (0, 1.0),
            (1, 1.0),
            (2, 1.0),
            (0, -1.0),
            (1, -1.0),
            (2, -1.0),
        ] {
            let outward = sign * DVec3::AXES[axis];
            let middle = lattice.place([0.5; 3]);
            let ray = Ray {
                origin: middle + 40.0 * outward,
                direction: -outward,
            };
            let t = volume.intersect(&ray).expect("the box is solid");
            assert!((40.0 - t - 8.0).abs() < 0.05, "{outward}: {t}");
        }
    }
}

//! From rays to pixels.
//!
//! One ray through the centre of every pixel finds what is seen. The light that reaches it is
//! sampled by rays in patterns that repeat every four pixels and is then averaged over as many
//! neighbours of like place and normal (A. Keller, W. Heidrich: Interleaved sampling, 2001). The
//! pixels on outlines, creases and edges of colour are drawn again with sixteen rays each, so
//! that they are smooth too.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::camera::{Ray, View};
use crate::light::{Lights, Material};
use crate::picture::{Light, Picture};
use crate::sampling::{disc, frame, r2};
use crate::tube::Tubes;
use crate::volume::Volume;

/// Side of the tile of patterns, in pixels.
const TILE: usize = 4;
/// Patterns, and rays through a pixel on an edge.
const PATTERNS: usize = TILE * TILE;
/// Rays of light start this far from the surface, in cells: further than the two interpolants of
/// the distance differ.
const OFFSET: f64 = 0.2;

/// How many rays are spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Quality {
    /// For tests and previews.
    Draft,
    /// For figures.
    #[default]
    Standard,
    /// For large prints: several times slower.
    Fine,
}

impl Quality {
    /// Rays to the surroundings and to the key light, for each pixel.
    fn rays(self) -> (usize, usize) {
        match self {
            Self::Draft => (8, 4),
            Self::Standard => (24, 12),
            Self::Fine => (96, 48),
        }
    }
}

/// What a ray meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Seen {
    Nothing,
    Ground,
    /// The surface, with the index of its colour.
    Surface(u16),
    Tube(u32),
}

impl Seen {
    /// Whether both lie on one piece of geometry, whatever its colours.
    fn same_piece(self, other: Self) -> bool {
        self == other || matches!((self, other), (Self::Surface(_), Self::Surface(_)))
    }
}

/// What a ray from the camera meets, and where.
#[derive(Clone, Copy, Debug)]
struct Hit {
    seen: Seen,
    /// Distance along the ray.
    t: f32,
    place: Vec3,
    normal: Vec3,
}

impl Hit {
    const NONE: Self = Self {
        seen: Seen::Nothing,
        t: f32::INFINITY,
        place: Vec3::INFINITY,
        normal: Vec3::ZERO,
    };

    fn new(seen: Seen, ray: &Ray, t: f64, normal: DVec3) -> Self {
        Self {
            seen,
            t: t as f32,
            place: ray.at(t).as_vec3(),
            normal: normal.as_vec3(),
        }
    }
}

/// Visible part of the key light and arriving part of the surroundings' light, from 0 to 1.
#[derive(Clone, Copy, Debug, Default)]
struct Arriving {
    key: f32,
    open: f32,
}

/// The plane that receives a shadow.
pub(crate) struct GroundPlane {
    pub up: DVec3,
    pub height: f64,
    /// How dark the shadow is, from 0 to 1.
    pub strength: f64,
}

impl GroundPlane {
    /// Where the shadow of a point falls, unless the light is low.
    pub fn shadow_of(&self, p: DVec3, light: DVec3) -> Option<DVec3> {
        /// Sine of the lowest elevation of a light that is followed.
        const LOWEST: f64 = 0.3;
        let rise = light.dot(self.up);
        (rise > LOWEST).then(|| p - (p.dot(self.up) - self.height) / rise * light)
    }
}

/// Everything needed to draw, in lattice coordinates.
pub(crate) struct Film<'a> {
    pub volume: &'a Volume,
    pub tubes: Tubes,
    pub ground: Option<GroundPlane>,
    pub view: View,
    pub lights: Lights,
    pub material: Material,
    /// Index of the colour of a point on the surface.
    pub region: &'a (dyn Fn(DVec3) -> usize + Sync),
    pub surface_colours: Vec<[f32; 3]>,
    pub tube_colours: Vec<[f32; 3]>,
    pub background: Light,
    pub quality: Quality,
    pub size: [u32; 2],
}

/// Directions for rays of light, shared by all points.
struct Patterns {
    /// Cosine-weighted directions about the third axis.
    sky: Vec<[f64; 3]>,
    /// Directions into the key light.
    key: Vec<DVec3>,
}

impl Patterns {
    fn new(lights: &Lights, quality: Quality, share: usize) -> (Self, [usize; 2]) {
        let (sky, key) = quality.rays();
        let counts = [sky, key].map(|count| count.div_ceil(share));
        let [a, b] = frame(lights.key);
        let patterns = Self {
            sky: (0..PATTERNS * counts[0])
                .map(|k| {
                    let [x, y] = disc(r2(k));
                    [x, y, (1.0 - x * x - y * y).max(0.0).sqrt()]
                })
                .collect(),
            key: (0..PATTERNS * counts[1])
                .map(|k| {
                    let [x, y] = disc(r2(k)).map(|c| lights.spread * c);
                    (lights.key + x * a + y * b).normalize()
                })
                .collect(),
        };
        (patterns, counts)
    }

    fn slices(&self, counts: [usize; 2], pattern: usize) -> (&[[f64; 3]], &[DVec3]) {
        (
            &self.sky[pattern * counts[0]..][..counts[0]],
            &self.key[pattern * counts[1]..][..counts[1]],
        )
    }
}

impl Film<'_> {
    pub fn draw(&self) -> Picture {
        let [width, height] = self.size.map(|side| side as usize);
        let hits: Vec<Hit> = (0..width * height)
            .into_par_iter()
            .map(|at| self.hit(&self.ray(at % width, at / width, [0.5; 2])))
            .collect();
        let (patterns, counts) = Patterns::new(&self.lights, self.quality, 1);
        let arriving: Vec<Arriving> = hits
            .par_iter()
            .enumerate()
            .map(|(at, hit)| {
                let (x, y) = (at % width, at / width);
                let pattern = y % TILE * TILE + x % TILE;
                self.arriving(hit, patterns.slices(counts, pattern))
            })
            .collect();
        let (patterns, counts) = Patterns::new(&self.lights, self.quality, 4);
        let pixels = (0..width * height)
            .into_par_iter()
            .map(|at| {
                let (x, y) = (at % width, at / width);
                let neighbourhood = Neighbourhood {
                    film: self,
                    hits: &hits,
                    x,
                    y,
                };
                let light = if neighbourhood.is_edge() {
                    let mut sum = Light::default();
                    for pattern in 0..PATTERNS {
                        let ray = self.ray(x, y, subpixel(pattern));
                        let hit = self.hit(&ray);
                        let slices = patterns.slices(counts, pattern);
                        let arriving = self.arriving(&hit, slices);
                        sum = sum + self.shade(&ray, &hit, arriving);
                    }
                    sum * (1.0 / PATTERNS as f32)
                } else {
                    let ray = self.ray(x, y, [0.5; 2]);
                    self.shade(&ray, &hits[at], neighbourhood.smoothed(&arriving))
                };
                light.over(self.background).encode()
            })
            .collect();
        Picture::from_parts(self.size, pixels)
    }

    fn ray(&self, x: usize, y: usize, [dx, dy]: [f64; 2]) -> Ray {
        self.view.ray(x as f64 + dx, y as f64 + dy)
    }

    fn hit(&self, ray: &Ray) -> Hit {
        let surface = self.volume.intersect(ray);
        let limit = surface.unwrap_or(f64::INFINITY);
        if let Some((t, normal, tube)) = self.tubes.intersect(ray, limit) {
            return Hit::new(Seen::Tube(tube as u32), ray, t, normal);
        }
        if let Some(t) = surface {
            let p = ray.at(t);
            // A vanishing gradient has no direction; what faces the camera will do.
            let normal = self.volume.normal(p).unwrap_or(-ray.direction);
            return Hit::new(Seen::Surface((self.region)(p) as u16), ray, t, normal);
        }
        if let Some(ground) = &self.ground {
            let falling = -ray.direction.dot(ground.up);
            let t = (ray.origin.dot(ground.up) - ground.height) / falling;
            if falling > 0.0 && t > 0.0 && t.is_finite() {
                return Hit::new(Seen::Ground, ray, t, ground.up);
            }
        }
        Hit::NONE
    }

    fn blocked(&self, origin: DVec3, direction: DVec3) -> bool {
        let ray = Ray { origin, direction };
        self.volume.blocks(&ray) || self.tubes.blocks(&ray)
    }

    fn arriving(&self, hit: &Hit, (sky, key): (&[[f64; 3]], &[DVec3])) -> Arriving {
        if hit.seen == Seen::Nothing {
            return Arriving::default();
        }
        let normal = hit.normal.as_dvec3();
        let origin = hit.place.as_dvec3() + OFFSET * normal;
        let [a, b] = frame(normal);
        let (mut all, mut open) = (0.0, 0.0);
        for &[x, y, z] in sky {
            let direction = x * a + y * b + z * normal;
            let radiance = self.lights.radiance(direction);
            all += radiance;
            if !self.blocked(origin, direction) {
                open += radiance;
            }
        }
        let open = if all > 0.0 { open / all } else { 1.0 };
        let lit = key
            .iter()
            .filter(|&&direction| normal.dot(direction) > 0.0 && !self.blocked(origin, direction))
            .count();
        Arriving {
            key: lit as f32 / key.len() as f32,
            open: open as f32,
        }
    }

    fn shade(&self, ray: &Ray, hit: &Hit, arriving: Arriving) -> Light {
        let normal = hit.normal.as_dvec3();
        let parts = [arriving.key, arriving.open].map(f64::from);
        let body = match hit.seen {
            Seen::Nothing => return Light::default(),
            Seen::Ground => return Light::black(self.shadow(normal, parts)),
            Seen::Surface(region) => self.surface_colours[usize::from(region)],
            Seen::Tube(tube) => self.tube_colours[tube as usize],
        };
        Light::opaque(
            self.lights
                .shade(body, &self.material, normal, -ray.direction, parts),
        )
    }

    /// Opacity of the shadow on the ground: the part of its light that is missing, less a little,
    /// so that the shadow ends.
    fn shadow(&self, up: DVec3, [key, open]: [f64; 2]) -> f32 {
        const UNNOTICED: f64 = 0.02;
        let direct = self.lights.key_strength * up.dot(self.lights.key).max(0.0);
        let ambient = self.lights.irradiance(up);
        let missing = if direct + ambient > 0.0 {
            1.0 - (direct * key + ambient * open) / (direct + ambient)
        } else {
            0.0
        };
        let strength = self.ground.as_ref().map_or(0.0, |ground| ground.strength);
        (strength * (missing - UNNOTICED).max(0.0) / (1.0 - UNNOTICED)) as f32
    }
}

/// Place of the ray with the given pattern in its pixel: one in each of 4 x 4 squares, and one in
/// each of sixteen columns and rows.
fn subpixel(pattern: usize) -> [f64; 2] {
    let (i, j) = (pattern % TILE, pattern / TILE);
    let side = PATTERNS as f64;
    [
        ((i * TILE + j) as f64 + 0.5) / side,
        ((j * TILE + i) as f64 + 0.5) / side,
    ]
}

/// A pixel among others.
struct Neighbourhood<'a> {
    film: &'a Film<'a>,
    hits: &'a [Hit],
    x: usize,
    y: usize,
}

impl Neighbourhood<'_> {
    fn hit(&self, x: usize, y: usize) -> &Hit {
        &self.hits[y * self.film.size[0] as usize + x]
    }

    /// The pixels at most `reach` away along each axis.
    fn within(&self, reach: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let [width, height] = self.film.size.map(|side| side as usize);
        let range = |at: usize, side: usize| at.saturating_sub(reach)..=(at + reach).min(side - 1);
        let columns = range(self.x, width);
        range(self.y, height).flat_map(move |y| columns.clone().map(move |x| (x, y)))
    }

    /// Distance of what another pixel shows from the tangent plane of this one, in pixels.
    fn height(&self, x: usize, y: usize) -> f32 {
        let own = self.hit(self.x, self.y);
        let offset = (self.hit(x, y).place - own.place).dot(own.normal);
        offset.abs() / self.film.view.footprint(own.t.into()) as f32
    }

    /// Whether the pixel may show more than one thing.
    fn is_edge(&self) -> bool {
        /// Normals further apart than this (the cosine) make a crease.
        const CREASE: f32 = 0.94;
        /// Height above the tangent plane, in pixels, that makes a step.
        const STEP: f32 = 2.0;
        let own = self.hit(self.x, self.y);
        self.within(1).any(|(x, y)| {
            let other = self.hit(x, y);
            if own.seen != other.seen {
                return true;
            }
            if matches!(own.seen, Seen::Nothing | Seen::Ground) {
                return false;
            }
            own.normal.dot(other.normal) < CREASE || self.height(x, y) > STEP
        })
    }

    /// The light that arrives, averaged over all patterns.
    fn smoothed(&self, arriving: &[Arriving]) -> Arriving {
        const REACH: usize = TILE / 2;
        /// Normals of pixels that share light differ less than this (the cosine).
        const ALIKE: f32 = 0.9;
        /// And their places lie this close to the tangent plane, in pixels.
        const CLOSE: f32 = 2.0;
        let own = self.hit(self.x, self.y);
        if own.seen == Seen::Nothing {
            return Arriving::default();
        }
        let (mut sum, mut total) = (Arriving::default(), 0.0);
        for (x, y) in self.within(REACH) {
            let other = self.hit(x, y);
            let alike = own.seen.same_piece(other.seen)
                && own.normal.dot(other.normal) > ALIKE
                && self.height(x, y) < CLOSE;
            if alike {
                // The two ends of a row of five have the same pattern and share its weight.
                let weight = |a: usize, b: usize| if a.abs_diff(b) == REACH { 0.5 } else { 1.0 };
                let weight = weight(x, self.x) * weight(y, self.y);
                let light = arriving[y * self.film.size[0] as usize + x];
                sum.key += weight * light.key;
                sum.open += weight * light.open;
                total += weight;
            }
        }
        Arriving {
            key: sum.key / total,
            open: sum.open / total,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_through_a_pixel_are_spread_evenly() {
        let places: Vec<[f64; 2]> = (0..PATTERNS).map(subpixel).collect();
        for axis in 0..2 {
            let mut along: Vec<f64> = places.iter().map(|p| p[axis]).collect();
            along.sort_by(f64::total_cmp);
            for (k, value) in along.into_iter().enumerate() {
                assert!((value - (k as f64 + 0.5) / 16.0).abs() < 1e-12);
            }
        }
        let mut squares: Vec<[usize; 2]> = places
            .iter()
            .map(|p| p.map(|c| (4.0 * c) as usize))
            .collect();
        squares.sort_unstable();
        squares.dedup();
        assert_eq!(squares.len(), PATTERNS);
    }
}

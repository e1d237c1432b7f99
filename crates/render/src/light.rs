//! Lights, and how a surface looks in them.
//!
//! Directions are seen from the subject: the azimuth turns from the camera to its right, the
//! elevation lifts upwards in the picture. Strengths are relative to what makes a white matte
//! surface white.

use std::f64::consts::PI;

use glam::DVec3;

use crate::camera::Orientation;

/// Azimuth and elevation of the key light in degrees: from the upper left,
const KEY: [f64; 2] = [-42.0, 38.0];
/// its strength, and its angular radius in degrees: how soft its shadows are.
const KEY_STRENGTH: f64 = 0.7;
const SOFTNESS: f64 = 9.0;
/// Azimuth and elevation of the fill light, a very broad one from the other side, and its strength.
const FILL: [f64; 2] = [75.0, 10.0];
const FILL_STRENGTH: f64 = 0.2;
/// Strength of the sky, which surrounds the subject, and the part of it that is left at the nadir.
const SKY_STRENGTH: f64 = 0.48;
const NADIR: f64 = 0.45;
/// Tints of the key light and of the surroundings: warm light, cool shade, white together.
const KEY_TINT: [f64; 3] = [1.03, 1.0, 0.955];
const SKY_TINT: [f64; 3] = [0.985, 1.0, 1.03];
/// Strength of the gloss over the matte colour, from 0 to 1, and its roughness: a broad highlight.
const GLOSS: f64 = 0.35;
const ROUGHNESS: f64 = 0.5;

/// Lights in the coordinates of the scene, fixed to the camera.
pub(crate) struct Lights {
    key: DVec3,
    up: DVec3,
    fill: DVec3,
}

impl Lights {
    pub fn new(view: &Orientation) -> Self {
        let direction = |angles: [f64; 2]| {
            let [(sin_az, cos_az), (sin_el, cos_el)] = angles.map(|a| a.to_radians().sin_cos());
            cos_el * (sin_az * view.right + cos_az * view.toward) + sin_el * view.above
        };
        Self {
            key: direction(KEY),
            up: view.up,
            fill: direction(FILL),
        }
    }

    /// Directions into the key light, evenly spread over it.
    pub fn towards_key(&self, count: usize) -> Vec<DVec3> {
        let (a, b) = self.key.any_orthonormal_pair();
        let spread = SOFTNESS.to_radians().tan();
        let direction = |k: usize| {
            let radius = spread * ((k as f64 + 0.5) / count as f64).sqrt();
            let (sin, cos) = (GOLDEN_ANGLE * k as f64).sin_cos();
            (self.key + radius * (cos * a + sin * b)).normalize()
        };
        (0..count).map(direction).collect()
    }

    /// Radiance of the surroundings: a linear gradient and the lobe `((1 + cos) / 2)^2`.
    pub fn radiance(&self, direction: DVec3) -> f64 {
        let lobe = 0.5 * (1.0 + direction.dot(self.fill));
        let sky = 0.5 * (1.0 + NADIR) + 0.5 * (1.0 - NADIR) * direction.dot(self.up);
        SKY_STRENGTH * sky + FILL_STRENGTH * lobe * lobe
    }

    /// Irradiance over pi of a free surface: the integral of the radiance with the cosine.
    ///
    /// Of a linear function `d . a` it is `2/3 n . a`, of `(d . a)^2` it is `(1 + (n . a)^2) / 4`.
    fn irradiance(&self, normal: DVec3) -> f64 {
        let (up, fill) = (normal.dot(self.up), normal.dot(self.fill));
        let lobe = 0.25 * (1.0 + 4.0 / 3.0 * fill + 0.25 * (1.0 + fill * fill));
        SKY_STRENGTH * (0.5 * (1.0 + NADIR) + (1.0 - NADIR) / 3.0 * up) + FILL_STRENGTH * lobe
    }

    /// Colour of a surface of the given body colour.
    ///
    /// `key` is the visible part of the key light, `open` the part of the surroundings' light that
    /// arrives, both from 0 to 1.
    pub fn shade(
        &self,
        body: [f32; 3],
        normal: DVec3,
        toward: DVec3,
        [key, open]: [f64; 2],
    ) -> [f32; 3] {
        let direct = KEY_STRENGTH * key * normal.dot(self.key).max(0.0);
        let ambient = self.irradiance(normal);
        let gloss = KEY_STRENGTH * key * PI * GLOSS * highlight(normal, toward, self.key);
        std::array::from_fn(|c| {
            let albedo = f64::from(body[c]);
            let light = direct * KEY_TINT[c] + ambient * SKY_TINT[c] * interreflected(open, albedo);
            shoulder(albedo * light + gloss) as f32
        })
    }
}

/// Turns by this angle, one after the other, never come close to each other: `pi (3 - sqrt 5)`.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;

/// Directions evenly spread over the sphere: Fibonacci's lattice.
pub(crate) fn all_around(count: usize) -> Vec<DVec3> {
    let direction = |k: usize| {
        let z = 1.0 - (2.0 * k as f64 + 1.0) / count as f64;
        let (sin, cos) = (GOLDEN_ANGLE * k as f64).sin_cos();
        DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + z * DVec3::Z
    };
    (0..count).map(direction).collect()
}

/// Light reflected by a gloss of full strength: the microfacet model of B. Walter and others
/// (2007), with the Fresnel term of C. Schlick (1994), times the cosine.
fn highlight(normal: DVec3, toward: DVec3, light: DVec3) -> f64 {
    /// Reflectance of plastics and glazes at normal incidence.
    const NORMAL_REFLECTANCE: f64 = 0.04;
    const ALPHA2: f64 = ROUGHNESS * ROUGHNESS * ROUGHNESS * ROUGHNESS;
    let (nl, nv) = (normal.dot(light), normal.dot(toward));
    if nl <= 0.0 || nv <= 0.0 {
        return 0.0;
    }
    let half = (light + toward).normalize();
    let nh = normal.dot(half);
    let distribution = ALPHA2 / (PI * (nh * nh * (ALPHA2 - 1.0) + 1.0).powi(2));
    let masking = |c: f64| 2.0 / (1.0 + (1.0 + ALPHA2 * (1.0 / (c * c) - 1.0)).sqrt());
    let fresnel = NORMAL_REFLECTANCE + (1.0 - NORMAL_REFLECTANCE) * (1.0 - light.dot(half)).powi(5);
    distribution * masking(nl) * masking(nv) * fresnel / (4.0 * nv)
}

/// Part of the surroundings' light that arrives directly or over other parts of the surface
/// (J. Jimenez and others: Practical real-time strategies for accurate indirect occlusion, 2016).
fn interreflected(open: f64, albedo: f64) -> f64 {
    let a = 2.0404 * albedo - 0.3324;
    let b = -4.7951 * albedo + 0.6417;
    let c = 2.7552 * albedo + 0.6903;
    open.max(((open * a + b) * open + c) * open)
}

/// The identity up to 0.8, then bent smoothly towards 1.
fn shoulder(intensity: f64) -> f64 {
    const KNEE: f64 = 0.8;
    if intensity <= KNEE {
        intensity
    } else {
        KNEE + (1.0 - KNEE) * (1.0 - (-(intensity - KNEE) / (1.0 - KNEE)).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIRECTIONS: usize = 20_000;

    #[test]
    fn the_irradiance_is_the_integral_of_the_radiance() {
        let lights = Lights {
            key: DVec3::Z,
            up: DVec3::Y,
            fill: DVec3::new(0.6, 0.0, 0.8),
        };
        for normal in [DVec3::X, -DVec3::Y, DVec3::new(-0.48, 0.6, 0.64)] {
            let integral: f64 = all_around(DIRECTIONS)
                .into_iter()
                .map(|d| 4.0 * normal.dot(d).max(0.0) * lights.radiance(d))
                .sum();
            let (mean, exact) = (integral / DIRECTIONS as f64, lights.irradiance(normal));
            assert!((mean - exact).abs() < 1e-3, "{normal}: {mean} {exact}");
        }
    }

    #[test]
    fn highlights_peak_in_the_mirror_direction_and_give_back_less_than_arrives() {
        let light = DVec3::new(0.6, 0.0, 0.8);
        let mirror = DVec3::new(-0.6, 0.0, 0.8);
        let peak = highlight(DVec3::Z, mirror, light);
        assert!(peak > 2.0 * highlight(DVec3::Z, light, light));
        // The cosine-weighted integral over the directions of view.
        let sum: f64 = all_around(DIRECTIONS)
            .into_iter()
            .map(|toward| toward.z.max(0.0) * highlight(DVec3::Z, toward, light))
            .sum();
        let reflected = 4.0 * PI * sum / DIRECTIONS as f64 / light.z;
        assert!((0.02..0.2).contains(&reflected), "{reflected}");
    }
}

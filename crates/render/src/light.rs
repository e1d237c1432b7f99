//! Lights and material.

use std::f64::consts::PI;

use glam::DVec3;
use srgb::Rgb;

use crate::Error;
use crate::camera::Orientation;
use crate::error::{fraction, require};

/// What the surface is made of: a matte body colour under a faint gloss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Body colour.
    pub colour: Rgb,
    /// Strength of the gloss, from 0 (none) to 1.
    pub gloss: f64,
    /// Roughness, from 0.05 (a sharp highlight) to 1 (a broad one).
    pub roughness: f64,
}

impl Material {
    /// A matte material of the given colour with a gentle, broad highlight.
    pub fn new(colour: Rgb) -> Self {
        Self {
            colour,
            gloss: 0.35,
            roughness: 0.5,
        }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        fraction("gloss", self.gloss)?;
        require("roughness", self.roughness, "between 0.05 and 1", |v| {
            (0.05..=1.0).contains(&v)
        })?;
        Ok(())
    }

    /// Light of the key reflected by the gloss: the microfacet model of B. Walter and others
    /// (2007), with the Fresnel term of C. Schlick (1994), times the cosine.
    pub(crate) fn highlight(&self, normal: DVec3, toward: DVec3, light: DVec3) -> f64 {
        /// Reflectance of plastics and glazes at normal incidence.
        const NORMAL_REFLECTANCE: f64 = 0.04;
        let (nl, nv) = (normal.dot(light), normal.dot(toward));
        if nl <= 0.0 || nv <= 0.0 {
            return 0.0;
        }
        let half = (light + toward).normalize();
        let alpha2 = self.roughness.powi(4);
        let nh = normal.dot(half);
        let distribution = alpha2 / (PI * (nh * nh * (alpha2 - 1.0) + 1.0).powi(2));
        let masking = |c: f64| 2.0 / (1.0 + (1.0 + alpha2 * (1.0 / (c * c) - 1.0)).sqrt());
        let fresnel =
            NORMAL_REFLECTANCE + (1.0 - NORMAL_REFLECTANCE) * (1.0 - light.dot(half)).powi(5);
        self.gloss * distribution * masking(nl) * masking(nv) * fresnel / (4.0 * nv)
    }
}

impl Default for Material {
    fn default() -> Self {
        Self::new(Rgb::CLAY)
    }
}

/// A key light and the light of the surroundings, both fixed to the camera.
///
/// Directions are seen from the subject: the azimuth turns from the camera to its right, the
/// elevation lifts upwards in the picture. Strengths are relative to what makes a white matte
/// surface white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lighting {
    /// Azimuth of the key light in degrees; negative values are on the left.
    pub key_azimuth: f64,
    /// Elevation of the key light in degrees.
    pub key_elevation: f64,
    /// Strength of the key light.
    pub key: f64,
    /// Angular radius of the key light in degrees, at most 45: how soft its shadows are.
    pub softness: f64,
    /// Strength of the sky, which surrounds the subject and fades downwards.
    pub sky: f64,
    /// Strength of the fill light, a very broad one from the side opposite to the key light.
    pub fill: f64,
}

impl Default for Lighting {
    fn default() -> Self {
        Self {
            key_azimuth: -42.0,
            key_elevation: 38.0,
            key: 0.70,
            softness: 9.0,
            sky: 0.48,
            fill: 0.2,
        }
    }
}

/// Part of the sky's strength that is left at the nadir.
const NADIR: f64 = 0.45;
/// Direction of the fill light, as azimuth opposite to the key light's and elevation.
const FILL_AZIMUTH: f64 = 75.0;
const FILL_ELEVATION: f64 = 10.0;

/// Tints of the key light and of the surroundings: warm light, cool shade, white together.
const KEY_TINT: [f64; 3] = [1.03, 1.0, 0.955];
const SKY_TINT: [f64; 3] = [0.985, 1.0, 1.03];

/// Lights in the coordinates of the scene.
pub(crate) struct Lights {
    pub key: DVec3,
    pub key_strength: f64,
    /// Radius of the key light on the unit sphere, as a tangent.
    pub spread: f64,
    up: DVec3,
    sky: f64,
    fill: DVec3,
    fill_strength: f64,
}

impl Lighting {
    pub(crate) fn resolve(&self, view: &Orientation) -> Result<Lights, Error> {
        for (name, value) in [
            ("azimuth of the key light", self.key_azimuth),
            ("elevation of the key light", self.key_elevation),
        ] {
            require(name, value, "finite", |_| true)?;
        }
        for (name, value) in [
            ("strength of the key light", self.key),
            ("strength of the sky", self.sky),
            ("strength of the fill light", self.fill),
        ] {
            require(name, value, "between 0 and 100", |v| {
                (0.0..=100.0).contains(&v)
            })?;
        }
        require("softness", self.softness, "between 0 and 45 degrees", |v| {
            (0.0..=45.0).contains(&v)
        })?;
        let direction = |azimuth: f64, elevation: f64| {
            let (sin_az, cos_az) = azimuth.to_radians().sin_cos();
            let (sin_el, cos_el) = elevation.to_radians().sin_cos();
            cos_el * (sin_az * view.right + cos_az * view.toward) + sin_el * view.above
        };
        let side = -1.0_f64.copysign(self.key_azimuth);
        Ok(Lights {
            key: direction(self.key_azimuth, self.key_elevation),
            key_strength: self.key,
            spread: self.softness.to_radians().tan(),
            up: view.up,
            sky: self.sky,
            fill: direction(side * FILL_AZIMUTH, FILL_ELEVATION),
            fill_strength: self.fill,
        })
    }
}

impl Lights {
    /// Radiance of the surroundings: a linear gradient and the lobe `((1 + cos) / 2)^2`.
    pub fn radiance(&self, direction: DVec3) -> f64 {
        let lobe = 0.5 * (1.0 + direction.dot(self.fill));
        self.sky * (0.5 * (1.0 + NADIR) + 0.5 * (1.0 - NADIR) * direction.dot(self.up))
            + self.fill_strength * lobe * lobe
    }

    /// Irradiance over pi of a free surface: the integral of the radiance with the cosine.
    ///
    /// Of a linear function `d . a` it is `2/3 n . a`, of `(d . a)^2` it is `(1 + (n . a)^2) / 4`.
    pub fn irradiance(&self, normal: DVec3) -> f64 {
        let (up, fill) = (normal.dot(self.up), normal.dot(self.fill));
        let lobe = 0.25 * (1.0 + 4.0 / 3.0 * fill + 0.25 * (1.0 + fill * fill));
        self.sky * (0.5 * (1.0 + NADIR) + (1.0 - NADIR) / 3.0 * up) + self.fill_strength * lobe
    }

    /// Colour of a surface of the given body colour.
    ///
    /// `key` is the visible part of the key light, `open` the part of the surroundings' light that
    /// arrives, both from 0 to 1.
    pub fn shade(
        &self,
        body: [f32; 3],
        material: &Material,
        normal: DVec3,
        toward: DVec3,
        [key, open]: [f64; 2],
    ) -> [f32; 3] {
        let direct = self.key_strength * key * normal.dot(self.key).max(0.0);
        let ambient = self.irradiance(normal);
        let gloss = self.key_strength * key * PI * material.highlight(normal, toward, self.key);
        std::array::from_fn(|c| {
            let albedo = f64::from(body[c]);
            let light = direct * KEY_TINT[c] + ambient * SKY_TINT[c] * interreflected(open, albedo);
            shoulder(albedo * light + gloss) as f32
        })
    }
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
    use crate::sampling::{disc, frame, r2};

    #[test]
    fn the_irradiance_is_the_integral_of_the_radiance() {
        let lights = Lights {
            key: DVec3::Z,
            key_strength: 1.0,
            spread: 0.1,
            up: DVec3::Y,
            sky: 0.7,
            fill: DVec3::new(0.6, 0.0, 0.8),
            fill_strength: 0.9,
        };
        for normal in [DVec3::X, -DVec3::Y, DVec3::new(-0.48, 0.6, 0.64)] {
            let [a, b] = frame(normal);
            let count = 20_000;
            let sum: f64 = (0..count)
                .map(|k| {
                    let [x, y] = disc(r2(k));
                    let z = (1.0 - x * x - y * y).max(0.0).sqrt();
                    lights.radiance(x * a + y * b + z * normal)
                })
                .sum();
            let (mean, exact) = (sum / count as f64, lights.irradiance(normal));
            assert!((mean - exact).abs() < 1e-3, "{normal}: {mean} {exact}");
        }
    }

    #[test]
    fn highlights_peak_in_the_mirror_direction_and_give_back_less_than_arrives() {
        let material = Material {
            gloss: 1.0,
            roughness: 0.4,
            ..Material::default()
        };
        let light = DVec3::new(0.6, 0.0, 0.8);
        let mirror = DVec3::new(-0.6, 0.0, 0.8);
        let peak = material.highlight(DVec3::Z, mirror, light);
        assert!(peak > 2.0 * material.highlight(DVec3::Z, light, light));
        // The cosine-weighted integral over the directions of view, uniform on the hemisphere.
        let count = 20_000;
        let sum: f64 = (0..count)
            .map(|k| {
                let [u, v] = r2(k);
                let (sin, cos) = (std::f64::consts::TAU * u).sin_cos();
                let radius = (1.0 - v * v).sqrt();
                let toward = DVec3::new(radius * cos, radius * sin, v);
                v * material.highlight(DVec3::Z, toward, light)
            })
            .sum();
        let reflected = 2.0 * PI * sum / count as f64 / light.z;
        assert!((0.02..0.2).contains(&reflected), "{reflected}");
    }
}

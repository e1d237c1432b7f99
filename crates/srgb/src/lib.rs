//! Colours: sRGB in files and on screens, linear intensities in computations.
//!
//! Light is added and averaged in linear intensities; files and screens take sRGB values
//! (IEC 61966-2-1).

/// An sRGB colour, 8 bits a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Rgb(pub u8, pub u8, pub u8);

impl Rgb {
    /// Warm light grey, like unglazed clay.
    pub const CLAY: Self = Self(229, 219, 205);
    /// Light blue.
    pub const SKY: Self = Self(160, 191, 221);
    /// Near-black, for lines.
    pub const INK: Self = Self(40, 40, 44);
    /// Black.
    pub const BLACK: Self = Self(0, 0, 0);
    /// White.
    pub const WHITE: Self = Self(255, 255, 255);

    /// Linear intensities in `[0, 1]`.
    pub fn linear(self) -> [f32; 3] {
        [self.0, self.1, self.2].map(decode)
    }
}

/// Linear intensity of an 8-bit sRGB value.
pub fn decode(value: u8) -> f32 {
    let v = f32::from(value) / 255.0;
    if v <= 0.04045 {
        v / 12.92
    } else {
        ((v + 0.055) / 1.055).powf(2.4)
    }
}

/// The 8-bit sRGB value of a linear intensity, clamped to `[0, 1]` and rounded.
pub fn encode(intensity: f32) -> u8 {
    let v = intensity.clamp(0.0, 1.0);
    let encoded = if v <= 0.0031308 {
        12.92 * v
    } else {
        1.055 * v.powf(1.0 / 2.4) - 0.055
    };
    (255.0 * encoded).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_round_trips_and_has_its_known_middle() {
        for value in 0..=255 {
            assert_eq!(encode(decode(value)), value);
        }
        // Half the light is the value 188, not 128.
        assert_eq!(encode(0.5), 188);
        assert_eq!((encode(-1.0), encode(7.0)), (0, 255));
    }
}

//! Colours that survive colour-blindness and printing: a qualitative palette and a colour map.

use derive_more::From;
use plotters::style::colors::colormaps::ViridisRGB;
use srgb::Rgb;

pub(crate) const INK: Rgb = Rgb(32, 32, 32);
pub(crate) const GREY: Rgb = Rgb(110, 110, 110);
pub(crate) const GRID: Rgb = Rgb(226, 226, 226);
pub(crate) const MINOR_GRID: Rgb = Rgb(243, 243, 243);
pub(crate) const FRAME: Rgb = Rgb(70, 70, 70);

/// The palette of Okabe and Ito ("Color Universal Design", 2008), ordered so that the first entries
/// are the easiest to tell apart on white; yellow comes last.
pub const OKABE_ITO: [Rgb; 8] = [
    Rgb(0, 114, 178),
    Rgb(213, 94, 0),
    Rgb(0, 158, 115),
    Rgb(204, 121, 167),
    Rgb(230, 159, 0),
    Rgb(86, 180, 233),
    Rgb(0, 0, 0),
    Rgb(240, 228, 66),
];

/// The colour of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, From)]
#[non_exhaustive]
pub enum Colour {
    /// Entry of [`OKABE_ITO`], modulo its length.
    #[from]
    Palette(usize),
    /// Near-black, for exact solutions.
    Black,
    /// Middle grey, for guides.
    Grey,
    /// Light grey, for filled shapes in the background.
    LightGrey,
    /// Any other colour.
    #[from]
    Custom(Rgb),
}

impl Colour {
    /// The colour as sRGB.
    pub fn rgb(self) -> Rgb {
        match self {
            Self::Palette(index) => OKABE_ITO[index % OKABE_ITO.len()],
            Self::Black => Rgb(20, 20, 20),
            Self::Grey => Rgb(130, 130, 130),
            Self::LightGrey => Rgb(214, 214, 214),
            Self::Custom(rgb) => rgb,
        }
    }
}

/// The colour map viridis, perceptually uniform and dark to light, at `t` in `[0, 1]`; values outside are clamped, NaN is light grey.
pub fn viridis(t: f64) -> Rgb {
    if t.is_nan() {
        return Rgb(200, 200, 200);
    }
    let colour = ViridisRGB::get_color(t.clamp(0.0, 1.0) as f32);
    Rgb(colour.0, colour.1, colour.2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn viridis_grows_lighter() {
        let luminance = |Rgb(r, g, b): Rgb| {
            0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
        };
        let light: Vec<f64> = (0..=50)
            .map(|k| luminance(viridis(f64::from(k) / 50.0)))
            .collect();
        assert!(light.windows(2).all(|w| w[1] > w[0]));
        assert_eq!(viridis(7.0), viridis(1.0));
        assert_eq!(viridis(f64::NAN), Rgb(200, 200, 200));
    }

    #[test]
    fn the_palette_wraps_and_is_distinct() {
        assert_eq!(Colour::from(8).rgb(), Colour::from(0).rgb());
        for (k, a) in OKABE_ITO.iter().enumerate() {
            assert!(OKABE_ITO[..k].iter().all(|b| a != b));
        }
    }
}

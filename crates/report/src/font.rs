//! The embedded typeface, so that pictures come out the same on every machine: no system font is ever consulted.
//!
//! The fonts of plotters will not do: it sets them 6.5 per cent larger than viewers of SVG documents do, and on another baseline, so a figure
//! would differ from its twin.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, GlyphId, ScaleFont};
use glam::DVec2;
use srgb::Rgb;

static FONT: LazyLock<FontRef<'static>> = LazyLock::new(|| {
    FontRef::try_from_slice(dejavu::sans::regular()).expect("the embedded font is well formed")
});

/// Distance from the middle of the capitals to the baseline, in em.
pub(crate) const HALF_CAPITAL: f64 = 0.365;

/// Distance from the top of a line to the baseline, in em.
pub(crate) const TOP_TO_BASELINE: f64 = 0.76;

/// Distance from one line of text to the next, in em.
pub(crate) const LEADING: f64 = 1.35;

/// Space below titles and above remarks.
pub(crate) const AIR: f64 = 5.0;

/// `ab_glyph` scales by ascent minus descent; this is that height in em.
fn scale_of(em: f64) -> f32 {
    let units = FONT.units_per_em().expect("the embedded font has an em");
    (em * f64::from(FONT.height_unscaled() / units)) as f32
}

/// Lays out one line: glyphs with their pen positions, and the width.
fn lay_out(text: &str, em: f64) -> (Vec<(GlyphId, f32)>, f32) {
    let font = FONT.as_scaled(scale_of(em));
    let (mut pen, mut previous) = (0.0_f32, None);
    let mut glyphs = Vec::with_capacity(text.len());
    for symbol in text.chars() {
        let glyph = font.glyph_id(symbol);
        if let Some(previous) = previous {
            pen += font.kern(previous, glyph);
        }
        glyphs.push((glyph, pen));
        pen += font.h_advance(glyph);
        previous = Some(glyph);
    }
    (glyphs, pen)
}

/// Width of one line of text at `em` layout units per em.
pub(crate) fn width(text: &str, em: f64) -> f64 {
    f64::from(lay_out(text, em).1)
}

/// Breaks `text` at spaces so that no line is wider than `limit`, unless a single word is.
pub(crate) fn wrap(text: &str, em: f64, limit: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for paragraph in text.lines() {
        let mut words = paragraph.split_whitespace();
        lines.extend(words.next().map(str::to_owned));
        for word in words {
            let line = lines.last_mut().expect("it has the first word");
            let longer = format!("{line} {word}");
            if width(&longer, em) > limit {
                lines.push(word.to_owned());
            } else {
                *line = longer;
            }
        }
    }
    lines
}

/// Height of wrapped lines with [`AIR`]; nothing for no text.
pub(crate) fn height(text: &str, em: f64, limit: f64) -> f64 {
    match wrap(text, em, limit).len() {
        0 => 0.0,
        lines => (lines as f64 * LEADING * em + AIR).ceil(),
    }
}

/// Where a line of text is from its place.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Align {
    /// It begins there.
    Left,
    Centre,
    /// It ends there.
    Right,
}

/// How a line of text is set in the embedded font. Its place is the middle of the capitals.
#[derive(Clone, Copy)]
pub(crate) struct TextStyle {
    /// Layout units per em.
    pub em: f64,
    pub colour: Rgb,
    pub align: Align,
    /// Turned to be read from bottom to top; then `align` is along that direction.
    pub vertical: bool,
}

impl TextStyle {
    /// Horizontal and centred.
    pub fn new(em: f64, colour: Rgb) -> Self {
        Self {
            em,
            colour,
            align: Align::Centre,
            vertical: false,
        }
    }

    pub fn aligned(self, align: Align) -> Self {
        Self { align, ..self }
    }

    pub fn upwards(mut self) -> Self {
        self.vertical = true;
        self
    }

    /// The place `down` em below `at` as the letters stand, above it if negative.
    pub fn below(&self, at: DVec2, down: f64) -> DVec2 {
        let step = if self.vertical { DVec2::X } else { DVec2::Y };
        at + down * self.em * step
    }
}

/// Visits the pixels of one line of text at `em` pixels per em, with the covered part of each: to the right of where the line begins, and
/// down from its top.
pub(crate) fn rasterize(text: &str, em: f64, mut visit: impl FnMut(i32, i32, f32)) {
    let (scale, baseline) = (scale_of(em), (TOP_TO_BASELINE * em) as f32);
    for (glyph, pen) in lay_out(text, em).0 {
        let placed = glyph.with_scale_and_position(scale, ab_glyph::point(pen, baseline));
        if let Some(outline) = FONT.outline_glyph(placed) {
            let corner = outline.px_bounds().min;
            let (x0, y0) = (corner.x as i32, corner.y as i32);
            outline.draw(|x, y, covered| {
                visit(x0 + x.cast_signed(), y0 + y.cast_signed(), covered);
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_every_symbol_of_the_field() {
        let symbols = "ετπεφψκλσΔ∇ΓΩ‖√∞×·±≈≤≥→−–…²³⁻⁰¹⁴⁵⁶⁷⁸⁹₀₁₂∂∫½";
        for symbol in symbols.chars() {
            let glyph = FONT.glyph_id(symbol);
            assert_ne!(glyph, GlyphId(0), "no glyph for {symbol:?}");
            assert!(FONT.outline(glyph).is_some(), "no outline for {symbol:?}");
        }
    }

    #[test]
    fn widths_scale_and_add() {
        let (once, twice) = (width("time", 10.0), width("time", 20.0));
        assert!((twice - 2.0 * once).abs() < 1e-3);
        assert!(width("0", 10.0) > 5.0 && width("0", 10.0) < 8.0);
    }

    #[test]
    fn wrapping_respects_the_limit() {
        let text = "the error against the exact radius, measured in the Euclidean norm";
        let lines = wrap(text, 12.0, 150.0);
        assert!(lines.len() > 2);
        assert!(lines.iter().all(|line| width(line, 12.0) <= 150.0));
        assert_eq!(lines.join(" "), text);
    }
}

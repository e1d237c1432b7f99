//! Which pixels of an image are the shape.

use derive_more::Display;
use geometry::require;

use crate::{Error, Image};

/// Which pixels of an image are inside: those on a side of a threshold. Values equal to it are outside.
#[derive(Clone, Copy, Debug, PartialEq, Display)]
pub enum Side {
    /// `1 - opacity (1 - grey)`, the grey value on white, is below the threshold.
    #[display("darker than {_0:.4}")]
    Dark(f64),
    /// `opacity grey`, the grey value on black, is above the threshold.
    #[display("lighter than {_0:.4}")]
    Light(f64),
    /// The opacity is above the threshold.
    #[display("more opaque than {_0:.4}")]
    Opaque(f64),
}

impl Side {
    /// Decides for an image: inside are the opaque pixels if one is less than half opaque; else the dark ones, unless more than
    /// half of the pixels at the border are dark, and then the light ones. The threshold is from 0 (black, transparent) to 1.
    pub fn of(image: &Image, threshold: f64) -> Result<Self, Error> {
        let is_fraction = |v: f64| (0.0..=1.0).contains(&v);
        let threshold = require("threshold", threshold, "from 0 to 1", is_fraction)?;
        let half = |opacity: &[u16]| opacity.iter().any(|&v| v <= u16::MAX / 2);
        if image.opacity().is_some_and(half) {
            return Ok(Self::Opaque(threshold));
        }
        let dark = Self::Dark(threshold);
        let is_dark = |&pixel: &usize| dark.depth(image.pixel(pixel)) > 0.0;
        let darker = image.border().filter(is_dark).count();
        if 2 * darker > image.border().count() {
            return Ok(Self::Light(threshold));
        }
        Ok(dark)
    }

    /// The same side of another threshold.
    #[must_use]
    pub fn at(self, threshold: f64) -> Self {
        match self {
            Self::Dark(_) => Self::Dark(threshold),
            Self::Light(_) => Self::Light(threshold),
            Self::Opaque(_) => Self::Opaque(threshold),
        }
    }

    /// What is compared with the threshold, from grey value and opacity.
    pub(crate) fn value(self, [grey, opacity]: [f64; 2]) -> f64 {
        match self {
            Self::Dark(_) => 1.0 - opacity * (1.0 - grey),
            Self::Light(_) => opacity * grey,
            Self::Opaque(_) => opacity,
        }
    }

    /// How far the value is on this side: positive inside.
    pub(crate) fn depth(self, pixel: [f64; 2]) -> f64 {
        let value = self.value(pixel);
        match self {
            Self::Dark(threshold) => threshold - value,
            Self::Light(threshold) | Self::Opaque(threshold) => value - threshold,
        }
    }

    /// The name of what is compared.
    pub(crate) fn quantity(self) -> &'static str {
        match self {
            Self::Dark(_) | Self::Light(_) => "the grey value",
            Self::Opaque(_) => "the opacity",
        }
    }
}

/// How the values of an image divide into two tones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tones {
    /// The threshold that separates them best: it maximises the variance between the two classes of pixels, and lies in the middle
    /// of all that do. N. Otsu: A threshold selection method from gray-level histograms. IEEE Trans. Syst. Man Cybern. 9 (1979).
    pub threshold: f64,
    /// The part of the pixels that has neither tone and is not at an edge between them: next to nothing in a drawing, much in
    /// a photograph.
    pub between: f64,
    /// The part of the pixels inside, with this threshold.
    pub inside: f64,
    /// The part of the pairs of neighbouring pixels on different sides of it that have the two tones and nothing in between.
    pub hard: f64,
}

/// Values further than this part of their contrast from both tones are between them.
const BETWEEN: f64 = 0.2;
/// Edges with more than this part of the contrast between two neighbours are hard.
const HARD: f64 = 0.9;
/// So many pixels from an edge its blending ends.
const BLENDED: usize = 2;

impl Tones {
    /// Of what the side compares.
    pub fn of(image: &Image, side: Side) -> Self {
        let threshold = otsu(image, side);
        let pixels = image.grey().len();
        let value = |pixel: usize| side.value(image.pixel(pixel));
        let median = |above: bool| {
            let class = (0..pixels).map(value);
            let mut class: Vec<f64> = class.filter(|v| (*v > threshold) == above).collect();
            let middle = class.len() / 2;
            match class.len() {
                0 => threshold,
                _ => *class.select_nth_unstable_by(middle, f64::total_cmp).1,
            }
        };
        let tones = [median(false), median(true)];
        let far = BETWEEN * (tones[1] - tones[0]);
        let [width, height] = image.size().map(|n| n as usize);
        let is_at_edge = |pixel: usize| {
            let (x, y) = (pixel % width, pixel / width);
            let above = value(pixel) > threshold;
            let columns = x.saturating_sub(BLENDED)..(x + BLENDED + 1).min(width);
            let mut rows = y.saturating_sub(BLENDED)..(y + BLENDED + 1).min(height);
            rows.any(|row| (columns.clone()).any(|x| (value(row * width + x) > threshold) != above))
        };
        let is_between = |pixel: &usize| {
            let value = value(*pixel);
            tones.iter().all(|tone| (value - tone).abs() > far) && !is_at_edge(*pixel)
        };
        let (mut edges, mut hard) = (0.0_f64, 0.0);
        for pixel in 0..pixels {
            let right = (pixel % width + 1 < width).then_some(pixel + 1);
            let below = (pixel / width + 1 < height).then_some(pixel + width);
            for next in right.into_iter().chain(below) {
                let [a, b] = [pixel, next].map(value);
                if (a > threshold) != (b > threshold) {
                    edges += 1.0;
                    hard += f64::from(u8::from((a - b).abs() > HARD * (tones[1] - tones[0])));
                }
            }
        }
        let separated = side.at(threshold);
        let is_inside = |pixel: &usize| separated.depth(image.pixel(*pixel)) > 0.0;
        let part = |count: usize| count as f64 / pixels as f64;
        Self {
            threshold,
            between: part((0..pixels).filter(is_between).count()),
            inside: part((0..pixels).filter(is_inside).count()),
            hard: hard / edges.max(1.0),
        }
    }

    /// How far points of the outline may be off, in pixels: a tenth where edges are blended, and more than half where they are hard.
    pub fn raster(&self) -> f64 {
        0.1 + 0.5 * self.hard
    }
}

/// Otsu's threshold for what the side compares; 0.5 if all values are equal.
fn otsu(image: &Image, side: Side) -> f64 {
    /// Values are counted in steps of those of 8 bits.
    const LAST: usize = 255;
    let mut counts = [0_u32; LAST + 1];
    for pixel in 0..image.grey().len() {
        let value = side.value(image.pixel(pixel));
        counts[((value * LAST as f64).round() as usize).min(LAST)] += 1;
    }
    let moment = |(value, &count): (usize, &u32)| value as f64 * f64::from(count);
    let total: f64 = counts.iter().copied().map(f64::from).sum();
    let whole: f64 = counts.iter().enumerate().map(moment).sum();
    let (mut below, mut below_moment) = (0.0, 0.0);
    let mut best = (0.0, None);
    for (split, count) in counts.iter().enumerate().take(LAST) {
        below += f64::from(*count);
        below_moment += moment((split, count));
        let above = total - below;
        if below == 0.0 || above == 0.0 {
            continue;
        }
        let difference = below_moment / below - (whole - below_moment) / above;
        let variance = below * above * difference * difference;
        // Between two values that occur the variance is the same, to the last bit.
        best = match (variance.partial_cmp(&best.0), best.1) {
            (Some(std::cmp::Ordering::Greater), _) => (variance, Some((split, split))),
            (Some(std::cmp::Ordering::Equal), Some((first, _))) => (variance, Some((first, split))),
            _ => best,
        };
    }
    let (first, last) = best.1.unwrap_or((0, LAST - 1));
    (0.5 * (first + last) as f64 + 0.5) / LAST as f64
}

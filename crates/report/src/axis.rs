//! Axes: ranges, the map from values to positions, ticks and their labels.

use glam::{DVec2, dvec2};

use crate::error::{Error, Result};
use crate::geom::Rect;

/// How values are spread along an axis or a colour bar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scale {
    Linear,
    Log,
}

/// One axis of a chart. Its label says what is measured, with its unit or scaling; without a range it ends with the data.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    pub(crate) label: String,
    pub(crate) scale: Scale,
    pub(crate) range: Option<[f64; 2]>,
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            scale: Scale::Linear,
            range: None,
        }
    }

    /// A logarithmic axis (base 10); values that are not positive cannot be shown.
    pub fn log(label: impl Into<String>) -> Self {
        Self {
            scale: Scale::Log,
            ..Self::linear(label)
        }
    }

    /// Fixes both ends. They are checked when the figure is drawn.
    #[must_use]
    pub fn with_range(mut self, low: f64, high: f64) -> Self {
        self.range = Some([low, high]);
        self
    }

    /// Whether a value can be placed on this axis.
    pub(crate) fn shows(&self, value: f64) -> bool {
        // Numbers below the normal range have too few digits left to be data.
        value.is_finite() && (self.scale == Scale::Linear || value >= f64::MIN_POSITIVE)
    }

    /// The axis with both ends known; `padding` is a share of an automatic range. `None` if there is neither a range nor a value to show.
    pub(crate) fn resolve(
        &self,
        values: impl Iterator<Item = f64>,
        padding: f64,
    ) -> Result<Option<Mapping>> {
        if let Some([low, high]) = self.range {
            return Mapping::new(&self.label, self.scale, low, high).map(Some);
        }
        let shown = values.filter(|&v| self.shows(v)).map(|v| (v, v));
        let Some((low, high)) = shown.reduce(|(a, b), (c, d)| (a.min(c), b.max(d))) else {
            return Ok(None);
        };
        // What is as good as constant is shown in the middle of a range of its own size, which needs some padding.
        let around = if padding > 0.0 { padding } else { 0.05 };
        let (low, high) = match self.scale {
            Scale::Linear => {
                let added = match high - low {
                    span if span > narrowest(low, high) => padding * span,
                    _ if high.abs() < 1e-250 => around,
                    _ => around * high.abs(),
                };
                (low - added, high + added)
            }
            Scale::Log => {
                let added = match high.log10() - low.log10() {
                    span if span > 1e-9 => padding * span,
                    _ => around,
                };
                let factor = 10.0_f64.powf(added);
                let low = (low / factor).max(f64::MIN_POSITIVE);
                (low, (high * factor).min(f64::MAX))
            }
        };
        Mapping::new(&self.label, self.scale, low, high).map(Some)
    }
}

/// An axis whose ends are known: values to fractions of its length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mapping {
    pub scale: Scale,
    pub low: f64,
    pub high: f64,
}

impl Mapping {
    pub fn new(label: &str, scale: Scale, low: f64, high: f64) -> Result<Self> {
        let valid = (high - low).is_finite()
            && high - low > narrowest(low, high)
            && (scale == Scale::Linear || low >= f64::MIN_POSITIVE);
        if valid {
            return Ok(Self { scale, low, high });
        }
        let axis = label.to_owned();
        Err(Error::Range { axis, low, high })
    }

    /// 0 at the low end, 1 at the high end; far outside values are pulled in, or their coordinates overflow later on.
    pub fn fraction(&self, value: f64) -> f64 {
        let [value, low, high] = match self.scale {
            Scale::Linear => [value, self.low, self.high],
            Scale::Log => [value, self.low, self.high].map(f64::log10),
        };
        ((value - low) / (high - low)).clamp(-1e4, 1e4)
    }

    /// Ticks for an axis `length` units long. `extent` is the room a label takes along the axis.
    pub fn ticks(&self, length: f64, extent: impl Fn(&str) -> f64) -> Ticks {
        let most = ((length / 28.0) as usize).clamp(2, 12);
        let mut best = None;
        for target in (1..=most).rev() {
            let ticks = match self.scale {
                Scale::Linear => linear_ticks(self.low, self.high, target),
                Scale::Log => log_ticks(self.low, self.high, target),
            };
            let fits = ticks.fit(self, length, &extent);
            let enough = ticks.major.len() >= 2;
            if fits && enough {
                return ticks;
            }
            if best.is_none() || (enough && !fits) {
                best = Some(ticks);
            }
        }
        best.unwrap_or_default()
    }
}

/// The ends of two axes: points of the plane to places in a plot box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Window {
    pub x: Mapping,
    pub y: Mapping,
}

impl Window {
    /// A window at equal scales, named in errors by the labels of its axes.
    pub fn linear([x, y]: [&str; 2], ends: [[f64; 2]; 2]) -> Result<Self> {
        let mapping = |label, [low, high]: [f64; 2]| Mapping::new(label, Scale::Linear, low, high);
        Ok(Self {
            x: mapping(x, ends[0])?,
            y: mapping(y, ends[1])?,
        })
    }

    /// Height over width.
    pub fn aspect(&self) -> f64 {
        (self.y.high - self.y.low) / (self.x.high - self.x.low)
    }

    pub fn place(&self, plot: &Rect, [x, y]: [f64; 2]) -> DVec2 {
        let (right, up) = (self.x.fraction(x), self.y.fraction(y));
        dvec2(
            plot.x + right * plot.width,
            plot.bottom() - up * plot.height,
        )
    }
}

/// Tick positions (as values) and labels.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Ticks {
    pub major: Vec<(f64, String)>,
    pub minor: Vec<f64>,
    /// A factor common to all labels, such as `×10⁻⁵`.
    pub factor: Option<String>,
}

impl Ticks {
    fn fit(&self, map: &Mapping, length: f64, extent: &impl Fn(&str) -> f64) -> bool {
        self.major.windows(2).all(|pair| {
            let gap = (map.fraction(pair[1].0) - map.fraction(pair[0].0)).abs() * length;
            gap >= 0.5 * (extent(&pair[0].1) + extent(&pair[1].1))
        })
    }
}

/// Ranges up to this width cannot be told from a point: their ticks would drown in rounding.
fn narrowest(low: f64, high: f64) -> f64 {
    1e-12 * low.abs().max(high.abs()) + 1e-280
}

/// The smallest of 1, 2, 5 times a power of ten that is at least `raw`.
fn nice_step(raw: f64) -> f64 {
    let power = 10.0_f64.powf(raw.log10().floor());
    let nice = [1.0, 2.0, 5.0].map(|m| m * power);
    let found = nice.into_iter().find(|step| raw <= step * (1.0 + 1e-9));
    found.unwrap_or(10.0 * power)
}

fn linear_ticks(low: f64, high: f64, target: usize) -> Ticks {
    let step = nice_step((high - low) / target as f64);
    let slack = 1e-9 * (high - low) / step;
    let (first, last) = ((low / step - slack).ceil(), (high / step + slack).floor());
    let count = (last - first + 1.0).max(0.0) as usize;
    let values: Vec<f64> = (0..count).map(|k| (first + k as f64) * step).collect();
    let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let power = |size: f64| (size * (1.0 + 1e-9)).log10().floor() as i32;
    let exponent = match largest {
        0.0 | 1e-3..1e5 => 0,
        _ => power(largest),
    };
    // Zero alone needs no decimals, however small the step.
    let decimals = match usize::try_from(exponent - power(step)) {
        Ok(decimals) if largest > 0.0 => decimals,
        _ => 0,
    };
    let unit = 10.0_f64.powi(exponent);
    let label = |value: f64| signed(&format!("{:.decimals$}", value / unit));
    Ticks {
        major: values.into_iter().map(|v| (v, label(v))).collect(),
        minor: Vec::new(),
        factor: (exponent != 0).then(|| format!("×{}", power_of_ten(exponent))),
    }
}

/// Powers of ten, as far apart as must be; where few are in sight, some of their multiples too; plain numbers where there are none.
fn log_ticks(low: f64, high: f64, target: usize) -> Ticks {
    const ALL: [i32; 9] = [1, 2, 3, 4, 5, 6, 7, 8, 9];
    let value = |(m, k): (i32, i32)| f64::from(m) * 10.0_f64.powi(k);
    let (bottom, top) = (low.log10() - 1e-9, high.log10() + 1e-9);
    let within = |mantissas: &[i32]| -> Vec<(i32, i32)> {
        (bottom.floor() as i32..=top.floor() as i32)
            .flat_map(|k| mantissas.iter().map(move |&m| (m, k)))
            .filter(|&tick| (bottom..=top).contains(&value(tick).log10()))
            .collect()
    };
    let decades = within(&[1]);
    let stride = i32::try_from(decades.len().div_ceil(target)).unwrap_or(i32::MAX);
    let multiples = [&ALL[..], &[1, 2, 5], &[1, 3]].map(within);
    let labelled = match multiples
        .into_iter()
        .find(|ticks| (2..=target).contains(&ticks.len()))
    {
        Some(ticks) if decades.len() <= 2 => ticks,
        _ if decades.len() >= 2 => decades
            .into_iter()
            .filter(|(_, k)| k.rem_euclid(stride) == 0)
            .collect(),
        _ => return linear_ticks(low, high, target),
    };
    let minor = within(if stride == 1 { &ALL } else { &[1] })
        .into_iter()
        .filter(|tick| !labelled.contains(tick));
    let label = |(m, k): (i32, i32)| match m {
        1 => power_of_ten(k),
        _ => format!("{m}·{}", power_of_ten(k)),
    };
    Ticks {
        minor: minor.map(value).collect(),
        major: labelled.iter().map(|&t| (value(t), label(t))).collect(),
        factor: None,
    }
}

/// `10⁻³` for -3.
pub(crate) fn power_of_ten(exponent: i32) -> String {
    format!("10{}", superscript(exponent))
}

/// `⁻³` for -3.
pub fn superscript(exponent: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digits = exponent.to_string();
    let raised = |c: char| c.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    digits.chars().map(raised).collect()
}

/// The number with a real minus sign, and zero without a sign: `−0.5` for `-0.5`, `0.0` for `-0.0` and `+0.0`.
pub fn signed(number: &str) -> String {
    let digits = number.trim_start_matches(['+', '-']);
    if digits.chars().all(|c| matches!(c, '0' | '.')) {
        return digits.to_owned();
    }
    number.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn labels(ticks: &Ticks) -> Vec<&str> {
        ticks
            .major
            .iter()
            .map(|(_, label)| label.as_str())
            .collect()
    }

    fn log(low: f64, high: f64) -> Mapping {
        Mapping::new("y", Scale::Log, low, high).unwrap()
    }

    #[test]
    fn log_mapping_spaces_ratios_equally() {
        let map = log(1e-4, 1.0);
        for (value, fraction) in [
            (1e-4, 0.0),
            (1e-3, 0.25),
            (1e-2, 0.5),
            (0.1, 0.75),
            (1.0, 1.0),
        ] {
            assert!((map.fraction(value) - fraction).abs() < 1e-12);
        }
    }

    #[test]
    fn decades_are_labelled_with_eight_minor_ticks_between() {
        let ticks = log(1e-4, 1e-1).ticks(300.0, |_| 20.0);
        assert_eq!(labels(&ticks), ["10⁻⁴", "10⁻³", "10⁻²", "10⁻¹"]);
        assert_eq!(ticks.minor.len(), 3 * 8);
    }

    #[test]
    fn many_decades_are_thinned() {
        let ticks = log(1e-30, 1.0).ticks(200.0, |_| 20.0);
        assert!((3..=8).contains(&ticks.major.len()), "{:?}", labels(&ticks));
        assert!(!ticks.minor.is_empty());
    }

    #[test]
    fn less_than_a_decade_is_still_labelled() {
        assert_eq!(
            labels(&log(1.5e-3, 6e-3).ticks(400.0, |_| 30.0)),
            ["2·10⁻³", "3·10⁻³", "4·10⁻³", "5·10⁻³", "6·10⁻³"]
        );
        let narrow = log(1.01, 1.09).ticks(200.0, |_| 30.0);
        assert!(narrow.major.len() >= 2, "{narrow:?}");
    }

    #[test]
    fn linear_labels_are_plain_or_share_a_factor() {
        assert_eq!(
            labels(&linear_ticks(0.0, 1.0, 5)),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(labels(&linear_ticks(-1.0, 1.0, 2)), ["−1", "0", "1"]);
        let numbers = ["-1.5", "+1.5", "-0.00", "+0.0", "0"];
        assert_eq!(numbers.map(signed), ["−1.5", "+1.5", "0.00", "0.0", "0"]);
        assert_eq!(labels(&linear_ticks(-1e-9, 4e-8, 1)), ["0"]);
        let small = linear_ticks(0.0, 4e-5, 4);
        assert_eq!(labels(&small), ["0", "1", "2", "3", "4"]);
        assert_eq!(small.factor.as_deref(), Some("×10⁻⁵"));
        let large = linear_ticks(0.0, 1e6, 2);
        assert_eq!(labels(&large), ["0.0", "0.5", "1.0"]);
        assert_eq!(large.factor.as_deref(), Some("×10⁶"));
    }

    #[test]
    fn automatic_ranges_ignore_what_cannot_be_shown() {
        let axis = Axis::log("error");
        let values = [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-3, 1e-1];
        let map = axis.resolve(values.into_iter(), 0.0).unwrap().unwrap();
        assert_eq!((map.low, map.high), (1e-3, 1e-1));
        assert_eq!(axis.resolve([0.0, -1.0].into_iter(), 0.0).unwrap(), None);
        let flat = Axis::linear("u")
            .resolve([0.0, 0.0].into_iter(), 0.05)
            .unwrap()
            .unwrap();
        assert!(flat.low < 0.0 && flat.high > 0.0);
    }

    #[test]
    fn bad_ranges_are_refused_with_their_numbers() {
        for (axis, low, high) in [
            (Axis::linear("time"), 1.0, 1.0),
            (Axis::linear("time"), 0.0, f64::NAN),
            (Axis::log("time"), 0.0, 1.0),
        ] {
            let error = axis
                .with_range(low, high)
                .resolve(std::iter::empty(), 0.0)
                .unwrap_err();
            assert!(error.to_string().contains("\"time\""), "{error}");
        }
    }

    proptest! {
        #[test]
        fn ticks_lie_on_the_axis_and_do_not_overlap(
            low in -1e3..1e3_f64, decades in -6.0..6.0_f64, length in 80.0..900.0_f64,
        ) {
            let map = Mapping::new("x", Scale::Linear, low, low + 10.0_f64.powf(decades)).unwrap();
            let extent = |label: &str| 7.0 * label.chars().count() as f64 + 10.0;
            let ticks = map.ticks(length, extent);
            prop_assert!(ticks.major.len() <= 13);
            for (value, _) in &ticks.major {
                prop_assert!((-1e-9..=1.0 + 1e-9).contains(&map.fraction(*value)), "{value}");
            }
            if length > 400.0 {
                prop_assert!(ticks.major.len() >= 2, "{ticks:?}");
                prop_assert!(ticks.fit(&map, length, &extent));
            }
        }

        #[test]
        fn log_ticks_lie_on_the_axis(
            low in -12.0..6.0_f64, decades in 0.05..20.0_f64, length in 80.0..900.0_f64,
        ) {
            let map = log(10.0_f64.powf(low), 10.0_f64.powf(low + decades));
            let ticks = map.ticks(length, |label| 7.0 * label.chars().count() as f64 + 10.0);
            prop_assert!(!ticks.major.is_empty());
            for value in ticks.major.iter().map(|(v, _)| v).chain(&ticks.minor) {
                prop_assert!((-1e-8..=1.0 + 1e-8).contains(&map.fraction(*value)));
            }
        }
    }
}

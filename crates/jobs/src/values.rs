//! Values of options, which are read as they are written.

use std::fmt;
use std::num::ParseIntError;

use derive_more::Display;

use crate::prelude::*;

/// A finite number.
///
/// # Errors
/// A text that is none.
pub fn finite(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value: &f64| value.is_finite());
    value.ok_or_else(|| "it must be a finite number".to_owned())
}

/// A finite number above 0.
///
/// # Errors
/// A text that is none.
pub fn positive(text: &str) -> Result<f64, String> {
    let value = finite(text).ok().filter(|value| *value > 0.0);
    value.ok_or_else(|| "it must be positive".to_owned())
}

/// A whole number above 0.
///
/// # Errors
/// A text that is none.
pub fn count(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("it must be at least 1".to_owned()),
        parsed => parsed.map_err(|error: ParseIntError| error.to_string()),
    }
}

/// A whole number in a file of options. Those of TOML end at `2^63 - 1`: a larger one becomes a text, which is read alike.
struct Whole<N>(N);

impl<N: Copy + TryInto<i64> + fmt::Display> Serialize for Whole<N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0.try_into() {
            Ok(number) => serializer.serialize_i64(number),
            Err(_) => serializer.collect_str(&self.0),
        }
    }
}

/// For serde: a whole number.
pub(crate) fn whole<N, S>(number: &N, serializer: S) -> Result<S::Ok, S::Error>
where
    N: Copy + TryInto<i64> + fmt::Display,
    S: Serializer,
{
    Whole(*number).serialize(serializer)
}

/// For serde: a whole number, if there is one.
#[expect(clippy::ref_option, reason = "serde passes the field")]
pub(crate) fn whole_if_given<N, S>(number: &Option<N>, serializer: S) -> Result<S::Ok, S::Error>
where
    N: Copy + TryInto<i64> + fmt::Display,
    S: Serializer,
{
    number.map(Whole).serialize(serializer)
}

/// A value in the units of the input, or a part of another one in percent.
#[derive(Clone, Copy, Debug, PartialEq, Display)]
pub enum Amount {
    /// In the units of the input.
    Value(f64),
    /// In percent of another one.
    #[display("{_0}%")]
    Percent(f64),
}

impl Amount {
    fn parse(text: &str, expected: &str) -> Result<Self, String> {
        let (number, amount): (_, fn(f64) -> Self) = match text.strip_suffix('%') {
            Some(percent) => (percent, Self::Percent),
            None => (text, Self::Value),
        };
        let wrong = |_| format!("{number:?} is no positive number; give {expected}");
        positive(number).map(amount).map_err(wrong)
    }

    /// The value, if `whole` is what it may be a part of.
    pub fn of(self, whole: f64) -> f64 {
        match self {
            Self::Value(value) => value,
            Self::Percent(percent) => percent / 100.0 * whole,
        }
    }

    /// A length, or a part of the motion.
    ///
    /// # Errors
    /// A text that is neither.
    pub fn tolerance(text: &str) -> Result<Self, String> {
        let expected = "a length, or a part of the motion in percent, such as 2%";
        Self::parse(text, expected)
    }
}

impl Serialize for Amount {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// What a size is to become.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SizeTarget {
    /// What it is at the beginning.
    Keep,
    /// This, or this part of what it is at the beginning.
    #[serde(untagged)]
    To(Amount),
}

impl FromStr for SizeTarget {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = "keep, a value, or a part of the beginning in percent, such as 90%";
        match text {
            "keep" => Ok(Self::Keep),
            text => Amount::parse(text, expected).map(Self::To),
        }
    }
}

/// What of a volume is inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Display, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Label {
    /// Each but 0 becomes a surface of its own.
    #[display("all")]
    All,
    /// This one.
    #[serde(untagged)]
    One(i64),
}

impl FromStr for Label {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            Ok(label) => Ok(Self::One(label)),
            Err(_) if text == "all" => Ok(Self::All),
            Err(_) => Err(format!("{text:?} is neither a whole number nor all")),
        }
    }
}

/// What an inpainted region holds at the beginning.
#[derive(Clone, Debug, Default, PartialEq, Display)]
#[display(rename_all = "lowercase")]
pub enum Ansatz {
    /// The shape itself.
    #[default]
    Keep,
    /// Nothing.
    Empty,
    /// All inside.
    Full,
    /// This region.
    #[display("{_0}")]
    Shape(Region),
}

impl Serialize for Ansatz {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl FromStr for Ansatz {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "keep" => Ok(Self::Keep),
            "empty" => Ok(Self::Empty),
            "full" => Ok(Self::Full),
            text if Region::is_meant(text) => text.parse().map(Self::Shape),
            text => Err(format!(
                "{text:?} is no ansatz: give keep, empty, full, box:... or ball:..."
            )),
        }
    }
}

//! Which way is up.

use std::str::FromStr;

use derive_more::Display;
use serde::{Deserialize, Serialize};

use crate::Error;

/// The coordinate axis that points up in pictures of a shape in space; `x`, `y` or `z` as text.
///
/// Together with the two that follow it cyclically it is right-handed: `z`, `x`, `y` if `z` points
/// up, and azimuths are counted from the second to the third.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Display, Serialize, Deserialize)]
#[display(rename_all = "lowercase")]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// Axis 0.
    X,
    /// Axis 1, as in most OBJ files.
    Y,
    /// Axis 2, as of everything made here.
    #[default]
    Z,
}

impl UpAxis {
    /// All of them, in order.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// Its number, from 0.
    pub fn index(self) -> usize {
        self as usize
    }
}

impl FromStr for UpAxis {
    type Err = Error;

    /// # Errors
    /// [`Error::UnknownAxis`].
    fn from_str(name: &str) -> Result<Self, Error> {
        Self::ALL
            .into_iter()
            .find(|axis| axis.to_string() == name)
            .ok_or_else(|| Error::UnknownAxis { name: name.into() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for axis in UpAxis::ALL {
            assert_eq!(axis.to_string().parse::<UpAxis>().unwrap(), axis);
        }
        assert_eq!(
            "up".parse::<UpAxis>().unwrap_err().to_string(),
            "\"up\" is no axis: choose x, y or z"
        );
    }
}

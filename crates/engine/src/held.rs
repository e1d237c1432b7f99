//! Perimeter and volume held, or driven to targets.

use serde::{Deserialize, Serialize};
use solver::Constraints;

/// A size that goes from one value to another over so many steps, evenly, and is held there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// The value at the beginning,
    pub from: f64,
    /// and after the last of these steps.
    pub to: f64,
    /// How many they are; none for a value that is held from the first step on.
    pub over: usize,
}

impl Target {
    /// A value that is held.
    pub fn keep(value: f64) -> Self {
        Self {
            from: value,
            to: value,
            over: 0,
        }
    }

    /// The value at the end of a step, counted from 1.
    pub fn at(&self, step: usize) -> f64 {
        if step >= self.over {
            return self.to;
        }
        self.from + (self.to - self.from) * step as f64 / self.over as f64
    }
}

/// The sizes of the zero set that are held, as [`geometry::ZeroSet`] measures them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Held {
    /// Length (2D) or area (3D).
    pub perimeter: Option<Target>,
    /// Area (2D) or volume (3D) of the inside.
    pub volume: Option<Target>,
}

impl Held {
    /// Whether nothing is held.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The constraints of a step, counted from 1.
    pub fn at(&self, step: usize) -> Constraints {
        let at = |target: Option<Target>| target.map(|target| target.at(step));
        Constraints {
            perimeter: at(self.perimeter),
            volume: at(self.volume),
        }
    }

    /// The constraints in the end.
    pub fn targets(&self) -> Constraints {
        self.at(usize::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_reached_evenly_and_held() {
        let target = Target {
            from: 1.0,
            to: 2.0,
            over: 4,
        };
        let values = [1, 2, 4, 9].map(|step| target.at(step));
        assert_eq!(
            values.map(f64::to_bits),
            [1.25, 1.5, 2.0, 2.0].map(f64::to_bits)
        );
        assert_eq!(Target::keep(0.3).at(1).to_bits(), 0.3_f64.to_bits());
        assert!(Held::default().is_empty() && Held::default().targets().is_empty());
    }
}

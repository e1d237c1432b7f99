//! Perimeter and volume held, or driven to targets.

use geometry::zero_set::{least_perimeter, reduced_volume};
use geometry::{Grid, PhaseField, ZeroSet};
use serde::{Deserialize, Serialize};

use crate::constraints::names;
use crate::{Constraints, Error};

/// Balls that are measured are round to this part of their perimeter.
const ROUND: f64 = 1e-4;
/// Places on the way to targets where sizes are checked.
const PLACES: usize = 256;

/// A size that goes from one value to another over so many steps, evenly, and is held there. A step that is made shorter, or a substep, takes
/// it that part of the way.
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

    /// The value after so many steps, parts of them included.
    pub fn at(&self, steps: f64) -> f64 {
        if self.is_reached(steps) {
            return self.to;
        }
        self.from + (self.to - self.from) * steps / self.over as f64
    }

    fn is_reached(&self, steps: f64) -> bool {
        // Parts of steps add up to whole ones but for rounding.
        steps >= self.over as f64 - 1e-9
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

impl From<Constraints> for Held {
    /// These sizes from the next step on.
    fn from(constraints: Constraints) -> Self {
        let keep = |value: Option<f64>| value.map(Target::keep);
        Self {
            perimeter: keep(constraints.perimeter),
            volume: keep(constraints.volume),
        }
    }
}

impl Held {
    /// Keeps the perimeter of a phase field, and drives the volume over so many steps to that which has, with this perimeter, the
    /// [reduced volume](geometry::zero_set::reduced_volume) `target`.
    ///
    /// # Errors
    /// [`Error::ReducedVolume`] unless `target` is above 0 and at most 1, [`Error::Geometry`].
    pub fn at_reduced_volume<const D: usize>(
        u: &impl PhaseField<D>,
        eps: f64,
        target: f64,
        over: usize,
    ) -> Result<Self, Error> {
        let ZeroSet {
            perimeter, volume, ..
        } = ZeroSet::of(u, eps)?;
        let present = reduced_volume(D, perimeter, volume);
        if !(target > 0.0 && target <= 1.0) {
            return Err(Error::ReducedVolume { target, present });
        }
        Ok(Self {
            perimeter: Some(Target::keep(perimeter)),
            volume: Some(Target {
                from: volume,
                to: volume * target / present,
                over,
            }),
        })
    }

    /// Whether nothing is held.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The constraints after so many steps, parts of them included.
    pub fn at(&self, steps: f64) -> Constraints {
        let at = |target: Option<Target>| target.map(|target| target.at(steps));
        Constraints {
            perimeter: at(self.perimeter),
            volume: at(self.volume),
        }
    }

    /// The constraints in the end.
    pub fn targets(&self) -> Constraints {
        self.at(f64::INFINITY)
    }

    /// Refuses perimeter and volume of a ball together, or of another shape with the [least perimeter](least_perimeter) in the box, in the end or at the
    /// beginning: near such a shape both sizes change in proportion, so that nothing leads away from it. What no shape has is refused by [`crate::Problem::hold`].
    ///
    /// # Errors
    /// [`Error::LeastPerimeter`], [`Error::LeastStart`].
    pub fn check<const D: usize>(&self, grid: &Grid<D>) -> Result<(), Error> {
        let names = names::<D>();
        let least = |sizes: Constraints| match (sizes.perimeter, sizes.volume) {
            (Some(perimeter), Some(volume)) => {
                let is_least = perimeter < (1.0 + ROUND) * least_perimeter(grid, volume);
                is_least.then_some((perimeter, volume))
            }
            _ => None,
        };
        if let Some((perimeter, volume)) = least(self.targets()) {
            return Err(Error::LeastPerimeter {
                names,
                perimeter,
                volume,
            });
        }
        if let Some((perimeter, volume)) = least(self.at(0.0)) {
            return Err(Error::LeastStart {
                names,
                perimeter,
                volume,
            });
        }
        Ok(())
    }

    /// Refuses targets that no shape of interface width `eps` has in the box, and sizes on the way to them.
    ///
    /// # Errors
    /// As [`Constraints::check`] for the targets, [`Error::Way`] or [`Self::check`]'s for the way.
    pub(crate) fn check_way<const D: usize>(&self, grid: &Grid<D>, eps: f64) -> Result<(), Error> {
        let targets = self.targets();
        targets.check(grid, eps)?;
        let steps = self.steps();
        // The way is straight but where one of the two arrives, so that few places tell enough, however many steps it takes.
        let even = (1..PLACES).map(|place| steps as f64 * (place as f64 / PLACES as f64));
        let arrivals = self.perimeter.iter().chain(&self.volume);
        let mut places = even.chain(arrivals.map(|target| target.over as f64));
        places.try_for_each(|place| match self.at(place).check(grid, eps) {
            Err(Error::PerimeterTooSmall {
                names,
                perimeter,
                volume,
                ..
            }) => self.check(grid).and(Err(Error::Way {
                part: place / steps as f64,
                // What makes the shape less round comes first.
                first: names[usize::from(self.at(0.0).volume > targets.volume)],
                names,
                perimeter,
                volume,
            })),
            other => other,
        })
    }

    /// How many steps reach all targets.
    pub fn steps(&self) -> usize {
        let targets = self.perimeter.iter().chain(&self.volume);
        targets.map(|target| target.over).max().unwrap_or(0)
    }

    /// Whether so many steps reach all targets.
    pub fn is_reached(&self, steps: f64) -> bool {
        let mut targets = self.perimeter.iter().chain(&self.volume);
        targets.all(|target| target.is_reached(steps))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::shapes::{Ball, Capsule, Ellipse};
    use geometry::{Grid, SignedDistance, phase_field};

    #[test]
    fn a_target_is_reached_evenly_and_held() {
        let target = Target {
            from: 1.0,
            to: 2.0,
            over: 4,
        };
        let values = [1.0, 2.0, 2.5, 4.0, 9.0].map(|steps| target.at(steps));
        assert_eq!(
            values.map(f64::to_bits),
            [1.25, 1.5, 1.625, 2.0, 2.0].map(f64::to_bits)
        );
        assert_eq!(Target::keep(0.3).at(0.5).to_bits(), 0.3_f64.to_bits());
        assert!(Held::default().is_empty() && Held::default().targets().is_empty());
        let held = Held {
            perimeter: Some(Target::keep(1.0)),
            volume: Some(target),
        };
        assert!(!held.is_reached(3.5) && held.is_reached(4.0));
    }

    #[test]
    fn reduced_volumes_are_reached_with_the_perimeter_kept() {
        let grid = Grid::<2>::centred(64, 1.0).unwrap();
        let eps = 2.0 * grid.spacing();
        let u = phase_field(grid, &Ellipse::new([0.3, 0.2]).unwrap(), eps).unwrap();
        let end = Held::at_reduced_volume(&u, eps, 0.7, 5).unwrap().targets();
        let (perimeter, volume) = (end.perimeter.unwrap(), end.volume.unwrap());
        assert!((reduced_volume(2, perimeter, volume) - 0.7).abs() < 1e-12);
        for target in [0.0, -0.5, 1.01, f64::NAN] {
            let error = Held::at_reduced_volume(&u, eps, target, 5).unwrap_err();
            assert!(matches!(error, Error::ReducedVolume { .. }), "{error}");
        }
    }

    fn check_kept<const D: usize>(
        shape: &impl SignedDistance<D>,
        cells: usize,
    ) -> Result<(), Error> {
        let grid = Grid::<D>::centred(cells, 1.0).unwrap();
        let eps = 2.0 * grid.spacing();
        let u = phase_field(grid, shape, eps).unwrap();
        let ZeroSet {
            perimeter, volume, ..
        } = ZeroSet::of(&u, eps).unwrap();
        let held = Held {
            perimeter: Some(Target::keep(perimeter)),
            volume: Some(Target::keep(volume)),
        };
        held.check(&grid)
    }

    #[test]
    fn both_sizes_of_a_ball_are_not_held() {
        let (disc, ball) = (
            Ball::new([0.0; 2], 0.3).unwrap(),
            Ball::new([0.0; 3], 0.27).unwrap(),
        );
        for refused in [
            check_kept(&disc, 32),
            check_kept(&disc, 128),
            check_kept(&ball, 32),
            check_kept(&ball, 64),
        ] {
            let error = refused.unwrap_err();
            assert!(matches!(error, Error::LeastPerimeter { .. }), "{error}");
        }
        check_kept(&Ellipse::new([0.3, 0.28]).unwrap(), 64).unwrap();
        // Of a band through the box both can be held where it is wavy; a straight one has the least length.
        let grid = Grid::<2>::centred(32, 1.0).unwrap();
        let band = |length: f64| Held {
            perimeter: Some(Target::keep(length)),
            volume: Some(Target::keep(0.5)),
        };
        assert!(band(2.0).check(&grid).is_err());
        band(2.1).check(&grid).unwrap();
        // From a disc, nothing leads to another shape.
        let from_disc = Held::at_reduced_volume(
            &phase_field(grid, &disc, 2.0 * grid.spacing()).unwrap(),
            2.0 * grid.spacing(),
            0.8,
            20,
        );
        let error = from_disc.unwrap().check(&grid).unwrap_err();
        assert!(matches!(error, Error::LeastStart { .. }), "{error}");
        let rod = Capsule::new([-0.03, 0.0, 0.0], [0.03, 0.0, 0.0], 0.25).unwrap();
        check_kept(&rod, 32).unwrap();
    }
}

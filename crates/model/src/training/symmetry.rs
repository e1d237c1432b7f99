//! Kernels invariant under the symmetries of the grid: reflections and permutations of the axes.
//!
//! The dihedral group in 2D and the octahedral group in 3D leave 45, 153 and 561 free values of a kernel of width 17,
//! 33 and 65 in 2D, and 165 of one of width 17 in 3D.

use crate::ratios::offsets;

/// The orbits of kernel entries under the hyperoctahedral group.
#[derive(Clone, Debug)]
pub struct Orbits {
    /// Orbit of each kernel entry, row-major.
    pub index: Vec<usize>,
    /// Entries per orbit.
    pub sizes: Vec<usize>,
}

impl Orbits {
    /// Orbits of a `width^dimension` kernel.
    pub fn new(dimension: usize, width: usize) -> Self {
        let mut sizes = Vec::new();
        let mut seen = std::collections::HashMap::new();
        let index = offsets(dimension, width)
            .map(|offset| {
                let mut key: Vec<usize> = offset.into_iter().map(isize::unsigned_abs).collect();
                key.sort_unstable();
                let orbit = *seen.entry(key).or_insert_with(|| {
                    sizes.push(0);
                    sizes.len() - 1
                });
                sizes[orbit] += 1;
                orbit
            })
            .collect();
        Self { index, sizes }
    }

    /// Number of orbits.
    pub fn count(&self) -> usize {
        self.sizes.len()
    }

    /// The whole kernel from one value per orbit.
    pub fn expand(&self, values: &[f64]) -> Vec<f64> {
        self.index.iter().map(|&orbit| values[orbit]).collect()
    }

    /// Mean of a kernel over each orbit.
    pub fn average(&self, kernel: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.count()];
        for (&orbit, value) in self.index.iter().zip(kernel) {
            sums[orbit] += value;
        }
        sums.iter()
            .zip(&self.sizes)
            .map(|(sum, &size)| sum / size as f64)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orbit_counts_are_those_of_the_groups() {
        for (dimension, width, count) in [(2, 17, 45), (2, 33, 153), (2, 65, 561), (3, 17, 165)] {
            let orbits = Orbits::new(dimension, width);
            assert_eq!(orbits.count(), count);
            assert_eq!(
                orbits.sizes.iter().sum::<usize>(),
                width.pow(dimension as u32)
            );
        }
    }

    #[test]
    fn expansion_is_symmetric_and_averaging_inverts_it() {
        let orbits = Orbits::new(3, 5);
        let values: Vec<f64> = (0..orbits.count()).map(|i| i as f64).collect();
        let kernel = orbits.expand(&values);
        assert_eq!(orbits.average(&kernel), values);
        let at = |i: usize, j: usize, k: usize| kernel[(i * 5 + j) * 5 + k];
        for (i, j, k) in [(0, 1, 3), (4, 2, 2), (1, 1, 0)] {
            assert!((at(i, j, k) - at(k, i, j)).abs() < f64::EPSILON);
            assert!((at(i, j, k) - at(4 - i, j, k)).abs() < f64::EPSILON);
        }
    }
}

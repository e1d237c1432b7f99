//! Empty space around a surface: how far a ray may go without looking.

use rayon::prelude::*;

/// For every cell of a lattice the Chebyshev distance, in cells, to the nearest cell that is not
/// known to lie outside; at most 255.
pub(crate) struct Emptiness {
    size: usize,
    distance: Vec<u8>,
}

impl Emptiness {
    /// A cell `c` is known to lie outside if all values at nodes `c - before ..= c + after` in
    /// each axis are positive. Indices beyond the lattice are left out.
    pub fn new(values: &[f32], size: usize, before: usize, after: usize) -> Self {
        let inside: Vec<u8> = values.par_iter().map(|&v| u8::from(v <= 0.0)).collect();
        let spread = (0..3).fold(inside, |flags, axis| {
            spread(&flags, size, axis, before, after)
        });
        let mut distance: Vec<u8> = spread
            .into_iter()
            .map(|f| if f == 1 { 0 } else { 255 })
            .collect();
        chessboard(&mut distance, size);
        Self { size, distance }
    }

    /// 0 in cells that have to be looked at; where it is `k > 0`, all cells less than `k` away
    /// along every axis lie outside.
    pub fn at(&self, cell: [usize; 3]) -> u8 {
        self.distance[(cell[0] * self.size + cell[1]) * self.size + cell[2]]
    }

    /// Where the ray leaves the empty cube of half width `k` around a cell.
    pub fn exit(
        cell: [usize; 3],
        k: u8,
        origin: [f64; 3],
        direction: [f64; 3],
        inverse: [f64; 3],
    ) -> f64 {
        let k = f64::from(k);
        let mut exit = f64::INFINITY;
        for axis in 0..3 {
            let lower = cell[axis] as f64;
            let face = if direction[axis] < 0.0 {
                lower - k + 1.0
            } else {
                lower + k
            };
            exit = exit.min((face - origin[axis]) * inverse[axis]);
        }
        exit
    }
}

/// Maximum over the window `-before ..= after` along one axis.
fn spread(flags: &[u8], size: usize, axis: usize, before: usize, after: usize) -> Vec<u8> {
    let stride = size.pow(2 - axis as u32);
    (0..flags.len())
        .into_par_iter()
        .map(|at| {
            let i = at / stride % size;
            let low = at - before.min(i) * stride;
            let high = at + after.min(size - 1 - i) * stride;
            (low..=high)
                .step_by(stride)
                .map(|k| flags[k])
                .max()
                .unwrap_or(0)
        })
        .collect()
}

/// Chessboard distance to the nearest zero, by a forward and a backward pass, exact for this
/// metric (G. Borgefors: Distance transformations in digital images, 1986).
fn chessboard(distance: &mut [u8], size: usize) {
    // The thirteen neighbours that a raster scan meets before the node itself.
    let mut earlier = Vec::new();
    for k in 0..13_isize {
        let [a, b, c] = [k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1];
        earlier.push([a, b, c]);
    }
    let n = size as isize;
    let mut pass = |forward: bool| {
        let sign = if forward { 1 } else { -1 };
        for step in 0..distance.len() {
            let at = if forward {
                step
            } else {
                distance.len() - 1 - step
            };
            if distance[at] == 0 {
                continue;
            }
            let place = [at / size / size, at / size % size, at % size].map(|i| i as isize);
            let mut best = distance[at];
            for offset in &earlier {
                let inside = (0..3).all(|i| (0..n).contains(&(place[i] + sign * offset[i])));
                if inside {
                    let shift = sign * ((offset[0] * n + offset[1]) * n + offset[2]);
                    best = best.min(distance[at.wrapping_add_signed(shift)].saturating_add(1));
                }
            }
            distance[at] = best;
        }
    };
    pass(true);
    pass(false);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_the_chessboard() {
        const SIZE: usize = 9;
        let seeds = [[1, 2, 3], [7, 7, 1]];
        let mut values = vec![1.0; SIZE * SIZE * SIZE];
        for [i, j, k] in seeds {
            values[(i * SIZE + j) * SIZE + k] = -1.0;
        }
        let map = Emptiness::new(&values, SIZE, 0, 0);
        for index in 0..values.len() {
            let cell = [index / SIZE / SIZE, index / SIZE % SIZE, index % SIZE];
            let to = |seed: &[usize; 3]| (0..3).map(|a| cell[a].abs_diff(seed[a])).max().unwrap();
            let expected = seeds.iter().map(to).min().unwrap();
            assert_eq!(usize::from(map.at(cell)), expected, "{cell:?}");
        }
    }

    #[test]
    fn windows_reach_before_and_after() {
        const SIZE: usize = 8;
        let mut values = vec![1.0; SIZE * SIZE * SIZE];
        values[(4 * SIZE + 4) * SIZE + 4] = -1.0;
        // Cell c sees nodes c-1 ..= c+2: the inside node 4 is seen from the cells 2 ..= 5.
        let map = Emptiness::new(&values, SIZE, 1, 2);
        for i in 0..SIZE {
            assert_eq!(map.at([i, 4, 4]) == 0, (2..=5).contains(&i), "{i}");
        }
    }

    #[test]
    fn rays_leave_empty_cubes_at_their_faces() {
        let direction = [0.6, -0.8, 0.0];
        let inverse = [1.0 / 0.6, -1.0 / 0.8, 1e30];
        // The cube from 3 to 8 in x and y; the ray starts at 5.5.
        let exit = Emptiness::exit([5, 5, 5], 3, [5.5; 3], direction, inverse);
        assert!((exit - 2.5 / 0.8).abs() < 1e-12, "{exit}");
    }
}

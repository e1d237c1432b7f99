//! Functions of the plane `a . x` on a periodic box.

use faer::Col;

/// The planes of nodes with an integer normal `a` on a periodic box: plane `m` holds the nodes with `a . x = m` modulo the cells of a side.
pub(super) struct Planes {
    normal: Vec<isize>,
    cells: usize,
    /// The plane of every node, row-major.
    of_node: Vec<usize>,
}

impl Planes {
    /// For a normal without common factor, on a box of `cells` nodes along each axis.
    pub(super) fn new(normal: &[isize], cells: usize) -> Self {
        let nodes = cells.pow(normal.len() as u32);
        let of_node = (0..nodes).map(|node| index(normal, node, cells)).collect();
        Self {
            normal: normal.to_vec(),
            cells,
            of_node,
        }
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.cells
    }

    /// Distance of neighbours, in cells.
    pub(super) fn spacing(&self) -> f64 {
        1.0 / length(&self.normal)
    }

    /// A function of the plane on all nodes.
    pub(super) fn lifted(&self, w: &Col<f64>) -> Vec<f64> {
        self.of_node.iter().map(|&plane| w[plane]).collect()
    }

    /// The mean over every plane.
    pub(super) fn means(&self, values: &[f64]) -> Col<f64> {
        let mut sums = Col::<f64>::zeros(self.cells);
        for (value, &plane) in values.iter().zip(&self.of_node) {
            sums[plane] += value;
        }
        let share = self.cells as f64 / self.of_node.len() as f64;
        sums * faer::Scale(share)
    }

    /// Whether the nodes of the planes tell a wave from its shifts: the mean of its square is a half on each.
    pub(super) fn tell(&self, wave: &Wave) -> bool {
        let mut square = vec![1.0; self.of_node.len()];
        wave.multiply(&mut square);
        wave.multiply(&mut square);
        let means = self.means(&square);
        means.iter().all(|mean| (mean - 0.5).abs() < 1e-9)
    }

    /// Waves `cos(k . x)` along the planes, a few `k` in every one of `D - 1` directions at right angles.
    ///
    /// `width` is the length, in cells, over which the step looks along a plane: of the waves that fit the box those that are about ten times
    /// longer, or the longest ones.
    pub(super) fn waves(&self, width: f64) -> Vec<Waves> {
        const PHASE: f64 = 0.1;
        let directions = tangents(&self.normal).into_iter().map(|direction| {
            let least = std::f64::consts::TAU * length(&direction) / self.cells as f64;
            let first = (PHASE / (width * least)).floor().max(1.0) as isize;
            let wave = |times: isize| {
                let times = times * first;
                let direction: Vec<isize> = direction.iter().map(|d| d * times).collect();
                Wave {
                    square: (least * times as f64).powi(2),
                    direction,
                    cells: self.cells,
                }
            };
            Waves([1, 2, 3, 4].map(wave))
        });
        directions.collect()
    }
}

/// Waves in one direction, with one to four times the same wave number.
pub(super) struct Waves(pub(super) [Wave; 4]);

impl Waves {
    /// The weights of the limit `k -> 0` of even functions of `k` by their values at the waves: that of the polynomial in `k^2`.
    pub(super) const TO_ZERO: [f64; 4] = [8.0 / 5.0, -4.0 / 5.0, 8.0 / 35.0, -1.0 / 35.0];
}

/// `cos(k . x)`.
pub(super) struct Wave {
    /// `|k|^2`, in cells.
    pub(super) square: f64,
    direction: Vec<isize>,
    cells: usize,
}

impl Wave {
    /// Multiplies values on all nodes.
    pub(super) fn multiply(&self, values: &mut [f64]) {
        let angle = std::f64::consts::TAU / self.cells as f64;
        let table: Vec<f64> = (0..self.cells)
            .map(|phase| (angle * phase as f64).cos())
            .collect();
        for (node, value) in values.iter_mut().enumerate() {
            *value *= table[index(&self.direction, node, self.cells)];
        }
    }
}

/// `a . x` modulo the cells of a side, for the node with this row-major index.
fn index(a: &[isize], mut node: usize, cells: usize) -> usize {
    let mut sum = 0;
    for along in a.iter().rev() {
        sum += along * (node % cells).cast_signed();
        node /= cells;
    }
    sum.rem_euclid(cells.cast_signed()).cast_unsigned()
}

pub(super) fn length(a: &[isize]) -> f64 {
    (a.iter().map(|a| a * a).sum::<isize>() as f64).sqrt()
}

/// Integer vectors at right angles to a normal and to each other.
fn tangents(normal: &[isize]) -> Vec<Vec<isize>> {
    let [x, y] = [normal[0], normal[1]];
    let first = vec![-y, x];
    match normal.get(2) {
        None => vec![first],
        Some(&z) => {
            let second = [-x * z, -y * z, x * x + y * y];
            let divisor = second.iter().fold(0, |a, b| divisor(a, *b)).max(1);
            let second = second.iter().map(|b| b / divisor).collect();
            vec![[first, vec![0]].concat(), second]
        }
    }
}

/// The greatest common divisor.
fn divisor(a: isize, b: isize) -> isize {
    if b == 0 { a.abs() } else { divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::normals;

    #[test]
    fn waves_run_along_the_planes() {
        for dimension in [2, 3] {
            for (normal, _) in normals(dimension) {
                let tangents = tangents(normal);
                assert_eq!(tangents.len(), dimension - 1);
                let dot = |a: &[isize], b: &[isize]| -> isize {
                    a.iter().zip(b).map(|(a, b)| a * b).sum()
                };
                for (i, a) in tangents.iter().enumerate() {
                    assert_eq!(dot(a, normal), 0);
                    assert!(dot(a, a) > 0);
                    assert!(tangents[..i].iter().all(|b| dot(a, b) == 0));
                }
            }
        }
    }

    #[test]
    fn limits_of_polynomials_are_exact() {
        let even = |k: f64| 3.0 - k.powi(2) + 0.5 * k.powi(4) + 0.1 * k.powi(6);
        let values = [1.0, 2.0, 3.0, 4.0].map(even);
        let limit: f64 = values.iter().zip(Waves::TO_ZERO).map(|(v, w)| v * w).sum();
        assert!((limit - 3.0).abs() < 1e-12, "{limit}");
    }

    /// The mean of `cos^2` over every plane is a half, so that products with a wave can be read off.
    #[test]
    fn planes_see_whole_periods_of_the_waves() {
        for dimension in [2, 3] {
            for (normal, _) in normals(dimension) {
                let planes = Planes::new(normal, 53);
                for wave in planes.waves(4.0).iter().flat_map(|waves| &waves.0) {
                    assert!(planes.tell(wave));
                    let mut square = vec![1.0; planes.of_node.len()];
                    wave.multiply(&mut square);
                    assert!(planes.means(&square).iter().all(|mean| mean.abs() < 1e-12));
                    wave.multiply(&mut square);
                    let near = |mean: &f64| (mean - 0.5).abs() < 1e-12;
                    assert!(planes.means(&square).iter().all(near), "{normal:?}");
                }
            }
        }
        // On this box the longest wave along (3, 1) is as long as the distance of nodes on a plane.
        let planes = Planes::new(&[3, 1], 20);
        assert!(!planes.tell(&planes.waves(4.0)[0].0[0]));
    }

    #[test]
    fn functions_of_the_plane_survive_the_way_to_the_nodes_and_back() {
        let planes = Planes::new(&[2, 1], 20);
        let w = Col::from_fn(20, |m| (m as f64).sin());
        let back = planes.means(&planes.lifted(&w));
        assert!((back - w).norm_max() < 1e-14);
    }
}

//! Nested dissection by coordinates: an order of elimination with little fill for couplings between neighbours on a lattice.

/// Sets of this many are not divided.
const LEAF: usize = 24;

/// The order in which points of a periodic lattice of `cells` points per axis, each coupled with those of the 3 x .. x 3 around it, are
/// eliminated: both sides of a plane before what lies on it, and each side in the same way.
pub(crate) fn dissection<const D: usize>(places: &[[u32; D]], cells: u32) -> Vec<u32> {
    let mut order = Vec::with_capacity(places.len());
    let all: Vec<u32> = (0..places.len() as u32).collect();
    // Where something reaches around the box, the first plane comes last of all, so that nothing wraps around below.
    let around: [bool; D] = std::array::from_fn(|axis| {
        let on = |at: u32| places.iter().any(|place| place[axis] == at);
        on(0) && on(cells - 1)
    });
    let on_seam = |&&i: &&u32| (0..D).any(|axis| around[axis] && places[i as usize][axis] == 0);
    let (seam, inner): (Vec<&u32>, Vec<&u32>) = all.iter().partition(|i| on_seam(i));
    divide(inner.into_iter().copied().collect(), places, &mut order);
    divide(seam.into_iter().copied().collect(), places, &mut order);
    order
}

fn divide<const D: usize>(set: Vec<u32>, places: &[[u32; D]], order: &mut Vec<u32>) {
    match (set.len() > LEAF).then(|| plane(&set, places)).flatten() {
        Some((axis, at)) => {
            let side = |keep: fn(&u32, &u32) -> bool| -> Vec<u32> {
                let kept = set
                    .iter()
                    .filter(|&&i| keep(&places[i as usize][axis], &at));
                kept.copied().collect()
            };
            divide(side(u32::lt), places, order);
            divide(side(u32::gt), places, order);
            order.extend(side(u32::eq));
        }
        None => order.extend(set),
    }
}

/// The plane with the fewest points among those that leave a third of the set, at least, on either side; none if there is no such plane.
fn plane<const D: usize>(set: &[u32], places: &[[u32; D]]) -> Option<(usize, u32)> {
    let sorted = |axis: usize| {
        let mut along: Vec<u32> = set.iter().map(|&i| places[i as usize][axis]).collect();
        along.sort_unstable();
        along
    };
    let mut best: Option<(usize, usize, u32)> = None;
    for axis in 0..D {
        let along = sorted(axis);
        let mut below = 0;
        for points in along.chunk_by(u32::eq) {
            let above = along.len() - below - points.len();
            let fewest = best.is_none_or(|(count, ..)| points.len() < count);
            if below.min(above) * 3 >= set.len() - points.len() && below > 0 && fewest {
                best = Some((points.len(), axis, points[0]));
            }
            below += points.len();
        }
    }
    best.map(|(_, axis, at)| (axis, at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Entries of the factor of a sphere's lattice points in an order, by elimination of a graph.
    fn fill(places: &[[u32; 3]], cells: u32, order: &[u32]) -> usize {
        let near = |a: &[u32; 3], b: &[u32; 3]| {
            (0..3).all(|axis| {
                let gap = a[axis].abs_diff(b[axis]);
                gap.min(cells - gap) <= 1
            })
        };
        let n = places.len();
        let mut position = vec![0; n];
        for (p, &i) in order.iter().enumerate() {
            position[i as usize] = p;
        }
        let mut beyond: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); n];
        for i in 0..n {
            for j in 0..n {
                if position[j] > position[i] && near(&places[i], &places[j]) {
                    beyond[position[i]].insert(position[j]);
                }
            }
        }
        for p in 0..n {
            let mut rows = beyond[p].clone();
            if let Some(parent) = rows.pop_first() {
                beyond[parent].extend(rows);
            }
        }
        beyond.iter().map(|rows| 1 + rows.len()).sum()
    }

    /// The points near a sphere about `(centre, centre, centre)`, through the sides of the box.
    fn sphere(cells: u32, centre: u32, radius: f64) -> Vec<[u32; 3]> {
        let gap = |x: u32| f64::from(x.abs_diff(centre).min(cells - x.abs_diff(centre)));
        (0..cells.pow(3))
            .map(|i| [i / cells / cells, i / cells % cells, i % cells])
            .filter(|place| {
                let square: f64 = place.iter().map(|&x| gap(x).powi(2)).sum();
                (square.sqrt() - radius).abs() < 0.9
            })
            .collect()
    }

    #[test]
    fn little_is_filled_in_and_everything_has_its_turn() {
        // A sphere that reaches through the sides has circles there, which come last.
        for (centre, radius, part) in [(15, 7.0, 0.6), (15, 9.0, 0.6), (7, 10.0, 0.8)] {
            let places = sphere(30, centre, radius);
            let order = dissection(&places, 30);
            let mut all = order.clone();
            all.sort_unstable();
            assert!(all.iter().copied().eq(0..places.len() as u32));
            let natural: Vec<u32> = (0..places.len() as u32).collect();
            let (found, plain) = (fill(&places, 30, &order), fill(&places, 30, &natural));
            let count = places.len();
            println!("{count} points: {found} entries, {plain} in their own order");
            assert!((found as f64) < part * plain as f64, "{found} {plain}");
        }
    }
}

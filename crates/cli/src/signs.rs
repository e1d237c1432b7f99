//! Which side of a mesh that folds over itself.

use geometry::Field;

/// Makes the signs of a distance agree where no surface is between: two neighbouring nodes that are both further than half a cell
/// from the surface are on the same side. Noise folds the triangles of a scan, and where they are folded the sign of the
/// distance is that of the wrong sheet, along whole rays. What is joined to the side of the box is outside; of other parts
/// the majority decides. Returns how many signs were changed.
pub fn mend(distance: &mut Field<3>) -> usize {
    let grid = *distance.grid();
    let (cells, clear) = (grid.cells(), 0.5 * grid.spacing());
    let values = distance.values_mut();
    let mut seen: Vec<bool> = values.iter().map(|s| s.abs() <= clear).collect();
    let mut changed = 0;
    for start in 0..values.len() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let mut part = vec![start];
        let (mut next, mut inside, mut at_side) = (0, 0, false);
        while let Some(&node) = part.get(next) {
            next += 1;
            inside += usize::from(values[node] < 0.0);
            let index = grid.multi_index(node);
            for (axis, &i) in index.iter().enumerate() {
                let stride = grid.stride(axis);
                at_side |= i == 0 || i + 1 == cells;
                let below = (i > 0).then(|| node - stride);
                let above = (i + 1 < cells).then(|| node + stride);
                for neighbour in below.into_iter().chain(above) {
                    if !std::mem::replace(&mut seen[neighbour], true) {
                        part.push(neighbour);
                    }
                }
            }
        }
        let sign = if !at_side && 2 * inside > part.len() {
            -1.0
        } else {
            1.0
        };
        for node in part {
            changed += usize::from(values[node] * sign < 0.0);
            values[node] = values[node].abs() * sign;
        }
    }
    changed
}

#[cfg(test)]
mod tests {
    use geometry::shapes::Ball;
    use geometry::{Grid, SignedDistance};

    use super::*;

    #[test]
    fn wrong_signs_are_mended_and_right_ones_stay() {
        let ball = Ball::new([0.0; 3], 0.3).unwrap();
        let grid = Grid::<3>::centred(16, 1.0).unwrap();
        let right = Field::from_fn(grid, |x| ball.signed_distance(x));
        let mut mended = right.clone();
        assert_eq!(mend(&mut mended), 0);
        assert_eq!(mended, right);
        // A ray of wrong signs from the surface to the side of the box, and one to the centre.
        let wrong = Field::from_fn(grid, |x| {
            let s = ball.signed_distance(x);
            let on_ray = x[1].abs() < 0.01 && x[2].abs() < 0.01 && x[0] > -0.01;
            if on_ray && s.abs() > 0.05 { -s } else { s }
        });
        let mut mended = wrong.clone();
        assert!(mend(&mut mended) > 4);
        assert_eq!(mended, right);
    }
}

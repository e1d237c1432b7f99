//! Which side of a mesh that folds over itself a node is on.

use geometry::Field;

/// Makes the signs of a distance agree where no surface is between: two neighbouring nodes that are both further than half a cell
/// from the surface are on the same side. Noise folds the triangles of a scan, and where they are folded the sign of the
/// distance is that of the wrong sheet, along whole rays. What is joined to the side of the box is outside; of other parts
/// the majority decides. Returns how many signs were changed.
pub fn mend_signs(distance: &mut Field<3>) -> usize {
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
        let is_inside = !at_side && 2 * inside > part.len();
        let sign = if is_inside { -1.0 } else { 1.0 };
        for node in part {
            changed += usize::from(values[node] * sign < 0.0);
            values[node] = values[node].abs() * sign;
        }
    }
    changed
}

//! Curves where three labels or more meet.

use std::collections::BTreeMap;

use super::LabelMesh;

impl LabelMesh {
    /// How many faces every edge has, whose vertices are in ascending order.
    fn edges(&self) -> BTreeMap<[u32; 2], usize> {
        let mut edges = BTreeMap::new();
        for &[a, b, c] in &self.mesh.faces {
            for [p, q] in [[a, b], [b, c], [c, a]] {
                *edges.entry([p.min(q), p.max(q)]).or_default() += 1;
            }
        }
        edges
    }

    /// The edges where three labels or more meet, each with its vertices in ascending order.
    pub fn junctions(&self) -> Vec<[u32; 2]> {
        let edges = self.edges().into_iter();
        let meet = edges.filter(|(_, faces)| *faces > 2);
        meet.map(|(edge, _)| edge).collect()
    }

    /// For every vertex those that it moves with: its neighbours on its wall, or the two on its curve. Where curves meet or end there are none.
    pub(super) fn neighbours(&self) -> Vec<Vec<u32>> {
        let count = self.mesh.vertices.len();
        let (mut on_wall, mut on_curve) = (vec![Vec::new(); count], vec![Vec::new(); count]);
        for ([a, b], faces) in self.edges() {
            for (from, to) in [(a, b), (b, a)] {
                on_wall[from as usize].push(to);
                if faces > 2 {
                    on_curve[from as usize].push(to);
                }
            }
        }
        let both = on_wall.into_iter().zip(on_curve);
        both.map(|(on_wall, on_curve)| match on_curve.len() {
            0 => on_wall,
            2 => on_curve,
            _ => Vec::new(),
        })
        .collect()
    }
}

//! What the flow makes of a noisy mesh, beside what smooths less and what keeps edges.

use std::collections::BTreeMap;

use crate::edges::{Edges, KeptEdges, Sharpened, Sides};
use crate::risk::Judge;
use crate::smoothing::{TAUBIN, Umbrellas};
use crate::{ClosedMesh, TriangleMesh};

/// The flow leaves this part of the degrees of freedom that Taubin's smoothing before it has left: 0.6 to 0.99, measured on noisy meshes.
const FREEDOM: f64 = 0.75;
/// Rounds in which degrees of freedom and gains are averaged, some sixty neighbours,
const LOCAL: usize = 20;
/// and gains by sharp edges, twice as many.
const BESIDE_EDGES: usize = 40;
/// Rounds of Taubin's smoothing that smooth less than the flow does.
const LESS: [usize; 5] = [0, 1, 2, 4, 8];
/// From the first gain on, less smoothing has some part of the mesh, and from the second on all.
const GAIN_OF_LESS: [f64; 2] = [0.15, 0.3];
/// Rounds in which these parts become gradual.
const GRADUAL: usize = 2;
/// A part of a mesh is one with edges if its mean gain is more than this. Chosen between noisy machine parts and freely curved surfaces.
const CLEAR: f64 = 0.06;
/// Gains from which sharp edges have some part of the mesh and all of it, where the evidence is clear,
const GAIN_WHERE_CLEAR: [f64; 2] = [-0.1, 0.0];
/// and where it is not,
const GAIN_ELSEWHERE: [f64; 2] = [0.0, 0.1];
/// so many edges around sharp edges.
const NEAR: usize = 6;
/// Edges are kept where more than this part of the mesh is that with sharp edges.
const KEPT: f64 = 0.5;

/// What a smoothing has for a noisy mesh.
pub(crate) struct Noisy<'a> {
    pub(crate) rough: &'a ClosedMesh,
    pub(crate) noise: f64,
    /// Whether a vertex says something: those that stay do not.
    pub(crate) counts: &'a [bool],
    /// Rounds of Taubin's smoothing before the flow.
    pub(crate) rounds: usize,
    pub(crate) umbrellas: &'a Umbrellas,
}

/// How much is gained at each vertex if another smoothing takes the place of the flow: the difference of their risks, in units of the variance of the noise.
struct Gains<'a> {
    noisy: &'a Noisy<'a>,
    judge: Judge<'a>,
    /// The risk of the flow, but for a constant.
    of_flow: Vec<f64>,
    /// The degrees of freedom that less smoothing leaves, by its rounds.
    freedoms: BTreeMap<usize, Vec<f64>>,
}

/// A mesh that takes the place of another one, and which part it has at each vertex.
struct Selected {
    mesh: TriangleMesh,
    gains: Vec<f64>,
}

impl<'a> Gains<'a> {
    fn new(noisy: &'a Noisy<'a>, flowed: &TriangleMesh) -> Self {
        let judge = Judge::new(noisy.rough.mesh(), noisy.umbrellas, flowed, noisy.noise);
        let freedoms = judge.freedoms_of_taubin(LESS.into_iter().chain([noisy.rounds]));
        let freedom = judge.averaged(freedoms[&noisy.rounds].clone(), LOCAL);
        let residuals = judge.squared_residuals(flowed).into_iter();
        let of_flow = residuals.zip(freedom).map(|(r, df)| r + 2.0 * FREEDOM * df);
        Self {
            noisy,
            of_flow: of_flow.collect(),
            judge,
            freedoms,
        }
    }

    /// Of a smoothing that leaves these degrees of freedom; none where vertices say nothing.
    fn of(&self, smoothed: &TriangleMesh, freedom: &[f64]) -> Vec<f64> {
        let residuals = self.judge.squared_residuals(smoothed).into_iter();
        let risks = residuals.zip(freedom).map(|(r, df)| r + 2.0 * df);
        let pairs = risks.zip(&self.of_flow).zip(self.noisy.counts);
        let gains =
            pairs.map(|((risk, of_flow), counts)| if *counts { of_flow - risk } else { 0.0 });
        gains.collect()
    }

    /// The flow, and less smoothing where that is nearer: where the shape has details that are as small as the edges.
    fn with_less(&self, flowed: &TriangleMesh) -> Selected {
        let rough = self.noisy.rough.mesh();
        let (mut points, mut done) = (rough.points(), 0);
        let mut best = vec![f64::NEG_INFINITY; flowed.vertices.len()];
        let mut less = flowed.clone();
        for rounds in LESS {
            // The rounds go on from those before.
            (self.noisy.umbrellas).smooth(&mut points, rounds - done, TAUBIN);
            done = rounds;
            let smoothed = rough.on(&points);
            let gains = self.of(&smoothed, &self.freedoms[&rounds]);
            let gains = self.judge.averaged(gains, LOCAL).into_iter().enumerate();
            for (vertex, gain) in gains
                .filter(|(vertex, gain)| *gain > best[*vertex])
                .collect::<Vec<_>>()
            {
                best[vertex] = gain;
                less.vertices[vertex] = smoothed.vertices[vertex];
            }
        }
        let parts = best.iter().map(|gain| ramp(*gain, GAIN_OF_LESS)).collect();
        let parts = self.judge.averaged(parts, GRADUAL);
        let gains = parts
            .iter()
            .zip(best)
            .map(|(part, gain)| part * gain.max(0.0));
        Selected {
            gains: gains.collect(),
            mesh: blended(flowed, &less, &parts),
        }
    }

    /// Where a mesh with sharp edges is nearer, that one.
    fn with_edges(
        &self,
        sides: &Sides,
        selected: Selected,
        edges: Edges,
    ) -> (TriangleMesh, KeptEdges) {
        let rough = self.noisy.rough.mesh();
        let sharp = sides.sharpened(rough);
        if sharp.edges.is_empty() {
            return (selected.mesh, KeptEdges::default());
        }
        let freedom = self
            .judge
            .freedom_of(&sharp.mesh, |mesh| sides.sharpened(mesh).mesh);
        let gains = self.of(&sharp.mesh, &freedom);
        let local = self.judge.averaged(gains.clone(), BESIDE_EDGES);
        let less = |gains: Vec<f64>| -> Vec<f64> {
            let pairs = gains.into_iter().zip(&selected.gains);
            pairs.map(|(gain, of_less)| gain - of_less).collect()
        };
        let (gains, local) = (less(gains), less(local));
        let clear = self.clear(&sharp, &gains);
        let near = match edges {
            Edges::Keep => self.near(&sharp),
            _ => vec![0.0; local.len()],
        };
        let parts = local.iter().zip(&clear).zip(near);
        let parts: Vec<f64> = parts
            .map(|((gain, is_clear), near)| match is_clear {
                true => ramp(*gain, GAIN_WHERE_CLEAR),
                false => near * ramp(*gain, GAIN_ELSEWHERE),
            })
            .collect();
        let mesh = blended(&selected.mesh, &sharp.mesh, &parts);
        let kept = sharp.kept(&mesh, |vertex| parts[vertex as usize] > KEPT);
        // What has no sharp edges in the end stays as it was.
        let mesh = if kept.count == 0 { selected.mesh } else { mesh };
        (mesh, kept)
    }

    /// Whether each vertex is at a part of the mesh that clearly has sharp edges.
    fn clear(&self, sharp: &Sharpened, gains: &[f64]) -> Vec<bool> {
        let parts = self.noisy.rough.parts();
        let of_vertex = |vertex: usize| parts.of_vertices()[vertex] as usize;
        let mut has_edges = vec![false; parts.count()];
        for [vertex, _] in &sharp.edges {
            has_edges[of_vertex(*vertex as usize)] = true;
        }
        let (mut sums, mut counts) = (vec![0.0; parts.count()], vec![0.0; parts.count()]);
        let counted = (0..gains.len()).filter(|&vertex| self.noisy.counts[vertex]);
        for vertex in counted {
            sums[of_vertex(vertex)] += gains[vertex];
            counts[of_vertex(vertex)] += 1.0;
        }
        let is_clear = |part: usize| has_edges[part] && sums[part] > CLEAR * counts[part];
        (0..gains.len())
            .map(|vertex| is_clear(of_vertex(vertex)))
            .collect()
    }

    /// One near sharp edges, and zero far from them.
    fn near(&self, sharp: &Sharpened) -> Vec<f64> {
        let mut near = vec![false; self.noisy.counts.len()];
        for vertex in sharp.edges.as_flattened() {
            near[*vertex as usize] = true;
        }
        for _ in 0..NEAR {
            let before = near.clone();
            for face in &self.noisy.rough.mesh().faces {
                if face.iter().any(|&vertex| before[vertex as usize]) {
                    for &vertex in face {
                        near[vertex as usize] = true;
                    }
                }
            }
        }
        let near = near.into_iter().map(|near| if near { 1.0 } else { 0.0 });
        self.judge.averaged(near.collect(), GRADUAL)
    }
}

impl Noisy<'_> {
    /// What the flow has made of it, but with less smoothing or sharp edges where those are nearer to the mesh without noise.
    pub(crate) fn nearest(&self, flowed: &TriangleMesh, edges: Edges) -> (TriangleMesh, KeptEdges) {
        let gains = Gains::new(self, flowed);
        let selected = gains.with_less(flowed);
        match edges {
            Edges::Round => (selected.mesh, KeptEdges::default()),
            _ => gains.with_edges(&Sides::of(self.rough, self.umbrellas), selected, edges),
        }
    }
}

/// Zero up to the first of two values, one from the second on, and linear between them.
fn ramp(x: f64, [from, to]: [f64; 2]) -> f64 {
    ((x - from) / (to - from)).clamp(0.0, 1.0)
}

/// A mesh with parts of another one, which has the same faces.
fn blended(mesh: &TriangleMesh, other: &TriangleMesh, parts: &[f64]) -> TriangleMesh {
    let pairs = mesh.points().into_iter().zip(other.points());
    let offset: Vec<_> = pairs
        .zip(parts)
        .map(|((x, y), part)| *part * (y - x))
        .collect();
    mesh.moved_by(&offset)
}

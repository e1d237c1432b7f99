//! Sharp edges of noisy meshes.

use std::f64::consts::{PI, TAU};

use geometry::{Grid, Placement, optimal_profile};
use surfaces::{Edges, FairedMesh, Fairing, MeshDistance, TriangleMesh};

use crate::common::{closed, sphere, torus, with_noise};

/// Length of the edges, with a size of about 1.
const EDGE: f64 = 0.03;
/// Standard deviation of the noise.
const NOISE: f64 = 0.25 * EDGE;

/// A prism over a profile around the origin, with its points `EDGE` apart along the outline, and the vertices on its edges.
struct Prism {
    mesh: TriangleMesh,
    edges: Vec<usize>,
}

impl Prism {
    /// Of height 0.4. `corners` are those points of the profile at which its sides meet in edges.
    fn new(profile: &[[f64; 2]], corners: &[usize]) -> Self {
        let around = profile.len();
        let levels = (0.4 / EDGE).round() as usize;
        let mut mesh = TriangleMesh::default();
        for level in 0..=levels {
            let z = 0.4 * (level as f64 / levels as f64 - 0.5);
            (mesh.vertices).extend(profile.iter().map(|[x, y]| [*x, *y, z]));
        }
        let edges = (0..mesh.vertices.len())
            .filter(|v| v / around == 0 || v / around == levels || corners.contains(&(v % around)));
        let edges = edges.collect();
        let strip = |low: usize, high: usize| {
            (0..around).flat_map(move |i| {
                let j = (i + 1) % around;
                let [a, b, c, d] = [low + i, low + j, high + j, high + i].map(|v| v as u32);
                [[a, b, c], [a, c, d]]
            })
        };
        for level in 0..levels {
            mesh.faces
                .extend(strip(level * around, (level + 1) * around));
        }
        for (z, outer) in [(0.2, levels * around), (-0.2, 0)] {
            let mut faces = Vec::new();
            let mut rim: Vec<usize> = (outer..outer + around).collect();
            let rings = (0.35 / EDGE).round() as usize;
            for ring in (0..rings).rev() {
                let part = ring as f64 / rings as f64;
                let count = ((around as f64 * part).round() as usize).max(1);
                let first = mesh.vertices.len();
                let at = |k: usize| profile[(k * around) / count].map(|x| part * x);
                (mesh.vertices).extend((0..count).map(at).map(|[x, y]| [x, y, z]));
                let inner: Vec<usize> = (first..first + count).collect();
                faces.extend(between(&rim, &inner));
                rim = inner;
            }
            if z < 0.0 {
                for face in &mut faces {
                    face.swap(0, 1);
                }
            }
            mesh.faces.extend(faces);
        }
        Self { mesh, edges }
    }

    /// A disc as its profile.
    fn cylinder() -> Self {
        let count = (TAU * 0.4 / EDGE).round();
        let point = |i: usize| {
            [
                (i as f64 * TAU / count).cos(),
                (i as f64 * TAU / count).sin(),
            ]
        };
        let points: Vec<_> = (0..count as usize)
            .map(|i| point(i).map(|x| 0.4 * x))
            .collect();
        Self::new(&points, &[])
    }

    /// A square.
    fn block() -> Self {
        let count = (0.7 / EDGE).round() as usize;
        let along = |i: usize| 0.7 * (i as f64 / count as f64 - 0.5);
        let sides = (0..4 * count).map(|k| match (k / count, along(k % count)) {
            (0, t) => [0.35, t],
            (1, t) => [-t, 0.35],
            (2, t) => [-0.35, -t],
            (_, t) => [t, -0.35],
        });
        let corners: Vec<usize> = (0..4).map(|side| side * count).collect();
        Self::new(&sides.collect::<Vec<_>>(), &corners)
    }

    /// Half a disc that goes on smoothly as a square: flat and round sides.
    fn arch() -> Self {
        let (round, count) = (
            (PI * 0.35 / EDGE).round() as usize,
            (0.7 / EDGE).round() as usize,
        );
        let arc = (0..round).map(|k| {
            let angle = PI * (k as f64 / round as f64 - 0.5);
            [0.35 * angle.cos(), 0.35 * angle.sin()]
        });
        let half = count / 2;
        let part = |k: usize, of: usize| k as f64 / of as f64;
        let top = (0..half).map(|k| [-0.35 * part(k, half), 0.35]);
        let back = (0..count).map(|k| [-0.35, 0.35 - 0.7 * part(k, count)]);
        let bottom = (0..half).map(|k| [0.35 * (part(k, half) - 1.0), -0.35]);
        let corners = [round + half, round + half + count];
        Self::new(
            &arc.chain(top).chain(back).chain(bottom).collect::<Vec<_>>(),
            &corners,
        )
    }
}

/// The triangles between a closed line and one within it, which may be a point; both begin in the same direction.
fn between(outer: &[usize], inner: &[usize]) -> Vec<[u32; 3]> {
    let (mut faces, mut i, mut k) = (Vec::new(), 0, 0);
    let is_point = inner.len() == 1;
    while i < outer.len() || (k < inner.len() && !is_point) {
        let [a, b] = [(i, outer), (k, inner)].map(|(n, line)| line[n % line.len()]);
        let is_outer = is_point || (i + 1) * inner.len() <= (k + 1) * outer.len();
        let next = if is_outer && i < outer.len() {
            i += 1;
            outer[i % outer.len()]
        } else {
            k += 1;
            inner[k % inner.len()]
        };
        faces.push([a, next, b].map(|v| v as u32));
    }
    faces
}

/// What becomes of noise on a clean mesh, with these rules for edges. No time of the flow is made.
fn faired<const N: usize>(clean: &TriangleMesh, rules: [Edges; N]) -> [FairedMesh; N] {
    let noisy = with_noise(clean, NOISE);
    let fairing = Fairing::new(closed(noisy.clone()), noisy.noise().deviation, |_| false);
    let grid = Grid::<3>::centred(64, 1.2).unwrap();
    let eps = 2.0 * grid.spacing();
    let placement = Placement::about([0.0; 3], 1.0).unwrap();
    let distance = MeshDistance::new(&fairing.start);
    let distance = distance.sample(grid, &|| ()).unwrap();
    let start = distance.map(|s| optimal_profile(s, eps));
    let followed = fairing.follow(placement, &start, eps).unwrap();
    rules.map(|edges| {
        let fairing = fairing.clone().with_edges(edges);
        fairing.faired(&followed, &start).unwrap()
    })
}

/// Root of the mean square distance of some vertices to a clean mesh, in standard deviations of the noise.
fn far(mesh: &TriangleMesh, vertices: &[usize], clean: &TriangleMesh) -> f64 {
    let places: Vec<_> = vertices.iter().map(|&v| mesh.vertices[v]).collect();
    let distances = MeshDistance::new(&closed(clean.clone())).signed_distances(&places);
    let squares = distances.iter().map(|far| far * far).sum::<f64>();
    (squares / places.len() as f64).sqrt() / NOISE
}

#[test]
fn edges_of_exact_shapes_stay_sharp_in_noise() {
    for prism in [Prism::block(), Prism::cylinder(), Prism::arch()] {
        let rules = [Edges::Auto, Edges::Keep, Edges::Round];
        let [auto, keep, round] = faired(&prism.mesh, rules);
        let distance = |faired: &FairedMesh| far(&faired.mesh, &prism.edges, &prism.mesh);
        let [of_auto, of_round] = [&auto, &round].map(distance);
        assert!(of_auto < 0.4, "{of_auto}");
        assert!(of_auto < 0.5 * of_round, "{of_auto}, round {of_round}");
        let all: Vec<usize> = (0..prism.mesh.vertices.len()).collect();
        let of_all = [&auto, &round].map(|faired| far(&faired.mesh, &all, &prism.mesh));
        assert!(of_all[0] < 0.8 * of_all[1], "{of_all:?}");
        // The edges of the mesh on edges of the shape, but for a few.
        let found = auto.edges.count as f64 / prism.edges.len() as f64;
        assert!((0.85..1.15).contains(&found), "{found}");
        let length = EDGE * auto.edges.count as f64;
        assert!((auto.edges.length / length - 1.0).abs() < 0.1);
        assert_eq!((round.edges.count, round.edges.length), (0, 0.0));
        // The evidence is clear anyway.
        assert_eq!(auto.mesh, keep.mesh);
    }
}

#[test]
fn round_shapes_have_no_edges() {
    for clean in [sphere([0.0; 3], 0.4, 4), torus(0.35, 0.12, 70, 24)] {
        let [auto, round] = faired(&clean, [Edges::Auto, Edges::Round]);
        assert_eq!(auto.edges.count, 0);
        assert_eq!(auto.mesh, round.mesh);
    }
}

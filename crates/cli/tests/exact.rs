//! Exact shapes, which have no noise.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use surfaces::TriangleMesh;

use crate::common::{run, text};

/// A closed outline turned around the z axis: its points are distances from the axis and heights, counter-clockwise, and none is on the axis.
fn turned(outline: &[[f64; 2]], around: u32) -> TriangleMesh {
    let count = outline.len() as u32;
    let mut mesh = TriangleMesh::default();
    for i in 0..around {
        let angle = TAU * f64::from(i) / f64::from(around);
        let ring = outline
            .iter()
            .map(|[r, z]| [r * angle.cos(), r * angle.sin(), *z]);
        mesh.vertices.extend(ring);
        for j in 0..count {
            let at = |i: u32, j: u32| i % around * count + j % count;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// A polygon with more points on its sides.
fn refined(corners: &[[f64; 2]], pieces: u32) -> Vec<[f64; 2]> {
    let sides = (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]]);
    let points = sides.flat_map(|[a, b]| {
        (0..pieces).map(move |k| {
            let part = f64::from(k) / f64::from(pieces);
            [0, 1].map(|i| a[i] + part * (b[i] - a[i]))
        })
    });
    points.collect()
}

fn circle(centre: f64, radius: f64, count: u32) -> Vec<[f64; 2]> {
    let angles = (0..count).map(|i| TAU * f64::from(i) / f64::from(count));
    let points = angles.map(|angle| [centre + radius * angle.cos(), radius * angle.sin()]);
    points.collect()
}

/// A block whose top is cut to a roof.
fn block() -> TriangleMesh {
    let vertices = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2].map(f64::from));
    let mut vertices: Vec<[f64; 3]> = vertices.map(|[x, y, z]| [2.0 * x, y, z]).collect();
    vertices[4][2] = 1.5;
    vertices[6][2] = 1.5;
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    TriangleMesh {
        vertices,
        faces: (sides.into_iter())
            .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
        normals: None,
    }
}

/// Every face as four: with corners that stay and new vertices in the middles of edges, or where C. Loop (1987) has both.
fn subdivided(mesh: &TriangleMesh, is_smooth: bool) -> TriangleMesh {
    let place = |v: u32| mesh.vertices[v as usize];
    let mut across: HashMap<[u32; 2], Vec<u32>> = HashMap::new();
    let mut beside: HashMap<u32, Vec<u32>> = HashMap::new();
    for &[a, b, c] in &mesh.faces {
        for [p, q, other] in [[a, b, c], [b, c, a], [c, a, b]] {
            across.entry([p.min(q), p.max(q)]).or_default().push(other);
            beside.entry(p).or_default().push(q);
        }
    }
    let mean = |weights: &[(f64, u32)]| {
        [0, 1, 2].map(|i| weights.iter().map(|(w, v)| w * place(*v)[i]).sum::<f64>())
    };
    let mut fine = TriangleMesh {
        vertices: mesh.vertices.clone(),
        ..TriangleMesh::default()
    };
    if is_smooth {
        for (&v, near) in &beside {
            let count = near.len() as f64;
            let beta = (0.625 - (0.375 + 0.25 * (TAU / count).cos()).powi(2)) / count;
            let mut weights: Vec<(f64, u32)> = near.iter().map(|&w| (beta, w)).collect();
            weights.push((1.0 - count * beta, v));
            fine.vertices[v as usize] = mean(&weights);
        }
    }
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    for &[a, b, c] in &mesh.faces {
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[p, q]| {
            let edge = [p.min(q), p.max(q)];
            *middles.entry(edge).or_insert_with(|| {
                let [c, d] = [0, 1].map(|i| across[&edge][i]);
                let [ends, sides] = if is_smooth {
                    [0.375, 0.125]
                } else {
                    [0.5, 0.0]
                };
                fine.vertices
                    .push(mean(&[(ends, p), (ends, q), (sides, c), (sides, d)]));
                fine.vertices.len() as u32 - 1
            })
        });
        fine.faces
            .extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    fine
}

fn times(count: usize, mesh: TriangleMesh, is_smooth: bool) -> TriangleMesh {
    (0..count).fold(mesh, |mesh, _| subdivided(&mesh, is_smooth))
}

/// Each moves by less than .05 % of its size at defaults, or is left as it is, since no noise was found.
#[test]
fn exact_shapes_hardly_move() {
    let folder = tempfile::tempdir().unwrap();
    let washer = [[0.6, -0.2], [1.0, -0.2], [1.0, 0.2], [0.6, 0.2]];
    let pulley = [[0.3, -0.5], [1.0, -0.5], [0.7, 0.0], [1.0, 0.5], [0.3, 0.5]];
    let half = (1..24).map(|i| PI * f64::from(i) / 24.0 - PI / 2.0);
    let ball: Vec<[f64; 2]> = half.map(|angle| [angle.cos(), angle.sin()]).collect();
    let shapes = [
        ("ball_with_a_pore", turned(&ball, 48)),
        ("coarse_torus", turned(&circle(1.0, 0.4, 16), 32)),
        ("torus", turned(&circle(1.0, 0.4, 40), 100)),
        ("thin_torus", turned(&circle(1.0, 0.15, 16), 90)),
        ("washer", turned(&washer, 60)),
        ("fine_washer", turned(&refined(&washer, 8), 60)),
        ("pulley", turned(&refined(&pulley, 10), 72)),
        ("block", block()),
        ("fine_block", times(4, block(), false)),
        ("smooth_block", times(4, block(), true)),
    ];
    for (name, mesh) in shapes {
        let file = format!("{name}.ply");
        surfaces::write(folder.path().join(&file), &mesh).unwrap();
        let size = mesh.bounding_box().unwrap().longest_side();
        let saved = format!("{name}_faired.ply");
        let output = run(
            folder.path(),
            &["fair", &file, "--save", &saved, "--no-page"],
        );
        let said = text(&output.stderr);
        if !output.status.success() {
            assert_eq!(output.status.code(), Some(2), "{name}: {said}");
            assert!(
                said.contains("no noise was found")
                    || said.contains("no noise that could be estimated"),
                "{name}: {said}"
            );
            continue;
        }
        let faired = surfaces::read(folder.path().join(&saved)).unwrap();
        let ways = mesh.vertices.iter().zip(&faired.vertices);
        let ways = ways.map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>());
        let farthest = ways.fold(0.0, f64::max).sqrt();
        println!("{name} moved by {:.1e} of its size", farthest / size);
        assert!(farthest <= 5e-4 * size, "{name}: {}", farthest / size);
    }
}

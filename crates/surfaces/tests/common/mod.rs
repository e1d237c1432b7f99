//! Meshes for the tests.
#![allow(clippy::float_cmp, reason = "equal vertices are computed alike")]

pub mod files;

use chacha20::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use surfaces::{ClosedMesh, TriangleMesh};

pub type Vector = [f64; 3];

pub fn minus(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| a[i] - b[i])
}

pub fn cross(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    })
}

pub fn dot(a: Vector, b: Vector) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

pub fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

pub fn unit(a: Vector) -> Vector {
    a.map(|x| x / length(a))
}

pub fn cube(half: f64) -> TriangleMesh {
    let vertices =
        (0..8).map(|bits| [2, 1, 0].map(|axis| if bits >> axis & 1 == 1 { half } else { -half }));
    let quads = [
        [0, 1, 3, 2],
        [4, 6, 7, 5],
        [0, 4, 5, 1],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 5, 7, 3],
    ];
    TriangleMesh {
        vertices: vertices.collect(),
        faces: quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
        normals: None,
    }
}

/// A torus about the third axis with `n` by `m` vertices.
pub fn torus(major: f64, minor: f64, n: u32, m: u32) -> TriangleMesh {
    let turn = |i: u32, n: u32| f64::from(i) / f64::from(n) * std::f64::consts::TAU;
    let vertices = (0..n * m).map(|index| {
        let (a, b) = (turn(index / m, n), turn(index % m, m));
        let ring = major + minor * b.cos();
        [ring * a.cos(), ring * a.sin(), minor * b.sin()]
    });
    let faces = (0..n * m).flat_map(|index| {
        let (i, j) = (index / m, index % m);
        let at = |i: u32, j: u32| (i % n) * m + j % m;
        let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[p, q, r], [p, r, s]]
    });
    TriangleMesh {
        vertices: vertices.collect(),
        faces: faces.collect(),
        normals: None,
    }
}

/// A sphere as an octahedron, subdivided.
pub fn sphere(centre: [f64; 3], radius: f64, levels: usize) -> TriangleMesh {
    let mut corners: Vec<[[f64; 3]; 3]> = (0..8)
        .map(|octant| {
            let sign = |axis: u32| if octant >> axis & 1 == 1 { -1.0 } else { 1.0 };
            let [x, y, z] = [
                [sign(0), 0.0, 0.0],
                [0.0, sign(1), 0.0],
                [0.0, 0.0, sign(2)],
            ];
            if sign(0) * sign(1) * sign(2) > 0.0 {
                [x, y, z]
            } else {
                [x, z, y]
            }
        })
        .collect();
    for _ in 0..levels {
        corners = corners
            .into_iter()
            .flat_map(|[a, b, c]| {
                let [ab, bc, ca] = [[a, b], [b, c], [c, a]]
                    .map(|[p, q]| unit(std::array::from_fn(|i| p[i] + q[i])));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let mut mesh = TriangleMesh::default();
    for triangle in corners {
        let face = triangle.map(|x| {
            let x: [f64; 3] = std::array::from_fn(|i| centre[i] + radius * x[i]);
            let known = mesh.vertices.iter().position(|v| *v == x);
            known.unwrap_or_else(|| {
                mesh.vertices.push(x);
                mesh.vertices.len() - 1
            }) as u32
        });
        mesh.faces.push(face);
    }
    mesh
}

pub fn reversed(mut mesh: TriangleMesh) -> TriangleMesh {
    for face in &mut mesh.faces {
        face.swap(0, 1);
    }
    mesh
}

pub fn translated(mut mesh: TriangleMesh, shift: [f64; 3]) -> TriangleMesh {
    for x in &mut mesh.vertices {
        *x = std::array::from_fn(|i| x[i] + shift[i]);
    }
    mesh
}

/// Both, as separate components.
pub fn together(mut a: TriangleMesh, b: &TriangleMesh) -> TriangleMesh {
    let offset = a.vertices.len() as u32;
    a.vertices.extend(&b.vertices);
    a.faces
        .extend(b.faces.iter().map(|f| f.map(|v| v + offset)));
    a.normals = None;
    a
}

/// The mesh as a closed one, which must need no mending.
#[track_caller]
pub fn closed(mesh: TriangleMesh) -> ClosedMesh {
    let (closed, warnings) = ClosedMesh::new(mesh).unwrap();
    assert_eq!(warnings, []);
    closed
}

/// Euler characteristic, components and genus.
pub fn topology(mesh: &ClosedMesh) -> (i64, usize, i64) {
    (mesh.euler_characteristic(), mesh.components(), mesh.genus())
}

/// Reproducible numbers in `[0, 1)` (Knuth's linear congruential generator).
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// In a box.
    pub fn point(&mut self, min: [f64; 3], max: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| min[i] + (max[i] - min[i]) * self.next())
    }
}

/// A random smooth function.
pub fn waves(seed: u64) -> impl Fn(Vector) -> f64 + Sync {
    let mut numbers = Numbers(seed);
    let waves: Vec<(Vector, f64, f64)> = (0..6)
        .map(|_| {
            (
                numbers.point([-9.0; 3], [9.0; 3]),
                6.3 * numbers.next(),
                numbers.next(),
            )
        })
        .collect();
    move |x| {
        let wave =
            |(k, phase, amplitude): &(Vector, f64, f64)| amplitude * (dot(*k, x) + phase).sin();
        waves.iter().map(wave).sum()
    }
}

/// The value rounded to multiples of `1 / levels`; unchanged for 0.
pub fn rounded(value: f64, levels: f64) -> f64 {
    if levels > 0.0 {
        (value * levels).round() / levels
    } else {
        value
    }
}

/// Normally distributed noise of this standard deviation along the normals.
pub fn with_noise(mesh: &TriangleMesh, deviation: f64) -> TriangleMesh {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut noisy = mesh.clone();
    for (x, normal) in noisy.vertices.iter_mut().zip(mesh.vertex_normals()) {
        let sum: f64 = (0..12).map(|_| rng.random::<f64>()).sum();
        *x = std::array::from_fn(|i| x[i] + deviation * (sum - 6.0) * normal[i]);
    }
    noisy
}

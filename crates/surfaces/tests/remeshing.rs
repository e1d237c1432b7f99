//! Meshes of well-shaped triangles: angles, topology, accuracy, time.

use std::time::Instant;

use geometry::shapes::{Ball, RoundedBox, Torus};
use geometry::{Field, Grid, SignedDistance, SignedDistanceExt, optimal_profile, phase_field};
use surfaces::{
    ClosedMesh, MeshDistance, TriangleMesh, isosurface, phase_field_surface, remeshed_surface,
    samples,
};

type Vector = [f64; 3];
fn minus(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| a[i] - b[i])
}
fn dot(a: Vector, b: Vector) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}
fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

fn angles(mesh: &TriangleMesh, face: [u32; 3]) -> [f64; 3] {
    let x = face.map(|v| mesh.vertices[v as usize]);
    std::array::from_fn(|i| {
        let (a, b) = (minus(x[(i + 1) % 3], x[i]), minus(x[(i + 2) % 3], x[i]));
        (dot(a, b) / (length(a) * length(b)))
            .clamp(-1.0, 1.0)
            .acos()
            .to_degrees()
    })
}

fn report(name: &str, n: usize, h: f64, mesh: &TriangleMesh, seconds: f64) {
    let mut smallest: Vec<f64> = mesh
        .faces
        .iter()
        .map(|&f| angles(mesh, f).into_iter().fold(180.0, f64::min))
        .collect();
    smallest.sort_by(f64::total_cmp);
    let part = |limit: f64| {
        100.0 * smallest.iter().filter(|&&a| a < limit).count() as f64 / smallest.len() as f64
    };
    let shortest = mesh
        .faces
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|e| {
            let [a, b] = e.map(|v| mesh.vertices[v as usize]);
            length(minus(a, b)) / h
        })
        .fold(9.0, f64::min);
    println!(
        "{name:>10} {n:4} faces {:7} min {:6.2} <10 {:6.2}% <15 {:6.3}% <25 {:6.3}% <30 {:6.2}% shortest {shortest:.3} time {seconds:.3}",
        mesh.faces.len(),
        smallest[0],
        part(10.0),
        part(15.0),
        part(25.0),
        part(30.0)
    );
}

#[test]
fn explore() {
    let ns = std::env::var("NS").unwrap_or("32,64,128".into());
    for n in ns.split(',').map(|n| n.parse().unwrap()) {
        let grid = Grid::<3>::centred(n, 1.0).unwrap();
        let h = grid.spacing();
        let eps = 2.0 * h;
        let shift = [0.311 * h, -0.127 * h, 0.473 * h];
        let ball = Ball::new([0.0; 3], 0.3).unwrap().translated(shift);
        let torus = Torus::new(0.27, 0.1).unwrap().translated(shift);
        let cube = RoundedBox::new([0.25; 3], 0.06).unwrap().translated(shift);
        let figure = MeshDistance::new(&samples::figure(96).unwrap())
            .sample(grid, || ())
            .unwrap()
            .map(|s| optimal_profile(s, eps));
        let lever = MeshDistance::new(&samples::lever(96).unwrap())
            .sample(grid, || ())
            .unwrap()
            .map(|s| optimal_profile(s, eps));
        let list = [
            ("ball", phase_field(grid, &ball, eps).unwrap()),
            ("torus", phase_field(grid, &torus, eps).unwrap()),
            ("cube", phase_field(grid, &cube, eps).unwrap()),
            ("figure", figure),
            ("lever", lever),
        ];
        for (name, u) in list {
            let start = Instant::now();
            let before = phase_field_surface(&u, eps).unwrap();
            report(name, n, h, &before, start.elapsed().as_secs_f64());
            let start = Instant::now();
            let after = remeshed_surface(&u, eps).unwrap();
            report("", n, h, &after, start.elapsed().as_secs_f64());
            let (before, _) = ClosedMesh::new(before).unwrap();
            let (after, warnings) = ClosedMesh::new(after).unwrap();
            assert_eq!(warnings, []);
            println!(
                "           area {:.6} {:.6} volume {:.6} {:.6} euler {} {} components {} {}",
                before.area(),
                after.area(),
                before.volume(),
                after.volume(),
                before.euler_characteristic(),
                after.euler_characteristic(),
                before.components(),
                after.components()
            );
        }
    }
}

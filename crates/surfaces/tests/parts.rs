//! Parts of surfaces, and volumes near every place.

use geometry::shapes::Ball;
use geometry::{Field, Grid, SignedDistance, SignedDistanceExt};
use surfaces::{Cells, ClosedMesh, Filling, TriangleMesh, isosurface};

/// Two balls, the first with a cavity, in a box of side 2.
const BALLS: [([f64; 3], f64, f64); 3] = [
    ([-0.4, 0.03, 0.01], 0.35, 1.0),
    ([-0.4, 0.03, 0.01], 0.15, -1.0),
    ([0.45, -0.02, 0.04], 0.2, 1.0),
];

fn ball(radius: f64) -> f64 {
    4.0 / 3.0 * std::f64::consts::PI * radius.powi(3)
}

fn balls() -> ClosedMesh {
    let grid = Grid::<3>::centred(48, 2.0).unwrap();
    let [whole, cavity, other] =
        BALLS.map(|(centre, radius, _)| Ball::new(centre, radius).unwrap());
    let shape = whole.difference(cavity).union(other);
    let distance = Field::from_fn(grid, |x| shape.signed_distance(x));
    ClosedMesh::new(isosurface(&distance).unwrap()).unwrap().0
}

/// The volume and centre of each part in the order of [`BALLS`].
fn measured(surface: &ClosedMesh, mesh: &TriangleMesh) -> Vec<(f64, [f64; 3])> {
    let parts = surface.parts();
    let volumes = parts.volumes(mesh);
    let centres = parts.centroids(mesh);
    let found = |&(centre, _, sign): &([f64; 3], f64, f64)| {
        let near = |part: &usize| {
            let square = |i: usize| (centres[*part][i] - centre[i]).powi(2);
            (0..3).map(square).sum::<f64>() < 0.0025 && sign * volumes[*part] > 0.0
        };
        let part = (0..parts.count()).find(near).unwrap();
        (volumes[part], centres[part])
    };
    BALLS.iter().map(found).collect()
}

#[test]
fn parts_are_measured_apart_and_take_on_their_volumes() {
    let surface = balls();
    let mesh = surface.mesh();
    assert_eq!(surface.parts().count(), 3);
    for ((volume, _), (_, radius, sign)) in measured(&surface, mesh).into_iter().zip(BALLS) {
        // Triangles are chords of the balls.
        let off = sign * volume / ball(radius) - 1.0;
        assert!((0.002..0.03).contains(&off.abs()), "{radius}: {off}");
    }
    let parts = surface.parts();
    let volumes: Vec<f64> = parts.volumes(mesh).iter().map(|v| 1.05 * v).collect();
    let moved = mesh.with_volumes(&parts, &volumes);
    for (found, wanted) in parts.volumes(&moved).iter().zip(&volumes) {
        assert!((found / wanted - 1.0).abs() < 1e-12, "{found} {wanted}");
    }
    // The parts alone.
    let walls: Vec<bool> = parts
        .volumes(mesh)
        .iter()
        .map(|&volume| volume < 0.0)
        .collect();
    let (solid, _) = ClosedMesh::new(parts.only(mesh, |part| !walls[part])).unwrap();
    assert_eq!((solid.components(), solid.euler_characteristic()), (2, 4));
    let all: f64 = (parts.volumes(mesh).iter())
        .filter(|volume| **volume > 0.0)
        .sum();
    assert!((solid.volume() / all - 1.0).abs() < 1e-12);
}

/// The cells of a lattice that is neither orthogonal nor right-handed.
fn cells() -> Cells {
    let side = 0.05;
    let sides = [
        [side, 0.0, 0.0],
        [0.3 * side, 1.1 * side, 0.0],
        [0.0, 0.2 * side, -side],
    ];
    Cells::new([0.013, 0.0, 0.0], sides)
}

/// What waves take off one side of a surface, and only the total gives back, each place gets back.
#[test]
fn places_take_on_their_volumes() {
    let surface = balls();
    let (parts, mesh) = (surface.parts(), surface.mesh());
    let normals = mesh.vertex_normals();
    let mut bent = mesh.clone();
    for (x, normal) in bent.vertices.iter_mut().zip(&normals) {
        // A short wave, and a long one: the first ball goes by this much to the left.
        let short = 0.01 * (40.0 * x[1]).sin();
        let way = 0.03 * normal[0] + short;
        *x = [0, 1, 2].map(|i| x[i] + way * normal[i]);
    }
    let filling = Filling::of(mesh, cells()).unwrap();
    let back = bent
        .with_filling(&filling, 0.1)
        .with_volumes(&parts, &parts.volumes(mesh));
    let [before, gone, back] = [mesh, &bent, &back].map(|mesh| measured(&surface, mesh)[0]);
    let shift = |found: (f64, [f64; 3])| found.1[0] - before.1[0];
    assert!(shift(gone) > 0.015, "{}", shift(gone));
    assert!(shift(back).abs() < 0.002, "{}", shift(back));
    // Nothing is missing where nothing has moved.
    let still = mesh.with_filling(&filling, 0.1);
    let pairs = still
        .vertices
        .as_flattened()
        .iter()
        .zip(mesh.vertices.as_flattened());
    assert!(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-9);
    // Cells that are far too small.
    let small = Cells::new(
        [0.0; 3],
        [[1e-9, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    );
    assert!(Filling::of(mesh, small).is_none());
}

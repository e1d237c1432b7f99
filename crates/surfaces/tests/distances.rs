//! The distance to a mesh against all its triangles, one by one.

#![allow(clippy::float_cmp, reason = "where equality is asserted, it is exact")]

use std::path::PathBuf;
use std::sync::Arc;

use crate::common::{
    Numbers, Vector, closed, cross, cube, dot, length, minus, reversed, sphere, together, torus,
    translated,
};
use geometry::shapes::{self, Ball};
use geometry::{Bricks, Field, Grid, Nodes, PhaseField, Placement, SignedDistance, Stored};
use surfaces::{ClosedMesh, MeshDistance, hausdorff_distance, mend_signs, samples};

/// Distance to a segment.
fn to_segment(x: Vector, [a, b]: [Vector; 2]) -> f64 {
    let (ab, ax) = (minus(b, a), minus(x, a));
    let along = (dot(ax, ab) / dot(ab, ab)).clamp(0.0, 1.0);
    length(std::array::from_fn(|i| ax[i] - along * ab[i]))
}

/// Distance to a triangle: to its plane over the inside, else to the nearest side.
fn to_triangle(x: Vector, [a, b, c]: [Vector; 3]) -> f64 {
    let normal = cross(minus(b, a), minus(c, a));
    let sides = [[a, b], [b, c], [c, a]];
    if sides
        .iter()
        .all(|&[p, q]| dot(cross(minus(q, p), minus(x, p)), normal) >= 0.0)
    {
        dot(minus(x, a), normal).abs() / length(normal)
    } else {
        sides
            .into_iter()
            .map(|s| to_segment(x, s))
            .fold(f64::INFINITY, f64::min)
    }
}

/// Solid angle over `4 pi`, summed: 1 inside, 0 outside.
fn winding_number(x: Vector, triangles: &[[Vector; 3]]) -> f64 {
    let angle = |triangle: &[Vector; 3]| {
        let [a, b, c] = triangle.map(|v| minus(v, x));
        let [la, lb, lc] = [a, b, c].map(length);
        let denominator = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
        2.0 * dot(a, cross(b, c)).atan2(denominator)
    };
    triangles.iter().map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// Compares at random points in and around the bounding box, and at points near the surface.
/// Returns the largest error.
fn compare(name: &str, mesh: &ClosedMesh, points: usize) -> f64 {
    let vertices = &mesh.mesh().vertices;
    let triangles: Vec<[Vector; 3]> = mesh
        .mesh()
        .faces
        .iter()
        .map(|f| f.map(|v| vertices[v as usize]))
        .collect();
    let distance = MeshDistance::new(mesh);
    let bounds = mesh.bounding_box();
    let side = bounds.longest_side();
    let mut numbers = Numbers(7);
    let mut worst = 0.0_f64;
    for index in 0..points {
        let wide = 0.2 * side;
        let x = if index % 2 == 0 {
            numbers.point(
                bounds.lower.map(|v| v - wide),
                bounds.upper.map(|v| v + wide),
            )
        } else {
            // Close to a corner, an edge or a face: these decide the sign.
            let triangle = triangles[(numbers.next() * triangles.len() as f64) as usize];
            let weights = match index % 6 {
                1 => [1.0, 0.0, 0.0],
                3 => [0.4, 0.6, 0.0],
                _ => [0.3, 0.3, 0.4],
            };
            let foot: Vector =
                std::array::from_fn(|i| (0..3).map(|k| weights[k] * triangle[k][i]).sum());
            let reach = side * 10_f64.powf(-1.0 - 4.0 * numbers.next());
            numbers.point(foot.map(|v| v - reach), foot.map(|v| v + reach))
        };
        let unsigned = triangles
            .iter()
            .map(|t| to_triangle(x, *t))
            .fold(f64::INFINITY, f64::min);
        let winding = winding_number(x, &triangles);
        assert!(
            (winding - winding.round()).abs() < 1e-6,
            "{name}: {winding} at {x:?}"
        );
        let expected = if winding > 0.5 { -unsigned } else { unsigned };
        let error = (distance.signed_distance(x) - expected).abs() / side;
        assert!(
            error < 1e-12,
            "{name}: {} for {expected} at {x:?}",
            distance.signed_distance(x)
        );
        worst = worst.max(error);
    }
    worst
}

#[test]
fn distances_agree_with_brute_force() {
    let cavity = together(
        sphere([0.0; 3], 0.5, 3),
        &reversed(sphere([0.1, 0.0, 0.0], 0.3, 2)),
    );
    let island = together(cavity.clone(), &sphere([0.1, 0.05, 0.0], 0.1, 2));
    // Two cubes that share one vertex.
    let mut touching = together(cube(0.3), &translated(cube(0.2), [0.5; 3]));
    for corner in touching.faces.as_flattened_mut() {
        if *corner == 8 {
            *corner = 7;
        }
    }
    touching.vertices.swap_remove(8);
    for corner in touching.faces.as_flattened_mut() {
        if *corner == 15 {
            *corner = 8;
        }
    }
    let cases = [
        ("cube", closed(cube(0.4))),
        ("torus", closed(torus(0.5, 0.2, 40, 20))),
        ("thin torus", closed(torus(0.5, 0.01, 60, 5))),
        ("cavity", closed(cavity)),
        ("island", closed(island)),
        ("touching", closed(touching)),
        (
            "far away",
            closed(translated(torus(0.5, 0.2, 20, 10), [30.0, -20.0, 50.0])),
        ),
        ("figure", samples::figure(48).unwrap()),
        ("lever", samples::lever(48).unwrap()),
    ];
    for (name, mesh) in cases {
        let points = if mesh.mesh().faces.len() > 5000 {
            200
        } else {
            2000
        };
        compare(name, &mesh, points);
    }
}

#[test]
fn tiny_and_huge_meshes_are_as_exact() {
    for size in [1e-70, 3e-9, 7e11, 1e69] {
        let mut mesh = cube(0.5);
        mesh.vertices = mesh
            .vertices
            .iter()
            .map(|x| x.map(|v| v * 2.0 * size))
            .collect();
        let distance = MeshDistance::new(&closed(mesh));
        let cuboid = shapes::Cuboid::new([1.0; 3]).unwrap();
        let mut numbers = Numbers(3);
        for _ in 0..500 {
            let x = numbers.point([-2.0; 3], [2.0; 3]);
            let expected = cuboid.signed_distance(x);
            let found = distance.signed_distance(x.map(|v| v * size)) / size;
            assert!(
                (found - expected).abs() < 1e-14,
                "{found} for {expected} at {x:?}"
            );
        }
    }
}

#[test]
fn points_that_are_not_finite_have_no_distance() {
    let distance = MeshDistance::new(&closed(cube(0.5)));
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e200] {
        assert!(distance.signed_distance([bad, 0.0, 0.0]).is_nan(), "{bad}");
    }
    assert!(distance.signed_distance([0.5, 0.1, 0.2]).abs() < 1e-15);
}

/// Rows are searched in pieces, of which the last one is shorter here.
#[test]
fn rows_of_any_length_are_sampled() {
    for cells in [8, 13, 21] {
        let grid = Grid::<3>::centred(cells, 1.7).unwrap();
        let distance = MeshDistance::new(&closed(torus(0.5, 0.2, 40, 20)));
        let sampled = distance.sample(grid, &|| ()).unwrap();
        let direct = Field::from_fn(grid, |x| distance.signed_distance(x));
        for (a, b) in sampled.values().iter().zip(direct.values()) {
            assert!((a - b).abs() < 1e-15, "{a} for {b} on {cells} cells");
        }
    }
}

#[test]
fn the_hausdorff_distance_is_that_of_the_farthest_vertex() {
    let torus = torus(0.5, 0.2, 40, 20);
    let mut moved = torus.clone();
    moved.roughen(0.03, 5);
    let far = |a: &ClosedMesh, b: &ClosedMesh| {
        let farthest = |points: &ClosedMesh, from: &ClosedMesh| {
            let distances = MeshDistance::new(from).signed_distances(&points.mesh().vertices);
            distances.into_iter().map(f64::abs).fold(0.0, f64::max)
        };
        farthest(a, b).max(farthest(b, a))
    };
    let torus = closed(torus);
    // As many vertices in the same order, more of them, and another shape.
    for other in [
        closed(moved),
        closed(translated(sphere([0.0; 3], 0.6, 3), [0.1, 0.0, 0.0])),
        closed(cube(0.5)),
        torus.clone(),
    ] {
        let found = hausdorff_distance(&torus, &other);
        assert_eq!(found, far(&torus, &other));
        assert_eq!(found, hausdorff_distance(&other, &torus));
    }
}

#[test]
fn sampling_is_the_distance_at_every_node() {
    let grid = Grid::<3>::centred(24, 1.5).unwrap();
    for mesh in [closed(torus(0.5, 0.2, 40, 20)), samples::lever(48).unwrap()] {
        let distance = MeshDistance::new(&mesh);
        let layers = std::sync::atomic::AtomicUsize::new(0);
        let count = || {
            layers.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        };
        let sampled = distance.sample(grid, &count).unwrap();
        assert_eq!(layers.into_inner(), 24);
        let direct = Field::from_fn(grid, |x| distance.signed_distance(x));
        for (index, (a, b)) in sampled.values().iter().zip(direct.values()).enumerate() {
            assert!((a - b).abs() < 1e-15, "{a} for {b} at node {index}");
        }
        // Whole blocks are further away than this, and others in part.
        let reach = 0.1;
        let within = distance.sample_within(reach, grid, &|| ()).unwrap();
        assert!(within.values().len() < grid.len());
        for (a, b) in within.field().unwrap().values().iter().zip(direct.values()) {
            assert!((a - b.clamp(-reach, reach)).abs() < 1e-15, "{a} for {b}");
        }
    }
    let far = grid.with_origin([1e200; 3]).unwrap();
    let distance = MeshDistance::new(&closed(cube(0.5)));
    let error = distance.sample(far, &|| ()).unwrap_err();
    assert!(error.to_string().contains("node 0 is NaN"), "{error}");
}

#[test]
fn near_the_surface_distances_are_those_of_the_whole_grid() {
    let grid = Grid::<3>::centred(64, 1.5).unwrap();
    let (near, reach) = (0.01, 0.1);
    for mesh in [closed(torus(0.5, 0.2, 40, 20)), samples::lever(48).unwrap()] {
        let distance = MeshDistance::new(&mesh);
        let within = distance.sample_within(reach, grid, &|| ()).unwrap();
        let few = distance.sample_near(near, reach, grid, &|| ()).unwrap();
        assert!(2 * few.values().len() < grid.len());
        let within = within.field().unwrap();
        for (a, b) in few.field().unwrap().values().iter().zip(within.values()) {
            // Elsewhere they are on the same side.
            let is_far = b.abs() > near && *a == reach.copysign(*b);
            assert!((a - b).abs() < 1e-15 || is_far, "{a} for {b}");
        }
        // Half of the grid and more is stored as ever.
        let wide = distance.sample_near(0.5, reach, grid, &|| ()).unwrap();
        assert_eq!(wide.field().unwrap(), within);
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let grid = Grid::<3>::centred(20, 1.0).unwrap();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let lever = samples::lever(48).unwrap();
            let sampled = MeshDistance::new(&lever).sample(grid, &|| ()).unwrap();
            (lever, sampled)
        })
    };
    let one = with(1);
    assert!(one == with(2) && one == with(5));
}

#[test]
fn placed_meshes_keep_their_distances() {
    let mesh = closed(translated(torus(5.0, 2.0, 40, 20), [100.0, 3.0, -7.0]));
    let grid = Grid::<3>::new(16, 2.0).unwrap();
    let placement = Placement::fit(&mesh.bounding_box(), &grid, 1.4).unwrap();
    let before = MeshDistance::new(&mesh);
    let after = MeshDistance::new(&mesh.placed(&placement));
    for index in 0..grid.len() {
        let x = grid.node(index);
        let expected = placement.scale() * before.signed_distance(placement.apply_inverse(x));
        assert!((after.signed_distance(x) - expected).abs() < 1e-13);
    }
}

/// Scanned meshes that cannot be part of the repository.
#[test]
#[ignore = "needs the meshes of scripts/fetch_meshes in the folder WORKBENCH_MESHES"]
fn scanned_meshes_agree_with_brute_force() {
    let folder = std::env::var_os("WORKBENCH_MESHES").map(PathBuf::from);
    let folder = folder.expect("WORKBENCH_MESHES is the folder of scripts/fetch_meshes");
    for (name, genus) in [("armadillo.obj", 0), ("rocker-arm.obj", 1)] {
        let mesh = closed(surfaces::read(folder.join(name)).unwrap());
        assert_eq!((mesh.components(), mesh.genus()), (1, genus), "{name}");
        let worst = compare(name, &mesh, 300);
        println!("{name}: 300 points, largest error {worst:.1e} of the longest side");
    }
}

#[test]
fn wrong_signs_are_mended_and_right_ones_stay() {
    let ball = Ball::new([0.0; 3], 0.3).unwrap();
    let grid = Grid::<3>::centred(16, 1.0).unwrap();
    let right = Field::from_fn(grid, |x| ball.signed_distance(x));
    let (mended, changed) = mend_signs(Stored::whole(right.clone()));
    assert_eq!((mended.field().unwrap(), changed), (right.clone(), 0));
    // A ray of wrong signs from the surface to the side of the box, and one to the centre.
    let wrong = Field::from_fn(grid, |x| {
        let s = ball.signed_distance(x);
        let on_ray = x[1].abs() < 0.01 && x[2].abs() < 0.01 && x[0] > -0.01;
        if on_ray && s.abs() > 0.05 { -s } else { s }
    });
    let (mended, changed) = mend_signs(Stored::whole(wrong));
    assert!(changed > 4);
    assert_eq!(mended.field().unwrap(), right);
    // A box with faces in the middle between nodes, up to rounding.
    let spacing = grid.spacing();
    let half = 4.5 * spacing;
    let right = Field::from_fn(grid, |x| {
        (1.0 + 1e-12) * (x.iter().fold(0.0, |far: f64, x| far.max(x.abs())) - half)
    });
    let (mended, changed) = mend_signs(Stored::whole(right.clone()));
    assert_eq!((mended.field().unwrap(), changed), (right, 0));
}

/// Of a distance of which only what is near is stored, also whole bricks of which nothing is.
#[test]
fn signs_are_mended_where_nothing_is_stored() {
    let grid = Grid::<3>::centred(64, 4.0).unwrap();
    let (ball, reach) = (Ball::new([0.0; 3], 1.7).unwrap(), 0.2);
    let ball = Field::from_fn(grid, |x| ball.signed_distance(x));
    let profile = |s: f64| -s.clamp(-reach, reach) / reach;
    let stored = |s: &Field<3>| Stored::from(s.map(profile)).map(|u| -reach * u);
    let right = stored(&ball);
    let (mended, changed) = mend_signs(right.clone());
    assert_eq!(
        (mended.field().unwrap(), changed),
        (right.field().unwrap(), 0)
    );
    // A brick in the middle, and one at the corner of the box.
    let wrong = Bricks::new(
        64,
        8,
        |place| right.nodes().bricks().unwrap().number(place).is_some(),
        |place| {
            place == [0; 3] || place != [4; 3] && right.nodes().bricks().unwrap().is_positive(place)
        },
    );
    let wrong = Nodes::on_bricks(grid, Arc::new(wrong.unwrap()));
    let wrong = Stored::new(right.values().to_vec(), wrong, right.phase_values());
    assert_ne!(wrong.field().unwrap(), right.field().unwrap());
    let (mended, changed) = mend_signs(wrong);
    assert_eq!(
        (mended.field().unwrap(), changed),
        (right.field().unwrap(), 2 * 512)
    );
}

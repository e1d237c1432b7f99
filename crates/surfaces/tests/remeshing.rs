//! Surfaces of well-shaped triangles: shapes of the triangles, topology, accuracy.

use std::collections::HashMap;
use std::f64::consts::PI;

use crate::common::{
    Numbers, Vector, closed, cross, dot, length, minus, rounded, topology, unit, waves,
};
use geometry::shapes::{Ball, Capsule, Cuboid, Torus};
use geometry::{Field, Grid, SignedDistance, SignedDistanceExt, optimal_profile, phase_field};
use proptest::prelude::*;
use surfaces::{
    ClosedMesh, Error, MeshDistance, TriangleMesh, phase_field_surface, remeshed_surface, samples,
};

fn triangles(mesh: &TriangleMesh) -> impl Iterator<Item = [Vector; 3]> {
    let corners = |face: &[u32; 3]| face.map(|v| mesh.vertices[v as usize]);
    mesh.faces.iter().map(corners)
}

/// Smallest angles of the triangles in degrees, in ascending order.
pub fn smallest_angles(mesh: &TriangleMesh) -> Vec<f64> {
    let smallest = |x: [Vector; 3]| {
        let angle = |i: usize| {
            let (a, b) = (minus(x[(i + 1) % 3], x[i]), minus(x[(i + 2) % 3], x[i]));
            length(cross(a, b)).atan2(dot(a, b)).to_degrees()
        };
        angle(0).min(angle(1)).min(angle(2))
    };
    let mut angles: Vec<f64> = triangles(mesh).map(smallest).collect();
    angles.sort_unstable_by(f64::total_cmp);
    angles
}

fn part_below(angles: &[f64], degrees: f64) -> f64 {
    angles.partition_point(|&angle| angle < degrees) as f64 / angles.len() as f64
}

pub fn shortest_edge(mesh: &TriangleMesh) -> f64 {
    let edges = triangles(mesh).flat_map(|[a, b, c]| [minus(a, b), minus(b, c), minus(c, a)]);
    edges.map(length).fold(f64::INFINITY, f64::min)
}

/// The surface by marching tetrahedra and the remeshed one, of the same topology.
#[track_caller]
fn both(u: &Field<3>, eps: f64) -> [ClosedMesh; 2] {
    let [marched, remeshed] =
        [phase_field_surface(u, eps), remeshed_surface(u, eps)].map(|mesh| closed(mesh.unwrap()));
    assert_eq!(topology(&remeshed), topology(&marched));
    [marched, remeshed]
}

/// A grid on the unit cube, moved by parts of its spacing.
fn grid(cells: usize, offset: Vector) -> Grid<3> {
    let grid = Grid::<3>::centred(cells, 1.0).unwrap();
    let (origin, h) = (grid.origin(), grid.spacing());
    let moved = std::array::from_fn(|i| origin[i] + offset[i] * h);
    grid.with_origin(moved).unwrap()
}

/// Faces point outwards as their corners' normals do.
#[track_caller]
fn assert_agreement(mesh: &TriangleMesh, cosine: f64) {
    let normals = mesh.normals.as_ref().unwrap();
    for (face, [a, b, c]) in mesh.faces.iter().zip(triangles(mesh)) {
        let normal = unit(cross(minus(b, a), minus(c, a)));
        for v in face {
            let along = dot(normal, normals[*v as usize]);
            assert!(along > cosine, "{along} at {a:?}, {b:?}, {c:?}");
        }
    }
}

/// Pairs of an edge and a face, without a common vertex, that cross.
fn crossings(mesh: &TriangleMesh, h: f64) -> usize {
    let bins = |points: &[Vector]| {
        let [low, high] = [f64::min, f64::max].map(|f| {
            std::array::from_fn::<_, 3, _>(|i| {
                let extreme = points.iter().map(|x| x[i]).reduce(f).unwrap();
                (extreme / h).floor() as i64
            })
        });
        (low[0]..=high[0]).flat_map(move |i| {
            (low[1]..=high[1]).flat_map(move |j| (low[2]..=high[2]).map(move |k| [i, j, k]))
        })
    };
    let mut faces_in: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    let corners: Vec<_> = triangles(mesh).collect();
    for (face, x) in corners.iter().enumerate() {
        for bin in bins(x) {
            faces_in.entry(bin).or_default().push(face);
        }
    }
    let volume = |a, b, c, d| dot(minus(b, a), cross(minus(c, a), minus(d, a)));
    let crosses = |p: Vector, q: Vector, [a, b, c]: [Vector; 3]| {
        let sides = [volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)];
        volume(p, a, b, c) * volume(q, a, b, c) < 0.0
            && (sides.iter().all(|&s| s > 0.0) || sides.iter().all(|&s| s < 0.0))
    };
    let mut count = 0;
    for face in &mesh.faces {
        for [v, w] in [[face[0], face[1]], [face[1], face[2]], [face[2], face[0]]] {
            let [p, q] = [v, w].map(|v| mesh.vertices[v as usize]);
            let near = bins(&[p, q]).filter_map(|bin| faces_in.get(&bin)).flatten();
            count += near
                .filter(|&&other| {
                    let others = mesh.faces[other];
                    !others.contains(&v) && !others.contains(&w) && crosses(p, q, corners[other])
                })
                .count();
        }
    }
    count
}

#[track_caller]
fn assert_well_shaped(name: &str, u: &Field<3>) {
    let h = u.grid().spacing();
    let [marched, remeshed] = both(u, 2.0 * h);
    let mesh = remeshed.mesh();
    let (before, after) = (smallest_angles(marched.mesh()), smallest_angles(mesh));
    let shortest = shortest_edge(mesh) / h;
    println!(
        "{name}, {} cells: below 15 degrees {:.1} % of {} before; {} after, from {:.1} degrees, {:.2} % below 30; edges \
         from {shortest:.2} h; area {:.5}, {:.5}; volume {:.6}, {:.6}",
        u.grid().cells(),
        100.0 * part_below(&before, 15.0),
        before.len(),
        after.len(),
        after[0],
        100.0 * part_below(&after, 30.0),
        marched.area(),
        remeshed.area(),
        marched.volume(),
        remeshed.volume(),
    );
    assert!(part_below(&before, 15.0) > 0.1, "{name} is no test");
    assert!(after[0] > 15.0, "{name}: {} degrees", after[0]);
    assert!(part_below(&after, 25.0) < 0.01, "{name}");
    assert!(shortest > 0.2, "{name}: {shortest} h");
    assert_agreement(mesh, 0.3);
    if u.grid().cells() < 64 {
        assert_eq!(crossings(mesh, h), 0, "{name}");
    }
}

#[test]
fn triangles_are_well_shaped() {
    let ball = Ball::new([0.0; 3], 0.3).unwrap();
    let torus = Torus::new(0.27, 0.1).unwrap();
    let core = Cuboid::new([0.25 - 0.06; 3]).unwrap();
    let cube = |x: [f64; 3]| core.signed_distance(x) - 0.06;
    let figure = MeshDistance::new(&samples::figure(64).unwrap());
    let lever = MeshDistance::new(&samples::lever(64).unwrap());
    for (cells, offset) in [
        (32, [0.0; 3]),
        (32, [0.5, 0.25, 0.125]),
        (45, [0.311, -0.127, 0.473]),
        (64, [0.9, 0.05, 0.6]),
    ] {
        let grid = grid(cells, offset);
        let eps = 2.0 * grid.spacing();
        for (name, u) in [
            ("ball", phase_field(grid, &ball, eps).unwrap()),
            ("torus", phase_field(grid, &torus, eps).unwrap()),
            ("rounded cube", phase_field(grid, &cube, eps).unwrap()),
        ] {
            assert_well_shaped(name, &u);
        }
        for (name, distance) in [("figure", &figure), ("lever", &lever)] {
            let s = distance.sample(grid, &|| ()).unwrap();
            assert_well_shaped(name, &s.map(|s| optimal_profile(s, eps)));
        }
    }
    let fine = grid(128, [0.3, 0.6, 0.1]);
    let u = phase_field(fine, &torus, 2.0 * fine.spacing()).unwrap();
    assert_well_shaped("torus", &u);
}

#[test]
fn spheres_are_as_accurate_as_those_of_marching_tetrahedra() {
    let centre = [0.011, -0.007, 0.003];
    let ball = Ball::new(centre, 0.3).unwrap();
    let (area, volume) = (4.0 * PI * 0.09, 4.0 / 3.0 * PI * 0.027);
    let mut previous: Option<[f64; 2]> = None;
    for n in [32, 64, 128] {
        let grid = Grid::<3>::centred(n, 1.0).unwrap();
        let h = grid.spacing();
        let u = phase_field(grid, &ball, 2.0 * h).unwrap();
        let [[a, v], errors] = both(&u, 2.0 * h)
            .map(|mesh| [mesh.area() / area - 1.0, mesh.volume() / volume - 1.0].map(f64::abs));
        println!("n = {n}: relative errors of area and volume {errors:?} for {a}, {v}");
        assert!(
            errors[0] < 1.05 * a && errors[1] < 1.05 * v,
            "{errors:?} for {a}, {v}"
        );
        if let Some([a, v]) = previous {
            assert!(
                errors[0] < 0.3 * a && errors[1] < 0.3 * v,
                "{errors:?} after {a}, {v}"
            );
        }
        previous = Some(errors);
        let mesh = remeshed_surface(&u, 2.0 * h).unwrap();
        for (x, normal) in mesh.vertices.iter().zip(mesh.normals.unwrap()) {
            // Third order, as vertices on edges of the lattice.
            let error = ball.signed_distance(*x).abs();
            assert!(error < 0.07 * (h / 0.3).powi(3) * 0.3, "{error} at {x:?}");
            let cosine = dot(unit(minus(*x, centre)), normal);
            assert!((cosine - 1.0).abs() < 1e-4, "{cosine} at {x:?}");
        }
    }
}

#[test]
fn thin_and_small_parts_keep_their_topology() {
    let h = 1.0_f64 / 32.0;
    for radius in [0.3, 0.5, 0.7, 1.0, 1.5, 2.0] {
        let ball = |x: f64| Ball::new([x, 0.0, 0.0], 0.15).unwrap();
        let neck = Capsule::new([-0.2, 0.0, 0.0], [0.2, 0.0, 0.0], radius * h).unwrap();
        let dumbbell = ball(-0.2).union(ball(0.2)).union(neck);
        let plate = Cuboid::new([0.3, 0.3, radius * h]).unwrap();
        let crumb = Ball::new([0.0; 3], radius * h).unwrap();
        for offset in [[0.0; 3], [0.4, 0.3, 0.1], [0.5, 0.5, 0.5]] {
            let grid = grid(32, offset);
            for (name, u) in [
                ("dumbbell", phase_field(grid, &dumbbell, 2.0 * h).unwrap()),
                ("plate", phase_field(grid, &plate, 2.0 * h).unwrap()),
                ("crumb", phase_field(grid, &crumb, 2.0 * h).unwrap()),
            ] {
                if phase_field_surface(&u, 2.0 * h).unwrap().faces.is_empty() {
                    continue;
                }
                let [_, remeshed] = both(&u, 2.0 * h);
                let angles = smallest_angles(remeshed.mesh());
                let crossings = crossings(remeshed.mesh(), h);
                assert!(
                    angles[0] > 15.0,
                    "{name} of {radius} cells: {} degrees",
                    angles[0]
                );
                assert_eq!(crossings, 0, "{name} of {radius} cells");
            }
        }
    }
}

#[test]
fn caps_stay_where_they_are() {
    let grid = Grid::<3>::centred(32, 1.0).unwrap();
    let eps = 2.0 * grid.spacing();
    let cylinder = |[x, y, _]: [f64; 3]| x.hypot(y) - 0.3;
    let u = phase_field(grid, &cylinder, eps).unwrap();
    let [marched, remeshed] = both(&u, eps);
    let (a, b) = (marched.bounding_box(), remeshed.bounding_box());
    assert_eq!((a.lower[2], a.upper[2]), (b.lower[2], b.upper[2]));
    let volume = PI * 0.09 * 31.0 / 32.0;
    assert!((remeshed.volume() / volume - 1.0).abs() < 2e-3);
    assert_eq!(crossings(remeshed.mesh(), grid.spacing()), 0);
    // All that is left of the bad triangles.
    let bad = part_below(&smallest_angles(remeshed.mesh()), 15.0);
    assert!(bad < 0.2, "{bad}");
}

#[test]
fn fields_without_a_smooth_surface_stay_closed() {
    let grid = Grid::<3>::centred(12, 1.0).unwrap();
    let mut numbers = Numbers(5);
    for levels in [1.0, 2.0, 1e3] {
        let values = (0..grid.len()).map(|_| rounded(2.0 * numbers.next() - 1.4, levels));
        let u = Field::from_values(grid, values.collect()).unwrap();
        both(&u.map(|u| u.clamp(-1.0, 1.0)), 2.0 * grid.spacing());
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let grid = grid(32, [0.1, 0.2, 0.3]);
    let eps = 2.0 * grid.spacing();
    let u = phase_field(grid, &Torus::new(0.27, 0.1).unwrap(), eps).unwrap();
    let by = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| remeshed_surface(&u, eps).unwrap())
    };
    assert_eq!(by(1), by(3));
}

#[test]
fn wrong_fields_and_widths_are_refused() {
    let grid = Grid::<3>::centred(8, 1.0).unwrap();
    let mut u = Field::constant(grid, -1.0);
    assert!(remeshed_surface(&u, 0.1).unwrap().faces.is_empty());
    for eps in [0.0, -1.0, f64::NAN] {
        let error = remeshed_surface(&u, eps).unwrap_err();
        assert!(matches!(error, Error::Geometry(_)));
    }
    u.values_mut()[17] = f64::NAN;
    let error = remeshed_surface(&u, 0.1).unwrap_err();
    assert!(error.to_string().contains("node 17 is NaN"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 40,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// Random smooth fields, also rounded ones.
    #[test]
    fn the_topology_is_that_of_marching_tetrahedra(
        seed in any::<u64>(),
        cells in 3..13_usize,
        levels in prop::sample::select(vec![0.0, 2.0]),
    ) {
        let grid = Grid::<3>::new(cells, 1.0).unwrap();
        let waves = waves(seed);
        let u = Field::from_fn(grid, |x| rounded(waves(x).tanh(), levels));
        let eps = 2.0 * grid.spacing();
        if !phase_field_surface(&u, eps).unwrap().faces.is_empty() {
            both(&u, eps);
        }
    }
}

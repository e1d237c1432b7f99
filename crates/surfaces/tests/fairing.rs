//! Noise, its smoothing, vertices that follow a level set, and files with moved vertices.

#![allow(clippy::float_cmp, reason = "where equality is asserted, it is exact")]

use chacha20::ChaCha8Rng;
use geometry::{Grid, Placement, optimal_profile};
use rand::{RngExt, SeedableRng};
use surfaces::{Fairing, MeshDistance, TriangleMesh, decode, rewrite};

use crate::common::{closed, cube, length, sphere, torus, with_noise};

fn radii(mesh: &TriangleMesh) -> (f64, f64) {
    let radii = mesh.vertices.iter().map(|x| length(*x));
    let mean = radii.clone().sum::<f64>() / mesh.vertices.len() as f64;
    let off = radii.map(|radius| (radius - mean).powi(2));
    (mean, (off.sum::<f64>() / mesh.vertices.len() as f64).sqrt())
}

#[test]
fn noise_is_estimated_to_five_percent_and_is_next_to_nothing_on_a_smooth_surface() {
    for clean in [sphere([0.0; 3], 1.0, 5), torus(1.0, 0.4, 120, 60)] {
        let of_shape = clean.noise().deviation;
        assert!(of_shape < 2e-4, "{of_shape}");
        for deviation in [0.002, 0.01] {
            let estimate = with_noise(&clean, deviation).noise().deviation;
            assert!(
                (estimate / deviation - 1.0).abs() < 0.05,
                "{estimate} for {deviation}"
            );
        }
    }
}

/// Of an octahedron's edges something is taken for noise, of which its flat sides have none.
#[test]
fn flat_sides_have_no_noise() {
    let sphere = sphere([0.0; 3], 1.0, 4);
    let mut octahedron = sphere.clone();
    for x in &mut octahedron.vertices {
        let length: f64 = x.iter().map(|x| x.abs()).sum();
        *x = x.map(|x| x / length);
    }
    assert!(octahedron.noise().flat_part > 0.3);
    for mesh in [octahedron, sphere] {
        let noisy = with_noise(&mesh, 0.01);
        assert!(noisy.noise().flat_part < 0.002);
    }
}

/// The variance is that of any distribution.
#[test]
fn noise_need_not_be_normally_distributed_nor_along_the_normals() {
    let clean = sphere([0.0; 3], 1.0, 5);
    let deviation = 0.01;
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut sum = |count: usize| (0..count).map(|_| rng.random::<f64>() - 0.5).sum::<f64>();
    let (mut uniform, mut isotropic) = (clean.clone(), clean.clone());
    for (vertex, normal) in clean.vertex_normals().into_iter().enumerate() {
        let length = 12.0_f64.sqrt() * deviation * sum(1);
        let x = clean.vertices[vertex];
        uniform.vertices[vertex] = std::array::from_fn(|i| x[i] + length * normal[i]);
        isotropic.vertices[vertex] = x.map(|x| x + deviation * sum(12));
    }
    for noisy in [uniform, isotropic] {
        let estimate = noisy.noise().deviation;
        assert!((estimate / deviation - 1.0).abs() < 0.05, "{estimate}");
    }
}

#[test]
fn smoothing_keeps_size_with_taubins_factors_and_shrinks_with_laplacian_ones() {
    let noisy = with_noise(&sphere([0.0; 3], 1.0, 4), 0.01);
    let (_, before) = radii(&noisy);
    let (mean, off) = radii(&noisy.smoothed(20, 0.5, -0.53));
    assert!(
        (mean - 1.0).abs() < 0.005 && off < 0.4 * before,
        "{mean} {off}"
    );
    let (mean, _) = radii(&noisy.smoothed(20, 0.5, 0.0));
    assert!(mean < 0.97, "{mean}");
}

/// On edges that are long for the wave length, too, only the average of the noise comes back.
#[test]
fn long_waves_are_given_back_without_the_noise() {
    let clean = sphere([0.0; 3], 1.0, 4);
    let noisy = with_noise(&clean, 0.01);
    for wavelength in [1.0, 0.3, 0.03] {
        let mut small = clean.clone();
        small.vertices.iter_mut().flatten().for_each(|x| *x *= 0.97);
        let (mean, off) = radii(&small.with_long_waves_of(&noisy, wavelength));
        assert!(
            (mean - 1.0).abs() < 0.005 && off < 0.006,
            "{wavelength}: {mean} {off}"
        );
    }
}

#[test]
fn the_volume_is_made_what_it_should_be() {
    let mesh = with_noise(&torus(1.0, 0.4, 60, 30), 0.01);
    // Far away from the origin, where digits are lost.
    let mut far = mesh.clone();
    far.vertices.iter_mut().flatten().for_each(|x| *x += 1e5);
    for (mesh, digits) in [(mesh, 1e-12), (far, 1e-6)] {
        let target = 1.01 * mesh.volume();
        let made = mesh.with_volume(target, |vertex| vertex % 2 == 0);
        assert!((made.volume() / target - 1.0).abs() < digits);
        assert!(
            (0..mesh.vertices.len()).all(|v| v % 2 == 0 || made.vertices[v] == mesh.vertices[v])
        );
    }
}

/// A level set that has moved takes the vertices along; what the grid does not resolve keeps its distance.
#[test]
fn vertices_follow_a_sphere_that_grows() {
    let grid = Grid::<3>::centred(64, 1.0).unwrap();
    let eps = 2.0 * grid.spacing();
    let field =
        |radius: f64| geometry::Field::from_fn(grid, |x| optimal_profile(length(x) - radius, eps));
    let mut mesh = sphere([0.0; 3], 1.0, 4);
    // A thorn of which the grid knows nothing.
    mesh.vertices[0] = mesh.vertices[0].map(|x| 1.4 * x);
    let fairing = Fairing::new(closed(mesh), 0.0, |x| x[2] < -0.9);
    // The radius 1 of the mesh is 0.3 in the box.
    let placement = Placement::about([0.0; 3], 0.3).unwrap();
    let followed = fairing.follow(placement, &field(0.3), eps).unwrap();
    let grown = field(0.33);
    assert_eq!(followed.left_behind(&grown).unwrap(), 0.0);
    let moved = fairing.faired(&followed, &grown).unwrap().mesh;
    for (vertex, x) in moved.vertices.iter().enumerate() {
        let radius = length(*x);
        let expected = match vertex {
            0 => 1.5,
            _ if fairing.kept[vertex] => 1.0,
            _ => 1.1,
        };
        assert!(
            (radius - expected).abs() < 2e-3,
            "{vertex}: {radius}, not {expected}"
        );
    }
    assert!(fairing.kept.contains(&true));
    let displacement = fairing.displacement(&followed, &grown).unwrap();
    // Those that stay count too.
    let stay = fairing.kept.iter().filter(|kept| **kept).count() as f64;
    let expected = 0.1 * (1.0 - stay / fairing.kept.len() as f64).sqrt();
    assert!((displacement - expected).abs() < 1e-3, "{displacement}");
    assert!(followed.left_behind(&field(0.02)).unwrap() > 0.5);
    // Nor does the smoothing before the flow take along what is kept.
    let smoothed = Fairing::new(fairing.rough.clone(), 0.05, |x| x[2] < -0.9);
    let start = smoothed.start.mesh().vertices.iter();
    let pairs = start.zip(&fairing.rough.mesh().vertices);
    let mut kept = pairs.zip(&smoothed.kept);
    assert!(kept.clone().any(|((x, from), _)| x != from));
    assert!(kept.all(|((x, from), kept)| x == from || !kept));
}

/// Without a flow: the zero level set of the start, long waves given back.
#[test]
fn a_fairing_takes_off_noise_before_the_flow_begins() {
    let noisy = with_noise(&sphere([0.0; 3], 0.3, 5), 0.003);
    let volume = noisy.volume();
    let fairing = Fairing::new(closed(noisy.clone()), noisy.noise().deviation, |_| false);
    let grid = Grid::<3>::centred(64, 1.0).unwrap();
    let eps = 2.0 * grid.spacing();
    let placement = Placement::about([0.0; 3], 1.0).unwrap();
    let distance = MeshDistance::new(&fairing.start)
        .sample(grid, &|| ())
        .unwrap();
    let start = distance.map(|s| optimal_profile(s, eps));
    let followed = fairing.follow(placement, &start, eps).unwrap();
    let faired = fairing.faired(&followed, &start).unwrap().mesh;
    let ((_, before), (_, after)) = (radii(&noisy), radii(&faired));
    assert!(after < 0.5 * before, "{after} of {before}");
    assert!((faired.volume() / volume - 1.0).abs() < 1e-12);
    assert!(fairing.time(grid.spacing(), 1.0) > 0.0);
}

const QUAD: &str = "# a pyramid\r\nmtllib a.mtl\r\nv 0 0 0 1 0.5 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\nv 0.5 0.5 1\r\nvt 0 0\r\nvn 0 0 -1\r\nvn 9 9 9\r\nvn 0 1 0\r\n\
    usemtl red\r\nf 4/1/1 3/1/1 2/1/1 1/1/1\r\ng sides\r\nf 1//2 2//2 5//2\r\nf 2 3 5\r\nf -3 -2 -1\r\nf 4 1 5\r\n";

#[test]
fn an_obj_file_keeps_everything_but_positions_and_normals() {
    let mut mesh = decode(QUAD.as_bytes(), "a.obj").unwrap();
    for x in &mut mesh.vertices {
        *x = [x[2], 2.0 * x[0], 2.0 * x[1] + 0.125];
    }
    let bytes = rewrite(QUAD.as_bytes(), "a.obj", &mesh).unwrap();
    let text = String::from_utf8(bytes.clone()).unwrap();
    assert_eq!(decode(&bytes, "a.obj").unwrap().vertices, mesh.vertices);
    let kept = |text: &str| -> Vec<String> {
        let other = |line: &&str| !line.starts_with("v ") && !line.starts_with("vn");
        text.split("\r\n")
            .filter(other)
            .map(str::to_owned)
            .collect()
    };
    assert_eq!(kept(&text), kept(QUAD));
    // The colour stays, the normals follow: the quadrangle now faces the other way along the first axis.
    assert!(text.contains("v 0 0 0.125 1 0.5 0\r\n"), "{text}");
    assert!(text.contains("vn -1 0 0\r\n"), "{text}");
    // The third belongs to no face. Far from the origin all of them are the same.
    assert!(text.contains("vn 0 1 0\r\n"), "{text}");
    for x in &mut mesh.vertices {
        *x = x.map(|x| x / 64.0 + 4_194_304.0);
    }
    let far = rewrite(QUAD.as_bytes(), "a.obj", &mesh).unwrap();
    let normals = |text: &str| -> Vec<String> {
        let lines = text.lines().filter(|line| line.starts_with("vn"));
        lines.map(str::to_owned).collect()
    };
    assert_eq!(normals(&String::from_utf8(far).unwrap()), normals(&text));
}

/// Of a file whose faces wind the other way, so that its normals are right and those by the faces are not.
#[test]
fn normals_stay_on_their_side() {
    let turned = QUAD.replace("vn 0 0 -1", "vn 0 0 1");
    let mesh = decode(turned.as_bytes(), "a.obj").unwrap();
    let text = rewrite(turned.as_bytes(), "a.obj", &mesh).unwrap();
    assert!(String::from_utf8(text).unwrap().contains("vn 0 0 1\r\n"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cube.ply");
    let mut inwards = cube(1.0);
    inwards.normals = Some(inwards.vertex_normals());
    inwards.faces.iter_mut().for_each(|face| face.swap(0, 1));
    surfaces::write(&path, &inwards).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let mesh = decode(&bytes, "cube.ply").unwrap();
    assert_eq!(rewrite(&bytes, "cube.ply", &mesh).unwrap(), bytes);
}

#[test]
fn ply_and_stl_files_keep_everything_but_positions_and_normals() {
    let folder = tempfile::tempdir().unwrap();
    let mut closed = closed(cube(1.0)).into_mesh();
    closed.normals = Some(closed.vertex_normals());
    for name in ["cube.ply", "cube.stl"] {
        let path = folder.path().join(name);
        surfaces::write(&path, &closed).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let mut moved = decode(&bytes, name).unwrap();
        assert_eq!(rewrite(&bytes, name, &moved).unwrap(), bytes, "{name}");
        moved
            .vertices
            .iter_mut()
            .for_each(|x| *x = [2.0 * x[0], x[1], x[2] + 1.0]);
        let again = rewrite(&bytes, name, &moved).unwrap();
        assert_eq!(again.len(), bytes.len());
        let read = decode(&again, name).unwrap();
        assert_eq!(
            (read.vertices, read.faces),
            (moved.vertices, moved.faces),
            "{name}"
        );
    }
    let ascii = "ply\nformat ascii 1.0\ncomment mine\nelement vertex 4\nproperty uchar red\nproperty float x\nproperty list uchar int \
        who\nproperty float y\nproperty float z\nelement face 4\nproperty list uchar int vertex_indices\nproperty int label\n\
        end_header\n7 0 2 5 6 0 0\n8 1 0 0 0\n9 0 1 3 1 0\n10 0 0 0 1\n3 0 2 1 11\n3 0 1 3 12\n3 1 2 3 13\n3 0 3 2 14\n";
    let mut mesh = decode(ascii.as_bytes(), "a.ply").unwrap();
    mesh.vertices[0] = [-0.5, 0.25, 0.0];
    let text = String::from_utf8(rewrite(ascii.as_bytes(), "a.ply", &mesh).unwrap()).unwrap();
    assert_eq!(
        text,
        ascii.replace("7 0 2 5 6 0 0\n", "7 -0.5 2 5 6 0.25 0\n")
    );
    // Rounded to the type of the file: y to double.
    mesh.vertices[0] = [1.0 / 3.0; 3];
    let mixed = ascii.replace("float y", "double y");
    let text = String::from_utf8(rewrite(mixed.as_bytes(), "a.ply", &mesh).unwrap()).unwrap();
    let rounded = "7 0.33333334 2 5 6 0.3333333333333333 0.33333334\n";
    assert_eq!(text, mixed.replace("7 0 2 5 6 0 0\n", rounded));
    let whole = ascii.replace("float", "int");
    assert!(rewrite(whole.as_bytes(), "a.ply", &mesh).is_err());
    let stl = "solid of me\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   vertex 0 1 0\n  endloop\n endfacet\n\
        endsolid of me\n";
    let mut mesh = decode(stl.as_bytes(), "a.stl").unwrap();
    mesh.vertices[1] = [0.0, 0.0, 2.0];
    let text = String::from_utf8(rewrite(stl.as_bytes(), "a.stl", &mesh).unwrap()).unwrap();
    assert!(
        text.contains(" facet normal -1e0 0e0 0e0\n") && text.contains("   vertex 0e0 0e0 2e0\n"),
        "{text}"
    );
}

/// Exact shapes have none, however few their faces are, and noise of a tenth of an edge is seen on each of them.
#[test]
fn noise_is_told_from_edges_and_few_faces() {
    let boxes = |levels: usize| {
        let mut mesh = crate::common::cube(1.0);
        for _ in 0..levels {
            mesh = subdivided(&mesh);
        }
        mesh
    };
    for (name, mesh) in [
        ("sphere 2", crate::common::sphere([0.0; 3], 1.0, 2)),
        ("sphere 4", crate::common::sphere([0.0; 3], 1.0, 4)),
        ("torus 20", crate::common::torus(1.0, 0.4, 20, 12)),
        ("torus 40", crate::common::torus(1.0, 0.4, 40, 20)),
        ("torus 100", crate::common::torus(1.0, 0.4, 100, 50)),
        ("box 2", boxes(2)),
        ("box 3", boxes(3)),
        ("box 4", boxes(4)),
    ] {
        assert!(mesh.noise().is_shape, "{name}");
        let mut rough = mesh.clone();
        let edge = (4.0 * crate::common::closed(mesh.clone()).area()
            / 3.0_f64.sqrt()
            / mesh.faces.len() as f64)
            .sqrt();
        // Even noise of this size has a standard deviation of a tenth of an edge and a bit more.
        rough.roughen(0.2 * edge, 1);
        assert!(!rough.noise().is_shape, "{name} with noise");
    }
}

/// Every face as four.
fn subdivided(mesh: &surfaces::TriangleMesh) -> surfaces::TriangleMesh {
    let mut fine = surfaces::TriangleMesh {
        normals: None,
        faces: Vec::new(),
        ..mesh.clone()
    };
    let mut middles = std::collections::HashMap::new();
    for &[a, b, c] in &mesh.faces {
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[p, q]| {
            *middles.entry([p.min(q), p.max(q)]).or_insert_with(|| {
                let [x, y] = [p, q].map(|v| mesh.vertices[v as usize]);
                fine.vertices.push([0, 1, 2].map(|i| 0.5 * (x[i] + y[i])));
                fine.vertices.len() as u32 - 1
            })
        });
        fine.faces
            .extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    fine
}

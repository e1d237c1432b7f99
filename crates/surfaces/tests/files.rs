//! Mesh files: round trips, variants of the formats, and files that are none.

#![allow(clippy::float_cmp, reason = "files keep every bit")]

use std::fs;
use std::path::Path;

use crate::common::files::{ENCODINGS, FACET, decode, encode, ply};
use crate::common::{closed, cube, torus};
use geometry::UpAxis;
use surfaces::{
    ClosedMesh, Error, FormatError, TriangleMesh, read, samples, up_axis, usual_up_axis, write,
};

fn problem(extension: &str, bytes: impl AsRef<[u8]>) -> FormatError {
    match decode(extension, bytes.as_ref()).unwrap_err() {
        Error::Format { problem, .. } => problem,
        other => panic!("{other}"),
    }
}

#[test]
fn obj_off_and_ply_round_trip_bit_for_bit() {
    let with_normals = samples::lever(48).unwrap().into_mesh();
    assert!(with_normals.normals.is_some());
    for mesh in [torus(0.5, 1.0 / 7.0, 30, 20), with_normals] {
        assert_eq!(decode("ply", &encode("ply", &mesh)).unwrap(), mesh);
        let plain = TriangleMesh {
            normals: None,
            ..mesh.clone()
        };
        assert_eq!(decode("OBJ", &encode("obj", &mesh)).unwrap(), plain);
        assert_eq!(decode("OFF", &encode("off", &mesh)).unwrap(), plain);
    }
}

#[test]
fn stl_round_trips_in_single_precision() {
    for mesh in [cube(0.5), samples::figure(48).unwrap().into_mesh()] {
        let bytes = encode("stl", &mesh);
        assert_eq!(bytes.len(), 84 + 50 * mesh.faces.len());
        let back = decode("stl", &bytes).unwrap();
        assert_eq!(back.vertices.len(), mesh.vertices.len());
        for (a, b) in mesh
            .faces
            .as_flattened()
            .iter()
            .zip(back.faces.as_flattened())
        {
            let (a, b) = (mesh.vertices[*a as usize], back.vertices[*b as usize]);
            assert_eq!(a.map(|v| f64::from(v as f32)), b);
        }
        assert!(encode("stl", closed(back).mesh()) == bytes);
    }
    // The normal of the first facet of the cube points down the first axis.
    let bytes = encode("stl", &cube(0.5));
    assert_eq!(
        bytes[84..96],
        [(-1.0_f32).to_le_bytes(), [0; 4], [0; 4]].concat()
    );
}

const TETRAHEDRON: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";

#[test]
fn obj_variants_are_understood() {
    let expected = decode(
        "obj",
        &[TETRAHEDRON, "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4"]
            .concat()
            .into_bytes(),
    );
    let expected = expected.unwrap();
    assert_eq!(expected.faces, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
    assert_eq!(ClosedMesh::new(expected.clone()).unwrap().1, []);
    for faces in [
        "f 1/1/1 3/9/9 2//7\nf 1/5 2/ 4//\ng a\nf 1 4 3\no b\nf 2 3 4",
        "f -4 -2 -3\nf -4 -3 -1\nf 1 -1 3\nusemtl x\nf 2 3 4\nl 1 2 3\np 1",
        "\r\n# \u{e9}\r\nf 1 3 2\r\n\tf  1 2 4 \r\nf 1 4 3\r\nvt nonsense\r\nf 2 3 4\r\n",
    ] {
        let text = [TETRAHEDRON, faces].concat();
        assert_eq!(decode("obj", text.as_bytes()).unwrap(), expected, "{faces}");
    }
    // Colours, weights, Latin-1 comments; vertices after the faces.
    let bytes = b"# caf\xe9\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n\
                  v 0 0 0 1 0 0\nv 1 0 0 1.0\nv +0 1. 0e0\nv 0 -0 .1e1\n";
    let mesh = decode("obj", bytes).unwrap();
    assert_eq!(mesh.faces, expected.faces);
    assert_eq!(mesh.vertices, expected.vertices);
    // Polygons as fans.
    let quads = [TETRAHEDRON, "f 1 2 3 4\nv 0 0 0\nf 5 4 3 2 1"].concat();
    let faces = decode("obj", quads.as_bytes()).unwrap().faces;
    assert_eq!(
        faces,
        [[0, 1, 2], [0, 2, 3], [4, 3, 2], [4, 2, 1], [4, 1, 0]]
    );
}

#[test]
fn broken_obj_files_are_explained() {
    let message = |text: &str| problem("obj", [TETRAHEDRON, text].concat()).to_string();
    for (text, expected) in [
        (
            "f 1 2 3\nf 1 2 9",
            "face 1 refers to vertex 9, but the file has 4 vertices, the first of which is 1",
        ),
        (
            "f 0 1 2",
            "face 0 refers to vertex 0, but the file has 4 vertices, the first of which is 1",
        ),
        (
            "f 1 2 -5",
            "line 5 has \"-5\" where a relative index of a vertex above is expected",
        ),
        (
            "f 1 2 99999999999999999999",
            "line 5 has \"99999999999999999999\" where the index of a vertex is expected",
        ),
        (
            "f 1 2 -9223372036854775808",
            "line 5 has \"-9223372036854775808\" where a relative index of a vertex above is \
             expected",
        ),
        (
            "f 1 2 9223372036854775807",
            "face 0 refers to vertex 9223372036854775807, but the file has 4 vertices, the first \
             of which is 1",
        ),
        (
            "f 1 2 4294967297",
            "face 0 refers to vertex 4294967297, but the file has 4 vertices, the first of which \
             is 1",
        ),
        (
            "f 1 2 3.5",
            "line 5 has \"3.5\" where the index of a vertex is expected",
        ),
        (
            "f 1 /2 3",
            "line 5 has \"/2\" where the index of a vertex is expected",
        ),
        (
            "f 1 2 3\nf 1 2",
            "face 1 has 2 corners; a face needs at least three",
        ),
        ("f", "face 0 has 0 corners; a face needs at least three"),
        ("v 1 2", "line 5 has \"\" where a coordinate is expected"),
        (
            "v 1 2 1,5",
            "line 5 has \"1,5\" where a coordinate is expected",
        ),
        (
            "v 1 nan 2",
            "vertex 4 has the coordinate NaN; all coordinates must be finite",
        ),
        (
            "v 1 2 -1e999",
            "vertex 4 has the coordinate -inf; all coordinates must be finite",
        ),
        (
            "g empty",
            "the file has 4 vertices and no faces: no mesh, or another format",
        ),
    ] {
        assert_eq!(message(text), expected);
    }
    let long = message(&format!("v 1 2 {}", "x".repeat(1000)));
    assert!(long.len() < 150 && long.contains("xxx ...\""), "{long}");
    assert!(matches!(problem("obj", ""), FormatError::Empty));
}

#[test]
fn stl_variants_are_understood() {
    let expected = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.5, 0.0]];
    for text in [
        format!("solid a b\n{FACET}endsolid a b\n"),
        format!("solid\n{FACET}endsolid"),
        format!(
            "\r\n  SOLID\r\n{}ENDSOLID\r\n",
            FACET.to_ascii_uppercase().replace('\n', "\r\n")
        ),
        format!(
            "solid nan\n{}endsolid nan",
            FACET.replace("0 0 1\n", "nan nan nan\n")
        ),
    ] {
        let mesh = decode("stl", text.as_bytes()).unwrap();
        assert_eq!(
            (mesh.vertices, mesh.faces),
            (expected.to_vec(), vec![[0, 1, 2]]),
            "{text}"
        );
    }
    let two = format!("solid a\n{FACET}endsolid a\nsolid b\n{FACET}{FACET}endsolid b");
    assert_eq!(decode("stl", two.as_bytes()).unwrap().faces, [[0, 1, 2]; 3]);

    // Binary, with a comment that looks like ASCII.
    let mut bytes = encode("stl", &cube(0.5));
    bytes[..20].copy_from_slice(b"solid not ascii\n\xff\xfe\0\n");
    assert_eq!(decode("stl", &bytes).unwrap().faces.len(), 12);
}

#[test]
fn broken_stl_files_are_explained() {
    let good = encode("stl", &cube(0.5));
    assert_eq!(
        problem("stl", &good[..600]).to_string(),
        "the header announces 12 facets, which take at least 684 bytes, but the file has 600: \
         truncated, or another format"
    );
    let mut huge = good.clone();
    huge[80..84].fill(0xff);
    let text = problem("stl", &huge).to_string();
    assert!(
        text.contains("4294967295 facets, which take at least 214748364834 bytes"),
        "{text}"
    );
    let mut none = good[..84].to_vec();
    none[80..84].fill(0);
    assert!(matches!(problem("stl", &none), FormatError::NoFaces { .. }));
    let mut bad = good;
    bad[84 + 50 + 12 + 16..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(matches!(
        problem("stl", &bad),
        FormatError::NonFinite { vertex: 4, .. }
    ));

    let message = |text: String| problem("stl", text).to_string();
    for (text, expected) in [
        (
            format!("solid a\n{FACET}"),
            "the file ends in line 8 where endsolid is expected: it is truncated",
        ),
        (
            format!("solid a\n{}", &FACET[..60]),
            "the file ends in line 5 where endsolid is expected: it is truncated",
        ),
        (
            format!("solid a\n{FACET}vertex 1 2 3\nendsolid"),
            "line 9 has \"vertex 1 2 3\" where facet or endsolid is expected",
        ),
        (
            format!(
                "solid a\n{}endsolid",
                FACET.replace("endloop", "vertex 1 1 1")
            ),
            "face 0 has 4 corners; an STL facet has three",
        ),
        (
            format!("solid a\n{}endsolid", FACET.replace("1.5e0", "one")),
            "line 6 has \"one\" where a coordinate is expected",
        ),
        (
            format!("solid a\n{}endsolid", FACET.replace("1.5e0", "inf")),
            "vertex 2 has the coordinate inf; all coordinates must be finite",
        ),
        (
            format!("solid a\n{}endsolid", FACET.replace("endfacet", "facet")),
            "line 8 has \"facet\" where outer loop, vertex, endloop or endfacet is expected",
        ),
        (
            "solid a\nendsolid".into(),
            "the file has 0 vertices and no faces: no mesh, or another format",
        ),
        (
            "nonsense".into(),
            "line 1 has \"nonsense\" where \"solid\", or a binary header of 84 bytes, is expected",
        ),
    ] {
        assert_eq!(message(text), expected);
    }
}

#[test]
fn ply_variants_are_understood() {
    for format in ENCODINGS {
        let mesh = decode("ply", &ply(format)).unwrap();
        assert_eq!(mesh.vertices[3], [0.0, 0.0, 1.0], "{format}");
        assert_eq!(
            mesh.faces,
            [[0, 2, 1], [0, 1, 3], [0, 3, 2], [0, 2, 1]],
            "{format}"
        );
        assert_eq!(mesh.normals, None);
    }
}

#[test]
fn colours_of_vertices_are_read() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty TYPE red\n\
                property TYPE green\nproperty TYPE blue\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
                0 0 0 1 0 0\n1 0 0 0 1 0\n0 1 0 0 0 1\n3 0 1 2\n";
    let colours = |text: &str, name: &str| surfaces::vertex_colours(text.as_bytes(), name).unwrap();
    let of = |level: u8| Some(vec![[level, 0, 0], [0, level, 0], [0, 0, level]]);
    assert_eq!(colours(&text.replace("TYPE", "uchar"), "a.ply"), of(1));
    assert_eq!(colours(&text.replace("TYPE", "float"), "a.ply"), of(255));
    assert_eq!(
        colours(
            &text
                .replace("TYPE blue", "int alpha")
                .replace("TYPE", "uchar"),
            "a.ply"
        ),
        None
    );
    let obj = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n";
    assert_eq!(colours(obj, "a.obj"), of(255));
    assert_eq!(
        colours(&obj.replace("v 1 0 0 0 1 0", "v 1 0 0"), "a.obj"),
        None
    );
    assert_eq!(colours("solid a", "a.stl"), None);
}

/// A strip goes round its sides in turn, -1 begins the next one, and a vertex given twice turns it.
#[test]
fn ply_strips_are_triangles() {
    let text = |strips: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
             0 0 0\n1 0 0\n0 1 0\n0 0 1\n{strips}\n"
        )
    };
    let apart = decode("ply", text("8 0 2 1 3 -1 0 1 3").as_bytes()).unwrap();
    assert_eq!(apart.faces, [[0, 2, 1], [1, 2, 3], [0, 1, 3]]);
    let closed = decode("ply", text("6 0 2 1 3 0 2").as_bytes()).unwrap();
    assert_eq!(closed.faces, [[0, 2, 1], [1, 2, 3], [1, 3, 0], [0, 3, 2]]);
    ClosedMesh::new(closed).unwrap();
    let turned = decode("ply", text("5 0 2 1 1 3").as_bytes()).unwrap();
    assert_eq!(turned.faces, [[0, 2, 1]]);
    let message = problem("ply", text("4 0 2 1 4")).to_string();
    assert!(message.contains("refers to vertex 4"), "{message}");
}

#[test]
fn broken_ply_files_are_explained() {
    let text = String::from_utf8(ply("ascii")).unwrap();
    let message = |from: &str, to: &str| {
        assert!(text.contains(from));
        problem("ply", text.replacen(from, to, 1)).to_string()
    };
    for (from, to, expected) in [
        (
            "3 0 1 3",
            "3 0 1 4",
            "face 1 refers to vertex 4, but the file has 4 vertices, the first of which is 0",
        ),
        (
            "3 0 1 3",
            "3 0 1 -3",
            "face 1 refers to vertex -3, but the file has 4 vertices, the first of which is 0",
        ),
        (
            "3 0 1 3",
            "2 0 1",
            "face 1 has 2 corners; a face needs at least three",
        ),
        (
            "float x",
            "float X",
            "the header does not declare x, y and z of vertex",
        ),
        (
            "vertex_index",
            "indices",
            "the header does not declare a list vertex_indices of its faces",
        ),
        (
            "element vertex",
            "element point",
            "the header does not declare an element vertex",
        ),
        (
            "element face",
            "element patch",
            "the header does not declare an element face or tristrips",
        ),
        (
            "1 1 0 0\n",
            "1 1 1e999 0\n",
            "vertex 1 has the coordinate inf; all coordinates must be finite",
        ),
        (
            "element edge 1\nproperty int a",
            "element edge 9",
            "the header announces 9 elements \"edge\" without properties",
        ),
    ] {
        assert_eq!(message(from, to), expected);
    }
    let text = message("vertex 4\n", "vertex 4000000000\n");
    assert!(
        text.starts_with(
            "the header announces 4000000000 elements \"vertex\", which take at least 3200000"
        ),
        "{text}"
    );
    for (from, to) in [
        ("element vertex 4", "element vertex -4"),
        ("element vertex 4", "element vertex 99999999999999999999"),
        ("format ascii", "format utf8"),
        ("ply\n", "plx\n"),
        ("end_header", "end"),
        ("1 1 0 0\n", "1 nan 0 0\n"),
        ("1 1 0 0\n", "1 1\n"),
        ("3 0 1 3", "4294967295 0 1 3"),
        ("3 0 1 3", "0 0 1 3"),
        ("float x", "list uchar float x"),
    ] {
        let text = message(from, to);
        assert!(!text.contains('\n') && text.len() < 200, "{text:?}");
    }
    for format in ENCODINGS {
        let good = ply(format);
        for length in 0..good.len() - 2 {
            let text = problem("ply", &good[..length]).to_string();
            assert!(!text.contains('\n') && text.len() < 200, "{text:?}");
        }
    }
    // A list of 2^31 corners, announced by a few bytes.
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 1\n\
                  property float x\nproperty float y\nproperty float z\nelement face 1\n\
                  property list uint int vertex_indices\nend_header\n";
    let bytes = [header.as_bytes(), &[0; 12], &[0, 0, 0, 0x80], &[0; 40]].concat();
    assert!(matches!(
        problem("ply", bytes),
        FormatError::Length { count: 1, .. }
    ));
}

#[test]
fn unusable_normals_are_dropped() {
    let mut mesh = cube(0.5);
    mesh.normals = Some(vec![[0.0, 0.0, 1.0]; 8]);
    let mut bytes = encode("ply", &mesh);
    let end = bytes
        .windows(11)
        .position(|w| w == b"end_header\n")
        .unwrap()
        + 11;
    bytes[end + 24..end + 32].copy_from_slice(&f64::NAN.to_le_bytes());
    assert_eq!(decode("ply", &bytes).unwrap(), cube(0.5));
}

#[test]
fn unknown_extensions_and_missing_files_are_told() {
    for path in ["mesh.wrl", "mesh", "obj", ".ply", "mesh.stl.gz"] {
        let text = read(path).unwrap_err().to_string();
        assert_eq!(
            text,
            format!(
                "{path} has no known extension; meshes are read and written as .obj, .off, .ply or .stl"
            )
        );
        assert!(matches!(
            write(path, &cube(1.0)),
            Err(Error::UnknownFormat { .. })
        ));
    }
    let text = read("no/such/file.ply").unwrap_err().to_string();
    assert!(
        text.starts_with("could not read no/such/file.ply: "),
        "{text}"
    );
    assert!(write("no/such/file.ply", &cube(1.0)).is_err());
    assert!(
        read(
            Path::new(env!("CARGO_MANIFEST_DIR"))
                .join("src")
                .with_extension("obj")
        )
        .is_err()
    );
}

#[test]
fn the_format_tells_which_axis_usually_points_up() {
    for (path, up) in [
        ("a.OBJ", UpAxis::Y),
        ("a.off", UpAxis::Z),
        ("a.ply", UpAxis::Z),
        ("a.stl", UpAxis::Z),
    ] {
        assert_eq!(usual_up_axis(path).unwrap(), up);
    }
    assert!(usual_up_axis("a.npy").is_err());
}

/// Its coordinates do not tell it: a mesh with y up lies on its side in a format that usually has z up, unless the file says so.
#[test]
fn a_file_names_the_axis_that_points_up_where_it_is_not_the_usual_one() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = samples::lever(48).unwrap().into_mesh();
    for extension in ["obj", "off", "ply", "stl"] {
        let path = folder.path().join("mesh").with_extension(extension);
        write(&path, &mesh).unwrap();
        let (plain, usual) = (fs::read(&path).unwrap(), read(&path).unwrap());
        for up in UpAxis::ALL {
            surfaces::write_with_up(&path, &mesh, up).unwrap();
            assert_eq!(up_axis(&path).unwrap(), up, "{extension}");
            assert_eq!(read(&path).unwrap(), usual);
            let is_usual = up == usual_up_axis(&path).unwrap();
            let bytes = fs::read(&path).unwrap();
            assert_eq!(bytes == plain, is_usual, "{extension} {up}");
            // What the file says goes on with its vertices.
            let moved = surfaces::rewrite(&bytes, &path, &usual).unwrap();
            fs::write(&path, moved).unwrap();
            assert_eq!(up_axis(&path).unwrap(), up, "{extension}");
        }
    }
    // Others say other things there.
    let path = folder.path().join("other.ply");
    fs::write(&path, "ply\r\ncomment up and down\r\ncomment up x\r\n").unwrap();
    assert_eq!(up_axis(&path).unwrap(), UpAxis::X);
    fs::write(&path, "ply\ncomment UP\nend_header\ncomment up x\n").unwrap();
    assert_eq!(up_axis(&path).unwrap(), UpAxis::Z);
}

#[test]
fn unusable_meshes_are_not_written() {
    let folder = tempfile::tempdir().unwrap();
    for extension in ["obj", "off", "ply", "stl"] {
        let path = folder.path().join("mesh").with_extension(extension);
        let refused = |spoil: fn(&mut TriangleMesh)| {
            let mut mesh = cube(1.0);
            spoil(&mut mesh);
            write(&path, &mesh).unwrap_err()
        };
        let error = refused(|mesh| *mesh = TriangleMesh::default());
        assert!(matches!(error, Error::NoFaces));
        let error = refused(|mesh| mesh.vertices[5][1] = f64::NAN);
        assert!(matches!(error, Error::NonFiniteVertex { vertex: 5, .. }));
        let error = refused(|mesh| mesh.faces[2][0] = 8);
        assert!(matches!(error, Error::IndexOutOfRange { face: 2, .. }));
        let error = refused(|mesh| mesh.normals = Some(Vec::new()));
        assert!(matches!(error, Error::Normals { .. }));
    }
    let huge = cube(1e39);
    let text = write(folder.path().join("mesh.stl"), &huge)
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("at most 3.4028234663852886e38 in this format"),
        "{text}"
    );
    assert!(write(folder.path().join("mesh.ply"), &huge).is_ok());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// As other programs read it, and with its vertices moved.
fn assert_reads(extension: &str, bytes: &[u8], expected: &TriangleMesh) -> Vec<u8> {
    let mesh = decode(extension, bytes).unwrap();
    assert_eq!(
        (&mesh.vertices, &mesh.faces),
        (&expected.vertices, &expected.faces),
        "{}",
        String::from_utf8_lossy(bytes)
    );
    let mut moved = mesh;
    for x in moved.vertices.as_flattened_mut() {
        *x += 0.5;
    }
    let path = Path::new("mesh").with_extension(extension);
    let rewritten = surfaces::rewrite(bytes, path, &moved).unwrap();
    assert_eq!(
        decode(extension, &rewritten).unwrap().vertices,
        moved.vertices
    );
    rewritten
}

#[test]
fn off_variants_are_understood() {
    let expected = decode(
        "obj",
        [TETRAHEDRON, "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4"]
            .concat()
            .as_bytes(),
    );
    let expected = expected.unwrap();
    let faces = "3 0 2 1\n3 0 1 3 255 0 0\n3 0 3 2 # red\n3 1 2 3 0.5 0.5 0.5 1\n";
    for vertices in [
        "OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n",
        "# made by hand\n\nOFF 4 4\n\n0 0 0\n1 0 0 # a corner\n\n0 1 0\n0 0 1\n\n",
        "4 4 0\r\n0 0 0\r\n1 0 0\r\n0 1 0\r\n0 0 1\r\n",
        "\tOFF4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n",
        "\u{feff}COFF\n4 4 0\n0 0 0 255 0 0 255\n1 0 0 0 9 0 255\n0 1 0 0 0 9 255\n0 0 1 1 2 3 255\n",
    ] {
        let text = [vertices, faces].concat();
        let rewritten = assert_reads("off", text.as_bytes(), &expected);
        let moved = String::from_utf8(rewritten).unwrap();
        assert!(moved.contains("1.5 0.5 0.5"), "{moved}");
        assert!(moved.ends_with(faces), "{moved}");
    }
    // Corners go on in the next lines.
    let vertices = "OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
    let broken = [
        vertices,
        "3 0 2\n1\n3 0\n1 3 255 0 0\n3\n0 3 2 # red\n3 1 2 3\n",
    ]
    .concat();
    assert_reads("off", broken.as_bytes(), &expected);
    // Colours as whole numbers and as parts of 1, behind normals.
    let colours = |text: &str| surfaces::vertex_colours(text.as_bytes(), "a.off").unwrap();
    let coloured =
        "CNOFF\n3 1 0\n0 0 0 0 0 1 1 0 0\n1 0 0 0 0 1 0 1 0\n0 1 0 0 0 1 0 0 255\n3 0 1 2\n";
    assert_eq!(
        colours(coloured),
        Some(vec![[1, 0, 0], [0, 1, 0], [0, 0, 255]])
    );
    let parts = coloured.replace("255", "0.2");
    assert_eq!(
        colours(&parts),
        Some(vec![[255, 0, 0], [0, 255, 0], [0, 0, 51]])
    );
    assert_eq!(colours("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2"), None);
    // Normals are made anew, on the side that they have.
    let mut turned = decode("off", coloured.replace("0 0 1 ", "0 0 -1 ").as_bytes()).unwrap();
    assert_eq!(turned.normals, Some(vec![[0.0, 0.0, -1.0]; 3]));
    turned
        .vertices
        .iter_mut()
        .for_each(|x| *x = [x[2], x[0], x[1]]);
    let rewritten = surfaces::rewrite(coloured.as_bytes(), "a.off", &turned).unwrap();
    let text = String::from_utf8(rewritten).unwrap();
    assert!(text.contains("\n0 1 0 1 0 0 0 1 0\n"), "{text}");
}

#[test]
fn broken_off_files_are_explained() {
    let message = |text: &str| problem("off", text).to_string();
    for (text, expected) in [
        (
            "PLY\n",
            "line 1 has \"PLY\" where OFF, or the numbers of vertices, faces and edges, is expected",
        ),
        ("XOFF\n", "line 1 has \"XOFF\" where OFF is expected"),
        (
            "OFF BINARY\n\0\0",
            "binary OFF is not read; save it as text, or as PLY",
        ),
        (
            "4OFF\n1 1 0\n",
            "4OFF is not read: its vertices have four or any number of coordinates; save it as OFF",
        ),
        (
            "OFF\n",
            "the file ends in line 1 where the numbers of vertices and faces is expected: it is truncated",
        ),
        (
            "OFF\n3 1 0\n0 0 0\n1 0 0\n",
            "the file ends in line 4 where a vertex is expected: it is truncated",
        ),
        (
            "OFF\n1 1 0\n0 0 x\n",
            "line 3 has \"x\" where a coordinate is expected",
        ),
        (
            "OFF\n1 2 0\n0 0 0\n3 0 0 0",
            "the file ends in line 4 where a face is expected: it is truncated",
        ),
        (
            "OFF\n1 1 0\n0 0 0\n3 0 0",
            "the file ends in line 4 where the index of a vertex is expected: it is truncated",
        ),
        (
            "OFF\n1 1 0\n0 0 0\n3 0 0 1",
            "face 0 refers to vertex 1, but the file has 1 vertices, the first of which is 0",
        ),
        (
            "OFF\n99999999999 1 0\n0 0 0\n",
            "the file ends in line 3 where a vertex is expected: it is truncated",
        ),
        (
            "OFF\n1 1 0\n0 0 0\n9999999999 0 0",
            "the file ends in line 4 where the index of a vertex is expected: it is truncated",
        ),
    ] {
        assert_eq!(message(text), expected, "{text:?}");
    }
}

/// Byte order marks, comments behind faces, lines that go on, and bytes behind the facets: other programs read them, and what is not
/// understood stays when the vertices move.
#[test]
fn what_other_programs_write_around_a_mesh_is_no_fault() {
    let faces = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    let obj = [TETRAHEDRON, faces].concat();
    let expected = decode("obj", obj.as_bytes()).unwrap();
    let marked = assert_reads("obj", &["\u{feff}", &obj].concat().into_bytes(), &expected);
    assert!(marked.starts_with("\u{feff}v 0.5 0.5 0.5\n".as_bytes()));
    let commented = obj
        .replace("f 1 3 2", "f 1 3 2 # a face")
        .replace("v 1 0 0", "v 1 0 0#x");
    let commented = assert_reads("obj", commented.as_bytes(), &expected);
    assert!(
        String::from_utf8(commented)
            .unwrap()
            .contains("\nv 1.5 0.5 0.5 #x\n")
    );
    for (from, to) in [
        ("f 1 3 2", "f 1 3 \\\n 2"),
        ("f 1 3 2", "f 1\\\r\n3 \\ \n\\\n2"),
        ("v 1 0 0", "v 1 \\\n 0\\\n 0"),
        // A path or a comment does not go on.
        ("v 1 0 0", "mtllib C:\\\nv 1 0 0"),
        ("v 1 0 0", "# C:\\\nv 1 0 0 # D:\\"),
    ] {
        assert_reads("obj", obj.replace(from, to).as_bytes(), &expected);
    }
    let message = problem("obj", "v 0 0 0\nf 1 \\\n 1 1\nf 1 1 x").to_string();
    assert_eq!(
        message,
        "line 4 has \"x\" where the index of a vertex is expected"
    );

    let text = format!("solid a\n{FACET}endsolid a\n");
    let one = decode("stl", text.as_bytes()).unwrap();
    let marked = assert_reads("stl", &["\u{feff}", &text].concat().into_bytes(), &one);
    assert!(marked.starts_with("\u{feff}solid a\n".as_bytes()));
    assert_reads("stl", &[text.as_bytes(), b"\x1a\0\0"].concat(), &one);
    let mut binary = encode("stl", &cube(0.5));
    let cube = decode("stl", &binary).unwrap();
    binary.extend([7; 40]);
    let moved = assert_reads("stl", &binary, &cube);
    assert_eq!(
        (moved.len(), &moved[moved.len() - 40..]),
        (binary.len(), &[7; 40][..])
    );
    binary.truncate(binary.len() - 41);
    let message = problem("stl", &binary).to_string();
    assert!(
        message.ends_with("truncated, or another format"),
        "{message}"
    );

    let ply = String::from_utf8(ply("ascii")).unwrap();
    let ply = ply.replace("short z", "float z").into_bytes();
    assert_reads(
        "ply",
        &["\u{feff}".as_bytes(), &ply, b"and more\n"].concat(),
        &decode("ply", &ply).unwrap(),
    );
    for extension in ["obj", "off", "ply", "stl"] {
        for mark in [b"\xff\xfe", b"\xfe\xff"] {
            let text = [&mark[..], b"v\0 \x000\0"].concat();
            assert_eq!(
                problem(extension, text).to_string(),
                "the text is UTF-16; save it as UTF-8"
            );
        }
    }
    // The axis is found behind a mark, too.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("marked.obj");
    fs::write(&path, ["\u{feff}# up z\n", &obj].concat()).unwrap();
    assert_eq!(up_axis(&path).unwrap(), UpAxis::Z);
}

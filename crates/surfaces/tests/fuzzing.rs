//! Damaged and malicious files of meshes.

use std::path::Path;

use crate::common::files::{ENCODINGS, FACET, encode, ply};
use crate::common::sphere;
use files::UTF8_MARK;
use fuzzing::{Fuzz, Limit, assert_short_line, peak_of};
use surfaces::{ClosedMesh, TriangleMesh, decode, rewrite, vertex_colours};

/// As documented at [`surfaces::read`].
const LIMIT: Limit = Limit {
    times: 64,
    plus: 1 << 20,
};

/// Whatever was read can be used: it is a closed surface, or something is missing.
fn check(_: &[u8], mesh: TriangleMesh) {
    let corners = mesh.faces.as_flattened();
    assert!(corners.iter().all(|&v| (v as usize) < mesh.vertices.len()));
    assert!(mesh.vertices.iter().flatten().all(|v| v.is_finite()));
    let normals = mesh.normals.as_ref();
    assert!(normals.is_none_or(|n| n.len() == mesh.vertices.len()));
    if let Err(error) = ClosedMesh::new(mesh) {
        assert_short_line(&error);
    }
}

#[test]
fn fuzzing_obj_files() {
    let quads = "# a comment\no part\nv 0 0 0 1 1 1\nv 1 0 0\nv 1 1 0\nv 0 1 1e-1\nvn 0 0 1\n\
                 f 1//1 2//1 3//1\nf -4/1 -2/2 -1/3\nf 1 2 3 4\n";
    let fuzzed = Fuzz::new("obj", LIMIT)
        .valid([
            encode("obj", &sphere([0.0; 3], 1.0, 1)),
            quads.as_bytes().to_vec(),
        ])
        .starts(["f ", "v "])
        .words([
            "v ", "f ", "\nv", "\nf", "f", "1/2/3 ", "-1 ", "\n", "//", "\r\n", "\\\n", " # ",
        ]);
    fuzzed.run(|bytes| decode(bytes, "a.obj"), check);
}

#[test]
fn fuzzing_stl_files() {
    let text = format!("solid a\n{FACET}{FACET}endsolid a\n");
    let fuzzed = Fuzz::new("stl", LIMIT)
        .valid([
            encode("stl", &sphere([0.0; 3], 1.0, 1)),
            text.into_bytes(),
            format!("solid a\n{}endsolid b\n", FACET.repeat(20)).into_bytes(),
        ])
        .starts(["solid ", "solid a\nfacet normal 0 0 1\nouter loop\nvertex "])
        .words([
            "solid",
            "endsolid",
            "facet",
            "endfacet",
            "outer loop",
            "endloop",
            "vertex ",
            "\n",
            "vertex 0 0 0\n",
            FACET,
        ])
        // The number of facets is that of the file again.
        .repair(|mut bytes| {
            if bytes.len() >= 84 && !bytes.starts_with(b"solid") {
                let facets = (bytes.len() - 84) / 50;
                bytes.truncate(84 + 50 * facets);
                bytes[80..84].copy_from_slice(&(facets as u32).to_le_bytes());
            }
            bytes
        });
    fuzzed.run(|bytes| decode(bytes, "a.stl"), check);
}

#[test]
fn fuzzing_off_files() {
    let coloured = "# a comment\nSTCNOFF 4 3 6\n0 0 0 0 0 1 255 0 0 1 1\n1 0 0 0 0 1 9 9 9\n\n\
                    1 1 0 0 0 1 1 2 3 # there\n0 1 1e-1 0 1 0 4 5 6\n3 0 1 2\n4 0 1 2 3 0.5 0.5 1\n3 3 2 1\n";
    let fuzzed = Fuzz::new("off", LIMIT)
        .valid([
            encode("off", &sphere([0.0; 3], 1.0, 1)),
            coloured.as_bytes().to_vec(),
            [UTF8_MARK, b"3 1\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2"].concat(),
        ])
        .starts(["OFF\n3 1 0\n", "COFF ", "OFF BINARY\n"])
        .words([
            "OFF",
            "ST",
            "C",
            "N",
            "4",
            "n",
            "BINARY",
            "# ",
            "\n",
            "\r\n",
            "3 0 1 2\n",
            "0 0 0\n",
            "1e9 ",
        ]);
    fuzzed.run(
        |bytes| decode(bytes, "a.off"),
        |bytes, mesh| {
            // Colours and the moved file are made of the same rows.
            let colours = vertex_colours(bytes, "a.off").unwrap();
            assert!(colours.is_none_or(|colours| colours.len() == mesh.vertices.len()));
            let again = decode(&rewrite(bytes, "a.off", &mesh).unwrap(), "a.off").unwrap();
            assert_eq!(
                (&again.vertices, &again.faces),
                (&mesh.vertices, &mesh.faces)
            );
            check(bytes, mesh);
        },
    );
}

#[test]
fn fuzzing_ply_files() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n\
                  property float y\nproperty char z\nelement face 2\n\
                  property list char ushort vertex_indices\nend_header\n";
    let mesh = sphere([0.0; 3], 1.0, 1);
    let mut with_normals = mesh.clone();
    with_normals.normals = Some(mesh.vertices.clone());
    let fuzzed = Fuzz::new("ply", LIMIT)
        .valid(ENCODINGS.map(ply))
        .valid([encode("ply", &mesh), encode("ply", &with_normals)])
        .starts(["ply\n", header])
        .words([
            "\nelement vertex 1",
            "\nelement face 1000",
            "\nelement edge 4000000000",
            "\nproperty uchar a",
            "\nproperty list uint double a",
            "\nproperty list char int b",
            "\nproperty double x",
            "\ncomment c",
            "\nobj_info d",
            "\nend_header\n",
            "ascii",
            "binary_little_endian",
            "binary_big_endian",
            "vertex_index",
            "char",
            "ushort",
            "3 0 1 2\n",
            "\n",
            " ",
            "\r\n",
        ]);
    fuzzed.run(|bytes| decode(bytes, "a.ply"), check);
}

/// Files of a mebibyte that make the most of every byte, or announce more than they have.
#[test]
fn the_worst_files_stay_within_the_limit() {
    let binary = |element: &str, properties: &str| {
        format!("ply\nformat binary_little_endian 1.0\n{element}\n{properties}\nend_header\n")
    };
    let position = "property char x\nproperty char y\nproperty char z";
    let faces = "property list uchar uchar vertex_indices";
    let text =
        |line: &str| format!("ply\nformat ascii 1.0\nelement vertex 1\nproperty char x\n{line}");
    for (extension, start, block) in [
        ("obj", String::new(), "v 0 0 0\n"),
        ("obj", "v 0 0 0\nf".to_string(), " 1"),
        ("obj", "v 0 0 0\n".to_string(), "f 1 1 1\n"),
        ("obj", "v 0 0 0\n".to_string(), "f\n"),
        ("obj", "\u{feff}".to_string(), "\u{0}"),
        ("obj", "v 0 0 0\n".to_string(), "f 1\\\n1 1\n"),
        ("obj", "v".to_string(), "\\\n"),
        ("off", "OFF 200000 0 0\n".to_string(), "0 0 0\n"),
        ("off", "OFF 1 200000 0\n0 0 0\n".to_string(), "3 0 0 0\n"),
        ("off", "OFF 1 2 0\n0 0 0\n500000 ".to_string(), "0 "),
        ("off", String::new(), "\u{0}"),
        ("stl", "solid\nfacet\n".to_string(), "vertex 0 0 0\n"),
        (
            "stl",
            "solid\nfacet\n".to_string(),
            "vertex 0 0 0\nvertex 0 1 0\nvertex 0 1 0\nendfacet\nfacet\n",
        ),
        ("ply", binary("element vertex 349000", position), "\0\0\0"),
        (
            "ply",
            binary(
                "element vertex 9",
                &format!("{position}\nelement face 262000\n{faces}"),
            ),
            "\x03\0\0\0",
        ),
        (
            "ply",
            binary(
                "element vertex 0",
                &format!("{position}\nelement face 1040000\n{faces}"),
            ),
            "\0",
        ),
        (
            "ply",
            binary("element a 1", "property list uint char b"),
            "\0\0\x08\0",
        ),
        ("ply", text("end_header\n"), "1 "),
        ("ply", text(""), "property char a\n"),
        ("ply", text(""), "element a 0\n"),
        ("ply", text(""), "comment a\n"),
    ] {
        let path = Path::new("mesh").with_extension(extension);
        let mut bytes = start.clone().into_bytes();
        bytes.extend(block.as_bytes().repeat((1 << 20) / block.len()));
        bytes.truncate(1 << 20);
        let (result, peak) = peak_of(|| decode(&bytes, &path));
        if let Err(error) = &result {
            assert_short_line(error);
        }
        println!("{extension} {start:?} {block:?}: {peak} bytes");
        assert!(
            peak <= LIMIT.times * bytes.len() + LIMIT.plus,
            "{start:?}, {block:?}: {peak} bytes"
        );
    }
}

//! Files of meshes for the tests.

use std::fs;

use surfaces::{Error, TriangleMesh, read, write};

/// Reads bytes as a file with that extension.
pub fn decode(extension: &str, bytes: &[u8]) -> Result<TriangleMesh, Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh").with_extension(extension);
    fs::write(&path, bytes).unwrap();
    read(&path)
}

/// The bytes of a written file.
pub fn encode(extension: &str, mesh: &TriangleMesh) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh").with_extension(extension);
    write(&path, mesh).unwrap();
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    fs::read(&path).unwrap()
}

/// A facet of ASCII STL.
pub const FACET: &str = "facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  \
                     vertex 0 1.5e0 0\n endloop\nendfacet\n";

/// A tetrahedron in three encodings, with properties and elements that are passed over.
pub fn ply(format: &str) -> Vec<u8> {
    let header = format!(
        "ply\nformat {format} 1.0\ncomment a b\nelement camera 1\nproperty list uchar float view\n\
         element vertex 4\nproperty uchar red\nproperty float x\nproperty double y\n\
         property short z\n\
         element face 3\nproperty list uchar int vertex_index\nproperty float quality\n\
         element edge 1\nproperty int a\nend_header\n"
    );
    let corners = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];
    let faces: [&[i32]; 3] = [&[0, 2, 1], &[0, 1, 3], &[0, 3, 2, 1]];
    let mut bytes = header.into_bytes();
    if format == "ascii" {
        bytes.extend(b"2 1.5 2.5\n0 0 0 0\n1 1 0 0\n2 0 1.0 0\n3 0 0 1\n");
        bytes.extend(b"3 0 2 1 0.5\n3 0 1 3 0.5\n4 0 3 2 1 0.5\n7\n");
        return bytes;
    }
    let big = format == "binary_big_endian";
    let mut put = |value: &[u8]| {
        // Given little-endian.
        let mut value = value.to_vec();
        if big {
            value.reverse();
        }
        bytes.extend(value);
    };
    put(&[2]);
    put(&1.5_f32.to_le_bytes());
    put(&2.5_f32.to_le_bytes());
    for (colour, [x, y, z]) in corners.into_iter().enumerate() {
        put(&[colour as u8]);
        put(&(x as f32).to_le_bytes());
        put(&f64::to_le_bytes(y));
        put(&(z as i16).to_le_bytes());
    }
    for face in faces {
        put(&[face.len() as u8]);
        for v in face {
            put(&v.to_le_bytes());
        }
        put(&0.5_f32.to_le_bytes());
    }
    put(&7_i32.to_le_bytes());
    bytes
}

/// The encodings of PLY.
pub const ENCODINGS: [&str; 3] = ["ascii", "binary_little_endian", "binary_big_endian"];

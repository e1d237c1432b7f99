//! Mesh files out.

use std::fmt::Write;
use std::path::Path;

use files::write_atomically;

use crate::format::Format;
use crate::vector::{Vector, scaled_normal};
use crate::{Error, TriangleMesh};

/// Writes a mesh, atomically (see [`write_atomically`]); the extension (`.obj`, `.ply`, `.stl`)
/// tells the format.
///
/// - OBJ: text; coordinates and normals as the shortest decimals that read back to the last bit.
/// - PLY: binary, little-endian, double precision, with normals.
/// - STL: binary. Single precision, no normals of vertices.
///
/// # Errors
/// [`Error::UnknownFormat`]; [`Error::NoFaces`]; [`Error::NonFiniteVertex`], for STL also beyond
/// single precision; [`Error::Normals`]; [`Error::IndexOutOfRange`]; [`Error::TooLarge`];
/// [`Error::Io`] if the file cannot be written.
pub fn write(path: impl AsRef<Path>, mesh: &TriangleMesh) -> Result<(), Error> {
    let path = path.as_ref();
    let bytes = encode(path, mesh)?;
    Ok(write_atomically(path, |out| out.write_all(&bytes))?)
}

/// The bytes that [`write()`] puts into a file of that name.
///
/// # Errors
/// Those of [`write()`] but the last.
pub fn encode(path: impl AsRef<Path>, mesh: &TriangleMesh) -> Result<Vec<u8>, Error> {
    let path = path.as_ref();
    let format = Format::of(path)?;
    mesh.check(match format {
        Format::Stl => f64::from(f32::MAX),
        Format::Obj | Format::Ply => f64::MAX,
    })?;
    let faces = u32::try_from(mesh.faces.len()).map_err(|_| Error::TooLarge {
        elements: "faces",
        count: mesh.faces.len(),
    })?;
    if faces == 0 {
        return Err(Error::NoFaces);
    }
    Ok(match format {
        Format::Obj => obj(mesh).into_bytes(),
        Format::Ply => ply(mesh),
        Format::Stl => stl(mesh, faces),
    })
}

fn obj(mesh: &TriangleMesh) -> String {
    let mut out = String::new();
    // Writing to a string does not fail.
    for [x, y, z] in &mesh.vertices {
        let _ = writeln!(out, "v {x} {y} {z}");
    }
    for [x, y, z] in mesh.normals.iter().flatten() {
        let _ = writeln!(out, "vn {x} {y} {z}");
    }
    for face in &mesh.faces {
        // Counted from one.
        let [a, b, c] = face.map(|v| u64::from(v) + 1);
        let _ = if mesh.normals.is_some() {
            writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")
        } else {
            writeln!(out, "f {a} {b} {c}")
        };
    }
    out
}

fn ply(mesh: &TriangleMesh) -> Vec<u8> {
    let axes: &[&str] = match mesh.normals {
        Some(_) => &["x", "y", "z", "nx", "ny", "nz"],
        None => &["x", "y", "z"],
    };
    let properties = axes.iter().map(|axis| format!("property double {axis}\n"));
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{}element face {}\n\
         property list uchar uint vertex_indices\nend_header\n",
        mesh.vertices.len(),
        properties.collect::<String>(),
        mesh.faces.len()
    )
    .into_bytes();
    for (vertex, position) in mesh.vertices.iter().enumerate() {
        let normal = mesh.normals.as_ref().map(|n| n[vertex]);
        let values = position.iter().chain(normal.iter().flatten());
        out.extend(values.flat_map(|value| value.to_le_bytes()));
    }
    for face in &mesh.faces {
        out.push(3);
        out.extend(face.iter().flat_map(|vertex| vertex.to_le_bytes()));
    }
    out
}

fn stl(mesh: &TriangleMesh, faces: u32) -> Vec<u8> {
    let mut out = vec![0; 80];
    out.extend(faces.to_le_bytes());
    for &face in &mesh.faces {
        // The normal is that of the rounded corners.
        let rounded = |x: Vector| x.to_array().map(|v| v as f32);
        let corners = mesh.corners(face).map(rounded);
        let normal = scaled_normal(corners.map(|x| Vector::from_array(x.map(f64::from))));
        let normal = rounded(normal.normalize_or_zero());
        let values = normal.iter().chain(corners.as_flattened());
        out.extend(values.flat_map(|value| value.to_le_bytes()));
        out.extend([0; 2]);
    }
    out
}

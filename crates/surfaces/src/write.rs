//! Mesh files out.

use std::fmt::Write;
use std::path::Path;

use files::write_atomically;
use geometry::UpAxis;

use crate::format::{Format, up_line, usual_up_axis};
use crate::vector::{Vector, scaled_normal};
use crate::{Error, TriangleMesh};

/// Writes a mesh, atomically (see [`write_atomically`]); the extension (`.obj`, `.off`, `.ply`,
/// `.stl`) tells the format.
///
/// - OBJ: text; coordinates and normals as the shortest decimals that read back to the last bit.
/// - OFF: text, in the same decimals, without normals.
/// - PLY: binary, little-endian, double precision, with normals.
/// - STL: binary. Single precision, no normals of vertices.
///
/// # Errors
/// [`Error::UnknownFormat`]; [`Error::NoFaces`]; [`Error::NonFiniteVertex`], for STL also beyond
/// single precision; [`Error::Normals`]; [`Error::IndexOutOfRange`]; [`Error::TooLarge`];
/// [`Error::Io`] if the file cannot be written.
pub fn write(path: impl AsRef<Path>, mesh: &TriangleMesh) -> Result<(), Error> {
    let path = path.as_ref();
    write_with_up(path, mesh, usual_up_axis(path)?)
}

/// As [`write()`], with the axis that points up, which the file names in a comment unless it is the [usual one](usual_up_axis()) of the format:
/// [`up_axis`](crate::up_axis()) finds it there. Coordinates stay what they are.
///
/// # Errors
/// Those of [`write()`].
pub fn write_with_up(path: impl AsRef<Path>, mesh: &TriangleMesh, up: UpAxis) -> Result<(), Error> {
    let path = path.as_ref();
    let bytes = encode_with_up(path, mesh, up)?;
    Ok(write_atomically(path, |out| out.write_all(&bytes))?)
}

/// The bytes that [`write()`] puts into a file of that name.
///
/// # Errors
/// Those of [`write()`] but the last.
pub fn encode(path: impl AsRef<Path>, mesh: &TriangleMesh) -> Result<Vec<u8>, Error> {
    let path = path.as_ref();
    encode_with_up(path, mesh, usual_up_axis(path)?)
}

/// The bytes that [`write_with_up()`] puts into a file of that name.
///
/// # Errors
/// Those of [`write()`] but the last.
pub fn encode_with_up(
    path: impl AsRef<Path>,
    mesh: &TriangleMesh,
    up: UpAxis,
) -> Result<Vec<u8>, Error> {
    let path = path.as_ref();
    let format = Format::of(path)?;
    mesh.check(match format {
        Format::Stl => f64::from(f32::MAX),
        Format::Obj | Format::Off | Format::Ply => f64::MAX,
    })?;
    let faces = u32::try_from(mesh.faces.len()).map_err(|_| Error::TooLarge {
        elements: "faces",
        count: mesh.faces.len(),
    })?;
    if faces == 0 {
        return Err(Error::NoFaces);
    }
    let comment = if up == usual_up_axis(path)? {
        String::new()
    } else {
        up_line(format, up)
    };
    Ok(match format {
        Format::Obj => (comment + &obj(mesh)).into_bytes(),
        Format::Off => off(&comment, mesh).into_bytes(),
        Format::Ply => ply(&comment, mesh),
        Format::Stl => stl(&comment, mesh, faces),
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

fn off(comment: &str, mesh: &TriangleMesh) -> String {
    let (vertices, faces) = (mesh.vertices.len(), mesh.faces.len());
    let mut out = format!("OFF\n{comment}{vertices} {faces} 0\n");
    // Writing to a string does not fail.
    for [x, y, z] in &mesh.vertices {
        let _ = writeln!(out, "{x} {y} {z}");
    }
    for [a, b, c] in &mesh.faces {
        let _ = writeln!(out, "3 {a} {b} {c}");
    }
    out
}

fn ply(comment: &str, mesh: &TriangleMesh) -> Vec<u8> {
    let mut out = ply_header(mesh, comment, "");
    ply_vertices(mesh, &mut out);
    for face in &mesh.faces {
        out.push(3);
        out.extend(face.iter().flat_map(|vertex| vertex.to_le_bytes()));
    }
    out
}

/// The header of a PLY file, whose faces have other properties besides.
pub(crate) fn ply_header(mesh: &TriangleMesh, comment: &str, of_faces: &str) -> Vec<u8> {
    let axes: &[&str] = match mesh.normals {
        Some(_) => &["x", "y", "z", "nx", "ny", "nz"],
        None => &["x", "y", "z"],
    };
    let properties = axes.iter().map(|axis| format!("property double {axis}\n"));
    format!(
        "ply\nformat binary_little_endian 1.0\n{comment}element vertex {}\n{}element face {}\n\
         property list uchar uint vertex_indices\n{of_faces}end_header\n",
        mesh.vertices.len(),
        properties.collect::<String>(),
        mesh.faces.len()
    )
    .into_bytes()
}

/// Adds the vertices with their normals.
pub(crate) fn ply_vertices(mesh: &TriangleMesh, out: &mut Vec<u8>) {
    for (vertex, position) in mesh.vertices.iter().enumerate() {
        let normal = mesh.normals.as_ref().map(|n| n[vertex]);
        let values = position.iter().chain(normal.iter().flatten());
        out.extend(values.flat_map(|value| value.to_le_bytes()));
    }
}

fn stl(comment: &str, mesh: &TriangleMesh, faces: u32) -> Vec<u8> {
    let mut out = comment.as_bytes().to_vec();
    out.resize(80, 0);
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

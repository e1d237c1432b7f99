//! Mesh files out.

use std::io::{self, Write};
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
    let mut bytes = Vec::new();
    let encoded = match format {
        Format::Obj => obj(&mut bytes, mesh),
        Format::Ply => ply(&mut bytes, mesh),
        Format::Stl => stl(&mut bytes, mesh, faces),
    };
    encoded.expect("writing to memory does not fail");
    Ok(bytes)
}

fn obj(out: &mut dyn Write, mesh: &TriangleMesh) -> io::Result<()> {
    for [x, y, z] in &mesh.vertices {
        writeln!(out, "v {x} {y} {z}")?;
    }
    for [x, y, z] in mesh.normals.iter().flatten() {
        writeln!(out, "vn {x} {y} {z}")?;
    }
    for face in &mesh.faces {
        // Counted from one.
        let [a, b, c] = face.map(|v| u64::from(v) + 1);
        if mesh.normals.is_some() {
            writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
        } else {
            writeln!(out, "f {a} {b} {c}")?;
        }
    }
    Ok(())
}

fn ply(out: &mut dyn Write, mesh: &TriangleMesh) -> io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0")?;
    writeln!(out, "element vertex {}", mesh.vertices.len())?;
    for axis in ["x", "y", "z"] {
        writeln!(out, "property double {axis}")?;
    }
    if mesh.normals.is_some() {
        for axis in ["nx", "ny", "nz"] {
            writeln!(out, "property double {axis}")?;
        }
    }
    writeln!(out, "element face {}", mesh.faces.len())?;
    writeln!(out, "property list uchar uint vertex_indices\nend_header")?;
    for (vertex, position) in mesh.vertices.iter().enumerate() {
        let normal = mesh.normals.as_ref().map(|n| n[vertex]);
        for value in position.iter().chain(normal.iter().flatten()) {
            out.write_all(&value.to_le_bytes())?;
        }
    }
    for face in &mesh.faces {
        out.write_all(&[3])?;
        for vertex in face {
            out.write_all(&vertex.to_le_bytes())?;
        }
    }
    Ok(())
}

fn stl(out: &mut dyn Write, mesh: &TriangleMesh, faces: u32) -> io::Result<()> {
    out.write_all(&[0; 80])?;
    out.write_all(&faces.to_le_bytes())?;
    for &face in &mesh.faces {
        // The normal is that of the rounded corners.
        let rounded = |x: Vector| x.to_array().map(|v| v as f32);
        let corners = mesh.corners(face).map(rounded);
        let normal = scaled_normal(corners.map(|x| Vector::from_array(x.map(f64::from))));
        let normal = rounded(normal.normalize_or_zero());
        for value in [normal].as_flattened().iter().chain(corners.as_flattened()) {
            out.write_all(&value.to_le_bytes())?;
        }
        out.write_all(&[0; 2])?;
    }
    Ok(())
}

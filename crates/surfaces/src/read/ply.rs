//! PLY, ASCII and binary of both byte orders.

mod body;
mod header;

use body::Body;
use header::{Element, Header};

use super::{FormatError, Polygons, finite, level, normals_like};
use crate::TriangleMesh;

/// Elements that hold faces: polygons, and strips of triangles.
const FACES: [&str; 2] = ["face", STRIPS];
const STRIPS: &str = "tristrips";

const NO_VERTICES: FormatError = FormatError::Undeclared("an element vertex");

pub(super) fn decode(bytes: &[u8]) -> Result<TriangleMesh, FormatError> {
    let header = Header::parse(bytes)?;
    let vertices = header.element("vertex").ok_or(NO_VERTICES)?;
    if FACES.iter().all(|name| header.element(name).is_none()) {
        return Err(FormatError::Undeclared("an element face or tristrips"));
    }
    let mut polygons = Polygons::new(vertices.count, 0)?;
    let mut mesh = TriangleMesh::default();
    let mut body = Body::new(&header, bytes);
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => read_vertices(&mut body, element, &mut mesh)?,
            name if FACES.contains(&name) => read_faces(&mut body, element, &mut polygons)?,
            _ => body.rows(element, |_, _| Ok(()))?,
        }
    }
    mesh.faces = polygons.finish()?;
    Ok(mesh)
}

/// Positions, and normals if the file has them.
fn read_vertices(
    body: &mut Body,
    element: &Element,
    mesh: &mut TriangleMesh,
) -> Result<(), FormatError> {
    let axes = element
        .scalars(["x", "y", "z"])
        .ok_or(FormatError::Undeclared("x, y and z of vertex"))?;
    let normal_axes = element.scalars(["nx", "ny", "nz"]);
    let mut normals = Vec::new();
    mesh.vertices.reserve_exact(element.count);
    body.rows(element, |vertex, row| {
        let position = axes.map(|p| row[p].numbers[0]);
        mesh.vertices.push(finite(position, vertex)?);
        normals.extend(normal_axes.map(|axes| axes.map(|p| row[p].numbers[0])));
        Ok(())
    })?;
    // Nothing here needs the normals: bad ones are dropped.
    let usable = normal_axes.is_some() && normals.as_flattened().iter().all(|v| v.is_finite());
    mesh.normals = usable.then_some(normals);
    Ok(())
}

fn read_faces(
    body: &mut Body,
    element: &Element,
    polygons: &mut Polygons,
) -> Result<(), FormatError> {
    let list = ["vertex_indices", "vertex_index"]
        .into_iter()
        .find_map(|name| element.indices(name))
        .ok_or(FormatError::Undeclared(
            "a list vertex_indices of its faces",
        ))?;
    let mut corners = Vec::new();
    body.rows(element, |face, row| {
        corners.clear();
        corners.extend(row[list].numbers.iter().map(|&index| index as i64));
        if element.name == STRIPS {
            return push_strips(polygons, face, &corners);
        }
        polygons.push(face, &corners)
    })
}

/// Adds strips that end at an index of -1: every three vertices in a row are a triangle, every second one turned round. A vertex that is
/// given twice, where a strip turns, makes none.
fn push_strips(polygons: &mut Polygons, number: usize, indices: &[i64]) -> Result<(), FormatError> {
    for strip in indices.split(|&index| index == -1) {
        for (k, corners) in strip.windows(3).enumerate() {
            let [a, b, c] = [corners[0], corners[1], corners[2]];
            if a != b && b != c && c != a {
                polygons.push(number, &if k % 2 == 0 { [a, b, c] } else { [b, a, c] })?;
            }
        }
    }
    Ok(())
}

/// The vertices of a file, and its numbers from these on.
fn vertices<'a, 'b>(
    header: &'a Header,
    bytes: &'b [u8],
) -> Result<(&'a Element, Body<'b>), FormatError> {
    let mut body = Body::new(header, bytes);
    for element in &header.elements {
        if element.name == "vertex" {
            return Ok((element, body));
        }
        body.rows(element, |_, _| Ok(()))?;
    }
    Err(NO_VERTICES)
}

/// The colours of the vertices, if they have some.
pub(super) fn colours(bytes: &[u8]) -> Result<Option<Vec<[u8; 3]>>, FormatError> {
    let header = Header::parse(bytes)?;
    let (element, mut body) = vertices(&header, bytes)?;
    let Some(columns) = element.scalars(["red", "green", "blue"]) else {
        return Ok(None);
    };
    let mut colours = Vec::with_capacity(element.count);
    body.rows(element, |_, row| {
        colours.push(columns.map(|column| {
            let value = row[column].numbers[0];
            if element.properties[column].scalar.is_integer() {
                value as u8
            } else {
                level(value)
            }
        }));
        Ok(())
    })?;
    Ok(Some(colours))
}

/// The file with other coordinates of vertices, and other normals if it has some.
pub(super) fn rewrite(bytes: &[u8], moved: &TriangleMesh) -> Result<Vec<u8>, FormatError> {
    let header = Header::parse(bytes)?;
    let (element, mut body) = vertices(&header, bytes)?;
    let mut normals = Vec::new();
    if element.scalars(["nx", "ny", "nz"]).is_some() {
        normals = normals_like(decode(bytes)?, moved);
    }
    let new = [
        (["x", "y", "z"], &moved.vertices),
        (["nx", "ny", "nz"], &normals),
    ];
    let mut columns: Vec<_> = (new.iter())
        .flat_map(|(names, values)| (0..3).map(move |axis| (names[axis], axis, *values)))
        .filter_map(|(name, axis, values)| Some((element.scalar(name)?, axis, values)))
        .collect();
    // In the order of the file.
    columns.sort_by_key(|(column, ..)| *column);
    let kind = |column: usize| element.properties[column].scalar;
    if columns
        .iter()
        .any(|(column, ..)| kind(*column).is_integer())
    {
        return Err(FormatError::Undeclared(
            "x, y and z of vertex as float or double",
        ));
    }
    let (mut out, mut copied) = (Vec::with_capacity(bytes.len()), 0);
    body.rows(element, |number, row| {
        for &(column, axis, values) in &columns {
            let old = &row[column].place;
            if let Some(position) = values.get(number) {
                out.extend_from_slice(&bytes[copied..old.start]);
                out.extend(header.encoding.bytes(kind(column), position[axis]));
                copied = old.end;
            }
        }
        Ok(())
    })?;
    out.extend_from_slice(&bytes[copied..]);
    Ok(out)
}

//! PLY, by `ply-rs-bw`, after a check of what the header announces.

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};

use super::{FormatError, Polygons, shortened};
use crate::TriangleMesh;

pub(super) fn decode(bytes: &[u8]) -> Result<TriangleMesh, FormatError> {
    let mut reader = Reader::new(bytes);
    let header = Parser::<PassedOver>::new()
        .read_header(&mut reader)
        .map_err(|e| said(&e))?;
    let before = bytes.len() - reader.get_ref().len();
    for element in header.elements.values() {
        check_length(element, header.encoding, before, bytes.len())?;
    }
    let (mut vertices, mut faces) = (None, None);
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => {
                for axis in AXES {
                    if !element.properties.contains_key(axis) {
                        return Err(FormatError::Undeclared {
                            missing: "x, y and z of vertex",
                        });
                    }
                }
                let read =
                    Parser::<Vertex>::new().read_payload_for_element(&mut reader, element, &header);
                let normals = NORMAL.iter().all(|n| element.properties.contains_key(*n));
                vertices = Some((read.map_err(|e| said(&e))?, normals));
            }
            "face" => {
                if !LISTS.iter().any(|n| element.properties.contains_key(*n)) {
                    return Err(FormatError::Undeclared {
                        missing: "a list vertex_indices of face",
                    });
                }
                let read =
                    Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header);
                faces = Some(read.map_err(|e| said(&e))?);
            }
            _ => {
                Parser::<PassedOver>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| said(&e))?;
            }
        }
    }
    let (vertices, has_normals) = vertices.ok_or(FormatError::Undeclared {
        missing: "an element vertex",
    })?;
    let faces = faces.ok_or(FormatError::Undeclared {
        missing: "an element face",
    })?;
    let non_finite = |x: &[f64; 3]| x.iter().copied().find(|v| !v.is_finite());
    for (vertex, read) in vertices.iter().enumerate() {
        if let Some(value) = non_finite(&read.position) {
            return Err(FormatError::NonFinite { vertex, value });
        }
    }
    let mut polygons = Polygons::new(vertices.len(), 0)?;
    for (face, read) in faces.iter().enumerate() {
        polygons.push(face, &read.corners)?;
    }
    // Nothing here needs the normals: bad ones are dropped.
    let usable = has_normals && vertices.iter().all(|v| non_finite(&v.normal).is_none());
    Ok(TriangleMesh {
        faces: polygons.finish()?,
        normals: usable.then(|| vertices.iter().map(|v| v.normal).collect()),
        vertices: vertices.iter().map(|v| v.position).collect(),
    })
}

/// A library message in one line.
fn said(error: &ParseError) -> FormatError {
    FormatError::Ply {
        message: shortened(&error.to_string()),
    }
}

/// Refuses counts for which the file is too short, before anything is allocated.
fn check_length(
    element: &ElementDef,
    encoding: Encoding,
    before: usize,
    length: usize,
) -> Result<(), FormatError> {
    if element.properties.is_empty() && element.count > 0 {
        return Err(FormatError::NoProperties {
            element: element.name.clone(),
            count: element.count,
        });
    }
    // In text, a digit and a separator; a list may be empty.
    let least = |data_type: &PropertyType| match (encoding, data_type) {
        (Encoding::Ascii, _) => 2,
        (_, PropertyType::Scalar(scalar) | PropertyType::List(scalar, _)) => size(scalar),
    };
    let each: u64 = element
        .properties
        .values()
        .map(|p| least(&p.data_type))
        .sum();
    let count = element.count as u64;
    // The last line of a text may lack its end.
    let missing = u64::from(encoding == Encoding::Ascii && count > 0);
    let expected = count.saturating_mul(each).saturating_add(before as u64) - missing;
    if expected > length as u64 {
        return Err(FormatError::Length {
            elements: format!("elements {:?}", shortened(&element.name)),
            count,
            expected,
            found: length as u64,
        });
    }
    Ok(())
}

fn size(scalar: &ScalarType) -> u64 {
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];
const NORMAL: [&str; 3] = ["nx", "ny", "nz"];
const LISTS: [&str; 2] = ["vertex_indices", "vertex_index"];

struct Vertex {
    position: [f64; 3],
    normal: [f64; 3],
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self {
            position: [0.0; 3],
            normal: [0.0; 3],
        }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = |names: [&str; 3]| names.iter().position(|n| *n == name);
        let target = if let Some(axis) = axis(AXES) {
            &mut self.position[axis]
        } else if let Some(axis) = axis(NORMAL) {
            &mut self.normal[axis]
        } else {
            return PropertyAccessResult::Ignored;
        };
        *target = match property {
            Property::Char(v) => f64::from(v),
            Property::UChar(v) => f64::from(v),
            Property::Short(v) => f64::from(v),
            Property::UShort(v) => f64::from(v),
            Property::Int(v) => f64::from(v),
            Property::UInt(v) => f64::from(v),
            Property::Float(v) => f64::from(v),
            Property::Double(v) => v,
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

struct Face {
    corners: Vec<i64>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self {
            corners: Vec::new(),
        }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        fn widened<T: Into<i64>>(list: Vec<T>) -> Vec<i64> {
            list.into_iter().map(Into::into).collect()
        }
        if !LISTS.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        self.corners = match property {
            Property::ListChar(list) => widened(list),
            Property::ListUChar(list) => widened(list),
            Property::ListShort(list) => widened(list),
            Property::ListUShort(list) => widened(list),
            Property::ListInt(list) => widened(list),
            Property::ListUInt(list) => widened(list),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// Any other element.
struct PassedOver;

impl PropertyAccess for PassedOver {
    fn new() -> Self {
        Self
    }

    fn set_property(&mut self, _: &str, _: Property) -> PropertyAccessResult {
        PropertyAccessResult::Ignored
    }
}

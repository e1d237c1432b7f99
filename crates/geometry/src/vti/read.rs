//! The reader: XML to named fields.

use std::path::Path;

use roxmltree::{Document, Node};

use files::{Number, shortened};

use super::error::VtiError;
use super::stream::{Fault, Format, Stream, number};
use crate::npy::reversed;
use crate::{Error, Field, Grid};

/// Most elements, and most attributes, of a file. Those of VTK have some tens.
const MOST_ELEMENTS: usize = 10_000;
/// Most values of all arrays together, beyond those that have a byte each in the file: compressed
/// data can be a thousand times as long, and arrays can share theirs.
const MOST_VALUES: u64 = 1 << 28;

/// Reads all point arrays of a file, in its order.
///
/// Understood are scalar arrays of any of VTK's number types, as text, base64 or raw bytes, inline
/// or appended, in either byte order, uncompressed or compressed by zlib. The nodes of the image
/// become those of the grid, whose side is thus `N` and not `N - 1` times the spacing: the
/// repeated last layer of a periodic grid is not in the file.
///
/// Memory: 24 bytes for every value, 32 times the size of the file, and 2 MiB. There may be as many
/// values as the file has bytes, or 2^28 if it has fewer (of compressed data, or arrays that share
/// theirs).
///
/// # Errors
/// [`Error::Io`]; [`Error::Vti`] for what is not understood and for images that are no cubes;
/// [`Error::NonFinite`] for values that are not finite.
pub fn read<const D: usize>(path: impl AsRef<Path>) -> Result<Vec<(String, Field<D>)>, Error> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|source| Error::Io {
        action: "read",
        path: path.into(),
        source,
    })?;
    let image = decode::<D>(&bytes).map_err(|source| Error::Vti {
        path: path.into(),
        source,
    })?;
    let grid = Grid::new(image.cells, image.spacing * image.cells as f64)?;
    let grid = grid.with_origin(image.origin)?;
    let arrays = image.arrays.into_iter();
    arrays
        .map(|(name, values)| Ok((name, Field::from_values(grid, values)?)))
        .collect()
}

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Image<const D: usize> {
    /// Nodes along every axis.
    pub cells: usize,
    /// Position of the first node.
    pub origin: [f64; D],
    /// Distance of neighbouring nodes.
    pub spacing: f64,
    /// Names and nodal values, row-major, last axis fastest; possibly not finite.
    pub arrays: Vec<(String, Vec<f64>)>,
}

/// Decodes the bytes of a file.
///
/// # Errors
/// See [`read`].
pub fn decode<const D: usize>(bytes: &[u8]) -> Result<Image<D>, VtiError> {
    const { assert!(D >= 1 && D <= 3, "VTK image data have one to three axes") };
    let (text, appended) = split(bytes)?;
    // The parser allocates by these numbers.
    for mark in ['<', '='] {
        let count = text.matches(mark).count();
        if count > MOST_ELEMENTS {
            return Err(VtiError::TooManyElements {
                count,
                limit: MOST_ELEMENTS,
            });
        }
    }
    let document = Document::parse(&text).map_err(|error| VtiError::Xml {
        reason: shortened(&error.to_string(), 160),
    })?;
    let file = document.root_element();
    if file.tag_name().name() != "VTKFile" {
        return Err(VtiError::NoElement { element: "VTKFile" });
    }
    one_of(file, "VTKFile", "type", &["ImageData"], None)?;
    let format = Format {
        big_endian: one_of(
            file,
            "VTKFile",
            "byte_order",
            &["LittleEndian", "BigEndian"],
            Some("LittleEndian"),
        )? == "BigEndian",
        header: match one_of(
            file,
            "VTKFile",
            "header_type",
            &["UInt32", "UInt64"],
            Some("UInt32"),
        )? {
            "UInt64" => 8,
            _ => 4,
        },
        compressed: file.has_attribute("compressor"),
    };
    one_of(
        file,
        "VTKFile",
        "compressor",
        &["vtkZLibDataCompressor"],
        Some("vtkZLibDataCompressor"),
    )?;

    let image = child(file, "ImageData")?;
    let whole: [i64; 6] = numbers(image, "ImageData", "WholeExtent", None)?;
    let nodes = [0, 1, 2].map(|axis| {
        let count = i128::from(whole[2 * axis + 1]) - i128::from(whole[2 * axis]) + 1;
        u64::try_from(count.max(0)).unwrap_or(u64::MAX)
    });
    if nodes[0] < 2 || (0..3).any(|k| nodes[k] != if k < D { nodes[0] } else { 1 }) {
        return Err(VtiError::NotCubical {
            nodes,
            dimension: D,
        });
    }
    let spacing: [f64; 3] = numbers(image, "ImageData", "Spacing", Some("1 1 1"))?;
    let h = spacing[0];
    let alike = |s: f64| (s - h).abs() <= 1e-6 * h;
    if !(h.is_finite() && h > 0.0 && spacing[..D].iter().all(|&s| alike(s))) {
        return Err(VtiError::Spacing { spacing });
    }
    let origin: [f64; 3] = numbers(image, "ImageData", "Origin", Some("0 0 0"))?;
    let direction: [f64; 9] = numbers(image, "ImageData", "Direction", Some("1 0 0 0 1 0 0 0 1"))?;
    let identity = |(k, &v): (usize, &f64)| (v - f64::from(u8::from(k % 4 == 0))).abs() < 1e-9;
    if !direction.iter().enumerate().all(identity) {
        return Err(VtiError::Attribute {
            element: "ImageData",
            attribute: "Direction",
            value: excerpt(image.attribute("Direction").unwrap_or_default()),
            requirement: "the identity",
        });
    }

    let mut pieces = image.children().filter(|n| n.has_tag_name("Piece"));
    let (piece, more) = (pieces.next(), pieces.count());
    let piece = match (piece, more) {
        (Some(piece), 0) => piece,
        (piece, more) => {
            let count = usize::from(piece.is_some()) + more;
            return Err(VtiError::Pieces { count });
        }
    };
    let extent: [i64; 6] = numbers(piece, "Piece", "Extent", image.attribute("WholeExtent"))?;
    if extent != whole {
        let written = |node: Node<'_, '_>, name| excerpt(node.attribute(name).unwrap_or_default());
        return Err(VtiError::PartialPiece {
            piece: written(piece, "Extent"),
            whole: written(image, "WholeExtent"),
        });
    }
    let has_arrays = |group: &Node<'_, '_>| group.children().any(|n| n.has_tag_name("DataArray"));
    let group = |name: &str| {
        let groups = piece.children().filter(|n| n.has_tag_name(name));
        groups.into_iter().find(has_arrays)
    };
    let points = group("PointData").ok_or_else(|| VtiError::NoPointData {
        cell_data: group("CellData").is_some(),
    })?;
    let reader = Reader {
        format,
        nodes: nodes[..D].iter().fold(1, |n: u64, &k| n.saturating_mul(k)),
        cells: nodes[0] as usize,
        appended,
        appended_base64: file
            .children()
            .find(|n| n.has_tag_name("AppendedData"))
            .map(|n| {
                one_of(
                    n,
                    "AppendedData",
                    "encoding",
                    &["raw", "base64"],
                    Some("base64"),
                )
            })
            .transpose()?
            == Some("base64"),
    };
    let data_arrays = || points.children().filter(|n| n.has_tag_name("DataArray"));
    let limit = MOST_VALUES.max(bytes.len() as u64);
    if reader.nodes.saturating_mul(data_arrays().count() as u64) > limit {
        return Err(VtiError::TooManyValues {
            arrays: data_arrays().count(),
            nodes: reader.nodes,
            limit,
        });
    }
    let mut arrays: Vec<(String, Vec<f64>)> = Vec::new();
    for array in data_arrays() {
        let name = array.attribute("Name").unwrap_or_default();
        if name.is_empty() || arrays.iter().any(|(other, _)| other == name) {
            return Err(VtiError::Name {
                name: excerpt(name),
            });
        }
        arrays.push((name.into(), reader.values::<D>(array, name)?));
    }
    Ok(Image {
        cells: nodes[0] as usize,
        // The origin is that of node 0, which need not be the first of the extent.
        origin: std::array::from_fn(|axis| origin[axis] + h * whole[2 * axis] as f64),
        spacing: h,
        arrays,
    })
}

/// The XML without appended data, closed again, and the appended data.
fn split(bytes: &[u8]) -> Result<(String, &[u8]), VtiError> {
    const TAG: &[u8] = b"<AppendedData";
    let start = bytes.windows(TAG.len()).position(|w| w == TAG);
    let end = start.and_then(|s| Some(s + bytes[s..].iter().position(|&b| b == b'>')? + 1));
    let (head, data) = match end {
        Some(end) if !bytes[..end].ends_with(b"/>") => bytes.split_at(end),
        _ => (bytes, &[][..]),
    };
    let text = std::str::from_utf8(head).map_err(|error| VtiError::Xml {
        reason: error.to_string(),
    })?;
    if head.len() == bytes.len() {
        return Ok((text.into(), data));
    }
    let closed = format!("{text}</AppendedData></VTKFile>");
    let white = data.iter().take_while(|b| b.is_ascii_whitespace()).count();
    // An underscore marks the beginning.
    let data = data[white..].strip_prefix(b"_").unwrap_or_default();
    Ok((closed, data))
}

/// The start of a text of the file, for a message.
fn excerpt(text: &str) -> String {
    shortened(text, 60)
}

fn child<'a, 'input>(
    parent: Node<'a, 'input>,
    element: &'static str,
) -> Result<Node<'a, 'input>, VtiError> {
    let mut children = parent.children();
    let found = children.find(|node| node.has_tag_name(element));
    found.ok_or(VtiError::NoElement { element })
}

/// The value of an attribute that must be one of a few.
fn one_of<'a>(
    node: Node<'a, '_>,
    element: &'static str,
    attribute: &'static str,
    allowed: &[&'static str],
    default: Option<&'static str>,
) -> Result<&'static str, VtiError> {
    let value: Option<&'a str> = node.attribute(attribute);
    let wanted = value.or(default).unwrap_or_default();
    let found = allowed.iter().find(|&&candidate| candidate == wanted);
    found.copied().ok_or_else(|| VtiError::Attribute {
        element,
        attribute,
        value: excerpt(wanted),
        requirement: match attribute {
            "type" => "ImageData",
            "byte_order" => "LittleEndian or BigEndian",
            "header_type" => "UInt32 or UInt64",
            "compressor" => "absent or vtkZLibDataCompressor",
            "encoding" => "raw or base64",
            _ => "ascii, binary or appended",
        },
    })
}

/// The numbers of an attribute.
fn numbers<T: std::str::FromStr + Copy, const N: usize>(
    node: Node<'_, '_>,
    element: &'static str,
    attribute: &'static str,
    default: Option<&str>,
) -> Result<[T; N], VtiError> {
    let text = node.attribute(attribute).or(default).unwrap_or_default();
    let parsed: Result<Vec<T>, _> = text.split_ascii_whitespace().map(str::parse).collect();
    let parsed = parsed.ok().and_then(|numbers| numbers.try_into().ok());
    parsed.ok_or_else(|| VtiError::Attribute {
        element,
        attribute,
        value: excerpt(text),
        requirement: "a list of as many numbers as VTK prescribes",
    })
}

/// What all arrays of a file have in common.
struct Reader<'a> {
    format: Format,
    /// Values of an array.
    nodes: u64,
    cells: usize,
    appended: &'a [u8],
    appended_base64: bool,
}

impl Reader<'_> {
    /// The values of one array in our order.
    fn values<const D: usize>(
        &self,
        array: Node<'_, '_>,
        name: &str,
    ) -> Result<Vec<f64>, VtiError> {
        let components = array.attribute("NumberOfComponents").unwrap_or("1");
        if components.trim() != "1" {
            return Err(VtiError::Components {
                name: excerpt(name),
                components: excerpt(components),
            });
        }
        let kind = array.attribute("type").unwrap_or_default();
        let number = number(kind).ok_or_else(|| VtiError::Attribute {
            element: "DataArray",
            attribute: "type",
            value: excerpt(kind),
            requirement: "Float32, Float64, or Int or UInt with 8, 16, 32 or 64",
        })?;
        let formats = ["ascii", "binary", "appended"];
        // Other elements, such as information keys, may stand before the text.
        let text: String = array
            .children()
            .filter_map(|n| if n.is_text() { n.text() } else { None })
            .collect();
        let stored = match one_of(array, "DataArray", "format", &formats, None)? {
            "ascii" => self.parse(&text, name)?,
            "binary" => self.decode(Stream::base64(text.as_bytes()), number, name)?,
            _ => {
                let [offset] = numbers::<usize, 1>(array, "DataArray", "offset", Some("0"))?;
                let data = self.appended.get(offset..).unwrap_or_default();
                let stream = if self.appended_base64 {
                    Stream::base64(data)
                } else {
                    Stream::raw(data)
                };
                self.decode(stream, number, name)?
            }
        };
        // VTK's fastest axis is our slowest.
        let nodes = 0..stored.len();
        Ok(nodes
            .map(|index| stored[reversed::<D>(index, self.cells)])
            .collect())
    }

    fn parse(&self, text: &str, name: &str) -> Result<Vec<f64>, VtiError> {
        let parsed: Result<Vec<f64>, _> = text.split_ascii_whitespace().map(str::parse).collect();
        let values = parsed.map_err(|_| VtiError::Data {
            name: excerpt(name),
            reason: "a word is not a number",
        })?;
        let found = values.len() as u64;
        if found != self.nodes {
            return Err(VtiError::Length {
                name: excerpt(name),
                expected: self.nodes,
                found,
            });
        }
        Ok(values)
    }

    fn decode(
        &self,
        mut stream: Stream<'_>,
        number: Number,
        name: &str,
    ) -> Result<Vec<f64>, VtiError> {
        let expected = self.nodes.saturating_mul(number.size() as u64);
        let bytes = stream
            .block(self.format, expected)
            .map_err(|fault| match fault {
                Fault::Length(found) => VtiError::Length {
                    name: excerpt(name),
                    expected,
                    found,
                },
                Fault::Broken(reason) => VtiError::Data {
                    name: excerpt(name),
                    reason,
                },
            })?;
        let chunks = bytes.chunks_exact(number.size());
        Ok(chunks
            .map(|b| number.decode(b, self.format.big_endian))
            .collect())
    }
}

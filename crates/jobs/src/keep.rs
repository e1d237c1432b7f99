//! What `keep` leaves where it is.

use clap::builder::{OsStringValueParser, TypedValueParser};
use rstar::RTree;

use crate::paths::{MESHES, extension, of_text, to_text};
use crate::prelude::*;

/// The file of the mask, if it is one.
pub fn mask(text: &str) -> Option<PathBuf> {
    let path = PathBuf::from(of_text(text));
    MESHES.contains(&&*extension(&path)).then_some(path)
}

/// What is typed, as the text of a name that may be that of a file.
pub fn parser() -> impl TypedValueParser<Value = String> {
    OsStringValueParser::new().map(|name| to_text(&name))
}

/// The distance of what stays, from what was typed, with the bytes of the mask, for a mesh, the bytes of its file and the name of that. What is
/// on the boundary stays too. For a colour it tells which vertices are nearer, so that nodes far from all of them stay or move as the nearest one does.
pub fn parse(
    text: &str,
    mask: Option<&[u8]>,
    mesh: &TriangleMesh,
    bytes: &[u8],
    file: &str,
) -> Result<Box<dyn SignedDistance<3>>> {
    let wrong = |reason| Refusal::Value {
        option: "keep",
        value: Some(text.to_owned()),
        reason,
    };
    if let Some(colour) = text.strip_prefix("colour:") {
        let digits = colour.strip_prefix('#').unwrap_or(colour);
        let value = u32::from_str_radix(digits, 16).ok();
        let Some(value) = value.filter(|_| digits.len() == 6) else {
            return Err(Refusal::KeepColour(text.to_owned()).into());
        };
        let [_, colour @ ..] = value.to_be_bytes();
        let Some(colours) = surfaces::vertex_colours(bytes, file)? else {
            return Err(Refusal::KeepWithoutColours.into());
        };
        let vertices = mesh.vertices.iter().copied().zip(colours);
        let (kept, others): (Vec<_>, Vec<_>) = vertices.partition(|(_, of)| *of == colour);
        let positions = [kept, others].map(|part| part.into_iter().map(|(x, _)| x).collect());
        return Ok(Box::new(nearer(positions.map(RTree::bulk_load))));
    }
    if let Some(mask) = mask {
        let mesh = surfaces::decode(mask, text)?;
        let mended = ClosedMesh::mended(mesh).map_err(|error| wrong(error.to_string()))?;
        return Ok(Box::new(MeshDistance::new(&mended.mesh)));
    }
    let region: Region = text.parse().map_err(wrong)?;
    Ok(region.shape()?)
}

/// Half of how much farther the first points are than the others, which changes by no more than the way: negative where the first are
/// nearer, and zero where both share a position. Where there are no points, they are infinitely far.
fn nearer(points: [RTree<[f64; 3]>; 2]) -> impl SignedDistance<3> {
    move |x: [f64; 3]| {
        let [first, others] = points.each_ref().map(|tree| {
            let nearest = tree.nearest_neighbor_with_distance_2(x);
            nearest.map_or(f64::INFINITY, |(_, squared)| squared.sqrt())
        });
        0.5 * (first - others)
    }
}

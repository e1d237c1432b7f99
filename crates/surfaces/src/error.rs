//! Everything that can go wrong in this crate.

#![allow(missing_docs, reason = "messages and names say it")]

use std::path::PathBuf;

use crate::Overlap;
use crate::read::error::FormatError;

/// Errors of mesh files, checks, placement and isosurfaces, each with the numbers needed to act on
/// it.
///
/// Faces and vertices are counted from zero, in the order of the mesh.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    #[error(
        "{path} has no known extension; meshes are read and written as .obj, .off, .ply or .stl",
        path = path.display()
    )]
    UnknownFormat { path: PathBuf },
    #[error(
        "{path} cannot hold the labels on the sides of walls; .ply and .obj can",
        path = path.display()
    )]
    NoLabels { path: PathBuf },
    #[error("{path} cannot be read as a mesh: {problem}", path = path.display())]
    Format { path: PathBuf, problem: FormatError },
    /// Grids and fields, and numbers outside their range.
    #[error(transparent)]
    Geometry(#[from] geometry::Error),
    #[error(transparent)]
    Io(#[from] files::Error),
    /// A shape or a region that cannot be built from its description.
    #[error("{0}")]
    Shape(String),
    #[error("the mesh has no faces; a surface needs at least four")]
    NoFaces,
    #[error(
        "the mesh encloses nothing that could be repaired: nowhere on a grid of cells of {spacing:.3e} do its faces wind round by more than half"
    )]
    EnclosesNothing {
        /// Side of the cells of the grid on which it was looked for.
        spacing: f64,
    },
    /// A coordinate is NaN or infinite, or does not fit the numbers of the file.
    #[error("vertex {vertex} is {position:?}; all coordinates must be finite{}", within(*limit))]
    NonFiniteVertex {
        /// The first such vertex.
        vertex: usize,
        position: [f64; 3],
        /// Largest magnitude that the format holds.
        limit: f64,
    },
    #[error(
        "{normals} normals for {vertices} vertices, {finite} of them finite; \
         every vertex needs one, or the mesh none"
    )]
    Normals {
        normals: usize,
        finite: usize,
        vertices: usize,
    },
    #[error("face {face} refers to vertex {vertex}, but there are {vertices} vertices")]
    IndexOutOfRange {
        /// The first such face.
        face: usize,
        vertex: u32,
        vertices: usize,
    },
    #[error("{count} {elements} are more than 32-bit indices can count; use a coarser mesh")]
    TooLarge {
        elements: &'static str,
        count: usize,
    },
    #[error(
        "the surface is open: {edges} edges belong to one face only, such as {from:?} - {to:?} of \
         face {face}; close the holes"
    )]
    Open {
        edges: usize,
        face: usize,
        from: [f64; 3],
        to: [f64; 3],
    },
    #[error(
        "the surface is not a manifold: {edges} edges belong to more than two faces, such as \
         {from:?} - {to:?} of face {face} and {others} others; remove the inner or doubled sheets"
    )]
    NonManifold {
        edges: usize,
        face: usize,
        others: usize,
        from: [f64; 3],
        to: [f64; 3],
    },
    #[error(
        "the orientation is mixed: {edges} edges are run through twice in the same direction, \
         such as {from:?} - {to:?} by the faces {first} and {second}; orient all faces alike"
    )]
    MixedOrientation {
        edges: usize,
        first: usize,
        second: usize,
        from: [f64; 3],
        to: [f64; 3],
    },
    #[error(
        "{faces} faces have no area, such as face {face} with the corners {corners:?} on a line; \
         merge their vertices or flip their longest edges"
    )]
    NoArea {
        faces: usize,
        face: usize,
        corners: [[f64; 3]; 3],
    },
    #[error(
        "the enclosed volume {volume:e} is zero up to rounding (area {area:e}), so that inside \
         and outside cannot be told apart"
    )]
    NoVolume { volume: f64, area: f64 },
    #[error(
        "the surface is open, and lids on its {holes} holes would cross it or lie on it ({faces} faces): close the holes"
    )]
    LidCrosses {
        holes: usize,
        /// Faces that cross others only with lids.
        faces: usize,
    },
    #[error(
        "the surface has {parts} loose parts and {holes} holes, of which at most {most} are closed one by one: join its faces"
    )]
    Loose {
        parts: usize,
        holes: usize,
        /// Most of either.
        most: usize,
    },
    #[error("{0}")]
    Overlap(Overlap),
    #[error(
        "the component with face {face} is oriented {orientation}, but {enclosing} other \
         components enclose it where {expected} should; unite overlapping parts, orient cavities \
         inwards"
    )]
    Nesting {
        face: usize,
        /// `outwards` or `inwards`.
        orientation: &'static str,
        /// Winding number of the other components about it.
        enclosing: i64,
        /// What it should be: 0 outwards, 1 inwards.
        expected: i64,
    },
}

fn within(limit: f64) -> String {
    if limit < f64::MAX {
        format!(" and at most {limit:e} in this format")
    } else {
        String::new()
    }
}

//! Where voxels are.

use glam::{DAffine3, DMat3, DVec3};

use super::bad;
use super::entries::Entries;
use crate::FormatError;
use crate::read::{Frames, size};

/// Most axes that NRRD has.
const MOST: usize = 16;
/// Kinds of axes in space, and what stands for none.
const IN_SPACE: [&str; 4] = ["domain", "space", "???", "none"];

/// Three axes in space, and perhaps one of several volumes.
pub struct Axes {
    pub size: [u64; 3],
    pub frames: Frames,
    /// From coordinates in voxels to positions, along right, anterior and superior axes if the space is that of a body.
    pub affine: DAffine3,
}

impl Axes {
    pub fn of(entries: &Entries<'_>) -> Result<Self, FormatError> {
        let counts = counts(entries)?;
        let steps = steps(entries, counts.len())?;
        let [(i, x), (j, y), (k, z)] = steps[..] else {
            let kinds = entries.kinds.or(entries.directions).unwrap_or("missing");
            return bad(
                "kinds or space directions",
                kinds,
                "those of three axes in space",
            );
        };
        let size = size("NRRD", [i, j, k].map(|axis| counts[axis] as f64))?;
        let list = (0..counts.len()).find(|axis| ![i, j, k].contains(axis));
        let frames = list.map(|axis| Frames {
            count: counts[axis],
            row: counts[..axis]
                .iter()
                .fold(1, |all: u64, &n| all.saturating_mul(n)),
        });
        let own = DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), origin(entries)?);
        Ok(Self {
            size,
            frames: frames.unwrap_or(Frames::in_turn(1, size)),
            affine: DAffine3::from_scale(signs(entries)?) * own,
        })
    }
}

/// The numbers of voxels along all axes.
fn counts(entries: &Entries<'_>) -> Result<Vec<u64>, FormatError> {
    let dimension = entries.dimension.unwrap_or("missing");
    let Ok(axes @ 3..=4) = dimension.parse() else {
        return bad("dimension", dimension, "3, or 4 for several volumes");
    };
    let sizes = entries.sizes.unwrap_or("missing");
    let counts = sizes.split_whitespace().take(MOST).map(str::parse);
    let counts: Vec<u64> = counts.collect::<Result<_, _>>().unwrap_or_default();
    if counts.len() != axes || counts.contains(&0) {
        return bad("sizes", sizes, "as many positive whole numbers as axes");
    }
    Ok(counts)
}

/// The axes in space, and the steps along them. If nothing tells which one of four axes is not in space, it is the last one.
fn steps(entries: &Entries<'_>, count: usize) -> Result<Vec<(usize, DVec3)>, FormatError> {
    if let Some(text) = entries.directions {
        let Some(vectors) = vectors(text).filter(|vectors| vectors.len() == count) else {
            let requirement = "three numbers in brackets, or none, for each axis";
            return bad("space directions", text, requirement);
        };
        let vectors = vectors.into_iter().enumerate();
        let steps = vectors.filter_map(|(axis, vector)| Some((axis, vector?)));
        return Ok(steps.take(3).collect());
    }
    let kinds = entries.kinds.unwrap_or_default();
    let kinds: Vec<&str> = kinds.split_whitespace().take(MOST).collect();
    let is_in_space = |axis| kinds.get(axis).is_none_or(|kind| IN_SPACE.contains(kind));
    let sides = sides(entries, count)?.into_iter().enumerate();
    // What is no number is no side in space.
    let sides = sides.filter(|(axis, side)| !side.is_nan() && is_in_space(*axis));
    let steps = sides.zip(DVec3::AXES);
    Ok(steps
        .map(|((axis, side), unit)| (axis, side * unit))
        .collect())
}

/// The sides of voxels, without directions.
fn sides(entries: &Entries<'_>, count: usize) -> Result<Vec<f64>, FormatError> {
    match (entries.spacings, entries.axis_mins) {
        (Some(text), _) => {
            let sides = text.split_whitespace().take(MOST).map(str::parse);
            let sides: Vec<f64> = sides.collect::<Result<_, _>>().unwrap_or_default();
            if sides.len() == count {
                Ok(sides)
            } else {
                bad("spacings", text, "a number for each axis")
            }
        }
        (None, Some(text)) => bad("axis mins", text, "space directions or spacings"),
        (None, None) => Ok(vec![1.0; count]),
    }
}

fn origin(entries: &Entries<'_>) -> Result<DVec3, FormatError> {
    let Some(text) = entries.origin else {
        return Ok(DVec3::ZERO);
    };
    match vectors(text).as_deref() {
        Some([Some(origin)]) => Ok(*origin),
        _ => bad("space origin", text, "three numbers in brackets"),
    }
}

/// Turns the axes of a space to right, anterior and superior; spaces of no body are as they are.
fn signs(entries: &Entries<'_>) -> Result<DVec3, FormatError> {
    match &*entries.space.unwrap_or_default().to_ascii_lowercase() {
        "left-posterior-superior" | "lps" => Ok(DVec3::new(-1.0, -1.0, 1.0)),
        "left-anterior-superior" | "las" => Ok(DVec3::new(-1.0, 1.0, 1.0)),
        "right-anterior-superior"
        | "ras"
        | "scanner-xyz"
        | "3d-right-handed"
        | "3d-left-handed"
        | "" => Ok(DVec3::ONE),
        other => bad(
            "space",
            other,
            "one of three axes, such as left-posterior-superior",
        ),
    }
}

/// Vectors in brackets; nothing for axes that are not in space.
fn vectors(text: &str) -> Option<Vec<Option<DVec3>>> {
    let (mut rest, mut vectors) = (text.trim(), Vec::new());
    while !rest.is_empty() && vectors.len() < MOST {
        let (vector, after) = match rest.strip_prefix("none") {
            Some(after) => (None, after),
            None => {
                let (inside, after) = rest.strip_prefix('(')?.split_once(')')?;
                let mut numbers = inside.split(',').map(|n| n.trim().parse().ok());
                let vector = [numbers.next()??, numbers.next()??, numbers.next()??];
                if numbers.next().is_some() {
                    return None;
                }
                (Some(DVec3::from_array(vector)), after)
            }
        };
        vectors.push(vector);
        rest = after.trim_start();
    }
    Some(vectors)
}

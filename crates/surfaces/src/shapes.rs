//! Shapes that can be named: boxes and balls, and those that are built in.

use std::fmt;
use std::str::FromStr;

use geometry::shapes::{Ball, Cross, Cuboid, Cylinder, Torus};
use geometry::{SignedDistance, SignedDistanceExt, UpAxis};

use crate::{ClosedMesh, Error, samples};

/// A box or a ball in the box of the grid, written `box:x0,y0,x1,y1` or `ball:x,y,r`, in 3D with `z`.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    is_ball: bool,
    numbers: Vec<f64>,
}

impl Region {
    /// Whether a text is meant to be a region, and not the name of a file.
    pub fn is_meant(text: &str) -> bool {
        text.starts_with("box:") || text.starts_with("ball:")
    }

    /// What the region is called: box or ball.
    pub fn name(&self) -> &'static str {
        if self.is_ball { "ball" } else { "box" }
    }

    /// The dimension of space that its numbers fit; a wrong number of them is left to [`Self::shape`].
    pub fn dimension(&self) -> usize {
        let in_space = if self.is_ball { 4 } else { 6 };
        if self.numbers.len() < in_space { 2 } else { 3 }
    }

    /// The signed distance in `D` dimensions.
    ///
    /// # Errors
    /// [`Error::Shape`] if there are too many or too few numbers, or if they enclose nothing.
    pub fn shape<const D: usize>(&self) -> Result<Box<dyn SignedDistance<D>>, Error> {
        let needed = if self.is_ball { D + 1 } else { 2 * D };
        let numbers = &self.numbers;
        if numbers.len() != needed {
            return Err(Error::Shape(format!(
                "{self} has {} numbers, and a {} in {D}D has {needed}",
                numbers.len(),
                self.name()
            )));
        }
        let first: [f64; D] = std::array::from_fn(|i| numbers[i]);
        if self.is_ball {
            return Ok(Box::new(Ball::new(first, numbers[D])?));
        }
        let last: [f64; D] = std::array::from_fn(|i| numbers[D + i]);
        if (0..D).any(|i| first[i] >= last[i]) {
            return Err(Error::Shape(format!(
                "{self} is empty: give the lower corner first, then the upper one"
            )));
        }
        let half = std::array::from_fn(|i| 0.5 * (last[i] - first[i]));
        let centre = std::array::from_fn(|i| 0.5 * (first[i] + last[i]));
        Ok(Box::new(Cuboid::new(half)?.translated(centre)))
    }
}

impl FromStr for Region {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let advice = "give box:x0,y0,x1,y1 or ball:x,y,r, in 3D with z";
        let (is_ball, rest) = match text.split_once(':') {
            Some(("box", rest)) => (false, rest),
            Some(("ball", rest)) => (true, rest),
            _ => return Err(format!("{text:?} is no region: {advice}")),
        };
        let numbers = rest
            .split(',')
            .map(|number| match number.trim().parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                _ => Err(format!(
                    "{number:?} in {text:?} is no finite number: {advice}"
                )),
            })
            .collect::<Result<_, _>>()?;
        Ok(Self { is_ball, numbers })
    }
}

impl fmt::Display for Region {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers: Vec<String> = self.numbers.iter().map(ToString::to_string).collect();
        write!(f, "{}:{}", self.name(), numbers.join(","))
    }
}

/// Cells per side of the grid on which built-in meshes are made.
const MESH_CELLS: usize = 96;

/// A shape that needs no file.
pub enum BuiltIn {
    /// In the plane.
    Plane(Box<dyn SignedDistance<2>>),
    /// In space.
    Space(Box<dyn SignedDistance<3>>),
    /// A mesh that is yet to be placed, and the axis that points up in it.
    Mesh(ClosedMesh, UpAxis),
}

/// The built-in shapes and whether they are in the plane.
const BUILT_IN: [(&str, bool); 10] = [
    ("disc", true),
    ("ring", true),
    ("cross", true),
    ("rectangle", true),
    ("sphere", false),
    ("cube", false),
    ("torus", false),
    ("coin", false),
    ("figure", false),
    ("lever", false),
];

/// The dimension of a built-in shape.
///
/// # Errors
/// [`Error::Shape`] naming those that there are.
pub fn dimension(name: &str) -> Result<usize, Error> {
    match BUILT_IN.iter().find(|(known, _)| *known == name) {
        Some((_, true)) => Ok(2),
        Some((_, false)) => Ok(3),
        None => Err(Error::Shape(format!(
            "there is no built-in shape {name:?}; there are {}",
            BUILT_IN.map(|(name, _)| name).join(", ")
        ))),
    }
}

/// A built-in shape about 0 with the given longest side.
///
/// # Errors
/// [`Error::Shape`] for a name that is none; [`Error::Geometry`] for a side that is not positive.
pub fn built_in(name: &str, side: f64) -> Result<BuiltIn, Error> {
    dimension(name)?;
    let half = 0.5 * side;
    Ok(match name {
        "disc" => BuiltIn::Plane(Box::new(Ball::new([0.0; 2], half)?)),
        "ring" => {
            let hole = Ball::new([0.0; 2], 0.5 * half)?;
            BuiltIn::Plane(Box::new(Ball::new([0.0; 2], half)?.difference(hole)))
        }
        "cross" => BuiltIn::Plane(Box::new(Cross::new(half, half / 3.0)?)),
        "rectangle" => BuiltIn::Plane(Box::new(Cuboid::new([half, 0.5 * half])?)),
        "sphere" => BuiltIn::Space(Box::new(Ball::new([0.0; 3], half)?)),
        "cube" => BuiltIn::Space(Box::new(Cuboid::new([half; 3])?)),
        "torus" => BuiltIn::Space(Box::new(Torus::new(0.72 * half, 0.28 * half)?)),
        "coin" => BuiltIn::Space(Box::new(Cylinder::new(half, 0.4 * half)?)),
        "figure" => BuiltIn::Mesh(samples::figure(MESH_CELLS)?, UpAxis::Y),
        _ => BuiltIn::Mesh(samples::lever(MESH_CELLS)?, UpAxis::Z),
    })
}

//! What an inpainted region holds at the beginning.

use derive_more::Display;

use crate::prelude::*;

/// What the inpainted region holds at the beginning.
#[derive(Clone, Debug, PartialEq, Display)]
#[display(rename_all = "lowercase")]
pub enum Ansatz {
    Keep,
    /// Nothing.
    Empty,
    /// All inside.
    Full,
    #[display("{_0}")]
    Shape(Region),
}

impl Ansatz {
    pub fn put_into<const D: usize>(
        &self,
        mut field: Field<D>,
        region: &[bool],
        eps: f64,
    ) -> Result<Field<D>, Error> {
        let grid = *field.grid();
        let inner = match self {
            Self::Keep => return Ok(field),
            Self::Empty => Field::constant(grid, -1.0),
            Self::Full => Field::constant(grid, 1.0),
            Self::Shape(shape) => phase_field(grid, shape.shape::<D>()?.as_ref(), eps)?,
        };
        let values = field.values_mut().iter_mut().zip(inner.values());
        for ((value, inner), _) in values.zip(region).filter(|(_, inside)| **inside) {
            *value = *inner;
        }
        Ok(field)
    }
}

impl FromStr for Ansatz {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Ok(match text {
            "keep" => Self::Keep,
            "empty" => Self::Empty,
            "full" => Self::Full,
            text if Region::is_meant(text) => Self::Shape(text.parse()?),
            text => {
                return Err(format!(
                    "{text:?} is no ansatz: give keep, empty, full, box:... or ball:..."
                ));
            }
        })
    }
}

impl Serialize for Ansatz {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

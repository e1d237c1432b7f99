//! Values on a lattice in space.

use files::Number;
use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use crate::{Error, FormatError, Warning};

/// One number per voxel of a lattice of `size[0] x size[1] x size[2]` voxels, whose centres are at `origin + i a + j b + k c`.
///
/// The steps `a`, `b`, `c` need not be orthogonal, and may be left-handed.
#[derive(Clone, Debug)]
pub struct Volume {
    size: [usize; 3],
    /// From coordinates in voxels to positions.
    pub(crate) frame: DAffine3,
    voxels: Voxels,
    pub(crate) warnings: Vec<Warning>,
}

/// Numbers as they are in files, the first axis fastest.
#[derive(Clone, Debug)]
pub(crate) struct Voxels {
    pub(crate) bytes: Vec<u8>,
    pub(crate) element: Number,
    pub(crate) big_endian: bool,
    /// The value of a number `x` is `scale[0] x + scale[1]`.
    pub(crate) scale: [f64; 2],
}

impl Voxels {
    fn of(values: &Values) -> Self {
        let (element, bytes) = values.as_bytes();
        Self {
            bytes,
            element,
            big_endian: false,
            scale: [1.0, 0.0],
        }
    }

    /// Whether they are whole numbers that a scale may turn into others.
    fn are_scaled(&self) -> bool {
        self.element.is_integer() && !self.scale.iter().all(|number| number.fract() == 0.0)
    }

    fn value(&self, voxel: usize) -> f64 {
        let size = self.element.size();
        let bytes = &self.bytes[size * voxel..][..size];
        let [slope, shift] = self.scale;
        slope * self.element.decode(bytes, self.big_endian) + shift
    }
}

/// The values of voxels.
#[derive(Clone, Debug)]
pub enum Values {
    /// Small labels, or grey values of eight bits.
    U8(Vec<u8>),
    /// Labels.
    I32(Vec<i32>),
    /// Grey values.
    F32(Vec<f32>),
    /// Grey values in double precision.
    F64(Vec<f64>),
}

impl Values {
    /// Their kind and their bytes, the lowest first.
    fn as_bytes(&self) -> (Number, Vec<u8>) {
        match self {
            Self::U8(values) => (Number::U8, values.clone()),
            Self::I32(values) => (
                Number::I32,
                values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            ),
            Self::F32(values) => (
                Number::F32,
                values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            ),
            Self::F64(values) => (
                Number::F64,
                values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            ),
        }
    }
}

impl Volume {
    /// Labels in a row, the first axis fastest, of voxels with these sides, finite and positive, from the centre of the first one. There
    /// are two voxels along each axis at least, and as many labels as voxels.
    pub fn of_labels(
        size: [usize; 3],
        origin: [f64; 3],
        sides: [f64; 3],
        labels: Vec<u8>,
    ) -> Result<Self, Error> {
        let voxels = Voxels {
            bytes: labels,
            element: Number::U8,
            big_endian: false,
            scale: [1.0, 0.0],
        };
        let matrix = DMat3::from_diagonal(sides.into());
        let frame = DAffine3::from_mat3_translation(matrix, origin.into());
        Self::new(size, frame, voxels).map_err(Error::Volume)
    }

    /// Values in a row, the first axis fastest, one for each voxel. Column `i` of `affine`, for `i` from 0 to 2, is the step from one voxel to the
    /// next along axis `i`, and its last column is the centre of the first voxel, as in NIfTI.
    ///
    /// # Errors
    /// [`Error::Volume`]: fewer than two voxels along an axis, another number of values, infinite values, no values but NaN, and an affine
    /// map that has no inverse.
    pub fn of_values(
        size: [usize; 3],
        affine: [[f64; 4]; 3],
        values: &Values,
    ) -> Result<Self, Error> {
        let column = |j: usize| DVec3::from_array([0, 1, 2].map(|i| affine[i][j]));
        let frame = DAffine3::from_cols(column(0), column(1), column(2), column(3));
        Self::new(size, frame, Voxels::of(values)).map_err(Error::Volume)
    }

    /// The same voxels with other values.
    ///
    /// # Errors
    /// As [`Volume::of_values`].
    pub fn with_values(&self, values: &Values) -> Result<Self, Error> {
        Self::new(self.size, self.frame, Voxels::of(values)).map_err(Error::Volume)
    }

    pub(crate) fn new(
        size: [usize; 3],
        frame: DAffine3,
        voxels: Voxels,
    ) -> Result<Self, FormatError> {
        let bytes = voxels.element.size();
        let needed = size
            .iter()
            .try_fold(bytes, |product, &n| product.checked_mul(n));
        if size.iter().any(|&n| n < 2) || needed != Some(voxels.bytes.len()) {
            return Err(FormatError::Size {
                size: size.map(|n| n as u64),
                bytes: bytes as u64,
                limit: voxels.bytes.len() as u64,
            });
        }
        let determinant = frame.matrix3.determinant();
        if !(frame.is_finite() && determinant.is_finite() && determinant != 0.0) {
            return Err(FormatError::Header {
                format: "volume",
                entry: "the place in space",
                value: format!("{:?}", frame.to_cols_array()),
                requirement: "a finite affine map that can be inverted",
            });
        }
        let mut volume = Self {
            size,
            frame,
            voxels,
            warnings: Vec::new(),
        };
        volume.check_values()?;
        Ok(volume)
    }

    /// Refuses infinite values, and counts those that are not a number.
    fn check_values(&mut self) -> Result<(), FormatError> {
        let voxels = || (0..self.len()).into_par_iter();
        let value = |voxel: usize| self.voxels.value(voxel);
        if let Some(voxel) = voxels().find_first(|&voxel| value(voxel).is_infinite()) {
            return Err(FormatError::Infinite {
                index: self.index(voxel),
                value: value(voxel),
            });
        }
        let count = voxels().filter(|&voxel| value(voxel).is_nan()).count();
        if count == self.len() {
            return Err(FormatError::NoValues);
        }
        if count > 0 {
            self.warnings.push(Warning::NoNumbers { count });
        }
        Ok(())
    }

    /// What a person should know before trusting the volume.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Takes the warnings out, so that they are told once.
    pub fn take_warnings(&mut self) -> Vec<Warning> {
        std::mem::take(&mut self.warnings)
    }

    /// Voxels along the axes.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Number of voxels.
    #[allow(clippy::len_without_is_empty, reason = "there are eight at least")]
    pub fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// The value of a voxel.
    pub fn value(&self, [i, j, k]: [usize; 3]) -> f64 {
        self.voxels.value(i + self.size[0] * (j + self.size[1] * k))
    }

    /// All values, the first axis fastest; NaN outside of a mask.
    pub fn values(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.len()).map(|voxel| self.voxels.value(voxel))
    }

    /// The whole number that a value is, up to the rounding of the scale of whole numbers; others are themselves.
    pub(crate) fn rounded(&self, value: f64) -> f64 {
        let whole = value.round();
        if self.voxels.are_scaled() && (value - whole).abs() <= label_tolerance(whole) {
            whole
        } else {
            value
        }
    }

    /// Where a point is whose coordinates are counted in voxels from the centre of the first one.
    pub fn position(&self, index: [f64; 3]) -> [f64; 3] {
        (self.frame.transform_point3(index.into())).to_array()
    }

    /// Volume of a voxel.
    pub fn voxel_volume(&self) -> f64 {
        self.frame.matrix3.determinant().abs()
    }

    /// Where a voxel is of which so many are before it.
    pub(crate) fn index(&self, voxel: usize) -> [usize; 3] {
        let [x, y, _] = self.size;
        [voxel % x, voxel / x % y, voxel / (x * y)]
    }
}

/// How far the value of a voxel may be from a label: scaled values are rounded, and neighbours of large labels are others.
pub(crate) fn label_tolerance(label: f64) -> f64 {
    (1e-6 * label.abs()).clamp(1e-6, 0.4)
}

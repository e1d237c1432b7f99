//! Inputs: files, their bytes in memory, and arrays.

use std::any::Any;
use std::borrow::Cow;
use std::convert::Infallible;
use std::ffi::OsString;
use std::fmt;
use std::io::Read;
use std::sync::Arc;

use geometry::npy::Array;
use volumes::Volume;

use crate::paths::{of_text, to_text};
use crate::prelude::*;

/// More bytes than the header of an array has.
const HEAD: u64 = 1 << 14;

/// The input of a job: a file, a built-in shape or a region by its name, or the contents of a file in memory.
#[derive(Clone)]
pub struct Input {
    /// The [text](crate::paths::to_text) of a name that may be none.
    name: String,
    contents: Option<Contents>,
}

/// What stands for a file.
#[derive(Clone)]
pub(crate) enum Contents {
    Bytes(Arc<[u8]>),
    Plane(Arc<Field<2>>),
    Space(Arc<Field<3>>),
    Volume(Arc<Volume>),
}

impl Contents {
    /// The field, if it is one in `D` dimensions.
    fn field<const D: usize>(&self) -> Option<&Field<D>> {
        match self {
            Self::Plane(field) => (&**field as &dyn Any).downcast_ref(),
            Self::Space(field) => (&**field as &dyn Any).downcast_ref(),
            Self::Bytes(_) | Self::Volume(_) => None,
        }
    }
}

impl Input {
    /// The bytes of a file of this name, whose extension says what they are.
    pub fn bytes(name: impl Into<String>, bytes: impl Into<Arc<[u8]>>) -> Self {
        Self::of_contents(name.into(), Contents::Bytes(bytes.into()))
    }

    /// A mesh. Its coordinates keep all their digits.
    ///
    /// # Errors
    /// A mesh without faces, or with vertices that are not finite.
    pub fn mesh(name: &str, mesh: &TriangleMesh) -> Result<Self> {
        let name = format!("{name}.ply");
        let bytes = surfaces::encode(&name, mesh)?;
        Ok(Self::bytes(name, bytes))
    }

    /// A picture: a drawing, or a mask.
    ///
    /// # Errors
    /// A picture that cannot be encoded.
    pub fn picture(name: &str, picture: &Picture) -> Result<Self> {
        Ok(Self::bytes(format!("{name}.png"), picture.to_png()?))
    }

    /// A phase field or signed distances on a grid in the plane, which the flow keeps unless `cells` are chosen.
    pub fn plane_field(name: &str, field: Field<2>) -> Self {
        Self::of_contents(format!("{name}.npy"), Contents::Plane(Arc::new(field)))
    }

    /// A phase field or signed distances on a grid in space, which the flow keeps unless `cells` are chosen.
    pub fn space_field(name: &str, field: Field<3>) -> Self {
        Self::of_contents(format!("{name}.npy"), Contents::Space(Arc::new(field)))
    }

    /// A segmentation, or a grey volume.
    pub fn volume(name: &str, volume: Volume) -> Self {
        Self::of_contents(format!("{name}.nii"), Contents::Volume(Arc::new(volume)))
    }

    /// A volume that was read of this input, with its name.
    pub(crate) fn with_volume(&self, volume: Volume) -> Self {
        Self::of_contents(self.name.clone(), Contents::Volume(Arc::new(volume)))
    }

    fn of_contents(name: String, contents: Contents) -> Self {
        Self {
            name,
            contents: Some(contents),
        }
    }

    /// Its name: that of a file, `builtin:NAME`, or a region.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its name as the path of a file.
    pub(crate) fn path(&self) -> PathBuf {
        of_text(&self.name).into()
    }

    pub(crate) fn is_in_memory(&self) -> bool {
        self.contents.is_some()
    }

    /// Whether it is a region by its name.
    pub(crate) fn is_region(&self) -> bool {
        !self.is_in_memory() && Region::is_meant(&self.name)
    }

    /// The field that it is, if it is one in memory and in `D` dimensions.
    pub(crate) fn in_memory_field<const D: usize>(&self) -> Option<Field<D>> {
        self.contents.as_ref()?.field().cloned()
    }

    /// The file that it names; its path is absolute unless it is in memory.
    pub(crate) fn file(&self) -> Result<File> {
        Ok(File {
            path: if self.is_in_memory() {
                self.name.clone().into()
            } else {
                crate::paths::absolute(self.path())?
            },
            contents: self.contents.clone(),
        })
    }

    /// A file has the same name wherever the program may run later.
    pub(crate) fn rename(&mut self, path: &Path) {
        self.name = to_text(path.as_os_str());
    }
}

impl From<&str> for Input {
    fn from(name: &str) -> Self {
        name.to_owned().into()
    }
}

impl From<String> for Input {
    fn from(name: String) -> Self {
        Self {
            name,
            contents: None,
        }
    }
}

impl From<&Path> for Input {
    fn from(path: &Path) -> Self {
        to_text(path.as_os_str()).into()
    }
}

impl From<OsString> for Input {
    fn from(name: OsString) -> Self {
        to_text(&name).into()
    }
}

impl FromStr for Input {
    type Err = Infallible;

    fn from_str(name: &str) -> Result<Self, Infallible> {
        Ok(name.into())
    }
}

impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.path().display().fmt(f)
    }
}

impl fmt::Debug for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.name, f)
    }
}

impl Serialize for Input {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.name)
    }
}

/// A file, on disk or in memory.
#[derive(Clone)]
pub(crate) struct File {
    pub path: PathBuf,
    pub contents: Option<Contents>,
}

impl File {
    /// Its bytes.
    pub fn read(&self) -> Result<Cow<'_, [u8]>> {
        Ok(match &self.contents {
            Some(Contents::Bytes(bytes)) => Cow::Borrowed(bytes),
            _ => Cow::Owned(files::read(&self.path)?),
        })
    }

    /// The extension of its name.
    pub fn extension(&self) -> String {
        crate::paths::extension(&self.path)
    }

    /// The image in it.
    pub fn image(&self) -> Result<images::Image> {
        let Some(Contents::Bytes(bytes)) = &self.contents else {
            return Ok(images::read(&self.path)?);
        };
        let decoded = images::decode(bytes);
        Ok(decoded.map_err(|problem| images::Error::Format {
            path: self.path.clone(),
            problem,
        })?)
    }

    /// The mesh in it.
    pub fn mesh(&self) -> Result<TriangleMesh> {
        if self.contents.is_none() {
            return Ok(surfaces::read(&self.path)?);
        }
        Ok(surfaces::decode(&self.read()?, &self.path)?)
    }

    /// The axis that points up in that mesh.
    pub fn up_axis(&self) -> Result<UpAxis> {
        Ok(surfaces::up_axis_of(&self.read()?, &self.path)?)
    }

    /// The volume in it; of several that with this number.
    pub fn volume(&self, frame: Option<u64>) -> Result<Cow<'_, Volume>> {
        let of_file = |problem| volumes::Error::Format {
            path: self.path.clone(),
            problem,
        };
        Ok(match (&self.contents, frame) {
            (None, _) => Cow::Owned(volumes::read_frame(&self.path, frame)?),
            (Some(Contents::Volume(volume)), None | Some(0)) => Cow::Borrowed(volume),
            (Some(Contents::Volume(_)), Some(frame)) => {
                let problem = volumes::FormatError::NoFrame { frame, count: 1 };
                return Err(of_file(problem).into());
            }
            (Some(_), _) => {
                let decoded = volumes::decode_frame(&self.read()?, frame);
                Cow::Owned(decoded.map_err(of_file)?)
            }
        })
    }

    /// What an array in it says by its header and its first elements, unless it is none.
    fn of_array<T>(&self, say: impl FnOnce(&Array<'_>) -> T) -> Result<Option<T>> {
        let head = match &self.contents {
            None => Cow::Owned(self.head()?),
            Some(Contents::Bytes(bytes)) => Cow::Borrowed(&**bytes),
            Some(_) => return Ok(None),
        };
        Ok(Array::of(&head).ok().map(|array| say(&array)))
    }

    /// The first bytes on disk, of which an array has its header.
    fn head(&self) -> Result<Vec<u8>> {
        let io = |source| files::Error::of("read", &self.path)(source);
        let mut head = Vec::new();
        let file = std::fs::File::open(&self.path).map_err(io)?;
        file.take(HEAD).read_to_end(&mut head).map_err(io)?;
        Ok(head)
    }

    /// The number of axes of an array of whole numbers, which are labels; three of a volume in memory, whatever was read.
    pub fn axes_of_labels(&self) -> Result<Option<usize>> {
        if let Some(Contents::Volume(_)) = &self.contents {
            return Ok(Some(3));
        }
        let axes = |array: &Array<'_>| array.number.is_integer().then_some(array.shape.len());
        Ok(self.of_array(axes)?.flatten())
    }

    /// Whether it is an array of values in space.
    pub fn has_values_in_space(&self) -> Result<bool> {
        let is_in_space = |array: &Array<'_>| array.shape.len() == 3;
        Ok(self.of_array(is_in_space)?.unwrap_or(false))
    }

    /// Whether all values of an array are 0 and 1, which are those of a mask and not of a phase field.
    pub fn is_mask(&self) -> Result<bool> {
        let is_mask = |array: &Array<'_>| array.values().all(|v| [0.0, 1.0].contains(&v));
        // Most are told from a mask by their first elements.
        if !self.of_array(is_mask)?.unwrap_or(false) {
            return Ok(false);
        }
        Ok(Array::of(&self.read()?).is_ok_and(|array| is_mask(&array)))
    }

    /// Whether it is a field in the plane. Whatever else is wrong with a file is said when its values are read.
    pub fn is_planar_field(&self) -> Result<bool> {
        Ok(match &self.contents {
            Some(Contents::Plane(_)) => true,
            Some(Contents::Space(_)) => false,
            _ => self
                .of_array(|array| array.shape.len() == 2)?
                .unwrap_or(true),
        })
    }

    /// The field in it, in `D` dimensions. The values of a file are on a grid about 0, in a box of this side.
    pub fn field<const D: usize>(&self, side: f64) -> Result<Field<D>> {
        if let Some(field) = self.contents.as_ref().and_then(Contents::field) {
            return Ok(field.clone());
        }
        let decoded = npy::decode::<D>(&self.read()?);
        let (cells, values) = decoded.map_err(|source| geometry::Error::Npy {
            path: self.path.clone(),
            source,
        })?;
        Ok(Field::from_values(Grid::centred(cells, side)?, values)?)
    }

    /// Whether it is a stack of images, which is a volume.
    pub fn is_stack(&self) -> bool {
        match &self.contents {
            None => volumes::is_stack(&self.path),
            // A single image is no volume.
            Some(Contents::Bytes(bytes)) => volumes::holds_stack(bytes),
            Some(_) => true,
        }
    }
}

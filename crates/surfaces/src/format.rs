//! The formats, by extension.

use std::path::Path;

use geometry::UpAxis;

use crate::Error;

/// A mesh file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Obj,
    Off,
    Ply,
    Stl,
}

impl Format {
    /// From the extension, in either case.
    pub(crate) fn of(path: &Path) -> Result<Self, Error> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        match extension.to_ascii_lowercase().as_str() {
            "obj" => Ok(Self::Obj),
            "off" => Ok(Self::Off),
            "ply" => Ok(Self::Ply),
            "stl" => Ok(Self::Stl),
            _ => Err(Error::UnknownFormat { path: path.into() }),
        }
    }
}

/// How a mesh file names its upward axis: a line of the header of PLY, a line of comment at the top of OBJ and behind the first line of OFF, and
/// the whole comment of binary STL.
pub(crate) fn up_line(format: Format, up: UpAxis) -> String {
    match format {
        Format::Obj | Format::Off => format!("# up {up}\n"),
        Format::Ply => format!("comment up {up}\n"),
        Format::Stl => format!("up {up}"),
    }
}

/// The axis that points up in a mesh file: the one that the file names, as those do that [`write_with_up`](crate::write_with_up()) makes, or
/// else the [usual one](usual_up_axis()) of its format.
///
/// # Errors
/// [`Error::UnknownFormat`]; [`Error::Io`] if the file cannot be read.
pub fn up_axis(path: impl AsRef<Path>) -> Result<UpAxis, Error> {
    let path = path.as_ref();
    Format::of(path)?;
    up_axis_of(&files::read(path)?, path)
}

/// The axis that points up in the bytes of a mesh file of that name; see [`up_axis`].
///
/// # Errors
/// [`Error::UnknownFormat`].
pub fn up_axis_of(bytes: &[u8], path: impl AsRef<Path>) -> Result<UpAxis, Error> {
    let path = path.as_ref();
    let format = Format::of(path)?;
    let bytes = files::without_mark(bytes);
    // The lines in which a file may name it.
    let header: Vec<&[u8]> = match format {
        Format::Stl => bytes.get(..80).into_iter().collect(),
        Format::Obj => (bytes.split(|&byte| byte == b'\n'))
            .take_while(|line| line.starts_with(b"#"))
            .collect(),
        Format::Off => (bytes.split(|&byte| byte == b'\n').take(2))
            .filter(|line| line.starts_with(b"#"))
            .collect(),
        Format::Ply => (bytes.split(|&byte| byte == b'\n'))
            .take_while(|line| !line.starts_with(b"end_header"))
            .collect(),
    };
    let said = |line: &[u8]| {
        let line = String::from_utf8_lossy(line);
        let line = line.trim_end_matches(['\0', '\r']);
        let names = |up: &UpAxis| up_line(format, *up).trim_end() == line;
        UpAxis::ALL.into_iter().find(names)
    };
    match header.into_iter().find_map(said) {
        Some(up) => Ok(up),
        None => usual_up_axis(path),
    }
}

/// The axis that points up in most meshes of that format, by the extension: `y` in OBJ files, which
/// come from animation, `z` in OFF, PLY and STL files, which come from scanners and for printers.
///
/// # Errors
/// [`Error::UnknownFormat`].
pub fn usual_up_axis(path: impl AsRef<Path>) -> Result<UpAxis, Error> {
    Ok(match Format::of(path.as_ref())? {
        Format::Obj => UpAxis::Y,
        Format::Off | Format::Ply | Format::Stl => UpAxis::Z,
    })
}

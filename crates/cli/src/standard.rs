//! `-` for standard input and output: files that stand for them while a command runs.

use std::fs::File;
use std::io::{Read, Write};

use crate::cli::{Command, InputOptions, MessageOptions};
use crate::input::usual_format;
use crate::paths::read;
use crate::prelude::*;
use crate::values::Label;

/// The files, which are removed in the end.
#[derive(Default)]
pub struct Standard {
    input: Option<PathBuf>,
    output: Option<PathBuf>,
}

impl Standard {
    /// Reads standard input if it is the input, and puts files in place of every `-` in the options.
    pub fn open(command: &mut Command, messages: &mut MessageOptions) -> Result<Self> {
        let mut standard = Self::default();
        let Some((input, save)) = paths(command) else {
            return Ok(standard);
        };
        if input.input.as_deref() == Some("-") {
            let mut bytes = Vec::new();
            let name = "standard input";
            let read = std::io::stdin().read_to_end(&mut bytes);
            read.map_err(files::Error::of("read", name))?;
            if bytes.is_empty() {
                refuse!("standard input is empty: pipe a mesh, an image or a field into it");
            }
            let path = stand_in("input", kind(&bytes));
            // Never through a link that somebody else has put there.
            let written = File::create_new(&path).and_then(|mut file| file.write_all(&bytes));
            written.map_err(files::Error::of("write", &path))?;
            input.input = Some(path.to_string_lossy().into_owned());
            standard.input = Some(path);
        }
        let Some(save) = save.filter(|path| path.as_os_str() == "-") else {
            return Ok(standard);
        };
        if messages.json {
            refuse!("--json and --save - would both write to standard output: leave one out");
        }
        if input.label == Some(Label::All) {
            refuse!("--save - writes one mesh, and --label all makes several: give a file");
        }
        messages.to_pipe = true;
        let format = usual_format(input.input.as_deref().unwrap_or_default())?;
        *save = stand_in("output", &format);
        standard.output = Some(save.clone());
        Ok(standard)
    }

    pub fn write(&self) -> Result<()> {
        let Some(path) = &self.output else {
            return Ok(());
        };
        if !path.exists() {
            refuse!("nothing is written to standard output: the shape has vanished");
        }
        let written = std::io::stdout().write_all(&read(path)?);
        Ok(written.map_err(files::Error::of("write", "standard output"))?)
    }
}

impl Drop for Standard {
    fn drop(&mut self) {
        for path in self.input.iter().chain(&self.output) {
            // There is none where the command failed before.
            let _ = std::fs::remove_file(path);
        }
    }
}

/// The input of a command and the file that it writes, if it has these.
fn paths(command: &mut Command) -> Option<(&mut InputOptions, Option<&mut PathBuf>)> {
    match command {
        Command::Check(check) => Some((&mut check.input, None)),
        Command::Sample(sample) => Some((&mut sample.input, Some(&mut sample.save))),
        Command::Run(command) => {
            let options = command.options();
            Some((&mut options.input, options.save.as_mut()))
        }
        _ => None,
    }
}

/// A name that no other process has.
fn stand_in(what: &str, format: &str) -> PathBuf {
    let name = format!("willmore-{}-{what}.{format}", std::process::id());
    std::env::temp_dir().join(name)
}

/// The usual extension of a file with these contents: OBJ, which is any text, if they are nothing else.
fn kind(bytes: &[u8]) -> &'static str {
    const BEGINNINGS: [(&[u8], &str); 19] = [
        (b"ply", "ply"),
        (b"solid", "stl"),
        (b"\x89PNG", "png"),
        (b"\xff\xd8", "jpg"),
        (b"GIF8", "gif"),
        (b"II*\0", "tif"),
        (b"MM\0*", "tif"),
        (b"II+\0", "tif"),
        (b"MM\0+", "tif"),
        (b"RIFF", "webp"),
        (b"BM", "bmp"),
        (b"\x93NUMPY", "npy"),
        (b"\x1f\x8b", "nii.gz"),
        (b"\x5c\x01\0\0", "nii"),
        (b"\x1c\x02\0\0", "nii"),
        (b"\0\0\x01\x5c", "nii"),
        (b"\0\0\x02\x1c", "nii"),
        (b"<?xml", "vti"),
        (b"<VTKFile", "vti"),
    ];
    // A header of 80 bytes, the number of triangles, and 50 bytes for each of them.
    let facets = bytes.get(80..84).and_then(|count| count.try_into().ok());
    let length = facets.map(|count| 84 + 50 * u64::from(u32::from_le_bytes(count)));
    if length == Some(bytes.len() as u64) {
        return "stl";
    }
    if bytes.get(208..212) == Some(b"MAP ") {
        return "mrc";
    }
    let known = BEGINNINGS
        .iter()
        .find(|(beginning, _)| bytes.starts_with(beginning));
    known.map_or("obj", |(_, kind)| kind)
}

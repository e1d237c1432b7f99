//! `-` for standard input and output: files that stand for them while a command runs.

use std::io::Read;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use jobs::InputOptions;
use jobs::values::Label;

use crate::cli::{Command, MessageOptions};
use crate::console::Console;
use crate::error::{Result, refuse};

/// The files, in a folder of their own that nobody else can write to; it is removed in the end.
#[derive(Default)]
pub struct Standard {
    output: Option<PathBuf>,
    /// The files by name, and what they stand for.
    aliases: Vec<(String, &'static str)>,
    _folder: Option<TempDir>,
}

impl Standard {
    /// Reads standard input if it is the input, and puts files in place of every `-` in the options.
    pub fn open(command: &mut Command, messages: MessageOptions) -> Result<Self> {
        let Some((input, save)) = paths(command) else {
            return Ok(Self::default());
        };
        let reads = input
            .input
            .as_ref()
            .is_some_and(|input| input.name() == "-");
        let save = save.filter(|path| path.as_os_str() == "-");
        if !reads && save.is_none() {
            return Ok(Self::default());
        }
        let folder = tempfile::tempdir();
        let folder = folder.map_err(files::Error::of("make a folder in", std::env::temp_dir()))?;
        let mut aliases = Vec::new();
        let mut place = |what: &'static str, format: &str| {
            let path = folder
                .path()
                .join(format!("{}.{format}", what.replace(' ', "-")));
            aliases.push((path.display().to_string(), what));
            path
        };
        if reads {
            let mut bytes = Vec::new();
            let read = std::io::stdin().read_to_end(&mut bytes);
            read.map_err(files::Error::of("read", "standard input"))?;
            if bytes.is_empty() {
                refuse!("standard input is empty: pipe a mesh, an image or a field into it");
            }
            let path = place("standard input", kind(&bytes));
            std::fs::write(&path, &bytes).map_err(files::Error::of("write", &path))?;
            input.input = Some(path.as_path().into());
        }
        let mut output = None;
        if let Some(save) = save {
            if messages.json {
                refuse!("--json and --save - would both write to standard output: leave one out");
            }
            if input.label == Some(Label::All) {
                refuse!("--save - writes one mesh, and --label all makes several: give a file");
            }
            let format = match &input.input {
                Some(input) => jobs::usual_format(input)?,
                None => return Err(jobs::Error::NoInput.into()),
            };
            *save = place("standard output", &format);
            output = Some(save.clone());
        }
        Ok(Self {
            output,
            aliases,
            _folder: Some(folder),
        })
    }

    /// The file that stands for standard output, if that is a result.
    pub fn output(&self) -> Option<&Path> {
        self.output.as_deref()
    }

    /// The files by name, with what messages call them.
    pub fn aliases(&self) -> Vec<(String, &'static str)> {
        self.aliases.clone()
    }

    /// Writes the result to standard output, if it goes there.
    pub fn write(&self, console: &Console) -> Result<()> {
        let Some(path) = &self.output else {
            return Ok(());
        };
        if !path.exists() {
            refuse!("nothing is written to standard output: the shape has vanished");
        }
        console.write(&files::read(path)?)
    }
}

/// The input of a command and the file that it writes, if it has these.
fn paths(command: &mut Command) -> Option<(&mut InputOptions, Option<&mut PathBuf>)> {
    match command {
        Command::Check(check) => Some((&mut check.options.input, None)),
        Command::Sample(sample) => Some((&mut sample.input, Some(&mut sample.save))),
        Command::Run(command) => {
            let (input, run) = command.options();
            Some((input, run.save.as_mut()))
        }
        _ => None,
    }
}

/// The usual extension of a file with these contents: OBJ, which is any text, if they are nothing else.
fn kind(bytes: &[u8]) -> &'static str {
    const BEGINNINGS: [(&[u8], &str); 26] = [
        (b"ply", "ply"),
        (b"solid", "stl"),
        (b"OFF", "off"),
        (b"COFF", "off"),
        (b"NOFF", "off"),
        (b"CNOFF", "off"),
        (b"STOFF", "off"),
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
        (b"NRRD000", "nrrd"),
        (b"\0\0\0\x01", "mgh"),
        (b"<?xml", "vti"),
        (b"<VTKFile", "vti"),
    ];
    if bytes.get(208..212) == Some(b"MAP ") {
        return "mrc";
    }
    let text = files::without_mark(bytes);
    let known = BEGINNINGS
        .iter()
        .find(|(beginning, _)| text.starts_with(beginning));
    match known {
        Some((_, kind)) => kind,
        None if surfaces::is_binary_stl(bytes) => "stl",
        None => "obj",
    }
}

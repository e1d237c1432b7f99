//! Files that are either complete or absent.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::Error;

/// Writes a file through a temporary one in the same folder: write, flush to disk, rename.
///
/// A reader, or a restart after a crash, sees the old file or the new one, never a part. The
/// temporary file is removed when something fails.
///
/// # Errors
/// [`Error::Io`] with the step that failed.
pub fn write_atomically(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Error> {
    let path = path.as_ref();
    let failed = |action| {
        move |source| Error::Io {
            action,
            path: path.into(),
            source,
        }
    };
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".partial-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The usual permissions of a new file, before the umask, and not those of a secret.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let temporary = builder
        .tempfile_in(folder)
        .map_err(failed("create a file beside"))?;
    let mut buffer = BufWriter::new(temporary);
    write(&mut buffer).map_err(failed("write"))?;
    let temporary = buffer
        .into_inner()
        .map_err(|e| failed("write")(e.into_error()))?;
    temporary
        .as_file()
        .sync_all()
        .map_err(failed("flush to disk"))?;
    temporary
        .persist(path)
        .map_err(|e| failed("replace")(e.error))?;
    // The rename itself is durable once the folder is; folders cannot be opened everywhere.
    if cfg!(unix) {
        File::open(folder)
            .and_then(|f| f.sync_all())
            .map_err(failed("flush the folder of"))?;
    }
    Ok(())
}

//! How far the results go beside the paper's, from the first table of `results/README.md`.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use crate::error::{Error, Result};
use crate::table::Table;

/// For every folder, what of the paper it shows and in what state.
pub(crate) type States = HashMap<String, Vec<(String, String)>>;

/// Reads the table with the columns "figure or table of the paper", "here" (links to folders) and
/// "state".
///
/// # Errors
/// [`Error::Read`]; [`Error::Table`] if it has no such table.
pub(crate) fn read(path: &Path) -> Result<States> {
    let text = fs::read_to_string(path).map_err(|source| Error::Read {
        path: path.into(),
        source,
    })?;
    let table = Table::from_markdown("README.md", &text)?;
    if table.head().len() != 3 {
        return Err(Error::Table {
            name: "README.md".to_owned(),
            problem: format!(
                "its first table has the columns {:?} where there should be three: what the paper \
                 shows, a link to the folder, the state",
                table.head()
            ),
        });
    }
    let mut states = States::new();
    for row in table.rows() {
        if let Some(folder) = linked(&row[1])
            && !row[2].is_empty()
        {
            let state = (row[0].clone(), row[2].clone());
            states.entry(folder.to_owned()).or_default().push(state);
        }
    }
    Ok(states)
}

/// `target` of `[label](target)`.
fn linked(cell: &str) -> Option<&str> {
    let (_, rest) = cell.split_once("](")?;
    let (target, _) = rest.split_once(')')?;
    Some(target.trim_end_matches('/'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_found_by_folder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("README.md");
        let text = "# R\n\n| paper | here | state |\n|---|---|---|\n| a | [c](c) | n = 8 |\n\
                    | b | [c](c/) | done |\n| x | [y](y) | |\n";
        fs::write(&path, text).unwrap();
        let states = read(&path).unwrap();
        let pair = |a: &str, b: &str| (a.to_owned(), b.to_owned());
        assert_eq!(states["c"], [pair("a", "n = 8"), pair("b", "done")]);
        assert!(!states.contains_key("y"));

        fs::write(&path, "| a | b |\n|---|---|\n| 1 | 2 |\n").unwrap();
        let message = read(&path).unwrap_err().to_string();
        assert!(
            message.contains("README.md") && message.contains("three"),
            "{message}"
        );
    }
}

//! What a run consists of: the commit point.

use std::collections::HashSet;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::digest::{self, is_digest};
use crate::{Damage, Error, Identity, names, seal};

/// Bumped when a reader of the old format would misread the new one.
pub(crate) const FORMAT: u32 = 1;
/// Longest index in bytes, enough for a quarter of a million files.
pub(crate) const MAX_LENGTH: u64 = 1 << 26;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Index {
    pub format: u32,
    pub finished: bool,
    pub identity: Identity,
    /// One or two, the newest last.
    pub commits: Vec<Commit>,
    /// In the order in which they were written, so that those of an older commit come first.
    pub files: Vec<Entry>,
}

/// What was there when a checkpoint was written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Commit {
    pub step: u64,
    /// None before the first checkpoint.
    pub checkpoint: Option<Entry>,
    pub metrics: Extent,
    /// How many of the files.
    pub files: usize,
}

/// A file, complete.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    pub name: String,
    pub length: u64,
    pub sha256: String,
}

/// The beginning of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Extent {
    pub length: u64,
    pub sha256: String,
}

impl Index {
    pub fn read(path: &Path) -> Result<Self, Error> {
        Self::decode(&digest::read_small(path, MAX_LENGTH)?, path)
    }

    pub fn decode(bytes: &[u8], path: &Path) -> Result<Self, Error> {
        #[derive(Deserialize)]
        struct Format {
            format: u32,
        }
        let Format { format } = seal::unseal(bytes, path)?;
        if format != FORMAT {
            return Err(Error::Version {
                path: path.into(),
                found: format,
                supported: FORMAT,
            });
        }
        let index: Self = seal::unseal(bytes, path)?;
        index
            .check()
            .map_err(|what| Error::damaged(path, Damage::Content(what.into())))?;
        Ok(index)
    }

    /// The last commit. Its existence is checked when an index is read.
    pub fn newest(&self) -> &Commit {
        self.commits.last().expect("an index has a commit")
    }

    /// The index as it would be with one of its commits alone.
    pub fn only(&self, commit: &Commit) -> Self {
        Self {
            commits: vec![commit.clone()],
            files: self.files[..commit.files].to_vec(),
            ..self.clone()
        }
    }

    /// What every index that was written satisfies.
    fn check(&self) -> Result<(), &'static str> {
        if !(1..=2).contains(&self.commits.len()) {
            return Err("it does not have one or two commits");
        }
        if self.finished && self.commits.len() != 1 {
            return Err("it is finished with more than one commit");
        }
        let ordered = self.commits.windows(2).all(|pair| {
            pair[0].step <= pair[1].step
                && pair[0].files <= pair[1].files
                && pair[0].metrics.length <= pair[1].metrics.length
        });
        if !ordered || self.newest().files != self.files.len() {
            return Err("its commits do not follow each other");
        }
        let mut seen = HashSet::new();
        for file in &self.files {
            if names::check(&file.name).is_err() || !seen.insert(&file.name) {
                return Err("it has a file twice or with an impossible name");
            }
        }
        for commit in &self.commits {
            let expected = names::checkpoint(commit.step);
            if let Some(entry) = &commit.checkpoint
                && (entry.name != expected || !seen.insert(&entry.name))
            {
                return Err("it has a checkpoint twice or with an impossible name");
            }
        }
        let digests = self
            .files
            .iter()
            .chain(self.commits.iter().filter_map(|c| c.checkpoint.as_ref()))
            .map(|entry| &entry.sha256)
            .chain(self.commits.iter().map(|c| &c.metrics.sha256));
        if !digests.into_iter().all(|digest| is_digest(digest)) {
            return Err("it has an impossible checksum");
        }
        Ok(())
    }
}

//! Damaged and malicious files: what readers accept is what was written.

use std::path::Path;

use fuzzing::{CountingAllocator, Fuzz, Limit, peak_of};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::checkpoint::{self, END, START};
use crate::index::{Commit, Entry, Extent, FORMAT, Index, MAX_LENGTH};
use crate::{Checkpoint, Error, GridShape, Identity, State, fingerprint, names, seal};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// As documented at [`Checkpoint::MAX_HEADER`].
const CHECKPOINTS: Limit = Limit {
    times: 1,
    plus: 160 * Checkpoint::MAX_HEADER,
};
/// As documented in the crate.
const INDICES: Limit = Limit {
    times: 10,
    plus: 1 << 16,
};

fn identity() -> Identity {
    Identity {
        kind: "k".into(),
        program: "p".into(),
        grid: GridShape {
            cells: vec![2, 2],
            side: 2.0,
            origin: vec![-1.0, -1.0],
        },
        network: None,
        options: "o".into(),
    }
}

fn a_checkpoint() -> Vec<u8> {
    let state = State::new(12, 0.3)
        .with_array("u", vec![0.1, -2.0, f64::NAN, 1e300])
        .with_array("empty", vec![])
        .with_notes(json!({ "a": [1, 2.5, null], "b": "text" }));
    let start = checkpoint::start(&identity(), &state).unwrap();
    let mut bytes = Vec::new();
    checkpoint::write(&mut bytes, &start, &state).unwrap();
    bytes
}

fn an_index() -> Index {
    let entry = |name: &str| Entry {
        name: name.into(),
        length: 3,
        sha256: fingerprint(name),
    };
    let commit = |step, files| Commit {
        step,
        checkpoint: Some(entry(&names::checkpoint(step))),
        metrics: Extent {
            length: 10 * step,
            sha256: fingerprint("m"),
        },
        files,
    };
    Index {
        format: FORMAT,
        finished: false,
        identity: identity(),
        commits: vec![commit(3, 1), commit(6, 2)],
        files: vec![entry("manifest.json"), entry("fields/a")],
    }
}

fn text(index: &Index) -> Vec<u8> {
    seal::seal("the index", index, MAX_LENGTH)
        .unwrap()
        .into_bytes()
}

/// The sealed index with other content and the checksum that goes with it.
fn resealed(bytes: &[u8]) -> Vec<u8> {
    let at = "{ \"sha256\": \"".len();
    let mut bytes = bytes.to_vec();
    if bytes.len() >= at + 64 {
        let checksum = fingerprint(&bytes[at + 64..]);
        bytes[at..at + 64].copy_from_slice(checksum.as_bytes());
    }
    bytes
}

/// The checkpoint with other content and the checksum that goes with it.
fn rehashed(bytes: &[u8]) -> Vec<u8> {
    let end = bytes.len().saturating_sub(END);
    [&bytes[..end], Sha256::digest(&bytes[..end]).as_slice()].concat()
}

const PATH: &str = "some/file";

fn read_checkpoint(bytes: &[u8]) -> Result<Checkpoint, Error> {
    named(Checkpoint::from_bytes(bytes, PATH))
}

fn read_index(bytes: &[u8]) -> Result<Index, Error> {
    named(Index::decode(bytes, Path::new(PATH)))
}

/// Errors name the file.
fn named<T>(result: Result<T, Error>) -> Result<T, Error> {
    if let Err(error) = &result {
        assert!(error.to_string().contains(PATH), "{error}");
    }
    result
}

const WORDS: [&str; 12] = [
    "null",
    "[",
    "]",
    "{",
    "}",
    ",",
    ":",
    "\"",
    "1e999",
    "\"length\":",
    "\"name\":",
    "true",
];
const PAIRS: [[&str; 2]; 3] = [["[", "]"], ["{\"a\":", "}"], ["\"", "\""]];

fn checkpoints(name: &'static str) -> Fuzz<'static> {
    Fuzz::new(name, CHECKPOINTS)
        .valid([a_checkpoint()])
        .starts([&a_checkpoint()[..12]])
        .words(WORDS)
        .pairs(PAIRS)
}

fn indices(name: &'static str) -> Fuzz<'static> {
    Fuzz::new(name, INDICES)
        .valid([text(&an_index())])
        .starts([&text(&an_index())[..100]])
        .words(WORDS)
        .pairs(PAIRS)
}

#[test]
fn a_changed_checkpoint_is_refused() {
    let original = a_checkpoint();
    checkpoints("checkpoints").run(read_checkpoint, |bytes, _| assert_eq!(bytes, original));
}

/// Beyond the checksum: whatever is accepted can be written and read again.
#[test]
fn a_forged_checkpoint_does_no_harm() {
    let accepted = |_: &[u8], Checkpoint { identity, state }| {
        let start = checkpoint::start(&identity, &state);
        assert!(start.is_ok(), "{start:?}");
    };
    let forged = checkpoints("forged checkpoints").repair(|bytes| rehashed(&bytes));
    forged.run(read_checkpoint, accepted);
    // The length of the header fits again, if the change was there.
    let original = a_checkpoint();
    let fitting = checkpoints("fitting checkpoints").repair(|mut bytes| {
        if bytes.len() > START + END {
            let grown = bytes.len() as i64 - original.len() as i64;
            let header = i64::from(u32::from_le_bytes(original[12..16].try_into().unwrap()));
            let header = (header + grown).max(0) as u32;
            bytes[12..16].copy_from_slice(&header.to_le_bytes());
        }
        rehashed(&bytes)
    });
    fitting.run(read_checkpoint, accepted);
}

#[test]
fn a_changed_index_is_refused() {
    let original = text(&an_index());
    indices("indices").run(read_index, |bytes, _| assert_eq!(bytes, original));
}

/// Beyond the checksum: whatever is accepted can be used, and written and read again.
#[test]
fn a_forged_index_does_no_harm() {
    let forged = indices("forged indices").repair(|bytes| resealed(&bytes));
    forged.run(read_index, |_, index| {
        for commit in &index.commits {
            let only = index.only(commit);
            assert_eq!(read_index(&text(&only)).unwrap(), only);
        }
        assert_eq!(read_index(&text(&index)).unwrap(), index);
    });
}

#[test]
fn an_index_that_contradicts_itself_is_refused() {
    let changes: [(&str, fn(&mut Index)); 13] = [
        ("version 2", |i| i.format = 2),
        ("one or two commits", |i| i.commits.clear()),
        ("one or two commits", |i| {
            i.commits.insert(0, i.commits[0].clone());
        }),
        ("more than one", |i| i.finished = true),
        ("follow", |i| i.commits[0].files = 3),
        ("follow", |i| i.commits[1].files = 1),
        ("follow", |i| i.commits[1].files = 3),
        ("follow", |i| i.commits[0].metrics.length = 61),
        ("follow", |i| i.commits.swap(0, 1)),
        ("file twice", |i| i.files[1] = i.files[0].clone()),
        ("impossible name", |i| i.files[1].name = "../a".into()),
        ("checkpoint twice", |i| i.commits[0] = i.commits[1].clone()),
        ("impossible checksum", |i| {
            i.commits[0].metrics.sha256.make_ascii_uppercase();
        }),
    ];
    read_index(&text(&an_index())).unwrap();
    for (reason, change) in changes {
        let mut index = an_index();
        change(&mut index);
        let message = read_index(&text(&index)).unwrap_err().to_string();
        assert!(message.contains(reason), "{message} instead of {reason}");
    }
}

#[test]
fn lengths_that_no_file_backs_are_refused() {
    let original = a_checkpoint();
    let header_end = START + u32::from_le_bytes(original[12..16].try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&original[START..header_end]).unwrap();
    for length in [5u64, 1 << 20, 1 << 40, 1 << 60, 1 << 61, u64::MAX] {
        let mut header = header.clone();
        header["arrays"][0]["length"] = length.into();
        let header = serde_json::to_vec(&header).unwrap();
        let bytes = [
            &original[..12],
            &(header.len() as u32).to_le_bytes(),
            &header,
            &original[header_end..],
        ]
        .concat();
        let message = read_checkpoint(&rehashed(&bytes)).unwrap_err().to_string();
        assert!(message.contains("bytes where it should have"), "{message}");
    }
    let mut bytes = original;
    bytes[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    let message = read_checkpoint(&bytes).unwrap_err().to_string();
    assert!(message.contains("4294967295"), "{message}");
}

/// Headers and indices that make the most of every byte.
#[test]
fn the_worst_files_stay_within_the_limit() {
    let original = a_checkpoint();
    let end = START + u32::from_le_bytes(original[12..16].try_into().unwrap()) as usize;
    let header = std::str::from_utf8(&original[START..end]).unwrap();
    let (before, _) = header.split_once("\"notes\":").unwrap();
    // Maps take most: a node of a tree for every one, however small.
    let maps = format!("{}0{},", "{\"\":".repeat(100), "}".repeat(100));
    for block in ["0,", "[],", "{},", "\"\",", "{\"\":0},", &maps] {
        let length = Checkpoint::MAX_HEADER - before.len() - 100;
        let notes = format!("[{}0]", block.repeat(length / block.len()));
        let header = format!("{before}\"notes\":{notes},\"arrays\":[]}}");
        let bytes = [
            &original[..12],
            &(header.len() as u32).to_le_bytes(),
            header.as_bytes(),
            &[0; END],
        ];
        let bytes = rehashed(&bytes.concat());
        let (result, peak) = peak_of(|| read_checkpoint(&bytes));
        println!("notes of {block:.20}: {peak} bytes");
        assert!(result.is_ok());
        assert!(peak <= CHECKPOINTS.plus + bytes.len(), "{block}: {peak}");
    }
    let mut index = an_index();
    index.files = (0..5000)
        .map(|k| Entry {
            name: k.to_string(),
            length: 0,
            sha256: fingerprint("a"),
        })
        .collect();
    index.commits[1].files = 5000;
    let bytes = text(&index);
    let (result, peak) = peak_of(|| read_index(&bytes));
    println!("{} bytes: {peak}", bytes.len());
    assert_eq!(result.unwrap(), index);
    assert!(peak <= INDICES.times * bytes.len(), "{peak}");
}

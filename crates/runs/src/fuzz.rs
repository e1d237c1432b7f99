//! Readers take any bytes: what they accept is what was written, and they neither panic nor take
//! memory that the file does not back. `FUZZ_CASES` sets the number of cases.

use std::path::Path;

use proptest::prelude::*;
use proptest::sample::Index as Position;
use proptest::test_runner::RngSeed;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::checkpoint::{self, END, START};
use crate::index::{Commit, Entry, Extent, FORMAT, Index, MAX_LENGTH};
use crate::{Checkpoint, Error, GridShape, Identity, State, fingerprint, names, seal};

fn config() -> ProptestConfig {
    let cases = std::env::var("FUZZ_CASES").ok();
    ProptestConfig {
        cases: cases.map_or(256, |n| n.parse().expect("FUZZ_CASES is a number")),
        rng_seed: RngSeed::Fixed(11),
        ..ProptestConfig::default()
    }
}

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

/// One change to a file.
#[derive(Debug, Clone)]
enum Change {
    Set(Position, u8),
    Flip(Position, u8),
    Cut(Position),
    Insert(Position, Vec<u8>),
    Remove(Position, u8),
    /// A number somewhere, as JSON or as bytes.
    Number(Position, u64),
}

impl Change {
    fn apply(&self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let length = bytes.len();
        match self {
            Self::Set(at, value) => bytes[at.index(length)] = *value,
            Self::Flip(at, bit) => bytes[at.index(length)] ^= 1 << (bit % 8),
            Self::Cut(at) => bytes.truncate(at.index(length)),
            Self::Insert(at, more) => {
                let at = at.index(length);
                bytes.splice(at..at, more.iter().copied());
            }
            Self::Remove(at, count) => {
                let at = at.index(length);
                bytes.drain(at..length.min(at + usize::from(*count)));
            }
            Self::Number(at, value) => {
                let digits: Vec<usize> =
                    (0..length).filter(|&i| bytes[i].is_ascii_digit()).collect();
                if let Some(&at) = digits.get(at.index(digits.len().max(1))) {
                    bytes.splice(at..=at, value.to_string().into_bytes());
                }
            }
        }
    }
}

fn change() -> impl Strategy<Value = Change> {
    let at = any::<Position>;
    prop_oneof![
        (at(), any::<u8>()).prop_map(|(at, v)| Change::Set(at, v)),
        (at(), any::<u8>()).prop_map(|(at, v)| Change::Flip(at, v)),
        at().prop_map(Change::Cut),
        (at(), prop::collection::vec(any::<u8>(), 1..9)).prop_map(|(at, v)| Change::Insert(at, v)),
        (at(), any::<u8>()).prop_map(|(at, v)| Change::Remove(at, v)),
        (
            at(),
            prop_oneof![any::<u64>(), 0..100u64, Just(u64::MAX / 8 + 1)]
        )
            .prop_map(|(at, v)| Change::Number(at, v)),
    ]
}

fn changes() -> impl Strategy<Value = Vec<Change>> {
    prop::collection::vec(change(), 1..4)
}

fn changed(original: &[u8], changes: &[Change]) -> Vec<u8> {
    let mut bytes = original.to_vec();
    for change in changes {
        change.apply(&mut bytes);
    }
    bytes
}

/// Errors are one line and name the file.
fn one_line<T>(result: &Result<T, Error>) -> Result<(), TestCaseError> {
    if let Err(error) = result {
        let message = error.to_string();
        prop_assert!(
            message.contains("some/file") && !message.contains('\n'),
            "{message}"
        );
    }
    Ok(())
}

const PATH: &str = "some/file";

fn read_checkpoint(bytes: &[u8]) -> Result<Checkpoint, Error> {
    Checkpoint::from_bytes(bytes, PATH)
}

fn read_index(bytes: &[u8]) -> Result<Index, Error> {
    Index::decode(bytes, Path::new(PATH))
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn arbitrary_bytes_are_no_checkpoint(
        bytes in prop::collection::vec(any::<u8>(), 0..200),
        whole in any::<bool>(),
    ) {
        // Behind the magic and the version, or from the beginning.
        let start = a_checkpoint()[..if whole { 0 } else { 12 }].to_vec();
        let result = read_checkpoint(&[start, bytes].concat());
        one_line(&result)?;
        prop_assert!(result.is_err());
    }

    #[test]
    fn a_changed_checkpoint_is_refused(changes in changes()) {
        let original = a_checkpoint();
        let bytes = changed(&original, &changes);
        let result = read_checkpoint(&bytes);
        one_line(&result)?;
        prop_assert_eq!(result.is_ok(), bytes == original);
    }

    /// Beyond the checksum: whatever is accepted can be written and read again.
    #[test]
    fn a_forged_checkpoint_does_no_harm(changes in changes(), fit in any::<bool>()) {
        let original = a_checkpoint();
        let mut bytes = changed(&original, &changes);
        if fit && bytes.len() > START + END {
            // The length of the header fits again, if the change was there.
            let grown = bytes.len() as i64 - original.len() as i64;
            let header = i64::from(u32::from_le_bytes(original[12..16].try_into().unwrap()));
            let header = (header + grown).max(0) as u32;
            bytes[12..16].copy_from_slice(&header.to_le_bytes());
        }
        let result = read_checkpoint(&rehashed(&bytes));
        one_line(&result)?;
        if let Ok(Checkpoint { identity, state }) = result {
            let start = checkpoint::start(&identity, &state);
            prop_assert!(start.is_ok(), "{start:?}");
        }
    }

    #[test]
    fn arbitrary_bytes_are_no_index(
        bytes in prop::collection::vec(any::<u8>(), 0..200),
        sealed in any::<bool>(),
    ) {
        let mut all = bytes;
        if sealed {
            all = resealed(&[&text(&an_index())[..100], &all].concat());
        }
        let result = read_index(&all);
        one_line(&result)?;
        prop_assert!(result.is_err());
    }

    #[test]
    fn a_changed_index_is_refused(changes in changes()) {
        let original = text(&an_index());
        let bytes = changed(&original, &changes);
        let result = read_index(&bytes);
        one_line(&result)?;
        prop_assert_eq!(result.is_ok(), bytes == original);
    }

    /// Beyond the checksum: whatever is accepted can be used, and written and read again.
    #[test]
    fn a_forged_index_does_no_harm(changes in changes()) {
        let bytes = resealed(&changed(&text(&an_index()), &changes));
        let result = read_index(&bytes);
        one_line(&result)?;
        if let Ok(index) = result {
            for commit in &index.commits {
                let only = index.only(commit);
                prop_assert_eq!(read_index(&text(&only)).unwrap(), only);
            }
            prop_assert_eq!(read_index(&text(&index)).unwrap(), index);
        }
    }
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

/// The tests above once more, in a process that has 256 MiB of addresses in all.
#[cfg(target_os = "linux")]
#[test]
fn readers_are_bounded_in_memory() {
    let output = std::process::Command::new("sh")
        .args(["-c", "ulimit -v 262144; exec \"$0\" \"$@\""])
        .arg(std::env::current_exe().unwrap())
        .args(["fuzz::", "--skip", "bounded_in_memory", "--test-threads=1"])
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}");
    assert!(text.contains("8 passed"), "{text}");
}

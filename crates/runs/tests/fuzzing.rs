//! Damaged and malicious files: what readers accept is what was written.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use ::fuzzing::{Fuzz, Limit, peak_of};
use files::{Sha256, hexadecimal};
use runs::{Error, RunDirectory, State, StoredRun};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::damage::rehashed;
use crate::toy::{Quick, quick_folder};

/// As documented in the crate, for any parts of the file.
const LIMIT: Limit = Limit {
    times: 78,
    plus: 160 * State::MAX_NOTES,
};
/// Bytes before the header, and after the arrays.
const START: usize = 20;
const END: usize = 32;

/// A run whose files are changed.
struct Fixture {
    _root: TempDir,
    folder: PathBuf,
}

impl Fixture {
    fn new() -> Self {
        let root = quick_folder();
        let folder = root.path().join("run");
        let state = State::new(12, json!({ "a": [1, 2.5, null], "b": "text" }))
            .with_array("u", vec![0.1, -2.0, f64::NAN, 1e300])
            .with_array("empty", vec![]);
        let files = [("a", &b"abc"[..]), ("fields/b", b"")];
        let storage = Arc::new(Quick);
        let mut run = RunDirectory::create_on(storage, &folder, &files, &state).unwrap();
        run.replace_file("c.csv", b"").unwrap();
        run.write_timings(&[1.5, 2e-300, 0.0]).unwrap();
        run.finish(&state).unwrap();
        Self {
            _root: root,
            folder,
        }
    }

    fn checkpoint(&self) -> PathBuf {
        self.folder.join("checkpoints/step-00000012.ckpt")
    }

    /// Errors name the file, or one that it lists.
    fn open(&self) -> Result<StoredRun, Error> {
        let opened = StoredRun::find_on(Arc::new(Quick), &self.folder, false);
        if let Err(error) = &opened {
            let folder = self.folder.to_str().unwrap();
            assert!(error.to_string().contains(folder), "{error}");
        }
        opened
    }

    fn read_checkpoint(&self, bytes: &[u8]) -> Result<StoredRun, Error> {
        // An accepted list of files may have removed it.
        fs::write(self.folder.join("a"), "abc").unwrap();
        fs::create_dir_all(self.folder.join("fields")).unwrap();
        fs::write(self.folder.join("fields/b"), "").unwrap();
        fs::write(self.folder.join("c.csv"), "").unwrap();
        fs::write(self.checkpoint(), bytes).unwrap();
        self.open()
    }

    fn read_timings(&self, bytes: &[u8]) -> Result<StoredRun, Error> {
        fs::write(self.folder.join("timings.json"), bytes).unwrap();
        self.open()
    }
}

/// Where the header of a checkpoint ends.
fn header_end(bytes: &[u8]) -> usize {
    START + u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize
}

/// The checkpoint with another header or other notes, and all that goes with it.
fn assembled(original: &[u8], header: &[u8], notes: &[u8]) -> Vec<u8> {
    let in_notes = u32::from_le_bytes(original[16..20].try_into().unwrap()) as usize;
    let length = |json: &[u8]| (json.len() as u32).to_le_bytes();
    let parts = [
        &original[..12],
        &length(header),
        &length(notes),
        header,
        notes,
        &original[header_end(original) + in_notes..],
    ];
    rehashed(&parts.concat())
}

fn with_header(original: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let end = header_end(original);
    let mut header = serde_json::from_slice(&original[START..end]).unwrap();
    change(&mut header);
    let in_notes = u32::from_le_bytes(original[16..20].try_into().unwrap()) as usize;
    let notes = &original[end..end + in_notes];
    assembled(original, &serde_json::to_vec(&header).unwrap(), notes)
}

fn fuzz(name: &'static str, original: &[u8]) -> Fuzz<'static> {
    const WORDS: [&str; 14] = [
        "null",
        "[",
        "]",
        "{",
        "{\"a\":",
        "}",
        ",",
        ":",
        "\"",
        "1e999",
        "\"length\":",
        "\"written\":",
        "\"derived\":",
        "true",
    ];
    Fuzz::new(name, LIMIT)
        .valid([original.to_vec()])
        .starts([&original[..12]])
        .words(WORDS)
}

#[test]
fn fuzzing_a_changed_checkpoint_is_refused() {
    let run = Fixture::new();
    let original = fs::read(run.checkpoint()).unwrap();
    fuzz("checkpoints", &original).run(
        |bytes| run.read_checkpoint(bytes),
        |bytes, _| assert_eq!(bytes, original),
    );
}

/// Beyond the checksum: whatever is accepted can be gone on from, written and read again.
#[test]
fn fuzzing_a_forged_checkpoint_does_no_harm() {
    let run = Fixture::new();
    let original = fs::read(run.checkpoint()).unwrap();
    let accepted = |_: &[u8], stored: StoredRun| {
        let (mut resumed, state) = stored.resume().unwrap();
        resumed.commit(&state).unwrap();
        drop(resumed);
        let again = run.open().unwrap();
        assert_eq!(format!("{:?}", again.state()), format!("{state:?}"));
    };
    let read = |bytes: &[u8]| run.read_checkpoint(bytes);
    let forged = fuzz("forged checkpoints", &original).repair(|bytes| rehashed(&bytes));
    forged.run(read, accepted);
    // The length of the header, or of the notes, fits again, if the change was there.
    for (name, at) in [("fitting headers", 12), ("fitting notes", 16)] {
        let fitting = fuzz(name, &original).repair(|mut bytes| {
            if bytes.len() > START + END {
                let grown = bytes.len() as i64 - original.len() as i64;
                let length = u32::from_le_bytes(original[at..at + 4].try_into().unwrap());
                let length = (i64::from(length) + grown).max(0) as u32;
                bytes[at..at + 4].copy_from_slice(&length.to_le_bytes());
            }
            rehashed(&bytes)
        });
        fitting.run(read, accepted);
    }
}

#[test]
fn fuzzing_changed_timings_are_refused() {
    let run = Fixture::new();
    let original = fs::read(run.folder.join("timings.json")).unwrap();
    let same = |bytes: &[u8], _: StoredRun| assert_eq!(bytes, original);
    fuzz("timings", &original).run(|bytes| run.read_timings(bytes), same);
    // Beyond the checksum, which is that of the content: only one text goes with it.
    let at = "{\n  \"sha256\": \"".len();
    let resealed = |mut bytes: Vec<u8>| {
        let middle = "\",\n  \"content\": ".len();
        if bytes.len() >= at + 64 + middle + 3 {
            let content = &bytes[at + 64 + middle..bytes.len() - 3];
            let checksum = hexadecimal(Sha256::of(content));
            bytes[at..at + 64].copy_from_slice(checksum.as_bytes());
        }
        bytes
    };
    let forged = fuzz("forged timings", &original).repair(resealed);
    forged.run(
        |bytes| run.read_timings(bytes),
        |bytes, stored| {
            let timings = stored.timings().to_vec();
            let (resumed, _) = stored.resume().unwrap();
            resumed.write_timings(&timings).unwrap();
            let text = fs::read(run.folder.join("timings.json")).unwrap();
            assert_eq!(text, bytes);
        },
    );
}

#[test]
fn a_header_that_contradicts_itself_is_refused() {
    let run = Fixture::new();
    let original = fs::read(run.checkpoint()).unwrap();
    let changes: [(&str, fn(&mut Value)); 14] = [
        ("of step 13", |h| h["step"] = json!(13)),
        ("not as expected", |h| h["step"] = json!(-1)),
        ("not as expected", |h| h["finished"] = json!(2)),
        ("not as expected", |h| h["more"] = json!(2)),
        ("not as expected", |h| h["files"]["a"]["more"] = json!(2)),
        ("without names", |h| h["arrays"][1][0] = json!("u")),
        ("without names", |h| h["arrays"][1][0] = json!("")),
        ("\"../a\"", |h| h["files"]["../a"] = h["files"]["a"].clone()),
        ("[[[ ...\"", |h| {
            h["files"]["[".repeat(10_000)] = h["files"]["a"].clone();
        }),
        ("\"Lock\"", |h| h["files"]["Lock"] = h["files"]["a"].clone()),
        ("is missing", |h| {
            h["files"]["d"] = h["files"]["a"].clone();
        }),
        ("checksum", |h| {
            h["files"]["a"]["written"]["length"] = json!(4);
        }),
        ("checksum", |h| {
            h["files"]["a"]["written"]["sha256"] = json!("5C");
        }),
        ("8 bytes too many", |h| h["arrays"][0][1] = json!(3)),
    ];
    drop(
        run.read_checkpoint(&with_header(&original, |_| {}))
            .unwrap(),
    );
    for (reason, change) in changes {
        let refused = run.read_checkpoint(&with_header(&original, change));
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(reason), "{message} instead of {reason}");
        ::fuzzing::assert_short_line(&message);
    }
}

#[test]
fn lengths_that_no_file_backs_are_refused() {
    let run = Fixture::new();
    let original = fs::read(run.checkpoint()).unwrap();
    for length in [5u64, 1 << 20, 1 << 40, 1 << 60, 1 << 61, u64::MAX] {
        let bytes = with_header(&original, |h| h["arrays"][0][1] = json!(length));
        let (refused, peak) = peak_of(|| run.read_checkpoint(&bytes));
        let message = refused.unwrap_err().to_string();
        assert!(message.contains("ends early"), "{message}");
        assert!(peak < 1 << 16, "{peak}");
    }
    for at in [12, 16] {
        let mut bytes = original.clone();
        bytes[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
        let refused = run.read_checkpoint(&rehashed(&bytes));
        let message = refused.unwrap_err().to_string();
        assert!(message.contains("4294967295"), "{message}");
    }
}

#[test]
fn arrays_come_back_bit_for_bit_and_constants_take_little() {
    let root = quick_folder();
    let folder = root.path().join("run");
    let mut values = vec![-1.0; 10_000];
    (values[64], values[5000]) = (0.3, f64::NAN);
    values.extend([0.0, -0.0]);
    let state = State::new(3, Value::Null)
        .with_array("u", values)
        .with_array("nothing", vec![])
        .with_array("v", vec![-0.0; 65]);
    drop(RunDirectory::create_on(Arc::new(Quick), &folder, &[], &state).unwrap());
    let stored = StoredRun::find_on(Arc::new(Quick), &folder, false).unwrap();
    let bits = |state: &State| -> Vec<Vec<u64>> {
        let arrays = state.arrays.iter();
        arrays
            .map(|(_, values)| values.iter().map(|v| v.to_bits()).collect())
            .collect()
    };
    assert_eq!(bits(stored.state()), bits(&state));
    let file = folder.join("checkpoints/step-00000003.ckpt");
    assert!(fs::metadata(file).unwrap().len() < 4000);
}

/// Headers and notes that make the most of every byte.
#[test]
fn the_worst_files_stay_within_the_limit() {
    let run = Fixture::new();
    let original = fs::read(run.checkpoint()).unwrap();
    let header = &original[START..header_end(&original)];
    // Maps take most: a node of a tree for every one, however small.
    let maps = format!("{}0{},", "{\"\":".repeat(100), "}".repeat(100));
    for block in ["0,", "[],", "{},", "\"\",", "{\"\":0},", &maps] {
        let length = State::MAX_NOTES - 100;
        let notes = format!("[{}0]", block.repeat(length / block.len()));
        let bytes = assembled(&original, header, notes.as_bytes());
        let (result, peak) = peak_of(|| run.read_checkpoint(&bytes));
        println!("notes of {block:.20}: {peak} bytes");
        assert!(result.is_ok());
        assert!(peak <= LIMIT.plus + 2 * bytes.len(), "{block}: {peak}");
    }
    let digits = b"0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";
    let name = |k: usize| -> String {
        let digit = |n: usize| char::from(digits[n % digits.len()]);
        [digit(k / 3844), digit(k / 62), digit(k)].iter().collect()
    };
    let many = |change: &dyn Fn(&mut Value)| with_header(&original, change);
    let constant = many(&|h| h["arrays"][1][1] = json!(64 * 10_000));
    let blocks = [0; 9].repeat(10_000);
    let constant = [&constant[..constant.len() - END], &blocks, &[0; END]].concat();
    for bytes in [
        rehashed(&constant),
        many(&|h| {
            for k in 0..200_000 {
                h["files"][name(k)] = json!({ "derived": null });
            }
        }),
        many(&|h| {
            let arrays = h["arrays"].as_array_mut().unwrap();
            arrays.extend((0..200_000).map(|k| json!([name(k), 0])));
        }),
    ] {
        let (result, peak) = peak_of(|| run.read_checkpoint(&bytes));
        println!("{} bytes: {peak}", bytes.len());
        assert!(result.is_ok(), "{result:?}");
        assert!(peak <= LIMIT.times * bytes.len(), "{peak}");
    }
    fs::write(run.checkpoint(), &original).unwrap();
    let seconds = "0,".repeat(500_000);
    let timings = format!(r#"{{"sha256":"","content":{{"seconds":[{seconds}0]}}}}"#);
    let (result, peak) = peak_of(|| run.read_timings(timings.as_bytes()));
    println!("{} bytes of timings: {peak}", timings.len());
    assert!(result.is_err());
    assert!(peak <= 40 * timings.len(), "{peak}");
}

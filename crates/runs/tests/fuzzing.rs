//! Damaged and malicious files: what readers accept is what was written.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use ::fuzzing::{Fuzz, Limit, peak_of};
use ciborium::Value;
use runs::{CheckpointState, Error, RunDirectory, StoredRun};
use serde_json::json;
use tempfile::TempDir;

use crate::damage::rehashed;
use crate::toy::{Quick, quick_folder};

/// Small maps take most.
const LIMIT: Limit = Limit {
    times: 320,
    plus: 1 << 16,
};
/// Bytes before what is CBOR, and after it.
const START: usize = 12;
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
        let state = CheckpointState::new(12, json!({ "a": [1, 2.5, null], "b": "text" }))
            .with_array("u", vec![0.1, -2.0, f64::NAN, 1e300])
            .with_array("empty", vec![]);
        let files = [("a", &b"abc"[..]), ("fields/b", b"")];
        let file_system = Arc::new(Quick);
        let mut run = RunDirectory::create_on(file_system, &folder, &files, &state).unwrap();
        run.replace_file("c.csv", b"").unwrap();
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
}

/// The checkpoint with other content, and the checksum that goes with it.
fn with_content(original: &[u8], change: impl FnOnce(&mut [Value])) -> Vec<u8> {
    let content = &original[START..original.len() - END];
    let mut content: Value = ciborium::from_reader(content).unwrap();
    change(content.as_array_mut().unwrap());
    let mut bytes = original[..START].to_vec();
    ciborium::into_writer(&content, &mut bytes).unwrap();
    rehashed(&[&bytes[..], &[0; END]].concat())
}

/// The value of a map at a key, which is added if it is not there.
fn at<'a>(map: &'a mut Value, key: &str) -> &'a mut Value {
    let map = map.as_map_mut().unwrap();
    let place = map.iter().position(|(k, _)| k.as_text() == Some(key));
    let place = place.unwrap_or_else(|| {
        map.push((key.into(), Value::Null));
        map.len() - 1
    });
    &mut map[place].1
}

fn fuzz(name: &'static str, original: &[u8]) -> Fuzz<'static> {
    Fuzz::new(name, LIMIT)
        .valid([original.to_vec()])
        .starts([&original[..START]])
        .words(["length", "sha256", "step", "notes", "arrays"])
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
}

#[test]
fn content_that_contradicts_itself_is_refused() {
    let run = Fixture::new();
    let original = fs::read(run.checkpoint()).unwrap();
    fn file(name: &str) -> impl Fn(&mut [Value]) {
        move |c| {
            let a = at(&mut c[1], "a").clone();
            *at(&mut c[1], name) = a;
        }
    }
    let long = "[".repeat(10_000);
    type Change<'a> = Box<dyn Fn(&mut [Value]) + 'a>;
    let changes: [(&str, Change<'_>); 13] = [
        (
            "of step 13",
            Box::new(|c| *at(&mut c[2], "step") = 13.into()),
        ),
        (
            "not as expected",
            Box::new(|c| *at(&mut c[2], "step") = (-1).into()),
        ),
        (
            "not as expected",
            Box::new(|c| *at(&mut c[2], "more") = 2.into()),
        ),
        (
            "not as expected",
            Box::new(|c| *at(&mut c[2], "arrays") = Value::Null),
        ),
        ("not as expected", Box::new(|c| c[0] = 2.into())),
        (
            "not as expected",
            Box::new(|c| *at(at(&mut c[1], "a"), "more") = 2.into()),
        ),
        (
            "cut off",
            Box::new(|c| *at(at(&mut c[2], "arrays"), "u") = Value::Bytes(vec![0; 15])),
        ),
        ("\"../a\"", Box::new(file("../a"))),
        ("[[[ ...\"", Box::new(file(&long))),
        ("\"Lock\"", Box::new(file("Lock"))),
        ("is missing", Box::new(file("d"))),
        (
            "checksum",
            Box::new(|c| *at(at(&mut c[1], "a"), "length") = 4.into()),
        ),
        (
            "checksum",
            Box::new(|c| *at(at(&mut c[1], "a"), "sha256") = "5C".into()),
        ),
    ];
    let same = with_content(&original, |_| {});
    assert_eq!(same, original);
    drop(run.read_checkpoint(&same).unwrap());
    for (reason, change) in changes {
        let refused = run.read_checkpoint(&with_content(&original, change));
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(reason), "{message} instead of {reason}");
        ::fuzzing::assert_short_line(&message);
    }
}

#[test]
fn lengths_that_no_file_backs_are_refused() {
    let run = Fixture::new();
    let original = fs::read(run.checkpoint()).unwrap();
    // Four numbers: a string of 32 bytes.
    let start = [&[0x58, 32], &0.1_f64.to_le_bytes()[..]].concat();
    let place = original.windows(start.len()).position(|w| w == start);
    let (before, after) = original.split_at(place.unwrap());
    for length in [1u64 << 20, 1 << 40, 1 << 60, 1 << 61, u64::MAX] {
        let bytes = [before, &[0x5b], &length.to_be_bytes(), &after[2..]].concat();
        let (refused, peak) = peak_of(|| run.read_checkpoint(&rehashed(&bytes)));
        let message = refused.unwrap_err().to_string();
        assert!(message.contains("not as expected"), "{message}");
        assert!(peak < 1 << 16, "{peak}");
    }
    let more = [&original[..original.len() - END], &[0; END + 3]].concat();
    let message = run.read_checkpoint(&rehashed(&more)).unwrap_err();
    assert!(
        message.to_string().contains("3 bytes too many"),
        "{message}"
    );
}

#[test]
fn arrays_come_back_bit_for_bit() {
    let root = quick_folder();
    let folder = root.path().join("run");
    let mut values = vec![-1.0; 10_000];
    (values[64], values[5000]) = (0.3, f64::NAN);
    values.extend([0.0, -0.0]);
    let state = CheckpointState::new(3, json!(null))
        .with_array("u", values)
        .with_array("nothing", vec![])
        .with_array("v", vec![-0.0; 65]);
    drop(RunDirectory::create_on(Arc::new(Quick), &folder, &[], &state).unwrap());
    let stored = StoredRun::find_on(Arc::new(Quick), &folder, false).unwrap();
    let bits = |state: &CheckpointState| -> Vec<Vec<u64>> {
        let arrays = state.arrays.iter();
        arrays
            .map(|(_, values)| values.0.iter().map(|v| v.to_bits()).collect())
            .collect()
    };
    assert_eq!(bits(stored.state()), bits(&state));
}

/// Content that makes the most of every byte.
#[test]
fn the_worst_files_stay_within_the_limit() {
    let run = Fixture::new();
    let original = fs::read(run.checkpoint()).unwrap();
    let many = |each: Value| vec![each; 100_000];
    let small = || Value::Map(vec![("".into(), 0.into())]);
    let deep = (0..100).fold(0.into(), |inner: Value, _| {
        Value::Map(vec![("".into(), inner)])
    });
    let named = |each: Value| {
        let entries = (0..100_000).map(|k| (format!("{k:x}").into(), each.clone()));
        Value::Map(entries.collect())
    };
    let changes: [(&str, usize, Value); 6] = [
        ("notes", 2, many(0.into()).into()),
        ("notes", 2, many("".into()).into()),
        ("notes", 2, many(small()).into()),
        ("notes", 2, vec![deep; 1000].into()),
        ("arrays", 2, named(Value::Bytes(Vec::new()))),
        ("files", 1, named(Value::Null)),
    ];
    for (what, place, value) in changes {
        let bytes = with_content(&original, |c| match what {
            "files" => c[place] = value,
            what => *at(&mut c[place], what) = value,
        });
        let (result, peak) = peak_of(|| run.read_checkpoint(&bytes));
        println!("{} bytes of {what}: {peak}", bytes.len());
        assert!(result.is_ok(), "{result:?}");
        assert!(peak <= LIMIT.times * bytes.len(), "{peak}");
    }
}

//! What a reader must not do is found.

use std::fmt::Display;
use std::str::Utf8Error;

use fuzzing::{CountingAllocator, Fuzz, Limit, Report, peak_of};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

const LIMIT: Limit = Limit {
    times: 4,
    plus: 1000,
};

fn fuzz<T, E: Display>(read: impl Fn(&[u8]) -> Result<T, E>) -> Report {
    Fuzz::new("test", LIMIT)
        .valid([b"rows 12 [ 1 2 3 ]".to_vec()])
        .starts(["rows "])
        .words(["rows", "columns", "[", "]"])
        .run(read, |_, _| ())
}

fn count(bytes: &[u8]) -> Option<u128> {
    let text = str::from_utf8(bytes).ok()?;
    text.strip_prefix("rows ")?.split(' ').next()?.parse().ok()
}

fn careful(bytes: &[u8]) -> Result<String, Utf8Error> {
    str::from_utf8(bytes).map(str::to_owned)
}

#[test]
fn a_good_reader_passes_and_the_same_cases_come_again() {
    let [report, again] = [(), ()].map(|()| fuzz(careful));
    assert_eq!(report.cases, 2001);
    assert!(report.accepted > 200 && report.accepted < 2000, "{report}");
    assert!(report.largest > 10_000, "{report}");
    assert!(report.largest_part <= 1.0 && report.slowest <= report.time);
    assert_eq!(
        (report.accepted, report.largest),
        (again.accepted, again.largest)
    );
}

#[test]
#[should_panic(expected = "panic: attempt to divide by zero")]
fn panics_are_found() {
    fuzz(|bytes| Ok::<_, Utf8Error>(count(bytes).map(|n| 1000 / n)));
}

#[test]
#[should_panic(expected = "the limit is 10")]
fn memory_on_the_word_of_a_header_is_found() {
    fuzz(|bytes| {
        let rows = count(bytes).unwrap_or(0).min(1 << 20);
        Ok::<_, Utf8Error>(Vec::<u64>::with_capacity(rows as usize))
    });
}

#[test]
#[should_panic(expected = "panic: too deep")]
fn deep_nesting_is_found() {
    fuzz(|bytes| {
        let open = bytes.split(|&b| b == b'[').count();
        assert!(open < 10_000, "too deep");
        Ok::<_, Utf8Error>(())
    });
}

#[test]
#[should_panic(expected = "not one short line")]
fn messages_of_any_length_are_found() {
    fuzz(|bytes| match careful(bytes) {
        Ok(text) if text.starts_with("rows ") => Ok(()),
        text => Err(format!("no rows in {text:?}")),
    });
}

#[test]
#[should_panic(expected = "valid file 0")]
fn a_reader_that_refuses_everything_is_found() {
    fuzz(|_| Err::<(), _>("no"));
}

#[test]
fn memory_is_counted() {
    let ((), peak) = peak_of(|| {
        let one = vec![1_u8; 1000];
        drop(one);
        let mut two = vec![1_u8; 1500];
        two.reserve_exact(500);
        drop(std::hint::black_box(two));
    });
    // Both blocks of the one that grows.
    assert_eq!(peak, 3500);
}

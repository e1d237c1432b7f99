//! Changes of files, from flipped bits to numbers that no file should have.

use proptest::prelude::*;
use proptest::sample::{Index, select};

/// Longest file, in bytes. Larger ones take longer, and show nothing else.
const LONGEST: usize = 1 << 16;

/// Numbers as text that are hard to bear.
const NUMBERS: [&str; 37] = [
    "",
    "0",
    "-0",
    "-1",
    "1",
    "2",
    "3",
    "127",
    "128",
    "255",
    "256",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "-2147483649",
    "4294967295",
    "4294967296",
    "1152921504606846976",
    "2305843009213693952",
    "9223372036854775807",
    "9223372036854775808",
    "-9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "99999999999999999999999999999999999999999999999999999999999999999999999999999999",
    "1e12",
    "1e308",
    "-1e308",
    "1e309",
    "1e-320",
    "1e999999999999",
    "0.1",
    "nan",
    "inf",
    "-inf",
    "0x10",
];

/// The same as bits of whole and floating-point numbers, of which the low bytes are taken.
const BITS: [u64; 24] = [
    0,
    1,
    2,
    0x7f,
    0x80,
    0xff,
    0x100,
    0x7fff,
    0xffff,
    0x1_0000,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x1_0000_0000,
    0x7f80_0000, // infinity, single precision
    0x7fc0_0000, // NaN
    0x7f7f_ffff, // the largest
    1 << 60,
    1 << 61,
    1 << 63,
    0x7ff0_0000_0000_0000, // infinity, double precision
    0x7ff8_0000_0000_0000, // NaN
    0x7fef_ffff_ffff_ffff, // the largest
    u64::MAX,
];

/// Bytes that stand at the beginning of most headers.
const EARLY: usize = 256;

/// A place in a file, which can be its end.
#[derive(Clone, Debug)]
pub(crate) enum Place {
    Anywhere(Index),
    Early(Index),
    End,
}

impl Place {
    fn of(&self, bytes: &[u8]) -> usize {
        match self {
            Self::Anywhere(index) => index.index(bytes.len() + 1),
            Self::Early(index) => index.index(bytes.len().min(EARLY) + 1),
            Self::End => bytes.len(),
        }
    }
}

fn place() -> impl Strategy<Value = Place> {
    prop_oneof![
        4 => any::<Index>().prop_map(Place::Anywhere),
        3 => any::<Index>().prop_map(Place::Early),
        1 => Just(Place::End),
    ]
}

/// One change to a file.
#[derive(Clone, Debug)]
pub(crate) enum Change {
    Set(Place, u8),
    Flip(Place, u8),
    Truncate(Place),
    Insert(Place, Vec<u8>),
    Remove(Place, usize),
    /// So many bytes once more, so often.
    Repeat(Place, usize, usize),
    /// Lines, or what there is between line breaks, change places.
    Swap(Place, Place),
    /// From here on another file, from there on.
    Splice(Place, Index, Place),
    /// A number in the text becomes another.
    Number(Index, String),
    /// Bytes become a number: 2 to the power of this many, this one, big-endian.
    Bits(Place, u32, u64, bool),
    /// A word of the format, so often.
    Word(Place, Index, usize),
    /// A pair of words around so many bytes, so often.
    Nest(Place, usize, Index, usize),
}

/// What a change can take from.
pub(crate) struct Material {
    /// Whole files and beginnings of files.
    pub files: Vec<Vec<u8>>,
    /// Words of the format.
    pub words: Vec<Vec<u8>>,
    /// Words that open something, and those that close it.
    pub pairs: Vec<[Vec<u8>; 2]>,
}

impl Change {
    /// Changes the bytes, of which [`LONGEST`] remain.
    pub fn apply(&self, bytes: &mut Vec<u8>, material: &Material) {
        let length = bytes.len();
        match self {
            Self::Set(at, value) => {
                let at = at.of(bytes);
                if at < length {
                    bytes[at] = *value;
                }
            }
            Self::Flip(at, bit) => {
                let at = at.of(bytes);
                if at < length {
                    bytes[at] ^= 1 << (bit % 8);
                }
            }
            Self::Truncate(at) => bytes.truncate(at.of(bytes)),
            Self::Insert(at, more) => insert(bytes, at.of(bytes), more, 1),
            Self::Remove(at, count) => {
                let at = at.of(bytes);
                bytes.drain(at..length.min(at + count));
            }
            Self::Repeat(at, count, times) => {
                let at = at.of(bytes);
                let block = bytes[at..length.min(at + count)].to_vec();
                insert(bytes, at, &block, *times);
            }
            Self::Swap(one, other) => {
                let mut lines: Vec<&[u8]> = bytes.split_inclusive(|&b| b == b'\n').collect();
                let line = |at: usize| bytes[..at].split(|&b| b == b'\n').count() - 1;
                let [one, other] = [one, other].map(|at| line(at.of(bytes)));
                if one < lines.len() && other < lines.len() {
                    lines.swap(one, other);
                    *bytes = lines.concat();
                }
            }
            Self::Splice(at, other, from) => {
                let at = at.of(bytes);
                let other: &Vec<u8> = other.get(&material.files);
                bytes.truncate(at);
                bytes.extend(&other[from.of(other)..]);
            }
            Self::Number(which, text) => {
                let numbers = numbers(bytes);
                if !numbers.is_empty() {
                    let range = which.get(&numbers).clone();
                    bytes.splice(range, text.bytes());
                }
            }
            Self::Bits(at, power, number, big_endian) => {
                let at = at.of(bytes);
                let size = 1 << power;
                let mut number = number.to_le_bytes()[..size].to_vec();
                if *big_endian {
                    number.reverse();
                }
                let end = length.min(at + size);
                bytes[at..end].copy_from_slice(&number[..end - at]);
            }
            Self::Word(at, which, times) => {
                if !material.words.is_empty() {
                    let word: &Vec<u8> = which.get(&material.words);
                    insert(bytes, at.of(bytes), word, *times);
                }
            }
            Self::Nest(at, count, which, times) => {
                if !material.pairs.is_empty() {
                    let [open, close] = which.get(&material.pairs);
                    let at = at.of(bytes);
                    insert(bytes, length.min(at + count), close, *times);
                    insert(bytes, at, open, *times);
                }
            }
        }
        bytes.truncate(LONGEST);
    }
}

fn insert(bytes: &mut Vec<u8>, at: usize, block: &[u8], times: usize) {
    let times = times.min(LONGEST / block.len().max(1));
    bytes.splice(at..at, block.repeat(times));
}

/// Where numbers stand in a text.
fn numbers(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let part = |b: &u8| b.is_ascii_digit() || b"+-.eE".contains(b);
    let mut found = Vec::new();
    let mut start = 0;
    while start < bytes.len() {
        let length = bytes[start..].iter().take_while(|b| part(b)).count();
        if bytes[start..start + length].iter().any(u8::is_ascii_digit) {
            found.push(start..start + length);
        }
        start += length + 1;
    }
    found
}

fn change() -> impl Strategy<Value = Change> {
    let byte = any::<u8>;
    let which = any::<Index>;
    let count = || prop_oneof![3 => 1..9_usize, 2 => 1..65_usize, 1 => 1..2000_usize];
    let times = || prop_oneof![8 => 1..4_usize, 2 => 4..200_usize, 1 => Just(20_000)];
    let more = prop_oneof![
        3 => prop::collection::vec(byte(), 1..9),
        1 => prop::collection::vec(byte(), 1..300),
    ];
    let number = prop_oneof![
        2 => select(&NUMBERS[..]).prop_map(String::from),
        1 => (0..300_u16).prop_map(|n| n.to_string()),
    ];
    prop_oneof![
        2 => (place(), byte()).prop_map(|(at, v)| Change::Set(at, v)),
        2 => (place(), byte()).prop_map(|(at, v)| Change::Flip(at, v)),
        1 => place().prop_map(Change::Truncate),
        2 => (place(), more).prop_map(|(at, v)| Change::Insert(at, v)),
        2 => (place(), count()).prop_map(|(at, n)| Change::Remove(at, n)),
        2 => (place(), count(), times()).prop_map(|(at, n, t)| Change::Repeat(at, n, t)),
        1 => (place(), place()).prop_map(|(a, b)| Change::Swap(a, b)),
        1 => (place(), which(), place()).prop_map(|(a, f, b)| Change::Splice(a, f, b)),
        4 => (which(), number).prop_map(|(n, text)| Change::Number(n, text)),
        3 => (place(), 0..4_u32, select(&BITS[..]), any::<bool>())
            .prop_map(|(at, p, n, big)| Change::Bits(at, p, n, big)),
        3 => (place(), which(), times()).prop_map(|(at, w, t)| Change::Word(at, w, t)),
        1 => (place(), count(), which(), times()).prop_map(|(at, n, w, t)| Change::Nest(at, n, w, t)),
    ]
}

pub(crate) fn changes() -> impl Strategy<Value = Vec<Change>> {
    prop_oneof![
        3 => prop::collection::vec(change(), 1..3),
        1 => prop::collection::vec(change(), 3..8),
    ]
}

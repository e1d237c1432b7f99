//! Changes of files, from flipped bits to numbers that no file should have.

use proptest::prelude::*;
use proptest::sample::{Index, select};

/// Longest file, in bytes. Larger ones take longer, and show nothing else.
const LONGEST: usize = 1 << 16;
/// Bytes that stand at the beginning of most headers.
const EARLY: usize = 256;

/// Numbers as text that are hard to bear, apart from powers of two.
const NUMBERS: &str = "-0 -1 -2147483649 -9223372036854775808 1e12 1e308 -1e308 1e309 1e-320 1e999999999999 \
     0.1 nan inf -inf 0x10 99999999999999999999999999999999999999999999999999999999999999999999999999999999";

/// Powers of two, and one less.
fn powers() -> impl Iterator<Item = u128> {
    let powers = [0, 1, 7, 8, 16, 31, 32, 61, 63, 64];
    powers.into_iter().flat_map(|k| [(1 << k) - 1, 1 << k])
}

/// The same as bits of whole and floating-point numbers, of which the low bytes are taken.
fn bits() -> Vec<u64> {
    let single = [f32::INFINITY, f32::NAN, f32::MAX].map(|v| u64::from(v.to_bits()));
    let double = [f64::INFINITY, f64::NAN, f64::MAX].map(f64::to_bits);
    powers()
        .map(|v| v as u64)
        .chain(single)
        .chain(double)
        .collect()
}

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

/// What comes in place of bytes.
#[derive(Clone, Debug)]
pub(crate) enum Block {
    Bytes(Vec<u8>),
    /// The same, but for these bits of the first.
    Same(u8),
    /// A word of the format.
    Word(Index),
    /// Another file, from there on.
    File(Index, Place),
}

/// One change to a file.
#[derive(Clone, Debug)]
pub(crate) enum Change {
    /// From a place on, so many bytes become a block, so often.
    Replace(Place, usize, Block, usize),
    /// Lines, or what there is between line breaks, change places.
    Swap(Place, Place),
    /// A number in the text becomes another.
    Number(Index, String),
}

/// What a change can take from.
#[derive(Default)]
pub(crate) struct Material {
    /// Whole files and beginnings of files.
    pub files: Vec<Vec<u8>>,
    /// Words of the format.
    pub words: Vec<Vec<u8>>,
}

impl Change {
    /// Changes the bytes, of which [`LONGEST`] remain.
    pub fn apply(&self, bytes: &mut Vec<u8>, material: &Material) {
        match self {
            Self::Replace(at, count, block, times) => {
                let at = at.of(bytes);
                let end = bytes.len().min(at.saturating_add(*count));
                let block = match block {
                    Block::Bytes(block) => block.clone(),
                    Block::Same(bits) => {
                        let mut same = bytes[at..end].to_vec();
                        same.iter_mut().take(1).for_each(|byte| *byte ^= bits);
                        same
                    }
                    Block::Word(_) if material.words.is_empty() => Vec::new(),
                    Block::Word(which) => which.get(&material.words).clone(),
                    Block::File(which, from) => {
                        let file: &Vec<u8> = which.get(&material.files);
                        file[from.of(file)..].to_vec()
                    }
                };
                replace(bytes, at..end, &block, *times);
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
            Self::Number(which, text) => {
                let numbers = numbers(bytes);
                if !numbers.is_empty() {
                    replace(bytes, which.get(&numbers).clone(), text.as_bytes(), 1);
                }
            }
        }
        bytes.truncate(LONGEST);
    }
}

fn replace(bytes: &mut Vec<u8>, range: std::ops::Range<usize>, block: &[u8], times: usize) {
    let times = times.min(LONGEST / block.len().max(1));
    bytes.splice(range, block.repeat(times));
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

/// Bytes that become as many others.
fn overwritten() -> impl Strategy<Value = Vec<u8>> {
    let number = (0..4_u32, select(bits()), any::<bool>()).prop_map(|(power, number, big)| {
        let mut number = number.to_le_bytes()[..1 << power].to_vec();
        if big {
            number.reverse();
        }
        number
    });
    prop_oneof![2 => any::<u8>().prop_map(|byte| vec![byte]), 3 => number]
}

fn change() -> impl Strategy<Value = Change> {
    let which = any::<Index>;
    let count = || prop_oneof![3 => 1..9_usize, 2 => 1..65_usize, 1 => 1..2000_usize];
    let times = || prop_oneof![8 => 1..4_usize, 2 => 4..200_usize, 1 => Just(20_000)];
    let more = prop_oneof![
        3 => prop::collection::vec(any::<u8>(), 1..9),
        1 => prop::collection::vec(any::<u8>(), 1..300),
    ];
    let texts = NUMBERS.split_whitespace().map(str::to_owned);
    let texts = texts.chain(powers().map(|v| v.to_string()));
    let texts: Vec<String> = texts.chain([String::new()]).collect();
    let number = prop_oneof![
        3 => select(texts),
        1 => (0..300_u16).prop_map(|n| n.to_string()),
    ];
    let rest = usize::MAX;
    prop_oneof![
        5 => (place(), overwritten()).prop_map(|(at, v)| Change::Replace(at, v.len(), Block::Bytes(v), 1)),
        2 => (place(), 0..8_u8).prop_map(|(at, bit)| Change::Replace(at, 1, Block::Same(1 << bit), 1)),
        1 => place().prop_map(move |at| Change::Replace(at, rest, Block::Bytes(Vec::new()), 1)),
        2 => (place(), more).prop_map(|(at, v)| Change::Replace(at, 0, Block::Bytes(v), 1)),
        2 => (place(), count()).prop_map(|(at, n)| Change::Replace(at, n, Block::Bytes(Vec::new()), 1)),
        2 => (place(), count(), times()).prop_map(|(at, n, t)| Change::Replace(at, n, Block::Same(0), t + 1)),
        3 => (place(), which(), times()).prop_map(|(at, w, t)| Change::Replace(at, 0, Block::Word(w), t)),
        1 => (place(), which(), place())
            .prop_map(move |(at, f, from)| Change::Replace(at, rest, Block::File(f, from), 1)),
        1 => (place(), place()).prop_map(|(a, b)| Change::Swap(a, b)),
        4 => (which(), number).prop_map(|(n, text)| Change::Number(n, text)),
    ]
}

pub(crate) fn changes() -> impl Strategy<Value = Vec<Change>> {
    prop_oneof![
        3 => prop::collection::vec(change(), 1..3),
        1 => prop::collection::vec(change(), 3..8),
    ]
}

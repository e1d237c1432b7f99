//! Damaged and malicious NPY files.

use crate::common::{self, doubles, foreign};
use fuzzing::{Fuzz, Limit, assert_short_line, peak_of};
use geometry::npy::{self, NpyError};

/// As documented at [`npy::read`].
const NPY: Limit = Limit {
    times: 4,
    plus: 1 << 20,
};

#[test]
fn fuzzing_npy_files() {
    let numbers: Vec<f64> = (0..64_u8).map(f64::from).collect();
    let singles: Vec<u8> = numbers
        .iter()
        .flat_map(|v| (*v as f32).to_be_bytes())
        .collect();
    let text = "{\"shape\":(2,2,2),\"descr\":\">f8\",\"fortran_order\":True}";
    let second = common::npy(2, text, &[0; 64]);
    Fuzz::new("npy", NPY)
        .valid([
            doubles("(4, 4, 4)", &numbers),
            foreign(">f4", true, "(4, 4, 4)", &singles),
            second,
        ])
        .starts([&b"\x93NUMPY"[..], b"\x93NUMPY\x01\x00\x76\x00{'"])
        .words([
            "'descr': ",
            "'shape': ",
            "'fortran_order': ",
            "True",
            "False",
            "<f8",
            "=f4",
            "(2, 2, 2)",
            "0, ",
            "1,",
            "'",
            "\"",
            "{",
            "}",
            ",",
            " ",
            "(",
            ")",
            "[",
            "]",
        ])
        // The header has the length that it says.
        .repair(|mut bytes| {
            let end = bytes.iter().position(|&b| b == b'}' || b == b'\n');
            if let Some(end) = end.filter(|&end| end > 12) {
                let (at, size) = if bytes[6] == 1 { (8, 2) } else { (8, 4) };
                let length = (end + 1 - at - size) as u32;
                bytes[at..at + size].copy_from_slice(&length.to_le_bytes()[..size]);
            }
            bytes
        })
        .run(npy::decode::<3>, |bytes, (cells, values)| {
            assert_eq!(values.len(), cells.pow(3));
            assert!(4 * values.len() <= bytes.len());
            assert!(values.iter().all(|v| v.is_finite()));
        });
}

/// Files that make the most of every byte, or announce more than they have.
#[test]
fn the_worst_files_stay_within_the_limit() {
    let npy = |header: &str, data: usize| common::npy(3, header, &vec![0; data]);
    let array =
        |shape: &str| format!("{{'descr': '<f4', 'fortran_order': True, 'shape': {shape}}}");
    for bytes in [
        npy(&array("(64, 64, 64)"), 4 << 18),
        npy(&array("(1048576, 1048576, 1048576)"), 1 << 20),
        npy(&array("(0, 0, 0)"), 0),
        npy(&array(&format!("({})", "1,".repeat(1 << 19))), 0),
        npy(&array(&format!("({})", "1,".repeat(1 << 14))), 0),
        npy(&array(&format!("({})", "1".repeat(1 << 15))), 0),
        npy(&format!("{{'descr': '{}'}}", "\u{0}".repeat(1 << 16)), 0),
        npy(&format!("{{'{}': 1}}", "x".repeat(60_000)), 0),
    ] {
        let (result, peak) = peak_of(|| npy::decode::<3>(&bytes));
        println!("{} bytes: {peak}", bytes.len());
        if let Err(error) = &result {
            assert_short_line(error);
        }
        assert!(
            peak <= NPY.times * bytes.len() + NPY.plus,
            "{peak}, {result:?}"
        );
    }
}

#[test]
fn npy_headers_have_limits() {
    let error = |header: &str| npy::decode::<2>(&common::npy(2, header, &[])).unwrap_err();
    assert_eq!(
        error(&" ".repeat(10_001)),
        NpyError::HeaderLength {
            length: 10_001,
            limit: 10_000
        }
    );
    let axes = |n: usize| {
        let shape = "1,".repeat(n);
        error(&format!(
            "{{'descr': '<f8', 'fortran_order': False, 'shape': ({shape})}}"
        ))
    };
    assert!(matches!(axes(64), NpyError::Rank { shape, .. } if shape.len() == 64));
    assert!(matches!(axes(65), NpyError::Header { .. }));
}

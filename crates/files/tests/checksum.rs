//! Checksums against published ones.

use std::io::Write;

use files::{Sha256, hexadecimal};

/// The example of one block of FIPS 180-4.
const ABC: &str = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

#[test]
fn checksums_are_those_of_the_standard_in_one_piece_or_several() {
    assert_eq!(hexadecimal(Sha256::of("abc")), ABC);
    let mut pieces = Sha256::default();
    pieces.update("a");
    pieces.write_all(b"bc").unwrap();
    assert_eq!(hexadecimal(pieces.finish()), ABC);
}

//! Damaged and malicious NPY and VTI files.

use std::io::Write;

use crate::common::{BY_VTK, doubles, foreign};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use fuzzing::{Fuzz, Limit, assert_short_line, peak_of};
use geometry::npy::{self, NpyError};
use geometry::vti::{self, Image, VtiError};

/// As documented at [`npy::read`].
const NPY: Limit = Limit {
    times: 4,
    plus: 1 << 20,
};
/// As documented at [`vti::read`], for files with fewer values than bytes.
const VTI: Limit = Limit {
    times: 32 + 24,
    plus: 2 << 20,
};

#[test]
fn fuzzing_npy_files() {
    let numbers: Vec<f64> = (0..64_u8).map(f64::from).collect();
    let singles: Vec<u8> = numbers
        .iter()
        .flat_map(|v| (*v as f32).to_be_bytes())
        .collect();
    let mut second = b"\x93NUMPY\x02\x00".to_vec();
    let text = b"{\"shape\":(2,2,2),\"descr\":\">f8\",\"fortran_order\":True}";
    second.extend((text.len() as u32).to_le_bytes());
    second.extend(text);
    second.extend([0; 64]);
    Fuzz::new("npy", NPY)
        .valid([
            doubles("(4, 4, 4)", &numbers),
            foreign(">f4", true, "(4, 4, 4)", &[&singles]),
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
        ])
        .pairs([["(", ")"], ["[", "]"], ["{", "}"], ["1,", ""]])
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

fn check(_: &[u8], image: Image<3>) {
    assert!(image.spacing > 0.0);
    for (name, values) in image.arrays {
        assert!(!name.is_empty());
        assert_eq!(values.len(), image.cells.pow(3));
    }
}

#[test]
fn fuzzing_vti_files() {
    Fuzz::new("vti", VTI)
        .valid(BY_VTK.map(<[u8]>::to_vec))
        .starts(["<VTKFile ", "<?xml version=\"1.0\"?>"])
        .words([
            "<DataArray ",
            "/>",
            "</DataArray>",
            "<Piece>",
            "</Piece>",
            "<PointData>",
            "<CellData>",
            "<AppendedData encoding=\"raw\">_",
            " type=\"UInt8\"",
            " type=\"Float32\"",
            " Name=\"w\"",
            " format=\"ascii\"",
            " format=\"binary\"",
            " format=\"appended\"",
            " offset=\"0\"",
            " header_type=\"UInt64\"",
            " byte_order=\"BigEndian\"",
            " compressor=\"vtkZLibDataCompressor\"",
            " NumberOfComponents=\"3\"",
            " WholeExtent=\"0 3 0 3 0 3\"",
            "<!DOCTYPE a [<!ENTITY b \"c\">]>",
            "<!ENTITY b \"&b;\">",
            "&b;",
            "&#x110000;",
            "&amp;",
            "<![CDATA[",
            "]]>",
            "<!--",
            "-->",
            "<?a?>",
            " xmlns:a=\"b\"",
            "AAAA",
            "==",
            "=",
            "1 ",
            "\r\n",
        ])
        .pairs([
            ["<a>", "</a>"],
            ["<a xmlns:b=\"c\">", "</a>"],
            ["<Piece>", "</Piece>"],
            ["<![CDATA[", "]]>"],
            ["&lt;", "&gt;"],
        ])
        .run(vti::decode::<3>, check);
}

/// A file with these attributes and this content of its only array.
fn vti_file(attributes: &str, extent: u32, array: &str, arrays: usize, data: &[u8]) -> Vec<u8> {
    let arrays = (0..arrays)
        .map(|k| format!("<DataArray Name=\"a{k}\" {array}"))
        .collect::<Vec<_>>()
        .concat();
    let head = format!(
        "<VTKFile type=\"ImageData\" {attributes}><ImageData WholeExtent=\"0 {extent} 0 {extent} 0 \
         {extent}\"><Piece><PointData>{arrays}</PointData></Piece></ImageData><AppendedData \
         encoding=\"raw\">_"
    );
    [head.as_bytes(), data].concat()
}

/// Files that make the most of every byte, or announce more than they have.
#[test]
fn the_worst_files_stay_within_the_limit() {
    let npy = |header: &str, data: usize| {
        let mut bytes = b"\x93NUMPY\x03\x00".to_vec();
        bytes.extend((header.len() as u32).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.resize(bytes.len() + data, 0);
        bytes
    };
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

    let block = |size: u32, data: Vec<u8>| [&size.to_le_bytes()[..], &data].concat();
    let zeros = block(1 << 18, vec![0; 1 << 18]);
    let uint8 = "type=\"UInt8\" format=\"appended\" offset=\"0\"/>";
    let ascii = format!(
        "type=\"UInt8\" format=\"ascii\">{}</DataArray>",
        "1 ".repeat(1 << 18)
    );
    let base64 = format!(
        "type=\"UInt8\" format=\"binary\">AAAEAA=={}</DataArray>",
        "AAAA".repeat((1 << 18) / 3 + 1)
    );
    for bytes in [
        vti_file("", 63, uint8, 1, &zeros),
        vti_file("", 63, &ascii, 1, &[]),
        vti_file("", 63, &ascii.replace("1 ", "&#49;&#32;"), 1, &[]),
        vti_file("", 63, &base64, 1, &[]),
        vti_file("", 1 << 20, uint8, 1, &zeros),
        vti_file("", 63, "/>", 9000, &zeros),
        vti_file("", 63, "type=\"UInt8\"/>", 20_000, &zeros),
        vti_file(
            "",
            63,
            &format!(">{}</DataArray>", "=".repeat(1 << 20)),
            1,
            &zeros,
        ),
        vti_file("", 63, &"<a>".repeat(1 << 18), 1, &zeros),
        vti_file("", 63, &"<a>".repeat(9000), 1, &zeros),
    ] {
        let (result, peak) = peak_of(|| vti::decode::<3>(&bytes));
        println!("{} bytes: {peak}", bytes.len());
        if let Err(error) = &result {
            assert_short_line(error);
        }
        let result = result.map(drop);
        assert!(
            peak <= VTI.times * bytes.len() + VTI.plus,
            "{peak}, {result:?}"
        );
    }
}

/// Arrays whose data are in the file once, and data that are a thousand times as long unpacked.
#[test]
fn vti_files_cannot_multiply() {
    let mut zeros = vec![0; 4 + (1 << 18)];
    zeros[..4].copy_from_slice(&(1_u32 << 18).to_le_bytes());
    let shared = "type=\"UInt8\" format=\"appended\" offset=\"0\"/>";
    let image = vti::decode::<3>(&vti_file("", 63, shared, 3, &zeros)).unwrap();
    assert_eq!(image.arrays.len(), 3);
    let (result, peak) = peak_of(|| vti::decode::<3>(&vti_file("", 63, shared, 2000, &zeros)));
    assert_eq!(
        result,
        Err(VtiError::TooManyValues {
            arrays: 2000,
            nodes: 1 << 18,
            limit: 1 << 28,
        })
    );
    assert!(peak < 2 << 20, "{peak}");

    // A block of 2^18 bytes, and announcements of other lengths.
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(&vec![0; 1 << 18]).unwrap();
    let packed = encoder.finish().unwrap();
    let attributes = "compressor=\"vtkZLibDataCompressor\"";
    let data = |sizes: [u32; 4]| [&sizes.map(u32::to_le_bytes).concat()[..], &packed].concat();
    let length = packed.len() as u32;
    let good = vti_file(attributes, 63, shared, 1, &data([1, 1 << 18, 0, length]));
    let (result, peak) = peak_of(|| vti::decode::<3>(&good));
    assert_eq!(result.unwrap().arrays[0].1, vec![0.0; 1 << 18]);
    assert!(peak <= 24 << 18, "{peak}");
    // More in the block than announced, and than there are nodes.
    let bomb = vti_file(attributes, 1, shared, 1, &data([1, 8, 0, length]));
    let (result, peak) = peak_of(|| vti::decode::<3>(&bomb));
    assert!(matches!(result, Err(VtiError::Data { .. })), "{result:?}");
    assert!(peak < 2 << 20, "{peak}");
    let huge = vti_file(attributes, 1023, shared, 1, &data([1, 1 << 30, 0, length]));
    let (result, peak) = peak_of(|| vti::decode::<3>(&huge));
    assert!(
        matches!(result, Err(VtiError::TooManyValues { .. })),
        "{result:?}"
    );
    assert!(peak < 2 << 20, "{peak}");
}

#[test]
fn npy_headers_have_limits() {
    let error = |header: &str| {
        let mut bytes = b"\x93NUMPY\x02\x00".to_vec();
        bytes.extend((header.len() as u32).to_le_bytes());
        bytes.extend(header.as_bytes());
        npy::decode::<2>(&bytes).unwrap_err()
    };
    assert_eq!(
        error(&" ".repeat(65536)),
        NpyError::HeaderLength {
            length: 65536,
            limit: 65535
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

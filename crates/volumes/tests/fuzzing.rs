//! Damaged and malicious files of volumes.

use fuzzing::{Fuzz, Limit};
use volumes::{FormatError, Inside, Volume, decode, decode_frame};

use crate::common::{mgh, mrc, nifti, nifti_2, npy, nrrd, packed, stack, values, wide_stacks};
use crate::nrrd::PLACED;

/// As documented at [`volumes::read`].
const LIMIT: Limit = Limit {
    times: 4,
    plus: (4 << 31) + (1 << 30),
};

/// The first one of the volumes, of which there may be several.
fn decode_first(bytes: &[u8]) -> Result<Volume, FormatError> {
    decode_frame(bytes, Some(0))
}

/// Whatever was read has bodies, or a reason.
#[allow(clippy::needless_pass_by_value, reason = "as the harness calls it")]
fn check(_: &[u8], volume: Volume) {
    assert_eq!(volume.size().iter().product::<usize>(), volume.len());
    assert!(volume.len() >= 8 && volume.voxel_volume() > 0.0);
    if volume.len() > 1000 {
        return;
    }
    let [low, high] = volume.range();
    assert!(low.is_finite() && high.is_finite());
    let label = volume.labels().map(|labels| Inside::Label(labels[0].0));
    for inside in label.into_iter().chain([Inside::Above(0.5 * (low + high))]) {
        match volume.body(inside) {
            Ok(body) => assert!(body.surface.volume() > 0.0),
            Err(error) => fuzzing::assert_short_line(&error),
        }
    }
}

#[test]
fn fuzzing_nifti_files() {
    let shorts: Vec<u8> = values().iter().flat_map(|&v| [0, v]).collect();
    let plain = nifti(2, false, &values());
    Fuzz::new("nifti", LIMIT)
        .valid([
            plain.clone(),
            nifti(4, true, &shorts),
            nifti_2(false, &values()),
            packed(&plain),
        ])
        .starts([&plain[..48], &packed(&plain)[..12]])
        .words(["n+1\0", "n+2\0\r\n\x1a\n", "ni1\0"])
        .run(decode, check);
}

#[test]
fn fuzzing_mrc_files() {
    let floats: Vec<u8> = (values().iter())
        .flat_map(|&v| f32::from(v).to_le_bytes())
        .collect();
    let plain = mrc(2, false, &floats);
    Fuzz::new("mrc", LIMIT)
        .valid([plain.clone(), mrc(0, true, &values()), packed(&plain)])
        .starts([&plain[..212]])
        .words(["MAP "])
        .run(decode, check);
}

#[test]
fn fuzzing_stacks() {
    let [shorts, floats] = wide_stacks();
    Fuzz::new("stacks", LIMIT)
        .valid([
            stack("ImageJ=1.54f\nimages=3\nspacing=2.0\n"),
            shorts,
            floats,
        ])
        .starts(["II*\0", "MM\0*", "II+\0"])
        .words(["ImageJ=1\n", "images=", "channels=", "spacing="])
        .run(decode, check);
}

#[test]
fn fuzzing_nrrd_files() {
    let raw = |fields: &str| format!("type: uint8\nencoding: raw\nendian: little\n{fields}");
    let lists =
        "dimension: 4\nsizes: 2 5 4 3\nkinds: list domain domain domain\nspacings: nan 1 2 3";
    let as_text = format!("type: float\nencoding: ascii\n{PLACED}");
    let numbers: Vec<String> = values().iter().map(|v| format!("{v} ")).collect();
    let both = [values(), values()].concat();
    Fuzz::new("nrrd", LIMIT)
        .valid([
            nrrd(&raw(PLACED), &values()),
            nrrd(&raw(PLACED).replace("raw", "gzip"), &packed(&values())),
            nrrd(&as_text, numbers.concat().as_bytes()),
            nrrd(&raw(lists), &both),
            nrrd(&raw(&format!("byte skip: -1\n{PLACED}")), &both),
        ])
        .starts(["NRRD0001\n", "NRRD0005\ntype: short\n"])
        .words([
            "encoding: text\n",
            "endian: big\n",
            "line skip: 1\n",
            "byte skip: ",
            "type: double\n",
            "space: RAS\n",
            "none ",
            "(0,0,1) ",
            "99999999999 ",
            "nan ",
            "-1",
            "\n\n",
            ",",
        ])
        .run(decode_first, check);
}

#[test]
fn fuzzing_mgh_files() {
    let floats: Vec<u8> = (values().iter())
        .flat_map(|&v| f32::from(v).to_be_bytes())
        .collect();
    let plain = mgh(3, 1, &floats);
    Fuzz::new("mgh", LIMIT)
        .valid([
            plain.clone(),
            [&plain[..], &[0; 40]].concat(),
            mgh(0, 2, &[values(), values()].concat()),
            packed(&plain),
        ])
        .starts([&plain[..40], &packed(&plain)[..12]])
        .words([&[0, 0, 0, 1][..], &[0x7f, 0xc0, 0, 0]])
        .run(decode_first, check);
}

#[test]
fn fuzzing_arrays() {
    let shorts: Vec<u8> = values().iter().flat_map(|&v| [v, 0]).collect();
    Fuzz::new("arrays", LIMIT)
        .valid([
            npy("|b1", false, "(5, 4, 3)", &values()),
            npy("<i2", false, "(3, 4, 5)", &shorts),
            npy("<f4", true, "(5, 2, 3)", &shorts),
        ])
        .starts(["\u{93}NUMPY"])
        .words(["(2, 2, 2)", "|u1", ">f8", "True", "False", "'shape': "])
        .run(decode_first, check);
}

#[test]
fn fuzzing_descriptions() {
    let ome = |order: &str, sizes: [u32; 3], more: &str| {
        let [z, c, t] = sizes;
        let document = format!(
            "<?xml version=\"1.0\"?><!-- a --><OME><Image><Pixels DimensionOrder=\"{order}\" SizeZ=\"{z}\" SizeC=\"{c}\" \
             SizeT=\"{t}\" {more}><TiffData IFD=\"0\"/></Pixels></Image></OME>"
        );
        stack(&document)
    };
    let sides =
        "PhysicalSizeX=\"0.3\" PhysicalSizeY=\"30\" PhysicalSizeYUnit=\"nm\" PhysicalSizeZ=\"1\"";
    Fuzz::new("descriptions", LIMIT)
        .valid([
            ome("XYZCT", [3, 1, 1], sides),
            ome("XYTCZ", [3, 1, 1], ""),
            stack("ImageJ=1\nimages=3\nslices=3\nchannels=1\nframes=1\nspacing=2\n"),
        ])
        .words([
            "<Pixels ",
            "<!--",
            "-->",
            "<![CDATA[",
            "]]>",
            "<?",
            "?>",
            "\"",
            "'",
            "=",
            ">",
            "/>",
            "&#181;m",
            "IFD=\"1\" ",
            "FirstZ=\"1\" ",
            "99999999999999999999",
        ])
        .run(decode_first, check);
}

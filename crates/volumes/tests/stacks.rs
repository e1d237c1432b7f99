//! Descriptions of stacks of images: OME-TIFF and ImageJ, with several channels and times.

use volumes::{Inside, Volume, Warning, decode, decode_frame};

use crate::common::{assert_near, assert_values, pages, stack};

/// A description with these attributes of the pixels and elements in them.
fn ome(attributes: &str, elements: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?><!-- a comment: 1 > 0 <Pixels/> --><OME \
         xmlns=\"http://www.openmicroscopy.org/Schemas/OME/2016-06\"><Image ID=\"Image:0\" Name='a > b'><Pixels ID=\"Pixels:0\" \
         Type=\"uint8\" SizeX=\"5\" SizeY=\"4\" {attributes}>{elements}</Pixels></Image></OME>"
    )
}

/// Three sections.
const SECTIONS: &str = "DimensionOrder=\"XYZCT\" SizeZ=\"3\" SizeC=\"1\" SizeT=\"1\"";

fn sides(volume: &Volume) -> [f64; 3] {
    volume.position([1.0; 3])
}

#[test]
fn voxels_of_ome_tiff_have_their_physical_sizes() {
    for (attributes, expected) in [
        (
            "PhysicalSizeX=\"0.3\" PhysicalSizeY=\"0.25\" PhysicalSizeZ=\"1.2\"",
            [0.3, 0.25, 1.2],
        ),
        (
            "PhysicalSizeX=\"0.3\" PhysicalSizeXUnit=\"µm\" PhysicalSizeY=\"0.25\" PhysicalSizeZ=\"1200\" PhysicalSizeZUnit=\"nm\"",
            [0.3, 0.25, 1.2],
        ),
        (
            "PhysicalSizeX=\"300\" PhysicalSizeXUnit=\"nm\" PhysicalSizeY=\"2.5e-4\" PhysicalSizeYUnit=\"mm\" PhysicalSizeZ=\"1.2\" \
             PhysicalSizeZUnit=\"&#181;m\"",
            [300.0, 250.0, 1200.0],
        ),
        (
            "PhysicalSizeX=\"1\" PhysicalSizeXUnit=\"parsec\" PhysicalSizeY=\"2\" PhysicalSizeYUnit=\"parsec\" PhysicalSizeZ=\"3\" \
             PhysicalSizeZUnit=\"parsec\"",
            [1.0, 2.0, 3.0],
        ),
        // Those of the resolution.
        ("", [0.5, 0.25, 0.25]),
    ] {
        let description = ome(
            &format!("{SECTIONS} {attributes}"),
            "<TiffData IFD=\"0\" PlaneCount=\"3\"/>",
        );
        let volume = decode(&stack(&description)).unwrap();
        assert_values(&volume, attributes);
        assert_near(sides(&volume), expected);
        assert!(volume.warnings().is_empty(), "{:?}", volume.warnings());
    }
    let flat = ome(&format!("{SECTIONS} PhysicalSizeX=\"0.3\""), "");
    let volume = decode(&stack(&flat)).unwrap();
    assert_near(sides(&volume), [0.3; 3]);
    assert_eq!(volume.warnings(), [Warning::NoDistance]);
}

/// A ball of radius 6 in voxels of 0.3 x 0.3 x 1.2, of which 8407 are inside: 908 in all.
#[test]
fn a_ball_of_ome_tiff_has_its_volume() {
    let section = |z: usize| -> Vec<u8> {
        let inside = |pixel: usize| {
            let [x, y] = [pixel % 60, pixel / 60].map(|i| i as f64 * 0.3 - 9.0);
            x * x + y * y + (z as f64 * 1.2 - 9.0).powi(2) < 36.0
        };
        (0..3600)
            .map(|pixel| 255 * u8::from(inside(pixel)))
            .collect()
    };
    let sections: Vec<Vec<u8>> = (0..16).map(section).collect();
    let description = ome(
        "DimensionOrder=\"XYCZT\" SizeZ=\"16\" SizeC=\"1\" SizeT=\"1\" PhysicalSizeX=\"0.3\" PhysicalSizeY=\"0.3\" PhysicalSizeZ=\"1.2\"",
        "",
    );
    let volume = decode(&pages([60, 60], &description, &sections)).unwrap();
    let labels = volume.labels().unwrap();
    let voxels = labels[1].1 as f64 * volume.voxel_volume();
    let body = volume.body(Inside::Label(255.0)).unwrap();
    assert!(
        (body.surface.volume() - 908.0).abs() < 0.5,
        "{voxels} {}",
        body.surface.volume()
    );
    assert!((body.surface.volume() / voxels - 1.0).abs() < 1e-6);
}

/// Two channels at three times, in all orders.
#[test]
fn one_of_several_volumes_is_chosen() {
    let page = |z: u64, c: u64, t: u64| vec![(100 * z + 10 * c + t) as u8; 20];
    for (order, strides) in [
        ("ZCT", [1, 2, 4]),
        ("ZTC", [1, 6, 2]),
        ("CZT", [2, 1, 4]),
        ("CTZ", [6, 1, 2]),
        ("TZC", [3, 6, 1]),
        ("TCZ", [6, 3, 1]),
    ] {
        let [sz, sc, st] = strides;
        let all = (0..12).map(|n| page(n / sz % 2, n / sc % 2, n / st % 3));
        let all: Vec<Vec<u8>> = all.collect();
        let attributes =
            format!("DimensionOrder=\"XY{order}\" SizeZ=\"2\" SizeC=\"2\" SizeT=\"3\"");
        let first = |z: u64, c: u64, t: u64| {
            let page = z * sz + c * sc + t * st;
            format!("<TiffData IFD=\"{page}\" FirstZ=\"{z}\" FirstC=\"{c}\" FirstT=\"{t}\"/>")
        };
        let elements = first(1, 0, 2) + &first(0, 1, 1);
        let bytes = pages([5, 4], &ome(&attributes, &elements), &all);
        // Channels before times, or times before channels.
        let times_first = order.find('T') < order.find('C');
        for frame in 0..6 {
            let (c, t) = if times_first {
                (frame / 3, frame % 3)
            } else {
                (frame % 2, frame / 2)
            };
            let volume = decode_frame(&bytes, Some(frame)).unwrap();
            assert_eq!(volume.size(), [5, 4, 2]);
            let found = [0, 1].map(|z| volume.value([1, 2, z]) as u64);
            assert_eq!(found, [10 * c + t, 100 + 10 * c + t], "{order} {frame}");
        }
        let error = decode(&bytes).unwrap_err().to_string();
        assert!(error.contains("holds 6 volumes"), "{error}");
        assert!(decode_frame(&bytes, Some(6)).is_err());
        if order == "CZT" {
            // The order of ImageJ.
            let note = "ImageJ=1\nimages=12\nchannels=2\nslices=2\nframes=3\nspacing=3\n";
            let volume = decode_frame(&pages([5, 4], note, &all), Some(5)).unwrap();
            assert_eq!([0, 1].map(|z| volume.value([0, 0, z]) as u64), [12, 112]);
            assert!((sides(&volume)[2] - 3.0).abs() < 1e-12);
        }
    }
}

#[test]
fn damaged_descriptions_are_told_or_refused() {
    let good = ome(
        &format!("{SECTIONS} PhysicalSizeX=\"0.3\" PhysicalSizeY=\"0.25\" PhysicalSizeZ=\"1.2\""),
        "<TiffData IFD=\"1\" FirstZ=\"1\"/>",
    );
    for (old, new, part) in [
        ("<Pixels ID", "<Pix ID", "it has no element Pixels"),
        ("\"XYZCT\"", "\"XYZC\"", "DimensionOrder is not one"),
        ("\"XYZCT\"", "\"ZXYCT\"", "DimensionOrder is ZXYCT"),
        ("SizeZ=\"3\"", "SizeZ=\"0\"", "SizeZ is no positive number"),
        ("SizeZ=\"3\"", "SizeZ=\"three\"", "SizeZ is no whole number"),
        ("SizeT=\"1\"", "", "SizeT is no positive number"),
        ("\"0.3\"", "\"nan\"", "PhysicalSizeX is nan"),
        ("\"1.2\"", "\"-1.2\"", "PhysicalSizeZ is -1.2"),
        ("PhysicalSizeX=\"0.3\"", "", "there is no PhysicalSizeX"),
        (
            "\"1.2\"",
            "\"1.2\" PhysicalSizeZUnit=\"ell\"",
            "the unit ell is unknown",
        ),
        ("IFD=\"1\"", "IFD=\"-1\"", "IFD is no whole number"),
        ("<Pixels ID=\"", "<Pixels ID=", "it has no element Pixels"),
    ] {
        assert!(good.contains(old), "{old}");
        let volume = decode(&stack(&good.replace(old, new))).unwrap();
        assert_values(&volume, new);
        assert_near(sides(&volume), [0.5, 0.25, 0.25]);
        let [warning] = volume.warnings() else {
            panic!("{new}: {:?}", volume.warnings());
        };
        assert!(warning.to_string().contains(part), "{part}: {warning}");
        fuzzing::assert_short_line(warning);
    }
    // What is cut off.
    for length in 60..good.len() {
        let volume = decode(&stack(&good[..length]));
        assert!(volume.is_ok_and(|volume| volume.len() == 60), "{length}");
    }
    let plain = good.replace("<TiffData IFD=\"1\" FirstZ=\"1\"/>", "");
    for (old, new, part) in [
        ("SizeZ=\"3\"", "SizeZ=\"4\"", "what the description notes"),
        (
            "SizeZ=\"3\"",
            "SizeZ=\"18446744073709551615\"",
            "what the description notes",
        ),
        (
            "SizeT=\"1\"",
            "SizeT=\"18446744073709551615\"",
            "holds 18446744073709551615 volumes",
        ),
        (
            "SizeZ=\"3\" SizeC=\"1\"",
            "SizeZ=\"1\" SizeC=\"3\"",
            "save the pages as sections along z",
        ),
    ] {
        let description = plain.replace(old, new);
        let error = decode(&stack(&description)).unwrap_err().to_string();
        assert!(error.contains(part), "{part}: {error}");
    }
    let other_order = good.replace("IFD=\"1\"", "IFD=\"2\"");
    let error = decode(&stack(&other_order)).unwrap_err().to_string();
    assert!(
        error.contains("order of the pages of the TIFF header"),
        "{error}"
    );
}

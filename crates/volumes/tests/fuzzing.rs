//! Damaged and malicious files of volumes.

use fuzzing::{Fuzz, Limit};
use volumes::{Inside, Volume, decode};

use crate::common::{mrc, nifti, nifti_2, packed, stack, values, wide_stacks};

/// As documented at [`volumes::read`].
const LIMIT: Limit = Limit {
    times: 4,
    plus: (4 << 31) + (1 << 30),
};

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

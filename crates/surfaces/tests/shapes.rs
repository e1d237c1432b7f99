//! Shapes that can be named.

use geometry::SignedDistance;
use surfaces::shapes::{BuiltIn, Region, built_in};

#[test]
fn regions_are_read_back_and_measure_distances() {
    let text = "box:-0.5,-1,0.5,1";
    let region: Region = text.parse().unwrap();
    assert_eq!(region.to_string(), text);
    let shape = region.shape::<2>().unwrap();
    assert!((shape.signed_distance([0.0, 0.0]) + 0.5).abs() < 1e-15);
    assert!(region.shape::<3>().is_err());
    let ball: Region = "ball:0,0,0.5,0.25".parse().unwrap();
    assert!((ball.shape::<3>().unwrap().signed_distance([0.0; 3]) - 0.25).abs() < 1e-15);
    for text in [
        "box",
        "box:",
        "ball:1,2,x",
        "cube:1",
        "ball:1,nan,1",
        "box:0,0,inf,1",
    ] {
        assert!(text.parse::<Region>().is_err(), "{text:?}");
    }
    assert!(
        "box:1,0,0,1"
            .parse::<Region>()
            .unwrap()
            .shape::<2>()
            .is_err()
    );
    assert!(
        "ball:0,0,-1"
            .parse::<Region>()
            .unwrap()
            .shape::<2>()
            .is_err()
    );
}

#[test]
fn built_in_shapes_have_the_side_that_is_asked_for() {
    let in_the_plane = ["disc", "ring", "cross", "rectangle"];
    let in_space = ["sphere", "cube", "torus", "coin"];
    for name in in_the_plane.into_iter().chain(in_space) {
        let outside = match built_in(name, 0.8).unwrap() {
            BuiltIn::Plane(shape) => shape.signed_distance([0.4 + 0.1, 0.0]),
            BuiltIn::Space(shape) => shape.signed_distance([0.4 + 0.1, 0.0, 0.0]),
            BuiltIn::Mesh(..) => panic!("{name} is a mesh"),
        };
        assert!((outside - 0.1).abs() < 1e-12, "{name}: {outside}");
    }
    // Meshes are placed later.
    for name in ["figure", "lever"] {
        assert!(matches!(built_in(name, 0.8).unwrap(), BuiltIn::Mesh(..)));
    }
    assert!(built_in("teapot", 0.8).is_err());
}

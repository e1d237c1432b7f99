//! The cross and the rectangle of the experiments under Willmore flow, at times that are multiples of 2^-14.

use reference::{Error, Flow, Shape, planar};

fn main() -> Result<(), Error> {
    let shapes = [
        ("cross", Shape::cross(0.8, 0.27)?),
        ("rectangle", Shape::rectangle(0.2, 0.1)?),
    ];
    let steps = [8.0, 32.0, 64.0, 128.0];
    for (name, shape) in shapes {
        let curves = planar::evolve(
            &shape,
            Flow::Willmore,
            &steps.map(|k| k / 16384.0),
            &planar::ACCURACY,
        )?;
        println!("{name}\nstep         tip    diagonal        area   perimeter      energy");
        for (step, curve) in steps.iter().zip(&curves) {
            let along = |direction| curve.distance_along(direction).unwrap_or(f64::NAN);
            let values = [
                along([1.0, 0.0]),
                along([1.0, 1.0]),
                curve.area(),
                curve.length(),
                curve.energy(),
            ];
            println!("{step:4} {}", values.map(|v| format!("{v:11.8}")).join(" "));
        }
    }
    Ok(())
}

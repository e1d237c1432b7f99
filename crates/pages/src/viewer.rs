//! Surfaces to turn.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

use geometry::measure::BoundingBox;
use maud::{Markup, PreEscaped, html};
use render::View;
use surfaces::TriangleMesh;

use crate::error::Result;
use crate::image::ImageElement;
use crate::page::labelled;
use crate::surface::Surface;

/// Directions in which the outermost points are looked for.
const DIRECTIONS: usize = 200;
/// Cubes along the radius in which they are looked for.
const CUBES: f64 = 8.0;

/// Surfaces, such as the steps of a flow, of which one is shown and can be turned: one or more with a label each, all seen in one scale
/// and from one direction, in which together they fill the view. Pictures with labels, side by side, stand in for them until they are started,
/// and wherever they cannot be: without JavaScript or WebGL, and on paper. Each surface must have a face, and [`View::check`] must accept the view.
///
/// Positions are rounded to 1/65535 of the bounding box. Where a mesh has no normals, they are
/// those of the triangles around a vertex, weighted by area.
pub fn viewer<'a>(
    caption: &str,
    pictures: &[(String, ImageElement)],
    view: View,
    surfaces: impl IntoIterator<Item = (&'a str, &'a TriangleMesh)>,
) -> Result<Markup> {
    view.check()?;
    let (mut encoded, mut points) = (Vec::new(), Vec::new());
    for (label, mesh) in surfaces {
        encoded.push(Surface::new(label, mesh)?);
        points.extend(mesh.corner_places());
    }
    let (centre, radius) = ball(&points);
    Ok(html! {
        figure.viewer data-caption=(caption) data-up=(view.up.index())
            data-azimuth=(view.azimuth) data-elevation=(view.elevation)
            data-centre=(listed(centre)) data-radius=(format!("{radius:e}"))
            data-outline=(outline(&points, centre, radius)) {
            div.stage {
                div.pictures {
                    @for picture in pictures { div { (labelled(caption, picture)) } }
                }
            }
            // No script: a block of data, which browsers neither run nor show.
            @for surface in &encoded {
                script type="text/plain" data-label=(surface.label) data-vertices=(surface.vertices)
                    data-faces=(surface.faces) data-normals[surface.has_normals]
                    data-low=(listed(surface.bounds.lower)) data-step=(listed(surface.step())) {
                    (PreEscaped(&surface.data))
                }
            }
            figcaption { (caption) }
        }
    })
}

fn listed(values: [f64; 3]) -> String {
    values.map(|v| format!("{v:e}")).join(" ")
}

/// The ball around points with the centre of their bounding box.
fn ball(points: &[[f64; 3]]) -> ([f64; 3], f64) {
    let centre = BoundingBox::around(points.iter().copied()).map_or([0.0; 3], |b| b.centre());
    let radius = points.iter().map(|x| {
        let squares = (0..3).map(|i| (x[i] - centre[i]).powi(2));
        squares.sum::<f64>().sqrt()
    });
    let radius = radius.fold(0.0, f64::max);
    // A single point is seen from somewhere, too.
    (centre, if radius > 0.0 { radius } else { 1.0 })
}

/// The points that are outermost in some direction, seen from the centre in units of the radius: what fits into the view from all sides if these
/// do, up to a percent.
fn outline(points: &[[f64; 3]], centre: [f64; 3], radius: f64) -> String {
    let groups = groups(points, centre, radius);
    let outermost: BTreeSet<usize> = (0..DIRECTIONS)
        .filter_map(|k| outermost(points, &groups, direction(k)))
        .collect();
    let numbers = outermost
        .iter()
        .flat_map(|&k| (0..3).map(move |i| (points[k][i] - centre[i]) / radius));
    let numbers: Vec<String> = numbers.map(|number| format!("{number:.4}")).collect();
    numbers.join(" ")
}

/// Points that are near each other.
struct Group {
    bounds: BoundingBox<3>,
    /// Their numbers, in ascending order.
    points: Vec<usize>,
}

/// All points, in cubes into which that around the ball is divided.
fn groups(points: &[[f64; 3]], centre: [f64; 3], radius: f64) -> Vec<Group> {
    let mut cubes: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (number, x) in points.iter().enumerate() {
        let cube = [0, 1, 2].map(|i| (CUBES * (x[i] - centre[i]) / radius).floor() as i64);
        cubes.entry(cube).or_default().push(number);
    }
    let group = |points_in: Vec<usize>| {
        let places = points_in.iter().map(|&number| points[number]);
        Some(Group {
            bounds: BoundingBox::around(places)?,
            points: points_in,
        })
    };
    cubes.into_values().filter_map(group).collect()
}

/// The point that is farthest in a direction, of several the first one. Groups whose boxes end before another point are passed over.
fn outermost(points: &[[f64; 3]], groups: &[Group], direction: [f64; 3]) -> Option<usize> {
    let far = |x: [f64; 3]| (0..3).map(|i| direction[i] * x[i]).sum::<f64>();
    let mut best: Option<(f64, usize)> = None;
    for group in groups {
        let BoundingBox { lower, upper } = group.bounds;
        let end = [0, 1, 2].map(|i| {
            if direction[i] < 0.0 {
                lower[i]
            } else {
                upper[i]
            }
        });
        if best.is_some_and(|(most, _)| far(end) < most) {
            continue;
        }
        for &number in &group.points {
            let here = far(points[number]);
            let is_farther = |(most, first)| here > most || here >= most && number < first;
            if best.is_none_or(is_farther) {
                best = Some((here, number));
            }
        }
    }
    best.map(|(_, number)| number)
}

/// Directions that are spread evenly, along a spiral from pole to pole.
fn direction(k: usize) -> [f64; 3] {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let z = 1.0 - (2.0 * k as f64 + 1.0) / DIRECTIONS as f64;
    let (sin, cos) = (golden * k as f64).sin_cos();
    let across = (1.0 - z * z).sqrt();
    [across * cos, across * sin, z]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_outermost_points_are_those_of_all() {
        let points: Vec<[f64; 3]> = (0..4000)
            .map(|k| [0.371, 0.519, 0.783].map(|step: f64| (step * f64::from(k) * 1.7).fract()))
            .collect();
        let (centre, radius) = ball(&points);
        let groups = groups(&points, centre, radius);
        assert!(groups.len() > 100);
        for k in 0..DIRECTIONS {
            let direction = direction(k);
            let far = |x: &[f64; 3]| (0..3).map(|i| direction[i] * x[i]).sum::<f64>();
            let places = points.iter().map(far).enumerate();
            let first = places.reduce(|a, b| if b.1 > a.1 { b } else { a });
            assert_eq!(
                outermost(&points, &groups, direction),
                first.map(|(n, _)| n)
            );
        }
    }

    #[test]
    fn the_ball_is_around_all_points() {
        // All coordinates are exact.
        let bits = |x: [f64; 3], radius: f64| (x.map(f64::to_bits), radius.to_bits());
        let points = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 3.0, 0.0]];
        let (centre, radius) = ball(&points);
        assert_eq!(bits(centre, radius), bits([2.0, 1.5, 0.0], 2.5));
        // Of many points those stay that are outermost somewhere.
        let inner = points.map(|x| [1.0 + 0.5 * x[0], 0.5 + 0.5 * x[1], 0.0]);
        let all = [points, inner].concat();
        assert_eq!(
            outline(&all, centre, radius),
            outline(&points, centre, radius)
        );
        assert_eq!(
            outline(&points, centre, radius),
            "-0.8000 -0.6000 0.0000 0.8000 -0.6000 0.0000 0.0000 0.6000 0.0000"
        );
        let (centre, radius) = ball(&[[3.0; 3]]);
        assert_eq!(bits(centre, radius), bits([3.0; 3], 1.0));
    }
}

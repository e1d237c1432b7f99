//! Polygons a short time after their start.

use std::f64::consts::{PI, TAU};

use realfft::num_complex::Complex;

use crate::corner::Corner;
use crate::curve::MOST_POINTS;
use crate::spectral::{Coefficients, Grid, Series, collect};
use crate::{Curve, Error, Flow};

/// The direction and the length of the edge that leaves a vertex, and the exterior angle there.
pub(crate) struct Edge {
    direction: f64,
    pub(crate) length: f64,
    pub(crate) angle: f64,
}

/// The edges of a polygon with the given vertices.
pub(crate) fn edges(vertices: &[[f64; 2]]) -> Vec<Edge> {
    let count = vertices.len();
    let edge = |i: usize| {
        let [a, b] = [i, i + 1].map(|i| vertices[i % count]);
        Complex::new(b[0] - a[0], b[1] - a[1])
    };
    let leaving = |i: usize| Edge {
        direction: edge(i).arg(),
        length: edge(i).norm(),
        angle: (edge(i) * edge(i + count - 1).conj()).arg(),
    };
    collect(count, leaving)
}

/// The largest number of turns that map the polygon to itself, and the mean of its vertices.
fn rotations(vertices: &[[f64; 2]], most: usize) -> (usize, Complex<f64>) {
    let count = vertices.len();
    let centre = vertices
        .iter()
        .map(|v| Complex::new(v[0], v[1]))
        .sum::<Complex<f64>>()
        / count as f64;
    let arms = collect(count, |i| {
        Complex::new(vertices[i][0], vertices[i][1]) - centre
    });
    let size = arms.iter().map(|arm| arm.norm()).fold(0.0, f64::max);
    let maps = |folds: usize| {
        let turn = Complex::cis(TAU / folds as f64);
        let off = |i: usize| (arms[i] * turn - arms[(i + count / folds) % count]).norm();
        (0..count).all(|i| off(i) < 1e-12 * size)
    };
    let mut divisors = (1..=most.min(count))
        .rev()
        .filter(|folds| count.is_multiple_of(*folds));
    (divisors.find(|&folds| maps(folds)).unwrap_or(1), centre)
}

/// The polygon after a short time, with the self-similar solution of the flow at each corner, over `rounding` of the shortest edge,
/// and edges that stay on their lines. In the plane this is exact to the tails of the corners.
pub(crate) fn rounded(
    vertices: &[[f64; 2]],
    flow: Flow,
    rounding: f64,
    most_folds: usize,
) -> Result<Curve, Error> {
    let edges = edges(vertices);
    let (folds, mut centre) = rotations(vertices, most_folds);
    let width = rounding
        * edges
            .iter()
            .map(|edge| edge.length)
            .fold(f64::INFINITY, f64::min);
    let mut corners: Vec<Corner> = Vec::new();
    let mut kinds = Vec::new(); // places in `corners` of the vertices
    for edge in &edges {
        let known = corners
            .iter()
            .position(|corner| (corner.angle - edge.angle).abs() < 1e-12);
        kinds.push(known.unwrap_or(corners.len()));
        if known.is_none() {
            corners.push(Corner::new(flow, edge.angle)?);
        }
    }
    let gains = collect(edges.len(), |i| width * corners[kinds[i]].gain());
    let (scale, alphas) = along(&edges, &gains);
    let time = width.powi(flow.order());
    let points = 2.0 * Corner::LARGEST_WAVE * scale / width;
    if points > MOST_POINTS as f64 {
        return Err(Error::Unresolved {
            points: MOST_POINTS,
            time,
        });
    }
    let grid = Grid::new(
        folds,
        ((points / folds as f64) as usize).next_power_of_two(),
    );
    let transforms: Vec<_> = corners.iter().map(Corner::transform).collect();
    let coefficient = |j: usize| {
        let wave = grid.wave(j);
        let weights = collect(corners.len(), |kind| transforms[kind](wave * width / scale));
        let jump = |i: usize| Complex::cis(-wave * alphas[i]) * weights[kinds[i]];
        (0..edges.len()).map(jump).sum::<Complex<f64>>() / Complex::new(0.0, TAU * wave)
    };
    let mut angle: Coefficients = collect(grid.points / 2 + 1, coefficient);
    let jump = |i: usize| edges[i].angle * (1.0 - alphas[i] / TAU);
    let mean = (0..edges.len()).map(jump).sum::<f64>();
    angle[0] = Complex::new(edges[0].direction + mean - PI, 0.0);
    angle[grid.points / 2] = Complex::ZERO;
    if folds == 1 {
        let [x, y] = [0, 1].map(|axis| f64::midpoint(vertices[0][axis], vertices[1][axis]));
        centre =
            Complex::new(x, y) - Series::positions(&grid, &grid.values(&angle)).at(0.0) * scale;
    }
    Ok(Curve {
        grid,
        angle,
        scale,
        centre: [centre.re, centre.im],
        time,
    })
}

/// The length over `2 pi` of the rounded polygon, and `alpha` of its vertices from the middle of the first edge. Rounded corners are
/// shorter by their gains on both sides, so the edges between them are too.
fn along(edges: &[Edge], gains: &[f64]) -> (f64, Vec<f64>) {
    let count = edges.len();
    let length = |i: usize| edges[i].length - gains[i] - gains[(i + 1) % count];
    let scale = (0..count).map(length).sum::<f64>() / TAU;
    let mut arc = edges[0].length / 2.0 - gains[1];
    let mut alphas = vec![0.0; count];
    for i in (1..count).chain([0]) {
        alphas[i] = arc / scale;
        arc += length(i);
    }
    (scale, alphas)
}

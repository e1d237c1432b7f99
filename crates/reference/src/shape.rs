//! Shapes to start from.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use realfft::num_complex::Complex;

use crate::corner::Corner;
use crate::error::positive;
use crate::spectral::{Coefficients, Grid, Series, power_sum};
use crate::{Curve, Error, Flow};

/// A closed curve to start from: a polygon, whose corners the flow smooths, or a smooth curve.
#[derive(Clone)]
pub struct Shape(Outline);

#[derive(Clone)]
enum Outline {
    Polygon(Vec<[f64; 2]>),
    Smooth(Curve),
}

impl Shape {
    /// The polygon with the given vertices, in either direction. Its arc length starts in the middle of the first edge, or of the
    /// last one where the direction is turned round.
    ///
    /// # Errors
    /// It must turn once, by less than half a turn at each vertex.
    pub fn polygon(mut vertices: Vec<[f64; 2]>) -> Result<Self, Error> {
        if vertices.iter().flatten().any(|x| !x.is_finite()) {
            return Err(Error::Turning { turning: f64::NAN });
        }
        let turning =
            |vertices: &[[f64; 2]]| edges(vertices).iter().map(|c| c.angle).sum::<f64>() / TAU;
        if turning(&vertices) < 0.0 {
            vertices.reverse();
        }
        once(turning(&vertices))?;
        Ok(Self(Outline::Polygon(vertices)))
    }

    /// The rectangle with the given half sides about the origin, from the middle of its lower side.
    ///
    /// # Errors
    /// The half sides must be positive and finite.
    pub fn rectangle(half_width: f64, half_height: f64) -> Result<Self, Error> {
        let (a, b) = (
            positive("half width", half_width)?,
            positive("half height", half_height)?,
        );
        Self::polygon(vec![[-a, -b], [a, -b], [a, b], [-a, b]])
    }

    /// The cross `[-a, a] x [-b, b]` with its transpose, `a` the half length and `b` the half width of the arms, from the middle
    /// of its lower end.
    ///
    /// # Errors
    /// `0 < b < a`, both finite.
    pub fn cross(half_length: f64, half_width: f64) -> Result<Self, Error> {
        let (a, b) = (
            positive("half length", half_length)?,
            positive("half width", half_width)?,
        );
        positive("half length minus half width", a - b)?;
        let arm = [[-b, -a], [b, -a], [b, -b]];
        let turned = |k: usize| arm.map(|[x, y]| [[x, y], [-y, x], [-x, -y], [y, -x]][k]);
        Self::polygon((0..4).flat_map(turned).collect())
    }

    /// The circle with the given centre and radius, from its lowest point.
    ///
    /// # Errors
    /// The radius must be positive, everything finite.
    pub fn circle(centre: [f64; 2], radius: f64) -> Result<Self, Error> {
        positive("radius", radius)?;
        Self::smooth(&sampled(32, |u| {
            [centre[0] + radius * u.cos(), centre[1] + radius * u.sin()]
        }))
    }

    /// The ellipse with the given half axes along x and y about the origin, from its lowest point.
    ///
    /// # Errors
    /// The half axes must be positive and finite, one at most a hundred times the other.
    pub fn ellipse(a: f64, b: f64) -> Result<Self, Error> {
        positive("first half axis", a)?;
        positive("second half axis", b)?;
        let aspect = (a / b).max(b / a);
        if aspect > 100.0 {
            return Err(Error::InvalidParameter {
                name: "ratio of the half axes",
                requirement: "at most 100",
                value: aspect,
            });
        }
        let count = 32 * aspect.ceil() as usize;
        Self::smooth(&sampled(count, |u| [a * u.cos(), b * u.sin()]))
    }

    /// The smooth curve through points at equal steps of a periodic parameter, of which it is the trigonometric interpolation; in
    /// either direction. Its arc length starts at the first point.
    ///
    /// # Errors
    /// There must be an even number of at least eight points, and the curve must turn once.
    pub fn smooth(points: &[[f64; 2]]) -> Result<Self, Error> {
        if points.len() < 8 || points.len() % 2 == 1 {
            return Err(Error::InvalidParameter {
                name: "number of points",
                requirement: "even and at least 8",
                value: points.len() as f64,
            });
        }
        if points.iter().flatten().any(|x| !x.is_finite()) {
            return Err(Error::Turning { turning: f64::NAN });
        }
        let mut points = points.to_vec();
        if shoelace(&points) < 0.0 {
            points[1..].reverse();
        }
        Ok(Self(Outline::Smooth(by_arc_length(&points)?)))
    }

    /// The curve to start from.
    pub(crate) fn curve(
        &self,
        flow: Flow,
        rounding: f64,
        most_folds: usize,
    ) -> Result<Curve, Error> {
        if !(rounding > 0.0 && rounding <= MOST_ROUNDING) {
            return Err(Error::InvalidParameter {
                name: "rounding",
                requirement: "positive and at most 1/80",
                value: rounding,
            });
        }
        match &self.0 {
            Outline::Smooth(curve) => Ok(curve.folded(most_folds)),
            Outline::Polygon(vertices) => rounded(vertices, flow, rounding, most_folds),
        }
    }
}

/// Above it the tails of neighbouring corners meet.
pub(crate) const MOST_ROUNDING: f64 = 1.0 / 80.0;

/// Points at equal steps of a parameter that starts at the bottom.
fn sampled(count: usize, point: impl Fn(f64) -> [f64; 2]) -> Vec<[f64; 2]> {
    (0..count)
        .map(|i| point(TAU * i as f64 / count as f64 - FRAC_PI_2))
        .collect()
}

fn once(turning: f64) -> Result<(), Error> {
    if (turning - 1.0).abs() < 1e-6 {
        Ok(())
    } else {
        Err(Error::Turning { turning })
    }
}

fn shoelace(points: &[[f64; 2]]) -> f64 {
    let next = points.iter().cycle().skip(1);
    points
        .iter()
        .zip(next)
        .map(|(p, q)| p[0] * q[1] - p[1] * q[0])
        .sum()
}

/// The direction and the length of the edge that leaves a vertex, and the exterior angle there.
struct Edge {
    direction: f64,
    length: f64,
    angle: f64,
}

fn edges(vertices: &[[f64; 2]]) -> Vec<Edge> {
    let edge = |i: usize| {
        let (a, b) = (
            vertices[i % vertices.len()],
            vertices[(i + 1) % vertices.len()],
        );
        Complex::new(b[0] - a[0], b[1] - a[1])
    };
    let leaving = |i: usize| Edge {
        direction: edge(i).arg(),
        length: edge(i).norm(),
        angle: (edge(i) * edge(i + vertices.len() - 1).conj()).arg(),
    };
    (0..vertices.len()).map(leaving).collect()
}

/// The largest number of turns that map the polygon to itself, and the mean of its vertices.
fn rotations(vertices: &[[f64; 2]], most: usize) -> (usize, Complex<f64>) {
    let points: Coefficients = vertices.iter().map(|v| Complex::new(v[0], v[1])).collect();
    let count = points.len();
    let centre = points.iter().sum::<Complex<f64>>() / count as f64;
    let size = points
        .iter()
        .map(|p| (p - centre).norm())
        .fold(0.0, f64::max);
    let maps = |folds: usize| {
        let turn = Complex::cis(TAU / folds as f64);
        let off = |i: usize| {
            ((points[i] - centre) * turn - (points[(i + count / folds) % count] - centre)).norm()
        };
        (0..count).all(|i| off(i) < 1e-12 * size)
    };
    let folds = (1..=most.min(count))
        .rev()
        .find(|&folds| count.is_multiple_of(folds) && maps(folds));
    (folds.unwrap_or(1), centre)
}

/// The polygon after a short time, with the self-similar solution of the flow at each corner, over `rounding` of the shortest edge,
/// and edges that stay on their lines: the rounded corners are shorter, so the edges between them are too. In the plane this is
/// exact to the tails of the corners.
fn rounded(
    vertices: &[[f64; 2]],
    flow: Flow,
    rounding: f64,
    most_folds: usize,
) -> Result<Curve, Error> {
    let edges = edges(vertices);
    let (folds, centre) = rotations(vertices, most_folds);
    let width = rounding * edges.iter().map(|c| c.length).fold(f64::INFINITY, f64::min);
    let mut corners: Vec<(f64, Corner)> = Vec::new();
    for edge in &edges {
        if !corners.iter().any(|(angle, _)| same(*angle, edge.angle)) {
            corners.push((edge.angle, Corner::new(flow, edge.angle)?));
        }
    }
    let corner = |i: usize| {
        corners
            .iter()
            .position(|(angle, _)| same(*angle, edges[i].angle))
            .expect("all angles are there")
    };
    let gains: Vec<f64> = (0..edges.len())
        .map(|i| width * corners[corner(i)].1.gain())
        .collect();
    let scale = edges
        .iter()
        .zip(&gains)
        .map(|(edge, gain)| edge.length - 2.0 * gain)
        .sum::<f64>()
        / TAU;
    // The arc length from the middle of the first edge to each corner, the first vertex coming last.
    let next = |i: usize| (i + 1) % edges.len();
    let mut arc = edges[0].length / 2.0 - gains[next(0)];
    let mut jumps = Vec::new();
    for i in 0..edges.len() {
        let (here, after) = (next(i), next(next(i)));
        jumps.push((arc / scale, here));
        arc += edges[here].length - gains[here] - gains[after];
    }
    let points = 2.0 * Corner::LARGEST_WAVE * scale / width / folds as f64;
    let grid = Grid::new(folds, (points as usize).next_power_of_two());
    let transforms: Vec<_> = corners
        .iter()
        .map(|(_, corner)| corner.transform())
        .collect();
    let coefficient = |j: usize| {
        let wave = grid.wave(j);
        let weights: Vec<f64> = transforms
            .iter()
            .map(|transform| transform(wave * width / scale))
            .collect();
        let sum: Complex<f64> = jumps
            .iter()
            .map(|&(alpha, i)| Complex::cis(-wave * alpha) * weights[corner(i)])
            .sum();
        sum / Complex::new(0.0, TAU * wave)
    };
    let mut angle: Coefficients = (0..=grid.points / 2).map(coefficient).collect();
    let mean = jumps
        .iter()
        .map(|&(alpha, i)| edges[i].angle * (1.0 - alpha / TAU))
        .sum::<f64>();
    angle[0] = Complex::new(edges[0].direction + mean - PI, 0.0);
    angle[grid.points / 2] = Complex::ZERO;
    let centre = if folds > 1 {
        centre
    } else {
        let middle = Complex::new(
            vertices[0][0] + vertices[1][0],
            vertices[0][1] + vertices[1][1],
        ) / 2.0;
        middle - Series::positions(&grid, &grid.values(&angle)).at(0.0) * scale
    };
    Ok(Curve {
        grid,
        angle,
        scale,
        centre: [centre.re, centre.im],
        time: width.powi(flow.order()),
    })
}

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-12
}

/// The trigonometric interpolation of counterclockwise points by its arc length.
fn by_arc_length(points: &[[f64; 2]]) -> Result<Curve, Error> {
    const RESOLVED: f64 = 1e-10;
    let fine = Grid::new(1, (4 * points.len()).next_power_of_two());
    let coarse = Grid::new(1, points.len());
    let padded = |axis: usize| {
        let mut coefficients = coarse.coefficients(points.iter().map(|p| p[axis]).collect());
        coefficients.resize(fine.points / 2 + 1, Complex::ZERO);
        coefficients
    };
    let [x, y] = [padded(0), padded(1)];
    let real = |coefficients: &[Complex<f64>], u: f64| {
        2.0 * power_sum(coefficients, Complex::cis(u)).re - coefficients[0].re
    };
    let [dx, dy] = [&x, &y].map(|c| fine.derivative(c));
    let velocities = fine.values(&dx).into_iter().zip(fine.values(&dy));
    let speed = fine.coefficients(velocities.map(|(x, y)| x.hypot(y)).collect());
    let scale = speed[0].re;
    let wobble = fine.antiderivative(&speed);
    let start = coarse.node(0);
    let at_start = real(&wobble, start);
    let mut u = start;
    let mut positions = Complex::ZERO;
    let mut angles: Vec<f64> = Vec::with_capacity(fine.points);
    for i in 0..fine.points {
        let alpha = fine.node(i);
        for _ in 0..20 {
            let arc = u - start + (real(&wobble, u) - at_start) / scale;
            let step = (alpha - arc) * scale / real(&speed, u);
            u += step;
            if step.abs() < 1e-14 {
                break;
            }
        }
        positions += Complex::new(real(&x, u), real(&y, u));
        let direction = real(&dy, u).atan2(real(&dx, u)) - alpha;
        let before = angles.last().copied().unwrap_or(direction);
        angles.push(direction - TAU * ((direction - before) / TAU).round());
    }
    once(1.0 + ((angles[fine.points - 1] - angles[0]) / TAU).round())?;
    let centre = positions / fine.points as f64;
    let curve = Curve {
        angle: fine.coefficients(angles),
        grid: fine,
        scale,
        centre: [centre.re, centre.im],
        time: 0.0,
    };
    let fitted = curve.fitted(RESOLVED)?;
    if fitted.grid.points > curve.grid.points {
        return Err(Error::Unresolved {
            points: points.len(),
            time: 0.0,
        });
    }
    Ok(fitted)
}

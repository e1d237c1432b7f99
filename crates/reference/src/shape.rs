//! Shapes to start from.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use realfft::num_complex::Complex;

use crate::error::{checked, finite, positive};
use crate::polygon::{edges, rounded};
use crate::spectral::{Grid, collect, power_sum};
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
    /// The polygon with the given vertices, in either direction. Its arc length starts in the middle of the first edge, or, of
    /// clockwise vertices, of the edge between the last two.
    ///
    /// # Errors
    /// Its edges must have lengths, and it must turn once, by less than 179 degrees at each vertex.
    pub fn polygon(mut vertices: Vec<[f64; 2]>) -> Result<Self, Error> {
        const SHARPEST: f64 = 179.0 / 180.0 * PI;
        finite(&vertices)?;
        let turning = |vertices: &[[f64; 2]]| {
            let angles = edges(vertices).into_iter().map(|edge| edge.angle);
            angles.sum::<f64>() / TAU
        };
        if turning(&vertices) < 0.0 {
            vertices.reverse();
        }
        once(turning(&vertices))?;
        for edge in edges(&vertices) {
            positive("length of an edge", edge.length)?;
            let turn = edge.angle.abs();
            checked("exterior angle", "below 179 degrees", turn, turn < SHARPEST)?;
        }
        Ok(Self(Outline::Polygon(vertices)))
    }

    /// The rectangle with the given half sides about the origin, from the middle of its lower side.
    ///
    /// # Errors
    /// The half sides must be positive and finite.
    pub fn rectangle(half_width: f64, half_height: f64) -> Result<Self, Error> {
        let a = positive("half width", half_width)?;
        let b = positive("half height", half_height)?;
        Self::polygon(vec![[-a, -b], [a, -b], [a, b], [-a, b]])
    }

    /// The cross `[-a, a] x [-b, b]` with its transpose, `a` the half length and `b` the half width of the arms, from the middle
    /// of its lower end.
    ///
    /// # Errors
    /// `0 < b < a`, both finite.
    pub fn cross(half_length: f64, half_width: f64) -> Result<Self, Error> {
        let a = positive("half length", half_length)?;
        let b = positive("half width", half_width)?;
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
    /// The half axes must be positive and finite, one at most twenty times the other.
    pub fn ellipse(a: f64, b: f64) -> Result<Self, Error> {
        positive("first half axis", a)?;
        positive("second half axis", b)?;
        let aspect = (a / b).max(b / a);
        checked(
            "ratio of the half axes",
            "at most 20",
            aspect,
            aspect <= 20.0,
        )?;
        let count = 32 * aspect.ceil() as usize;
        Self::smooth(&sampled(count, |u| [a * u.cos(), b * u.sin()]))
    }

    /// The smooth curve through points at equal steps of a periodic parameter, of which it is the trigonometric interpolation; in
    /// either direction. Its arc length starts at the first point.
    ///
    /// # Errors
    /// There must be an even number of at least eight points, and the curve must turn once.
    pub fn smooth(points: &[[f64; 2]]) -> Result<Self, Error> {
        let (count, even) = (points.len() as f64, points.len().is_multiple_of(2));
        checked("number of points", "even", count, even)?;
        checked("number of points", "at least 8", count, count >= 8.0)?;
        finite(points)?;
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
        let holds = rounding > 0.0 && rounding <= MOST_ROUNDING;
        checked("rounding", "positive and at most 1/80", rounding, holds)?;
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
    collect(count, |i| point(TAU * i as f64 / count as f64 - FRAC_PI_2))
}

fn once(turning: f64) -> Result<(), Error> {
    if (turning - 1.0).abs() < 1e-6 {
        Ok(())
    } else {
        Err(Error::Turning { turning })
    }
}

fn shoelace(points: &[[f64; 2]]) -> f64 {
    let pairs = points.iter().zip(points.iter().cycle().skip(1));
    pairs.map(|(p, q)| p[0] * q[1] - p[1] * q[0]).sum()
}

/// The trigonometric interpolation of counterclockwise points by its arc length.
fn by_arc_length(points: &[[f64; 2]]) -> Result<Curve, Error> {
    const RESOLVED: f64 = 1e-10;
    let fine = Grid::new(1, (4 * points.len()).next_power_of_two());
    let coarse = Grid::new(1, points.len());
    let padded = |axis: usize| {
        let mut coefficients = coarse.expand(|i| points[i][axis]);
        coefficients.resize(fine.points / 2 + 1, Complex::ZERO);
        coefficients
    };
    let [x, y] = [padded(0), padded(1)];
    let real = |coefficients: &[Complex<f64>], u: f64| {
        2.0 * power_sum(coefficients, Complex::cis(u)).re - coefficients[0].re
    };
    let [dx, dy] = [&x, &y].map(|c| fine.derivative(c));
    let (at_x, at_y) = (fine.values(&dx), fine.values(&dy));
    let speed = fine.expand(|i| at_x[i].hypot(at_y[i]));
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

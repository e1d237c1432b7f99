//! Plane geometry of the layout: points, boxes, clipping, dashing and thinning of polylines.
//!
//! Everything is in layout units with the origin at the upper left and `y` pointing down.

use std::f64::consts::TAU;

/// A point in layout units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Point {
    pub x: f64,
    pub y: f64,
}

pub(crate) const fn point(x: f64, y: f64) -> Point {
    Point { x, y }
}

impl Point {
    pub fn distance(self, other: Self) -> f64 {
        (self.x - other.x).hypot(self.y - other.y)
    }

    /// Distance to the segment from `a` to `b`.
    fn distance_to(self, a: Self, b: Self) -> f64 {
        let (dx, dy) = (b.x - a.x, b.y - a.y);
        let along = (self.x - a.x) * dx + (self.y - a.y) * dy;
        let share = (along / (dx * dx + dy * dy)).clamp(0.0, 1.0);
        // Of a segment without length, every point is the same.
        self.distance(a.towards(b, if share.is_nan() { 0.0 } else { share }))
    }

    /// The point a fraction `t` of the way to `other`.
    pub fn towards(self, other: Self, t: f64) -> Self {
        let between = |from: f64, to: f64| from + t * (to - from);
        point(between(self.x, other.x), between(self.y, other.y))
    }
}

/// A regular polygon that passes for a disc at the sizes used for markers and joins.
pub(crate) fn disc(centre: Point, radius: f64) -> Vec<Point> {
    let sides = if radius < 2.0 { 12 } else { 24 };
    let corner = |k| {
        let (sin, cos) = (TAU * f64::from(k) / f64::from(sides)).sin_cos();
        point(centre.x + radius * cos, centre.y + radius * sin)
    };
    (0..sides).map(corner).collect()
}

/// An axis-parallel box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rect {
    pub x: f64,
    pub y: f64,
    pub width: f64,
    pub height: f64,
}

impl Rect {
    pub const fn new(x: f64, y: f64, width: f64, height: f64) -> Self {
        Self {
            x,
            y,
            width,
            height,
        }
    }

    pub fn right(&self) -> f64 {
        self.x + self.width
    }

    pub fn bottom(&self) -> f64 {
        self.y + self.height
    }

    pub fn centre(&self) -> Point {
        point(self.x + 0.5 * self.width, self.y + 0.5 * self.height)
    }

    /// The box grown by `by` on every side.
    pub fn grown(&self, by: f64) -> Self {
        let (width, height) = (self.width + 2.0 * by, self.height + 2.0 * by);
        Self::new(self.x - by, self.y - by, width, height)
    }

    pub fn contains(&self, p: Point) -> bool {
        p.x >= self.x && p.x <= self.right() && p.y >= self.y && p.y <= self.bottom()
    }

    /// The largest box of the given height-to-width ratio centred in this one, with its corners on whole units, so that its frame is crisp.
    pub fn fitted(&self, aspect: f64) -> Self {
        let width = self.width.min(self.height / aspect);
        let (x, y) = (
            self.centre().x - 0.5 * width,
            self.centre().y - 0.5 * width * aspect,
        );
        let side = |from: f64, length: f64| ((from + length).round() - from.round()).max(1.0);
        Self::new(
            x.round(),
            y.round(),
            side(x, width),
            side(y, width * aspect),
        )
    }

    /// Corners, clockwise from the upper left.
    pub fn corners(&self) -> [Point; 4] {
        let (right, bottom) = (self.right(), self.bottom());
        [
            (self.x, self.y),
            (right, self.y),
            (right, bottom),
            (self.x, bottom),
        ]
        .map(|(x, y)| point(x, y))
    }
}

/// Room a panel needs around its plot box.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Margins {
    pub left: f64,
    pub right: f64,
    pub top: f64,
    pub bottom: f64,
}

impl Margins {
    pub fn even(width: f64) -> Self {
        Self {
            left: width,
            right: width,
            top: width,
            bottom: width,
        }
    }

    pub fn max(self, other: Self) -> Self {
        Self {
            left: self.left.max(other.left),
            right: self.right.max(other.right),
            top: self.top.max(other.top),
            bottom: self.bottom.max(other.bottom),
        }
    }
}

/// The part of the segment from `a` to `b` inside `bounds` (Liang and Barsky, 1984).
fn clip_segment(a: Point, b: Point, bounds: &Rect) -> Option<(Point, Point)> {
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    let sides = [
        (-dx, a.x - bounds.x),
        (dx, bounds.right() - a.x),
        (-dy, a.y - bounds.y),
        (dy, bounds.bottom() - a.y),
    ];
    for (slope, gap) in sides {
        if slope == 0.0 {
            if gap < 0.0 {
                return None;
            }
        } else if slope < 0.0 {
            enter = enter.max(gap / slope);
        } else {
            leave = leave.min(gap / slope);
        }
    }
    (enter <= leave).then(|| (a.towards(b, enter), a.towards(b, leave)))
}

/// Clips a polyline, giving the connected runs inside `bounds`.
pub(crate) fn clip_polyline(points: &[Point], bounds: &Rect) -> Vec<Vec<Point>> {
    let mut runs: Vec<Vec<Point>> = Vec::new();
    for pair in points.windows(2) {
        let Some((a, b)) = clip_segment(pair[0], pair[1], bounds) else {
            continue;
        };
        match runs.last_mut() {
            Some(run) if run.last().is_some_and(|end| end.distance(a) < 1e-9) => run.push(b),
            _ => runs.push(vec![a, b]),
        }
    }
    runs
}

/// Clips a filled loop against `bounds` (Sutherland and Hodgman, 1974).
pub(crate) fn clip_loop(points: &[Point], bounds: &Rect) -> Vec<Point> {
    let mut ring = points.to_vec();
    let inside: [&dyn Fn(Point) -> f64; 4] = [
        &|p| p.x - bounds.x,
        &|p| bounds.right() - p.x,
        &|p| p.y - bounds.y,
        &|p| bounds.bottom() - p.y,
    ];
    for depth in inside {
        let mut clipped = Vec::with_capacity(ring.len() + 4);
        for (k, &b) in ring.iter().enumerate() {
            let a = ring[(k + ring.len() - 1) % ring.len()];
            let (da, db) = (depth(a), depth(b));
            if (da < 0.0) != (db < 0.0) {
                clipped.push(a.towards(b, da / (da - db)));
            }
            if db >= 0.0 {
                clipped.push(b);
            }
        }
        ring = clipped;
    }
    ring
}

/// Drops points closer than `spacing` to the last one kept; the ends stay.
///
/// A curve that wanders inside the spacing is invisible at the resolution drawn.
pub(crate) fn thin(points: &[Point], spacing: f64) -> Vec<Point> {
    let mut kept: Vec<Point> = Vec::with_capacity(points.len());
    for (k, &p) in points.iter().enumerate() {
        let last = k + 1 == points.len();
        if last || kept.last().is_none_or(|q| q.distance(p) >= spacing) {
            kept.push(p);
        }
    }
    kept
}

/// Leaves out points as long as no other is farther than `tolerance` from the line between those kept (Ramer, 1972; Douglas and Peucker,
/// 1973). The ends stay.
pub(crate) fn simplified(points: &[Point], tolerance: f64) -> Vec<Point> {
    let last = points.len().saturating_sub(1);
    let (mut kept, mut spans) = (vec![0, last], vec![(0, last)]);
    while let Some((from, to)) = spans.pop() {
        let inner = (from + 1..to).map(|k| (k, points[k].distance_to(points[from], points[to])));
        let farthest = inner.max_by(|(_, a), (_, b)| a.total_cmp(b));
        if let Some((middle, distance)) = farthest
            && distance > tolerance
        {
            kept.push(middle);
            spans.extend([(from, middle), (middle, to)]);
        }
    }
    kept.sort_unstable();
    kept.dedup();
    kept.iter()
        .filter_map(|&k| points.get(k).copied())
        .collect()
}

/// Cuts a polyline into the dashes of `pattern` (lengths of pen down, pen up, ...); empty: solid.
pub(crate) fn dash(points: &[Point], pattern: &[f64]) -> Vec<Vec<Point>> {
    if pattern.is_empty() || points.len() < 2 {
        return vec![points.to_vec()];
    }
    let mut dashes = Vec::new();
    let (mut slot, mut left) = (0, pattern[0]);
    let mut current = vec![points[0]];
    for pair in points.windows(2) {
        let (mut from, to) = (pair[0], pair[1]);
        loop {
            let length = from.distance(to);
            let ends = length <= left || !length.is_finite();
            if ends {
                left -= length;
                if slot % 2 == 0 {
                    current.push(to);
                }
                break;
            }
            from = from.towards(to, left / length);
            if slot % 2 == 0 {
                current.push(from);
                dashes.push(std::mem::take(&mut current));
            } else {
                current = vec![from];
            }
            slot = (slot + 1) % pattern.len();
            left = pattern[slot];
        }
    }
    if slot % 2 == 0 && current.len() > 1 {
        dashes.push(current);
    }
    dashes
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const UNIT: Rect = Rect::new(0.0, 0.0, 10.0, 10.0);

    #[test]
    fn clipping_keeps_the_part_inside() {
        let (a, b) = clip_segment(point(-5.0, 5.0), point(15.0, 5.0), &UNIT).unwrap();
        assert_eq!((a, b), (point(0.0, 5.0), point(10.0, 5.0)));
        assert!(clip_segment(point(-5.0, 0.0), point(0.0, -5.1), &UNIT).is_none());
        let zigzag = [
            point(2.0, 2.0),
            point(2.0, 20.0),
            point(8.0, 20.0),
            point(8.0, 2.0),
        ];
        assert_eq!(clip_polyline(&zigzag, &UNIT).len(), 2);
    }

    #[test]
    fn clipped_loops_are_those_of_the_intersection() {
        let square = Rect::new(5.0, 5.0, 10.0, 10.0).corners();
        let clipped = clip_loop(&square, &UNIT);
        let corners = Rect::new(5.0, 5.0, 5.0, 5.0).corners();
        assert!(clipped.len() == 4 && corners.iter().all(|corner| clipped.contains(corner)));
        assert!(clip_loop(&Rect::new(20.0, 20.0, 1.0, 1.0).corners(), &UNIT).is_empty());
    }

    #[test]
    fn simplified_curves_keep_their_corners_and_their_place() {
        let step = |k: u32| 10.0 * f64::from(k) / 100.0;
        let up = (0..=100).map(|k| point(0.0, step(k)));
        let corner: Vec<Point> = up.chain((1..=100).map(|k| point(step(k), 10.0))).collect();
        let corners = [point(0.0, 0.0), point(0.0, 10.0), point(10.0, 10.0)];
        assert_eq!(simplified(&corner, 0.05), corners);
        for few in 0..3 {
            assert_eq!(simplified(&corner[..few], 0.05), corner[..few]);
        }
        let circle = |k: u32| {
            let (sin, cos) = (TAU * f64::from(k) / 3000.0).sin_cos();
            point(100.0 * cos, 100.0 * sin)
        };
        let ring: Vec<Point> = (0..=3000).map(circle).collect();
        let kept = simplified(&ring, 0.05);
        assert!((60..140).contains(&kept.len()), "{}", kept.len());
        for &p in &ring {
            let distances = kept.windows(2).map(|pair| p.distance_to(pair[0], pair[1]));
            assert!(distances.fold(f64::INFINITY, f64::min) <= 0.05);
        }
    }

    proptest! {
        #[test]
        fn dashes_cover_the_pattern_share(length in 50.0..400.0_f64, cuts in 1_usize..40) {
            let line: Vec<Point> =
                (0..=cuts).map(|k| point(length * k as f64 / cuts as f64, 0.0)).collect();
            let inked: f64 =
                dash(&line, &[6.0, 4.0]).iter().map(|d| d[0].distance(d[d.len() - 1])).sum();
            let periods = (length / 10.0).floor();
            let expected = 6.0 * periods + (length - 10.0 * periods).min(6.0);
            prop_assert!((inked - expected).abs() < 1e-9);
        }
    }
}

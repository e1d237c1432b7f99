//! Plane geometry of the layout: points, boxes, clipping, dashing and thinning of polylines.
//!
//! Everything is in layout units with the origin at the upper left and `y` pointing down.

use std::f64::consts::TAU;

use glam::{DVec2, dvec2};

/// The distance of two points by `hypot`, which rounds less than [`DVec2::distance`].
pub(crate) fn distance(a: DVec2, b: DVec2) -> f64 {
    (a.x - b.x).hypot(a.y - b.y)
}

/// Distance from a point to the segment from `a` to `b`.
fn distance_to_segment(p: DVec2, [a, b]: [DVec2; 2]) -> f64 {
    let along = b - a;
    let share = ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    // Of a segment without length, every point is the same.
    let share = if share.is_nan() { 0.0 } else { share };
    distance(p, a + share * along)
}

/// A regular polygon that passes for a disc at the sizes used for markers and joins.
pub(crate) fn disc(centre: DVec2, radius: f64) -> Vec<DVec2> {
    let sides = if radius < 2.0 { 12 } else { 24 };
    let angle = |k: i32| TAU * f64::from(k) / f64::from(sides);
    let corner = |k| centre + radius * DVec2::from_angle(angle(k));
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

    pub fn centre(&self) -> DVec2 {
        dvec2(self.x + 0.5 * self.width, self.y + 0.5 * self.height)
    }

    /// The box grown by `by` on every side.
    pub fn grown(&self, by: f64) -> Self {
        let (width, height) = (self.width + 2.0 * by, self.height + 2.0 * by);
        Self::new(self.x - by, self.y - by, width, height)
    }

    pub fn contains(&self, p: DVec2) -> bool {
        p.x >= self.x && p.x <= self.right() && p.y >= self.y && p.y <= self.bottom()
    }

    /// The largest box of the given height-to-width ratio centred in this one, with its corners on whole units, so that its frame is crisp.
    pub fn fitted(&self, aspect: f64) -> Self {
        let width = self.width.min(self.height / aspect);
        let size = dvec2(width, width * aspect);
        let corner = self.centre() - 0.5 * size;
        let (low, high) = (corner.round(), (corner + size).round());
        let sides = (high - low).max(DVec2::ONE);
        Self::new(low.x, low.y, sides.x, sides.y)
    }

    /// Corners, clockwise from the upper left.
    pub fn corners(&self) -> [DVec2; 4] {
        let (left, top, right, bottom) = (self.x, self.y, self.right(), self.bottom());
        [[left, top], [right, top], [right, bottom], [left, bottom]].map(DVec2::from)
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
fn clip_segment(a: DVec2, b: DVec2, bounds: &Rect) -> Option<(DVec2, DVec2)> {
    let along = b - a;
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    let sides = [
        (-along.x, a.x - bounds.x),
        (along.x, bounds.right() - a.x),
        (-along.y, a.y - bounds.y),
        (along.y, bounds.bottom() - a.y),
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
    (enter <= leave).then(|| (a + enter * along, a + leave * along))
}

/// Clips a polyline, giving the connected runs inside `bounds`.
pub(crate) fn clip_polyline(points: &[DVec2], bounds: &Rect) -> Vec<Vec<DVec2>> {
    let mut runs: Vec<Vec<DVec2>> = Vec::new();
    for pair in points.windows(2) {
        let Some((a, b)) = clip_segment(pair[0], pair[1], bounds) else {
            continue;
        };
        match runs.last_mut() {
            Some(run) if run.last().is_some_and(|end| distance(*end, a) < 1e-9) => run.push(b),
            _ => runs.push(vec![a, b]),
        }
    }
    runs
}

/// Clips a filled loop against `bounds` (Sutherland and Hodgman, 1974).
pub(crate) fn clip_loop(points: &[DVec2], bounds: &Rect) -> Vec<DVec2> {
    let mut ring = points.to_vec();
    let inside: [&dyn Fn(DVec2) -> f64; 4] = [
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
                clipped.push(a + da / (da - db) * (b - a));
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
pub(crate) fn thin(points: &[DVec2], spacing: f64) -> Vec<DVec2> {
    let mut kept: Vec<DVec2> = Vec::with_capacity(points.len());
    for (k, &p) in points.iter().enumerate() {
        let last = k + 1 == points.len();
        if last || kept.last().is_none_or(|q| distance(*q, p) >= spacing) {
            kept.push(p);
        }
    }
    kept
}

/// Leaves out points as long as no other is farther than `tolerance` from the line between those kept (Ramer, 1972; Douglas and Peucker,
/// 1973). The ends stay.
pub(crate) fn simplified(points: &[DVec2], tolerance: f64) -> Vec<DVec2> {
    let last = points.len().saturating_sub(1);
    let (mut kept, mut spans) = (vec![0, last], vec![(0, last)]);
    while let Some((from, to)) = spans.pop() {
        let off = |k: usize| distance_to_segment(points[k], [points[from], points[to]]);
        let inner = (from + 1..to).map(|k| (k, off(k)));
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
pub(crate) fn dash(points: &[DVec2], pattern: &[f64]) -> Vec<Vec<DVec2>> {
    if pattern.is_empty() || points.len() < 2 {
        return vec![points.to_vec()];
    }
    let mut dashes = Vec::new();
    let (mut slot, mut left) = (0, pattern[0]);
    let mut current = vec![points[0]];
    for pair in points.windows(2) {
        let (mut from, to) = (pair[0], pair[1]);
        let mut length = distance(from, to);
        while length > left && length.is_finite() {
            from += left / length * (to - from);
            current.push(from);
            if slot % 2 == 0 {
                dashes.push(current);
            }
            current = vec![from];
            slot = (slot + 1) % pattern.len();
            left = pattern[slot];
            length = distance(from, to);
        }
        left -= length;
        current.push(to);
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
        let (a, b) = clip_segment(dvec2(-5.0, 5.0), dvec2(15.0, 5.0), &UNIT).unwrap();
        assert_eq!((a, b), (dvec2(0.0, 5.0), dvec2(10.0, 5.0)));
        assert!(clip_segment(dvec2(-5.0, 0.0), dvec2(0.0, -5.1), &UNIT).is_none());
        let zigzag = [[2.0, 2.0], [2.0, 20.0], [8.0, 20.0], [8.0, 2.0]].map(DVec2::from);
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
        let up = (0..=100).map(|k| dvec2(0.0, step(k)));
        let corner: Vec<DVec2> = up.chain((1..=100).map(|k| dvec2(step(k), 10.0))).collect();
        let corners = [dvec2(0.0, 0.0), dvec2(0.0, 10.0), dvec2(10.0, 10.0)];
        assert_eq!(simplified(&corner, 0.05), corners);
        for few in 0..3 {
            assert_eq!(simplified(&corner[..few], 0.05), corner[..few]);
        }
        let circle = |k: u32| 100.0 * DVec2::from_angle(TAU * f64::from(k) / 3000.0);
        let ring: Vec<DVec2> = (0..=3000).map(circle).collect();
        let kept = simplified(&ring, 0.05);
        assert!((60..140).contains(&kept.len()), "{}", kept.len());
        for &p in &ring {
            let ends = kept.windows(2).map(|pair| [pair[0], pair[1]]);
            let distances = ends.map(|ends| distance_to_segment(p, ends));
            assert!(distances.fold(f64::INFINITY, f64::min) <= 0.05);
        }
    }

    proptest! {
        #[test]
        fn dashes_cover_the_pattern_share(length in 50.0..400.0_f64, cuts in 1_usize..40) {
            let line: Vec<DVec2> =
                (0..=cuts).map(|k| dvec2(length * k as f64 / cuts as f64, 0.0)).collect();
            let inked: f64 =
                dash(&line, &[6.0, 4.0]).iter().map(|d| distance(d[0], d[d.len() - 1])).sum();
            let periods = (length / 10.0).floor();
            let expected = 6.0 * periods + (length - 10.0 * periods).min(6.0);
            prop_assert!((inked - expected).abs() < 1e-9);
        }
    }
}

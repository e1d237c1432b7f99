//! Grids and fields.

#![allow(clippy::float_cmp, reason = "where equality is asserted, it is exact")]

use geometry::shapes::{Ball, Cuboid};
use geometry::{Bricks, Error, Field, Grid, NodeSet, SignedDistance, SignedDistanceExt};
use proptest::prelude::*;

#[test]
fn grids_follow_the_conventions() {
    let grid = Grid::<3>::new(4, 2.0).unwrap();
    assert_eq!((grid.cells(), grid.len(), grid.shape()), (4, 64, [4, 4, 4]));
    assert!((grid.spacing() - 0.5).abs() < 1e-16);
    assert!((grid.cell_volume() - 0.125).abs() < 1e-16);
    // Row-major, the last axis fastest, the repeated layer absent.
    assert_eq!(grid.node(1), [0.0, 0.0, 0.5]);
    assert_eq!(grid.node(4), [0.0, 0.5, 0.0]);
    assert_eq!(grid.node(63), [1.5, 1.5, 1.5]);
    assert_eq!([0, 1, 2].map(|axis| grid.stride(axis)), [16, 4, 1]);
}

#[test]
fn centred_grids_have_the_origin_as_a_node() {
    for cells in [2, 6, 10, 48, 514] {
        let grid = Grid::<2>::centred(cells, 0.7).unwrap();
        let middle = grid.index([cells / 2; 2]);
        assert_eq!(grid.node(middle), [0.0, 0.0], "{cells}");
    }
    let grid = Grid::<2>::per_unit(128, 2.0).unwrap();
    assert_eq!((grid.cells(), grid.origin()), (256, [-1.0, -1.0]));
    assert!((grid.spacing() - 1.0 / 128.0).abs() < 1e-18);
    let moved = grid.with_origin([0.25, 0.5]).unwrap();
    assert_eq!(moved.node(0), [0.25, 0.5]);
}

#[test]
fn impossible_grids_are_refused() {
    let small = Grid::<2>::new(1, 1.0);
    assert!(matches!(small, Err(Error::GridTooSmall { cells: 1 })));
    for side in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        for grid in [Grid::<2>::new(8, side), Grid::per_unit(8, side)] {
            assert!(
                matches!(grid, Err(Error::InvalidParameter { .. })),
                "{grid:?}"
            );
        }
    }
    for large in [
        Grid::<3>::new(1 << 22, 1.0).err(),
        Grid::<3>::new(usize::MAX, 1.0).err(),
        Grid::<1>::new(usize::MAX, 1.0).err(),
        Grid::<2>::per_unit(usize::MAX, 1e300).err(),
    ] {
        assert!(
            matches!(large, Some(Error::GridTooLarge { .. })),
            "{large:?}"
        );
    }
    let fractional = Grid::<2>::per_unit(3, 0.5);
    assert!(matches!(fractional, Err(Error::FractionalCells { .. })));
    let moved = Grid::<1>::new(8, 1.0).unwrap().with_origin([f64::NAN]);
    assert!(matches!(moved, Err(Error::InvalidParameter { .. })));
}

#[test]
fn fields_refuse_wrong_counts_and_bad_values() {
    let grid = Grid::<2>::new(2, 1.0).unwrap();
    let count = Field::from_values(grid, vec![0.0; 5]);
    assert!(matches!(
        count,
        Err(Error::ValueCount {
            expected: 4,
            actual: 5
        })
    ));
    let bad = Field::from_values(grid, vec![0.0, 1.0, f64::NAN, f64::INFINITY]);
    assert!(matches!(bad, Err(Error::NonFinite { index: 2, .. })));
    let message = bad.unwrap_err().to_string();
    assert!(message.contains("node 2"), "{message}");
    let field = Field::from_values(grid, vec![1.0, 2.0, 3.0, 4.0]).unwrap();
    assert_eq!(field.map(|v| 2.0 * v).into_values(), [2.0, 4.0, 6.0, 8.0]);
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn indices_round_trip(cells in 2_usize..20, seed in 0_usize..8000) {
        let grid = Grid::<3>::new(cells, 1.0).unwrap();
        let index = seed % grid.len();
        let multi_index = grid.multi_index(index);
        prop_assert_eq!(grid.index(multi_index), index);
        let strides: usize = (0..3).map(|axis| multi_index[axis] * grid.stride(axis)).sum();
        prop_assert_eq!(strides, index);
    }

    /// Multilinear functions are reproduced, also across the periodic seam.
    #[test]
    fn interpolation_is_multilinear_and_periodic(x in prop::array::uniform2(0.0..0.75_f64)) {
        let grid = Grid::<2>::new(4, 1.0).unwrap();
        let bilinear = |[x, y]: [f64; 2]| 1.0 + x - 2.0 * y + 3.0 * x * y;
        let field = Field::from_fn(grid, bilinear);
        prop_assert!((field.interpolate(x) - bilinear(x)).abs() < 1e-14);
        let image = [x[0] + 3.0, x[1] - 2.0];
        prop_assert!((field.interpolate(image) - bilinear(x)).abs() < 1e-13);
        let seam = field.interpolate([0.875, 0.0]);
        prop_assert!((seam - 0.5 * (1.75 + 1.0)).abs() < 1e-14);
    }

    /// Runs of equal marks, as in rows of a region.
    #[test]
    fn sets_of_nodes_are_their_marks(runs in prop::collection::vec((any::<bool>(), 1_usize..40), 1..30)) {
        let mut marks: Vec<bool> = Vec::new();
        for (mark, len) in &runs {
            marks.extend(vec![*mark; *len]);
        }
        marks.resize(1024, false);
        let set: NodeSet = marks.iter().copied().collect();
        prop_assert_eq!(set.iter().collect::<Vec<_>>(), &*marks);
        prop_assert!((0..marks.len()).all(|node| set.contains(node) == marks[node]));
        prop_assert_eq!((set.grid_len(), set.len()), (1024, marks.iter().filter(|mark| **mark).count()));
        prop_assert_eq!(set.is_empty(), !marks.contains(&true));
        for (first, len) in [(0, 1024), (17, 100), (1000, 24), (512, 1)] {
            let mut part = vec![false; len];
            set.within(first, len).for_each(|range| part[range].fill(true));
            prop_assert_eq!(&part, &marks[first..first + len]);
        }
        let again = NodeSet::from_ranges(1024, set.ranges().iter().cloned());
        prop_assert_eq!(again.as_ref(), Some(&set));
        let bricks = Bricks::<2>::new(32, 8, |[row, column]| row != column, |_| false).unwrap();
        let values: Vec<f64> = marks.iter().map(|mark| f64::from(*mark)).collect();
        let stored = set.on(&bricks).into_iter().map(f64::from);
        prop_assert_eq!(stored.collect::<Vec<_>>(), bricks.gather(&values));
    }

    #[test]
    fn the_nodes_inside_a_shape_are_those_of_negative_distance(
        centre in prop::array::uniform3(-0.6..0.6_f64), size in 0.01..0.5_f64,
    ) {
        let grid = Grid::<3>::centred(20, 1.0).unwrap();
        let ball = Ball::new(centre, size).unwrap();
        let cube = Cuboid::new([size, 0.3, 0.1]).unwrap();
        let shape = ball.difference(cube);
        for sign in [1.0, -1.0] {
            let distance = |x| sign * shape.signed_distance(x);
            let expected: NodeSet = (0..grid.len()).map(|node| distance(grid.node(node)) < 0.0).collect();
            prop_assert_eq!(NodeSet::inside(&grid, &distance), expected);
        }
    }
}

#[test]
fn ranges_that_are_no_set_of_nodes_are_refused() {
    assert!(NodeSet::from_ranges(9, [0..2, 3..9]).is_some());
    for ranges in [[0..2, 2..9], [3..9, 0..2], [0..2, 3..10], [0..0, 3..9]] {
        assert_eq!(NodeSet::from_ranges(9, ranges.clone()), None, "{ranges:?}");
    }
}

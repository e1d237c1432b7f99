//! Some of the nodes of a grid.

use std::ops::Range;

use crate::{Bricks, Grid, SignedDistance, parallel};

/// Some of the nodes of a grid, as ranges of their indices: about one for each row of the grid that crosses the set, so that a set takes little
/// memory on a grid of which little is stored.
///
/// ```
/// use geometry::NodeSet;
///
/// let set: NodeSet = (0..10).map(|node| node % 5 > 2).collect();
/// assert_eq!(set.ranges(), [3..5, 8..10]);
/// assert!(set.contains(4) && !set.contains(5));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeSet {
    /// In order, none of them empty, no two of them beside each other.
    ranges: Vec<Range<usize>>,
    grid_len: usize,
}

impl NodeSet {
    /// The nodes at which a distance is negative. As distances change by no more than the way, they are asked for only where their sign can change.
    pub fn inside<const D: usize>(grid: &Grid<D>, shape: &dyn SignedDistance<D>) -> Self {
        let (cells, spacing) = (grid.cells(), grid.spacing());
        let row = |row: usize| {
            let (first, mut ranges) = (row * cells, Vec::new());
            let mut node = first;
            while node < first + cells {
                let distance = shape.signed_distance(grid.node(node));
                let alike = ((distance.abs() / spacing) as usize).max(1);
                let next = node.saturating_add(alike).min(first + cells);
                if distance < 0.0 {
                    ranges.push(node..next);
                }
                node = next;
            }
            ranges
        };
        let rows = parallel::map(grid.len() / cells, 1, &row);
        Self::joined(grid.len(), rows.into_iter().flatten())
    }

    /// The nodes in these ranges, in order; none if they are not, or not on a grid of so many nodes.
    pub fn from_ranges(
        grid_len: usize,
        ranges: impl IntoIterator<Item = Range<usize>>,
    ) -> Option<Self> {
        let ranges: Vec<_> = ranges.into_iter().collect();
        let ordered = ranges.windows(2).all(|pair| pair[0].end < pair[1].start);
        let full = ranges.iter().all(|range| range.start < range.end);
        let fits = ranges.last().is_none_or(|range| range.end <= grid_len);
        (ordered && full && fits).then_some(Self { ranges, grid_len })
    }

    /// Joins ranges that begin where others end.
    fn joined(grid_len: usize, parts: impl Iterator<Item = Range<usize>>) -> Self {
        let mut ranges: Vec<Range<usize>> = Vec::new();
        for part in parts {
            match ranges.last_mut() {
                Some(last) if last.end == part.start => last.end = part.end,
                _ => ranges.push(part),
            }
        }
        Self { ranges, grid_len }
    }

    /// The ranges of indices, in order.
    pub fn ranges(&self) -> &[Range<usize>] {
        &self.ranges
    }

    /// How many nodes the grid has.
    pub fn grid_len(&self) -> usize {
        self.grid_len
    }

    /// How many nodes are in the set.
    pub fn len(&self) -> usize {
        self.ranges.iter().map(Range::len).sum()
    }

    /// Whether no node is in the set.
    pub fn is_empty(&self) -> bool {
        self.ranges.is_empty()
    }

    /// Whether a node is in the set.
    pub fn contains(&self, node: usize) -> bool {
        self.within(node, 1).next().is_some()
    }

    /// Whether each node of the grid is in the set.
    pub fn iter(&self) -> impl Iterator<Item = bool> + Clone {
        let mut ranges = self.ranges.iter().peekable();
        (0..self.grid_len).map(move |node| {
            while ranges.next_if(|range| range.end <= node).is_some() {}
            ranges.peek().is_some_and(|range| range.start <= node)
        })
    }

    /// What is in the set of so many nodes from a first one on, counted from there.
    pub fn within(&self, first: usize, len: usize) -> impl Iterator<Item = Range<usize>> {
        let from = self.ranges.partition_point(|range| range.end <= first);
        let ranges = self.ranges[from..].iter();
        let ranges = ranges.take_while(move |range| range.start < first + len);
        ranges.map(move |range| range.start.saturating_sub(first)..(range.end - first).min(len))
    }

    /// Whether each of the stored nodes is in the set.
    pub fn on<const D: usize>(&self, bricks: &Bricks<D>) -> Vec<bool> {
        let mut marks = vec![false; bricks.len()];
        for (first, row) in bricks.rows().zip(marks.chunks_exact_mut(bricks.side())) {
            for range in self.within(first, row.len()) {
                row[range].fill(true);
            }
        }
        marks
    }
}

/// Whether each node of the grid, in its order, is in the set.
impl FromIterator<bool> for NodeSet {
    fn from_iter<I: IntoIterator<Item = bool>>(marks: I) -> Self {
        let mut grid_len = 0;
        let nodes = marks.into_iter().inspect(|_| grid_len += 1).enumerate();
        let nodes = nodes.filter(|(_, marked)| *marked);
        let set = Self::joined(0, nodes.map(|(node, _)| node..node + 1));
        Self { grid_len, ..set }
    }
}

//! Numbers in sets that are joined one after the other.

/// Sets of the numbers from 0 on, each with its least number as its root. Paths to roots are halved as they are walked (R. E. Tarjan: Efficiency of a good
/// but not linear set union algorithm. J. ACM 22 (1975)).
#[derive(Default)]
pub(crate) struct Joined {
    /// A number of the same set that is no larger.
    parents: Vec<u32>,
}

impl Joined {
    /// So many sets of one number each.
    pub(crate) fn new(count: usize) -> Self {
        Self {
            parents: (0..count as u32).collect(),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.parents.len()
    }

    /// Adds a set of the next number.
    pub(crate) fn push(&mut self) {
        self.parents.push(self.parents.len() as u32);
    }

    /// The least number of the set of this one.
    pub(crate) fn root(&mut self, number: usize) -> usize {
        let mut number = number as u32;
        loop {
            let parent = self.parents[number as usize];
            if parent == number {
                return number as usize;
            }
            let next = self.parents[parent as usize];
            self.parents[number as usize] = next;
            number = next;
        }
    }

    /// Makes the sets of two numbers one; returns whether they were apart.
    pub(crate) fn join(&mut self, one: usize, other: usize) -> bool {
        let (one, other) = (self.root(one), self.root(other));
        self.parents[one.max(other)] = one.min(other) as u32;
        one != other
    }
}

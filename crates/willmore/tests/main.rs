//! Parts of one's own in every combination, and the examples.

mod examples;
mod killed;
mod own;

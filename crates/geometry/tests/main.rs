//! Grids, distances, contours, measures and files.

mod common;
mod contours;
mod distances;
mod files;
mod fuzzing;
mod grids;
mod measures;
mod zero_sets;

#[global_allocator]
static ALLOCATOR: ::fuzzing::CountingAllocator = ::fuzzing::CountingAllocator;

//! Grids, distances, contours, measures and files.

mod common;
mod contours;
mod distances;
mod files;
mod fuzzing;
mod grids;
mod measures;

#[global_allocator]
static ALLOCATOR: ::fuzzing::CountingAllocator = ::fuzzing::CountingAllocator;

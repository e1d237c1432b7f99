//! Volumes: files and bodies.

mod bodies;
mod common;
mod files;
mod fuzzing;
mod kinds;
mod nrrd;
mod stacks;

#[global_allocator]
static ALLOCATOR: ::fuzzing::CountingAllocator = ::fuzzing::CountingAllocator;

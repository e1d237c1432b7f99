//! Volumes: files and bodies.

mod bodies;
mod common;
mod files;
mod fuzzing;

#[global_allocator]
static ALLOCATOR: ::fuzzing::CountingAllocator = ::fuzzing::CountingAllocator;

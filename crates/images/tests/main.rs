//! Outlines, drawings and files of images.

mod common;
mod drawings;
mod files;
mod fuzzing;
mod outlines;

#[global_allocator]
static ALLOCATOR: ::fuzzing::CountingAllocator = ::fuzzing::CountingAllocator;

//! Outlines, drawings and files of images.

mod common;
mod drawings;
mod files;
mod fuzzing;
mod outlines;
mod tones;

#[global_allocator]
static ALLOCATOR: ::fuzzing::CountingAllocator = ::fuzzing::CountingAllocator;

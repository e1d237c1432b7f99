//! Meshes: files, distances, isosurfaces.

mod bounds;
mod closed;
mod common;
mod covering;
mod distances;
mod edges;
mod fairing;
mod files;
mod fuzzing;
mod isosurfaces;
mod label_meshes;
mod lids;
mod parts;
mod remeshing;
mod repairing;
mod shapes;

#[global_allocator]
static ALLOCATOR: ::fuzzing::CountingAllocator = ::fuzzing::CountingAllocator;

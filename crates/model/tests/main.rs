//! Shipped networks, their calibration, and damaged files.

mod calibration;
mod fuzzing;
mod measured;
mod shipped_networks;

#[global_allocator]
static ALLOCATOR: ::fuzzing::CountingAllocator = ::fuzzing::CountingAllocator;

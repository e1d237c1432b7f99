//! What run directories promise.

mod damage;
mod faults;
mod fuzzing;
mod killed;
mod toy;

#[global_allocator]
static ALLOCATOR: ::fuzzing::CountingAllocator = ::fuzzing::CountingAllocator;

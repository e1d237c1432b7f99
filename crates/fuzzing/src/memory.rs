//! Memory that a thread asks for.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// Most bytes at a time while measuring; more are refused, which ends the process. No test should
/// bring down the machine that it runs on.
const MOST: usize = 1 << 31;

/// Bytes of one thread since the measurement began.
#[derive(Clone, Copy)]
struct Count {
    /// Held. What was allocated before may be given back, too.
    live: isize,
    peak: isize,
}

thread_local! {
    static COUNT: Cell<Option<Count>> = const { Cell::new(None) };
}

/// The system's allocator, counting for [`peak_of`]. Every test binary that measures declares it as its `#[global_allocator]`.
pub struct CountingAllocator;

/// Counts bytes that are about to be taken; whether they may be.
fn take(size: usize) -> bool {
    let counted = COUNT.try_with(|cell| {
        let Some(mut count) = cell.get() else {
            return true;
        };
        let size = isize::try_from(size).unwrap_or(isize::MAX);
        count.live = count.live.saturating_add(size);
        count.peak = count.peak.max(count.live);
        let allowed = count.live <= MOST as isize;
        if !allowed {
            count.live -= size;
        }
        cell.set(Some(count));
        allowed
    });
    counted.unwrap_or(true)
}

fn give_back(size: usize) {
    // A thread that ends has nothing to measure.
    let _ = COUNT.try_with(|cell| {
        if let Some(mut count) = cell.get() {
            count.live -= size as isize;
            cell.set(Some(count));
        }
    });
}

#[allow(
    unsafe_code,
    reason = "an allocator; every call is passed on to the system's unchanged"
)]
// The provided `realloc` allocates and then frees: old and new exist at the same time, as when a block cannot grow where it is.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if !take(layout.size()) {
            return std::ptr::null_mut();
        }
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if !take(layout.size()) {
            return std::ptr::null_mut();
        }
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        give_back(layout.size());
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// What a function returns, and the most bytes that it held at a time on this thread beyond those
/// held before.
///
/// # Panics
/// If the binary does not declare the [`CountingAllocator`].
pub fn peak_of<T>(function: impl FnOnce() -> T) -> (T, usize) {
    const PROBE: usize = 4096;
    let ((), probe) = counted(|| drop(std::hint::black_box(Vec::<u8>::with_capacity(PROBE))));
    assert!(
        probe >= PROBE,
        "memory is not counted: declare the CountingAllocator as #[global_allocator]"
    );
    counted(function)
}

fn counted<T>(function: impl FnOnce() -> T) -> (T, usize) {
    /// Ends the measurement, also by a panic.
    struct End;
    impl Drop for End {
        fn drop(&mut self) {
            COUNT.set(None);
        }
    }
    let end = End;
    COUNT.set(Some(Count { live: 0, peak: 0 }));
    let result = function();
    let peak = COUNT.get().map_or(0, |count| count.peak);
    drop(end);
    (result, peak.max(0) as usize)
}

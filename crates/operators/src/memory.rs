//! Memory of the process: what is kept for later use, how much is in use, and what happens where there is none.

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use std::{process, thread};

use crate::fft::Real;

/// The allocator of the system, for programs: where the system refuses memory, the program says so in one line on standard error and ends with
/// the exit code 2. Without it a program of Rust aborts, and shows a trace of its calls.
pub struct OrRefuse;

/// The exit code of a program to which the system refused memory.
pub const REFUSED: i32 = 2;

/// Ends the program. Nothing here allocates.
#[cold]
fn refuse(size: usize) -> ! {
    static SAID: AtomicBool = AtomicBool::new(false);
    // Another thread is ending it.
    while SAID.swap(true, Ordering::Relaxed) {
        thread::sleep(Duration::from_secs(1));
    }
    let mut line = [0; 256];
    let mut rest = &mut line[..];
    // It is long enough.
    let _ = writeln!(
        rest,
        "error: this does not fit into memory: the system refuses {size} bytes more; take fewer cells, or let the program have more memory. A run that \
         had begun goes on with: willmore resume"
    );
    let left = rest.len();
    let length = line.len() - left;
    let _ = std::io::stderr().write_all(&line[..length]);
    process::exit(REFUSED)
}

#[allow(unsafe_code, reason = "an allocator is unsafe")]
// SAFETY: all of it is that of the system, which has the contract of `GlobalAlloc`; a null pointer is not returned.
unsafe impl GlobalAlloc for OrRefuse {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's, as for all functions here.
        let block = unsafe { System.alloc(layout) };
        if block.is_null() {
            refuse(layout.size());
        }
        block
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        let block = unsafe { System.alloc_zeroed(layout) };
        if block.is_null() {
            refuse(layout.size());
        }
        block
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above.
        let block = unsafe { System.realloc(block, layout, size) };
        if block.is_null() {
            refuse(size);
        }
        block
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(block, layout) }
    }
}

/// Tells the allocator of glibc to keep memory that was freed. By default it returns vectors of megabytes to the system at once
/// and gets them back page by page, which costs flows half of their time. Other allocators keep memory anyway. To be called first in a
/// program.
pub fn keep_freed() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        const KEPT: libc::c_int = libc::c_int::MAX;
        #[allow(unsafe_code, reason = "a call into the C library without pointers")]
        // SAFETY: `mallopt` takes two integers; this is called before there are other threads.
        unsafe {
            // No vector is mapped on its own, however large it is: glibc accepts no threshold above 32 MiB.
            libc::mallopt(libc::M_MMAP_MAX, 0);
            libc::mallopt(libc::M_TRIM_THRESHOLD, KEPT);
        }
    }
}

/// Gives memory back to the system that is only kept for later use: spectra of kernels, plans and buffers of convolutions, and
/// what the allocator keeps. For instance between two computations with large vectors of different sizes.
pub fn release_kept() {
    f32::shared().clear();
    f64::shared().clear();
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        #[allow(unsafe_code, reason = "a call into the C library without pointers")]
        // SAFETY: `malloc_trim` takes an integer and may be called at any time.
        unsafe {
            libc::malloc_trim(0);
        }
    }
}

/// Starts a new measurement of the largest resident memory, where the system can do that.
pub fn forget_peak() {
    // Without that the peak is the one since the start of the program: an upper bound.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Largest resident memory of this process in MiB, where the system tells.
pub fn peak_mib() -> Option<f64> {
    Some(kib("/proc/self/status", "VmHWM:")? / 1024.0)
}

/// Bytes of memory that this process could still take without swapping, and within the limit of its address space (`ulimit -v`), where the system
/// tells.
pub fn available() -> Option<f64> {
    let free = kib("/proc/meminfo", "MemAvailable:")? * 1024.0;
    Some(free.min(left_of_limit().unwrap_or(f64::INFINITY)))
}

/// Bytes that are left of the limit of the address space, if there is one.
fn left_of_limit() -> Option<f64> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits
        .lines()
        .find(|l| l.starts_with("Max address space"))?;
    let limit: f64 = line.split_whitespace().nth(3)?.parse().ok()?;
    let taken = kib("/proc/self/status", "VmSize:")? * 1024.0;
    Some((limit - taken).max(0.0))
}

/// The number on the line of a file of the system that begins like this.
fn kib(path: &str, beginning: &str) -> Option<f64> {
    let text = std::fs::read_to_string(path).ok()?;
    let line = text.lines().find(|line| line.starts_with(beginning))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

/// Pages of memory that the system has handed to this process so far, where it tells. While vectors are recycled, there are none.
pub fn pages() -> Option<u64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name of the program, in brackets, may hold blanks; `minflt` is the eighth field after it.
    let (_, fields) = stat.rsplit_once(')')?;
    fields.split_whitespace().nth(7)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convolution::kernel_symbol;

    #[test]
    fn what_was_released_is_made_again_with_the_same_bits() {
        // No other test has a grid of this shape.
        let shape = [22, 26];
        let kernel = [0.1, -0.2, 0.3, 0.5, 0.7, 0.2, 0.4, 0.1, 0.6];
        let before = kernel_symbol(&shape, &kernel, 3);
        let kept = std::sync::Arc::downgrade(&before);
        let bits = before.as_ref().clone();
        release_kept();
        drop(before);
        assert!(kept.upgrade().is_none(), "the spectrum is still kept");
        assert_eq!(*kernel_symbol(&shape, &kernel, 3), bits);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn touching_new_memory_takes_pages() {
        const SIZE: usize = 64 << 20;
        let before = pages().unwrap();
        let vector = std::hint::black_box(vec![1_u8; SIZE]);
        let taken = pages().unwrap() - before;
        // Pages have 4 KiB or more; huge ones 2 MiB.
        assert!(taken as usize >= SIZE >> 21, "{taken} pages");
        drop(vector);
    }
}

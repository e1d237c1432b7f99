//! How programs use memory.

/// Tells the allocator of glibc to keep memory that was freed. By default it returns vectors of megabytes to the system at once
/// and gets them back page by page, which costs the energies and gradients of a flow half of their time. Other allocators keep
/// memory anyway. For the first line of a program.
pub fn keep_freed() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        /// The largest value glibc accepts.
        const MAPPED_FROM: libc::c_int = 32 << 20;
        const KEPT: libc::c_int = 128 << 20;
        #[allow(unsafe_code, reason = "a call into the C library without pointers")]
        // SAFETY: `mallopt` takes two integers and may be called at any time.
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, MAPPED_FROM);
            libc::mallopt(libc::M_TRIM_THRESHOLD, KEPT);
        }
    }
}

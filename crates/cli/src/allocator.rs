//! The memory that the C library's allocator holds on to.

/// The largest block that the GNU C library may take as a sign (32 MiB), less what it adds.
const BLOCK: usize = (32 << 20) - (64 << 10);

/// Has the GNU C library keep the memory of one recording for the next: without it, every large buffer
/// goes back to the system when it is freed, and its pages are cleared again for the next one (a tenth to
/// a quarter of a run). That library keeps blocks up to the size of the largest that was freed; this frees
/// one that is never touched and takes no memory. Other allocators take no notice.
pub fn keep_freed_memory() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(BLOCK)));
}

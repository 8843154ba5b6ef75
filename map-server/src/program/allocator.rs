//! Where the memory of a program that serves comes from: mimalloc.
//!
//! Each session of Zenoh has buffers of 64 KiB, made by whichever thread needs one first. With the
//! system's allocator of Linux (glibc), what robots that have left give back lies in one thread's
//! share while another thread asks the system for more: while robots come and go, a server grew by
//! 3 MiB a minute for as long as it was watched, though it used no more (`docs/benchmarks.md`).

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

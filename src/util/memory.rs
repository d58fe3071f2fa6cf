//! The host memory that is left. Work that cannot fit is refused before it allocates.
//!
//! Rust ends a process that cannot allocate, without a way to clean up or to say what was too large. Linux often
//! grants the allocation and ends the process later, when the memory is used.

use sysinfo::{MemoryRefreshKind, RefreshKind, System};

/// Size that is assumed to fit, bytes. Smaller estimates are not worth the time of a check.
const NEGLIGIBLE: u64 = 64 << 20;

/// The error that something needs more memory than is available.
#[derive(Debug, thiserror::Error)]
#[error("{what} needs some {} of memory, and {} are available", in_words(*.needed), in_words(*.available))]
pub struct OutOfMemory {
    what: String,
    needed: u64,
    available: u64,
}

impl From<OutOfMemory> for String {
    fn from(error: OutOfMemory) -> Self {
        error.to_string()
    }
}

/// Checks that `needed` bytes are available. `what` begins the error's message.
///
/// # Errors
/// Fewer bytes are available.
pub fn require(what: &str, needed: u64) -> Result<(), OutOfMemory> {
    if needed <= NEGLIGIBLE {
        return Ok(());
    }
    match available() {
        Some(available) if available < needed => Err(OutOfMemory { what: what.to_owned(), needed, available }),
        _ => Ok(()),
    }
}

/// Returns the number of bytes that the process can still allocate. It is the least of three numbers: the machine's
/// available memory and free swap space, the rest up to the container's limit, and the rest up to the limit on the
/// process's address space (`ulimit -v`). `None` if the system reports none of them.
pub fn available() -> Option<u64> {
    let memory = RefreshKind::nothing().with_memory(MemoryRefreshKind::everything());
    let system = System::new_with_specifics(memory).ok().filter(|system| system.total_memory() > 0);
    let of_machine = system.as_ref().map(|system| system.available_memory().saturating_add(system.free_swap()));
    // `CGroupLimits::free_memory` counts the container's page cache as used, although the kernel would give it up. So
    // `rss` is subtracted from the limit instead.
    let of_container = system.as_ref().and_then(System::cgroup_limits);
    let of_container = of_container.map(|it| it.total_memory.saturating_sub(it.rss).saturating_add(it.free_swap));
    [of_machine, of_container, address_space_left()].into_iter().flatten().min()
}

/// Returns the size of the machine's memory in bytes. `None` if the system does not report it.
pub fn total() -> Option<u64> {
    let memory = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    System::new_with_specifics(memory).ok().map(|system| system.total_memory()).filter(|bytes| *bytes > 0)
}

/// Returns the number of bytes up to the limit on the process's address space. `None` without a limit.
#[cfg(target_os = "linux")]
fn address_space_left() -> Option<u64> {
    let limit = rustix::process::getrlimit(rustix::process::Resource::As).current?;
    let pages = std::fs::read_to_string("/proc/self/statm").ok()?;
    let n_pages: u64 = pages.split_whitespace().next()?.parse().ok()?;
    Some(limit.saturating_sub(n_pages * rustix::param::page_size() as u64))
}

#[cfg(not(target_os = "linux"))]
fn address_space_left() -> Option<u64> {
    None
}

/// Formats a size: below 1 GiB in whole MiB, otherwise in GiB with one decimal.
pub fn in_words(bytes: u64) -> String {
    let mebibytes = bytes as f64 / f64::from(1 << 20);
    if mebibytes < 1024.0 { format!("{mebibytes:.0} MiB") } else { format!("{:.1} GiB", mebibytes / 1024.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_machine_has_is_refused() {
        assert!(available().is_some_and(|bytes| bytes > NEGLIGIBLE));
        assert!(total() >= Some(NEGLIGIBLE));
        require("nothing", 0).unwrap();
        require("a little", NEGLIGIBLE).unwrap();
        let error = require("a sphere of 2 triangles", 1 << 60).unwrap_err().to_string();
        assert!(error.starts_with("a sphere of 2 triangles needs some 1073741824.0 GiB of memory, and "), "{error}");
        assert!(error.ends_with(" are available"), "{error}");
    }
}

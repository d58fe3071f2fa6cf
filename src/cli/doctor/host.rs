//! The machine that kdray runs on.

use kdray::util::memory;
use serde::Serialize;

/// What is known of the machine.
#[derive(Serialize)]
pub struct Host {
    /// The version of kdray.
    pub kdray: &'static str,
    /// Name and version of the operating system, and the processor's instruction set.
    pub os: String,
    pub cpu_threads: usize,
    /// Size of the memory, bytes. None if the system does not report it.
    pub memory_bytes: Option<u64>,
    /// Number of bytes that the process can still allocate. None if the system does not report it.
    pub available_bytes: Option<u64>,
}

impl Host {
    pub fn of_machine() -> Self {
        let name = sysinfo::System::long_os_version().unwrap_or_else(|_| std::env::consts::OS.to_owned());
        Self {
            kdray: env!("CARGO_PKG_VERSION"),
            os: format!("{name}, {}", std::env::consts::ARCH),
            cpu_threads: rayon::current_num_threads(),
            memory_bytes: memory::total(),
            available_bytes: memory::available(),
        }
    }

    pub fn text(&self) -> String {
        let bytes = |bytes: Option<u64>| bytes.map_or_else(|| "unknown".to_owned(), memory::in_words);
        format!(
            "kdray {} on {}\n{} CPU threads, memory {}, available {}\n",
            self.kdray,
            self.os,
            self.cpu_threads,
            bytes(self.memory_bytes),
            bytes(self.available_bytes)
        )
    }
}

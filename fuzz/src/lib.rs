//! What all fuzz targets share.

#[path = "../../tests/support/assembled.rs"]
pub mod assembled;
#[path = "../../tests/support/hostile.rs"]
pub mod hostile;

use std::sync::OnceLock;

use kdray::engine::Engine;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use self::hostile::{Format, Reader};

#[doc(hidden)]
pub use libfuzzer_sys;

/// Bytes of address space that a target may use. kdray refuses what does not fit into the rest, so that a file which
/// asks for much is refused, and does not end the fuzzer. It is less than libFuzzer's own limit of 2 GiB.
const ADDRESS_SPACE: u64 = 1536 << 20;

/// Defines the fuzz target of a format.
#[macro_export]
macro_rules! target {
    ($format:ident) => {
        $crate::libfuzzer_sys::fuzz_target!(
            init: $crate::prepare(),
            |content: &[u8]| $crate::check($crate::hostile::Format::$format, content)
        );
    };
}

/// Sets what holds for the whole process.
pub fn prepare() {
    // One thread makes runs repeatable.
    // SAFETY: no other thread reads the environment yet.
    unsafe { std::env::set_var("RAYON_NUM_THREADS", "1") };
    // libFuzzer's hook ends the process at each panic. kdray catches those of image decoders.
    std::panic::set_hook(Box::new(|panic| eprintln!("{panic}")));
    let hard = getrlimit(Resource::As).maximum;
    setrlimit(Resource::As, Rlimit { current: Some(ADDRESS_SPACE), maximum: hard }).expect("a limit on memory");
}

/// Reads a file of the format.
pub fn check(format: Format, content: &[u8]) {
    static READER: OnceLock<Reader> = OnceLock::new();
    READER.get_or_init(Reader::new).check(format, content);
}

/// Assembles a world, options and rays of the bytes, and draws and casts on the CPU.
pub fn check_world(bytes: &[u8]) {
    static ENGINE: OnceLock<Engine> = OnceLock::new();
    assembled::check(ENGINE.get_or_init(Engine::on_cpu), bytes);
}

#![no_main]
kdray_fuzz::libfuzzer_sys::fuzz_target!(init: kdray_fuzz::prepare(), |content: &[u8]| kdray_fuzz::check_world(content));

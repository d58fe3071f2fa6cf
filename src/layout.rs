//! The structs, constants and bindings that the kernels share with the host, generated from `glsl/shared/layout.glsl`.

include!(concat!(env!("OUT_DIR"), "/layout.rs"));

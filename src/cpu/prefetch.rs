//! Loads into the cache ahead of need.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};

use fearless_simd::Simd;

/// Bytes of a cache line, on most machines.
const LINE_BYTES: usize = 64;

/// Begins to load a value into the cache. Does nothing on machines other than x86.
#[inline(always)]
pub fn prefetch<S: Simd, T>(simd: S, value: &T) {
    #[cfg(target_arch = "x86_64")]
    if let Some(sse2) = simd.level().as_sse2() {
        let begin = std::ptr::from_ref(value).cast::<i8>();
        for line in 0..size_of::<T>().div_ceil(LINE_BYTES) {
            prefetch_line(sse2, begin.wrapping_add(LINE_BYTES * line));
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (simd, value, LINE_BYTES);
}

#[cfg(target_arch = "x86_64")]
fearless_simd::kernel!(
    #[inline(always)]
    fn prefetch_line(_sse2: Sse2, line: *const i8) {
        _mm_prefetch::<_MM_HINT_T0>(line)
    }
);

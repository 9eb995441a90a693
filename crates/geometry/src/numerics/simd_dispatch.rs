//! Run-time dispatch of loops to the widest vector instructions of the processor.

use pulp::{Arch, Simd, WithSimd};

/// Runs `work` with code compiled for this processor's vector instructions.
///
/// Call it as `dispatch_simd(#[inline(always)] || …)`, and mark the called functions
/// `#[inline(always)]`: only inlined code is compiled for the instructions. The numbers are the
/// same on every processor: vectors change neither the order of operations nor their rounding, and
/// nothing is contracted to a fused multiply–add.
#[inline(always)]
pub fn dispatch_simd<R>(work: impl FnMut() -> R) -> R {
    Arch::new().dispatch(Work(work))
}

struct Work<F>(F);

impl<R, F: FnMut() -> R> WithSimd for Work<F> {
    type Output = R;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> R {
        (self.0)()
    }
}

/// Runs `work` with code compiled for AVX2 and returns true; returns false without running it if
/// the processor lacks AVX2.
///
/// Call it like [`dispatch_simd`]. Code that is not inlined is correct but slow: use no closures
/// and no `map` of arrays in loops.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn dispatch_avx2(work: impl FnMut(pulp::x86::V3)) -> bool {
    let Some(simd) = pulp::x86::V3::try_new() else {
        return false;
    };
    Simd::vectorize(simd, Avx2Work(simd, work));
    true
}

/// Prefetches a sample for reading.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn prefetch(simd: pulp::x86::V3, samples: &[u8], at: usize) {
    use std::arch::x86_64::_MM_HINT_T0;
    let pointer = samples.as_ptr().wrapping_add(at);
    simd.sse._mm_prefetch::<_MM_HINT_T0>(pointer.cast());
}

/// Prefetches rows for writing.
pub fn prefetch_rows(rows: &[&mut [u8]]) {
    /// Size of a cache line, bytes.
    #[cfg(target_arch = "x86_64")]
    const CACHE_LINE_BYTES: usize = 64;
    #[cfg(target_arch = "x86_64")]
    dispatch_avx2(
        #[inline(always)]
        |simd| {
            for row in rows {
                for at in (0..row.len()).step_by(CACHE_LINE_BYTES) {
                    prefetch(simd, row, at);
                }
            }
        },
    );
    #[cfg(not(target_arch = "x86_64"))]
    let _ = rows;
}

#[cfg(target_arch = "x86_64")]
struct Avx2Work<F>(pulp::x86::V3, F);

#[cfg(target_arch = "x86_64")]
impl<F: FnMut(pulp::x86::V3)> WithSimd for Avx2Work<F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        (self.1)(self.0);
    }
}

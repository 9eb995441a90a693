//! Run-time dispatch of loops to the widest vector instructions of the processor.

use pulp::{Arch, Simd, WithSimd};
use std::sync::atomic::{AtomicU8, Ordering};

/// The widest vector instructions that the process uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum SimdLimit {
    /// Those of the processor.
    #[default]
    Widest,
    /// AVX2, if the processor has it.
    Avx2,
    /// Those that every processor of its kind has.
    Baseline,
}

/// The [`SimdLimit`] of the process.
static LIMIT: AtomicU8 = AtomicU8::new(SimdLimit::Widest as u8);

/// Limits the vector instructions of the process, to test that numbers do not depend on them.
pub fn limit_simd(limit: SimdLimit) {
    LIMIT.store(limit as u8, Ordering::Relaxed);
}

/// True if the process is limited to `limit`.
#[inline(always)]
fn is_limited_to(limit: SimdLimit) -> bool {
    LIMIT.load(Ordering::Relaxed) == limit as u8
}

/// The instructions to use.
#[inline(always)]
fn arch() -> Arch {
    if is_limited_to(SimdLimit::Widest) {
        return Arch::new();
    }
    #[cfg(target_arch = "x86_64")]
    if let (true, Some(simd)) = (is_limited_to(SimdLimit::Avx2), pulp::x86::V3::try_new()) {
        return Arch::V3(simd);
    }
    Arch::Scalar
}

/// Runs `work` with code compiled for this processor's vector instructions.
///
/// Call it as `dispatch_simd(#[inline(always)] || …)`, and mark the called functions
/// `#[inline(always)]`: only inlined code is compiled for the instructions. The numbers are the
/// same on every processor: vectors change neither the order of operations nor their rounding, and
/// nothing is contracted to a fused multiply–add.
#[inline(always)]
pub fn dispatch_simd<R>(work: impl FnMut() -> R) -> R {
    arch().dispatch(Work(work))
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
    if is_limited_to(SimdLimit::Baseline) {
        return false;
    }
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

//! Loops compiled for the widest vectors of the processor that runs them.

use pulp::{Arch, Simd, WithSimd};

/// Does `work` with the code compiled for this processor's vector instructions.
///
/// Write it as `dispatch_simd(#[inline(always)] || …)`, and mark what it calls `#[inline(always)]`
/// as well: only what is inlined is compiled anew. The numbers are the same on every processor:
/// vectors change neither the order of operations nor their rounding, and nothing is contracted to
/// a fused multiply–add.
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

/// Does `work` with the code compiled for AVX2, which it is handed; false without doing it where
/// the processor has none.
///
/// Write it as [`dispatch_simd`]. What is not inlined is neither fast nor wrong: no closures, no
/// `map` of arrays in loops.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn dispatch_avx2(work: impl FnMut(pulp::x86::V3)) -> bool {
    let Some(simd) = pulp::x86::V3::try_new() else {
        return false;
    };
    Simd::vectorize(simd, Avx2Work(simd, work));
    true
}

/// Asks for a sample that will be needed soon.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn prefetch(simd: pulp::x86::V3, samples: &[u8], at: usize) {
    use std::arch::x86_64::_MM_HINT_T0;
    let pointer = samples.as_ptr().wrapping_add(at);
    simd.sse._mm_prefetch::<_MM_HINT_T0>(pointer.cast());
}

/// Asks for rows that will be written soon.
pub fn prefetch_rows(rows: &[&mut [u8]]) {
    /// Bytes that come at once.
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

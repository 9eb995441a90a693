//! Memory that `refine` needs, checked before it begins.

use crate::cli::output::Failure;
use crate::render::available_bytes;
use crate::survey::Survey;

/// Memory of the program, and that is to stay free, bytes.
const MIN_FREE_BYTES: u64 = 48 << 20;

/// Refuses to begin what would end without memory, if the system reports how much is free.
/// `bytes`: memory of the run beside [`MIN_FREE_BYTES`].
///
/// # Errors
/// A temporary [`Failure`] with both numbers.
pub fn check_memory(survey: &Survey, bytes: u64) -> Result<(), Failure> {
    let needed = bytes + MIN_FREE_BYTES;
    match available_bytes() {
        Some(free) if free < needed => Err(Failure::temporary(format!(
            "refining {} frames takes some {} MiB of memory, and {} MiB are free; end other \
             programs, raise the limit (ulimit -v), or refine it in shards (--shard)",
            survey.frames.len(),
            needed >> 20,
            free >> 20
        ))),
        _ => Ok(()),
    }
}

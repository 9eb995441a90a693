//! Free memory, and whether it suffices.

use crate::error::RenderError;
use crate::layout::canvas::Canvas;
use crate::sampling::picture_cache::PictureCache;

/// Memory that is available without swapping and within the limit of the process's addresses
/// (`ulimit -v`), bytes, where the system reports it (Linux).
pub fn available_bytes() -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let free = read("/proc/meminfo").and_then(|text| parse_kib(&text, "MemAvailable:"));
    let limit = read("/proc/self/limits").and_then(|text| parse_address_limit(&text));
    let used = read("/proc/self/status").and_then(|text| parse_kib(&text, "VmSize:"));
    let left = limit.map(|limit| limit.saturating_sub(used.unwrap_or(0)));
    [free, left].into_iter().flatten().min()
}

/// Checks that drawing `canvas` from `frames` with `needed` bytes stays within `available`, if that
/// is known.
///
/// # Errors
/// [`RenderError::Memory`].
pub fn check_available(
    canvas: &Canvas,
    frames: &PictureCache,
    needed: u64,
    available: Option<u64>,
) -> Result<(), RenderError> {
    check_limit(canvas, frames, needed, u64::MAX, available)
}

/// Checks that drawing with `needed` bytes stays within `limit` and within `available`, if that is
/// known.
///
/// # Errors
/// [`RenderError::Memory`].
pub fn check_limit(
    canvas: &Canvas,
    frames: &PictureCache,
    needed: u64,
    limit: u64,
    available: Option<u64>,
) -> Result<(), RenderError> {
    match available.map_or(limit, |available| limit.min(available)) {
        least if needed > least => Err(RenderError::Memory {
            by_limit: needed > limit,
            columns: canvas.columns,
            rows: canvas.rows,
            frames: frames.len(),
            needed_mib: needed.div_ceil(1 << 20),
            available_mib: least >> 20,
        }),
        _ => Ok(()),
    }
}

/// The number of KiB of the line that starts with `name`, in bytes.
fn parse_kib(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

/// The soft limit of the address space, bytes; None without a limit.
fn parse_address_limit(limits: &str) -> Option<u64> {
    let line = limits
        .lines()
        .find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::camera::Camera;

    #[test]
    fn the_available_line_is_read() {
        let text = "MemTotal:       16 kB\nMemAvailable:   12 kB\n";
        assert_eq!(parse_kib(text, "MemAvailable:"), Some(12 * 1024));
        assert_eq!(parse_kib("nothing", "MemAvailable:"), None);
        let line = "Max address space         102400000            unlimited            bytes";
        assert_eq!(parse_address_limit(line), Some(102_400_000));
        let none = line.replace("102400000", "unlimited");
        assert_eq!(parse_address_limit(&none), None);
    }

    #[test]
    fn what_is_beyond_the_memory_is_refused() {
        let canvas = Canvas {
            columns: 10_000,
            rows: 10_000,
            px_per_metre: 100.0,
            h_start_m: 0.0,
        };
        let frames = PictureCache::from_pictures(Camera::from_vertical_fov(2, 2, 1.0), vec![]);
        assert!(check_available(&canvas, &frames, 500_000_000, Some(500_000_000)).is_ok());
        assert!(check_available(&canvas, &frames, 500_000_001, None).is_ok());
        let message = check_available(&canvas, &frames, 500_000_001, Some(500_000_000))
            .unwrap_err()
            .to_string();
        assert!(message.contains("10000 × 10000 px") && message.contains("--px-per-metre"));
    }
}

//! Free memory, and whether it suffices.

use crate::error::RenderError;
use crate::layout::canvas::Canvas;
use crate::sampling::picture_cache::PictureCache;

/// Memory that is available without swapping, bytes, where the system reports it (Linux).
pub fn available_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    parse_meminfo(&text)
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
    match available {
        Some(available) if needed > available => Err(RenderError::Memory {
            columns: canvas.columns,
            rows: canvas.rows,
            frames: frames.len(),
            needed_mib: needed.div_ceil(1 << 20),
            available_mib: available >> 20,
        }),
        _ => Ok(()),
    }
}

fn parse_meminfo(meminfo: &str) -> Option<u64> {
    let line = meminfo
        .lines()
        .find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::camera::Camera;

    #[test]
    fn the_available_line_is_read() {
        let text = "MemTotal:       16 kB\nMemAvailable:   12 kB\n";
        assert_eq!(parse_meminfo(text), Some(12 * 1024));
        assert_eq!(parse_meminfo("nothing"), None);
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

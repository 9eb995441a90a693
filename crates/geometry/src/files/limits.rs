//! Largest sizes of text files, by their kind.
//!
//! A parsed file takes several times its size in memory. Each limit is more than ten times the
//! largest file of its kind that a survey of 100,000 frames has.

/// Largest `survey.toml`, bytes.
pub const MAX_SURVEY_BYTES: u64 = 4 << 20;
/// Largest calibration, bytes: nerfstudio's has the frames, too.
pub const MAX_CALIBRATION_BYTES: u64 = 64 << 20;
/// Largest table of poses, times, rates of a gyroscope, or points of a line, bytes.
pub const MAX_TABLE_BYTES: u64 = 512 << 20;
/// Largest file about the shape of a wall, bytes.
pub const MAX_WALL_BYTES: u64 = 256 << 20;
/// Largest report of a refinement, bytes.
pub const MAX_REPORT_BYTES: u64 = 512 << 20;
/// Largest file of marks, bytes.
pub const MAX_MARKS_BYTES: u64 = 256 << 20;

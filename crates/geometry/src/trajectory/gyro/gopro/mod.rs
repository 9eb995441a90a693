//! The gyro of a GoPro's own video: a track `gpmd` of an MP4, whose payloads are GPMF.
//!
//! | subject | file |
//! | --- | --- |
//! | the file and its index | [`video_file`] |
//! | boxes of MP4 | [`boxes`] |
//! | place and time of each payload | [`sample_table`] |
//! | keys, lengths and values of GPMF | [`klv`] |
//! | the axes of the sensor in the camera | [`axes`] |
//! | values of one sensor from all payloads | [`sensor`] |
//! | times of the values | [`sample_clock`] |
//! | the readout time of the rolling shutter | [`settings`] |
//! | the log | [`reader`] |
//!
//! Source: README and samples of <https://github.com/gopro/gpmf-parser>, version 2.1.

mod axes;
mod boxes;
mod klv;
mod reader;
mod sample_clock;
mod sample_table;
mod sensor;
mod settings;
#[cfg(test)]
mod tests;
mod video_file;

pub(super) use reader::read;
pub use settings::gopro_readout_ms;
pub(super) use video_file::VideoFile;

//! Functions that the fuzzer, and a test of the program with damaged seeds, call with bytes of
//! others.

pub mod calibration;
pub mod centreline;
pub mod checkpoint;
pub mod covariances;
pub mod discovery;
pub mod frame_pixels;
pub mod frame_times;
pub mod frames_of_reference;
pub mod gyro;
pub mod jobs;
pub mod mark_changes;
pub mod marks;
pub mod matrix_folders;
pub mod names;
pub mod pictures;
pub mod plan;
pub mod points;
pub mod poses;
pub mod recordings;
pub mod refinement;
pub mod requests;
pub mod runs;
pub mod survey;
pub mod sweep;
pub mod video;
pub mod wall_files;
pub mod words;

/// Reads an input. It panics on what must not be.
pub type Target = fn(&[u8]);

/// All targets by their names.
pub const TARGETS: [(&str, Target); 27] = [
    ("calibration", calibration::run),
    ("centreline", centreline::run),
    ("checkpoint", checkpoint::run),
    ("covariances", covariances::run),
    ("discovery", discovery::run),
    ("frame_pixels", frame_pixels::run),
    ("frame_times", frame_times::run),
    ("frames_of_reference", frames_of_reference::run),
    ("gyro", gyro::run),
    ("jobs", jobs::run),
    ("mark_changes", mark_changes::run),
    ("marks", marks::run),
    ("matrix_folders", matrix_folders::run),
    ("names", names::run),
    ("pictures", pictures::run),
    ("plan", plan::run),
    ("points", points::run),
    ("poses", poses::run),
    ("recordings", recordings::run),
    ("refinement", refinement::run),
    ("requests", requests::run),
    ("runs", runs::run),
    ("survey", survey::run),
    ("sweep", sweep::run),
    ("video", video::run),
    ("wall_files", wall_files::run),
    ("words", words::run),
];

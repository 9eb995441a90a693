//! runs.jsonl, the completed runs of a sweep. The simulator refuses the only requested run at once.

use super::super::file;
use tunnelstitch::evaluate::converge::{ConvergeOptions, run_sweep};
use tunnelstitch::progress::Silent;
use tunnelstitch::trajectory::JitterModel;

/// Reads the input.
pub fn run(data: &[u8]) {
    let (folder, _path) = file("runs.jsonl", data);
    let options = ConvergeOptions {
        rotations_deg: vec![2.0],
        jitters: vec![JitterModel::Independent],
        seeds: 1,
        frames: 2,
        width: 32,
        height: 24,
        noise_grey: -1.0,
        ..ConvergeOptions::default()
    };
    let _ = run_sweep(&options, folder.path(), false, &Silent);
}

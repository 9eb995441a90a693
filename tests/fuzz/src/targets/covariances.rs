//! covariance.csv.

use super::super::file;
use tunnelstitch::refine::read_covariances;

/// Reads the input.
pub fn run(data: &[u8]) {
    let (_folder, path) = file("covariance.csv", data);
    let _ = read_covariances(&path, 3);
}

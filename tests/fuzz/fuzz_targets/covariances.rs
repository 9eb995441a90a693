//! covariance.csv.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tunnelstitch::refine::read_covariances;
use tunnelstitch_fuzz::file;

fuzz_target!(|data: &[u8]| {
    let (_folder, path) = file("covariance.csv", data);
    let _ = read_covariances(&path, 3);
});

//! A gyroscope's log, integrated; the first byte selects the options.

use super::super::file;
use nalgebra::{Matrix3, Vector3};
use tunnelstitch::trajectory::gyro::{
    ClockOffset, FrameStations, GyroLog, GyroOptions, InitialAttitude, StationaryChoice,
    baseline_from_gyro,
};
use tunnelstitch::trajectory::{Mounting, Station};

/// Reads the input.
pub fn run(data: &[u8]) {
    let Some((first, content)) = data.split_first() else {
        return;
    };
    let (_folder, path) = file("log.gcsv", content);
    let Ok(log) = GyroLog::read(&path) else {
        return;
    };
    let to_camera = log
        .orientation
        .map_or_else(Matrix3::identity, |word| word.to_camera());
    let start_s = log.samples[0].time_s;
    let times_s = [0.1, 0.2, 0.3, 0.4, 0.5].map(|after_s| start_s + after_s);
    let stations = [0.0, 0.0, 0.1, 0.4, 0.9].map(|angle_rad| Station {
        chainage_m: angle_rad,
        angle_rad,
        offset_m: [0.0; 2],
    });
    let frames = FrameStations {
        times_s: &times_s,
        stations: &stations,
        mounting: Mounting::default(),
    };
    let bit = |k: u32| first >> k & 1 == 1;
    let options = GyroOptions {
        rest: match bit(0) {
            true => StationaryChoice::Find(0.05),
            false => StationaryChoice::Given([start_s, start_s + 0.1]),
        },
        bias_rad_s: bit(1).then(Vector3::zeros),
        density_rad_sqrt_s: bit(2).then_some(1e-4),
        scale_sigma: 0.01,
        total_turn_rad: bit(3).then_some(1.0),
        clock: match bit(4) {
            true => ClockOffset::Match([-0.1, 0.1]),
            false => ClockOffset::Given(0.0),
        },
        start: match bit(5) {
            true => InitialAttitude::Gravity { down_rad: 3.0 },
            false => InitialAttitude::Station,
        },
    };
    if let Ok(baseline) = baseline_from_gyro(&log, &to_camera, &frames, &options) {
        assert_eq!(baseline.trajectory.len(), times_s.len());
    }
}

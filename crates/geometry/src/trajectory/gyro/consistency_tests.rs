//! Consistency of the stated and the actual errors of integrated rotations, for log files with bias
//! and noise.

use super::*;
use crate::trajectory::so3;
use nalgebra::{UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write;

const HZ: f64 = 200.0;
const REST_S: f64 = 3.0;
const STEPS: usize = 20;

/// A smooth motion: at rest until [`REST_S`], then turning about the axis, swaying.
fn truth(t: f64) -> UnitQuaternion<f64> {
    let t = (t - REST_S).max(0.0);
    // Starts from rest.
    let turned = t * t / (1.0 + t);
    let sway = Vector3::new(0.1 * (1.0 - t.cos()), 0.0, 0.05 * (1.0 - (1.3 * t).cos()));
    so3::exp(&(Vector3::y() * turned)) * so3::exp(&sway)
}

/// The log of that motion by a sensor with the given orientation in the camera.
fn log(orientation: &str, bias: Vector3<f64>, sigma: f64, seed: u64) -> String {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let from_camera = Orientation::parse(orientation)
        .unwrap()
        .to_camera()
        .transpose();
    let mut text = format!(
        "GYROFLOW IMU \
         LOG\nversion,1.3\norientation,{orientation}\ntscale,0.0001\ngscale,0.00001\nt,gx,gy,gz\n"
    );
    let half = 1e-4;
    for k in 0..((REST_S + STEPS as f64) * HZ) as usize + 2 {
        let t = k as f64 / HZ;
        let rate = so3::log(&(truth(t - half).inverse() * truth(t + half))) / (2.0 * half);
        let noise = Vector3::from_fn(|_, _| sigma * normal());
        let raw = (from_camera * (rate + bias + noise) * 1e5).map(f64::round);
        writeln!(text, "{},{},{},{}", (t * 1e4).round(), raw.x, raw.y, raw.z).unwrap();
    }
    text
}

/// Normalised squared errors (over three axes) of the steps from second to second and of the whole.
fn normalised(orientation: &str, seed: u64) -> (f64, f64) {
    let bias = Vector3::new(0.012, -0.02, 0.007);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log.gcsv");
    std::fs::write(&path, log(orientation, bias, 0.02, seed)).unwrap();
    let log = GyroLog::read(&path).unwrap();
    let rates = log.rates(&log.orientation.unwrap().to_camera());
    let rest = StationaryInterval::find(&rates, 2.5).unwrap();
    assert!(rest.span_s[1] < REST_S + 0.2, "{rest:?}");
    let noise = RotationNoise {
        density_rad_sqrt_s: rest.density_rad_sqrt_s,
        bias_sigma_rad_s: rest.density_rad_sqrt_s / rest.length_s().sqrt(),
        scale_sigma: 0.0,
    };
    let turning = IntegratedRotation::new(rates.without(&rest.bias_rad_s));
    let error = |from: f64, to: f64| {
        let found = turning.between(from, to).unwrap();
        let expected = truth(from).inverse() * truth(to);
        let sigma = noise.sigma_rad(to - from, 0.0);
        so3::log(&(expected.inverse() * found)).norm_squared() / (3.0 * sigma * sigma)
    };
    let seconds = |k: usize| REST_S + k as f64;
    let steps: f64 = (0..STEPS).map(|k| error(seconds(k), seconds(k + 1))).sum();
    (steps / STEPS as f64, error(seconds(0), seconds(STEPS)))
}

/// Errors match their stated size for 24 orientations: the mean squares of 480 steps (1440 numbers)
/// and of 24 complete logs (72 numbers).
#[test]
fn errors_are_what_they_are_said_to_be() {
    let words: Vec<String> = ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"]
        .iter()
        .flat_map(|word| {
            let mixed = |k: usize| {
                let letters = word.chars().enumerate();
                letters
                    .map(|(at, c)| if at == k { c.to_ascii_lowercase() } else { c })
                    .collect::<String>()
            };
            (0..4).map(mixed).collect::<Vec<_>>()
        })
        .collect();
    let all: Vec<(f64, f64)> = words
        .iter()
        .enumerate()
        .map(|(seed, word)| normalised(word, seed as u64))
        .collect();
    let mean = |of: fn(&(f64, f64)) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
    let (steps, whole) = (mean(|pair| pair.0), mean(|pair| pair.1));
    // 1 ± 0.04 and 1 ± 0.2 by chance; the density is estimated with some per cent, rather too large
    // than too small.
    assert!((0.7..1.2).contains(&steps), "{steps}");
    assert!((0.4..1.6).contains(&whole), "{whole}");
}

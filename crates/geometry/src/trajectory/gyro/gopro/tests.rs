//! Videos of a few payloads, written here, and read as a log.

use super::settings::gopro_readout_ms;
use crate::trajectory::error::PoseError;
use crate::trajectory::gyro::log::{GyroLog, Readout, ReadoutDirection};
use nalgebra::Vector3;

/// A box of MP4.
fn mp4_box(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let size = 8 + content.len() as u32;
    [&size.to_be_bytes()[..], &kind[..], content].concat()
}

fn numbers(numbers: &[u32]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_be_bytes()).collect()
}

/// A value of GPMF.
fn klv(key: &[u8; 4], kind: u8, element_bytes: usize, data: &[u8]) -> Vec<u8> {
    let repeat = (data.len() / element_bytes) as u16;
    let header = [
        &key[..],
        &[kind, element_bytes as u8],
        &repeat.to_be_bytes(),
    ];
    let mut all = [&header.concat(), data].concat();
    all.resize(all.len().next_multiple_of(4), 0);
    all
}

fn vectors(values: &[[i16; 3]]) -> Vec<u8> {
    let numbers = values.iter().flatten();
    numbers.flat_map(|n| n.to_be_bytes()).collect()
}

/// Payload `number` of a device with one stream for each sensor; `more` precedes the sensors'
/// values.
fn payload(
    device: &str,
    more: &[u8],
    number: u32,
    rates: &[[i16; 3]],
    felt: &[[i16; 3]],
) -> Vec<u8> {
    let stream = |key: &[u8; 4], unit: &[u8], scale: u16, values: &[[i16; 3]]| {
        let total = (number + 1) * values.len() as u32;
        let content = [
            &klv(b"TSMP", b'L', 4, &total.to_be_bytes())[..],
            &klv(b"TMPC", b'f', 4, &31.5f32.to_be_bytes()),
            more,
            &klv(b"SIUN", b'c', unit.len(), unit),
            &klv(b"SCAL", b's', 2, &scale.to_be_bytes()),
            &klv(key, b's', 6, &vectors(values)),
        ];
        klv(b"STRM", 0, 1, &content.concat())
    };
    let streams = [
        klv(b"DVNM", b'c', device.len(), device.as_bytes()),
        stream(b"ACCL", b"m/s\xb2", 418, felt),
        stream(b"GYRO", b"rad/s", 1000, rates),
    ];
    klv(b"DEVC", 0, 1, &streams.concat())
}

/// A video with these payloads, one a second, in a track of this format.
fn video(format: &[u8; 4], payloads: &[Vec<u8>]) -> Vec<u8> {
    video_with(format, payloads, &[])
}

/// A video whose index begins with other boxes.
fn video_with(format: &[u8; 4], payloads: &[Vec<u8>], others: &[u8]) -> Vec<u8> {
    let first = mp4_box(b"ftyp", b"mp41");
    let count = payloads.len() as u32;
    let sizes: Vec<u32> = payloads.iter().map(|p| p.len() as u32).collect();
    let position = |k: usize| first.len() as u32 + 8 + sizes[..k].iter().sum::<u32>();
    let positions: Vec<u32> = (0..payloads.len()).map(position).collect();
    let table = [
        mp4_box(
            b"stsd",
            &[&numbers(&[0, 1, 16])[..], format, &[0; 8]].concat(),
        ),
        mp4_box(b"stts", &numbers(&[0, 1, count, 1000])),
        mp4_box(b"stsc", &numbers(&[0, 1, 1, 1, 1])),
        mp4_box(b"stsz", &numbers(&[&[0, 0, count], &sizes[..]].concat())),
        mp4_box(b"stco", &numbers(&[&[0, count], &positions[..]].concat())),
    ];
    let media = [
        mp4_box(b"mdhd", &numbers(&[0, 0, 0, 1000, 1000 * count, 0])),
        mp4_box(b"minf", &mp4_box(b"stbl", &table.concat())),
    ];
    let track = mp4_box(b"trak", &mp4_box(b"mdia", &media.concat()));
    let data = mp4_box(b"mdat", &payloads.concat());
    [first, data, mp4_box(b"moov", &[others, &track].concat())].concat()
}

/// Three payloads of four rates and two accelerations: the rate about the first axis counts up.
fn payloads(device: &str, more: &[u8]) -> Vec<Vec<u8>> {
    let rates = |k: i16| [0, 1, 2, 3].map(|j| [4 * k + j, 20, 30]);
    let felt = [[4099, 0, 0], [4099, 418, 0]];
    let one = |k: i16| payload(device, more, k as u32, &rates(k), &felt);
    (0..3).map(one).collect()
}

/// Settings with this value of `SROT`, as those of a HERO11 in the box `udta`.
fn settings(kind: u8, readout: &[u8]) -> Vec<u8> {
    let device = [
        klv(b"DVNM", b'c', 15, b"Global Settings"),
        klv(b"MINF", b'c', 12, b"HERO11 Black"),
        klv(b"SROT", kind, readout.len(), readout),
    ];
    let settings = klv(b"DEVC", 0, 1, &device.concat());
    let boxes = [mp4_box(b"FIRM", b"H22.01"), mp4_box(b"GPMF", &settings)];
    mp4_box(b"udta", &boxes.concat())
}

fn read(content: &[u8]) -> Result<GyroLog, PoseError> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("GX010001.MP4");
    std::fs::write(&path, content).unwrap();
    GyroLog::read(&path)
}

#[test]
fn rates_accelerations_and_times_of_a_hero5_are_read() {
    let log = read(&video(b"gpmd", &payloads("Camera", &[]))).unwrap();
    assert_eq!(log.samples.len(), 12);
    for (k, sample) in log.samples.iter().enumerate() {
        let expected = Vector3::new(k as f64, 20.0, 30.0) / 1000.0;
        assert!((sample.rate_rad_s - expected).norm() < 1e-12);
        assert!((sample.time_s - 0.25 * k as f64).abs() < 1e-9);
    }
    let felt = log.samples[0].acceleration_g.unwrap();
    assert!((felt.x - 4099.0 / 418.0 / 9.80665).abs() < 1e-12, "{felt}");
    // At rest upright, up is −y of the camera; a turn about up is one to the left.
    let to_camera = log.orientation.unwrap().to_camera();
    let up = to_camera * Vector3::x();
    let [left, backwards] = [to_camera * Vector3::y(), to_camera * Vector3::z()];
    assert_eq!(
        [up, left, backwards],
        [-Vector3::y(), -Vector3::x(), -Vector3::z()]
    );
}

/// A time that a stream states, as a HERO7 does, is not read: it is often wrong.
#[test]
fn the_readout_time_is_that_of_the_settings() {
    let stated = |kind: u8, readout: &[u8]| {
        let all = payloads("Camera", &klv(b"SROT", b'f', 4, &11.0f32.to_be_bytes()));
        read(&video_with(b"gpmd", &all, &settings(kind, readout)))
    };
    let readout = stated(b'f', &24.0f32.to_be_bytes()).unwrap().readout;
    let expected = Readout {
        time_ms: 24.0,
        direction: ReadoutDirection::TopToBottom,
    };
    assert_eq!(readout, Some(expected));
    for none in [0.0f32, -1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(stated(b'f', &none.to_be_bytes()).unwrap().readout, None);
    }
    let in_stream = klv(b"SROT", b'f', 4, &11.0f32.to_be_bytes());
    let log = read(&video(b"gpmd", &payloads("Camera", &in_stream))).unwrap();
    assert_eq!(log.readout, None);
    let message = stated(b'c', b"slow").unwrap_err().to_string();
    assert!(
        message.contains("MP4: its `SROT` has elements"),
        "{message}"
    );
}

#[test]
fn a_file_that_is_no_video_states_no_readout_time() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("GX010001.MP4");
    assert_eq!(gopro_readout_ms(&path), None);
    std::fs::write(&path, "GYROFLOW IMU LOG").unwrap();
    assert_eq!(gopro_readout_ms(&path), None);
    let settings = settings(b'f', &16.5f32.to_be_bytes());
    std::fs::write(&path, video_with(b"gpmd", &[], &settings)).unwrap();
    assert_eq!(gopro_readout_ms(&path), Some(16.5));
}

#[test]
fn axes_are_those_that_the_camera_states() {
    let max = [0.0f32, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let max: Vec<u8> = max.iter().flat_map(|n| n.to_be_bytes()).collect();
    let letters = [klv(b"ORIN", b'c', 1, b"XzY"), klv(b"ORIO", b'c', 1, b"ZXY")].concat();
    let matrix = klv(b"MTRX", b'f', 36, &max);
    for more in [letters, matrix] {
        let log = read(&video(b"gpmd", &payloads("GoPro Max", &more))).unwrap();
        let up = log.orientation.unwrap().to_camera() * -Vector3::y();
        assert_eq!(up, -Vector3::y());
    }
    let log = read(&video(b"gpmd", &payloads("Hero6 Black", &[]))).unwrap();
    assert_eq!(
        log.orientation.unwrap().to_camera() * Vector3::z(),
        -Vector3::y()
    );
    // Whichever axes its accelerations have: those of a HERO6 are not used.
    assert_eq!(log.samples[0].acceleration_g, None);
    let unknown = read(&video(b"gpmd", &payloads("Another", &[]))).unwrap();
    assert_eq!(unknown.orientation, None);
    assert_eq!(unknown.samples[0].acceleration_g, None);
}

/// A payload that was lost leaves a gap, and the rest keeps its times, where the camera counts.
#[test]
fn a_lost_payload_shifts_no_times() {
    let mut all = payloads("Camera", &[]);
    all[1] = klv(b"DEVC", 0, 4, &[]);
    let log = read(&video(b"gpmd", &all)).unwrap();
    let times_s: Vec<f64> = log.samples.iter().map(|s| s.time_s).collect();
    assert!(
        (times_s[3] - 0.75).abs() < 1e-9 && (times_s[4] - 2.0).abs() < 1e-9,
        "{times_s:?}"
    );
}

#[test]
fn what_is_wrong_is_named() {
    let good = payloads("Camera", &[]);
    let whole = video(b"gpmd", &good);
    let replaced = |from: &[u8], to: &[u8]| {
        let at = whole.windows(from.len()).position(|part| part == from);
        let mut all = whole.clone();
        all[at.unwrap()..][..to.len()].copy_from_slice(to);
        all
    };
    let others = [klv(b"DEVC", 0, 4, &[]), klv(b"DEVC", 0, 4, &[])];
    let without_gyro = video(b"gpmd", &others);
    for (content, expected) in [
        (
            video(b"fdsc", &good),
            "MP4: has no track `gpmd`: this camera wrote no gyro",
        ),
        (without_gyro, "0 values of `GYRO`"),
        (video(b"gpmd", &[]), "0 values of `GYRO`"),
        (replaced(b"moov", b"free"), "has no index"),
        (whole[..whole.len() - 1].to_vec(), "damaged or cut off"),
        (replaced(b"stsz", b"none"), "no box `stsz`"),
        (
            replaced(b"rad/s", b"deg/s"),
            "payload 0, at 0.000 s: its `GYRO` are in `deg/s`",
        ),
        (replaced(b"GYROs\x06", b"GYROs\x08"), "payload 0"),
        (
            replaced(b"GYROs", b"GYRO?"),
            "type `?`, which are no numbers",
        ),
        (
            replaced(b"SCALs\x02\0\x01\x01\xa2", b"SCALs\x02\0\x01\0\0"),
            "its SCAL is [0.0]",
        ),
        (
            video(b"gpmd", &payloads("Camera", &klv(b"ORIN", b'c', 1, b"XXY"))),
            "ORIN is `XXY`",
        ),
    ] {
        let message = read(&content).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

/// Every byte of the index and of a payload, damaged: an error or another log, and no panic.
#[test]
fn damaged_videos_do_no_harm() {
    let all = payloads("Camera", &klv(b"ORIN", b'c', 1, b"ZXY"));
    let settings = settings(b'f', &24.0f32.to_be_bytes());
    let whole = video_with(b"gpmd", &all, &settings);
    for at in 0..whole.len() {
        for value in [0, 0xff] {
            let mut damaged = whole.clone();
            damaged[at] = value;
            if let Ok(log) = read(&damaged) {
                let times = log.samples.windows(2);
                assert!(times.clone().all(|pair| pair[0].time_s < pair[1].time_s));
            }
        }
    }
}

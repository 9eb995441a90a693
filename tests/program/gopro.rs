//! Initial poses from the gyro in a GoPro's video, through the program.

use crate::support::missing::is_ffmpeg_missing;
use crate::support::{blender_survey, fail, succeed, text};
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use tunnelstitch::trajectory::{poses_of, tum};

/// Rates and accelerations of a payload of one second.
const PER_PAYLOAD: usize = 100;

fn mp4_box(kind: &str, content: &[u8]) -> Vec<u8> {
    let size = 8 + content.len() as u32;
    [&size.to_be_bytes()[..], kind.as_bytes(), content].concat()
}

fn words(numbers: &[u32]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_be_bytes()).collect()
}

fn klv(key: &str, kind: u8, element_bytes: u8, data: &[u8]) -> Vec<u8> {
    let repeat = (data.len() / usize::from(element_bytes)) as u16;
    let mut all = [
        key.as_bytes(),
        &[kind, element_bytes],
        &repeat.to_be_bytes(),
        data,
    ]
    .concat();
    all.resize(all.len().next_multiple_of(4), 0);
    all
}

fn stream(key: &str, scale: u16, value: impl Fn(usize) -> [i16; 3]) -> Vec<u8> {
    let values = (0..PER_PAYLOAD).flat_map(value);
    let values: Vec<u8> = values.flat_map(i16::to_be_bytes).collect();
    let scale = klv("SCAL", b's', 2, &scale.to_be_bytes());
    klv("STRM", 0, 1, &[scale, klv(key, b's', 6, &values)].concat())
}

/// The camera's settings in the box `udta`, with a readout time of 24 ms.
fn settings() -> Vec<u8> {
    let readout = klv("SROT", b'f', 4, &24.0f32.to_be_bytes());
    mp4_box("udta", &mp4_box("GPMF", &klv("DEVC", 0, 1, &readout)))
}

/// A video of a HERO5, upright: three seconds at rest, then four with an even turn to the left of
/// 0.5 rad/s, with a bias of 0.01 and noise of 0.001 rad/s.
fn video(format: &str) -> Vec<u8> {
    let payload = |second: usize| {
        let turn = if second < 3 { 0 } else { 5000 };
        let device = [
            klv("DVNM", b'c', 6, b"Camera"),
            stream("ACCL", 418, |_| [4099, 0, 0]),
            stream("GYRO", 10_000, |k| {
                let noise = [0, 1, 0, -1][k % 4];
                [turn + 100 + 10 * noise, 100 - 10 * noise, 100 + 10 * noise]
            }),
        ];
        klv("DEVC", 0, 1, &device.concat())
    };
    let payloads: Vec<Vec<u8>> = (0..7).map(payload).collect();
    let size = payloads[0].len() as u32;
    let description = [&words(&[0, 1, 16])[..], format.as_bytes(), &[0; 8]].concat();
    let table = [
        mp4_box("stsd", &description),
        mp4_box("stts", &words(&[0, 1, 7, 1000])),
        mp4_box("stsc", &words(&[0, 1, 1, 7, 1])),
        mp4_box("stsz", &words(&[0, size, 7])),
        mp4_box("stco", &words(&[0, 1, 20])),
    ];
    let media = [
        mp4_box("mdhd", &words(&[0, 0, 0, 1000, 7000, 0])),
        mp4_box("minf", &mp4_box("stbl", &table.concat())),
    ];
    let index = [
        settings(),
        mp4_box("trak", &mp4_box("mdia", &media.concat())),
    ];
    let parts = [
        mp4_box("ftyp", b"mp41"),
        mp4_box("mdat", &payloads.concat()),
        mp4_box("moov", &index.concat()),
    ];
    parts.concat()
}

#[test]
fn a_gopros_own_video_makes_poses() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("GX010001.MP4");
    let out = dir.path().join("poses.tum");
    let all = [
        "gyro",
        text(&path),
        "--frames",
        "3",
        "--fps",
        "1",
        "--out",
        text(&out),
    ];
    let all = [
        &all[..],
        &["--time-offset-s", "4", "--rest-span-s", "0.1,2.9"],
    ]
    .concat();
    std::fs::write(&path, video("gpmd")).unwrap();
    let said = succeed(&all);
    assert!(
        said.contains("100.0 per second") && said.contains("under [camera]: readout_ms = 24"),
        "{said}"
    );
    let said = succeed(&[&all[..], &["--json"]].concat());
    let said: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(said["readout_ms"], 24.0);
    let poses = poses_of(&tum::read(&out).unwrap());
    // To the left is about −y of the camera.
    let turned = (poses[0].r_wc.inverse() * poses[2].r_wc).scaled_axis();
    assert!((turned + Vector3::y()).norm() < 1e-3, "{turned}");
    // Gravity gives the first angle: the camera is upright, and the bottom is at θ = 90°.
    succeed(&[&all[..], &["--down-deg", "90", "--roll-deg", "90"]].concat());
    let upright = poses_of(&tum::read(&out).unwrap());
    let down: UnitQuaternion<f64> = upright[0].r_wc;
    assert!((down * Vector3::y() - Vector3::x()).norm() < 0.01, "{down}");

    std::fs::write(&path, video("fdsc")).unwrap();
    let message = fail(&all, 3);
    assert!(message.contains("has no track `gpmd`"), "{message}");
}

/// Writes a video of some frames whose index begins with the settings of a GoPro.
fn write_video_with_settings(path: &Path) {
    let pictures = blender_survey().join("frames/%06d.jpg");
    let output = Command::new("ffmpeg")
        .args(["-v", "error", "-nostdin", "-framerate", "1", "-i"])
        .args([text(&pictures), "-frames:v", "3", text(path)])
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let mut video = std::fs::read(path).unwrap();
    // The index is the last box.
    let at = video.windows(4).rposition(|word| word == b"moov").unwrap();
    let size = (video.len() - at + 4 + settings().len()) as u32;
    video[at - 4..at].copy_from_slice(&size.to_be_bytes());
    video.splice(at + 4..at + 4, settings());
    std::fs::write(path, video).unwrap();
}

#[test]
fn init_writes_the_readout_time_that_a_video_states() {
    if is_ffmpeg_missing() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    write_video_with_settings(&dir.path().join("GX010001.MP4"));
    let camera = blender_survey().join("camera.json");
    std::fs::copy(camera, dir.path().join("camera.json")).unwrap();
    let arguments = ["init", text(dir.path()), "--radius-m", "3"];
    let said = succeed(&arguments);
    let survey = std::fs::read_to_string(dir.path().join("survey.toml")).unwrap();
    assert!(survey.contains("\nreadout_ms = 24 "), "{said} {survey}");
}

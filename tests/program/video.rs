//! Frames from a video, through the program. Needs `ffmpeg` and `ffprobe`.

use crate::support::missing::is_ffmpeg_missing;
use crate::support::{blender_survey, edit, fail, simulate, succeed, text, wall_px};
use image::imageops::FilterType;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use tunnelstitch::frames::Video;

/// Runs ffmpeg and returns its standard output.
fn ffmpeg(arguments: &[&str]) -> Vec<u8> {
    let output = Command::new("ffmpeg")
        .args(["-v", "error", "-nostdin", "-y"])
        .args(arguments)
        .output()
        .expect("ffmpeg starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {said}");
    output.stdout
}

/// Creates a video of numbered pictures, one per second.
fn video_of(pattern: &Path, video: &Path, codec: &[&str]) {
    let mut arguments = vec!["-framerate", "1", "-i", text(pattern)];
    arguments.extend(codec);
    arguments.push(text(video));
    ffmpeg(&arguments);
}

const LOSSLESS: [&str; 4] = ["-c:v", "ffv1", "-pix_fmt", "gray"];
/// Encoder options with references over a dozen pictures, forwards and backwards, and across key
/// pictures.
const ENTANGLED: [&str; 12] = [
    "-c:v",
    "libx264",
    "-crf",
    "0",
    "-pix_fmt",
    "gray",
    "-bf",
    "3",
    "-g",
    "12",
    "-x264-params",
    "open-gop=1:scenecut=0",
];

/// So many small frames of a brick tunnel.
fn simulated(folder: &Path, frames: &str) -> PathBuf {
    let out = folder.join("survey");
    simulate(&out, &["--frames", frames, "--size", "160x120"]);
    out
}

/// Replaces a survey's frames by a video of them.
fn into_video(survey: &Path, name: &str, codec: &[&str]) {
    let frames = survey.join("frames");
    video_of(&frames.join("%06d.png"), &survey.join(name), codec);
    let video = format!("video = \"{name}\"");
    edit(
        &survey.join("survey.toml"),
        "images = \"frames/*.png\"",
        &video,
    );
}

/// Pictures requested in any order, by any number of threads, equal those decoded in sequence.
#[test]
fn every_picture_is_the_one_asked_for() {
    if is_ffmpeg_missing() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let frame = |k: usize| dir.path().join(format!("{k:06}.png"));
    for k in 0..24 {
        let from = blender_survey().join(format!("frames/{k:06}.jpg"));
        image::open(from)
            .unwrap()
            .resize(160, 120, FilterType::Triangle)
            .to_luma8()
            .save(frame(k))
            .unwrap();
    }
    let pattern = dir.path().join("%06d.png");
    for (name, codec) in [
        ("a.mkv", &LOSSLESS[..]),
        ("b.mp4", &ENTANGLED),
        ("c.avi", &["-c:v", "mjpeg", "-q:v", "2"]),
    ] {
        let path = dir.path().join(name);
        video_of(&pattern, &path, codec);
        let video = Video::open(&path).unwrap();
        assert_eq!((video.pictures(), video.size()), (24, (160, 120)));
        let grey = ["-f", "rawvideo", "-pix_fmt", "gray", "-"];
        let colour = [
            "-sws_flags",
            "bitexact+accurate_rnd+full_chroma_int",
            "-f",
            "rawvideo",
            "-pix_fmt",
            "rgb24",
            "-",
        ];
        let is_grey = video.colour() == image::ColorType::L8;
        let raw: &[&str] = if is_grey { &grey } else { &colour };
        let all = ffmpeg(&[&["-i", text(&path)], raw].concat());
        let sequence: Vec<&[u8]> = all.chunks_exact(all.len() / 24).collect();
        let same = |k: usize| video.decode(k).unwrap().as_bytes() == sequence[k];
        for k in (0..300)
            .map(|k| (k * k + 7 * k) % 24)
            .take(20)
            .chain(0..24)
            .chain([23, 0, 22])
        {
            assert!(same(k), "{name}: picture {k}");
            assert_eq!(video.time_s(k), k as f64);
        }
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let same = &same;
                scope.spawn(move || {
                    for k in (0..6).map(|k| (13 * thread + 5 * k) % 24) {
                        assert!(same(k), "{name}: picture {k}");
                    }
                });
            }
        });
        if codec == LOSSLESS {
            for k in [0, 17, 23] {
                assert_eq!(video.decode(k).unwrap(), image::open(frame(k)).unwrap());
            }
        }
    }
}

/// The refined poses, with the wall as given, and their error on it, pixels.
fn refined(survey: &Path) -> (String, f64) {
    let out = survey.join("refined");
    let refine = ["refine", text(survey), "--out", text(&out), "--quiet"];
    succeed(&[&refine[..], &["--shape", "fixed"]].concat());
    let poses = out.join("poses.tum");
    let error_px = wall_px(survey, &poses);
    (std::fs::read_to_string(poses).unwrap(), error_px)
}

#[test]
fn a_video_refines_as_its_pictures_do() {
    if is_ffmpeg_missing() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let survey = simulated(dir.path(), "14");
    let toml = survey.join("survey.toml");
    let pictures = std::fs::read_to_string(&toml).unwrap();
    let (expected, error_px) = refined(&survey);
    into_video(&survey, "lossless.mkv", &LOSSLESS);
    assert_eq!(refined(&survey).0, expected);
    // Associated by the video's times as well.
    edit(&toml, "[poses]", "[poses]\nassociate = \"time\"");
    assert_eq!(refined(&survey).0, expected);
    let run = std::fs::read_to_string(survey.join("refined/run.toml")).unwrap();
    let hash = blake3::hash(&std::fs::read(survey.join("lossless.mkv")).unwrap());
    assert!(
        run.contains("lossless.mkv") && run.contains(hash.to_hex().as_str()),
        "{run}"
    );
    // A quarter of the bits of the wall's own noise.
    std::fs::write(&toml, &pictures).unwrap();
    into_video(
        &survey,
        "lossy.mp4",
        &["-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p"],
    );
    let (_, lossy_px) = refined(&survey);
    println!("wall error: pictures {error_px:.4} px, video at crf 16 {lossy_px:.4} px");
    assert!(lossy_px < 2.0 * error_px, "{lossy_px} {error_px}");
}

#[test]
fn every_command_takes_a_video() {
    if is_ffmpeg_missing() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let survey = simulated(dir.path(), "24");
    into_video(
        &survey,
        "survey.mp4",
        &["-c:v", "libx264", "-crf", "8", "-pix_fmt", "yuv420p"],
    );
    std::fs::remove_dir_all(survey.join("frames")).unwrap();
    std::fs::remove_file(survey.join("survey.toml")).unwrap();
    let folder = text(&survey);
    let said = succeed(&["init", folder, "--radius-m", "3"]);
    assert!(
        said.contains("survey.mp4 (24 pictures, 160 × 120 px)") && said.contains("next: "),
        "{said}"
    );
    let out = |name: &str| survey.join(name).to_str().unwrap().to_owned();
    let (refined, poses) = (out("refined"), out("refined/poses.tum"));
    for arguments in [
        &["check", folder][..],
        &["config", folder],
        &["refine", folder, "--fast", "--out", &refined],
        &[
            "stitch",
            folder,
            "--poses",
            &poses,
            "--out",
            &out("after.png"),
            "--px-per-metre",
            "20",
        ],
        &[
            "compare",
            folder,
            "--refined",
            &poses,
            "--out",
            &out("compared"),
            "--px-per-metre",
            "20",
        ],
        &[
            "report",
            folder,
            "--refined",
            &refined,
            "--out",
            &out("report"),
        ],
        &["locate", folder, "--frame", "000003,100,100"],
        &[
            "convert",
            folder,
            "--to",
            "nerfstudio",
            "--out",
            &out("transforms.json"),
        ],
        &[
            "refine",
            folder,
            "--out",
            &out("calibrated"),
            "--fast",
            "--calibrate",
            "focal",
        ],
        &[
            "stitch",
            &out("calibrated"),
            "--poses",
            &out("calibrated/poses.tum"),
            "--out",
            &out("again.png"),
            "--px-per-metre",
            "20",
        ],
    ] {
        succeed(arguments);
    }
    // Every other picture, by its time.
    let said = succeed(&[
        "init",
        folder,
        "--radius-m",
        "3",
        "--video",
        &out("survey.mp4"),
        "--every",
        "2",
        "--force",
    ]);
    assert!(said.contains("12 of every 2"), "{said}");
    let check: Value = serde_json::from_str(&succeed(&["check", folder, "--json"])).unwrap();
    assert_eq!(check["frames"], 12);
    let step_deg = |check: &Value| check["poses"]["step_deg"].as_f64().unwrap();
    assert!((step_deg(&check) - 60.0).abs() < 0.01, "{check}");
    // Keyframes by the angle.
    edit(
        &survey.join("survey.toml"),
        "every = 2",
        "angle_step_deg = 50.0 #",
    );
    let again: Value = serde_json::from_str(&succeed(&["check", folder, "--json"])).unwrap();
    assert_eq!(
        (&again["frames"], step_deg(&again)),
        (&check["frames"], step_deg(&check))
    );
}

#[test]
fn pictures_are_turned_as_players_show_them() {
    if is_ffmpeg_missing() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let (upright, turned, shown) = (path("a.mp4"), path("b.mp4"), path("shown.png"));
    video_of(
        &blender_survey().join("frames/%06d.jpg"),
        &upright,
        &ENTANGLED,
    );
    // The message depends on the version.
    let copy = ["-i", text(&upright), "-c", "copy"];
    let old = ["-metadata:s:v:0", "rotate=90", text(&turned)];
    ffmpeg(&[&copy[..], &old].concat());
    if Video::open(&turned).unwrap().rotation_deg() == 0 {
        let new = [&["-display_rotation", "90"], &copy[..], &[text(&turned)]];
        ffmpeg(&new.concat());
    }
    let video = Video::open(&turned).unwrap();
    assert_eq!(video.size(), (360, 480));
    assert!([90, 270].contains(&video.rotation_deg()));
    let first = [
        "-i",
        text(&turned),
        "-frames:v",
        "1",
        "-pix_fmt",
        "gray",
        text(&shown),
    ];
    ffmpeg(&first);
    let shown = image::open(shown).unwrap().to_luma8();
    assert_eq!(video.decode(0).unwrap().to_luma8(), shown);
}

#[test]
fn what_is_wrong_with_a_video_is_said() {
    if is_ffmpeg_missing() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let survey = simulated(dir.path(), "24");
    let toml = survey.join("survey.toml");
    into_video(&survey, "a.mkv", &LOSSLESS);
    let sound = std::fs::read(survey.join("a.mkv")).unwrap();
    let sound_toml = std::fs::read_to_string(&toml).unwrap();
    ffmpeg(&[
        "-f",
        "lavfi",
        "-i",
        "sine=duration=1",
        text(&survey.join("sound.mkv")),
    ]);
    let refine = |expected: &[&str]| {
        let message = fail(
            &["refine", text(&survey), "--out", text(&survey.join("out"))],
            3,
        );
        for part in expected {
            assert!(message.contains(part), "no {part:?} in {message}");
        }
        std::fs::write(survey.join("a.mkv"), &sound).unwrap();
        std::fs::write(&toml, &sound_toml).unwrap();
    };
    std::fs::write(survey.join("a.mkv"), &sound[..sound.len() / 2]).unwrap();
    refine(&["a.mkv", "cut off", "copy it again"]);
    std::fs::write(survey.join("a.mkv"), "no video").unwrap();
    refine(&["a.mkv", "not a video"]);
    let frames = survey.join("frames/%06d.png");
    let entangled = survey.join("b.mp4");
    video_of(&frames, &entangled, &ENTANGLED);
    let mut damaged = std::fs::read(&entangled).unwrap();
    let length = damaged.len();
    damaged[length / 2..][..length / 5].fill(0);
    std::fs::write(&entangled, &damaged).unwrap();
    edit(&toml, "a.mkv", "b.mp4");
    refine(&["b.mp4/0000", "the video is damaged"]);
    std::fs::write(&entangled, &damaged[..length / 2]).unwrap();
    edit(&toml, "a.mkv", "b.mp4");
    refine(&["b.mp4", "cut off before its end", "copy it again"]);
    edit(&toml, "a.mkv", "sound.mkv");
    refine(&["sound.mkv", "no video stream"]);
    edit(&toml, "a.mkv", "gone.mkv");
    refine(&["gone.mkv", "relative to survey.toml"]);
    edit(&toml, "\"a.mkv\"", "\"a.mkv\"\nevery = 2");
    refine(&["baseline.tum", "24 poses for 12 frames", "--associate time"]);
    edit(&toml, "\"a.mkv\"", "\"a.mkv\"\nevery = 0");
    refine(&["survey.toml", "every is 0"]);
    edit(&toml, "\"a.mkv\"", "\"a.mkv\"\nimages = \"*.jpg\"");
    refine(&["survey.toml", "more than one of images, video and bag"]);
    edit(&toml, "video = \"a.mkv\"", "");
    refine(&["survey.toml", "neither images", "nor video"]);
    let without = Command::new(env!("CARGO_BIN_EXE_tunnelstitch"))
        .args(["check", text(&survey)])
        .env("PATH", dir.path())
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&without.stderr);
    assert_eq!(without.status.code(), Some(3), "{message}");
    assert!(
        message.contains("ffprobe") && message.contains("install ffmpeg"),
        "{message}"
    );
}

/// Playlists name other files, which are not of the survey.
#[test]
fn lists_of_other_files_are_refused() {
    if is_ffmpeg_missing() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let survey = simulated(dir.path(), "3");
    into_video(&survey, "v.mkv", &LOSSLESS);
    let outside = dir.path().join("secret.mkv");
    std::fs::rename(survey.join("v.mkv"), &outside).unwrap();
    let playlist = format!(
        "#EXTM3U\n#EXT-X-TARGETDURATION:24\n#EXTINF:24,\n{}\n#EXT-X-ENDLIST\n",
        text(&outside)
    );
    let concat = format!("ffconcat version 1.0\nfile '{}'\n", text(&outside));
    for (name, content) in [("x.m3u8", playlist.as_str()), ("v.mkv", concat.as_str())] {
        std::fs::write(survey.join(name), content).unwrap();
        edit(
            &survey.join("survey.toml"),
            "video = \"",
            &format!("video = \"{name}\" # "),
        );
        let message = fail(&["check", text(&survey)], 3);
        assert!(
            message.contains(name) && message.contains("list of other files"),
            "{message}"
        );
    }
    // A pattern of pictures is no file.
    edit(
        &survey.join("survey.toml"),
        "video = \"",
        "video = \"frames/%06d.png\" # ",
    );
    let message = fail(&["check", text(&survey)], 3);
    assert!(message.contains("frames.video is relative"), "{message}");
}

/// Folders whose names look like addresses or options are folders.
#[test]
fn folders_may_look_like_addresses() {
    if is_ffmpeg_missing() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let survey = simulated(dir.path(), "3");
    into_video(&survey, "v.mkv", &LOSSLESS);
    std::fs::create_dir(dir.path().join("http:")).unwrap();
    for name in ["http:/127.0.0.1:18999", "a:b", "-dash"] {
        std::fs::rename(&survey, dir.path().join(name)).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_tunnelstitch"))
            .args(["check", "--", name])
            .current_dir(dir.path())
            .output()
            .unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{name}: {message}");
        std::fs::rename(dir.path().join(name), &survey).unwrap();
    }
}

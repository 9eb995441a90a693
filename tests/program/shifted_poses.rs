//! Initial poses that belong to the frames some places later or earlier.

use crate::support::{edit, fail, simulate, succeed, text};
use serde_json::Value;
use std::ops::Range;
use std::path::Path;
use tunnelstitch::trajectory::tum;

/// Frames of a survey.
const COUNT: usize = 24;
/// Poses that the carrier has before the first frame and after the last.
const MARGIN: usize = 3;

/// A survey of [`COUNT`] frames and the initial poses around them.
struct Shiftable {
    folder: tempfile::TempDir,
    /// Initial poses of a carrier that starts before the first frame and ends after the last.
    poses: Vec<String>,
}

impl Shiftable {
    /// Keeps the frames of a simulated survey that a carrier meets which turns by 10° and more from
    /// frame to frame, `steps` times as much.
    fn new(steps: impl Iterator<Item = usize>) -> Self {
        let kept = steps.take(COUNT + 2 * MARGIN).scan(0, |place, step| {
            let own = *place;
            *place += step;
            Some(own)
        });
        let kept: Vec<usize> = kept.collect();
        let folder = tempfile::tempdir().unwrap();
        let survey = folder.path();
        let frames = (kept[kept.len() - 1] + 1).to_string();
        let motion = ["--turn-deg", "10", "--advance-m", "0.03"];
        let noise = ["--rotation-sigma-deg", "0.5", "--translation-sigma-m"];
        let more = [
            "0.005,0.005,0.005",
            "--frames",
            &frames,
            "--size",
            "160x120",
        ];
        simulate(survey, &[&motion[..], &noise, &more, &["--force"]].concat());
        let shown = &kept[MARGIN..MARGIN + COUNT];
        for entry in std::fs::read_dir(survey.join("frames")).unwrap() {
            let path = entry.unwrap().path();
            let stem = path.file_stem().unwrap().to_str().unwrap();
            if !shown.contains(&stem.parse().unwrap()) {
                std::fs::remove_file(&path).unwrap();
            }
        }
        let lines = |name: &str, kept: &[usize]| -> Vec<String> {
            let text = std::fs::read_to_string(survey.join(name)).unwrap();
            let lines: Vec<&str> = text.lines().collect();
            kept.iter().map(|k| format!("{}\n", lines[*k])).collect()
        };
        let poses = lines("baseline.tum", &kept);
        let truth = lines("groundtruth.tum", shown).concat();
        std::fs::write(survey.join("groundtruth.tum"), truth).unwrap();
        // Of three and four steps of the simulation.
        let toml = survey.join("survey.toml");
        edit(
            &toml,
            "rotation_sigma_deg = 0.5",
            "rotation_sigma_deg = 1.0",
        );
        Self { folder, poses }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Writes the initial poses such that they belong to the frames so many places later.
    fn write_poses(&self, shift_frames: isize) {
        let first = MARGIN.checked_add_signed(shift_frames).unwrap();
        let own: Range<usize> = first..first + COUNT;
        std::fs::write(self.path().join("baseline.tum"), self.poses[own].concat()).unwrap();
    }

    /// The readings that `check` names, as JSON.
    fn readings(&self) -> Value {
        let said = succeed(&["check", text(self.path()), "--json"]);
        let mut check: Value = serde_json::from_str(&said).unwrap();
        check["readings"].take()
    }
}

/// Slow, fast and slow again: `check` names the shift with its line, and is silent with that line.
#[test]
fn a_shift_is_named_where_the_motion_varies_and_its_line_mends_it() {
    let pattern = [1, 1, 4, 4, 4, 1, 4, 1, 1, 1, 4, 4, 1, 1, 4];
    let survey = Shiftable::new(pattern.into_iter().cycle());
    survey.write_poses(0);
    assert_eq!(survey.readings(), Value::Null);
    let toml = survey.path().join("survey.toml");
    let right = std::fs::read_to_string(&toml).unwrap();
    for (shift_frames, named) in [(2, "2 frames later"), (-2, "2 frames earlier")] {
        survey.write_poses(shift_frames);
        let line = format!("shift_frames = {shift_frames}");
        let expected = format!("the poses {named} ({line} under [poses])");
        let readings = survey.readings()["readings"].take();
        assert_eq!(readings, Value::from(vec![expected]));
        edit(&toml, "[poses]", &format!("[poses]\n{line}"));
        assert_eq!(survey.readings(), Value::Null, "{shift_frames}");
        std::fs::write(&toml, &right).unwrap();
    }
}

/// A constant motion has the right poses in every shift, but for a motion along the wall.
#[test]
fn nothing_tells_a_shift_of_a_constant_motion() {
    let survey = Shiftable::new(std::iter::repeat(3));
    for shift_frames in [0, 2] {
        survey.write_poses(shift_frames);
        assert_eq!(survey.readings(), Value::Null, "{shift_frames}");
    }
}

/// The frames at an end that have no pose go on, and are named; true poses stay with their frames.
#[test]
fn shifted_poses_go_on_at_the_ends() {
    let survey = Shiftable::new(std::iter::repeat(3));
    let toml = survey.path().join("survey.toml");
    let right = std::fs::read_to_string(&toml).unwrap();
    let convert = |poses: &str, name: &str| {
        let out = survey.path().join(name);
        let arguments = [
            "convert",
            text(survey.path()),
            "--poses",
            poses,
            "--to",
            "tum",
        ];
        succeed(&[&arguments[..], &["--out", text(&out)]].concat());
        tum::read(&out).unwrap()
    };
    survey.write_poses(0);
    let initial = convert("initial", "initial.tum");
    let truth = convert("truth", "truth.tum");
    survey.write_poses(2);
    edit(&toml, "[poses]", "[poses]\nshift_frames = 2");
    assert_eq!(convert("truth", "unmoved.tum"), truth);
    for (read, expected) in convert("initial", "moved.tum").iter().zip(&initial) {
        assert!(read.pose.local(&expected.pose).norm() < 1e-9);
    }
    let said = succeed(&["check", text(survey.path()), "--json"]);
    assert!(said.contains("2 of 24 frames"), "{said}");
    std::fs::write(&toml, &right).unwrap();
    edit(&toml, "[poses]", "[poses]\nshift_frames = -13");
    let message = fail(&["check", text(survey.path())], 3);
    assert!(
        message.contains("poses.shift_frames = -13") && message.contains("at most 12"),
        "{message}"
    );
}

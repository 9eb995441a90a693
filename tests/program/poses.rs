//! Poses in other formats and conventions, through the program.

use crate::support::{self, edit, fail, first_frames, simulate, succeed, text};
use std::path::{Path, PathBuf};
use tunnelstitch::trajectory::{
    CameraAxes, Pose, StampedPose, Trajectory, TunnelAxis, poses_of, se3, so3, tum,
};

/// The writable formats and their file names.
const FORMATS: [(&str, &str); 5] = [
    ("tum", "out.tum"),
    ("kitti", "out.txt"),
    ("csv", "out.csv"),
    ("colmap", "sparse"),
    ("nerfstudio", "transforms.json"),
];

fn convert(survey: &Path, poses: &str, to: &str, out: &Path, more: &[&str]) {
    let arguments = [
        "convert",
        text(survey),
        "--poses",
        poses,
        "--to",
        to,
        "--out",
        text(out),
    ];
    succeed(&[&arguments, more].concat());
}

/// Reads the poses of a file through the program.
fn read_by_the_program(survey: &Path, file: &Path, more: &[&str]) -> Trajectory {
    let out = survey.join("read.tum");
    convert(survey, text(file), "tum", &out, more);
    tum::read(&out).unwrap()
}

#[track_caller]
fn assert_same(a: &[StampedPose], b: &[StampedPose], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    for (k, (a, b)) in a.iter().zip(b).enumerate() {
        let off = a.pose.local(&b.pose).norm();
        assert!(off < tolerance, "frame {k} is off by {off}");
    }
}

fn panorama(survey: &Path, poses: &str, more: &[&str]) -> Vec<u8> {
    let out = survey.join("panorama.png");
    let arguments = [
        "stitch",
        text(survey),
        "--poses",
        poses,
        "--px-per-metre",
        "20",
        "--out",
        text(&out),
    ];
    succeed(&[&arguments, more].concat());
    std::fs::read(&out).unwrap()
}

fn write_tum(path: &Path, poses: impl IntoIterator<Item = StampedPose>) {
    let trajectory: Trajectory = poses.into_iter().collect();
    std::fs::write(path, tum::format(&trajectory)).unwrap();
}

fn mapped(trajectory: &[StampedPose], map: impl Fn(&Pose) -> Pose) -> Vec<StampedPose> {
    let stamped = |s: &StampedPose| StampedPose {
        pose: map(&s.pose),
        ..*s
    };
    trajectory.iter().map(stamped).collect()
}

/// One survey with its poses in each format: the same poses, and the same panorama to the byte.
#[test]
fn every_format_gives_the_same_panorama() {
    let survey = first_frames(6);
    let dir = survey.path();
    let truth = tum::read(&dir.join("groundtruth.tum")).unwrap();
    let expected = panorama(dir, "truth", &[]);
    for (format, name) in FORMATS {
        let file = dir.join(name);
        convert(dir, "truth", format, &file, &[]);
        assert_same(&read_by_the_program(dir, &file, &[]), &truth, 1e-9);
        let named = read_by_the_program(dir, &file, &["--pose-format", format]);
        assert_same(&named, &truth, 1e-9);
        assert!(panorama(dir, text(&file), &[]) == expected, "{format}");
    }
    // Also as the survey's own poses.
    edit(&dir.join("survey.toml"), "groundtruth.tum", "sparse");
    edit(&dir.join("survey.toml"), "baseline.tum", "transforms.json");
    for poses in ["truth", "initial"] {
        assert!(panorama(dir, poses, &[]) == expected, "{poses}");
    }
}

/// Names associate poses with frames in any order, and poses of other frames are ignored.
#[test]
fn names_in_another_order_change_nothing() {
    let survey = first_frames(5);
    let dir = survey.path();
    let truth = tum::read(&dir.join("groundtruth.tum")).unwrap();
    let (csv, sorted) = (dir.join("poses.csv"), dir.join("sorted.csv"));
    convert(dir, "truth", "csv", &sorted, &[]);
    let text_of = std::fs::read_to_string(&sorted).unwrap();
    // Without times, which would have to increase.
    let without_time = |line: &str| {
        let words: Vec<&str> = line.split(',').collect();
        [&words[..1], &words[2..]].concat().join(",")
    };
    let mut lines: Vec<String> = text_of.lines().map(without_time).collect();
    lines[1..].reverse();
    lines.push("elsewhere/999.jpg,0,0,0,0,0,0,1".to_owned());
    std::fs::write(&csv, lines.join("\r\n")).unwrap();
    assert_same(&read_by_the_program(dir, &csv, &[]), &truth, 1e-9);
    let out = dir.join("o.tum");
    let arguments = [
        "convert",
        text(dir),
        "--poses",
        text(&csv),
        "--to",
        "tum",
        "--out",
        text(&out),
    ];
    let message = fail(&[&arguments[..], &["--associate", "order"]].concat(), 3);
    assert!(message.contains("6 poses for 5 frames"), "{message}");
    lines.remove(2);
    std::fs::write(&csv, lines.join("\n")).unwrap();
    let message = fail(&arguments, 3);
    assert!(message.contains("no pose of frame 3"), "{message}");
    assert!(!out.exists());
}

/// Renames the frames to their times, nanoseconds.
fn rename_by_time(dir: &Path, times_ns: &[u64]) {
    for (k, time_ns) in times_ns.iter().enumerate() {
        let from = dir.join(format!("frames/{k:06}.jpg"));
        std::fs::rename(from, dir.join(format!("frames/{time_ns}.jpg"))).unwrap();
    }
}

/// EuRoC's poses of a body in another world at a higher rate than the frames: associated by time,
/// mounted, and transformed to the tunnel's frame.
#[test]
fn a_bodys_poses_in_another_world_are_found_by_time() {
    let survey = first_frames(4);
    let dir = survey.path();
    let truth = tum::read(&dir.join("groundtruth.tum")).unwrap();
    let camera_in_body = Pose::new(
        so3::exp(&nalgebra::Vector3::new(0.3, -1.2, 0.8)),
        nalgebra::Vector3::new(0.02, -0.06, 0.11),
    );
    let axis = TunnelAxis {
        point_m: [100.0, -20.0, 3.0],
        axis: [0.6, 0.8, 0.02],
        theta_zero: Some([0.0, 0.0, 1.0]),
    };
    let world = axis.frame().unwrap();
    let body = |pose: &Pose| world.after(pose).after(&camera_in_body.inverse());
    // A frame every 200 ms; the body's poses 80 ms before each and 40 ms after, interpolated to the
    // neighbours.
    let begin_ns = 1_403_636_580_000_000_000u64;
    let frame_ns: Vec<u64> = (0..4).map(|k| begin_ns + k * 200_000_000).collect();
    rename_by_time(dir, &frame_ns);
    let poses = poses_of(&truth);
    let step = |k: usize, share: f64| {
        let k = k.clamp(0, poses.len() - 2);
        se3::between(&poses[k], &poses[k + 1], share).unwrap()
    };
    let mut lines = vec!["#timestamp [ns],x,y,z,qw,qx,qy,qz".to_owned()];
    for (k, time_ns) in frame_ns.iter().enumerate() {
        // On the screw through this frame and the next, or the one before the last.
        let (from, base) = if k + 1 < poses.len() {
            (k, 0.0)
        } else {
            (k - 1, 1.0)
        };
        for (off_ns, share) in [(-80_000_000i64, -0.4), (40_000_000, 0.2)] {
            let pose = body(&step(from, base + share));
            let (t, q) = (pose.t_wc, pose.r_wc);
            let at = time_ns.checked_add_signed(off_ns).unwrap();
            lines.push(format!(
                "{at},{},{},{},{},{},{},{}",
                t.x, t.y, t.z, q.w, q.i, q.j, q.k
            ));
        }
    }
    let write = |name: &str, text: String| -> PathBuf {
        std::fs::write(dir.join(name), text).unwrap();
        dir.join(name)
    };
    let poses_file = write("data.csv", lines.join("\n"));
    let r = camera_in_body.r_wc.to_rotation_matrix();
    let row = |k: usize| {
        format!(
            "{}, {}, {}, {}",
            r[(k, 0)],
            r[(k, 1)],
            r[(k, 2)],
            camera_in_body.t_wc[k]
        )
    };
    let sensor = format!(
        "T_BS:\n  cols: 4\n  data: [{},\n {},\n {}, 0, 0, 0, 1]\n",
        row(0),
        row(1),
        row(2)
    );
    let (mount, axis) = (
        write("sensor.yaml", sensor),
        write("axis.json", serde_json::to_string(&axis).unwrap()),
    );
    let by_time = [
        "--associate",
        "time",
        "--interpolate",
        "--time-tolerance-s",
        "0.05",
        "--body-to-camera",
        text(&mount),
        "--tunnel-frame",
        text(&axis),
    ];
    let found = read_by_the_program(dir, &poses_file, &by_time);
    // Seconds since 1970 as doubles are a quarter of a microsecond apart: 1e-6 of a step.
    assert_same(&found, &truth, 3e-6);
    assert_eq!(found[1].time_s, 1403636580.2);

    // With options from survey.toml.
    let toml = dir.join("survey.toml");
    edit(&toml, "truth = \"groundtruth.tum\"", "");
    edit(
        &toml,
        "initial = \"baseline.tum\"",
        "initial = \"data.csv\"\nbody_to_camera = \"sensor.yaml\"\ntunnel_frame = \
         \"axis.json\"\nassociate = \"time\"\n\
         time_tolerance_s = 0.05\ninterpolate = true",
    );
    let out = dir.join("initial.tum");
    convert(dir, "initial", "tum", &out, &[]);
    assert_eq!(
        std::fs::read(&out).unwrap(),
        std::fs::read(dir.join("read.tum")).unwrap()
    );

    // Errors: too far in time, beyond the poses, without the mount.
    let arguments = ["convert", text(dir), "--to", "tum", "--out", text(&out)];
    let message = fail(
        &[&arguments[..], &["--time-tolerance-s", "0.02"]].concat(),
        3,
    );
    for part in [
        "frame 0",
        "1403636580 s",
        "nearest pose is at 1403636580.04",
        "0.040000 s away",
    ] {
        assert!(message.contains(part), "no {part:?} in: {message}");
    }
    edit(&toml, "body_to_camera = \"sensor.yaml\"", "");
    let message = fail(&arguments, 3);
    assert!(
        message.contains("--body-to-camera") && message.contains("EuRoC"),
        "{message}"
    );
}

/// Times from a list associate TUM poses with frames that have only numbers.
#[test]
fn a_list_of_times_ties_poses_to_numbered_frames() {
    let survey = first_frames(4);
    let dir = survey.path();
    let truth = tum::read(&dir.join("groundtruth.tum")).unwrap();
    let often = truth.iter().flat_map(|stamped| {
        [0.0, 0.25].map(|off_s| StampedPose {
            time_s: 50.0 + stamped.time_s + off_s,
            ..*stamped
        })
    });
    let poses = dir.join("often.tum");
    write_tum(&poses, often);
    let times = dir.join("times.txt");
    let by_time = ["--associate", "time", "--frame-times", text(&times)];
    std::fs::write(&times, "50.001\n51.002\n52\n53\n").unwrap();
    let found = read_by_the_program(dir, &poses, &by_time);
    assert_same(&found, &truth, 1e-12);
    assert_eq!(found[1].time_s, 51.002);
    let out = dir.join("o.tum");
    let arguments = [
        "convert",
        text(dir),
        "--poses",
        text(&poses),
        "--to",
        "tum",
        "--out",
        text(&out),
    ];
    let message = fail(&[&arguments[..], &["--associate", "time"]].concat(), 3);
    assert!(
        message.contains("frame 0") && message.contains("--frame-times"),
        "{message}"
    );
    let message = fail(&arguments, 3);
    assert!(
        message.contains("8 poses for 4 frames") && message.contains("--associate time"),
        "{message}"
    );

    // In milliseconds, which the error names with the key.
    std::fs::write(&times, "50000\n51000\n52000\n53000\n").unwrap();
    let message = fail(&[&arguments[..], &by_time].concat(), 3);
    let line = "time_unit = \"ms\"";
    assert!(
        message.contains(&format!("milliseconds ({line} under [frames]")),
        "{message}"
    );
    edit(
        &dir.join("survey.toml"),
        "[frames]",
        &format!("[frames]\n{line}"),
    );
    assert_same(&read_by_the_program(dir, &poses, &by_time), &truth, 1e-12);
}

/// Poses as ORB-SLAM3, spreadsheets, ROS and others write them are those of TUM.
#[test]
fn files_of_other_programs_are_read_as_they_are() {
    let survey = first_frames(3);
    let dir = survey.path();
    let truth = tum::read(&dir.join("groundtruth.tum")).unwrap();
    let begin_ns = 1_403_636_579_763_555_584u64;
    let times_ns: Vec<u64> = (0..3).map(|k| begin_ns + k * 50_000_000).collect();
    rename_by_time(dir, &times_ns);
    // Rows of a time, a translation and a quaternion, in one order or the other.
    let rows = |is_w_first: bool, separator: &str| -> Vec<String> {
        let row = |(stamped, time_ns): (&StampedPose, &u64)| {
            let (t, q) = (stamped.pose.t_wc, stamped.pose.r_wc);
            let mut numbers = [t.x, t.y, t.z, q.i, q.j, q.k, q.w];
            if is_w_first {
                numbers[3..].rotate_right(1);
            }
            let words = numbers.iter().map(f64::to_string);
            let words: Vec<String> = std::iter::once(format!("{time_ns}.000000"))
                .chain(words)
                .collect();
            words.join(separator)
        };
        truth.iter().zip(&times_ns).map(row).collect()
    };
    let ros = "%time;field.pose.position.x;field.pose.position.y;field.pose.position.z;\
               field.pose.orientation.x;field.pose.orientation.y;field.pose.orientation.z;\
               field.pose.orientation.w\n";
    let own = "when;east;north;up;qx;qy;qz;q0\n";
    let twice = |mut rows: Vec<String>| {
        rows.insert(1, rows[1].clone());
        rows.join("\n")
    };
    let by_time = ["--associate", "time"];
    let columns = ["--pose-columns", "time_s=when,tx=east,ty=north,tz=up,qw=q0"];
    for (content, more) in [
        (rows(false, " ").join("\n"), &[][..]),
        (rows(false, ", ").join("\n"), &[]),
        (twice(rows(false, "\t")), &[]),
        (
            format!(
                "# time tx ty tz qw qx qy qz\n{}",
                rows(true, " ").join("\n")
            ),
            &[],
        ),
        (rows(true, " ").join("\n"), &["--pose-quaternion", "wxyz"]),
        (
            format!(
                "\u{feff}sep=;\r\n{ros}{}",
                rows(false, ";").join("\r\n").replace('.', ",")
            ),
            &[],
        ),
        (format!("{own}{}", rows(false, ";").join("\n")), &columns),
    ] {
        let poses = dir.join("others.txt");
        std::fs::write(&poses, &content).unwrap();
        let found = read_by_the_program(dir, &poses, &[&by_time[..], more].concat());
        assert_same(&found, &truth, 1e-12);
        assert!(
            (found[1].time_s - 1_403_636_579.813_555_6).abs() < 1e-6,
            "{content}"
        );
    }

    // The keys of survey.toml do what the flags do, and errors name lines and columns.
    let toml = dir.join("survey.toml");
    edit(&toml, "truth = \"groundtruth.tum\"", "");
    edit(
        &toml,
        "initial = \"baseline.tum\"",
        "initial = \"own.csv\"\nassociate = \"time\"\n\
         columns = { time_s = \"when\", tx = \"east\", ty = \"north\", tz = \"up\", qw = \"q0\" }",
    );
    let (own_file, out) = (dir.join("own.csv"), dir.join("own.tum"));
    let content = format!("{own}{}", rows(false, ";").join("\n"));
    std::fs::write(&own_file, &content).unwrap();
    convert(dir, "initial", "tum", &out, &[]);
    assert_same(&tum::read(&out).unwrap(), &truth, 1e-12);
    let arguments = ["convert", text(dir), "--to", "tum", "--out", text(&out)];
    std::fs::write(&own_file, content.replace("north", "south")).unwrap();
    let message = fail(&arguments, 3);
    assert!(
        message.contains("own.csv:1: no column `north`") && message.contains("`east`, `south`"),
        "{message}"
    );
    // A second pose of a time is left out if the prior covers its difference, and refused if not.
    let lines: Vec<&str> = content.lines().collect();
    let words: Vec<&str> = lines[2].split(';').collect();
    let east: f64 = words[1].parse().unwrap();
    let twice = |east: f64| {
        let east = east.to_string();
        let second = [&words[..1], &[east.as_str()], &words[2..]]
            .concat()
            .join(";");
        let mut lines = lines.clone();
        lines.insert(3, &second);
        std::fs::write(&own_file, lines.join("\n")).unwrap();
    };
    twice(east + 0.002);
    let said = support::tunnelstitch(&arguments).stderr;
    let said = String::from_utf8_lossy(&said);
    assert!(
        said.contains("lines 3 and 4 have two poses") && said.contains("2.00 mm"),
        "{said}"
    );
    assert_same(&tum::read(&out).unwrap(), &truth, 1e-12);
    twice(east + 2.0);
    let message = fail(&arguments, 3);
    assert!(
        message.contains("own.csv: lines 3 and 4 have") && message.contains("frame 1 ("),
        "{message}"
    );
}

/// Poses of other conventions are refused with the flag that corrects them, and are correct with
/// it.
#[test]
fn wrong_conventions_are_named_with_their_flags() {
    let survey = first_frames(24);
    let dir = survey.path();
    let truth = tum::read(&dir.join("groundtruth.tum")).unwrap();
    let far = Pose::new(Default::default(), nalgebra::Vector3::new(0.0, 80.0, 0.0));
    let along_x = TunnelAxis {
        point_m: [2.0, 9.0, 0.0],
        axis: [1.0, 0.0, 0.0],
        theta_zero: None,
    };
    let x_frame = along_x.frame().unwrap();
    let poses = dir.join("poses.tum");
    let out = dir.join("o.png");
    let stitch = [
        "stitch",
        text(dir),
        "--poses",
        text(&poses),
        "--out",
        text(&out),
        "--px-per-metre",
        "10",
    ];

    // World-to-camera, with chainage counted from a shaft 80 m away.
    write_tum(&poses, mapped(&truth, |pose| far.after(pose).inverse()));
    let message = fail(&stitch, 3);
    assert!(message.contains("--pose-convention w2c"), "{message}");
    let read = read_by_the_program(dir, &poses, &["--pose-convention", "w2c"]);
    assert_same(&read, &mapped(&truth, |pose| far.after(pose)), 1e-9);

    // The tunnel along the world's x: the message's remedy corrects it.
    write_tum(&poses, mapped(&truth, |pose| x_frame.after(pose)));
    let message = fail(&stitch, 3);
    let told = message.split("with the FILE ").nth(1).expect(&message);
    let axis = dir.join("axis.json");
    std::fs::write(&axis, told).unwrap();
    succeed(&[&stitch[..], &["--tunnel-frame", text(&axis)]].concat());

    // OpenGL's axes are corrected by the flag.
    write_tum(&poses, mapped(&truth, |pose| CameraAxes::OpenGl.turn(pose)));
    let read = read_by_the_program(dir, &poses, &["--camera-axes", "opengl"]);
    assert_same(&read, &truth, 1e-12);

    // The flags override survey.toml for the survey's own poses.
    write_tum(
        &dir.join("baseline.tum"),
        mapped(&truth, |pose| far.after(pose).inverse()),
    );
    edit(&dir.join("survey.toml"), "truth = \"groundtruth.tum\"", "");
    let refined = dir.join("refined");
    let message = fail(&["refine", text(dir), "--out", text(&refined)], 3);
    assert!(
        message.contains("baseline.tum") && message.contains("--pose-convention w2c"),
        "{message}"
    );
    assert!(!refined.exists());
    let initial = dir.join("initial.tum");
    convert(
        dir,
        "initial",
        "tum",
        &initial,
        &["--pose-convention", "w2c"],
    );
    assert_same(
        &tum::read(&initial).unwrap(),
        &mapped(&truth, |pose| far.after(pose)),
        1e-9,
    );
}

/// Planned poses on the axis look at the wall in every convention: the images decide, and each
/// named flag corrects it.
#[test]
fn what_only_pictures_can_tell_is_named_by_refine() {
    let scratch = tempfile::tempdir().unwrap();
    let dir = &scratch.path().join("survey");
    simulate(dir, &["--frames", "14", "--size", "160x120"]);
    let path = dir.join("baseline.tum");
    let planned = tum::read(&path).unwrap();
    write_tum(&path, mapped(&planned, Pose::inverse));
    let out = dir.join("refined");
    let refine = |more: &[&str]| {
        let arguments = ["refine", text(dir), "--fast", "--out", text(&out)];
        let output = support::tunnelstitch(&[&arguments, more].concat());
        assert!(matches!(output.status.code(), Some(0 | 4)));
        String::from_utf8(output.stderr).unwrap()
    };
    let said = refine(&[]);
    assert!(
        said.contains("they agree (7 of 7")
            && said.contains("--pose-convention w2c")
            && said.contains("--camera-axes opengl"),
        "{said}"
    );
    for flag in [["--pose-convention", "w2c"], ["--camera-axes", "opengl"]] {
        let said = refine(&flag);
        assert!(!said.contains("agree with"), "{flag:?}: {said}");
    }
}

/// Poses and pictures in another order, unit or orientation: `check` names the line that mends it,
/// and has nothing to say with that line.
#[test]
fn what_only_pictures_can_tell_is_named_by_check() {
    let scratch = tempfile::tempdir().unwrap();
    let dir = &scratch.path().join("survey");
    simulate(dir, &["--frames", "10", "--size", "240x180"]);
    let (toml, path) = (dir.join("survey.toml"), dir.join("baseline.tum"));
    let planned = tum::read(&path).unwrap();
    let right = std::fs::read_to_string(&toml).unwrap();
    let check = || {
        let said = succeed(&["check", text(dir), "--json"]);
        let check: serde_json::Value = serde_json::from_str(&said).unwrap();
        check["readings"]["readings"].to_string()
    };
    let assert_named = |line: &str, section: &str| {
        let said = check().replace('\\', "");
        assert!(said.contains(line), "{line}: {said}");
        edit(&toml, section, &format!("{section}\n{line}"));
        assert_eq!(check(), "null", "{line}");
        std::fs::write(&toml, &right).unwrap();
    };
    assert_eq!(check(), "null");
    let reversed = planned.iter().zip(planned.iter().rev());
    let reversed = reversed.map(|(at, stamped)| StampedPose {
        time_s: at.time_s,
        ..*stamped
    });
    write_tum(&path, reversed.collect::<Vec<_>>());
    assert_named("reversed = true", "[poses]");
    let in_millimetres = |pose: &Pose| Pose::new(pose.r_wc, 1e3 * pose.t_wc);
    write_tum(&path, mapped(&planned, in_millimetres));
    assert_named("unit_m = 0.001", "[poses]");
    write_tum(&path, planned);
    // A diameter is given for the radius.
    let wide = scratch.path().join("wide");
    let options = ["--frames", "10", "--size", "240x180", "--seed", "2"];
    simulate(&wide, &[&options[..], &["--supersample", "2"]].concat());
    edit(
        &wide.join("survey.toml"),
        "radius_m = 3.0",
        "radius_m = 6.0",
    );
    let said = succeed(&["check", text(&wide), "--json"]);
    assert!(said.contains("radius_m = 3 under [tunnel]"), "{said}");
    for entry in std::fs::read_dir(dir.join("frames")).unwrap() {
        let path = entry.unwrap().path();
        image::open(&path).unwrap().rotate180().save(&path).unwrap();
    }
    assert_named("orientation = \"turned180\"", "[frames]");
}

/// `refine` accepts poses of any format with the same result, to the byte, as from TUM; `compare`
/// reads the output of `convert`.
#[test]
fn refine_and_compare_take_any_format() {
    let survey = first_frames(6);
    let dir = survey.path();
    let refine = |name: &str| {
        let out = dir.join(name);
        succeed(&["refine", text(dir), "--out", text(&out)]);
        std::fs::read(out.join("poses.tum")).unwrap()
    };
    let expected = refine("from-tum");
    convert(dir, "initial", "csv", &dir.join("poses.csv"), &[]);
    edit(&dir.join("survey.toml"), "baseline.tum", "poses.csv");
    assert!(refine("from-csv") == expected);
    let refined = dir.join("from-csv/poses.tum");
    let sparse = dir.join("sparse");
    convert(dir, text(&refined), "colmap", &sparse, &[]);
    let compare = |refined: &Path| -> serde_json::Value {
        let out = dir.join("compared");
        let json = succeed(&[
            "compare",
            text(dir),
            "--refined",
            text(refined),
            "--out",
            text(&out),
            "--px-per-metre",
            "20",
            "--json",
        ]);
        serde_json::from_str(&json).unwrap()
    };
    let scores = |refined: &Path| {
        let report = compare(refined);
        let of = |kind: &str, what: &str| report["refined"][kind][what]["rms"].as_f64().unwrap();
        [
            of("trajectory", "translation_m"),
            of("unaligned", "ape_translation_m"),
            of("unaligned", "rpe_rotation_deg"),
        ]
    };
    let (from_tum, from_colmap) = (scores(&refined), scores(&sparse));
    for (a, b) in from_tum.into_iter().zip(from_colmap) {
        assert!(a > 0.0 && (a - b).abs() < 1e-9, "{a} {b}");
    }
    // Removing the gauge cannot make it worse.
    assert!(from_tum[0] <= from_tum[1] * (1.0 + 1e-6));
}

/// Neither the survey nor other files are replaced.
#[test]
fn convert_replaces_nothing_it_should_not() {
    let survey = first_frames(3);
    let dir = survey.path();
    let to = |format: &str, out: &Path| {
        fail(
            &["convert", text(dir), "--to", format, "--out", text(out)],
            2,
        )
    };
    for name in [
        "baseline.tum",
        "camera.json",
        "frames/000001.jpg",
        "survey.toml",
    ] {
        let message = to("tum", &dir.join(name));
        assert!(message.contains("would replace"), "{message}");
    }
    assert!(to("colmap", dir).contains("would replace"));
    let other = dir.join("other");
    std::fs::create_dir(&other).unwrap();
    std::fs::write(other.join("notes.md"), "x").unwrap();
    assert!(to("colmap", &other).contains("holds other files than"));
    assert!(other.join("notes.md").is_file());
    let model = dir.join("model");
    for _ in 0..2 {
        convert(dir, "initial", "colmap", &model, &[]);
    }
    // The model's three files and the record.
    assert_eq!(support::entries(&model), 4);
    std::fs::write(dir.join("axis"), "1 0 0 0\n0 2 0 0\n0 0 1 0\n0 0 0 1\n").unwrap();
    let (axis, out) = (dir.join("axis"), dir.join("o.tum"));
    let arguments = [
        "convert",
        text(dir),
        "--to",
        "tum",
        "--out",
        text(&out),
        "--tunnel-frame",
        text(&axis),
    ];
    let message = fail(&arguments, 3);
    assert!(
        message.contains("axis: its first three columns are not a rotation"),
        "{message}"
    );
}

//! Round trips and errors of every format.

use super::*;
use crate::camera::{Camera, ColmapCamera};
use nalgebra::Vector3;
use proptest::prelude::*;
use std::path::{Path, PathBuf};

/// A folder and a file in it with these bytes.
fn file_of(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("poses");
    std::fs::write(&path, bytes).unwrap();
    (dir, path)
}

fn read_text(text: &str) -> Result<PoseFile, PoseError> {
    read_poses(&file_of(text.as_bytes()).1, None)
}

/// The poses of a file of this name and text, or the message of its error.
pub(super) fn read_named(name: &str, text: &str) -> Result<PoseFile, String> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, text).unwrap();
    read_poses(&path, None).map_err(|error| error.to_string())
}

fn names(count: usize) -> Vec<String> {
    (0..count)
        .map(|k| format!("frames/a,\"{k}\".png"))
        .collect()
}

/// Formats the poses in every writable format.
fn written(trajectory: &[StampedPose]) -> Vec<(PoseFormat, String)> {
    let names = names(trajectory.len());
    let camera = ColmapCamera::of(&Camera::from_vertical_fov(64, 48, 1.0)).unwrap();
    vec![
        (PoseFormat::Tum, tum::format(trajectory)),
        (PoseFormat::Kitti, kitti::format(trajectory)),
        (PoseFormat::Csv, csv::format(&names, trajectory)),
        (
            PoseFormat::Colmap,
            colmap::format_images(&names, trajectory).unwrap(),
        ),
        (
            PoseFormat::Nerfstudio,
            nerfstudio::format(camera.nerfstudio().unwrap(), &names, trajectory),
        ),
    ]
}

fn assert_restored(trajectory: &[StampedPose], format: PoseFormat, text: &str, tolerance: f64) {
    let (_dir, path) = file_of(text.as_bytes());
    let file = read_poses(&path, None).unwrap();
    assert_eq!(file.format, format);
    assert_eq!(file.entries.len(), trajectory.len());
    let convention = Convention::of(format);
    for (k, (entry, stamped)) in file.entries.iter().zip(trajectory).enumerate() {
        let back = convention.to_tunnel(&entry.pose);
        let scale = 1.0 + stamped.pose.t_wc.norm();
        assert!(
            back.r_wc.angle_to(&stamped.pose.r_wc) < tolerance,
            "{format:?}"
        );
        assert!(
            (back.t_wc - stamped.pose.t_wc).norm() < tolerance * scale,
            "{format:?}"
        );
        if let Some(time_s) = entry.time_s {
            assert_eq!(time_s, stamped.time_s);
        }
        if let Some(name) = &entry.name {
            assert_eq!(*name, names(k + 1)[k]);
        }
    }
    let knows = |format: PoseFormat| {
        (
            matches!(format, PoseFormat::Tum | PoseFormat::Csv),
            matches!(
                format,
                PoseFormat::Csv | PoseFormat::Colmap | PoseFormat::Nerfstudio
            ),
        )
    };
    assert_eq!((file.has_times(), file.has_names()), knows(format));
}

fn any_pose() -> impl Strategy<Value = Pose> {
    let turn = (-4.0f64..4.0, -4.0f64..4.0, -4.0f64..4.0);
    let place = (-1e3f64..1e3, -1e5f64..1e5, -1.0f64..1.0);
    (turn, place).prop_map(|((a, b, c), (x, y, z))| {
        Pose::new(so3::exp(&Vector3::new(a, b, c)), Vector3::new(x, y, z))
    })
}

proptest! {
    #[test]
    fn every_format_restores_any_trajectory(
        poses in prop::collection::vec(any_pose(), 1..6), begin in -1e9f64..2e9,
        steps in prop::collection::vec(1e-3f64..1e3, 6),
    ) {
        let mut time_s = begin;
        let trajectory: Trajectory = poses.into_iter().zip(steps).map(|(pose, step)| {
            time_s += step;
            StampedPose { time_s, pose }
        }).collect();
        for (format, text) in written(&trajectory) {
            assert_restored(&trajectory, format, &text, 1e-13);
        }
    }

    #[test]
    fn no_text_makes_it_panic(text in "[-0-9eE.,;\\[\\]{}\" #a-zA-Z\n\r\t]{0,200}") {
        let (_dir, path) = file_of(text.as_bytes());
        let _ = read_poses(&path, None);
        use PoseFormat::{
            Bundler, Colmap, Csv, Euroc, Json, Kitti, Meshroom, Metashape, Nerfstudio, Openmvg,
            Opensfm, Pix4d, Realitycapture, Record3d, Tum,
        };
        for format in [
            Tum,
            Kitti,
            Csv,
            Colmap,
            Nerfstudio,
            Euroc,
            Opensfm,
            Bundler,
            Meshroom,
            Openmvg,
            Metashape,
            Realitycapture,
            Pix4d,
            Json,
            Record3d,
        ] {
            let _ = read_poses(&path, Some(format));
        }
    }
}

/// Windows' line ends, a byte order mark, comments and blank lines change nothing.
#[test]
fn editors_leave_their_marks() {
    let trajectory = indexed(spiral(5, 0.1234567890123, 0.7));
    for (format, text) in written(&trajectory) {
        assert_restored(&trajectory, format, &text.replace('\n', "\r\n"), 1e-13);
        assert_restored(&trajectory, format, &format!("\u{feff}{text}"), 1e-13);
        if !matches!(format, PoseFormat::Nerfstudio) {
            assert_restored(
                &trajectory,
                format,
                &format!("# made by hand\n\n{text}\n"),
                1e-13,
            );
        }
    }
}

/// A file cut off anywhere is refused, or has fewer poses if it was cut between two; never others.
#[test]
fn a_truncated_file_has_no_wrong_poses() {
    let trajectory = indexed(spiral(3, 0.5, 0.75));
    for (format, text) in written(&trajectory) {
        let whole = read_poses(&file_of(text.as_bytes()).1, Some(format))
            .unwrap()
            .entries;
        for end in 0..text.len() {
            let (_dir, path) = file_of(&text.as_bytes()[..end]);
            if let Ok(file) = read_poses(&path, Some(format)) {
                let complete = file.entries.len() - 1;
                assert_eq!(
                    file.entries[..complete],
                    whole[..complete],
                    "{format:?} {end}"
                );
            }
        }
    }
}

#[test]
fn what_is_no_text_is_refused() {
    for bytes in [
        &[0xff, 0xfe, 0x30][..],
        b"0 0 0 0 0 0 0 1\0\n",
        b"\x89PNG\r\n\x1a\n",
    ] {
        let message = read_poses(&file_of(bytes).1, None).unwrap_err().to_string();
        assert!(message.contains("is no text of UTF-8"), "{message}");
    }
    let message = read_poses(Path::new("/nowhere/poses.tum"), None)
        .unwrap_err()
        .to_string();
    assert!(message.contains("cannot read the file"), "{message}");
}

/// Matrices of 4 × 4 are those of 3 × 4 with a row that says nothing.
#[test]
fn whole_matrices_are_rows_of_kitti() {
    let read = read_text("0 0 1 4 1 0 0 5 0 1 0 6 0 0 0 1\n").unwrap();
    let expected = read_text("0 0 1 4 1 0 0 5 0 1 0 6\n").unwrap();
    assert_eq!(read.format, PoseFormat::Kitti);
    assert_eq!(read.entries, expected.entries);
    let transposed = read_text("0 1 0 0 0 0 1 0 1 0 0 0 4 5 6 1\n").unwrap_err();
    let message = transposed.to_string();
    assert!(
        message.contains(":1: the last row of the 4 × 4 matrix is 4 5 6 1"),
        "{message}"
    );
}

#[test]
fn euroc_is_read_in_nanoseconds_with_w_first() {
    let text = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], \
                q_RS_y [], q_RS_z [], v_RS_R_x [m s^-1]\n\
        1403636580838555648,4.688319,-1.786938,0.783338,\
        0.534108,-0.153029,-0.827383,-0.082152,-0.027876\n\
        1403636580843555328,4.688177,-1.786770,0.787350,\
        0.534640,-0.152990,-0.826976,-0.082863,-0.031\n";
    let file = read_text(text).unwrap();
    assert_eq!(file.format, PoseFormat::Euroc);
    let first = &file.entries[0];
    assert_eq!(first.time_s, Some(1403636580.8385556));
    assert!((first.pose.r_wc.w - 0.534108).abs() < 1e-5);
    assert_eq!(first.pose.t_wc.x, 4.688319);
}

#[test]
fn columns_are_found_by_their_names() {
    let plain =
        read_text("timestamp_ns;x;y;z;qw;qx;qy;qz;speed\n1403636580838555648;1;2;3;1;0;0;0;9\n")
            .unwrap();
    assert_eq!(plain.format, PoseFormat::Csv);
    assert_eq!(plain.entries[0].time_s, Some(1403636580.8385556));
    assert_eq!(plain.entries[0].pose.t_wc, Vector3::new(1.0, 2.0, 3.0));
    assert!(!plain.has_names());
    let header = "timestamp,x,y,z,qw,qx,qy,qz\n";
    for (time, time_s) in [("1403636580838555648", 1403636580.8385556), ("12.5", 12.5)] {
        let file = read_text(&format!("{header}{time},1,2,3,1,0,0,0\n")).unwrap();
        assert_eq!(file.entries[0].time_s, Some(time_s));
    }
}

/// Two poses, as every file of the tests below has them.
fn assert_two_poses(text: &str, options: &PoseFileOptions, format: PoseFormat) {
    let (_dir, path) = file_of(text.as_bytes());
    let file = read_poses_with(&path, options).unwrap_or_else(|error| panic!("{text}: {error}"));
    assert_eq!(file.format, format, "{text}");
    let expected = [[1.5, 0.25, -2.0], [2.5, 0.5, -1.0]];
    assert_eq!(file.entries.len(), 2, "{text}");
    for (entry, t) in file.entries.iter().zip(expected) {
        assert_eq!(entry.pose.t_wc, Vector3::from(t), "{text}");
        let q = entry.pose.r_wc;
        assert!(
            (q.w - 0.6).abs() < 1e-12 && (q.k - 0.8).abs() < 1e-12,
            "{text}"
        );
    }
}

#[test]
fn rows_without_a_header_have_any_separator_and_order() {
    let rows = ["0 1.5 0.25 -2 0 0 0.8 0.6", "1 2.5 0.5 -1 0 0 0.8 0.6"];
    let w_first = ["0 1.5 0.25 -2 0.6 0 0 0.8", "1 2.5 0.5 -1 0.6 0 0 0.8"];
    let kitti = [
        "-0.28 -0.96 0 1.5 0.96 -0.28 0 0.25 0 0 1 -2",
        "-0.28 -0.96 0 2.5 0.96 -0.28 0 0.5 0 0 1 -1",
    ];
    let options = PoseFileOptions::default();
    let with_order = PoseFileOptions {
        quaternion: Some(QuaternionOrder::Wxyz),
        ..PoseFileOptions::default()
    };
    for separator in [",", ", ", ";", "\t", "  "] {
        let joined = |rows: [&str; 2]| rows.join("\n").replace(' ', separator);
        assert_two_poses(&joined(rows), &options, PoseFormat::Tum);
        assert_two_poses(&joined(kitti), &options, PoseFormat::Kitti);
        assert_two_poses(&joined(w_first), &with_order, PoseFormat::Tum);
        for comment in ["# time tx ty tz qw qx qy qz\n", "#t x y z w x y z\n\n"] {
            let text = format!("{comment}{}", joined(w_first));
            assert_two_poses(&text, &options, PoseFormat::Tum);
        }
    }
    // A comment with the names of all columns, separated as these are, is a header.
    let text = format!(
        "# time,qw,qx,qy,qz,x,y,z\n{}\n",
        "0,0.6,0,0,0.8,1.5,0.25,-2"
    );
    let text = format!("{text}1,0.6,0,0,0.8,2.5,0.5,-1\n");
    assert_two_poses(&text, &options, PoseFormat::Csv);
}

#[test]
fn tables_of_spreadsheets_and_of_ros_are_read() {
    let options = PoseFileOptions::default();
    let ros = "field.pose.position.x,field.pose.position.y,field.pose.position.z,\
               field.pose.orientation.x,field.pose.orientation.y,field.pose.orientation.z,\
               field.pose.orientation.w\n\
               1403636579763555584,7,1.5,0.25,-2,0,0,0.8,0.6\n\
               1403636579863555584,8,2.5,0.5,-1,0,0,0.8,0.6\n";
    let plotted = ros
        .replace("field.", "/odom/")
        .replace("pose.", "pose/pose/");
    let decimal = "time_s;tx;ty;tz;qx;qy;qz;qw\r\n0,5;1,5;0,25;-2,0;0;0;0,8;0,6\r\n\
                   0,75;2,5;0,5;-1;0,0;0;0,8;0,6\r\n";
    let euroc = "timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], \
                 q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v_RS_R_x [m s^-1]\n\
                 1,1.5,0.25,-2,0.6,0,0,0.8,9\n2,2.5,0.5,-1,0.6,0,0,0.8,9\n";
    for text in [
        format!("%time,field.header.seq,{ros}"),
        format!("header.stamp.secs,header.stamp.nsecs,{ros}").replace(",7,", ",70,"),
        format!("__time,/odom/header/seq,{plotted}"),
        decimal.to_owned(),
        format!("sep=;\r\n{decimal}"),
        format!("\u{feff}\"sep=;\"\r\n{decimal}"),
        decimal.replace(';', "\t"),
        euroc.to_owned(),
    ] {
        assert_two_poses(&text, &options, PoseFormat::Csv);
    }
    // UTF-16 as of `Unicode Text`.
    let bytes: Vec<u8> = format!("\u{feff}{}", decimal.replace(';', "\t"))
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    let file = read_poses(&file_of(&bytes).1, None).unwrap();
    assert_eq!(file.entries[1].time_s, Some(0.75));
    // Where commas separate, a quoted one may stand before thousands.
    let quoted = |number: &str| {
        read_text(&format!(
            "time_s,tx,ty,tz,qx,qy,qz,qw\n0,\"{number}\",0,0,0,0,0,1\n"
        ))
    };
    assert_eq!(quoted("1,5").unwrap().entries[0].pose.t_wc.x, 1.5);
    let message = quoted("1,500").unwrap_err().to_string();
    assert!(message.contains(":2: `1,500` is not a number"), "{message}");
}

/// Rows without a header: with the name of the frame, a counter, without times; matrices with a
/// time or a name.
#[test]
fn rows_tell_their_form_by_what_they_hold() {
    let tum = "5 1 2 3 0 0 0.6 0.8\n6 1 2 3 0 0 0.6 0.8\n";
    let pose = read_text(tum).unwrap().entries[0].pose;
    let with = |rows: [&str; 2]| read_text(&format!("{}\n{}\n", rows[0], rows[1])).unwrap();
    let named = with(["a.png 1 2 3 0 0 0.6 0.8", "b.png 1 2 3 0 0 0.6 0.8"]);
    assert_eq!(named.entries[1].name.as_deref(), Some("b.png"));
    assert_eq!(
        (named.entries[0].pose, named.entries[0].time_s),
        (pose, None)
    );
    let last = with(["5,1,2,3,0,0,0.6,0.8,a.png", "6,1,2,3,0,0,0.6,0.8,b.png"]);
    assert_eq!(last.entries[1].time_s, Some(6.0));
    let counted = with(["0 5 1 2 3 0 0 0.6 0.8", "1 6 1 2 3 0 0 0.6 0.8"]);
    assert_eq!(counted.entries, read_text(tum).unwrap().entries);
    let seven = with(["1 2 3 0 0 0.6 0.8", "1 2 3 0 0 0.6 0.8"]);
    assert_eq!(
        (seven.entries[1].pose, seven.entries[1].time_s),
        (pose, None)
    );
    let matrix = "0.28 -0.96 0 1 0.96 0.28 0 2 0 0 1 3";
    let plain = with([matrix, matrix]).entries[0].pose;
    for prefix in ["a.png ", "7.5 ", "a.png 7.5 "] {
        let rows = [
            format!("{prefix}{matrix}"),
            format!("{prefix}{matrix} 0 0 0 1"),
        ];
        let rows = rows.map(|row| row.replace("a.png", "c.png"));
        let file = with([&rows[0], &rows[1].replace("c.png", "d.png")]);
        assert_eq!(file.entries[1].pose, plain);
        assert_eq!(
            file.entries[1].time_s,
            prefix.contains("7.5").then_some(7.5)
        );
    }
    // Poses with angles are not taken for such without times.
    let angles = read_text("0 1 2 3 10 20 30\n").unwrap_err().to_string();
    assert!(angles.contains("the quaternion has length"), "{angles}");
}

#[test]
fn columns_of_other_names_are_those_that_the_user_names() {
    let columns = [
        (PoseColumn::TimeS, "when"),
        (PoseColumn::Tx, "east"),
        (PoseColumn::Ty, "north"),
        (PoseColumn::Tz, "up"),
    ];
    let options = PoseFileOptions {
        columns: columns
            .map(|(column, name)| (column, name.to_owned()))
            .into(),
        ..PoseFileOptions::default()
    };
    let text = "when;up;north;east;x;y;z;qx;qy;qz;qw\n\
                1;-2;0.25;1.5;9;9;9;0;0;0.8;0.6\n2;-1;0.5;2.5;9;9;9;0;0;0.8;0.6\n";
    assert_two_poses(text, &options, PoseFormat::Csv);
    let (_dir, path) = file_of(text.replace("north", "south").as_bytes());
    let message = read_poses_with(&path, &options).unwrap_err().to_string();
    for part in [":1: no column `north`", "for ty", "`up`, `south`, `east`"] {
        assert!(message.contains(part), "{message}");
    }
    let message = read_text(&text.replace(";y;", ";why;"))
        .unwrap_err()
        .to_string();
    for part in [
        "no column `ty_m` or `ty`",
        "`x`, `why`, `z`",
        "columns = { ty =",
    ] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn times_of_many_digits_are_nanoseconds_in_tum() {
    for word in [
        "1403636579763555584",
        "1403636579763555584.000000",
        "1.403636579763555584e+18",
    ] {
        let file = read_text(&format!("{word} 0 0 0 0 0 0 1\n")).unwrap();
        assert_eq!(file.format, PoseFormat::Tum);
        assert_eq!(file.entries[0].time_s, Some(1403636579.7635555));
    }
    // With commas these would be EuRoC's, whose order is another.
    let comma = "1403636579763555584,0,0,0,0.6,0,0,0.8\n";
    assert_eq!(read_text(comma).unwrap().format, PoseFormat::Euroc);
    let named = read_text(&format!("# t tx ty tz qx qy qz qw\n{comma}")).unwrap();
    assert_eq!(named.format, PoseFormat::Tum);
}

#[test]
fn poses_of_one_time_are_merged_if_they_are_wanted_by_time() {
    let options = PoseFileOptions {
        duplicate_times: DuplicateTimes::Merge,
        ..PoseFileOptions::default()
    };
    let ns = "1403636580838555648,0,0,0,1,0,0,0\n";
    for text in [
        "0 0 0 0 0 0 0 1\n0 0 0 0.0005 0 0 0 1\n".to_owned(),
        "time,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n0,0,0,0,0,0,0,1\n".to_owned(),
        ns.repeat(2),
    ] {
        let (_dir, path) = file_of(text.as_bytes());
        assert_eq!(read_poses_with(&path, &options).unwrap().entries.len(), 1);
        let message = read_poses(&path, None).unwrap_err().to_string();
        assert!(message.contains("duplicate timestamp"), "{message}");
    }
    let (_dir, path) = file_of(b"0 0 0 0 0 0 0 1\n\n0 0 0 0 0 0 0.02 1\n");
    let file = read_poses_with(&path, &options).unwrap();
    assert_eq!((file.entries.len(), file.conflicts.len()), (1, 1));
    assert_eq!(file.conflicts[0].lines, [1, 3]);
    assert!((file.conflicts[0].angle_deg - 2.292).abs() < 1e-3);
}

#[test]
fn nerfstudios_applied_transform_is_undone() {
    let trajectory = indexed(spiral(2, 0.5, 0.75));
    let applied = Pose::new(
        so3::exp(&Vector3::new(1.0, 0.0, 0.3)),
        Vector3::new(0.0, 2.0, 1.0),
    );
    let moved: Trajectory = trajectory
        .iter()
        .map(|s| StampedPose {
            pose: applied.after(&s.pose),
            ..*s
        })
        .collect();
    let mut keys = serde_json::Map::new();
    keys.insert(
        "applied_transform".to_owned(),
        serde_json::json!(rigid::to_rows(&applied)),
    );
    let text = nerfstudio::format(keys, &names(2), &moved);
    assert_restored(&trajectory, PoseFormat::Nerfstudio, &text, 1e-13);
}

#[test]
fn wrong_lines_are_named_with_the_remedy() {
    let header = "time_s,tx_m,ty_m,tz_m,qx,qy,qz,qw\n";
    let image = "1 1 0 0 0 0 0 0 1 a.png\n";
    let ns = "1403636580838555648";
    for (text, expected) in [
        // TUM.
        (
            "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 1\n".to_owned(),
            ":2: 7 columns",
        ),
        ("0 0 0 NaN 0 0 0 1\n".into(), ":1: `NaN` is not finite"),
        ("0 0 0 0 0 0 0 0\n".into(), ":1: the quaternion is zero"),
        (
            "0 0 0 0 0 0 0 2\n".into(),
            ":1: the quaternion has length 2",
        ),
        (
            "0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n".into(),
            ":2: duplicate timestamp 0",
        ),
        (
            "1 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n".into(),
            ":2: timestamp 0 after 1: sort the file by \
                                                       time",
        ),
        ("0 x 0 0 0 0 0 1\n".into(), ":1: `x` is not a number"),
        ("# nothing\n".into(), "holds no poses"),
        (String::new(), "holds no poses"),
        // KITTI.
        (
            "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1\n".into(),
            ":2: 11 columns",
        ),
        (
            "1 0 0 0 0 1 0 0 0 0 1 inf\n".into(),
            ":1: `inf` is not finite",
        ),
        (
            "2 0 0 0 0 2 0 0 0 0 2 0\n".into(),
            ":1: its rotation is scaled by 2",
        ),
        (
            "1 0 0 0 0 1 0 0 0 0 -1 0\n".into(),
            ":1: its rotation is a reflection",
        ),
        // CSV.
        (header.into(), "holds no poses"),
        (
            "time_s,tx_m,ty_m,qx,qy,qz,qw\n".into(),
            ":1: no column `tz_m` or `tz`",
        ),
        (
            "x,tx,y,z,qx,qy,qz,qw\n".into(),
            ":1: two columns are called",
        ),
        (
            format!("{header}0,0,0,0,0,0,1\n"),
            ":2: 7 columns where the first line names 8",
        ),
        (
            format!("{header}\n0,0,0,nan,0,0,0,1\n"),
            ":3: `nan` is not finite",
        ),
        (
            format!("{header}0,0,0,0,0,0,0,0\n"),
            ":2: the quaternion is zero",
        ),
        (
            format!("{header}0,0,0,0,0,0,0,1\n0,0,0,0,0,0,0,1\n"),
            ":3: duplicate timestamp",
        ),
        (
            format!("frame,{header}a,1,0,0,0,0,0,0,1\nb,0,0,0,0,0,0,0,1\n"),
            ":3: timestamp 0 after \
                                                                           1",
        ),
        (
            format!("frame,{header}a,1,0,0,0,0,0,0,1\na,2,0,0,0,0,0,0,1\n"),
            ":3: a second pose of a",
        ),
        (
            format!("frame,{header},1,0,0,0,0,0,0,1\n"),
            ":2: the frame has no name",
        ),
        // COLMAP.
        (format!("{image}\n1 1 0 0 0 0 0 0 1\n"), ":3: 9 columns"),
        (format!("{image}{image}"), ":2: should hold the points"),
        (format!("{image}\n{image}\n"), ":3: a second pose of a.png"),
        (
            format!("{image}1.5 2.5 -1 3\n"),
            ":2: should hold the points",
        ),
        (
            "1 0 0 0 0 0 0 0 1 a.png\n".into(),
            ":1: the quaternion is zero",
        ),
        (
            "1 1 0 0 0 0 0 nan 1 a.png\n".into(),
            ":1: `nan` is not finite",
        ),
        // nerfstudio.
        ("{\"frames\": []}".into(), "holds no poses"),
        ("{\"frames\": [".into(), "line 1 column"),
        ("{}".into(), "it has no keys; JSON is read from nerfstudio"),
        (
            "{\"frames\": [{\"file_path\": \"a\", \"transform_matrix\": \
             [[1,0,0,0],[0,1,0,0],[0,0,2,0]]}]}"
                .into(),
            "frames[0] (a): transform_matrix: its first three columns are not a rotation",
        ),
        (
            "{\"frames\": [], \"applied_scale\": 0.5}".into(),
            "applied_scale is 0.5",
        ),
        // EuRoC.
        (
            format!("{ns},0,0,0,1,0,0,0\n{ns},0,0,0,1,0,0,0\n"),
            ":2: duplicate timestamp",
        ),
        (
            format!("{ns},0,0,0,1,0,0,0\n{ns}.5,0,0,0,1,0,0,0\n"),
            ":2: `1403636580838555648.5` is not a whole number",
        ),
        (
            format!("{ns},0,0,0,1,0,0,0\n\n{ns},0,0,0,1,0,0\n"),
            ":3: 7 columns",
        ),
        (
            format!("{ns},0,0,0,0,0,0,0\n"),
            ":1: the quaternion is zero",
        ),
        (format!("{ns},0,0,NaN,1,0,0,0\n"), ":1: `NaN` is not finite"),
        // None of them.
        ("hello\n".into(), ":1: in no known format: neither of TUM"),
        ("1 2 3\n".into(), "--pose-format"),
    ] {
        let message = read_text(&text).unwrap_err().to_string();
        assert!(message.contains(expected), "{text:?}: {message}");
    }
}

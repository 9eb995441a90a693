//! Tables of angles, lost poses and stacks of pictures: read, or named with what to do.

use crate::support::{edit, fail, first_frames, simulate, succeed, text, tunnelstitch};
use nalgebra::UnitQuaternion;
use serde_json::Value;
use std::path::Path;
use tiff::encoder::{TiffEncoder, colortype};
use tunnelstitch::trajectory::{StampedPose, tum};

/// Roll, pitch and yaw of a frame, degrees.
fn angles_deg(frame: usize) -> [f64; 3] {
    let k = frame as f64;
    [5.0 + k, 10.0 - k, 30.0 * k]
}

/// The positions of the survey with these angles, as a CSV.
fn table_of_angles(survey: &Path) -> String {
    let mut table = "frame,tx,ty,tz,roll,pitch,yaw\n".to_owned();
    let poses = tum::read(&survey.join("baseline.tum")).unwrap();
    for (k, stamped) in poses.iter().enumerate() {
        let ([roll, pitch, yaw], t) = (angles_deg(k), stamped.pose.t_wc);
        table += &format!("{k}.jpg,{},{},{},{roll},{pitch},{yaw}\n", t.x, t.y, t.z);
    }
    table
}

#[test]
fn angles_are_read_with_the_lines_that_the_error_names() {
    let survey = first_frames(4);
    let dir = survey.path();
    std::fs::write(dir.join("angles.csv"), table_of_angles(dir)).unwrap();
    let toml = dir.join("survey.toml");
    edit(&toml, "baseline.tum", "angles.csv");
    let refused = fail(&["check", text(dir)], 3);
    let lines = "write euler = \"ZYX\" and angle_unit = \"deg\" (or \"rad\") in [poses]";
    assert!(
        refused.contains("angles.csv:1: ") && refused.contains(lines),
        "{refused}"
    );
    edit(
        &toml,
        "[poses]",
        "[poses]\nassociate = \"order\"\neuler = \"ZYX\"",
    );
    let refused = fail(&["check", text(dir)], 3);
    assert!(
        refused.contains("angle_unit = \"deg\" or \"rad\""),
        "{refused}"
    );
    edit(&toml, "[poses]", "[poses]\nangle_unit = \"deg\"");
    let read = |flags: &[&str]| {
        let out = dir.join("read.tum");
        let convert = ["convert", text(dir), "--poses", "initial", "--to", "tum"];
        succeed(&[&convert[..], &["--out", text(&out)], flags].concat());
        tum::read(&out).unwrap()
    };
    let largest = |read: &[StampedPose]| {
        let off = |(k, stamped): (usize, &StampedPose)| {
            let [roll, pitch, yaw] = angles_deg(k).map(f64::to_radians);
            let expected = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            stamped.pose.r_wc.angle_to(&expected)
        };
        read.iter().enumerate().map(off).fold(0.0, f64::max)
    };
    assert!(largest(&read(&[])) < 1e-9);
    assert!(largest(&read(&["--pose-euler", "xyz"])) < 1e-9);
    assert!(largest(&read(&["--pose-euler", "XYZ"])) > 0.01);
    let refused = fail(&["check", text(dir), "--pose-euler", "ZXZ"], 2);
    assert!(refused.contains("X, Y and Z once each"), "{refused}");
}

/// A tracker that writes the identity where it has lost the camera.
#[test]
fn poses_that_fall_to_the_origin_are_named_with_their_frames() {
    let survey = first_frames(8);
    let dir = survey.path();
    let warnings = || -> String {
        let said = succeed(&["check", text(dir), "--json"]);
        let check: Value = serde_json::from_str(&said).unwrap();
        check["warnings"].to_string()
    };
    assert!(!warnings().contains("origin"), "{}", warnings());
    let file = dir.join("baseline.tum");
    let text_of = std::fs::read_to_string(&file).unwrap();
    let lost = |(k, line): (usize, &str)| {
        let time = line.split_whitespace().next().unwrap();
        match k {
            5 | 6 => format!("{time} 0 0 0 0 0 0 1\n"),
            _ => format!("{line}\n"),
        }
    };
    let lines = text_of.lines().filter(|line| !line.starts_with('#'));
    let changed: String = lines.clone().enumerate().map(lost).collect();
    std::fs::write(&file, changed).unwrap();
    let said = warnings();
    assert!(
        said.contains("poses fall back to the origin amid others, those of frames 5 to 6; "),
        "{said}"
    );
    let refined = tunnelstitch(&["refine", text(dir), "--out", text(&dir.join("r"))]);
    let said = String::from_utf8_lossy(&refined.stderr).into_owned();
    assert!(
        said.contains("poses fall back to the origin amid others, those of frames 5 to 6; "),
        "{said}"
    );
    let zeros = lines.map(|line| {
        let time = line.split_whitespace().next().unwrap();
        format!("{time} 0 0 0 0 0 0 0\n")
    });
    std::fs::write(&file, zeros.collect::<String>()).unwrap();
    let refused = fail(&["check", text(dir)], 3);
    assert!(refused.contains("lost the camera"), "{refused}");
}

/// Writes pictures as the pages of a TIFF file.
fn write_stack(path: &Path, pictures: &[image::GrayImage]) {
    let mut encoder = TiffEncoder::new(std::fs::File::create(path).unwrap()).unwrap();
    for picture in pictures {
        let (width, height) = picture.dimensions();
        encoder
            .write_image::<colortype::Gray8>(width, height, picture)
            .unwrap();
    }
}

/// One stack, and stacks in a folder: the poses are those of the same frames in files.
#[test]
fn pages_of_tiff_files_are_frames() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("survey");
    simulate(&dir, &["--frames", "6", "--size", "160x120"]);
    let refined = |name: &str| {
        let out = folder.path().join(name);
        succeed(&["refine", text(&dir), "--out", text(&out), "--threads", "1"]);
        std::fs::read(out.join("poses.tum")).unwrap()
    };
    let of_files = refined("files");
    let pictures: Vec<image::GrayImage> = (0..6)
        .map(|k| {
            image::open(dir.join(format!("frames/{k:06}.png")))
                .unwrap()
                .to_luma8()
        })
        .collect();
    let toml = dir.join("survey.toml");
    write_stack(&dir.join("stack.tif"), &pictures);
    edit(&toml, "frames/*.png", "stack.tif");
    assert!(refined("one") == of_files);
    std::fs::create_dir(dir.join("stacks")).unwrap();
    write_stack(&dir.join("stacks/run-2.TIF"), &pictures[..4]);
    write_stack(&dir.join("stacks/run-10.TIF"), &pictures[4..]);
    edit(&toml, "stack.tif", "stacks/*");
    assert!(refined("several") == of_files);
    let run = std::fs::read_to_string(folder.path().join("several/run.toml")).unwrap();
    assert!(!run.contains("000000"), "{run}");
    let whole = std::fs::read(dir.join("stacks/run-2.TIF")).unwrap();
    // The directory of the last page is cut off: that page is missing.
    let mut damaged = whole.clone();
    damaged.truncate(whole.len() - 8);
    std::fs::write(dir.join("stacks/run-2.TIF"), &damaged).unwrap();
    let said = fail(&["check", text(&dir)], 3);
    assert!(said.contains("6 poses for 5 frames"), "{said}");
}

/// Files of other kinds in place of poses and frames, and tables that are nearly right.
#[test]
fn what_people_save_is_read_or_named_with_its_remedy() {
    let survey = first_frames(4);
    let dir = survey.path();
    let file = dir.join("baseline.tum");
    let right = std::fs::read_to_string(&file).unwrap();
    let lines: Vec<&str> = right.lines().collect();
    let without_times: Vec<&str> = lines.iter().map(|l| l.split_once(' ').unwrap().1).collect();
    let without_times = without_times.join("\n");
    let lfs = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n";
    for (content, expected) in [
        (
            format!("{right}{right}"),
            "baseline.tum:5: timestamp 0 after 3: the file has several",
        ),
        (
            lfs.to_owned(),
            "baseline.tum: is a pointer of Git LFS in place of the file; `git lfs pull`",
        ),
        (
            "<!DOCTYPE html><html></html>".to_owned(),
            "baseline.tum: is a web page",
        ),
        (
            format!("Tunnel A,,,,,,,\n{right}"),
            "baseline.tum:1: column 2 is empty; ",
        ),
    ] {
        std::fs::write(&file, content).unwrap();
        let refused = fail(&["check", text(dir)], 3);
        assert!(refused.contains(expected), "{expected}: {refused}");
    }
    let toml = dir.join("survey.toml");
    edit(&toml, "[poses]", "[poses]\nassociate = \"order\"");
    let read = || {
        let out = dir.join("read.tum");
        let convert = ["convert", text(dir), "--poses", "initial", "--to", "tum"];
        succeed(&[&convert[..], &["--out", text(&out)]].concat());
        tum::read(&out).unwrap()
    };
    std::fs::write(&file, &right).unwrap();
    let expected = read();
    std::fs::write(&file, format!("tx ty tz qx qy qz qw\n{without_times}\n")).unwrap();
    assert_eq!(read().len(), 4);
    // Matrices as a program prints them, row by row.
    let matrices: String = expected
        .iter()
        .map(|stamped| {
            let matrix = stamped.pose.r_wc.to_rotation_matrix();
            let (r, t) = (matrix.matrix(), stamped.pose.t_wc);
            let row = |k: usize| format!("[{} {} {} {}]\n", r[(k, 0)], r[(k, 1)], r[(k, 2)], t[k]);
            format!("[{} {} {}[0. 0. 0. 1.]]\n", row(0), row(1), row(2))
        })
        .collect();
    std::fs::write(&file, matrices).unwrap();
    for (read, expected) in read().iter().zip(&expected) {
        assert!(read.pose.r_wc.angle_to(&expected.pose.r_wc) < 1e-9);
        assert!((read.pose.t_wc - expected.pose.t_wc).norm() < 1e-9);
    }
    std::fs::write(&file, &right).unwrap();
    edit(&toml, "frames/*.jpg", "~/frames/*.jpg");
    let refused = fail(&["check", text(dir)], 3);
    assert!(refused.contains("write the whole path"), "{refused}");
    edit(&toml, "~/frames/*.jpg", "frames/*.jpg");
    std::fs::write(dir.join("frames/000002.jpg"), lfs).unwrap();
    let refused = fail(&["check", text(dir)], 3);
    assert!(
        refused.contains("000002.jpg): it is a pointer of Git LFS"),
        "{refused}"
    );
}

/// macOS writes accents as characters of their own; tables of numbers write counters with a point.
#[test]
fn names_with_accents_and_counters_with_points_are_associated() {
    let survey = first_frames(4);
    let dir = survey.path();
    let poses = tum::read(&dir.join("baseline.tum")).unwrap();
    let table = |name: &dyn Fn(usize) -> String| {
        let row = |(k, stamped): (usize, &StampedPose)| {
            let (t, q) = (stamped.pose.t_wc, stamped.pose.r_wc.coords);
            let numbers = [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(|value| value.to_string());
            format!("{},{}\n", name(k), numbers.join(","))
        };
        let rows: String = poses.iter().enumerate().map(row).collect();
        std::fs::write(
            dir.join("p.csv"),
            format!("frame,tx,ty,tz,qx,qy,qz,qw\n{rows}"),
        )
        .unwrap();
    };
    edit(&dir.join("survey.toml"), "baseline.tum", "p.csv");
    table(&|k| format!("{k}.0"));
    succeed(&["check", text(dir)]);
    for k in 0..4 {
        let name = format!("frames/Tu\u{308}bbing {k}.jpg");
        std::fs::rename(dir.join(format!("frames/{k:06}.jpg")), dir.join(name)).unwrap();
    }
    table(&|k| format!("T\u{fc}bbing {k}.jpg"));
    succeed(&["check", text(dir)]);
}

/// Degrees that are declared as radians: only the pictures tell.
#[test]
fn angles_in_the_other_unit_are_named_by_the_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let survey = folder.path().join("survey");
    let motion = ["--frames", "16", "--turn-deg", "20", "--advance-m", "0.05"];
    simulate(&survey, &[&motion[..], &["--size", "160x120"]].concat());
    let mut table = "tx,ty,tz,roll,pitch,yaw\n".to_owned();
    for stamped in tum::read(&survey.join("baseline.tum")).unwrap() {
        let (roll, pitch, yaw) = stamped.pose.r_wc.euler_angles();
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(f64::to_degrees);
        let t = stamped.pose.t_wc;
        table += &format!("{},{},{},{roll},{pitch},{yaw}\n", t.x, t.y, t.z);
    }
    std::fs::write(survey.join("angles.csv"), table).unwrap();
    let toml = survey.join("survey.toml");
    let lines = "initial = \"angles.csv\"\neuler = \"ZYX\"\nangle_unit = \"rad\"";
    edit(&toml, "truth = \"groundtruth.tum\"\n", "");
    edit(&toml, "initial = \"baseline.tum\"", lines);
    let readings = || -> Value {
        let said = succeed(&["check", text(&survey), "--json"]);
        let mut check: Value = serde_json::from_str(&said).unwrap();
        check["readings"]["readings"].take()
    };
    let expected = "angles in deg (angle_unit = \"deg\" under [poses])";
    assert_eq!(readings(), Value::from(vec![expected]));
    edit(&toml, "\"rad\"", "\"deg\"");
    assert_eq!(readings(), Value::Null);
}

/// Comments of MATLAB and C, numbers in quotes, titles in any language, and slips of survey.toml.
#[test]
fn comments_quotes_and_titles_of_other_programs_are_read() {
    let survey = first_frames(4);
    let dir = survey.path();
    let file = dir.join("baseline.tum");
    let right = std::fs::read_to_string(&file).unwrap();
    let read = || {
        let out = dir.join("read.tum");
        let convert = ["convert", text(dir), "--poses", "initial", "--to", "tum"];
        succeed(&[&convert[..], &["--out", text(&out)]].concat());
        std::fs::read_to_string(&out).unwrap()
    };
    let expected = read();
    let rows: Vec<Vec<&str>> = right
        .lines()
        .map(|line| line.split(' ').collect())
        .collect();
    let quoted = rows
        .iter()
        .map(|row| format!("\"{}\"\n", row.join("\",\"")));
    // Rows of names in another order than the frames.
    let named = rows.iter().enumerate().rev();
    let named = named.map(|(k, row)| format!("D:\\Kanal\\{k:06}.jpg;{}\n", row[1..].join(";")));
    let titles = "Bild;X;Y;Z;qx;qy;qz;qw\n".to_owned();
    for content in [
        format!("% time tx ty tz qx qy qz qw\n%% of the odometry\n{right}"),
        format!("// time, pose\n\n{right}"),
        quoted.collect(),
        titles + &named.collect::<String>(),
    ] {
        std::fs::write(&file, &content).unwrap();
        assert_eq!(read(), expected, "{content}");
    }
    let without_header = rows.iter().enumerate();
    let without_header =
        without_header.map(|(k, row)| format!("frames/{k:06}.jpg {}\n", row[1..].join(" ")));
    std::fs::write(&file, without_header.collect::<String>()).unwrap();
    assert_eq!(read(), expected);
    let toml = dir.join("survey.toml");
    for (from, to, expected) in [
        (
            "radius_m = 3.0",
            "radius_m = 3,0",
            "decimals follow a point",
        ),
        ("\"frames/", "\"frames\\", "write `/`, or single quotes"),
    ] {
        edit(&toml, from, to);
        let refused = fail(&["check", text(dir)], 3);
        assert!(
            refused.contains("survey.toml:") && refused.contains(expected),
            "{refused}"
        );
        edit(&toml, to, from);
    }
}

//! Refinement of the Blender-rendered fixture through the program, judged against the true poses.

use crate::support::{
    self, first_frames, json, refined_blender_survey, simulate, succeed, text, tunnelstitch,
};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    simulate(&survey, &["--frames", "14", "--size", "160x120"]);
    let refined = |threads: &str| {
        let out = dir.path().join(threads);
        let refine = ["refine", text(&survey), "--out", text(&out), "--quiet"];
        succeed(&[&refine[..], &["--threads", threads]].concat());
        ["poses.tum", "covariance.csv"].map(|name| std::fs::read(out.join(name)).unwrap())
    };
    let one = refined("1");
    assert!(["2", "3"].iter().all(|threads| refined(threads) == one));
}

#[test]
fn the_fixture_is_repaired() {
    let refined = refined_blender_survey();
    // The format that evo reads: eight columns, single spaces, no trailing space.
    let poses = std::fs::read_to_string(refined.join("poses.tum")).unwrap();
    assert_eq!(poses.lines().count(), 48);
    for line in poses.lines() {
        assert_eq!(line.split(' ').count(), 8, "{line:?}");
        assert!(line.split(' ').all(|word| word.parse::<f64>().is_ok()));
    }

    let report = json(&refined.join("refine.json"));
    assert_eq!(report["frames"].as_array().unwrap().len(), 48);
    assert_eq!(report["frames_on_prior"], 0);
    for level in report["levels"].as_array().unwrap() {
        let cost = |name: &str| level[name].as_f64().unwrap();
        // The last step is not judged.
        let judged = level["iterations"].as_u64().unwrap() > 1;
        assert!(!judged || cost("cost_end") < cost("cost_start"));
        assert!(level["observations"].as_u64().unwrap() > 0);
    }
    for frame in report["frames"].as_array().unwrap() {
        assert_eq!(frame["flag"], "photometric");
        // No exposure was varied when the frames were rendered.
        assert!(
            (frame["gain"].as_f64().unwrap() - 1.0).abs() < 0.02,
            "{frame}"
        );
        assert!(frame["sigma"]["wall_px"].as_f64().unwrap() < 0.1);
    }
}

/// Simulates a survey with the given options and refines it; returns refine.json and what was
/// warned of.
fn refine_simulated(options: &[&str]) -> (serde_json::Value, String) {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    simulate(&survey, options);
    let output = tunnelstitch(&["refine", text(&survey), "--out", text(&out)]);
    let warned = String::from_utf8_lossy(&output.stderr).into_owned();
    let code = output.status.code();
    let report = json(&out.join("refine.json"));
    let expected = if report["verdict"]["photometric"] == 0 {
        4
    } else {
        0
    };
    assert_eq!(code, Some(expected), "{options:?}: {warned}");
    (report, warned)
}

/// A wall without texture determines no pose, so no frame is photometric.
#[test]
fn a_flat_wall_is_never_called_photometric() {
    let dir = tempfile::tempdir().unwrap();
    let texture = dir.path().join("flat.png");
    image::GrayImage::from_pixel(8, 8, image::Luma([128]))
        .save(&texture)
        .unwrap();
    for noise in ["0", "2", "6"] {
        let (report, warned) = refine_simulated(&[
            "--frames",
            "14",
            "--size",
            "160x120",
            "--texture",
            text(&texture),
            "--light",
            "even",
            "--noise",
            noise,
        ]);
        assert_eq!(report["frames_on_prior"], 14, "noise {noise}");
        assert!(warned.contains("14 of 14 frames"), "{warned}");
    }
}

/// Low contrast under much noise: a hard case, but no error.
#[test]
fn faint_walls_and_odd_frames_are_refined_without_an_error() {
    let faint = ["--frames", "16", "--size", "160x120", "--wall", "concrete"];
    refine_simulated(&[&faint[..], &["--noise", "6"]].concat());
    refine_simulated(&["--frames", "6", "--size", "16x120", "--turn-deg", "1"]);
    refine_simulated(&["--frames", "3", "--size", "400x16", "--fov-deg", "4"]);
}

/// World-to-camera poses are a common mistake: the pose convention search names it.
#[test]
fn poses_in_the_wrong_direction_are_warned_of() {
    let survey = first_frames(12);
    let path = survey.path().join("baseline.tum");
    let trajectory = tunnelstitch::trajectory::tum::read(&path).unwrap();
    let inverted: Vec<_> = trajectory
        .iter()
        .map(|stamped| {
            let r_cw = stamped.pose.r_wc.inverse();
            let pose = tunnelstitch::trajectory::Pose::new(r_cw, -(r_cw * stamped.pose.t_wc));
            tunnelstitch::trajectory::StampedPose { pose, ..*stamped }
        })
        .collect();
    std::fs::write(&path, tunnelstitch::trajectory::tum::format(&inverted)).unwrap();
    let out = survey.path().join("out");
    let output = support::tunnelstitch(&["refine", text(survey.path()), "--out", text(&out)]);
    let warned = String::from_utf8_lossy(&output.stderr);
    // A plan exactly on the axis, read from world to camera, is one of OpenGL's axes seen from the
    // tunnel's other end.
    let named = |flag: &str| warned.contains(flag);
    assert!(
        named("--pose-convention w2c") || named("--camera-axes opengl (poses.camera_axes"),
        "{warned}"
    );
}

/// Root mean square wall error of a refined survey's photometric frames, pixels, with the gauge
/// fixed by them.
fn photometric_wall_px(survey: &Path, out: &Path) -> f64 {
    let survey = tunnelstitch::survey::Survey::open(survey).unwrap();
    let report = json(&out.join("refine.json"));
    let believed = |k: usize| report["frames"][k]["flag"] == "photometric";
    let poses = |trajectory: &tunnelstitch::trajectory::Trajectory| -> Vec<_> {
        let all = tunnelstitch::trajectory::poses_of(trajectory);
        let kept = all.into_iter().enumerate().filter(|(k, _)| believed(*k));
        kept.map(|(_, pose)| pose).collect()
    };
    let refined = tunnelstitch::trajectory::tum::read(&out.join("poses.tum")).unwrap();
    let error = tunnelstitch::evaluate::wall_error(
        survey.surface.as_ref(),
        &survey.cameras,
        &poses(&refined),
        &poses(survey.truth.as_ref().unwrap()),
    );
    error.unwrap().px.rms
}

/// Simulates and refines; returns the folder with `survey` and `out`.
fn simulate_and_refine(options: &[&str]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    simulate(&survey, options);
    succeed(&["refine", text(&survey), "--out", text(&out), "--quiet"]);
    dir
}

/// Gain ±30 %, a lamp that falls to 40 % at the corners, specular highlights on 3 % of the wall,
/// moving objects, 16 bits.
#[test]
fn uneven_light_highlights_and_moving_objects_do_no_harm() {
    let light = "--frames 30 --size 240x180 --gain-percent 30 --bias-grey 5 --lamp-corner 0.4 \
                 --specular-percent 3 --moving 2 --bits 16 --seed 4";
    let dir = simulate_and_refine(&light.split_whitespace().collect::<Vec<_>>());
    let px = photometric_wall_px(&dir.path().join("survey"), &dir.path().join("out"));
    assert!(px < 0.15, "{px}");
}

/// A lamp and highlights on concrete with a contrast of 3 to 4 grey levels: the residual light has
/// larger gradients than the wall.
#[test]
fn hard_light_does_no_harm_on_a_faint_wall() {
    let light = "--frames 24 --size 480x360 --wall concrete --gain-percent 30 --lamp-corner 0.4 \
                 --specular-percent 3 --seed 2";
    let dir = simulate_and_refine(&light.split_whitespace().collect::<Vec<_>>());
    let out = dir.path().join("out");
    let px = photometric_wall_px(&dir.path().join("survey"), &out);
    assert!(px < 0.15, "{px}");
    let report = json(&out.join("refine.json"));
    assert_eq!(report["frames_on_prior"], 0);
}

/// Faulty frames are rejected with the reason, and the others are as accurate as without them.
#[test]
fn faulty_frames_are_flagged_and_the_others_stay_accurate() {
    let bad = "5:black,9:blurred,12:occluded,15:repeated,20-22:missing";
    let options = ["--frames", "30", "--size", "480x360", "--seed", "6"];
    let dir = simulate_and_refine(&[&options[..], &["--bad-frames", bad]].concat());
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    let report = json(&out.join("refine.json"));
    let flagged: Vec<u64> = report["frames"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|frame| frame["flag"] != "photometric")
        .map(|frame| frame["index"].as_u64().unwrap())
        .collect();
    assert_eq!(flagged, [5, 9, 12, 15]);
    assert!(
        report["frames"][15]["reason"]
            .as_str()
            .unwrap()
            .contains("frame 14")
    );
    let px = photometric_wall_px(&survey, &out);
    assert!(px < 0.03, "{px}");

    // A covariance for every frame and every pair of neighbours.
    let table = std::fs::read_to_string(out.join("covariance.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + 27 + 26);
}

/// One initial pose is 20° off: this frame keeps it and is flagged, and the others stay accurate.
#[test]
fn a_wrong_prior_costs_one_frame() {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    let options = ["--frames", "24", "--size", "320x240", "--seed", "8"];
    simulate(&survey, &options);
    let path = survey.join("baseline.tum");
    let mut baseline = tunnelstitch::trajectory::tum::read(&path).unwrap();
    let turn = nalgebra::UnitQuaternion::from_scaled_axis(nalgebra::Vector3::y() * 0.35);
    baseline[10].pose.r_wc *= turn;
    std::fs::write(&path, tunnelstitch::trajectory::tum::format(&baseline)).unwrap();
    succeed(&["refine", text(&survey), "--out", text(&out), "--quiet"]);
    let report = json(&out.join("refine.json"));
    for frame in report["frames"].as_array().unwrap() {
        let expected = if frame["index"] == 10 {
            "prior"
        } else {
            "photometric"
        };
        assert_eq!(frame["flag"], expected, "{frame}");
    }
    let px = photometric_wall_px(&survey, &out);
    assert!(px < 0.05, "{px}");
}

/// Perceptual aliasing on a wall that repeats every 0.45 m, with steps of 6° and 9 cm: no frame
/// that is a tile off is photometric, and an ambiguous frame has both poses.
#[test]
fn on_a_wall_that_repeats_no_frame_is_silently_wrong() {
    let options = "--wall tiled-brick --frames 24 --size 240x180 --seed 2 \
                   --rotation-sigma-deg 6 --translation-sigma-m 0.06,0.06,0.09";
    let dir = simulate_and_refine(&options.split_whitespace().collect::<Vec<_>>());
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    let px = photometric_wall_px(&survey, &out);
    assert!(px < 0.3, "{px}");
    let report = json(&out.join("refine.json"));
    let frames = report["frames"].as_array().unwrap();
    let ambiguous = frames.iter().filter(|frame| frame["flag"] == "ambiguous");
    assert!(ambiguous.clone().count() > 0);
    for frame in ambiguous {
        assert!(frame["other_pose"]["translation_m"].is_array(), "{frame}");
    }
}

/// A turn that closes with little overlap could converge to the next tile on the coarse levels,
/// with every pair of frames consistent.
#[test]
fn a_turn_closes_on_the_right_tile() {
    let options = "--wall tiled-brick --frames 60 --size 320x240 --seed 2 --jitter random-walk \
                   --rotation-sigma-deg 2 --translation-sigma-m 0.02,0.02,0.03";
    let dir = simulate_and_refine(&options.split_whitespace().collect::<Vec<_>>());
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    let report = json(&out.join("refine.json"));
    let frames = report["frames"].as_array().unwrap();
    let believed = frames.iter().filter(|f| f["flag"] == "photometric");
    assert_eq!(believed.count(), 60);
    let px = photometric_wall_px(&survey, &out);
    assert!(px < 0.05, "{px}");
}

/// A bare wall in noise, but for specks: they are all that there is of it.
#[test]
fn specks_on_a_bare_wall_are_enough() {
    const SIDE_PX: u32 = 600;
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut wall = image::GrayImage::from_pixel(SIDE_PX, SIDE_PX, image::Luma([150]));
    for _ in 0..160 {
        let [u, v] = [0; 2].map(|_: i32| rng.random_range(0..SIDE_PX - 10));
        let (side, grey) = (rng.random_range(4..10), [80, 220][rng.random_range(0..2)]);
        for (x, y) in (0..side * side).map(|k| (k % side, k / side)) {
            wall.put_pixel(u + x, v + y, image::Luma([grey]));
        }
    }
    let dir = tempfile::tempdir().unwrap();
    let texture = dir.path().join("specks.png");
    wall.save(&texture).unwrap();
    let options = "--texture-width-m 2.5 --frames 14 --size 240x180 --noise 3 --supersample 3";
    let options: Vec<&str> = options.split(' ').collect();
    let dir = simulate_and_refine(&[&["--texture", text(&texture)], &options[..]].concat());
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    assert_eq!(json(&out.join("refine.json"))["frames_on_prior"], 0);
    let px = photometric_wall_px(&survey, &out);
    assert!(px < 1.0, "{px}");
}

/// Sharp bricks: joint estimation of the wall removes at least a quarter of the error, and the
/// stated uncertainty decreases with it.
#[test]
fn joint_estimation_of_the_wall_improves_bricks() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    simulate(
        &survey,
        &["--frames", "12", "--size", "120x90", "--noise", "2"],
    );
    let refined = |name: &str, options: &[&str]| {
        let out = dir.path().join(name);
        let mut arguments = vec!["refine", text(&survey), "--out", text(&out), "--quiet"];
        arguments.extend(options);
        succeed(&arguments);
        let report = json(&out.join("refine.json"));
        let sigma = report["frames"][8]["sigma"]["wall_px"].as_f64().unwrap();
        (photometric_wall_px(&survey, &out), sigma)
    };
    let (plain, joint) = (refined("plain", &[]), refined("joint", &["--joint"]));
    assert!(joint.0 < 0.75 * plain.0, "{} after {}", joint.0, plain.0);
    assert!((0.3..3.0).contains(&(joint.0 / joint.1)), "{joint:?}");
}

/// Concrete is smooth over a pixel: joint estimation has nothing to gain and changes nothing.
#[test]
fn a_smooth_wall_is_refined_without_joint_estimation() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    let concrete = ["--wall", "concrete", "--frames", "12", "--size", "160x120"];
    simulate(&survey, &concrete);
    let refined = |name: &str, options: &[&str]| {
        let out = dir.path().join(name);
        let arguments = ["refine", text(&survey), "--out", text(&out)];
        (succeed(&[&arguments[..], options].concat()), out)
    };
    let ((_, plain), (said, joint)) = (refined("plain", &[]), refined("joint", &["--joint"]));
    assert!(said.contains("refined without --joint"), "{said}");
    for file in ["poses.tum", "covariance.csv"] {
        let [plain, joint] = [&plain, &joint].map(|out| std::fs::read(out.join(file)).unwrap());
        assert!(plain == joint, "{file} is different");
    }
}

/// The summary is short; the table of solves and the times of stages are for `-v`.
#[test]
fn tables_of_the_estimator_are_printed_with_verbose() {
    let survey = first_frames(6);
    let out = survey.path().join("out");
    let refine = ["refine", text(survey.path()), "--out", text(&out)];
    let short = succeed(&refine);
    let long = succeed(&[&refine[..], &["-v"]].concat());
    assert!(short.contains("\nrefined 6 frames in "), "{short}");
    for part in [
        " of 6 frames are photometric; mean 1-σ on the wall",
        ": poses.tum, refine.json, covariance.csv, ",
        "run.toml\nthe result may be used",
    ] {
        assert!(
            short.contains(part) && long.contains(part),
            "{part}: {short}"
        );
    }
    for table in ["observations  noise (grey)", "  stopped: ", "  decode "] {
        assert!(!short.contains(table), "{short}");
        assert!(long.contains(table), "{table}: {long}");
    }
}

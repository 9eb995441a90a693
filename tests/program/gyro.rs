//! Initial poses from a gyroscope's log, through the program: a simulated survey, a log of its true
//! rotations, refinement.

use crate::support::{fail, simulate, succeed, text, tunnelstitch};
use nalgebra::{UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write;
use std::path::Path;
use tunnelstitch::evaluate::wall_error;
use tunnelstitch::survey::Survey;
use tunnelstitch::trajectory::{Pose, poses_of, tum};

const HZ: f64 = 200.0;
/// Duration at rest before the first frame and after the last.
const REST_S: f64 = 4.0;
/// Noise of a sample: 20 mdeg/s/√Hz.
const NOISE_DEG_S: f64 = 0.28;
const BIAS_DEG_S: [f64; 3] = [0.6, -1.1, 0.3];

/// The log of a sensor with x right, y up and z backwards (`YxZ`) that rotates from pose to pose,
/// one per second.
///
/// The tunnel's bottom is at θ = 180°, and the first camera looks up, along z.
fn gcsv(truth: &[Pose], title: &str) -> String {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let steps: Vec<Vector3<f64>> = truth
        .windows(2)
        .map(|pair| (pair[0].r_wc.inverse() * pair[1].r_wc).scaled_axis())
        .collect();
    let mut text = format!(
        "{title}\nversion,1.3\nid,simulated\norientation,YxZ\n\
         frame_readout_time,12.5\nframe_readout_direction,1\n\
         tscale,0.001\ngscale,0.0001\nascale,0.0005\nt,gx,gy,gz,ax,ay,az\n"
    );
    let last_s = 2.0 * REST_S + steps.len() as f64;
    for k in 0..=(last_s * HZ) as usize {
        let t = k as f64 / HZ;
        let since = t - REST_S;
        let place = since.floor().clamp(0.0, steps.len() as f64) as usize;
        let rate = match steps.get(place) {
            Some(step) if since >= 0.0 => *step,
            _ => Vector3::zeros(),
        };
        let part = (since - place as f64).max(0.0);
        let attitude = truth[place].r_wc * UnitQuaternion::from_scaled_axis(rate * part);
        let up = attitude.inverse() * Vector3::z();
        let noise = Vector3::from_fn(|_, _| NOISE_DEG_S * normal());
        let measured = rate + (Vector3::from(BIAS_DEG_S) + noise).map(f64::to_radians);
        let sensor = |v: Vector3<f64>| Vector3::new(v.x, -v.y, -v.z);
        let (g, a) = (sensor(measured) / 0.0001, sensor(up) / 0.0005);
        writeln!(
            text,
            "{},{:.0},{:.0},{:.0},{:.0},{:.0},{:.0}",
            k * 5,
            g.x,
            g.y,
            g.z,
            a.x,
            a.y,
            a.z
        )
        .unwrap();
    }
    text
}

fn simulated(survey: &Path) -> Vec<Pose> {
    let options = ["--frames", "24", "--size", "240x180", "--seed", "3"];
    simulate(survey, &options);
    poses_of(&tum::read(&survey.join("groundtruth.tum")).unwrap())
}

/// The gyroscope's poses are far better than the plan's, their errors match the stated ones, and
/// refinement ends below a tenth of a pixel.
#[test]
fn a_gyros_log_makes_poses_that_refine() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    let truth = simulated(&survey);
    let log = dir.path().join("video.gcsv");
    std::fs::write(&log, gcsv(&truth, "GYROFLOW IMU LOG")).unwrap();
    let baseline = survey.join("gyro.tum");
    let lines = dir.path().join("lines.toml");
    let said = succeed(&[
        "gyro",
        text(&log),
        "--survey",
        text(&survey),
        "--fps",
        "1",
        "--time-offset-s",
        "4",
        "--advance-m",
        "0.1",
        "--down-deg",
        "180",
        "--rest-s",
        "3",
        "--scale-sigma-percent",
        "0",
        "--toml-out",
        text(&lines),
        "--out",
        text(&baseline),
    ]);
    assert!(said.contains("readout_ms = -12.5"), "{said}");
    assert!(said.contains("200.0 per second"), "{said}");

    // The errors of steps match the prior.
    let poses = poses_of(&tum::read(&baseline).unwrap());
    let lines = std::fs::read_to_string(&lines).unwrap();
    let sections: toml::Table = lines.parse().unwrap();
    let sigma = sections["prior"]["rotation_sigma_deg"]
        .as_float()
        .unwrap()
        .to_radians();
    let step_error = |poses: &[Pose]| {
        let squares: f64 = (1..poses.len())
            .map(|k| {
                let step = poses[k - 1].r_wc.inverse() * poses[k].r_wc;
                let true_step = truth[k - 1].r_wc.inverse() * truth[k].r_wc;
                step.angle_to(&true_step).powi(2) / 3.0
            })
            .sum();
        (squares / (poses.len() - 1) as f64).sqrt()
    };
    let ratio = step_error(&poses) / sigma;
    assert!((0.6..1.4).contains(&ratio), "{ratio}, said {sigma}");
    let plan = poses_of(&tum::read(&survey.join("baseline.tum")).unwrap());
    assert!(step_error(&poses) < 0.05 * step_error(&plan));
    // Gravity gives the first angle, to the noise of the rotation since rest.
    assert!(poses[0].r_wc.angle_to(&truth[0].r_wc) < 0.01);

    // A rest after the last frame, with a tilted carrier, works too; the bias is known to 0.011°/s
    // there, 0.3° until the first.
    let late = dir.path().join("late.tum");
    succeed(&[
        "gyro",
        text(&log),
        "--survey",
        text(&survey),
        "--fps",
        "1",
        "--time-offset-s",
        "4",
        "--advance-m",
        "0.1",
        "--down-deg",
        "180",
        "--rest-span-s",
        "27.5,30.5",
        "--out",
        text(&late),
        "--quiet",
    ]);
    let late = poses_of(&tum::read(&late).unwrap());
    assert!(late[0].r_wc.angle_to(&truth[0].r_wc) < 3.0 * 0.3f64.to_radians());

    let toml = survey.join("survey.toml");
    let all = std::fs::read_to_string(&toml).unwrap();
    let before = all.split("[poses]").next().unwrap().to_owned();
    std::fs::write(&toml, before + &lines).unwrap();
    let out = dir.path().join("out");
    succeed(&["refine", text(&survey), "--out", text(&out), "--quiet"]);
    let refined = poses_of(&tum::read(&out.join("poses.tum")).unwrap());
    let survey = Survey::open(&survey).unwrap();
    let px = |poses: &[Pose]| {
        let error = wall_error(survey.surface.as_ref(), &survey.cameras, poses, &truth);
        error.unwrap().px.rms
    };
    let (before, after) = (px(&poses), px(&refined));
    assert!(
        before > 1.0 && after < 0.1,
        "{before} px before, {after} px after"
    );
}

/// A plan with a stop determines the offset of the clocks.
#[test]
fn the_clock_is_found_by_the_plan() {
    let dir = tempfile::tempdir().unwrap();
    // Rotations of 5 to 33° per frame.
    let turns: Vec<f64> = (0..30)
        .scan(0.0, |angle: &mut f64, k: u32| {
            let now = *angle;
            *angle += 5.0 + f64::from(k * k % 29);
            Some(now)
        })
        .collect();
    let truth: Vec<Pose> = turns
        .iter()
        .map(|angle| {
            let turn = Vector3::y() * angle.to_radians();
            Pose::new(UnitQuaternion::from_scaled_axis(turn), Vector3::zeros())
        })
        .collect();
    let log = dir.path().join("video.gcsv");
    std::fs::write(&log, gcsv(&truth, "CAMERA IMU LOG")).unwrap();
    let table = dir.path().join("plan.csv");
    let mut rows = "frame,chainage_m,angle_deg\n".to_owned();
    for (k, angle) in turns.iter().enumerate() {
        writeln!(rows, "{k},{},{angle}", 0.05 * k as f64).unwrap();
    }
    std::fs::write(&table, rows).unwrap();
    let out = dir.path().join("poses.tum");
    let said = succeed(&[
        "gyro",
        text(&log),
        "--frames",
        "30",
        "--fps",
        "1",
        "--table",
        text(&table),
        "--match-plan-s",
        "-1,9",
        "--out",
        text(&out),
    ]);
    let offset_s: f64 = said
        .split_once("time offset ")
        .and_then(|(_, rest)| rest.split_whitespace().next())
        .unwrap()
        .parse()
        .unwrap();
    assert!((offset_s - REST_S).abs() < 0.003, "{said}");
    let poses = poses_of(&tum::read(&out).unwrap());
    // Two seconds of rest determine the bias to 0.28°/s / √400, which is 0.4° about each axis after
    // 29 s: three times that.
    let sigma = (29.0 * NOISE_DEG_S / 20.0).to_radians() * 3f64.sqrt();
    assert!(poses[29].r_wc.angle_to(&truth[29].r_wc) < 3.0 * sigma);
    assert!((poses[29].t_wc.y - 1.45).abs() < 1e-9);

    // Rates in radians that the header takes for degrees turn by a 57th of the plan.
    let wrong = dir.path().join("wrong.gcsv");
    let scaled = std::fs::read_to_string(&log).unwrap();
    let scaled = scaled.replace("gscale,0.0001", "gscale,1.7453292519943295e-6");
    std::fs::write(&wrong, scaled).unwrap();
    let frames = ["--frames", "30", "--fps", "1", "--time-offset-s", "4"];
    let plan = ["--table", text(&table), "--out", text(&out)];
    let output = tunnelstitch(&[&["gyro", text(&wrong)], &frames[..], &plan[..]].concat());
    let warned = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{warned}");
    assert!(
        warned.contains("write into its header: gscale,1.000000e-4"),
        "{warned}"
    );

    // The sensor given by a matrix from its axes to the camera's, and a reflected one.
    let mount = dir.path().join("mount.txt");
    std::fs::write(&mount, "1 0 0 0\n0 -1 0 0\n0 0 -1 0\n0 0 0 1\n").unwrap();
    let with = |more: &[&str]| {
        let all = [
            "gyro",
            text(&log),
            "--frames",
            "30",
            "--fps",
            "1",
            "--time-offset-s",
            "4",
            "--out",
            text(&out),
        ];
        let output = tunnelstitch(&[&all, more].concat());
        assert!(output.status.success(), "{output:?}");
        let poses = poses_of(&tum::read(&out).unwrap());
        (poses, String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (by_word, _) = with(&["--advance-m", "0.1"]);
    let (by_matrix, _) = with(&["--advance-m", "0.1", "--body-to-camera", text(&mount)]);
    for (a, b) in by_word.iter().zip(&by_matrix) {
        assert!(a.local(b).norm() < 1e-9, "{a:?} {b:?}");
    }
    let (mirrored, warned) = with(&["--orientation", "yxZ"]);
    assert!(
        warned.contains("is a reflection") && warned.contains("assumed to stay in place"),
        "{warned}"
    );
    assert!(mirrored[29].r_wc.angle_to(&by_word[29].r_wc) > 0.1);
}

#[test]
fn what_is_wrong_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let log = dir.path().join("video.gcsv");
    let out = dir.path().join("poses.tum");
    let good = gcsv(&[Pose::identity(); 4], "GYROFLOW IMU LOG");
    let cut = &good[..good.len() - 12];
    let unoriented = good.replace("orientation,YxZ\n", "");
    let restless = good.replace("gscale,0.0001", "gscale,0.1");
    let clock = &["--frames", "4", "--fps", "1"][..];
    for (text_of_log, arguments, code, expected) in [
        (&good[..], &["--frames", "4"][..], 2, "--fps"),
        (
            &good[..],
            &["--frames", "40", "--fps", "1"],
            3,
            "frame 12 at 12 s",
        ),
        (
            cut,
            clock,
            3,
            "columns where the table's first line names 7",
        ),
        (&unoriented, clock, 3, "--orientation"),
        (&restless, clock, 3, "never rested"),
        ("hello\n", clock, 3, "video.gcsv:1: `hello`"),
    ] {
        std::fs::write(&log, text_of_log).unwrap();
        let all = [&["gyro", text(&log), "--out", text(&out)], arguments].concat();
        let message = fail(&all, code);
        assert!(message.contains(expected), "{message}");
        assert!(!out.exists());
    }
}

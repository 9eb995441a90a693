//! Writes a simulated survey to a folder.

use crate::error::SimulateError;
use crate::lining::truth_file::format_deviation;
use crate::options::SimulateOptions;
use crate::rig::RigOptions;
use crate::scene::Scene;
use image::{GrayImage, Luma};
use rayon::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};
use tunnelstitch_core::frames::{PictureFormat, write_picture};
use tunnelstitch_core::persist::atomic::{self, StagedFolder, WriteError};
use tunnelstitch_core::progress::Progress;
use tunnelstitch_core::survey::{
    CameraSection, CameraSections, FramesSection, PosesSection, RigSection, SURVEY_FILE,
    SurveyFile, TunnelSection,
};
use tunnelstitch_geometry::camera::format_calibration;
use tunnelstitch_geometry::trajectory::{Pose, StampedPose, tum};

/// Content of `simulation.json`, from which the survey can be simulated again.
#[derive(Clone, Debug, Serialize)]
pub struct SimulationRecord {
    /// Name and version of the program.
    pub program: &'static str,
    /// Options of the simulation.
    pub options: SimulateOptions,
}

/// Simulates a survey and writes its folder.
///
/// The folder has `survey.toml`, `camera.json`, `frames/000000.png` … (or `.jpg`), `baseline.tum`
/// (the plan), `groundtruth.tum` and `simulation.json`, `mask.png` if the rig's shaft is visible,
/// `overlay.png` if the frames have an overlay, and `groundtruth_shape.csv` if the lining deviates
/// from the tunnel. A rig has the calibration and the mount of each camera in `rig/`, the frames in
/// a folder for each, and the poses are those of its body.
///
/// Nothing appears under the name `out` unless everything was written. With `overwrite`, an earlier
/// simulated survey of that name is replaced. The same options give the same bytes, whatever the
/// number of threads.
///
/// # Errors
/// [`SimulateError`].
pub fn write_survey(
    options: &SimulateOptions,
    out: &Path,
    overwrite: bool,
    progress: &dyn Progress,
) -> Result<SimulationRecord, SimulateError> {
    let (simulated, folder) = stage_survey(options, out, overwrite, progress)?;
    folder.finish()?;
    Ok(simulated)
}

/// Writes a survey as [`write_survey`] does, but leaves it to the caller to give the folder its
/// name.
///
/// # Errors
/// [`SimulateError`].
pub fn stage_survey(
    options: &SimulateOptions,
    out: &Path,
    overwrite: bool,
    progress: &dyn Progress,
) -> Result<(SimulationRecord, StagedFolder), SimulateError> {
    let scene = checked_scene(options, out, overwrite)?;
    let simulated = SimulationRecord {
        program: tunnelstitch_core::PROGRAM,
        options: options.clone(),
    };
    let folder = StagedFolder::begin(out)?;
    // Errors name the folder by its final name, not by that of the staging folder.
    let final_name = |error: WriteError| {
        let path = match error.path.strip_prefix(folder.path()) {
            Ok(inside) => out.join(inside),
            Err(_) => error.path,
        };
        WriteError::new(&path, error.source)
    };
    write_text_files(&scene, &simulated, folder.path()).map_err(final_name)?;
    write_masks(&scene, folder.path()).map_err(final_name)?;
    write_frames(&scene, folder.path(), progress).map_err(final_name)?;
    Ok((simulated, folder))
}

/// Checks what [`write_survey`] checks before the first frame; writes nothing.
///
/// # Errors
/// [`SimulateError`].
pub fn check_survey(
    options: &SimulateOptions,
    out: &Path,
    overwrite: bool,
) -> Result<(), SimulateError> {
    checked_scene(options, out, overwrite).map(drop)
}

/// The scene of a survey that can be written into the folder `out`.
fn checked_scene(
    options: &SimulateOptions,
    out: &Path,
    overwrite: bool,
) -> Result<Scene, SimulateError> {
    let scene = Scene::new(options)?;
    check_output_folder(out, overwrite)?;
    atomic::check_folder(atomic::parent_folder(out))?;
    Ok(scene)
}

/// Mask of the pixels that show the wall; only written if the rig's shaft is visible.
const MASK_FILE: &str = "mask.png";

/// Mask of the pixels that no frame's overlay covers; the survey does not name it.
const OVERLAY_FILE: &str = "overlay.png";

/// Centreline of a curved tunnel.
const CENTRELINE_FILE: &str = "centreline.txt";

/// Folder of the calibrations and mounts of a rig.
const RIG_FOLDER: &str = "rig";

/// True deviation of a lining as built.
const TRUE_SHAPE_FILE: &str = "groundtruth_shape.csv";

/// Record of the simulation, by which a simulated survey is recognised.
const RECORD_FILE: &str = "simulation.json";

/// Files of a simulated survey.
const FILES: [&str; 12] = [
    SURVEY_FILE,
    RECORD_FILE,
    // Written by the command line program.
    "run.toml",
    MASK_FILE,
    OVERLAY_FILE,
    CENTRELINE_FILE,
    "camera.json",
    "baseline.tum",
    "groundtruth.tum",
    TRUE_SHAPE_FILE,
    RIG_FOLDER,
    "frames",
];

/// Refuses to replace anything but a simulated survey.
fn check_output_folder(out: &Path, overwrite: bool) -> Result<(), SimulateError> {
    let exists = |what| {
        Err(SimulateError::Exists {
            path: out.to_owned(),
            what,
        })
    };
    if !out.exists() {
        return Ok(());
    }
    let is_empty = std::fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_none());
    if is_empty {
        return Ok(());
    }
    if !is_simulated(out) {
        return exists(
            "exists and is not just a simulated survey, so it is not replaced; \
             choose another folder",
        );
    }
    if !overwrite {
        return exists("the survey exists; choose another folder, or replace it with --force");
    }
    Ok(())
}

/// True if a folder holds only files that [`write_survey`] writes.
fn is_simulated(folder: &Path) -> bool {
    let Ok(mut entries) = std::fs::read_dir(folder) else {
        return false;
    };
    let ours = entries
        .all(|entry| entry.is_ok_and(|entry| FILES.iter().any(|name| entry.file_name() == *name)));
    ours && folder.join(RECORD_FILE).is_file()
}

fn write_text_files(
    scene: &Scene,
    simulated: &SimulationRecord,
    folder: &Path,
) -> Result<(), WriteError> {
    let options = &simulated.options;
    let survey = SurveyFile {
        tunnel: TunnelSection {
            centreline: options
                .tunnel
                .centreline
                .is_some()
                .then(|| CENTRELINE_FILE.into()),
            ..options.tunnel.clone()
        },
        camera: camera_sections(options),
        rig: options.rig.map(|_| RigSection::default()),
        frames: FramesSection {
            images: options.rig.is_none().then(|| pattern_of("frames", options)),
            mask: scene.shaft().map(|_| MASK_FILE.into()),
            ..FramesSection::default()
        },
        poses: PosesSection {
            truth: Some("groundtruth.tum".into()),
            ..PosesSection::of("baseline.tum")
        },
        prior: options.prior(),
        calibrate: None,
        options: std::collections::BTreeMap::new(),
    };
    let other = std::io::Error::other;
    let path = |name: &str| folder.join(name);
    let (survey_path, record_path) = (path(SURVEY_FILE), path(RECORD_FILE));
    let survey = toml::to_string(&survey)
        .map_err(|error| WriteError::new(&survey_path, other(error.to_string())))?;
    let record = serde_json::to_string_pretty(simulated)
        .map_err(|error| WriteError::new(&record_path, other(error.to_string())))?;
    let trajectory = |poses: &[Pose]| {
        let stamped = |frame: usize| StampedPose {
            time_s: frame as f64 * options.interval_s,
            pose: poses[frame],
        };
        let there: Vec<StampedPose> = match options.rig {
            Some(_) => (0..poses.len()).map(stamped).collect(),
            None => scene.frames().map(stamped).collect(),
        };
        tum::format(&there)
    };
    if let Some(centreline) = &options.tunnel.centreline {
        let copy = path(CENTRELINE_FILE);
        std::fs::copy(centreline, &copy).map_err(|source| WriteError::new(&copy, source))?;
    }
    if let Some(lining) = scene.tunnel.lining() {
        let shape = format_deviation(lining, scene.seen_h_m());
        atomic::write_text(&path(TRUE_SHAPE_FILE), &shape)?;
    }
    atomic::write_text(&survey_path, &survey)?;
    atomic::write_text(&record_path, &(record + "\n"))?;
    match options.rig {
        Some(rig) => write_rig(scene, &rig.mounts(), folder)?,
        None => atomic::write_text(&path("camera.json"), &format_calibration(scene.camera()))?,
    }
    let [plan, truth] = scene.given_poses();
    atomic::write_text(&path("baseline.tum"), &trajectory(plan))?;
    atomic::write_text(&path("groundtruth.tum"), &trajectory(truth))
}

/// The camera, or the cameras of a rig, of `survey.toml`.
fn camera_sections(options: &SimulateOptions) -> CameraSections {
    let of_rig = |rig: RigOptions| {
        let section = |k: u32| CameraSection {
            frames: Some(pattern_of(&frame_folder(k as usize), options)),
            body_to_camera: Some(mount_file(k as usize).into()),
            ..CameraSection::of_file(calibration_file(k as usize))
        };
        CameraSections::of_rig((0..rig.cameras).map(section).collect())
    };
    options.rig.and_then(of_rig).unwrap_or_else(|| {
        CameraSection {
            readout_ms: (options.readout_ms != 0.0).then_some(options.readout_ms),
            ..CameraSection::of_file("camera.json")
        }
        .into()
    })
}

/// Writes the calibrations and the mounts of a rig.
fn write_rig(scene: &Scene, mounts: &[Pose], folder: &Path) -> Result<(), WriteError> {
    atomic::create_folder(&folder.join(RIG_FOLDER))?;
    for (k, (camera, mount)) in scene.cameras().all().iter().zip(mounts).enumerate() {
        let calibration = folder.join(calibration_file(k));
        atomic::write_text(&calibration, &format_calibration(camera))?;
        let motion = mount.inverse();
        let r = motion.r_wc.to_rotation_matrix();
        let row = |k: usize| {
            let t = motion.t_wc[k];
            format!("{} {} {} {t}\n", r[(k, 0)], r[(k, 1)], r[(k, 2)])
        };
        let matrix: String = (0..3).map(row).collect();
        let text = format!("# x_camera = T x_body, metres\n{matrix}0 0 0 1\n");
        atomic::write_text(&folder.join(mount_file(k)), &text)?;
    }
    Ok(())
}

/// Name of the calibration of a camera of a rig.
fn calibration_file(camera: usize) -> String {
    format!("{RIG_FOLDER}/camera{camera}.json")
}

/// Name of the mount of a camera of a rig.
fn mount_file(camera: usize) -> String {
    format!("{RIG_FOLDER}/mount{camera}.txt")
}

/// Name of the folder with the frames of a camera of a rig.
fn frame_folder(camera: usize) -> String {
    format!("frames/camera{camera}")
}

/// The pattern of the frames in a folder.
fn pattern_of(folder: &str, options: &SimulateOptions) -> String {
    format!("{folder}/*.{}", frame_format(options).1)
}

/// Writes the masks of the rig's shaft and of the overlay, each if it is visible.
fn write_masks(scene: &Scene, folder: &Path) -> Result<(), WriteError> {
    if let Some(shaft) = scene.shaft() {
        write_mask(scene, &shaft.wall_mask(), &folder.join(MASK_FILE))?;
    }
    if let Some(overlay) = scene.overlay() {
        let wall = overlay.wall_mask(scene.frames());
        write_mask(scene, &wall, &folder.join(OVERLAY_FILE))?;
    }
    Ok(())
}

/// Writes a mask: white where the wall is shown, black elsewhere.
fn write_mask(scene: &Scene, wall: &[bool], path: &Path) -> Result<(), WriteError> {
    let [width, height] = scene.cameras().size();
    let mask = GrayImage::from_fn(width, height, |u, v| {
        let shown = wall[v as usize * width as usize + u as usize];
        Luma([if shown { 255 } else { 0 }])
    });
    write_picture(path, &mask.into(), PictureFormat::Png)
}

/// Format and extension of the frames.
fn frame_format(options: &SimulateOptions) -> (PictureFormat, &'static str) {
    match options.effects.jpeg_quality {
        Some(quality) => (PictureFormat::Jpeg { quality }, "jpg"),
        None => (PictureFormat::Png, "png"),
    }
}

/// Renders and writes all frames that exist into the survey's `folder`, named by their numbers in
/// the plan.
///
/// The frames of a batch are rendered in parallel from one raster of the wall.
fn write_frames(scene: &Scene, folder: &Path, progress: &dyn Progress) -> Result<(), WriteError> {
    let frames = folder.join("frames");
    atomic::create_folder(&frames)?;
    let cameras = scene.cameras().count();
    let of_camera: Vec<PathBuf> = match scene.options.rig {
        Some(_) => (0..cameras).map(|k| folder.join(frame_folder(k))).collect(),
        None => vec![frames],
    };
    for folder in &of_camera {
        atomic::create_folder(folder)?;
    }
    let (format, extension) = frame_format(&scene.options);
    progress.start("simulating", scene.frames().count());
    for batch in scene.batches() {
        let rasters = scene.rasters(&batch.stretches);
        batch
            .frames
            .into_par_iter()
            .try_for_each(|(frame, source)| {
                let image = scene.digitised_frame(&rasters, source);
                let folder = &of_camera[frame % cameras];
                let path = folder.join(format!("{:06}.{extension}", frame / cameras));
                write_picture(&path, &image, format)?;
                progress.advance(1);
                Ok(())
            })?;
    }
    progress.finish();
    Ok(())
}

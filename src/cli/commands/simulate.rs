//! `tunnelstitch simulate`: writes a survey of a simulated tunnel.

use crate::camera::{Camera, Lens, read_calibration};
use crate::cli::arguments::{
    AsBuiltArguments, DegradationArguments, ImagingArguments, JitterArgument, TunnelArguments,
    WallArgument, input_file, numbers, output_folder, picture_size, positive, view_angle,
};
use crate::cli::output::{
    DryRunArguments, Failure, Job, RUN_FILE, RunRecord, Terminal, json, record,
};
use crate::files::printed;
use crate::persist::atomic::OutputSet;
use crate::simulate::{self, Illumination, RigOptions, SimulateOptions, Wall};
use crate::survey::PriorSection;
use crate::trajectory::JitterModel;
use clap::ValueEnum;
use std::path::{Path, PathBuf};

/// Simulates a survey: frames of a tunnel wall, initial poses with errors, and the true poses.
///
/// Writes a folder that all other commands accept: survey.toml, camera.json, frames, baseline.tum
/// (the planned poses), groundtruth.tum, and simulation.json, which records the options. A lining
/// that is not as drawn has groundtruth_shape.csv: its true deviation. An overlay has overlay.png.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    tunnelstitch simulate free --out survey\n  \
    tunnelstitch simulate free --wall concrete --jitter independent --seed 7 --out survey\n  \
    tunnelstitch simulate off-centre --texture bricks.jpg --texture-width-m 2 --out survey\n  \
    tunnelstitch simulate free --lamp-corner 0.4 --gain-percent 20 --bias-grey 5 \
    --specular-percent 3 --out damp\n  \
    tunnelstitch simulate free --shape horseshoe --width-m 5 --height-m 4 \
    --centreline bend.txt --out curved\n  \
    tunnelstitch simulate free --segments 6 --ring-length-m 1.5 --step-mm 3 --cables 4 --lamps 2 \
    --out built\n  \
    tunnelstitch simulate free --interval-s 0.333 --readout-ms 20 --out rolling\n  \
    tunnelstitch simulate free --lamp-offset-m 0.1,0,0 --sheen-percent 20 --overlay both \
    --gamma 2.2 --motion-blur-px 3 --jpeg-quality 80 --out real\n  \
    tunnelstitch simulate free --rig 3 --frames 60 --out rig\n  \
    tunnelstitch simulate free --view forward --lamp-offset-m 0,0,0 --out forward\n  \
    tunnelstitch simulate free --turns 2 --moving 8 --bad-frames 5:black,18-20:missing --out bad"
)]
pub struct SimulateArguments {
    /// Experiment of the paper; the options below change it.
    #[arg(value_enum)]
    experiment: Experiment,
    /// Folder for the survey.
    #[arg(long, short, value_name = "DIR", value_parser = output_folder())]
    out: PathBuf,
    /// Replace an earlier simulated survey in this folder.
    #[arg(long)]
    force: bool,
    /// Number of frames [default: 12; free: 120].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Number of turns of the camera, instead of a number of frames.
    #[arg(long, value_name = "N", conflicts_with = "frames", value_parser = positive)]
    turns: Option<f64>,
    /// Advance along the axis per frame, metres [default: 0; free: 0.1].
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    advance_m: Option<f64>,
    /// Turn about the axis per frame, degrees [default: 30; with --view forward: 0].
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    turn_deg: Option<f64>,
    /// Angle between the optical axis and the axis of the tunnel: side (90 degrees), forward (0),
    /// or degrees from 0 to 180. Unless it is side, the wall fades into dark fog from 30 to 60
    /// radii away; a view along the axis is drawn up to there.
    #[arg(long, value_name = "side|forward|DEG", default_value = "side", value_parser = view_angle)]
    view: f64,
    /// Time between frames, seconds.
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = positive)]
    interval_s: f64,
    /// Rolling shutter: readout time from a frame's first row to its last, milliseconds; negative
    /// if rows are read bottom-up. Poses are those of the middle row.
    #[arg(
        long,
        value_name = "MS",
        default_value_t = 0.0,
        allow_hyphen_values = true
    )]
    readout_ms: f64,
    #[command(flatten)]
    tunnel: TunnelArguments,
    /// Calibration file of the camera, in any format and with any lens model that survey.toml
    /// accepts.
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = ["size", "fov_deg", "k1", "k2"],
        value_parser = input_file()
    )]
    camera: Option<PathBuf>,
    /// Number of cameras of a rig: each takes a frame at every moment, and --frames counts the
    /// moments. They are spread about the carrier's axis (with --view forward about the vertical of
    /// the picture, so that the second of two looks back) and differ a little; the poses are those
    /// of the rig's body, and survey.toml has a table of each camera.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=16))]
    rig: Option<u32>,
    /// Angle between the first and the last camera of the rig, degrees [default: all around].
    #[arg(long, value_name = "DEG", requires = "rig")]
    rig_spread_deg: Option<f64>,
    /// Width and height of the frames, pixels.
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = picture_size)]
    size: [u32; 2],
    /// Vertical field of view, degrees.
    #[arg(long, value_name = "DEG", default_value_t = 60.0)]
    fov_deg: f64,
    /// Radial distortion k1 in OpenCV's convention. --fov-deg is the field of view without
    /// distortion.
    #[arg(
        long,
        value_name = "K1",
        default_value_t = 0.0,
        allow_hyphen_values = true
    )]
    k1: f64,
    /// Radial distortion k2 in OpenCV's convention.
    #[arg(
        long,
        value_name = "K2",
        default_value_t = 0.0,
        allow_hyphen_values = true
    )]
    k2: f64,
    /// Errors of the initial poses: accumulating from frame to frame, or independent
    /// [default: none; free: random-walk].
    #[arg(long, value_enum)]
    jitter: Option<JitterArgument>,
    /// 1-σ of the rotation errors about each axis, degrees [default: 2 with jitter].
    #[arg(long, value_name = "DEG")]
    rotation_sigma_deg: Option<f64>,
    /// 1-σ of the translation errors along x, y and z, metres
    /// [default: 0.02,0.02,0.03 with jitter].
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>)]
    translation_sigma_m: Option<[f64; 3]>,
    /// Texture of the wall.
    #[arg(long, value_enum, default_value_t)]
    wall: WallArgument,
    /// A picture as texture of the wall, instead.
    #[arg(long, value_name = "FILE", conflicts_with = "wall")]
    texture: Option<PathBuf>,
    /// Width of that picture on the wall, metres; adjusted so that a whole number of copies fits
    /// around the section.
    #[arg(long, value_name = "M", default_value_t = 1.0, requires = "texture")]
    texture_width_m: f64,
    /// Illumination of the wall.
    #[arg(long, value_enum, default_value_t)]
    light: LightArgument,
    /// 1-σ of the sensor's noise, grey levels.
    #[arg(long, value_name = "GREY", default_value_t = 2.0)]
    noise: f64,
    /// Samples along each side of a pixel (anti-aliasing); fewer are faster, but alias at sharp
    /// edges.
    #[arg(long, value_name = "N", default_value_t = 8)]
    supersample: u32,
    #[command(flatten)]
    as_built: AsBuiltArguments,
    #[command(flatten)]
    degradations: DegradationArguments,
    #[command(flatten)]
    imaging: ImagingArguments,
    /// Seed of everything random (wall, jitter, noise, degradations): the same seed gives the same
    /// bytes.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    dry_run: DryRunArguments,
}

/// Names of experiments.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Experiment {
    /// The camera is on the axis; the initial poses are true.
    Centred,
    /// The camera is at (0.5, 0, 0.5) m, while the initial poses are on the axis.
    OffCentre,
    /// The camera flies forward; every step deviates from the plan.
    Free,
}

/// Names of illuminations.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum LightArgument {
    /// Bright at θ = 0, dark at 180°.
    #[default]
    Downward,
    /// Uniform.
    Even,
}

impl SimulateArguments {
    /// Options for the library.
    ///
    /// # Errors
    /// A camera that cannot be read or described.
    fn options(&self) -> Result<SimulateOptions, Failure> {
        let preset = match self.experiment {
            Experiment::Centred => SimulateOptions::centred(),
            Experiment::OffCentre => SimulateOptions::off_centre(),
            Experiment::Free => SimulateOptions::free(),
        };
        let frames = match (self.frames, self.turns) {
            (Some(frames), _) => frames as usize,
            (None, Some(turns)) => (turns * 360.0 / self.turn_deg().abs()).round() as usize,
            (None, None) => preset.frames,
        };
        let wall = match (&self.texture, self.wall) {
            (Some(path), _) => Wall::Texture {
                path: path.clone(),
                width_m: self.texture_width_m,
            },
            (None, WallArgument::Brick) => Wall::Brick,
            (None, WallArgument::Concrete) => Wall::Concrete,
            (None, WallArgument::TiledBrick) => Wall::TiledBrick,
            (None, WallArgument::Target) => Wall::Target,
        };
        let camera = self.camera()?;
        let options = SimulateOptions {
            frames,
            advance_m: self.advance_m.unwrap_or(preset.advance_m),
            turn_deg: self.turn_deg(),
            view_deg: self.view,
            interval_s: self.interval_s,
            readout_ms: self.readout_ms,
            tunnel: self.tunnel.section(),
            camera,
            rig: self.rig.map(|cameras| RigOptions {
                cameras,
                spread_deg: self.rig_spread_deg,
            }),
            jitter: self.jitter(preset.jitter),
            wall,
            light: match self.light {
                LightArgument::Downward => Illumination::Downward,
                LightArgument::Even => Illumination::Even,
            },
            noise_grey: self.noise,
            supersample: self.supersample,
            seed: self.seed,
            ..preset
        };
        let options = self.degradations.add_to(self.as_built.add_to(options));
        Ok(self.imaging.add_to(options))
    }

    /// Turn from frame to frame, degrees; a camera that looks forward does not revolve by default.
    fn turn_deg(&self) -> f64 {
        let default = if self.view == 0.0 { 0.0 } else { 30.0 };
        self.turn_deg.unwrap_or(default)
    }

    /// The camera of --camera, or a pinhole camera with radial distortion.
    ///
    /// # Errors
    /// A malformed file; an impossible field of view; distortion that is not monotonic.
    fn camera(&self) -> Result<Camera, Failure> {
        if let Some(path) = &self.camera {
            return Ok(read_calibration(path, None)?);
        }
        let [width, height] = self.size;
        if !(self.fov_deg > 0.0 && self.fov_deg < 170.0) {
            return Err(Failure::usage(
                "--fov-deg must lie between 0 and 170 degrees; for a fisheye, give a --camera file",
            ));
        }
        let camera = Camera {
            lens: Lens::radial(self.k1, self.k2),
            ..Camera::from_vertical_fov(width, height, self.fov_deg.to_radians())
        };
        if camera.visible_fraction() < 1.0 {
            return Err(Failure::usage(
                "--k1 and --k2: the distortion must be monotonic up to the corners of the image",
            ));
        }
        Ok(camera)
    }

    /// The preset's jitter with the arguments' changes; without a preset, any of the arguments adds
    /// jitter.
    fn jitter(&self, preset: Option<PriorSection>) -> Option<PriorSection> {
        let is_given = self.jitter.is_some()
            || self.rotation_sigma_deg.is_some()
            || self.translation_sigma_m.is_some();
        let jitter = preset.or(is_given.then(PriorSection::default))?;
        Some(PriorSection {
            model: self.jitter.map_or(jitter.model, JitterModel::from),
            rotation_sigma_deg: self.rotation_sigma_deg.unwrap_or(jitter.rotation_sigma_deg),
            translation_sigma_m: self
                .translation_sigma_m
                .unwrap_or(jitter.translation_sigma_m),
        })
    }
}

/// Runs the command.
///
/// # Errors
/// Impossible options, or an output that cannot be written.
pub fn run(
    arguments: &SimulateArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    if arguments.turns.is_some() && arguments.turn_deg() == 0.0 {
        return Err(Failure::usage(
            "--turns needs a --turn-deg other than 0; or give a number of --frames",
        ));
    }
    let options = arguments.options()?;
    let out = &arguments.out;
    let inputs = [
        &arguments.camera,
        &arguments.texture,
        &options.tunnel.centreline,
        &options.as_built.shape_file,
    ];
    let inputs: Vec<&Path> = inputs.into_iter().flatten().map(AsRef::as_ref).collect();
    if arguments.dry_run.is_set() {
        simulate::check_survey(&options, out, arguments.force)?;
        return describe(&options, &inputs, out).print(terminal);
    }
    let (simulated, folder) = simulate::stage_survey(&options, out, arguments.force, terminal)?;
    let inputs = record::hash_files(inputs)?;
    let mut outputs = OutputSet::default();
    outputs.folder(folder)?;
    record.add_to(&mut outputs, &out.join(RUN_FILE), &inputs)?;
    outputs.commit()?;
    if terminal.is_json() {
        return json::print(&simulated);
    }
    // Collecting the components drops a trailing slash.
    let out: PathBuf = arguments.out.components().collect();
    let out = printed(&out);
    let next = match arguments.experiment {
        Experiment::Free => format!("refine {out} --out {out}-refined"),
        Experiment::Centred | Experiment::OffCentre => {
            format!("stitch {out} --poses truth --out {out}.png")
        }
    };
    terminal.say(format!(
        "{out}: {} frames of {} × {} px, with true poses\nnext: tunnelstitch {next}",
        frame_count(&options),
        options.camera.width,
        options.camera.height
    ));
    Ok(())
}

/// Number of frames that are written.
fn frame_count(options: &SimulateOptions) -> usize {
    options.pictures() - options.bad_frames.missing_count()
}

/// The work of simulating a survey from `inputs` into the folder `out`.
fn describe(options: &SimulateOptions, inputs: &[&Path], out: &Path) -> Job {
    let (width, height) = (options.camera.width, options.camera.height);
    Job {
        reads: inputs.iter().map(|path| path.to_path_buf()).collect(),
        writes: vec![out.to_owned()],
        amount: Some(format!(
            "{} frames of {width} × {height} px to simulate",
            frame_count(options)
        )),
        ..Job::default()
    }
}

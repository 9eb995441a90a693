//! `tunnelstitch simulate`: a survey of a tunnel that never was.

use super::hardships::HardshipArguments;
use super::record::{self, RUN_FILE, Run};
use super::stitch::positive;
use super::tunnel::TunnelArguments;
use super::{Failure, Terminal, json};
use crate::camera::{Camera, Lens, read_calibration};
use crate::simulate::{self, Illumination, SimulateOptions, Wall};
use crate::survey::PriorSection;
use crate::trajectory::JitterModel;
use clap::ValueEnum;
use std::path::PathBuf;

/// Simulates a survey: frames of a tunnel wall, wrong initial poses, and the true ones.
///
/// Writes a folder that all other commands take: survey.toml, camera.json, frames, baseline.tum
/// (the plan), groundtruth.tum, and simulation.json, which records the options.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    tunnelstitch simulate free --out survey\n  \
    tunnelstitch simulate free --wall concrete --jitter independent --seed 7 --out survey\n  \
    tunnelstitch simulate off-centre --texture bricks.jpg --texture-width-m 2 --out survey\n  \
    tunnelstitch simulate free --lamp-corner 0.4 --gain-percent 20 --bias-grey 5 --specular-percent 3 --out damp\n  \
    tunnelstitch simulate free --shape horseshoe --width-m 5 --height-m 4 --centreline bend.txt --out curved\n  \
    tunnelstitch simulate free --interval-s 0.333 --readout-ms 20 --out rolling\n  \
    tunnelstitch simulate free --turns 2 --moving 8 --bad-frames 5:black,18-20:missing --out bad"
)]
pub struct SimulateArguments {
    /// Which of the paper's experiments; the options below change it.
    #[arg(value_enum)]
    experiment: Experiment,
    /// Folder for the survey.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Replace an earlier simulated survey of that name.
    #[arg(long)]
    force: bool,
    /// Number of frames [default: 12; free: 120].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Turns of the camera, instead of a number of frames.
    #[arg(long, value_name = "N", conflicts_with = "frames", value_parser = positive)]
    turns: Option<f64>,
    /// Advance from frame to frame, metres [default: 0; free: 0.1].
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    advance_m: Option<f64>,
    /// Turn from frame to frame, degrees.
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = 30.0,
        allow_hyphen_values = true
    )]
    turn_deg: f64,
    /// Time from frame to frame, seconds: the poses' times.
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = positive)]
    interval_s: f64,
    /// Rolling shutter: time from reading a frame's first row to reading its last, milliseconds;
    /// negative: bottom-up. Poses are those of the middle row.
    #[arg(
        long,
        value_name = "MS",
        default_value_t = 0.0,
        allow_hyphen_values = true
    )]
    readout_ms: f64,
    #[command(flatten)]
    tunnel: TunnelArguments,
    /// Calibration file of the camera: any lens, of any of the kinds that `survey.toml` takes.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["size", "fov_deg", "k1", "k2"])]
    camera: Option<PathBuf>,
    /// Width and height of the frames, pixels.
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = size)]
    size: [u32; 2],
    /// Vertical field of view, degrees.
    #[arg(long, value_name = "DEG", default_value_t = 60.0)]
    fov_deg: f64,
    /// Radial distortion of the lens: k1 in OpenCV's convention. The field of view is that without
    /// distortion.
    #[arg(
        long,
        value_name = "K1",
        default_value_t = 0.0,
        allow_hyphen_values = true
    )]
    k1: f64,
    /// The same: k2.
    #[arg(
        long,
        value_name = "K2",
        default_value_t = 0.0,
        allow_hyphen_values = true
    )]
    k2: f64,
    /// Noise on the plan: errors that add up from frame to frame, or each frame on its own
    /// [default: none; free: random-walk].
    #[arg(long, value_enum)]
    jitter: Option<JitterArgument>,
    /// 1-σ of the jitter about each axis, degrees [default: 2 with jitter].
    #[arg(long, value_name = "DEG")]
    rotation_sigma_deg: Option<f64>,
    /// 1-σ of the jitter along x, y and z, metres [default: 0.02,0.02,0.03 with jitter].
    #[arg(long, value_name = "X,Y,Z", value_parser = three_numbers)]
    translation_sigma_m: Option<[f64; 3]>,
    /// What the wall looks like.
    #[arg(long, value_enum, default_value_t)]
    wall: WallArgument,
    /// A picture to paper the wall with, instead.
    #[arg(long, value_name = "FILE", conflicts_with = "wall")]
    texture: Option<PathBuf>,
    /// Width of that picture on the wall, metres; it repeats, a whole number of times around.
    #[arg(long, value_name = "M", default_value_t = 1.0, requires = "texture")]
    texture_width_m: f64,
    /// How the wall is lit.
    #[arg(long, value_enum, default_value_t)]
    light: LightArgument,
    /// 1-σ of the sensor's noise, grey levels.
    #[arg(long, value_name = "GREY", default_value_t = 2.0)]
    noise: f64,
    /// Points along each side of a pixel; fewer are faster, and alias where the wall is sharp.
    #[arg(long, value_name = "N", default_value_t = 8)]
    supersample: u32,
    #[command(flatten)]
    hardships: HardshipArguments,
    /// Seed of all that is random (wall, jitter, noise, hardships): the same seed gives the same
    /// bytes.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print the record (simulation.json) on standard output.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Experiment {
    /// From the axis; the initial poses are true.
    Centred,
    /// From (0.5, 0, 0.5) m, while the initial poses claim the axis.
    OffCentre,
    /// Flying forward, every step off the plan.
    Free,
}

/// Noise models by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum JitterArgument {
    /// Errors add up from frame to frame.
    RandomWalk,
    /// Each frame errs on its own.
    Independent,
}

impl From<JitterArgument> for JitterModel {
    fn from(jitter: JitterArgument) -> Self {
        match jitter {
            JitterArgument::RandomWalk => Self::RandomWalk,
            JitterArgument::Independent => Self::Independent,
        }
    }
}

/// Walls by name.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum WallArgument {
    /// Bricks, each with a tone of its own.
    #[default]
    Brick,
    /// Smooth stains of low contrast.
    Concrete,
    /// A tile of 8 × 6 bricks that repeats.
    TiledBrick,
    /// Dark and bright squares on mid grey, turned by 5°: slanted edges, as ISO 12233 measures
    /// sharpness by.
    Target,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum LightArgument {
    /// Bright at θ = 0, dark at 180°.
    #[default]
    Downward,
    /// The same everywhere.
    Even,
}

/// Width and height of a picture, for clap: "640x480".
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once(['x', '×']).and_then(|(width, height)| {
        Some([width.trim().parse().ok()?, height.trim().parse().ok()?])
    });
    parsed.ok_or_else(|| "must be width x height in pixels, as 640x480".to_owned())
}

fn three_numbers(text: &str) -> Result<[f64; 3], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    numbers
        .ok()
        .and_then(|numbers| <[f64; 3]>::try_from(numbers).ok())
        .ok_or_else(|| "must be three numbers with commas between, as 0.02,0.02,0.03".to_owned())
}

impl SimulateArguments {
    fn options(&self) -> Result<SimulateOptions, Failure> {
        let preset = match self.experiment {
            Experiment::Centred => SimulateOptions::centred(),
            Experiment::OffCentre => SimulateOptions::off_centre(),
            Experiment::Free => SimulateOptions::free(),
        };
        let frames = match (self.frames, self.turns) {
            (Some(frames), _) => frames as usize,
            (None, Some(turns)) => (turns * 360.0 / self.turn_deg.abs()).round() as usize,
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
        Ok(self.hardships.add_to(SimulateOptions {
            frames,
            advance_m: self.advance_m.unwrap_or(preset.advance_m),
            turn_deg: self.turn_deg,
            interval_s: self.interval_s,
            readout_ms: self.readout_ms,
            tunnel: self.tunnel.section(),
            camera,
            jitter: self.jitter_of(preset.jitter),
            wall,
            light: match self.light {
                LightArgument::Downward => Illumination::Downward,
                LightArgument::Even => Illumination::Even,
            },
            noise_grey: self.noise,
            supersample: self.supersample,
            seed: self.seed,
            ..preset
        }))
    }

    fn camera(&self) -> Result<Camera, Failure> {
        if let Some(path) = &self.camera {
            return Ok(read_calibration(path, None)?);
        }
        let [width, height] = self.size;
        if !(self.fov_deg > 0.0 && self.fov_deg < 170.0) {
            return Err(Failure::usage(
                "--fov-deg must lie between 0 and 170 degrees; a --camera file may describe a fisheye",
            ));
        }
        let camera = Camera {
            lens: Lens::radial(self.k1, self.k2),
            ..Camera::from_vertical_fov(width, height, self.fov_deg.to_radians())
        };
        if camera.shown_share() < 1.0 {
            return Err(Failure::usage(
                "--k1 and --k2 must not fold the picture back on itself before its corners",
            ));
        }
        Ok(camera)
    }

    /// The preset's jitter with the arguments' changes; any of them asks for jitter.
    fn jitter_of(&self, preset: Option<PriorSection>) -> Option<PriorSection> {
        let asked = self.jitter.is_some()
            || self.rotation_sigma_deg.is_some()
            || self.translation_sigma_m.is_some();
        let jitter = preset.or(asked.then(PriorSection::default))?;
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
pub fn run(arguments: &SimulateArguments, run: &Run, terminal: &Terminal) -> Result<(), Failure> {
    if arguments.turns.is_some() && arguments.turn_deg == 0.0 {
        return Err(Failure::usage(
            "--turns needs a --turn-deg other than 0; or give a number of --frames",
        ));
    }
    let options = arguments.options()?;
    let simulated = simulate::write_survey(&options, &arguments.out, arguments.force, terminal)?;
    let inputs = [
        &arguments.camera,
        &arguments.texture,
        &options.tunnel.centreline,
    ];
    let inputs = record::files(inputs.into_iter().flatten().map(AsRef::as_ref))?;
    run.write(&arguments.out.join(RUN_FILE), &inputs)?;
    if arguments.json {
        return json::print(&simulated);
    }
    // Without a slash at its end.
    let out: PathBuf = arguments.out.components().collect();
    let out = out.display();
    let next = match arguments.experiment {
        Experiment::Free => format!("refine {out} --out {out}-refined"),
        Experiment::Centred | Experiment::OffCentre => {
            format!("stitch {out} --poses truth --out {out}.png")
        }
    };
    terminal.say(format!(
        "{out}: {} frames of {} × {} px, with true poses\nnext: tunnelstitch {next}",
        options.frames - options.bad_frames.missing_count(),
        options.camera.width,
        options.camera.height
    ));
    Ok(())
}

//! `tunnelstitch stitch`: draws one panorama from given poses, as a whole or in shards.

use crate::cli::arguments::{
    BlendArguments, OutputArguments, PictureArguments, PosesArguments, ResumeArguments,
    memory_size, resume,
};
use crate::cli::commands::overlay::leave_out_overlay;
use crate::cli::commands::stitch_maps::MapInputs;
use crate::cli::commands::stitch_run::StitchRun;
use crate::cli::commands::stitch_shards::{SEAMS_FILE, join_shards, write_seams, write_shard};
use crate::cli::output::{
    DryRunArguments, Failure, RunRecord, Terminal, is_stream, print_file, record,
    refuse_two_results,
};
use crate::persist::atomic::ScratchFolder;
use crate::persist::shard_number::ShardNumber;
use crate::render::{PanoramaFileOptions, Stitch, StitchOptions};
use crate::trajectory::poses_of;
use std::path::{Path, PathBuf};

/// Draws one panorama of the unrolled wall from given poses.
///
/// The poses are used as they are; `refine` improves them. If the run is interrupted, the same
/// command continues it.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    tunnelstitch stitch my-survey --poses refined/poses.tum --out after.png\n  \
    tunnelstitch stitch my-survey --poses refined/poses.tum --px-per-metre 400 --out wall.tif \
    --maps maps\n\n\
    A long survey in two shards, on two machines, and joined:\n  \
    tunnelstitch stitch my-survey --seams --out parts\n  \
    tunnelstitch stitch my-survey --shard 1/2 --out parts\n  \
    tunnelstitch stitch my-survey --shard 2/2 --out parts\n  \
    tunnelstitch stitch my-survey --join parts --out wall.tif")]
pub struct StitchArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    #[command(flatten)]
    poses: PosesArguments,
    #[command(flatten)]
    output: OutputArguments,
    #[command(flatten)]
    picture: PictureArguments,
    #[command(flatten)]
    blend: BlendArguments,
    /// Memory limit, as 512MiB or 2GiB. Frames that do not fit are decoded again when they are
    /// needed.
    #[arg(long, value_name = "SIZE", default_value = "2GiB", value_parser = memory_size)]
    memory: u64,
    /// Treat every camera as if it stood on the tunnel's axis, to see the effect of its position.
    #[arg(long)]
    ignore_offset: bool,
    /// Find only exposures and seams, and write seams.state into the folder --out, for --shard.
    #[arg(long, conflicts_with_all = ["shard", "join", "dzi"])]
    seams: bool,
    /// Draw only shard K of N stretches along the tunnel, counted from 1, with the exposures and
    /// seams in the folder --out, and write shard-K-of-N into it, for --join. It decodes its own
    /// frames only.
    #[arg(long, value_name = "K/N", conflicts_with_all = ["join", "dzi"])]
    shard: Option<ShardNumber>,
    /// Put the panorama, a .tif, together from the seams and all shards in FOLDER. It has the bytes
    /// of one that is drawn as a whole.
    #[arg(long, value_name = "FOLDER", conflicts_with = "dzi")]
    join: Option<PathBuf>,
    #[command(flatten)]
    resume: ResumeArguments,
    #[command(flatten)]
    dry_run: DryRunArguments,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the survey, the poses or the output.
pub fn run(
    arguments: &StitchArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    if is_stream(&arguments.output.out) {
        return print_panorama(arguments, record, terminal);
    }
    draw(arguments, &arguments.output, record, terminal)
}

/// Draws the panorama into a scratch folder, and writes it on standard output as a PNG.
fn print_panorama(
    arguments: &StitchArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let output = &arguments.output;
    refuse_two_results(&output.out, terminal)?;
    if arguments.part().is_some() || arguments.join.is_some() || arguments.dry_run.is_set() {
        return Err(Failure::usage(
            "--out - writes a whole panorama on standard output; name a file or folder by --out \
             with --seams, --shard, --join and --dry-run",
        ));
    }
    let scratch = ScratchFolder::inside(&std::env::temp_dir())?;
    let drawn = output.with_panorama(scratch.path().join("panorama.png"));
    draw(arguments, &drawn, record, &Terminal::new(true, false))?;
    print_file(&drawn.out)
}

/// Draws the panorama, or a part of it, into the files `output`.
fn draw(
    arguments: &StitchArguments,
    output: &OutputArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let part = arguments.part();
    match (&part, &arguments.join) {
        (Some(_), _) => output.check_folder_of_parts()?,
        (None, Some(_)) => output.check_name_of_tiff()?,
        (None, None) => output.check_names()?,
    }
    let (mut survey, trajectory) = arguments.poses.open(&arguments.survey, terminal)?;
    output.check_overwriting(&survey)?;
    // Parts are joined without a look at frames.
    if arguments.join.is_none() {
        leave_out_overlay(&mut survey, terminal)?;
    }
    let (options, layout) = (arguments.options(), arguments.picture.canvas.layout.into());
    let mut stitch = Stitch::new(
        survey.surface.as_ref(),
        &survey.cameras,
        &survey.frames,
        &poses_of(&trajectory),
        &survey.shutter(),
        &options,
    )?;
    let (canvas, format) = (*stitch.canvas(), stitch.frames().format());
    let files = arguments.files(output);
    let budget = stitch.budget(files.pending_bytes(&canvas, format, layout))?;
    output.check_formats(&canvas, format, layout)?;
    let run = StitchRun {
        output,
        files,
        poses: arguments.poses.file(),
        survey: &survey,
        options,
        layout,
        budget: match &part {
            Some(_) => budget.without_spare_room(),
            None => budget,
        },
        map_inputs: match &part {
            Some(_) => MapInputs::default(),
            None => MapInputs::read(output, arguments.poses.file(), &survey)?,
        },
        record,
        terminal,
    };
    if arguments.dry_run.is_set() {
        return run.job(&stitch, part).print(terminal);
    }
    run.announce(&stitch);
    let inputs = record::hash_survey(&survey, arguments.poses.file())?;
    let of_parts = resume::origin(&survey, &run.options_of_parts(), inputs.clone())?;
    let say = |text: &str| terminal.say(text);
    if let Some(part) = part {
        let resume = &arguments.resume;
        return resume.run(&part, &of_parts, say, |checkpoint| match arguments.shard {
            Some(shard) => write_shard(&run, &mut stitch, shard, &of_parts, checkpoint),
            None => write_seams(&run, &mut stitch, &of_parts),
        });
    }
    let origin = resume::origin(&survey, &run.options_of_result(), inputs.clone())?;
    arguments
        .resume
        .run(&output.out, &origin, say, |checkpoint| {
            for also in [&run.files.dzi, &run.files.maps].into_iter().flatten() {
                checkpoint.lock_also(also)?;
            }
            match &arguments.join {
                Some(folder) => {
                    let parts = (folder.as_path(), &of_parts);
                    join_shards(&run, &mut stitch, parts, checkpoint, &inputs)
                }
                None => run.draw(&mut stitch, checkpoint, &inputs),
            }
        })
}

impl StitchArguments {
    /// Options of the renderer.
    fn options(&self) -> StitchOptions {
        StitchOptions {
            px_per_metre: self.picture.canvas.px_per_metre,
            ignore_offset: self.ignore_offset,
            render: self.blend.render_options(self.picture.interpolation.into()),
            memory: self.memory,
        }
    }

    /// The part of a panorama that is written instead of a whole one.
    fn part(&self) -> Option<PathBuf> {
        let folder = &self.output.out;
        match self.shard {
            Some(shard) => Some(folder.join(shard.name())),
            None => self.seams.then(|| folder.join(SEAMS_FILE)),
        }
    }

    /// Names and formats of the files; a part is one of a GeoTIFF.
    fn files(&self, output: &OutputArguments) -> PanoramaFileOptions {
        let files = output.options();
        match self.part() {
            Some(part) => PanoramaFileOptions {
                out: part.join(Path::new("panorama.tif")),
                ..files
            },
            None => files,
        }
    }
}

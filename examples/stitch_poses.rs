//! Stitches panoramas of one survey from several sets of poses, with the same warp for all.
//!
//! Run it with `cargo run --release --example stitch_poses [SURVEY]`; it writes `initial.png` and,
//! where the survey has true poses, `truth.png`.

use std::error::Error;
use std::path::PathBuf;
use tunnelstitch::progress::Silent;
use tunnelstitch::render::{Layout, StitchOptions, stitch};
use tunnelstitch::survey::Survey;
use tunnelstitch::trajectory::poses_of;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os().nth(1).map(PathBuf::from);
    let folder = folder.unwrap_or_else(|| PathBuf::from("fixtures/blender_free48"));
    let survey = Survey::open(&folder)?;
    let options = StitchOptions {
        px_per_metre: Some(40.0),
        ..StitchOptions::default()
    };
    let mut sets = vec![("initial.png", survey.initial_poses())];
    if let Some(truth) = &survey.truth {
        sets.push(("truth.png", poses_of(truth)));
    }
    for (name, poses) in sets {
        let panorama = stitch(
            survey.surface.as_ref(),
            &survey.cameras,
            &survey.frames,
            &poses,
            &survey.shutter(),
            &options,
            &Silent,
        )?;
        panorama.into_image(Layout::ThetaRight).save(name)?;
        println!("wrote {name}");
    }
    Ok(())
}

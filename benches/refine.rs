//! Duration of the estimator's stages on a simulated survey: `cargo bench --bench refine`.
//!
//! The survey is that of `tunnelstitch demo`: 120 frames of 640 × 480 px. Each repetition decodes
//! and refines it again, in the default mode and with `--fast`; the tables give the median and the
//! range over the repetitions, and frames per second end to end.

use std::sync::Arc;
use tunnelstitch::progress::{Progress, Silent};
use tunnelstitch::refine::{RefineOptions, refine};
use tunnelstitch::simulate::{self, SimulateOptions};
use tunnelstitch::survey::Survey;

const REPETITIONS: usize = 5;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("survey");
    simulate::write_survey(&SimulateOptions::free(), &path, false, &Silent)?;
    let survey = Survey::open(&path)?;
    println!(
        "{} frames of {} × {} px, {} threads, {REPETITIONS} rounds",
        survey.frames.len(),
        survey.cameras.size()[0],
        survey.cameras.size()[1],
        rayon::current_num_threads()
    );
    measure(&survey, "refine", &RefineOptions::default())?;
    measure(&survey, "refine --fast", &RefineOptions::fast())
}

/// Measures one mode and prints its table.
fn measure(
    survey: &Survey,
    name: &str,
    options: &RefineOptions,
) -> Result<(), Box<dyn std::error::Error>> {
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    let mut stages: Vec<String> = Vec::new();
    let mut seconds: Vec<Vec<f64>> = Vec::new();
    let mut totals = Vec::new();
    for _ in 0..REPETITIONS {
        let report = refine(survey, options, &silent)?.report;
        totals.push(report.timings.iter().map(|lap| lap.seconds).sum::<f64>());
        for lap in report.timings {
            match stages.iter().position(|stage| *stage == lap.stage) {
                Some(stage) => seconds[stage].push(lap.seconds),
                None => {
                    stages.push(lap.stage);
                    seconds.push(vec![lap.seconds]);
                }
            }
        }
    }
    println!("\n{:<60} {:>9} {:>19}", name, "median s", "range s");
    for (stage, seconds) in stages.iter().zip(&seconds) {
        print_row(stage, seconds);
    }
    print_row("all", &totals);
    let frames = survey.frames.len() as f64;
    let [low, median, high] = min_median_max(&totals);
    println!(
        "{:.1} frames/s ({:.1} to {:.1})",
        frames / median,
        frames / high,
        frames / low
    );
    Ok(())
}

/// Prints the durations of a stage.
fn print_row(stage: &str, seconds: &[f64]) {
    let [low, median, high] = min_median_max(seconds);
    println!("{stage:<60} {median:>9.3} {low:>9.3} {high:>9.3}");
}

/// Minimum, median and maximum.
fn min_median_max(values: &[f64]) -> [f64; 3] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    [
        sorted[0],
        sorted[sorted.len() / 2],
        sorted[sorted.len() - 1],
    ]
}

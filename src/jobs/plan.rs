//! The tasks of a network: their commands, files, needs and expectations.

use super::error::JobError;
use super::job::{Job, SectionStep, Step, Task, TriggerRule};
use super::network::{Network, Section, SectionLine};
use super::section_calls::{Call, Part, SectionCalls};
use super::section_work::{SectionWork, needs};
use crate::files::printed;
use crate::inspect::MARKS_GEOJSON;
use crate::storage::Mirror;
use crate::survey::{Survey, toml_path};
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf, absolute};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Time for the map of a network: a process and the figures of a section, seconds.
const TIME_PER_SECTION_S: f64 = 0.1;
/// Name of the map of a network in the folder of its job.
pub const MAP_FILE: &str = "network.gpkg";
/// Name in the place of a section for tasks of the whole network.
const WHOLE_NETWORK: &str = "network";

/// Choices of a plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlanOptions {
    /// The steps of every section.
    pub steps: BTreeSet<SectionStep>,
    /// Processors of a task.
    pub cores: u16,
    /// Shards in which each section is refined, stitched and exported.
    pub division: Division,
}

/// Shards in which a section is refined, stitched and exported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Division {
    /// So many, or fewer if it has not as many frames.
    Shards(usize),
    /// As many as it takes for so many frames of its own in each.
    FramesPerShard(usize),
}

impl Division {
    /// Number of shards of a survey.
    fn shards(self, survey: &Survey) -> usize {
        let moments = survey.frames.len() / survey.cameras.count().max(1);
        let shards = match self {
            Self::Shards(shards) => shards,
            Self::FramesPerShard(frames) => survey.frames.len().div_ceil(frames.max(1)),
        };
        shards.clamp(1, moments.max(1))
    }
}

/// Plans the tasks of a network for a job in `folder`.
///
/// # Errors
/// A survey that cannot be opened; a section that has no place on the map; a job in a folder whose
/// files are inputs.
pub fn plan(network: &Network, folder: &Path, options: &PlanOptions) -> Result<Job, JobError> {
    let folder = normalised(folder)?;
    let tasks: Vec<Vec<Task>> = network
        .sections
        .par_map(|section| section_tasks(section, &folder, options))
        .into_iter()
        .collect::<Result<_, _>>()?;
    let mut tasks = tasks.concat();
    if network.crs.is_some() {
        tasks.push(map_task(network, &folder, &tasks)?);
    }
    Ok(Job::new(tasks))
}

/// The task of the map, which comes after all `others`.
fn map_task(network: &Network, folder: &Path, others: &[Task]) -> Result<Task, JobError> {
    let file = from_folder(&network.path, folder)?;
    let mut inputs = BTreeSet::from([file.clone()]);
    for section in &network.sections {
        SectionLine::of(network, section)?;
        let survey = toml_path(&section.survey);
        let tunnel = Survey::read_file(&survey).map(|file| file.tunnel);
        let tunnel = tunnel.map_err(|source| JobError::Survey {
            section: section.id.clone(),
            source,
        })?;
        let of_survey = survey.parent().unwrap_or(Path::new(""));
        let marks = Some(Path::new(MARKS_GEOJSON));
        for name in [marks, tunnel.centreline.as_deref()].into_iter().flatten() {
            inputs.insert(from_folder(&of_survey.join(name), folder)?);
        }
        inputs.insert(from_folder(&survey, folder)?);
    }
    let refined = others.iter().filter(|task| task.ends_refinement());
    inputs.extend(refined.flat_map(|task| task.outputs.iter().cloned()));
    let network_file = file.to_string_lossy();
    let words = [
        "tunnelstitch",
        "network-map",
        &network_file,
        ".",
        "--out",
        MAP_FILE,
    ];
    let seconds = TIME_PER_SECTION_S * network.sections.len() as f64;
    Ok(Task {
        id: format!("{WHOLE_NETWORK}.{}", Step::Map),
        section: WHOLE_NETWORK.to_owned(),
        step: Step::Map,
        command: words.map(str::to_owned).to_vec(),
        inputs: inputs.into_iter().collect(),
        outputs: vec![MAP_FILE.into()],
        after: others.iter().map(|task| task.id.clone()).collect(),
        trigger_rule: TriggerRule::AllDone,
        needs: needs(seconds, 0, 1),
    })
}

/// The tasks of a section.
fn section_tasks(
    section: &Section,
    folder: &Path,
    options: &PlanOptions,
) -> Result<Vec<Task>, JobError> {
    let survey = Survey::open(&section.survey).map_err(|source| JobError::Survey {
        section: section.id.clone(),
        source,
    })?;
    let inputs = inputs_of(&survey, folder)?;
    let work = SectionWork::of(&survey, options.division.shards(&survey), options.cores);
    let is_refined = options.steps.contains(&SectionStep::Refine);
    let calls = SectionCalls {
        id: &section.id,
        survey: from_folder(&section.survey, folder)?,
        is_refined,
        shards: work.shards,
    };
    let refine = format!("{}.{}", section.id, Step::Refine);
    let mut tasks: Vec<Task> = Vec::new();
    for step in &options.steps {
        let is_after_refine = is_refined && *step != SectionStep::Refine;
        let first = tasks.len();
        for Call {
            part,
            command,
            output,
        } in calls.of_step(*step)
        {
            // Each part after those before it that it reads, the whole after all of them.
            let earlier = tasks[first..].iter();
            let earlier = earlier.filter(|_| part == Part::Whole);
            let seams = tasks
                .get(first)
                .filter(|_| *step != SectionStep::Refine && matches!(part, Part::Shard(_)));
            let after = earlier.chain(seams).map(|task| task.id.clone());
            let refined = is_after_refine.then(|| refine.clone());
            tasks.push(Task {
                id: format!("{}.{}{}", section.id, Step::from(*step), part.suffix()),
                section: section.id.clone(),
                step: (*step).into(),
                command,
                inputs: inputs.clone(),
                outputs: vec![output.into()],
                after: refined.into_iter().chain(after).collect(),
                trigger_rule: TriggerRule::AllSuccess,
                needs: work.needs(*step, part, options.cores),
            });
        }
    }
    Ok(tasks)
}

/// The files of a survey, and the folders of its frames, from the folder of the job.
fn inputs_of(survey: &Survey, folder: &Path) -> Result<Vec<PathBuf>, JobError> {
    let mut inputs: BTreeSet<PathBuf> = BTreeSet::new();
    for path in survey.own_files() {
        inputs.insert(from_folder(path, folder)?);
    }
    let stored = survey.file.stored_frames()?;
    inputs.extend(stored.iter().map(|url| PathBuf::from(url.to_string())));
    let mirror = Mirror::of_user();
    for frame in survey.frames.iter() {
        if mirror.has_path(&frame.path) && !stored.is_empty() {
            continue;
        }
        match frame.shared_file() {
            Some(file) => {
                inputs.insert(from_folder(file, folder)?);
            }
            None => {
                let frames = frame.path.parent().unwrap_or(Path::new("."));
                let from = from_folder(frames, folder)?;
                if from.components().all(|part| part == Component::ParentDir) {
                    return Err(JobError::Value {
                        path: folder.to_owned(),
                        what: format!(
                            "the job would be in {}, a folder of frames, all files of which are \
                             inputs; choose another --out",
                            printed(frames)
                        ),
                    });
                }
                inputs.insert(from);
            }
        }
    }
    Ok(inputs.into_iter().collect())
}

/// A path as seen from the (normalised) folder of the job.
fn from_folder(path: &Path, folder: &Path) -> Result<PathBuf, JobError> {
    let path = normalised(path)?;
    // Without a relative path, as on another drive, the absolute one.
    Ok(pathdiff::diff_paths(&path, folder).unwrap_or(path))
}

/// The absolute path without `.` and `..`.
fn normalised(path: &Path) -> Result<PathBuf, JobError> {
    let absolute = absolute(path).map_err(|source| JobError::Read {
        path: path.to_owned(),
        source,
        remedy: "",
    })?;
    let mut normal = PathBuf::new();
    for part in absolute.components() {
        match part {
            Component::ParentDir => {
                normal.pop();
            }
            _ => normal.push(part),
        }
    }
    Ok(normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::Crs;
    use crate::simulate::{SimulateOptions, write_survey};

    /// A network of one small survey.
    fn network(folder: &Path) -> Network {
        let options = SimulateOptions {
            frames: 2,
            supersample: 1,
            camera: crate::camera::Camera::from_vertical_fov(32, 24, 1.0),
            ..SimulateOptions::free()
        };
        write_survey(&options, folder, false, &crate::progress::Silent).unwrap();
        Network {
            path: folder.with_file_name("network.toml"),
            crs: None,
            manholes: Vec::new(),
            sections: vec![Section {
                id: "K1".to_owned(),
                survey: folder.to_owned(),
                ends: None,
                place: [2, 6],
            }],
        }
    }

    fn options(steps: &[SectionStep]) -> PlanOptions {
        PlanOptions {
            steps: steps.iter().copied().collect(),
            cores: 2,
            division: Division::Shards(1),
        }
    }

    /// Whatever way the paths are written.
    #[test]
    fn paths_are_relative_to_the_job() {
        let dir = tempfile::tempdir().unwrap();
        let network = network(&dir.path().join("s/../surveys/K1"));
        let steps = [SectionStep::Export, SectionStep::Refine];
        let folder = dir.path().join("x/../jobs/./K");
        let job = plan(&network, &folder, &options(&steps)).unwrap();
        let [refine, export] = &job.tasks[..] else {
            panic!("{job:?}");
        };
        let text = |task: &Task| task.command.join(" ");
        assert_eq!(
            text(refine),
            "tunnelstitch refine ../../surveys/K1 --out K1/refined"
        );
        assert_eq!(
            text(export),
            "tunnelstitch export ../../surveys/K1 --poses K1/refined/poses.tum --3dtiles K1/tiles"
        );
        assert!(refine.inputs.contains(&"../../surveys/K1/frames".into()));
        assert_eq!(export.after, ["K1.refine"]);
        job.write(&folder).unwrap();
        assert_eq!(Job::read(&folder).unwrap(), job);
    }

    #[test]
    fn shards_come_before_what_joins_them() {
        let dir = tempfile::tempdir().unwrap();
        let network = network(&dir.path().join("K1"));
        let plan = |division: Division| {
            let options = PlanOptions {
                division,
                ..options(&[SectionStep::Refine, SectionStep::Stitch])
            };
            plan(&network, &dir.path().join("job"), &options).unwrap()
        };
        let job = plan(Division::FramesPerShard(1));
        let [first, second, join, seams, draw, other, stitch] = &job.tasks[..] else {
            panic!("{job:?}");
        };
        assert_eq!(
            second.command.join(" "),
            "tunnelstitch refine ../K1 --shard 2/2 --out K1/shards"
        );
        assert_eq!(second.outputs, [Path::new("K1/shards/shard-2-of-2.state")]);
        assert_eq!(
            join.command.join(" "),
            "tunnelstitch refine ../K1 --join K1/shards --out K1/refined"
        );
        assert_eq!(join.after, [first.id.as_str(), second.id.as_str()]);
        assert_eq!(seams.after, ["K1.refine"]);
        assert_eq!(
            seams.command.join(" "),
            "tunnelstitch stitch ../K1 --poses K1/refined/poses.tum --seams --out \
             K1/panorama-shards"
        );
        assert_eq!(seams.outputs, [Path::new("K1/panorama-shards/seams.state")]);
        assert_eq!(other.id, "K1.stitch-2");
        assert_eq!(other.after, ["K1.refine", "K1.stitch-seams"]);
        assert_eq!(
            other.command.join(" "),
            "tunnelstitch stitch ../K1 --poses K1/refined/poses.tum --shard 2/2 --out \
             K1/panorama-shards"
        );
        assert_eq!(
            other.outputs,
            [Path::new("K1/panorama-shards/shard-2-of-2")]
        );
        assert_eq!(
            stitch.command.join(" "),
            "tunnelstitch stitch ../K1 --poses K1/refined/poses.tum --join K1/panorama-shards \
             --out K1/panorama.tif"
        );
        assert_eq!(
            stitch.after,
            ["K1.refine", seams.id.as_str(), &draw.id, &other.id]
        );
        let tiles = PlanOptions {
            division: Division::Shards(2),
            ..options(&[SectionStep::Export])
        };
        let tiles = super::plan(&network, &dir.path().join("job"), &tiles).unwrap();
        let [_, _, part, whole] = &tiles.tasks[..] else {
            panic!("{tiles:?}");
        };
        assert_eq!(
            part.command.join(" "),
            "tunnelstitch export ../K1 --shard 2/2 --3dtiles K1/tiles-shards"
        );
        assert_eq!(part.after, ["K1.export-seams"]);
        assert_eq!(part.outputs, [Path::new("K1/tiles-shards/shard-2-of-2")]);
        assert_eq!(
            whole.command.join(" "),
            "tunnelstitch export ../K1 --join K1/tiles-shards --3dtiles K1/tiles"
        );
        assert_eq!(whole.outputs, [Path::new("K1/tiles")]);
        // No more shards than frames, and one is none.
        assert_eq!(plan(Division::Shards(9)), job);
        assert_eq!(plan(Division::FramesPerShard(2)).tasks.len(), 2);
    }

    #[test]
    fn the_map_comes_after_everything_if_the_network_has_a_place() {
        let dir = tempfile::tempdir().unwrap();
        let network = Network {
            crs: Some(Crs::parse("EPSG:2056").unwrap()),
            ..network(&dir.path().join("K1"))
        };
        let folder = dir.path().join("job");
        let plan = |network: &Network| plan(network, &folder, &options(&[SectionStep::Stitch]));
        let message = plan(&network).unwrap_err().to_string();
        let expected = "network.toml:2:6: section K1 has no place on the map";
        assert!(message.contains(expected), "{message}");
        let toml = dir.path().join("K1/survey.toml");
        let text = std::fs::read_to_string(&toml).unwrap();
        let bent = text.replacen("[tunnel]", "[tunnel]\ncentreline = \"line.txt\"", 1);
        std::fs::write(&toml, bent).unwrap();
        std::fs::write(dir.path().join("K1/line.txt"), "0 -9 0\n0 0 0\n0 9 0\n").unwrap();
        let job = plan(&network).unwrap();
        let [stitch, map] = &job.tasks[..] else {
            panic!("{job:?}");
        };
        assert_eq!(map.after, [stitch.id.as_str()]);
        assert_eq!(
            map.command.join(" "),
            "tunnelstitch network-map ../network.toml . --out network.gpkg"
        );
        // Marks count as soon as there are some.
        let inputs = ["line.txt", "marks.geojson", "survey.toml"];
        let inputs = inputs.map(|name| PathBuf::from(format!("../K1/{name}")));
        assert_eq!(map.inputs[..3], inputs);
        job.write(&folder).unwrap();
        assert_eq!(Job::read(&folder).unwrap(), job);
    }

    #[test]
    fn a_job_among_its_own_inputs_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let network = network(dir.path());
        let folder = dir.path().join("frames/job");
        let error = plan(&network, &folder, &options(&[SectionStep::Stitch])).unwrap_err();
        assert!(
            error.to_string().contains("choose another --out"),
            "{error}"
        );
        let beside = plan(
            &network,
            &dir.path().join("job"),
            &options(&[SectionStep::Stitch]),
        );
        assert!(beside.unwrap().tasks[0].after.is_empty());
    }
}

//! The calls of the program that make up the steps of a section.

use super::job::{SectionStep, Step};
use crate::persist::shard_number::ShardNumber;
use std::path::{Path, PathBuf};

/// The part of a step that a task is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// All of it, or what joins its shards.
    Whole,
    /// Exposures and seams of a panorama or of 3D Tiles, which their shards are drawn with.
    Seams,
    /// One of its shards.
    Shard(ShardNumber),
}

impl Part {
    /// End of the identifier of its task.
    pub fn suffix(self) -> String {
        match self {
            Self::Whole => String::new(),
            Self::Seams => "-seams".to_owned(),
            Self::Shard(shard) => format!("-{}", shard.number),
        }
    }
}

/// A call of the program.
pub struct Call {
    /// The part of its step.
    pub part: Part,
    /// The call, in which the first word stands for the program.
    pub command: Vec<String>,
    /// The file or folder that it writes.
    pub output: String,
}

/// The calls of a section.
pub struct SectionCalls<'s> {
    /// The section.
    pub id: &'s str,
    /// Its survey, from the folder of the job.
    pub survey: PathBuf,
    /// True if its poses are refined.
    pub is_refined: bool,
    /// Shards in which it is refined, stitched and exported.
    pub shards: usize,
}

impl SectionCalls<'_> {
    /// The calls of a step, each behind those that it comes after: seams, shards, and the whole.
    pub fn of_step(&self, step: SectionStep) -> Vec<Call> {
        let shards = (1..=self.shards).map(|number| {
            Part::Shard(ShardNumber {
                number,
                of: self.shards,
            })
        });
        let (seams, has_shards) = match step {
            SectionStep::Refine => (None, self.shards > 1),
            SectionStep::Stitch | SectionStep::Export => (Some(Part::Seams), self.shards > 1),
            SectionStep::Report => (None, false),
        };
        let parts = seams.into_iter().chain(shards).filter(|_| has_shards);
        let parts = parts.chain([Part::Whole]);
        parts.map(|part| self.call(step, part)).collect()
    }

    /// The call of a part of a step.
    fn call(&self, step: SectionStep, part: Part) -> Call {
        let Self { id, .. } = self;
        let refined = format!("{id}/refined");
        let poses = match self.is_refined {
            true => vec!["--poses".to_owned(), format!("{refined}/poses.tum")],
            false => Vec::new(),
        };
        let (mut words, flag, whole) = match step {
            SectionStep::Refine => (Vec::new(), "--out", refined),
            SectionStep::Stitch => (poses, "--out", format!("{id}/panorama.tif")),
            SectionStep::Report => {
                let words = vec!["--refined".to_owned(), refined];
                (words, "--out", format!("{id}/report"))
            }
            SectionStep::Export => (poses, "--3dtiles", format!("{id}/tiles")),
        };
        let parts = match step {
            SectionStep::Stitch => format!("{id}/panorama-shards"),
            SectionStep::Export => format!("{id}/tiles-shards"),
            _ => format!("{id}/shards"),
        };
        let is_sharded = step != SectionStep::Report;
        let (written, output) = match part {
            Part::Whole => {
                if is_sharded && self.shards > 1 {
                    words.extend(["--join".to_owned(), parts]);
                }
                (whole.clone(), whole)
            }
            Part::Seams => {
                words.push("--seams".to_owned());
                let output = format!("{parts}/seams.state");
                (parts, output)
            }
            Part::Shard(shard) => {
                words.extend(["--shard".to_owned(), shard.to_string()]);
                let output = match step {
                    SectionStep::Refine => shard.file(Path::new(&parts)),
                    _ => Path::new(&parts).join(shard.name()),
                };
                let output = output.to_string_lossy().into_owned();
                (parts, output)
            }
        };
        let name = Step::from(step).to_string();
        let survey = self.survey.to_string_lossy().into_owned();
        let first = ["tunnelstitch".to_owned(), name, survey];
        let last = [flag.to_owned(), written];
        Call {
            part,
            command: first.into_iter().chain(words).chain(last).collect(),
            output,
        }
    }
}

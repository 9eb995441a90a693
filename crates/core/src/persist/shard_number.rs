//! A shard of a long run by its number, in words and in the names of files.

use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A shard by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct ShardNumber {
    /// Its number, from 1.
    pub number: usize,
    /// Number of shards.
    pub of: usize,
}

impl ShardNumber {
    /// Name of what belongs to the shard.
    pub fn name(self) -> String {
        format!("shard-{}-of-{}", self.number, self.of)
    }

    /// Its file in a folder.
    pub fn file(self, folder: &Path) -> PathBuf {
        folder.join(format!("{}.state", self.name()))
    }

    /// Its own of `count` things that all shards divide among them as evenly as possible.
    pub fn range(self, count: usize) -> Range<usize> {
        let start = |number: usize| number * count / self.of;
        start(self.number - 1)..start(self.number)
    }

    /// All shards of the only division of which a folder has files, in order; None without any, or
    /// with those of several divisions.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn all_in(folder: &Path) -> io::Result<Option<Vec<Self>>> {
        let mut divisions = BTreeSet::new();
        for entry in std::fs::read_dir(folder)? {
            divisions.extend(Self::of_file(&entry?.path()).map(|shard| shard.of));
        }
        let mut divisions = divisions.into_iter();
        Ok(match (divisions.next(), divisions.next()) {
            (Some(of), None) => Some((1..=of).map(|number| Self { number, of }).collect()),
            _ => None,
        })
    }

    /// The shard that a file or folder is of, by its name.
    fn of_file(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        let name = name.strip_suffix(".state").unwrap_or(name);
        let (number, of) = name.strip_prefix("shard-")?.split_once("-of-")?;
        let numbers = number.parse().ok().zip(of.parse().ok());
        numbers.map(|(number, of)| Self { number, of })
    }
}

impl fmt::Display for ShardNumber {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}/{}", self.number, self.of)
    }
}

impl FromStr for ShardNumber {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/');
        let numbers = numbers.and_then(|(number, of)| number.parse().ok().zip(of.parse().ok()));
        match numbers {
            Some((number, of)) if (1..=of).contains(&number) => Ok(Self { number, of }),
            _ => Err("must be a number and how many there are, as 3/8".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_named_by_their_numbers() {
        let shard: ShardNumber = "3/8".parse().unwrap();
        assert_eq!((shard.number, shard.of), (3, 8));
        assert_eq!(shard.to_string(), "3/8");
        let file = shard.file(Path::new("out"));
        assert_eq!(file, Path::new("out/shard-3-of-8.state"));
        for name in ["shard-3-of-8.state", "out/shard-3-of-8"] {
            assert_eq!(ShardNumber::of_file(Path::new(name)), Some(shard));
        }
        for name in ["shard-x-of-8.state", "shard-3-of-8.unfinished"] {
            assert_eq!(ShardNumber::of_file(Path::new(name)), None);
        }
        for wrong in ["0/8", "9/8", "3", "a/b", "3/"] {
            assert!(wrong.parse::<ShardNumber>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn shards_divide_everything_among_them() {
        for (of, count) in [(1, 5), (3, 7), (8, 3)] {
            let shards = (1..=of).map(|number| ShardNumber { number, of });
            let all: Vec<usize> = shards.flat_map(|shard| shard.range(count)).collect();
            assert_eq!(all, (0..count).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_folder_has_the_shards_of_one_division() {
        let dir = tempfile::tempdir().unwrap();
        let all = || ShardNumber::all_in(dir.path()).unwrap();
        let write = |name: &str| std::fs::write(dir.path().join(name), "").unwrap();
        write("seams.state");
        assert_eq!(all(), None);
        write("shard-2-of-3.state");
        let numbers = all().unwrap().into_iter().map(|shard| shard.number);
        assert_eq!(numbers.collect::<Vec<_>>(), [1, 2, 3]);
        write("shard-1-of-2.state");
        assert_eq!(all(), None);
    }
}

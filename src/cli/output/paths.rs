//! Checks of output paths, made before any work is done.

use super::failure::Failure;
use crate::files::printed;
use crate::frames::PictureFormat;
use crate::persist::atomic;
use crate::survey::Survey;
use std::path::{Path, PathBuf};

/// The file of this program, for tasks that are calls of it.
///
/// # Errors
/// A system that does not tell.
pub fn own_program() -> Result<PathBuf, Failure> {
    std::env::current_exe()
        .map_err(|error| Failure::temporary(format!("cannot find the program's own file: {error}")))
}

/// Finds the format of a picture to be written, and checks its folder.
///
/// # Errors
/// An extension of no supported format; a path that is a folder; a folder that cannot be created.
pub fn picture_format(path: &Path) -> Result<PictureFormat, Failure> {
    let format = PictureFormat::of(path).map_err(|error| Failure::usage(error.to_string()))?;
    if path.is_dir() {
        return Err(Failure::usage(format!(
            "{}: is a folder; name a file",
            printed(path)
        )));
    }
    check_parent_folder(path)?;
    Ok(format)
}

/// Checks that a file can be written into its folder, which is created with it if it is missing.
///
/// # Errors
/// Whatever the system says.
pub fn check_parent_folder(path: &Path) -> Result<(), Failure> {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => Ok(atomic::check_folder(folder)?),
        _ => Ok(atomic::check_folder(Path::new("."))?),
    }
}

/// Files that a survey is read from, frames included.
pub fn survey_files(survey: &Survey) -> Vec<PathBuf> {
    let frames = survey.frames.iter().map(|frame| frame.file().to_owned());
    frames.chain(survey.own_files().iter().cloned()).collect()
}

/// Refuses outputs that would replace an input or one another.
///
/// # Errors
/// The first such output, with the file that it would replace.
pub fn refuse_overwriting(outputs: &[PathBuf], inputs: Vec<PathBuf>) -> Result<(), Failure> {
    let mut taken: Vec<(PathBuf, &Path)> = Vec::new();
    taken.extend(inputs.iter().map(|path| (resolved(path), path.as_path())));
    for output in outputs {
        let place = resolved(output);
        // A folder of tiles replaces everything in it.
        let replaced = taken.iter().find(|(other, _)| other.starts_with(&place));
        if let Some((_, other)) = replaced {
            return Err(Failure::usage(format!(
                "{}: would replace {}; choose another name",
                printed(output),
                printed(other)
            )));
        }
        taken.push((place, output));
    }
    Ok(())
}

/// The absolute path without links, of a file that need not exist yet.
fn resolved(path: &Path) -> PathBuf {
    if let Ok(full) = path.canonicalize() {
        return full;
    }
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.canonicalize(),
        _ => Path::new(".").canonicalize(),
    };
    match (folder, path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path.to_owned(),
    }
}

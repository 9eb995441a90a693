//! Reading of `covariance.csv`.

use nalgebra::Matrix6;
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::files::limits::MAX_TABLE_BYTES;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::files::read_text;

/// Reason why a covariance file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CovarianceError {
    /// The file cannot be read.
    #[error("{}: cannot read the covariances: {source}", printed(path))]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// A line is malformed.
    #[error(
        "{}:{line}: {what}; a covariance file is one that refine has written",
        printed(path)
    )]
    Line {
        /// The file.
        path: PathBuf,
        /// 1-based line.
        line: usize,
        /// The mistake.
        what: String,
    },
}

/// Columns of the file: two frames, σ, and the 36 elements of a covariance.
const COLUMNS: usize = 39;

/// Reads the covariances of the frames ([`crate::Covariances::frames`]) from a file that
/// [`crate::Covariances::csv`] has written.
///
/// # Errors
/// [`CovarianceError`]; also if the frames are not 0 to `frames − 1` in ascending order.
pub fn read_covariances(path: &Path, frames: usize) -> Result<Vec<Matrix6<f64>>, CovarianceError> {
    let text = read_text(path, MAX_TABLE_BYTES).map_err(|source| CovarianceError::Read {
        path: path.to_owned(),
        source,
    })?;
    let mut found = Vec::with_capacity(frames);
    let fail = |line: usize, what: String| CovarianceError::Line {
        path: path.to_owned(),
        line,
        what,
    };
    for (k, line) in text.lines().enumerate().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        if fields.len() != COLUMNS {
            let what = format!("{} fields, but a line has {COLUMNS}", fields.len());
            return Err(fail(k + 1, what));
        }
        if fields[0] != fields[1] {
            continue;
        }
        if fields[0] != found.len().to_string() {
            let what = format!("frame {}, but {} is next", fields[0], found.len());
            return Err(fail(k + 1, what));
        }
        let numbers = fields[3..].iter().map(|field| field.parse::<f64>());
        let numbers: Vec<f64> = numbers
            .collect::<Result<_, _>>()
            .map_err(|error| fail(k + 1, error.to_string()))?;
        found.push(Matrix6::from_row_slice(&numbers));
    }
    if found.len() != frames {
        let what = format!("{} frames, but the survey has {frames}", found.len());
        return Err(fail(text.lines().count(), what));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Covariances;

    #[test]
    fn written_covariances_are_read_back() {
        let element = |k: usize| move |r: usize, c: usize| (100 * k + 10 * r + c) as f64 * 1e-7;
        let covariances = Covariances {
            frames: (0..3).map(|k| Matrix6::from_fn(element(k))).collect(),
            next: vec![Matrix6::from_element(f64::NAN); 2],
            variance_factor: 1.0,
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("covariance.csv");
        std::fs::write(&path, covariances.csv(&[])).unwrap();
        let read = read_covariances(&path, 3).unwrap();
        for (a, b) in read.iter().zip(&covariances.frames) {
            assert!((a - b).norm() < 1e-14);
        }
        let message = read_covariances(&path, 4).unwrap_err().to_string();
        assert!(message.contains("3 frames"), "{message}");
        let text = covariances.csv(&[]).replace("\n1,1,", "\n1,1,7,");
        std::fs::write(&path, text).unwrap();
        let message = read_covariances(&path, 3).unwrap_err().to_string();
        assert!(message.contains("covariance.csv:4:"), "{message}");
    }
}

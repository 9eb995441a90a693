//! Errors with the exit code of the program.

use crate::camera::CalibrationError;
use crate::evaluate::EvaluateError;
use crate::evaluate::converge::ConvergeError;
use crate::follow::FollowError;
use crate::frames::FrameError;
use crate::inspect::InspectError;
use crate::jobs::JobError;
use crate::network_map::MapError;
use crate::persist::atomic::WriteError;
use crate::persist::checkpoint::CheckpointError;
use crate::raster::RasterError;
use crate::refine::{CovarianceError, ProblemError, RefineError};
use crate::render::RenderError;
use crate::report::ReportError;
use crate::simulate::SimulateError;
use crate::storage::StorageError;
use crate::surface::SurfaceError;
use crate::survey::SurveyError;
use crate::trajectory::PoseError;
use std::io::ErrorKind;

/// An error as the user sees it: one text with the remedy, and an exit code.
///
/// Exit codes: 0 success, 1 a bug in this program, 2 wrong usage, 3 bad input, 4 a quality gate
/// that is not met, 75 a temporary failure such as a full disk.
#[derive(Debug)]
pub struct Failure {
    /// Text to print.
    pub message: String,
    /// Exit code.
    pub code: u8,
}

impl Failure {
    /// A state that should be impossible.
    pub fn bug(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            code: 1,
        }
    }

    /// Arguments that do not go together.
    pub fn usage(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            code: 2,
        }
    }

    /// Input that cannot be used.
    pub fn input(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            code: 3,
        }
    }

    /// A temporary failure: the same command may succeed later.
    pub fn temporary(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            code: 75,
        }
    }

    /// True if the same command may succeed later.
    pub fn is_temporary(&self) -> bool {
        self.code == 75
    }

    /// A result that misses the required quality.
    pub fn quality(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            code: 4,
        }
    }
}

impl From<WriteError> for Failure {
    fn from(error: WriteError) -> Self {
        let is_temporary = matches!(
            error.source.kind(),
            ErrorKind::StorageFull
                | ErrorKind::QuotaExceeded
                | ErrorKind::FileTooLarge
                | ErrorKind::OutOfMemory
                | ErrorKind::Interrupted
        );
        if is_temporary {
            Self::temporary(error.to_string())
        } else {
            Self::input(error.to_string())
        }
    }
}

impl From<CheckpointError> for Failure {
    fn from(error: CheckpointError) -> Self {
        match error {
            CheckpointError::Write(error) => error.into(),
            CheckpointError::Busy { .. } => Self::temporary(error.to_string()),
            _ => Self::input(error.to_string()),
        }
    }
}

impl From<RefineError> for Failure {
    fn from(error: RefineError) -> Self {
        match error {
            RefineError::Problem(ProblemError::Checkpoint(error)) => error.into(),
            _ => Self::input(error.to_string()),
        }
    }
}

impl From<JobError> for Failure {
    fn from(error: JobError) -> Self {
        match error {
            JobError::Survey { section, source } => {
                let Self { message, code } = source.into();
                Self {
                    message: format!("section {section}: {message}"),
                    code,
                }
            }
            JobError::Write(error) => error.into(),
            JobError::Storage(error) => error.into(),
            JobError::Failed { code, .. } => Self {
                message: error.to_string(),
                code,
            },
            JobError::NotReady { .. } | JobError::Busy { .. } => Self::temporary(error.to_string()),
            _ => Self::input(error.to_string()),
        }
    }
}

impl From<MapError> for Failure {
    fn from(error: MapError) -> Self {
        match error {
            MapError::Job(error) => error.into(),
            MapError::Marks(error) => error.into(),
            MapError::Database(_) => Self::bug(error.to_string()),
            _ => Self::input(error.to_string()),
        }
    }
}

impl From<StorageError> for Failure {
    fn from(error: StorageError) -> Self {
        match error.is_temporary() {
            true => Self::temporary(error.to_string()),
            false => Self::input(error.to_string()),
        }
    }
}

impl From<SurveyError> for Failure {
    fn from(error: SurveyError) -> Self {
        match error {
            SurveyError::Storage(error) => error.into(),
            _ => Self::input(error.to_string()),
        }
    }
}

impl From<FollowError> for Failure {
    fn from(error: FollowError) -> Self {
        match error {
            FollowError::Survey(error) => error.into(),
            FollowError::Write(error) => error.into(),
            FollowError::Render(error) => error.into(),
        }
    }
}

impl From<SimulateError> for Failure {
    fn from(error: SimulateError) -> Self {
        match error {
            SimulateError::Write(error) => error.into(),
            SimulateError::Option { .. } | SimulateError::BadFrames(_) => {
                Self::usage(error.to_string())
            }
            _ => Self::input(error.to_string()),
        }
    }
}

impl From<ConvergeError> for Failure {
    fn from(error: ConvergeError) -> Self {
        match error {
            ConvergeError::Option { what } => Self::usage(what),
            ConvergeError::Simulate(error) => error.into(),
            ConvergeError::Write(error) => error.into(),
            _ => Self::input(error.to_string()),
        }
    }
}

impl From<RasterError> for Failure {
    fn from(error: RasterError) -> Self {
        match error {
            RasterError::Write(error) => error.into(),
            RasterError::Unsupported(_) => Self::usage(error.to_string()),
            _ => Self::bug(error.to_string()),
        }
    }
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Raster(error) => error.into(),
            RenderError::Checkpoint(error) => error.into(),
            // More may be free later.
            RenderError::Memory {
                by_limit: false, ..
            } => Self::temporary(error.to_string()),
            _ => Self::input(error.to_string()),
        }
    }
}

impl From<InspectError> for Failure {
    fn from(error: InspectError) -> Self {
        match error {
            InspectError::Raster(error) => error.into(),
            InspectError::Write(error) => error.into(),
            InspectError::Render(error) => error.into(),
            InspectError::Survey(error) => error.into(),
            InspectError::Json { .. } => Self::bug(error.to_string()),
            InspectError::TooLong { .. } | InspectError::NoViewer | InspectError::Listen { .. } => {
                Self::usage(error.to_string())
            }
            InspectError::Part(_)
            | InspectError::Marks { .. }
            | InspectError::MarkConflict { .. }
            | InspectError::Folder { .. } => Self::input(error.to_string()),
        }
    }
}

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        match error {
            ReportError::Render(error) => error.into(),
            ReportError::Encode { .. } => Self::bug(error.to_string()),
            _ => Self::input(error.to_string()),
        }
    }
}

macro_rules! bad_input {
    ($($error:ty),* $(,)?) => {
        $(impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::input(error.to_string())
            }
        })*
    };
}

bad_input!(
    CalibrationError,
    EvaluateError,
    FrameError,
    CovarianceError,
    SurfaceError,
    PoseError
);

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Error;
    use std::path::Path;

    #[test]
    fn a_full_disk_is_temporary_and_a_forbidden_folder_is_bad_input() {
        let failure = |kind: ErrorKind| {
            Failure::from(WriteError::new(
                Path::new("out/poses.tum"),
                Error::from(kind),
            ))
        };
        assert_eq!(failure(ErrorKind::StorageFull).code, 75);
        assert_eq!(failure(ErrorKind::PermissionDenied).code, 3);
        let wrapped = SimulateError::from(WriteError::new(
            Path::new("frames/000000.png"),
            Error::from(ErrorKind::StorageFull),
        ));
        let failure = Failure::from(wrapped);
        assert_eq!(failure.code, 75);
        assert!(failure.message.contains("frames/000000.png"));
    }
}

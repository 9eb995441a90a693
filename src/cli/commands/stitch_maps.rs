//! Files of `refine` that the maps of a panorama show.

use crate::cli::arguments::OutputArguments;
use crate::cli::output::Failure;
use crate::evaluate::deformation::DeviationMap;
use crate::refine::read_covariances;
use crate::survey::{MaskedWall, Survey};
use nalgebra::Matrix6;
use std::path::Path;

/// Files of `refine` for the maps of a panorama, as far as they are there and maps are written.
#[derive(Default)]
pub struct MapInputs {
    /// Covariances of the poses.
    pub covariances: Option<Vec<Matrix6<f64>>>,
    /// Deviation of the wall from its best-fit circles.
    pub deformation: Option<DeviationMap>,
    /// Wall that was left out.
    pub masked: Option<MaskedWall>,
}

impl MapInputs {
    /// Reads the files of a survey, and those beside the file of its `poses`.
    ///
    /// # Errors
    /// A malformed file, or one of another survey or tunnel.
    pub fn read(
        output: &OutputArguments,
        poses: Option<&Path>,
        survey: &Survey,
    ) -> Result<Self, Failure> {
        if !output.has_maps() {
            return Ok(Self::default());
        }
        let masked =
            poses.map(|poses| MaskedWall::read_beside(poses, survey.nominal.perimeter_m()));
        Ok(Self {
            covariances: read_pose_covariances(output, poses, survey)?,
            deformation: DeviationMap::of_survey(survey)?,
            masked: masked.transpose()?.flatten(),
        })
    }
}

/// Reads the covariances of the poses: those of --covariance, else those beside the poses.
///
/// # Errors
/// A malformed file, or one of another survey.
fn read_pose_covariances(
    output: &OutputArguments,
    poses: Option<&Path>,
    survey: &Survey,
) -> Result<Option<Vec<Matrix6<f64>>>, Failure> {
    let beside = poses.map(|file| file.with_file_name("covariance.csv"));
    let path = match &output.covariance {
        Some(path) => Some(path.clone()),
        None => beside.filter(|path| path.is_file()),
    };
    match path {
        Some(path) => Ok(Some(read_covariances(&path, survey.frames.len())?)),
        None => Ok(None),
    }
}

//! Reasons to reject a frame's pixels.

use serde::{Deserialize, Serialize};
use std::fmt;
use tunnelstitch_geometry::trajectory::Pose;

/// A reason to reject a frame's pixels and to leave it at its prior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum RejectionReason {
    /// The image has hardly any contrast: black, white, lamp off, lens covered.
    Featureless,
    /// The image repeats that of an earlier frame.
    Repeated(usize),
    /// The image does not match the wall around its pose.
    NoMatch {
        /// Highest correlation of local contrast.
        correlation: f64,
    },
    /// The image matches the wall at two places.
    Ambiguous {
        /// Pose at the second place.
        other: Pose,
        /// Distance on the wall between the image centres at the two poses, metres.
        separation_m: f64,
    },
    /// The image contradicts frames that agree among themselves.
    Contradicts {
        /// One of them.
        frame: usize,
        /// Correlation of local contrast with it.
        correlation: f64,
    },
    /// The image is blurred.
    Blurred {
        /// Its contrast at the finest detail over that of its neighbours, 0 to 1.
        share: f64,
    },
    /// Too many pixels disagree with the other frames.
    Disagrees {
        /// Share of disagreeing pixels, 0 to 1.
        share: f64,
    },
    /// The frame is displaced against frames that show the same wall.
    Misaligned {
        /// Displacement, pixels.
        error_px: f64,
    },
    /// No reliable pair connects the frame, or the group that it agrees with, to the others.
    Disconnected {
        /// Number of frames of that group.
        frames: usize,
    },
    /// Too little overlap with other frames.
    NoOverlap {
        /// Share of its pixels that others show, 0 to 1.
        share: f64,
    },
    /// Refined steps are a multiple of the initial ones: lengths cannot be believed.
    ContradictsScale {
        /// The factor.
        factor: f64,
    },
    /// It is one of few frames that fit, where most do not: they may fit by chance.
    Minority {
        /// Number of frames that fit.
        frames: usize,
        /// Number of frames that show something.
        shown: usize,
    },
    /// Neighbouring frames agree with another reading of the survey.
    Misread,
    /// The equations of the survey have no solution.
    Unsolved,
    /// It was not tried, as none of those before it matched.
    NotTried {
        /// Number of frames that were tried.
        failures: usize,
    },
    /// It was not looked at: tracking was behind the camera.
    LeftOut,
    /// Too little texture to determine the pose.
    Uncertain {
        /// 1-σ on the wall, pixels.
        wall_px: f64,
    },
}

impl RejectionReason {
    /// True if the image shows nothing that could fit others.
    pub fn shows_nothing(&self) -> bool {
        matches!(self, Self::Featureless | Self::Repeated(_))
    }

    /// True if the image fits the other frames and places itself among them, though less surely
    /// than the user asks for. If its place is not even known to a pixel, it may fit by chance.
    pub fn is_uncertain(&self) -> bool {
        matches!(self, Self::Uncertain { wall_px } if *wall_px < 1.0)
    }

    /// True if the image shows something that fits nowhere, or not the other frames. Frames that
    /// fit at two places, or tell too little, do not speak against the others.
    pub fn is_stray(&self) -> bool {
        let is_undecided = matches!(self, Self::Ambiguous { .. } | Self::Uncertain { .. });
        !self.shows_nothing() && !is_undecided
    }

    /// True if the image shows a wall that does not fit the other frames.
    pub fn is_misfit(&self) -> bool {
        matches!(
            self,
            Self::NoMatch { .. }
                | Self::Ambiguous { .. }
                | Self::Contradicts { .. }
                | Self::Disagrees { .. }
        )
    }

    /// True if the image fits the wall somewhere, but not the other frames.
    pub fn is_misplaced(&self) -> bool {
        matches!(
            self,
            Self::Contradicts { .. }
                | Self::Disagrees { .. }
                | Self::Misaligned { .. }
                | Self::Disconnected { .. }
        )
    }

    /// True if the frame may register successfully among other neighbours.
    pub fn is_retriable(&self) -> bool {
        matches!(self, Self::NoMatch { .. } | Self::Ambiguous { .. }) || self.is_misplaced()
    }
}

impl fmt::Display for RejectionReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Featureless => write!(f, "it shows hardly any contrast (dark, white or covered)"),
            Self::Repeated(frame) => write!(f, "it is the same image as frame {frame}"),
            Self::NoMatch { correlation } => write!(
                f,
                "it does not match the wall anywhere near its prior \
                 (correlation {correlation:.2} at best)"
            ),
            Self::Ambiguous { separation_m, .. } => write!(
                f,
                "it matches the wall equally well at two places {separation_m:.2} m apart, \
                 and the prior does not tell which"
            ),
            Self::Contradicts { frame, correlation } => write!(
                f,
                "it contradicts frames that agree among themselves \
                 (correlation {correlation:.2} with frame {frame})"
            ),
            Self::Blurred { share } => write!(
                f,
                "it is blurred: {:.0} % of the fine contrast that other frames show",
                100.0 * share
            ),
            Self::Disagrees { share } => write!(
                f,
                "{:.0} % of its pixels disagree with the other frames",
                100.0 * share
            ),
            Self::Misaligned { error_px } => write!(
                f,
                "it is displaced by {error_px:.1} px against frames that show the same wall"
            ),
            Self::Disconnected { frames: 1 } => {
                write!(f, "no reliable pair connects it to the other frames")
            }
            Self::Disconnected { frames } => write!(
                f,
                "it is one of {frames} frames that agree with each other, \
                 but no reliable pair connects them to the others"
            ),
            Self::NoOverlap { share } if *share == 0.0 => {
                write!(f, "it overlaps no other frame on the wall")
            }
            Self::NoOverlap { share } => write!(
                f,
                "only {:.1} % of its pixels overlap other frames",
                100.0 * share
            ),
            Self::ContradictsScale { factor } => write!(
                f,
                "refined steps are {factor:.2} times the initial ones, so lengths cannot be \
                 believed"
            ),
            Self::NotTried { failures } => write!(
                f,
                "it was not tried: {failures} frames from the beginning were searched for over \
                 3.5 σ of the prior in all directions, and most do not show the same wall"
            ),
            Self::Minority { frames: 1, .. } => write!(f, "it fits no other frame"),
            Self::Minority { frames, shown } => write!(
                f,
                "only {frames} of {shown} frames fit each other, which may be chance where so \
                 many do not"
            ),
            Self::Misread => write!(
                f,
                "neighbouring frames agree with another reading of poses, pictures or camera"
            ),
            Self::Unsolved => write!(f, "the equations of the survey have no solution"),
            Self::LeftOut => write!(f, "it was not looked at, since tracking was behind"),
            Self::Uncertain { wall_px } if !wall_px.is_finite() => write!(
                f,
                "the other frames do not tell its position on the wall: too little texture, or \
                 frames that do not match"
            ),
            Self::Uncertain { wall_px } => write!(
                f,
                "its position on the wall is uncertain by {wall_px:.2} px, more than \
                 --max-sigma-px allows: too little texture"
            ),
        }
    }
}

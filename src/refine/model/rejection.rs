//! Why a frame's pixels are not inliers.

use crate::trajectory::Pose;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A reason to leave a frame at its prior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum RejectionReason {
    /// Hardly any contrast: black, white, lamp off, lens covered.
    Featureless,
    /// The same picture as an earlier frame's.
    Repeated(usize),
    /// The wall at its pose shows something else.
    NoMatch {
        /// Correlation of local contrast at best.
        correlation: f64,
    },
    /// It matches the wall at two places.
    Ambiguous {
        /// The second one.
        other: Pose,
        /// How far apart the two put the frame's middle on the wall, metres.
        separation_m: f64,
    },
    /// It contradicts frames that agree among themselves.
    Contradicts {
        /// One of them.
        frame: usize,
        /// Correlation of local contrast with it.
        correlation: f64,
    },
    /// Sharp edges of the wall are not sharp in it.
    Blurred {
        /// Its contrast at the finest detail over that of its neighbours.
        share: f64,
    },
    /// Too much of it disagrees with the others, pixel by pixel.
    Disagrees {
        /// Share of its pixels, 0 to 1.
        share: f64,
    },
    /// It is displaced against frames that show the same wall.
    Misaligned {
        /// By how much, pixels.
        error_px: f64,
    },
    /// Nothing sure ties it, or the group of frames that it agrees with, to the others.
    Disconnected {
        /// Frames of that group.
        frames: usize,
    },
    /// The last solve had not come to rest.
    NotConverged {
        /// The step that was left, pixels on the wall.
        step_px: f64,
    },
    /// Nothing or too little in common with others.
    NoOverlap {
        /// Share of its pixels that others show, 0 to 1.
        share: f64,
    },
    /// Its patches do not all fit the others at once.
    Overdispersed {
        /// What they are off by, beyond noise, pixels.
        overdispersion_px: f64,
    },
    /// Too little texture to fix its place.
    Uncertain {
        /// 1-σ on the wall, pixels.
        wall_px: f64,
    },
}

impl RejectionReason {
    /// True if the frame shows something, but nothing that fits the others.
    pub fn is_misfit(&self) -> bool {
        matches!(
            self,
            Self::NoMatch { .. }
                | Self::Ambiguous { .. }
                | Self::Contradicts { .. }
                | Self::Disagrees { .. }
        )
    }

    /// True if another try, with other frames around, may place the frame.
    pub fn is_retriable(&self) -> bool {
        matches!(
            self,
            Self::NoMatch { .. }
                | Self::Ambiguous { .. }
                | Self::Contradicts { .. }
                | Self::Disagrees { .. }
                | Self::Misaligned { .. }
                | Self::Disconnected { .. }
        )
    }
}

impl fmt::Display for RejectionReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Featureless => write!(f, "it shows hardly any contrast (dark, white or covered)"),
            Self::Repeated(frame) => write!(f, "it is the same picture as frame {frame}"),
            Self::NoMatch { correlation } => write!(
                f,
                "it does not match the wall anywhere near its prior (correlation {correlation:.2} at best)"
            ),
            Self::Ambiguous { separation_m, .. } => write!(
                f,
                "it matches the wall equally well at two places {separation_m:.2} m apart, and the prior does not tell which"
            ),
            Self::Contradicts { frame, correlation } => write!(
                f,
                "it contradicts frames that agree among themselves (correlation {correlation:.2} with frame {frame})"
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
                write!(f, "nothing sure ties it to the other frames")
            }
            Self::Disconnected { frames } => write!(
                f,
                "it is one of {frames} frames that agree with each other but that nothing sure ties to the others"
            ),
            Self::NotConverged { step_px } => write!(
                f,
                "its pose had not come to rest: the next step would move it by {step_px:.1} px"
            ),
            Self::NoOverlap { share } if *share == 0.0 => {
                write!(f, "it overlaps no other frame on the wall")
            }
            Self::NoOverlap { share } => write!(
                f,
                "only {:.1} % of its pixels overlap other frames",
                100.0 * share
            ),
            Self::Overdispersed { overdispersion_px } => write!(
                f,
                "it fits the others only under overdispersion (patches of it are off by {overdispersion_px:.2} px, or those of most frames are): a wrong \
                 camera, radius or shape, or a wall that repeats and is closed a period off"
            ),
            Self::Uncertain { wall_px } => write!(
                f,
                "its place on the wall is uncertain by {wall_px:.1} px: too little texture, or frames that do not match"
            ),
        }
    }
}

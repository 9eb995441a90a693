//! Data from which all sections of the page are drawn.

use crate::refine::FrameFlag;
use crate::report::chart::Axis;
use crate::report::model::{Abscissa, Report};
use crate::report::pictures::Pictures;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// Report and pictures, from which all sections of the page are drawn.
pub(super) struct PageData<'a> {
    /// The report.
    pub(super) report: &'a Report,
    /// Its pictures.
    pub(super) pictures: &'a Pictures,
}

impl PageData<'_> {
    /// A picture as data URI; an empty one if there is no picture of this name.
    pub(super) fn jpeg(&self, file: &str) -> String {
        let bytes = self.pictures.get(file);
        bytes.map_or_else(
            || "data:,".to_owned(),
            |bytes| data_uri("image/jpeg", bytes),
        )
    }

    /// Abscissa of every frame in charts.
    fn abscissae(&self) -> Vec<f64> {
        let frames = self.report.frames.iter();
        match self.report.abscissa {
            Abscissa::Chainage => frames.map(|frame| frame.refined_m[1]).collect(),
            Abscissa::Frame => frames.map(|frame| frame.index as f64).collect(),
        }
    }

    /// Horizontal axis of charts of frames.
    pub(super) fn axis(&self) -> Axis {
        let abscissae = self.abscissae();
        let low = abscissae.iter().copied().fold(f64::INFINITY, f64::min);
        let high = abscissae.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Axis {
            name: match self.report.abscissa {
                Abscissa::Chainage => "chainage (m)".to_owned(),
                Abscissa::Frame => "frame".to_owned(),
            },
            range: if low <= high { [low, high] } else { [0.0, 1.0] },
            whole: self.report.abscissa == Abscissa::Frame,
        }
    }

    /// Indices of flagged frames.
    pub(super) fn flagged(&self) -> Vec<usize> {
        let frames = self.report.refinement.iter().flat_map(|r| &r.frames);
        let flagged = frames.filter(|frame| frame.flag != FrameFlag::Photometric);
        flagged.map(|frame| frame.index).collect()
    }

    /// Abscissae of flagged frames in charts.
    pub(super) fn marks(&self) -> Vec<f64> {
        let abscissae = self.abscissae();
        let of = |frame: usize| abscissae.get(frame).copied();
        self.flagged().into_iter().filter_map(of).collect()
    }

    /// Abscissa and value of every frame that has a value.
    pub(super) fn points(&self, value: impl Fn(usize) -> Option<f64>) -> Vec<[f64; 2]> {
        let abscissae = self.abscissae();
        let pairs = abscissae.iter().enumerate();
        pairs.filter_map(|(k, x)| Some([*x, value(k)?])).collect()
    }
}

/// Bytes as data URI.
pub(super) fn data_uri(kind: &str, bytes: &[u8]) -> String {
    format!("data:{kind};base64,{}", STANDARD.encode(bytes))
}

//! A line chart: curves, axes and marks.

/// Meaning of a curve, which decides its appearance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveStyle {
    /// Initial poses.
    Initial,
    /// Refined poses.
    Refined,
    /// True poses.
    Truth,
    /// The n-th curve of an ordered set, as pyramid levels.
    Ordered(usize),
}

impl CurveStyle {
    /// Class in the style sheet.
    pub fn class(self) -> String {
        match self {
            Self::Initial => "initial".to_owned(),
            Self::Refined => "refined".to_owned(),
            Self::Truth => "truth".to_owned(),
            Self::Ordered(k) => format!("ordered-{}", k % 6),
        }
    }
}

/// A curve of a chart.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name.
    pub name: String,
    /// Its appearance.
    pub style: CurveStyle,
    /// Its points, along the curve.
    pub points: Vec<[f64; 2]>,
    /// 1-σ of each point; empty if there is none.
    pub sigma: Vec<f64>,
}

impl Series {
    /// A curve without uncertainty.
    pub fn new(name: &str, style: CurveStyle, points: Vec<[f64; 2]>) -> Self {
        Self {
            name: name.to_owned(),
            style,
            points,
            sigma: Vec::new(),
        }
    }

    /// Adds the 1-σ of the points that have one.
    pub fn with_sigma(mut self, sigma: impl Iterator<Item = Option<f64>>) -> Self {
        let sigma: Vec<f64> = sigma.map(|sigma| sigma.unwrap_or(f64::NAN)).collect();
        if sigma.iter().any(|sigma| sigma.is_finite()) {
            self.sigma = sigma;
        }
        self
    }

    /// Upper and lower edge of the band of ±1-σ.
    pub(super) fn band_edges(&self) -> [Vec<[f64; 2]>; 2] {
        let edge = |sign: f64| {
            let points = self.points.iter().zip(&self.sigma);
            points.map(|([x, y], s)| [*x, y + sign * s]).collect()
        };
        [edge(1.0), edge(-1.0)]
    }
}

/// Horizontal axis of a chart.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Its name with the unit.
    pub name: String,
    /// Its range.
    pub range: [f64; 2],
    /// True if all values are integers.
    pub whole: bool,
}

/// Scale of a chart's vertical axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vertical {
    /// Linear over the values.
    Linear,
    /// Linear from zero to the highest value.
    FromZero,
    /// Logarithmic over the values, which are positive.
    Logarithmic,
}

/// A line chart.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Title.
    pub title: String,
    /// Unit of the values; empty for pure numbers.
    pub unit: String,
    /// The horizontal axis.
    pub along: Axis,
    /// The vertical axis.
    pub vertical: Vertical,
    /// The curves.
    pub series: Vec<Series>,
    /// Abscissae of flagged frames.
    pub marks: Vec<f64>,
}

//! Counts points, checks them and hands them over.

use super::error::PointsError;
use nalgebra::Vector3;
use std::path::Path;

/// Largest coordinate, metres: more than the circumference of the Earth is no position.
const MAX_COORDINATE_M: f64 = 1e8;

/// Number of points of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PointCount {
    /// Points that were handed over.
    pub read: u64,
    /// Points whose coordinates are all NaN: nothing was measured there.
    pub empty: u64,
}

/// A visitor of the points of one file.
pub struct PointVisitor<'v> {
    path: &'v Path,
    visit: &'v mut dyn FnMut(Vector3<f64>),
    /// Points so far.
    pub count: PointCount,
}

/// The place of a point in its file, counted from 1.
#[derive(Clone, Copy, Debug)]
pub enum Place {
    /// A line of text.
    Line(u64),
    /// A point of a binary file.
    Point(u64),
}

impl<'v> PointVisitor<'v> {
    /// A visitor before the first point.
    pub fn new(path: &'v Path, visit: &'v mut dyn FnMut(Vector3<f64>)) -> Self {
        Self {
            path,
            visit,
            count: PointCount::default(),
        }
    }

    /// The file.
    pub fn path(&self) -> &'v Path {
        self.path
    }

    /// The error of a place.
    pub fn error(&self, place: Place, what: impl Into<String>) -> PointsError {
        match place {
            Place::Line(line) => PointsError::line(self.path, line, what),
            Place::Point(point) => PointsError::point(self.path, point, what),
        }
    }

    /// Hands over a point, metres.
    ///
    /// # Errors
    /// A coordinate that is not finite, or larger than any position.
    pub fn put(&mut self, place: Place, [x, y, z]: [f64; 3]) -> Result<(), PointsError> {
        let is_possible = |v: f64| v.abs() <= MAX_COORDINATE_M;
        if !(is_possible(x) && is_possible(y) && is_possible(z)) {
            return Err(self.error(
                place,
                format!(
                    "is at ({x}, {y}, {z}); coordinates must be finite, metres; remove the point, \
                     or export the file again without invalid points"
                ),
            ));
        }
        self.count.read += 1;
        (self.visit)(Vector3::new(x, y, z));
        Ok(())
    }

    /// Hands over a point whose coordinates are all NaN where nothing was measured.
    ///
    /// # Errors
    /// Those of [`PointVisitor::put`].
    pub fn put_measured(&mut self, place: Place, point: [f64; 3]) -> Result<(), PointsError> {
        if point.iter().all(|v| v.is_nan()) {
            self.count.empty += 1;
            return Ok(());
        }
        self.put(place, point)
    }
}

impl Place {
    /// The place after this one.
    pub fn next(self) -> Self {
        match self {
            Self::Line(line) => Self::Line(line + 1),
            Self::Point(point) => Self::Point(point + 1),
        }
    }
}

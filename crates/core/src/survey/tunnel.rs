//! `[tunnel]`: the shape of the tunnel.

use super::error::SurveyError;
use super::ignore::IgnoreSection;
use super::shape_file::ShapeFile;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tunnelstitch_geometry::surface::section::{CircleOutline, Ellipse, PiecewiseOutline, Section};
use tunnelstitch_geometry::surface::{
    CentrePoint, Centreline, Circle, Prism, SIZES_M, Surface, Swept,
};
use tunnelstitch_geometry::trajectory::{LengthUnit, PoseError, text};

/// 1-σ of a real lining's deviation from its nominal shape, radii: a centimetre at a radius of
/// three metres.
pub const DEFAULT_SHAPE_SIGMA_RADII: f64 = 1.0 / 300.0;
/// Largest 1-σ of it, radii.
const MAX_SHAPE_SIGMA_RADII: f64 = 0.1;
/// Radius above which a unit is more likely wrong, metres: the widest caverns span 100 m.
const MAX_RADIUS_M: f64 = 100.0;
/// Radii of most tunnels and pipes, metres.
const USUAL_RADII_M: RangeInclusive<f64> = 0.05..=10.0;
/// Largest 1-σ of the radius, percent.
const MAX_RADIUS_SIGMA_PERCENT: f64 = 30.0;

/// The section of the tunnel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// A circle of radius `radius_m`.
    Circle,
    /// An ellipse with its axes along x and z: `width_m`, `height_m`.
    Ellipse,
    /// A rectangle, the axis in its middle: `width_m`, `height_m`.
    Box,
    /// A round arch on straight walls and a flat floor, the axis in the middle of the arch:
    /// `width_m`, `height_m`.
    Horseshoe,
}

/// `[tunnel]`. Width is along x, height along z; twelve o'clock is +z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TunnelSection {
    /// The shape of the section.
    pub shape: Shape,
    /// Radius of a circle, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_m: Option<f64>,
    /// Width of any other section, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width_m: Option<f64>,
    /// Height of any other section, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f64>,
    /// A file of the centreline, if it is not the world's y axis; see [`read_centreline`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centreline: Option<PathBuf>,
    /// A file of the wall's displacement from this shape ([`crate::survey::ShapeFile`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape_file: Option<PathBuf>,
    /// 1-σ of the wall's deviation from the given shape, millimetres; 0 if it is exact. By default
    /// that of a real lining, a 300th of the radius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape_sigma_mm: Option<f64>,
    /// 1-σ of the radius (of the size of any other section), percent; 0 if it is exact. By default
    /// that of a real lining, a third.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_sigma_percent: Option<f64>,
    /// A file of measured points of the wall, in the world of the poses
    /// ([`crate::points::read_points`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<PathBuf>,
    /// Regions of the wall that are excluded from the comparison of frames: water, plants, moving
    /// objects.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ignore: Vec<IgnoreSection>,
}

impl TunnelSection {
    /// A straight round tunnel of the given radius, metres.
    pub fn round(radius_m: f64) -> Self {
        Self {
            shape: Shape::Circle,
            radius_m: Some(radius_m),
            width_m: None,
            height_m: None,
            centreline: None,
            shape_file: None,
            shape_sigma_mm: None,
            radius_sigma_percent: None,
            points: None,
            ignore: Vec::new(),
        }
    }

    /// Radius of a circle, half the width of any other section, metres; 0 where it is missing.
    pub fn nominal_m(&self) -> f64 {
        self.radius_m
            .or(self.width_m.map(|width_m| 0.5 * width_m))
            .unwrap_or_default()
    }

    /// The sentence about a radius that no tunnel has, if it is one: with the radius in metres by
    /// the units of length in which it is a usual one.
    pub fn size_warning(&self) -> Option<String> {
        let radius_m = self.radius_m.filter(|radius_m| *radius_m > MAX_RADIUS_M)?;
        let metres = |unit: &LengthUnit| (radius_m * unit.length_m * 1e3).round() / 1e3;
        let units = LengthUnit::OTHERS.into_iter();
        let usual = units.filter(|unit| USUAL_RADII_M.contains(&metres(unit)));
        let readings = usual
            .map(|unit| {
                format!(
                    "; if it is in {}, write radius_m = {}",
                    unit.name,
                    metres(&unit)
                )
            })
            .collect::<String>();
        Some(format!(
            "tunnel.radius_m is {radius_m} metres, and no tunnel is so wide{readings}"
        ))
    }

    /// True for a straight round tunnel, whose radius and axis can be estimated.
    pub fn is_straight_and_round(&self) -> bool {
        self.shape == Shape::Circle && self.centreline.is_none()
    }

    /// 1-σ of the wall's deviation from the given shape, metres.
    ///
    /// # Errors
    /// A value that is negative or more than a tenth of the radius, as text.
    pub fn shape_sigma_m(&self) -> Result<f64, String> {
        let most_mm = 1e3 * MAX_SHAPE_SIGMA_RADII * self.nominal_m();
        match self.shape_sigma_mm {
            None => Ok(DEFAULT_SHAPE_SIGMA_RADII * self.nominal_m()),
            Some(mm) if (0.0..=most_mm).contains(&mm) => Ok(1e-3 * mm),
            Some(mm) => Err(format!(
                "tunnel.shape_sigma_mm is {mm}; it must lie between 0 (exact) and {most_mm:.0}, a \
                 tenth of the radius"
            )),
        }
    }

    /// Relative 1-σ of the radius, or of the size of any other section.
    ///
    /// # Errors
    /// A value that is negative or more than 30 percent, as text.
    pub fn radius_sigma(&self) -> Result<f64, String> {
        match self.radius_sigma_percent {
            None => Ok(DEFAULT_SHAPE_SIGMA_RADII),
            Some(percent) if (0.0..=MAX_RADIUS_SIGMA_PERCENT).contains(&percent) => {
                Ok(0.01 * percent)
            }
            Some(percent) => Err(format!(
                "tunnel.radius_sigma_percent is {percent}; it must lie between 0 (exact) and \
                 {MAX_RADIUS_SIGMA_PERCENT}"
            )),
        }
    }

    /// The content of `shape_file`; paths are relative to `folder`.
    ///
    /// # Errors
    /// A file that cannot be read or is of another tunnel.
    pub fn found_shape(
        &self,
        planned: &dyn Surface,
        folder: &Path,
    ) -> Result<Option<ShapeFile>, SurveyError> {
        let file = self.shape_file.as_ref();
        let Some(path) = file.map(|file| folder.join(file)) else {
            return Ok(None);
        };
        let found = ShapeFile::read(&path, planned.perimeter_m())?;
        if found.bend.is_some() && !planned.gauge().shift {
            let what = "has a bend, which only a straight tunnel can have; remove it".to_owned();
            return Err(SurveyError::Value { path, what });
        }
        Ok(Some(found))
    }

    /// Creates the tunnel of the given shape, without `shape_file`; paths are relative to `folder`,
    /// and errors name the file `toml`.
    ///
    /// # Errors
    /// A size that is missing, impossible or of another shape; a centreline that cannot be read or
    /// that no tunnel can follow.
    pub fn surface(&self, toml: &Path, folder: &Path) -> Result<Arc<dyn Surface>, SurveyError> {
        let value = |what: String| SurveyError::Value {
            path: toml.to_owned(),
            what: format!("tunnel: {what}"),
        };
        let section = self.section().map_err(value)?;
        let Some(line) = self.centreline(folder, section.as_ref())? else {
            return Ok(match (self.shape, self.radius_m) {
                // The fastest shape.
                (Shape::Circle, Some(radius_m)) => {
                    Arc::new(Circle::new(radius_m).map_err(|error| value(error.to_string()))?)
                }
                _ => Arc::new(Prism::new(section)),
            });
        };
        Ok(Arc::new(Swept::new(section, line)))
    }

    /// The centreline of the given section, None if it is the world's y axis; its path is relative
    /// to `folder`.
    ///
    /// # Errors
    /// A centreline that cannot be read or that no tunnel can follow.
    pub fn centreline(
        &self,
        folder: &Path,
        section: &dyn Section,
    ) -> Result<Option<Centreline>, SurveyError> {
        let Some(centreline) = &self.centreline else {
            return Ok(None);
        };
        let path = folder.join(centreline);
        let points = read_centreline(&path)?;
        let line = Centreline::through(&points, self.nominal_m(), section.farthest_m());
        let line = line.map_err(|error| PoseError::file(&path, error.to_string()))?;
        Ok(Some(line))
    }

    /// Creates the section, or returns the problem of its sizes.
    pub fn section(&self) -> Result<Box<dyn Section>, String> {
        let named = [
            ("radius_m", self.radius_m, self.shape == Shape::Circle),
            ("width_m", self.width_m, self.shape != Shape::Circle),
            ("height_m", self.height_m, self.shape != Shape::Circle),
        ];
        for (name, size, needed) in named {
            match (size, needed) {
                (None, true) => return Err(format!("{name} is missing; this shape needs it")),
                (Some(_), false) => return Err(format!("{name} is not a size of this shape")),
                _ => {}
            }
        }
        let (width_m, height_m) = (
            self.width_m.unwrap_or_default(),
            self.height_m.unwrap_or_default(),
        );
        let fail = |error: tunnelstitch_geometry::surface::SurfaceError| error.to_string();
        Ok(match self.shape {
            Shape::Circle => {
                let radius_m = self.radius_m.unwrap_or_default();
                Circle::new(radius_m).map_err(fail)?;
                Box::new(CircleOutline { radius_m })
            }
            Shape::Ellipse => Box::new(Ellipse::new(width_m, height_m).map_err(fail)?),
            Shape::Box => Box::new(PiecewiseOutline::rectangle(width_m, height_m).map_err(fail)?),
            Shape::Horseshoe => {
                Box::new(PiecewiseOutline::horseshoe(width_m, height_m).map_err(fail)?)
            }
        })
    }
}

/// Reads a centreline: lines `x y z [radius]`, metres, in the world of the poses; text after a `#`
/// is ignored. A radius (half the width, if the section is not a circle) holds at its point and
/// changes smoothly to that of the next.
///
/// # Errors
/// An unreadable file, a line of another form.
pub fn read_centreline(path: &Path) -> Result<Vec<CentrePoint>, SurveyError> {
    let content = text::read(path)?;
    let mut points = Vec::new();
    for (k, line) in content.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let numbers: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
        let (point, radius_m) = match numbers.as_deref() {
            Ok([x, y, z]) => (Vector3::new(*x, *y, *z), None),
            Ok([x, y, z, radius_m]) => (Vector3::new(*x, *y, *z), Some(*radius_m)),
            _ => {
                let what = "not a point of a centreline; a line is x y z or x y z radius, metres";
                return Err(PoseError::line(path, k + 1, what.to_owned()).into());
            }
        };
        if !point.iter().all(|v| v.is_finite()) || radius_m.is_some_and(|r| !SIZES_M.contains(&r)) {
            let what = "its numbers must be finite, and a radius from 0.001 to 100000 m";
            return Err(PoseError::line(path, k + 1, what.to_owned()).into());
        }
        points.push(CentrePoint { point, radius_m });
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(content: &str) -> Result<Vec<CentrePoint>, String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("curve.txt");
        std::fs::write(&path, content).unwrap();
        read_centreline(&path).map_err(|error| error.to_string())
    }

    #[test]
    fn a_centreline_has_points_radii_and_comments() {
        let points = read("# a bend\n0 0 0 3\n\n 1.5 2e1 -3 # here\n").unwrap();
        assert_eq!(points.len(), 2);
        assert_eq!(points[0].radius_m, Some(3.0));
        assert_eq!(points[1].point, Vector3::new(1.5, 20.0, -3.0));
        for (bad, line) in [
            ("0 0 0\n1 2\n", 2),
            ("0 0 zero\n", 1),
            ("\n0 0 NaN\n", 2),
            ("0 0 0 0\n", 1),
            ("0 0 0 1 2\n", 1),
        ] {
            let error = read(bad).unwrap_err();
            assert!(error.contains(&format!("curve.txt:{line}: ")), "{error}");
        }
    }

    #[test]
    fn a_radius_in_another_unit_is_named() {
        let warning = |radius_m| TunnelSection::round(radius_m).size_warning();
        assert_eq!(warning(40.0), None);
        let millimetres = warning(3000.0).unwrap();
        assert!(millimetres.ends_with("so wide; if it is in millimetres, write radius_m = 3"));
        let inches = warning(120.0).unwrap();
        assert!(inches.ends_with("if it is in inches, write radius_m = 3.048"));
    }

    #[test]
    fn the_radius_is_a_third_of_a_percent_sure_or_as_said() {
        let mut tunnel = TunnelSection::round(3.0);
        assert!((tunnel.radius_sigma().unwrap() - 1.0 / 300.0).abs() < 1e-12);
        tunnel.radius_sigma_percent = Some(2.0);
        assert_eq!(tunnel.radius_sigma(), Ok(0.02));
        for wrong in [-1.0, 31.0, f64::NAN] {
            tunnel.radius_sigma_percent = Some(wrong);
            assert!(tunnel.radius_sigma().is_err(), "{wrong}");
        }
    }

    #[test]
    fn shapes_want_their_own_sizes() {
        let tunnel = |shape, sizes: [Option<f64>; 3]| TunnelSection {
            shape,
            radius_m: sizes[0],
            width_m: sizes[1],
            height_m: sizes[2],
            centreline: None,
            shape_file: None,
            shape_sigma_mm: None,
            radius_sigma_percent: None,
            points: None,
            ignore: Vec::new(),
        };
        let surface = |tunnel: TunnelSection| {
            let made = tunnel.surface(Path::new("survey.toml"), Path::new("."));
            made.map_err(|error| error.to_string())
        };
        let (r, w, h) = (Some(3.0), Some(4.0), Some(3.5));
        assert!(surface(tunnel(Shape::Circle, [r, None, None])).is_ok());
        for shape in [Shape::Ellipse, Shape::Box, Shape::Horseshoe] {
            assert!(surface(tunnel(shape, [None, w, h])).is_ok());
            let error = surface(tunnel(shape, [None, w, None])).unwrap_err();
            assert!(error.contains("height_m is missing"), "{error}");
            let error = surface(tunnel(shape, [r, w, h])).unwrap_err();
            assert!(error.contains("radius_m is not"), "{error}");
            let error = surface(tunnel(shape, [None, Some(-4.0), h])).unwrap_err();
            assert!(error.contains("width_m is -4"), "{error}");
        }
        let error = surface(tunnel(Shape::Circle, [None; 3])).unwrap_err();
        assert!(error.contains("radius_m is missing"), "{error}");
    }
}

//! The layers of the map: sections, manholes, defects.

use super::error::MapError;
use super::figures::{Accuracy, WorstDeformation};
use super::geometry::Geometry;
use super::geopackage::{Column, ColumnType, Feature, GeoPackage, Layer};
use super::section_state::{SectionState, SectionTasks};
use crate::inspect::{Mark, Marks};
use crate::jobs::{Crs, Job, Network, Section, SectionLine, Step};
use crate::survey::toml_path;
use rusqlite::types::Value;
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Columns of the sections.
const SECTIONS: [(&str, ColumnType); 23] = [
    ("id", ColumnType::Text),
    ("from_manhole", ColumnType::Text),
    ("to_manhole", ColumnType::Text),
    ("state", ColumnType::Text),
    ("reason", ColumnType::Text),
    ("frames", ColumnType::Integer),
    ("photometric", ColumnType::Integer),
    ("photometric_share", ColumnType::Real),
    ("sigma_registration_px", ColumnType::Real),
    ("sigma_registration_mm", ColumnType::Real),
    ("sigma_absolute_px", ColumnType::Real),
    ("sigma_absolute_mm", ColumnType::Real),
    ("deviation_extreme_mm", ColumnType::Real),
    ("deviation_extreme_at_m", ColumnType::Real),
    ("ovality_max_mm", ColumnType::Real),
    ("ovality_max_sigma_mm", ColumnType::Real),
    ("ovality_max_at_m", ColumnType::Real),
    ("defects", ColumnType::Integer),
    ("severity_max", ColumnType::Integer),
    ("report", ColumnType::Text),
    ("panorama", ColumnType::Text),
    ("poses", ColumnType::Text),
    ("tiles", ColumnType::Text),
];

/// Columns of the defects.
const DEFECTS: [(&str, ColumnType); 12] = [
    ("section", ColumnType::Text),
    ("id", ColumnType::Text),
    ("class", ColumnType::Text),
    ("severity", ColumnType::Integer),
    ("note", ColumnType::Text),
    ("chainage_m", ColumnType::Real),
    ("clock", ColumnType::Text),
    ("end_chainage_m", ColumnType::Real),
    ("end_clock", ColumnType::Text),
    ("length_m", ColumnType::Real),
    ("width_mm", ColumnType::Real),
    ("created", ColumnType::Text),
];

/// Columns of the manholes.
const MANHOLES: [(&str, ColumnType); 1] = [("id", ColumnType::Text)];

/// Draws the map of a network whose `job` is in `folder`; its links are relative to the folder
/// `base` of the map.
///
/// # Errors
/// A network without a coordinate reference system; a section without a place; records, results or
/// marks that cannot be read.
pub fn draw_map(
    network: &Network,
    job: &Job,
    folder: &Path,
    base: &Path,
) -> Result<(GeoPackage, Vec<SectionState>), MapError> {
    let crs: Crs = network.crs.ok_or_else(|| MapError::NoCrs {
        path: network.path.clone(),
    })?;
    let sections = network.sections.par_map(|section| {
        let line = SectionLine::of(network, section)?;
        SectionOnMap::read(section, line, job, folder)
    });
    let sections: Vec<SectionOnMap> = sections.into_iter().collect::<Result<_, _>>()?;
    let layers = vec![
        Layer {
            name: "sections",
            description: "Sections of the network, and how they were refined",
            geometry_type: "LINESTRING",
            columns: columns(&SECTIONS),
            features: sections
                .iter()
                .map(|section| section.feature(base))
                .collect(),
        },
        Layer {
            name: "manholes",
            description: "Manholes at the ends of the sections",
            geometry_type: "POINT",
            columns: columns(&MANHOLES),
            features: manholes(network),
        },
        Layer {
            name: "defects",
            description: "Marked defects, on the line of their section",
            geometry_type: "POINT",
            columns: columns(&DEFECTS),
            features: sections.iter().flat_map(SectionOnMap::defects).collect(),
        },
    ];
    let states = sections.into_iter().map(|section| section.state).collect();
    Ok((GeoPackage { crs, layers }, states))
}

fn columns(columns: &[(&'static str, ColumnType)]) -> Vec<Column> {
    let columns = columns.iter();
    columns
        .map(|(name, kind)| Column { name, kind: *kind })
        .collect()
}

fn manholes(network: &Network) -> Vec<Feature> {
    let manholes = network.manholes.iter().map(|manhole| Feature {
        geometry: Geometry::Point(manhole.position_m),
        values: vec![text(&manhole.id)],
    });
    manholes.collect()
}

/// A section, with all that the map has of it.
struct SectionOnMap<'n> {
    section: &'n Section,
    line: SectionLine,
    state: SectionState,
    accuracy: Option<Accuracy>,
    deformation: WorstDeformation,
    marks: Vec<Mark>,
    /// Report, panorama, poses and tiles, if they are done.
    results: [Option<PathBuf>; 4],
}

impl<'n> SectionOnMap<'n> {
    fn read(
        section: &'n Section,
        line: SectionLine,
        job: &Job,
        folder: &Path,
    ) -> Result<Self, MapError> {
        let tasks = SectionTasks::read(folder, job, &section.id)?;
        let refined = tasks.output(Step::Refine, true);
        let refined = refined.map(|refined| folder.join(refined));
        let deformation = refined.as_deref().map(WorstDeformation::read).transpose()?;
        let survey = toml_path(&section.survey);
        let marks = Marks::open(survey.parent().unwrap_or(Path::new("")))?;
        // A task is done only with its outputs, which may be on another machine.
        let result = |step: Step, name: &str| {
            let output = folder.join(tasks.output(step, false)?);
            // Joined with nothing, a file would become a folder.
            Some(match name {
                "" => output,
                _ => output.join(name),
            })
        };
        Ok(Self {
            state: tasks.state(),
            accuracy: refined.as_deref().map(Accuracy::read).transpose()?,
            deformation: deformation.unwrap_or_default(),
            marks: marks.all().to_vec(),
            results: [
                result(Step::Report, "report.html"),
                result(Step::Stitch, ""),
                result(Step::Refine, "poses.tum"),
                result(Step::Export, "tileset.json"),
            ],
            section,
            line,
        })
    }

    fn feature(&self, base: &Path) -> Feature {
        let (accuracy, deformation) = (self.accuracy.as_ref(), &self.deformation);
        let ends = self.section.ends.as_ref();
        let reason = match &self.state {
            SectionState::Failed { reason } => Some(reason.as_str()),
            SectionState::NotUsable => accuracy.and_then(|known| known.verdict.as_deref()),
            _ => None,
        };
        let of_accuracy = |of: fn(&Accuracy) -> Option<f64>| real(accuracy.and_then(of));
        let count = |of: fn(&Accuracy) -> usize| accuracy.map_or(Value::Null, |a| integer(of(a)));
        let severest = self.marks.iter().map(|mark| mark.properties.severity).max();
        let [deviation_mm, deviation_m] = pair(deformation.deviation);
        let [ovality_mm, ovality_m] = pair(deformation.ovality);
        let mut values = vec![
            text(&self.section.id),
            maybe_text(ends.map(|ends| ends.from.as_str())),
            maybe_text(ends.map(|ends| ends.to.as_str())),
            text(self.state.name()),
            maybe_text(reason),
            count(|accuracy| accuracy.frames),
            count(|accuracy| accuracy.photometric),
            of_accuracy(Accuracy::photometric_share),
            of_accuracy(|accuracy| accuracy.registration_px),
            of_accuracy(|accuracy| accuracy.registration_mm),
            of_accuracy(|accuracy| accuracy.absolute_px),
            of_accuracy(|accuracy| accuracy.absolute_mm),
            deviation_mm,
            deviation_m,
            ovality_mm,
            real(deformation.ovality_sigma_mm),
            ovality_m,
            integer(self.marks.len()),
            severest.map_or(Value::Null, |severity| Value::Integer(severity.into())),
        ];
        values.extend(self.results.iter().map(|path| link(path.as_deref(), base)));
        Feature {
            geometry: Geometry::LineString(self.line.points_m()),
            values,
        }
    }

    fn defects(&self) -> impl Iterator<Item = Feature> {
        self.marks.iter().map(|mark| {
            let p = &mark.properties;
            Feature {
                geometry: Geometry::Point(self.line.at(p.chainage_m)),
                values: vec![
                    text(&self.section.id),
                    text(&mark.id),
                    text(&p.class),
                    Value::Integer(p.severity.into()),
                    text(&p.note),
                    Value::Real(p.chainage_m),
                    text(&p.clock),
                    real(p.end_chainage_m),
                    maybe_text(p.end_clock.as_deref()),
                    real(p.length_m),
                    real(p.width_mm),
                    text(&p.created),
                ],
            }
        })
    }
}

fn text(value: &str) -> Value {
    Value::Text(value.to_owned())
}

fn maybe_text(value: Option<&str>) -> Value {
    value.map_or(Value::Null, text)
}

fn integer(value: usize) -> Value {
    Value::Integer(value as i64)
}

/// A number; nothing if it is not known.
fn real(value: Option<f64>) -> Value {
    value
        .filter(|value| value.is_finite())
        .map_or(Value::Null, Value::Real)
}

fn pair(values: Option<(f64, f64)>) -> [Value; 2] {
    [
        real(values.map(|pair| pair.0)),
        real(values.map(|pair| pair.1)),
    ]
}

/// The path of a result from the folder of the map, with `/` on all systems.
fn link(path: Option<&Path>, base: &Path) -> Value {
    let relative = path.and_then(|path| {
        let [path, base] = [path, base].map(|path| std::path::absolute(path).ok());
        pathdiff::diff_paths(path?, base?)
    });
    relative.map_or(Value::Null, |relative| {
        let parts = relative.components();
        let parts = parts.map(|part| part.as_os_str().to_string_lossy().into_owned());
        Value::Text(parts.collect::<Vec<String>>().join("/"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nothing has been run, and the network is on the map all the same.
    #[test]
    fn sections_without_results_are_on_the_map_with_their_marks() {
        let dir = tempfile::tempdir().unwrap();
        let survey = dir.path().join("a");
        std::fs::create_dir(&survey).unwrap();
        let mark = r#"{"type": "FeatureCollection", "features": [{"type": "Feature", "id": "m1",
            "geometry": {"type": "Point", "coordinates": [5.0, 1.5]},
            "properties": {"class": "BAB", "severity": 3, "note": "wet", "chainage_m": 5.0,
            "clock": "4:30", "theta_deg": 135.0, "x_m": 0.1, "y_m": 5.0, "z_m": -1.0,
            "layer": "refined", "created": ""}}]}"#;
        std::fs::write(survey.join("marks.geojson"), mark).unwrap();
        let file = dir.path().join("network.toml");
        let content = "crs = \"EPSG:2056\"\n\
            [[manhole]]\nid = \"M1\"\nposition_m = [100.0, 200.0]\n\
            [[manhole]]\nid = \"M2\"\nposition_m = [130.0, 240.0]\n\
            [[section]]\nid = \"a\"\nsurvey = \"a\"\nfrom = \"M1\"\nto = \"M2\"\n";
        std::fs::write(&file, content).unwrap();
        let network = Network::read(&file).unwrap();
        let job = Job::new(Vec::new());
        let (map, states) = draw_map(&network, &job, dir.path(), dir.path()).unwrap();
        assert_eq!(states, [SectionState::NotRun]);
        let [sections, manholes, defects] = &map.layers[..] else {
            panic!("{map:?}");
        };
        for layer in &map.layers {
            let columns = layer.columns.len();
            assert!(
                layer
                    .features
                    .iter()
                    .all(|feature| feature.values.len() == columns)
            );
        }
        let ends = vec![[100.0, 200.0], [130.0, 240.0]];
        assert_eq!(sections.features[0].geometry, Geometry::LineString(ends));
        assert_eq!(sections.features[0].values[3], text("not run"));
        assert_eq!(
            sections.features[0].values[17..19],
            [integer(1), integer(3)]
        );
        assert_eq!(manholes.features.len(), 2);
        assert_eq!(
            defects.features[0].geometry,
            Geometry::Point([103.0, 204.0])
        );
        assert_eq!(defects.features[0].values[2], text("BAB"));
        let no_crs = Network {
            crs: None,
            ..network
        };
        let message = draw_map(&no_crs, &job, dir.path(), dir.path()).unwrap_err();
        assert!(message.to_string().contains("has no crs"), "{message}");
    }

    #[test]
    fn links_are_relative_to_the_map() {
        let of = |path: &str, base: &str| link(Some(Path::new(path)), Path::new(base));
        assert_eq!(of("/n/job/K1/poses.tum", "/n/job"), text("K1/poses.tum"));
        assert_eq!(of("job/K1/poses.tum", "."), text("job/K1/poses.tum"));
        assert_eq!(of("/n/job/K1/p.tif", "/n/maps"), text("../job/K1/p.tif"));
        assert_eq!(link(None, Path::new(".")), Value::Null);
    }
}

//! Metashape's cameras in XML: a `camera` with its `label` and a `transform` of sixteen numbers,
//! row by row, **camera-to-chunk** in OpenCV's axes.
//!
//! The `transform` of the camera's component, or else of the chunk (rotation, translation and
//! scale), leads to the world, `x_world = s R x_chunk + t`: the local coordinate system in metres,
//! or the geocentric one if the chunk has geographic or projected coordinates. Without it, the
//! positions are those of the chunk, in a unit that is unknown. Labels are the names of pictures,
//! mostly without their endings.
//!
//! Source: Agisoft Metashape 2.1, "Export Cameras" (XML); Metashape Python Reference, `Camera` and
//! `ChunkTransform`.

use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::{rigid, text};
use crate::files::xml::{child, children, numbers, parse as parse_xml};
use nalgebra::Vector3;
use roxmltree::Node;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
    let fail = |what: String| PoseError::file(path, what);
    let document = parse_xml(text).map_err(fail)?;
    let chunks: Vec<Node> = children(document.root_element(), "chunk").collect();
    let [chunk] = chunks[..] else {
        return Err(fail(match chunks.len() {
            0 => "is XML without a `chunk`, and so not the cameras of Metashape".to_owned(),
            count => format!("holds {count} chunks; export the cameras of one"),
        }));
    };
    let world = World::of(chunk).map_err(fail)?;
    let mut names = text::Names::default();
    let mut entries = Vec::new();
    let mut unplaced = BTreeSet::new();
    let cameras = child(chunk, "cameras").into_iter();
    let cameras = cameras.flat_map(|cameras| cameras.descendants());
    for camera in cameras.filter(|node| node.has_tag_name("camera")) {
        let Some(transform) = child(camera, "transform") else {
            continue;
        };
        let name = camera.attribute("label").unwrap_or_default();
        let of_camera = |what: String| fail(format!("camera {name:?}: {what}"));
        names.add(name).map_err(of_camera)?;
        let pose = camera_in_chunk(transform).map_err(of_camera)?;
        let component = camera.attribute("component_id").unwrap_or_default();
        let placement = world.of_component(component);
        if placement.is_none() {
            unplaced.insert(component);
        }
        entries.push(PoseEntry::named(
            name,
            placement.map_or(pose, |placement| placement.after(&pose)),
        ));
    }
    if unplaced.len() > 1 {
        return Err(fail(format!(
            "its cameras belong to {} components that are not aligned with each other; export one",
            unplaced.len()
        )));
    }
    Ok(entries)
}

fn camera_in_chunk(transform: Node) -> Result<Pose, String> {
    let values: [f64; 16] = numbers(transform)?;
    let (rows, _) = values.as_chunks::<4>();
    rigid::from_rows(rows)
}

/// A motion with a scale, `x ← s R x + t`.
struct Similarity {
    motion: Pose,
    scale: f64,
}

impl Similarity {
    /// The similarity of a `transform`; what it lacks changes nothing.
    fn of(transform: Node) -> Result<Self, String> {
        let rotation = child(transform, "rotation").map(numbers::<9>);
        let translation = child(transform, "translation").map(numbers::<3>);
        let scale = child(transform, "scale").map(numbers::<1>);
        let [x, y, z] = translation.transpose()?.unwrap_or_default();
        let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let [a, b, c, d, e, f, g, h, i] = rotation.transpose()?.unwrap_or(identity);
        let [scale] = scale.transpose()?.unwrap_or([1.0]);
        if scale <= 0.0 {
            return Err(format!(
                "the scale of a transform is {scale}; it must be positive"
            ));
        }
        Ok(Self {
            motion: rigid::from_rows(&[[a, b, c, x], [d, e, f, y], [g, h, i, z]])?,
            scale,
        })
    }

    /// A pose of the chunk in the world.
    fn after(&self, pose: &Pose) -> Pose {
        let scaled: Vector3<f64> = pose.t_wc * self.scale;
        self.motion.after(&Pose::new(pose.r_wc, scaled))
    }
}

/// The placement of a chunk and its components in the world.
struct World<'a> {
    chunk: Option<Similarity>,
    components: HashMap<&'a str, Similarity>,
}

impl<'a> World<'a> {
    fn of(chunk: Node<'a, '_>) -> Result<Self, String> {
        let mut components = HashMap::new();
        let all = child(chunk, "components").into_iter();
        for component in all.flat_map(|all| children(all, "component")) {
            if let Some(transform) = child(component, "transform") {
                let id = component.attribute("id").unwrap_or_default();
                components.insert(id, Similarity::of(transform)?);
            }
        }
        let chunk = child(chunk, "transform").map(Similarity::of).transpose()?;
        Ok(Self { chunk, components })
    }

    /// The placement of a component, or that of the chunk.
    fn of_component(&self, id: &str) -> Option<&Similarity> {
        self.components.get(id).or(self.chunk.as_ref())
    }
}

#[cfg(test)]
mod tests {
    use crate::trajectory::format_tests::read_named;
    use crate::trajectory::{Convention, PoseFile, PoseFormat};
    use nalgebra::Vector3;

    fn read(text: &str) -> Result<PoseFile, String> {
        read_named("cameras.xml", text)
    }

    /// x of the camera towards the chunk's −y, y towards −z, z along x.
    const TRANSFORM: &str = "0 0 1 1  -1 0 0 2  0 -1 0 3  0 0 0 1";

    fn file(transforms: [&str; 2], component: &str, chunk: &str) -> String {
        let [a, b] = transforms;
        format!(
            r#"<?xml version="1.0" encoding="UTF-8"?>
<document version="2.0.0"><chunk label="Chunk 1" enabled="true"><sensors next_id="1"/>
<components><component id="0" label="C">{component}</component></components>
<cameras next_id="3" next_group_id="1">
<camera id="0" sensor_id="0" component_id="0" label="a_1"><transform>{a}</transform></camera>
<group id="0"><camera id="1" sensor_id="0" component_id="0" label="b"><transform>{b}</transform>
</camera></group><camera id="2" sensor_id="0" label="none"><orientation>1</orientation></camera>
</cameras>{chunk}</chunk></document>"#
        )
    }

    #[test]
    fn transforms_lead_from_the_camera_to_the_chunk() {
        let file = read(&file([TRANSFORM; 2], "", "")).unwrap();
        assert_eq!(
            (file.format, file.entries.len()),
            (PoseFormat::Metashape, 2)
        );
        assert_eq!(file.entries[0].name.as_deref(), Some("a_1"));
        let pose = Convention::of(file.format).to_world(&file.entries[1].pose);
        assert_eq!(pose.t_wc, Vector3::new(1.0, 2.0, 3.0));
        // 4 m ahead, 0.5 m below, 2 m to the right.
        let seen = pose.to_camera(&Vector3::new(5.0, 0.0, 2.5));
        assert!(
            (seen - Vector3::new(2.0, 0.5, 4.0)).norm() < 1e-12,
            "{seen}"
        );
    }

    /// A quarter of a turn about z, twice the size, 10 m along x: (1, 2, 3) becomes (6, 2, 6).
    #[test]
    fn components_and_chunks_are_placed_in_the_world() {
        let placed = "<transform><rotation locked=\"false\">0 -1 0 1 0 0 0 0 1</rotation>\
            <translation>10 0 0</translation><scale>2</scale></transform>";
        let other = "<transform><scale>7</scale></transform>";
        for (component, chunk) in [(placed, ""), ("", placed), (placed, other)] {
            let file = read(&file([TRANSFORM; 2], component, chunk)).unwrap();
            let pose = file.entries[0].pose;
            assert!((pose.t_wc - Vector3::new(6.0, 2.0, 6.0)).norm() < 1e-12);
            // The camera looks along the chunk's x, which is the world's y.
            assert!((pose.r_wc * Vector3::z() - Vector3::y()).norm() < 1e-12);
        }
    }

    #[test]
    fn broken_files_name_the_camera() {
        let scaled = TRANSFORM.replace("-1 0 0 2", "-2 0 0 2");
        let two =
            file([TRANSFORM; 2], "", "").replacen("component_id=\"0\"", "component_id=\"1\"", 1);
        for (text, expected) in [
            (
                file([&scaled, TRANSFORM], "", ""),
                "camera \"a_1\": its first three",
            ),
            (
                file([TRANSFORM, "1 0"], "", ""),
                "camera \"b\": transform has 2 numbers",
            ),
            (
                file([TRANSFORM; 2], "", "").replace("a_1", "b"),
                "a second pose of b",
            ),
            (
                file(
                    [TRANSFORM; 2],
                    "",
                    "<transform><scale>0</scale></transform>",
                ),
                "is 0; it must",
            ),
            (two, "2 components that are not aligned"),
            ("<gpx/>".to_owned(), "not the cameras of Metashape"),
            (
                "<document><chunk/><chunk/></document>".to_owned(),
                "holds 2 chunks",
            ),
            ("<document><chunk/></document>".to_owned(), "holds no poses"),
            ("<document>".to_owned(), "is no valid XML"),
        ] {
            let message = read(&text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}

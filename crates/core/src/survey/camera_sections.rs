//! `[camera]`, or several `[[camera]]` of a rig.

use super::camera_section::CameraSection;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// The table `[camera]`, or the tables `[[camera]]` of a rig in their order; at least one.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraSections(Vec<CameraSection>);

impl CameraSections {
    /// The tables of a rig; None if there are none.
    pub fn of_rig(sections: Vec<CameraSection>) -> Option<Self> {
        (!sections.is_empty()).then_some(Self(sections))
    }

    /// True if there are several cameras.
    pub fn is_rig(&self) -> bool {
        self.0.len() > 1
    }

    /// The first camera.
    pub fn first(&self) -> &CameraSection {
        &self.0[0]
    }

    /// The first camera, to be changed.
    pub fn first_mut(&mut self) -> &mut CameraSection {
        &mut self.0[0]
    }

    /// All cameras.
    pub fn all(&self) -> &[CameraSection] {
        &self.0
    }

    /// All cameras, to be changed.
    pub fn all_mut(&mut self) -> &mut [CameraSection] {
        &mut self.0
    }
}

impl From<CameraSection> for CameraSections {
    fn from(section: CameraSection) -> Self {
        Self(vec![section])
    }
}

impl Serialize for CameraSections {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0.as_slice() {
            [camera] => camera.serialize(serializer),
            cameras => cameras.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for CameraSections {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OneOrSeveral)
    }
}

/// Reads a table, or an array of them.
struct OneOrSeveral;

impl<'de> Visitor<'de> for OneOrSeveral {
    type Value = CameraSections;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("the table [camera], or the tables [[camera]] of a rig")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        CameraSection::deserialize(MapAccessDeserializer::new(map)).map(Into::into)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut tables: A) -> Result<Self::Value, A::Error> {
        let mut sections = Vec::new();
        while let Some(section) = tables.next_element()? {
            sections.push(section);
        }
        CameraSections::of_rig(sections)
            .ok_or_else(|| A::Error::custom("camera is an empty array; it needs a camera"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct File {
        camera: CameraSections,
    }

    fn read(text: &str) -> Result<File, toml::de::Error> {
        toml::from_str(text)
    }

    #[test]
    fn one_table_is_a_camera_and_several_are_a_rig() {
        let one = read("[camera]\nfile = \"a.json\"\n").unwrap();
        assert!(!one.camera.is_rig());
        let text = "[[camera]]\nfile = \"a.json\"\nframes = \"left/*.png\"\n\
                    [[camera]]\nfile = \"b.json\"\nframes = \"right/*.png\"\n";
        let rig = read(text).unwrap();
        assert!(rig.camera.is_rig());
        assert_eq!(rig.camera.all()[1].frames.as_deref(), Some("right/*.png"));
        for file in [one, rig] {
            assert_eq!(read(&toml::to_string(&file).unwrap()).unwrap(), file);
        }
    }

    #[test]
    fn an_unknown_key_of_a_camera_is_named_where_it_stands() {
        for text in ["[camera]\nshutter = 1\n", "[[camera]]\nshutter = 1\n"] {
            let error = read(text).unwrap_err();
            assert!(
                error.message().contains("unknown field `shutter`"),
                "{error}"
            );
            let at = error.span().unwrap();
            assert_eq!(&text[at], "shutter", "{text}");
        }
        let error = read("camera = []\n").unwrap_err();
        assert!(error.message().contains("empty array"), "{error}");
        assert!(
            read("camera = 3\n")
                .unwrap_err()
                .message()
                .contains("[[camera]]")
        );
    }
}

//! The images of a topic in a recording.

use super::error::FrameError;
use super::picture_decoder::Content;
use super::recorded_pixels;
use image::DynamicImage;
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::recordings::{
    Message, MessageKind, RecordedPicture, Recording, TopicGroup, Wire,
};

/// The images of a topic in a recording, in the order of the times in their headers. Each is read
/// from its place in the file when it is decoded.
#[derive(Debug)]
pub struct RecordedImages {
    recording: Recording,
    topic: String,
    content: (MessageKind, Wire),
    messages: Vec<Message>,
}

/// An image as the recording holds it.
pub(super) enum RecordedImage {
    /// A picture file.
    File(Content),
    /// Pixels.
    Pixels(DynamicImage),
}

impl RecordedImages {
    /// Finds the images of a topic, or of the only one with images.
    ///
    /// # Errors
    /// A recording that cannot be read; no such topic, or several and no name.
    pub fn open(path: &Path, topic: Option<&str>) -> Result<Self, FrameError> {
        Self::of(Recording::open(path)?, topic)
    }

    /// Finds the images of a topic, or of the only one with images, in an open recording.
    ///
    /// # Errors
    /// No such topic, or several and no name.
    pub fn of(recording: Recording, topic: Option<&str>) -> Result<Self, FrameError> {
        let found = recording.topic(TopicGroup::Images, topic)?;
        let content = found.content.unwrap_or((MessageKind::Image, Wire::Cdr));
        let (topic, mut messages) = (found.name.clone(), found.messages.clone());
        messages.sort_by(|a, b| time_of(a).total_cmp(&time_of(b)));
        Ok(Self {
            recording,
            topic,
            content,
            messages,
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        self.recording.path()
    }

    /// The topic.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// Number of images.
    pub fn count(&self) -> usize {
        self.messages.len()
    }

    /// The time in an image's header, seconds.
    pub fn time_s(&self, image: usize) -> f64 {
        time_of(&self.messages[image])
    }

    /// The name of an image: that of the recording, and the image's number.
    pub(super) fn name(&self, image: usize) -> PathBuf {
        let mut name = self.path().as_os_str().to_owned();
        name.push(format!("#{image:06}"));
        name.into()
    }

    /// Reads an image.
    ///
    /// # Errors
    /// A file that has changed; an encoding that is not read; a message that ends too early, in
    /// words.
    pub(super) fn read(&self, image: usize) -> Result<RecordedImage, String> {
        let mut reader = self.recording.reader().map_err(|error| error.reason())?;
        let message = reader.read(&self.messages[image]);
        let message = message.map_err(|error| error.reason())?;
        match RecordedPicture::read(&message, self.content)? {
            RecordedPicture::Raw(raw) => recorded_pixels::decode(&raw).map(RecordedImage::Pixels),
            RecordedPicture::Compressed(file) if file.format.contains("compressedDepth") => Err(
                "its pixels are distances (compressedDepth), and no picture of the wall".to_owned(),
            ),
            RecordedPicture::Compressed(file) => {
                Ok(RecordedImage::File(Content::copied(file.data)))
            }
        }
    }
}

/// The time of a message; those of images have headers.
fn time_of(message: &Message) -> f64 {
    message.time_s.unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{FrameFile, PictureReading, colour_type, load_colour};
    use image::ColorType;
    use std::sync::Arc;

    fn images(name: &str, topic: &str) -> Arc<RecordedImages> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/recordings");
        Arc::new(RecordedImages::open(&folder.join(name), Some(topic)).unwrap())
    }

    #[test]
    fn frames_of_a_recording_are_its_images() {
        for name in ["zstd.mcap", "ros1.mcap", "lz4.bag"] {
            for (topic, count) in [("/camera/image_raw", 3), ("/rear/image/compressed", 2)] {
                let images = images(name, topic);
                assert_eq!((images.count(), images.topic()), (count, topic));
                for k in (0..count).rev() {
                    let frame = FrameFile::in_recording(k, &images, k);
                    assert_eq!(frame.name(), format!("{name}#00000{k}"));
                    frame.examine(24, 16).unwrap();
                    assert_eq!(colour_type(&frame).unwrap(), ColorType::L8);
                    let picture = load_colour(&frame, 24, 16).unwrap().into_luma8();
                    let value = (5 * 20 + 7 * 3 + 50 * k) as u8;
                    assert_eq!(picture.get_pixel(20, 3).0, [value], "{name} {topic} {k}");
                    assert!(load_colour(&frame, 16, 24).is_err());
                }
            }
        }
    }

    #[test]
    fn images_are_turned_as_pictures_in_files_are() {
        let images = images("plain.mcap", "/camera/image_raw");
        let frame = FrameFile::in_recording(0, &images, 0).with_reading(PictureReading {
            orientation: crate::frames::PictureOrientation::Turned180,
            ..PictureReading::default()
        });
        let turned = load_colour(&frame, 24, 16).unwrap().into_luma8();
        assert_eq!(turned.get_pixel(23, 15).0, [0]);
    }
}

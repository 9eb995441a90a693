//! Recordings that the writers of other people made (`fixtures/recordings/make.py`), whole, cut off
//! and damaged.

use super::error::RecordingError;
use super::picture::RecordedPicture;
use super::recorded_pose::PoseTopic;
use super::recording::Recording;
use super::topic::{Topic, TopicGroup};
use std::path::{Path, PathBuf};

const FILES: [&str; 8] = [
    "zstd.mcap",
    "lz4.mcap",
    "plain.mcap",
    "unchunked.mcap",
    "ros1.mcap",
    "plain.bag",
    "lz4.bag",
    "bz2.bag",
];
const START_S: f64 = 1_700_000_000.0;
const SIZE: [u32; 2] = [24, 16];

fn fixture(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/recordings");
    folder.join(name)
}

/// Reads a copy of a recording that was changed.
fn open_changed(name: &str, change: impl Fn(&mut Vec<u8>)) -> Result<Recording, String> {
    let mut bytes = std::fs::read(fixture(name)).unwrap();
    change(&mut bytes);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    Recording::open(&path).map_err(|error| error.to_string())
}

#[test]
fn images_are_those_that_were_recorded() {
    for name in FILES {
        let recording = Recording::open(&fixture(name)).unwrap();
        let topic = recording.topic(TopicGroup::Images, Some("/camera/image_raw"));
        let topic = topic.unwrap();
        assert_eq!(topic.messages.len(), 3, "{name}");
        let mut reader = recording.reader().unwrap();
        for (k, message) in topic.messages.iter().enumerate().rev() {
            let time_s = message.time_s.unwrap() - START_S;
            assert!((time_s - 0.1 * k as f64).abs() < 1e-6, "{name}: {time_s}");
            let bytes = reader.read(message).unwrap();
            let read = RecordedPicture::read(&bytes, topic.content.unwrap()).unwrap();
            let RecordedPicture::Raw(raw) = read else {
                panic!("{name}: {read:?}");
            };
            assert_eq!((raw.encoding, [raw.width, raw.height]), ("mono8", SIZE));
            let value = |at: usize| 5 * (at % 24) + 7 * (at / 24) + 50 * k;
            let expected: Vec<u8> = (0..24 * 16).map(|at| value(at) as u8).collect();
            assert_eq!(raw.data, expected, "{name}");
        }
        let rear = recording.topic(TopicGroup::Images, Some("/rear/image/compressed"));
        let rear = rear.unwrap();
        let bytes = reader.read(&rear.messages[1]).unwrap().into_owned();
        let read = RecordedPicture::read(&bytes, rear.content.unwrap()).unwrap();
        let RecordedPicture::Compressed(file) = read else {
            panic!("{name}: {read:?}");
        };
        assert!(file.format == "png" && file.data.starts_with(b"\x89PNG"));
    }
}

#[test]
fn a_recording_is_read_no_further_than_to_a_first_message() {
    for name in FILES {
        let size = std::fs::metadata(fixture(name)).unwrap().len() as usize;
        let bytes = &std::fs::read(fixture(name)).unwrap()[..size / 2];
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let open = |topic: &str| {
            let group = TopicGroup::Calibrations;
            let recording = Recording::open_to_first(&path, group, topic)?;
            Ok(recording.topic(group, Some(topic))?.messages.len())
        };
        assert!(matches!(open("/camera/camera_info"), Ok(1..3)), "{name}");
        let said: RecordingError = open("/camera").unwrap_err();
        assert!(said.to_string().contains("cut off"), "{name}: {said}");
    }
}

#[test]
fn topics_to_choose_from_are_listed_with_their_counts() {
    for name in FILES {
        let recording = Recording::open(&fixture(name)).unwrap();
        let said = |topic: Result<&Topic, _>| match topic {
            Err(error) => format!("{error}"),
            Ok(topic) => panic!("{topic:?}"),
        };
        for choice in [None, Some("/odom")] {
            let said = said(recording.topic(TopicGroup::Images, choice));
            for part in [
                "/camera/image_raw (",
                "3 messages",
                "/rear/image/compressed (",
                "2 m",
            ] {
                assert!(said.contains(part), "{name}: {said}");
            }
            assert!(!said.contains("/tf"), "{name}: {said}");
        }
        let said = recording.poses(&PoseTopic {
            topic: Some("/tf".to_owned()),
            ..PoseTopic::default()
        });
        let said = said.unwrap_err().to_string();
        assert!(
            said.contains("base to camera (7), map to base (7)"),
            "{said}"
        );
    }
}

#[test]
fn a_recording_that_is_cut_off_anywhere_is_refused() {
    for name in FILES {
        let size = std::fs::metadata(fixture(name)).unwrap().len() as usize;
        // The summary at the end of an MCAP file is not needed.
        for end in (0..size / 2).step_by(197) {
            let said = open_changed(name, |bytes| bytes.truncate(end)).unwrap_err();
            assert!(said.contains("cut off"), "{name} of {end} bytes: {said}");
        }
    }
}

#[test]
fn a_changed_byte_is_an_error_or_of_no_consequence() {
    for name in FILES {
        let size = std::fs::metadata(fixture(name)).unwrap().len() as usize;
        let mut refused = 0;
        for at in (0..size).step_by(131) {
            let changed = open_changed(name, |bytes| bytes[at] ^= 0x41);
            refused += usize::from(changed.is_err());
        }
        assert!(refused > 0, "{name}");
    }
    // An image in a chunk has a check sum.
    let said = open_changed("plain.mcap", |bytes| {
        let image = [5u8, 10, 15, 20];
        let found = bytes.windows(4).position(|window| window == image);
        bytes[found.unwrap()] ^= 1;
    });
    assert!(said.unwrap_err().contains("check sum"));
}

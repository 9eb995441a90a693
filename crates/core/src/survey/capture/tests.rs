//! Tests of surveys whose frames are being taken.

use super::*;
use crate::survey::SURVEY_FILE;
use tunnelstitch_geometry::trajectory::spiral;

/// A survey in a folder whose pictures are yet to come.
struct Folder {
    dir: tempfile::TempDir,
    start: Instant,
}

impl Folder {
    /// A folder with the poses of `poses` frames.
    fn new(poses: usize) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let toml = "[frames]\nimages = \"frames/*.png\"\n[camera]\nfile = \"camera.json\"\n\
                    [tunnel]\nshape = \"circle\"\nradius_m = 1.0\n\
                    [poses]\ninitial = \"poses.tum\"\n\
                    [prior]\nmodel = \"random-walk\"\nrotation_sigma_deg = 1.0\n\
                    translation_sigma_m = [0.01, 0.01, 0.01]\n";
        let camera = r#"{"model": "pinhole", "width": 32, "height": 24, "fx": 30.0, "fy": 30.0,
                         "cx": 15.5, "cy": 11.5}"#;
        std::fs::create_dir(dir.path().join("frames")).unwrap();
        std::fs::write(dir.path().join(SURVEY_FILE), toml).unwrap();
        std::fs::write(dir.path().join("camera.json"), camera).unwrap();
        let folder = Self {
            dir,
            start: Instant::now(),
        };
        folder.write_poses(poses);
        folder
    }

    fn write_poses(&self, count: usize) {
        let line = |(k, pose): (usize, tunnelstitch_geometry::trajectory::Pose)| {
            let (t, q) = (pose.t_wc, pose.r_wc.coords);
            format!(
                "{k} {} {} {} {} {} {} {}\n",
                t.x, t.y, t.z, q.x, q.y, q.z, q.w
            )
        };
        let text: String = (spiral(count, 0.1, 0.5).into_iter().enumerate())
            .map(line)
            .collect();
        std::fs::write(self.dir.path().join("poses.tum"), text).unwrap();
    }

    fn path(&self, number: usize) -> PathBuf {
        self.dir.path().join(format!("frames/{number}.png"))
    }

    fn write(&self, numbers: &[usize]) {
        for number in numbers {
            image::GrayImage::new(32, 24)
                .save(self.path(*number))
                .unwrap();
        }
    }

    fn open(&self) -> Option<Capture> {
        Capture::open(self.dir.path(), |_| ()).unwrap()
    }

    /// Takes further frames so many milliseconds after the start; returns the names of all.
    fn taken(&self, capture: &mut Capture, ms: u64) -> Vec<String> {
        let now = self.start + Duration::from_millis(ms);
        capture.take_further(now).unwrap();
        let survey = capture.survey();
        assert_eq!(survey.frames.len(), survey.initial.len());
        survey.frames.iter().map(FrameFile::name).collect()
    }
}

#[test]
fn frames_are_taken_as_far_as_they_have_poses() {
    let folder = Folder::new(2);
    assert!(folder.open().is_none());
    folder.write(&[0, 1, 2]);
    let mut capture = folder.open().unwrap();
    assert_eq!(folder.taken(&mut capture, 0), ["0.png", "1.png"]);
    assert_eq!((capture.pictures(), capture.waiting()), (3, 1));
    folder.write_poses(11);
    folder.write(&[3]);
    assert_eq!(folder.taken(&mut capture, 9).len(), 4);
    assert!(capture.missing().is_empty() && capture.set_aside().is_empty());
}

/// A picture that is being written holds up those after it, but not for long.
#[test]
fn an_incomplete_picture_is_waited_for() {
    let folder = Folder::new(9);
    folder.write(&[0, 1, 2]);
    let whole = std::fs::read(folder.path(1)).unwrap();
    std::fs::write(folder.path(1), &whole[..whole.len() - 9]).unwrap();
    let mut capture = folder.open().unwrap();
    assert_eq!(folder.taken(&mut capture, 0), ["0.png"]);
    std::fs::write(folder.path(1), &whole).unwrap();
    assert_eq!(folder.taken(&mut capture, 100).len(), 3);
    std::fs::write(folder.path(3), &whole[..20]).unwrap();
    folder.write(&[4]);
    assert_eq!(folder.taken(&mut capture, 200).len(), 3);
    assert_eq!(folder.taken(&mut capture, 1300).len(), 4);
    assert_eq!(capture.set_aside()[0].file, "3.png");
    // The pose of frame 4 is its own.
    let expected = spiral(9, 0.1, 0.5)[4];
    assert!(capture.survey().initial[3].pose.local(&expected).norm() < 1e-9);
}

#[test]
fn missing_and_late_frames_are_named() {
    let folder = Folder::new(9);
    folder.write(&[0, 1, 2, 4]);
    let mut capture = folder.open().unwrap();
    assert_eq!(folder.taken(&mut capture, 0).len(), 3);
    assert_eq!(folder.taken(&mut capture, 1000).last().unwrap(), "4.png");
    let missing = &capture.missing()[0];
    assert_eq!(
        (missing.count, &*missing.before, &*missing.after),
        (1, "2.png", "4.png")
    );
    folder.write(&[3, 5]);
    assert_eq!(folder.taken(&mut capture, 1100).last().unwrap(), "5.png");
    let late = &capture.set_aside()[0];
    assert_eq!(
        (&*late.file, &*late.reason),
        ("3.png", "it came after 4.png")
    );
    let expected = spiral(9, 0.1, 0.5)[5];
    assert!(capture.survey().initial[4].pose.local(&expected).norm() < 1e-9);
}

#[test]
fn half_a_file_of_poses_is_awaited() {
    let folder = Folder::new(9);
    folder.write(&[0, 1]);
    let poses = folder.dir.path().join("poses.tum");
    let mut capture = folder.open().unwrap();
    std::fs::write(&poses, "0 0 0 0 0 0 0 1\n1 0 0.1 0 0 0").unwrap();
    assert!(folder.taken(&mut capture, 0).is_empty());
    assert_eq!(capture.poses_error(), None);
    std::fs::write(&poses, "0 0 0 0 0 0 0 1\n1 0 0.1 0 0\n").unwrap();
    assert!(folder.taken(&mut capture, 100).is_empty());
    assert!(capture.poses_error().unwrap().contains("poses.tum"));
    folder.write_poses(2);
    assert_eq!(folder.taken(&mut capture, 200).len(), 2);
    assert_eq!(capture.poses_error(), None);
}

#[test]
fn what_is_no_folder_of_pictures_is_refused() {
    let folder = Folder::new(2);
    let error = Capture::open(folder.dir.path(), |file| {
        file.frames.images = None;
        file.frames.video = Some("a.mp4".into());
    });
    assert!(error.unwrap_err().to_string().contains("frames.images"));
}

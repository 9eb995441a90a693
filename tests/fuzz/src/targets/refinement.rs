//! refine.json and covariance.csv (after a zero byte) as read and drawn by the report.

use super::super::small_survey;
use std::sync::OnceLock;
use tunnelstitch::evaluate::{CompareInput, ComparedPanoramas, Comparison, compare};
use tunnelstitch::progress::Silent;
use tunnelstitch::render::RenderOptions;
use tunnelstitch::report::{RefinedFiles, Sources, gather, page};
use tunnelstitch::survey::Survey;

struct Compared {
    survey: Survey,
    comparison: Comparison,
    drawings: ComparedPanoramas,
}

fn compared() -> &'static Compared {
    static COMPARED: OnceLock<Compared> = OnceLock::new();
    COMPARED.get_or_init(|| {
        let survey = Survey::open(small_survey()).unwrap();
        let poses = survey.initial_poses();
        let input = CompareInput {
            surface: survey.surface.as_ref(),
            cameras: &survey.cameras,
            files: &survey.frames,
            initial: &poses,
            refined: &poses,
            shutter: &survey.shutter(),
            truth: None,
            px_per_metre: Some(2.0),
            render: RenderOptions::default(),
        };
        let (comparison, drawings) = compare(&input, &Silent).unwrap();
        Compared {
            survey,
            comparison,
            drawings,
        }
    })
}

/// Reads the input.
pub fn run(data: &[u8]) {
    let Compared {
        survey,
        comparison,
        drawings,
    } = compared();
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    let mut parts = data.splitn(2, |byte| *byte == 0);
    put("refine.json", parts.next().unwrap_or_default());
    if let Some(covariances) = parts.next() {
        put("covariance.csv", covariances);
    }
    std::fs::copy(
        small_survey().join("baseline.tum"),
        folder.path().join("poses.tum"),
    )
    .unwrap();
    let Ok(refined) = RefinedFiles::read(survey, folder.path()) else {
        return;
    };
    let sources = Sources {
        survey,
        refined,
        comparison,
        drawings,
        command: Vec::new(),
    };
    if let Ok((report, pictures)) = gather(sources) {
        let _ = page(&report, &pictures);
    }
}

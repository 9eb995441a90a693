//! The report of a survey with a black frame: its numbers, its page, and the page in a browser.

use crate::support::{
    self,
    chromium::{self, Look},
    fail, json, succeed, text,
};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tunnelstitch::report::{PICTURES, Pictures, Report, page};

/// A survey's results.
struct Work {
    _dir: tempfile::TempDir,
    refined: PathBuf,
    compared: PathBuf,
    report: PathBuf,
}

/// A name that a page must not take for its own markup.
const NAME: &str = "pipe <b>7</b> & \"co\"";

/// Simulated, refined, compared and reported once for all tests.
fn work() -> &'static Work {
    static WORK: OnceLock<Work> = OnceLock::new();
    WORK.get_or_init(|| {
        let dir = tempfile::tempdir().expect("a folder");
        let [survey, refined, compared, report] =
            [NAME, "refined", "compared", "report"].map(|name| dir.path().join(name));
        let (survey, refined_text) = (text(&survey), text(&refined));
        succeed(&[
            "simulate",
            "free",
            "--frames",
            "24",
            "--size",
            "320x240",
            "--supersample",
            "2",
            "--bad-frames",
            "7:black",
            "--seed",
            "3",
            "--out",
            survey,
        ]);
        succeed(&["refine", survey, "--out", refined_text]);
        let poses = refined.join("poses.tum");
        succeed(&[
            "compare",
            survey,
            "--refined",
            text(&poses),
            "--out",
            text(&compared),
        ]);
        let said = succeed(&[
            "report",
            survey,
            "--refined",
            refined_text,
            "--out",
            text(&report),
        ]);
        assert!(said.contains("report.html"), "{said}");
        Work {
            _dir: dir,
            refined,
            compared,
            report,
        }
    })
}

fn html() -> String {
    std::fs::read_to_string(work().report.join("report.html")).expect("a page")
}

#[test]
fn its_numbers_are_those_of_refine_and_compare() {
    let work = work();
    let report = json(&work.report.join("report.json"));
    let (refine, compare) = (
        json(&work.refined.join("refine.json")),
        json(&work.compared.join("compare.json")),
    );
    assert_eq!(report["schema_version"], 1);
    for part in ["frames", "canvas", "baseline", "refined", "truth"] {
        assert_eq!(report["comparison"][part], compare[part], "{part}");
    }
    for part in [
        "levels",
        "frames",
        "options",
        "timings",
        "survey_file",
        "command",
    ] {
        assert_eq!(report["refinement"][part], refine[part], "{part}");
    }
    assert_eq!(report["commands"][0], refine["command"]);
    assert_eq!(report["verdict"]["flagged"], refine["frames_on_prior"]);
    // Every step of every solve, and the costs before and after it.
    for level in refine["levels"].as_array().unwrap() {
        let steps = level["steps"].as_array().unwrap();
        assert_eq!(level["iterations"], steps.len());
        let start = level["cost_start"].as_f64().unwrap();
        let mut last = start;
        for step in steps {
            let Some(cost) = step["cost"].as_f64() else {
                continue;
            };
            // The cost falls; only a step within a pixel may leave it as rough as it is on sharp
            // walls.
            let settles = step["step_px"].as_f64().unwrap() < 1.0 && cost < 1.01 * last;
            assert!(cost < last || settles, "{last} → {cost} by {step}");
            last = cost;
        }
        assert!(last <= start, "{start} → {last}");
        assert_eq!(Some(last), level["cost_end"].as_f64());
    }
}

#[test]
fn its_frames_are_those_of_the_poses_and_covariances() {
    let work = work();
    let report = json(&work.report.join("report.json"));
    let poses = std::fs::read_to_string(work.refined.join("poses.tum")).unwrap();
    let covariances = std::fs::read_to_string(work.refined.join("covariance.csv")).unwrap();
    let own: Vec<Vec<f64>> = covariances
        .lines()
        .skip(1)
        .map(|line| {
            line.split(',')
                .map(|f| f.parse().unwrap_or(f64::NAN))
                .collect::<Vec<f64>>()
        })
        .filter(|fields| fields[0] == fields[1])
        .collect();
    let frames = report["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 24);
    for ((frame, line), covariance) in frames.iter().zip(poses.lines()).zip(&own) {
        let fields: Vec<f64> = line.split(' ').map(|f| f.parse().unwrap()).collect();
        for axis in 0..3 {
            assert_eq!(frame["refined_m"][axis].as_f64(), Some(fields[1 + axis]));
            let sigma = frame["sigma_translation_m"][axis].as_f64().unwrap();
            assert!((sigma - covariance[3 + 7 * (3 + axis)].sqrt()).abs() < 1e-12);
            let sigma = frame["sigma_rotation_deg"][axis].as_f64().unwrap();
            assert!((sigma - covariance[3 + 7 * axis].sqrt().to_degrees()).abs() < 1e-12);
        }
        let planned: Vec<f64> = (0..3)
            .map(|k| frame["planned_m"][k].as_f64().unwrap())
            .collect();
        let moved: f64 = (0..3).map(|k| (fields[1 + k] - planned[k]).powi(2)).sum();
        let distance = frame["correction_distance_m"].as_f64().unwrap();
        assert!((distance - moved.sqrt()).abs() < 1e-12);
    }
}

/// The page can be made from report.json and the pictures beside it alone.
#[test]
fn the_page_shows_the_numbers() {
    let work = work();
    let numbers = std::fs::read_to_string(work.report.join("report.json")).unwrap();
    let report: Report = serde_json::from_str(&numbers).unwrap();
    let entries = std::fs::read_dir(work.report.join(PICTURES)).unwrap();
    let pictures: Pictures = entries
        .map(|entry| {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            (name, std::fs::read(path).unwrap())
        })
        .collect();
    assert!(pictures.contains_key("frame-000007.jpg"));
    let html = html();
    assert!(page(&report, &pictures).unwrap() == html);
    assert_eq!(
        serde_json::to_string_pretty(&report).unwrap() + "\n",
        numbers
    );
    let reason = report
        .refinement
        .as_ref()
        .and_then(|r| r.frames[7].reason.clone());
    let reason = reason.expect("a black frame is flagged");
    for words in [
        "23 of 24 frames refined, 1 flagged",
        "Frame 7",
        "000007.png",
        &reason[1..],
    ] {
        assert!(html.contains(words), "no {words:?}");
    }
}

#[test]
fn the_page_is_well_formed_and_needs_nothing_else() {
    let html = html();
    assert!(html.contains("pipe &lt;b&gt;7&lt;/b&gt; &amp;"));
    assert!(!html.contains("<b>"));
    let tags = tags(&html);
    let ids: BTreeSet<&str> = tags.iter().filter_map(|tag| attribute(tag, "id")).collect();
    for tag in &tags {
        for name in ["src", "href"] {
            let Some(target) = attribute(tag, name) else {
                continue;
            };
            let inside = target.strip_prefix('#').is_some_and(|id| ids.contains(id));
            assert!(inside || target.starts_with("data:"), "{tag:.200}");
        }
        if tag.starts_with("img") {
            assert!(
                attribute(tag, "alt").is_some_and(|alt| !alt.is_empty()),
                "{tag:.200}"
            );
        }
    }
    for outside in [
        "http:",
        "https:",
        "url(",
        "@import",
        "fetch(",
        "XMLHttpRequest",
    ] {
        assert!(!html.contains(outside), "{outside}");
    }
}

/// The tags of a page without their brackets; each that needs an end must have it, in the right
/// order.
fn tags(html: &str) -> Vec<&str> {
    const VOID: [&str; 6] = ["!DOCTYPE", "meta", "link", "img", "input", "br"];
    let (mut open, mut found) = (Vec::new(), Vec::new());
    let mut rest = html;
    while let Some(start) = rest.find('<') {
        let end = start + rest[start..].find('>').expect("an end of the tag");
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        let name = tag.split([' ', '\n']).next().unwrap_or_default();
        if let Some(name) = name.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "before {rest:.200}");
            continue;
        }
        found.push(tag);
        if VOID.contains(&name) {
            continue;
        }
        open.push(name);
        // What is between these is no markup.
        if ["style", "script"].contains(&name) {
            rest = &rest[rest.find(&format!("</{name}>")).expect("an end")..];
        }
    }
    assert!(open.is_empty(), "{open:?}");
    found
}

fn attribute<'t>(tag: &'t str, name: &str) -> Option<&'t str> {
    let (_, rest) = tag.split_once(&format!(" {name}=\""))?;
    rest.split('"').next()
}

#[test]
fn it_looks_right_wide_and_narrow_light_and_dark() {
    let Some(browser) = chromium::find() else {
        return;
    };
    let out = tempfile::tempdir().unwrap();
    let (with, without) = (
        out.path().join("with.html"),
        out.path().join("without.html"),
    );
    let html = html();
    std::fs::write(&with, &html).unwrap();
    let (before, rest) = html.split_once("<script>").expect("a script");
    let (_, after) = rest.split_once("</script>").expect("its end");
    std::fs::write(&without, format!("{before}{after}")).unwrap();
    for size in [[1280, 900], [390, 844]] {
        for (dark, page) in [(false, &with), (true, &with), (false, &without)] {
            let look = Look { size, dark };
            let picture = chromium::screenshot(&browser, page, look, &out.path().join("look.png"));
            assert_eq!([picture.width(), picture.height()], size);
            let brightness =
                |pixel: &image::Rgb<u8>| pixel.0.iter().map(|c| u32::from(*c)).sum::<u32>() / 3;
            let paper = brightness(picture.get_pixel(2, 2));
            let mean = picture.pixels().map(brightness).sum::<u32>() / (size[0] * size[1]);
            if dark {
                assert!(paper < 40 && mean < 110, "{look:?}: {paper}, {mean}")
            } else {
                assert!(paper > 240 && mean > 150, "{look:?}: {paper}, {mean}")
            }
            // Text stands out from the paper, and there are colours.
            let contrast = picture
                .pixels()
                .map(|p| brightness(p).abs_diff(paper))
                .max();
            assert!(contrast > Some(150), "{look:?}: {contrast:?}");
            let colours: BTreeSet<[u8; 3]> = picture.pixels().map(|pixel| pixel.0).collect();
            assert!(colours.len() > 100, "{look:?}: {} colours", colours.len());
        }
    }
}

/// A script that reports the visible state of the page, and its reaction to the pointer, to the
/// surrounding page.
const PROBE: &str = r##"<script>
const slider = document.querySelector(".wiper input");
const after = () => {
  const style = getComputedStyle(document.querySelector(".wipe .after"));
  return parseFloat(style.clipPath.split(" ").pop());
};
const before = after();
slider.value = 90;
slider.dispatchEvent(new Event("input"));
const chart = document.querySelector("#trajectory .chart > svg");
const box = chart.getBoundingClientRect();
chart.dispatchEvent(new PointerEvent("pointermove", {
  clientX: box.left + 0.5 * box.width,
  clientY: box.top + 9,
}));
const root = document.documentElement;
parent.postMessage(JSON.stringify({
  width: innerWidth,
  overflow: root.scrollWidth - root.clientWidth,
  moved: after() - before,
  pictures: document.images.length,
  broken: [...document.images].filter((image) => !image.naturalWidth).length,
  charts: document.querySelectorAll(".chart > svg").length,
  flat: [...document.querySelectorAll(".chart > svg, .strip img, .pano img")]
    .filter((e) => e.getBoundingClientRect().height < 40).length,
  reading: chart.parentElement.querySelector("output").textContent,
  tiny: [...document.querySelectorAll("p, td, th, .tick")]
    .filter((e) => parseFloat(getComputedStyle(e).fontSize) < 10).length,
  errors: window.errors,
}), "*");
</script></body>"##;

#[test]
fn nothing_sticks_out_and_everything_works() {
    let Some(browser) = chromium::find() else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let probed = dir.path().join("probed.html");
    let html = html()
        .replacen(
            "<head>",
            "<head><script>window.errors = 0; addEventListener('error', () => errors++);</script>",
            1,
        )
        .replacen("</body>", PROBE, 1);
    std::fs::write(&probed, html).unwrap();
    for [width, height] in [[1280, 900], [390, 844]] {
        // A frame can be as narrow as a phone, a window cannot.
        let around = dir.path().join("around.html");
        let frame = format!(
            "<script>onmessage = (news) => {{ document.title = 'PROBE ' + news.data; }};</script>\
             <iframe src='probed.html' style='border:0' width='{width}' height='{height}'></iframe>"
        );
        std::fs::write(&around, frame).unwrap();
        let look = Look {
            size: [1400, 1000],
            dark: false,
        };
        let dump = chromium::dump(&browser, &around, look);
        let (_, rest) = dump.split_once("<title>PROBE ").expect("the probe has run");
        let found: Value = serde_json::from_str(rest.split("</title>").next().unwrap()).unwrap();
        assert_eq!(found["width"], width, "{found}");
        assert_eq!(found["overflow"], 0, "{found}");
        for none in ["broken", "flat", "tiny", "errors"] {
            assert_eq!(found[none], 0, "{none}: {found}");
        }
        assert!(found["moved"].as_f64() > Some(80.0), "{found}");
        assert!(
            found["pictures"].as_u64() >= Some(8) && found["charts"].as_u64() >= Some(18),
            "{found}"
        );
        let reading = found["reading"].as_str().unwrap();
        assert!(
            ["initial", "refined", "true"]
                .iter()
                .all(|name| reading.contains(name)),
            "{found}"
        );
    }
}

#[test]
fn poses_from_elsewhere_and_no_truth_make_a_report_that_says_so() {
    let survey = support::first_frames(12);
    support::edit(
        &survey.path().join("survey.toml"),
        "truth = \"groundtruth.tum\"",
        "",
    );
    let [poses, out] = ["groundtruth.tum", "out"].map(|name| survey.path().join(name));
    let arguments = [
        "report",
        text(survey.path()),
        "--refined",
        text(&poses),
        "--out",
        text(&out),
        "--px-per-metre",
        "30",
        "--json",
    ];
    let report: Value = serde_json::from_str(&succeed(&arguments)).unwrap();
    assert!(report["refinement"].is_null() && report["verdict"]["flagged"].is_null());
    assert!(report["comparison"]["refined"]["wall"].is_null());
    let html = std::fs::read_to_string(out.join("report.html")).unwrap();
    tags(&html);
    for words in [
        "Refined poses of 12 frames",
        "True poses are not known",
        "No refine.json",
    ] {
        assert!(html.contains(words), "no {words:?}");
    }
    for section in ["id=\"errors\"", "id=\"convergence\"", "id=\"flagged\""] {
        assert!(!html.contains(section), "{section}");
    }
}

#[test]
fn what_is_not_refined_or_of_another_survey_is_refused_with_the_remedy() {
    let survey = support::first_frames(3);
    let out = survey.path().join("out");
    let report = |refined: &Path| {
        let arguments = [
            "report",
            text(survey.path()),
            "--refined",
            text(refined),
            "--out",
            text(&out),
        ];
        fail(&arguments, 3)
    };
    let message = report(survey.path());
    assert!(
        message.contains("no poses.tum") && message.contains("--refined"),
        "{message}"
    );
    let refined = survey.path().join("refined");
    std::fs::create_dir(&refined).unwrap();
    std::fs::copy(
        survey.path().join("groundtruth.tum"),
        refined.join("poses.tum"),
    )
    .unwrap();
    std::fs::copy(
        work().refined.join("refine.json"),
        refined.join("refine.json"),
    )
    .unwrap();
    let message = report(&refined);
    assert!(
        message.contains("24 frames") && message.contains("3"),
        "{message}"
    );
    std::fs::write(refined.join("refine.json"), "{\"program\": 7}").unwrap();
    let message = report(&refined);
    assert!(
        message.contains("refine.json:1:") && message.contains("refine the survey again"),
        "{message}"
    );
    assert!(!out.exists());
}

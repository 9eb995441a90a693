//! Surveys that are refined in shards.

use crate::support::outputs::outputs;
use crate::support::{self, edit, fail, json, succeed, text};
use std::path::{Path, PathBuf};

/// A small survey, refined as one into `plain`.
fn refined(dir: &Path) -> PathBuf {
    let survey = dir.join("s");
    support::simulate(
        &survey,
        &["--frames", "14", "--size", "128x96", "--seed", "3"],
    );
    succeed(&["refine", text(&survey), "--out", text(&dir.join("plain"))]);
    survey
}

/// Refines a shard into the folder `shards`.
fn refine_shard(survey: &Path, shard: &str, dir: &Path) {
    let out = dir.join("shards");
    succeed(&[
        "refine",
        text(survey),
        "--shard",
        shard,
        "--out",
        text(&out),
    ]);
}

/// Poses of a file: position, metres, and quaternion x y z w.
fn poses(path: &Path) -> Vec<[f64; 7]> {
    let content = std::fs::read_to_string(path).unwrap();
    let lines = content.lines().filter(|line| !line.starts_with('#'));
    let pose = |line: &str| {
        let numbers = line.split_whitespace().skip(1);
        let numbers: Vec<f64> = numbers.map(|number| number.parse().unwrap()).collect();
        numbers.try_into().unwrap()
    };
    lines.map(pose).collect()
}

/// Checks that poses differ by less than a twentieth of their uncertainty.
fn assert_near(left: &Path, right: &Path) {
    let report = json(&left.join("refine.json"));
    let [left, right] = [left, right].map(|folder| poses(&folder.join("poses.tum")));
    assert_eq!(left.len(), right.len());
    let mut largest = 0.0f64;
    for (k, (a, b)) in left.iter().zip(&right).enumerate() {
        let sigma = &report["frames"][k]["sigma"];
        let apart = |range: std::ops::Range<usize>| -> f64 {
            let squares = range.map(|i| (a[i] - b[i]).powi(2));
            squares.sum::<f64>().sqrt()
        };
        let translation = apart(0..3) / sigma["translation_m"].as_f64().unwrap();
        let rotation = 2.0 * apart(3..7).to_degrees() / sigma["rotation_deg"].as_f64().unwrap();
        largest = largest.max(translation).max(rotation);
    }
    assert!(largest < 0.05, "{largest} σ");
}

#[test]
fn one_shard_is_the_survey() {
    let dir = tempfile::tempdir().unwrap();
    let survey = refined(dir.path());
    refine_shard(&survey, "1/1", dir.path());
    let [shards, joined, plain] = ["shards", "joined", "plain"].map(|name| dir.path().join(name));
    let join = ["--join", text(&shards), "--out", text(&joined)];
    succeed(&[&["refine", text(&survey)], &join[..]].concat());
    assert_eq!(outputs(&joined), outputs(&plain));
}

#[test]
fn a_job_of_shards_has_the_same_bytes_in_any_order_and_the_poses_of_a_single_run() {
    let dir = tempfile::tempdir().unwrap();
    let survey = refined(dir.path());
    let [forth, back] = ["forth", "back"].map(|name| dir.path().join(name));
    let steps = ["--shards", "2", "--steps", "refine,stitch,export"];
    for job in [&forth, &back] {
        succeed(&[&["plan-job", text(&survey), "--out", text(job)], &steps[..]].concat());
    }
    succeed(&["run-job", text(&forth)]);
    let early = fail(&["run-task", text(&back), "s.refine"], 75);
    assert!(early.contains("comes after s.refine-1"), "{early}");
    for task in [
        "s.refine-2",
        "s.refine-1",
        "s.refine",
        "s.stitch-seams",
        "s.stitch-2",
        "s.stitch-1",
        "s.stitch",
        "s.export-seams",
        "s.export-2",
        "s.export-1",
        "s.export",
    ] {
        succeed(&["run-task", text(&back), task]);
    }
    // survey.toml names the frames as the folder of the job sees them.
    let results = |job: &Path| {
        let mut files = outputs(&job.join("s/refined"));
        files.remove(Path::new("survey.toml"));
        files
    };
    assert_eq!(results(&forth), results(&back));
    let panorama = |job: &Path| std::fs::read(job.join("s/panorama.tif")).unwrap();
    assert!(panorama(&forth) == panorama(&back));
    // It is the panorama that is drawn as a whole.
    let (poses, whole) = (forth.join("s/refined/poses.tum"), dir.path().join("w.tif"));
    let files = ["--poses", text(&poses), "--out", text(&whole)];
    succeed(&[&["stitch", text(&survey)], &files[..]].concat());
    assert!(panorama(&forth) == std::fs::read(&whole).unwrap());
    let tiles = |folder: &Path| {
        let mut files = outputs(folder);
        // It names the files of the job.
        files.remove(Path::new("run.toml"));
        files
    };
    let whole = dir.path().join("tiles");
    let files = ["--poses", text(&poses), "--3dtiles", text(&whole)];
    succeed(&[&["export", text(&survey)], &files[..]].concat());
    for job in [&forth, &back] {
        assert!(tiles(&job.join("s/tiles")) == tiles(&whole));
    }
    assert_near(&dir.path().join("plain"), &forth.join("s/refined"));
}

#[test]
fn shards_that_do_not_belong_together_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("s");
    support::simulate(&survey, &["--frames", "4", "--size", "96x72"]);
    let [shards, joined] = ["shards", "joined"].map(|name| dir.path().join(name));
    let join = [
        "refine",
        text(&survey),
        "--join",
        text(&shards),
        "--out",
        text(&joined),
    ];
    assert!(fail(&join, 3).contains("shards"));
    refine_shard(&survey, "1/2", dir.path());
    let message = fail(&join, 3);
    assert!(message.contains("shard-2-of-2.state"), "{message}");
    refine_shard(&survey, "1/1", dir.path());
    let message = fail(&join, 3);
    assert!(message.contains("of one division"), "{message}");
    std::fs::remove_file(shards.join("shard-1-of-2.state")).unwrap();
    edit(&survey.join("survey.toml"), "2.0", "2.1");
    let message = fail(&join, 3);
    assert!(message.contains("part of another result"), "{message}");
    let none = [
        "refine",
        text(&survey),
        "--shard",
        "1/9",
        "--out",
        text(&shards),
    ];
    let message = fail(&none, 3);
    assert!(message.contains("there is no shard 1 of 9"), "{message}");
}

/// Runs `stitch` on a survey, with `words` and the output `out`.
fn stitch(survey: &Path, words: &[&str], out: &Path) {
    let out = ["--px-per-metre", "160", "--out", text(out)];
    succeed(&[&["stitch", text(survey)], words, &out[..]].concat());
}

/// Maps, lossy tiles, and more shards than bands.
#[test]
fn a_panorama_in_shards_has_the_files_of_a_whole_one() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("s");
    support::simulate(&survey, &["--frames", "20", "--size", "96x72"]);
    for (name, more, shards) in [
        ("maps", &["--maps"][..], 3),
        ("jpeg", &["--compression", "jpeg", "--quality", "80"], 9),
    ] {
        let folder = dir.path().join(name);
        let [parts, whole, joined] = ["parts", "whole", "joined"].map(|name| folder.join(name));
        let with_maps = |of: &Path| -> Vec<String> {
            let mut words: Vec<String> = more.iter().map(|word| (*word).to_owned()).collect();
            if name == "maps" {
                words.push(text(&of.join("maps")).to_owned());
            }
            words
        };
        let run = |of: &Path, words: &[&str], out: &Path| {
            let maps = with_maps(of);
            let maps: Vec<&str> = maps.iter().map(String::as_str).collect();
            stitch(&survey, &[&maps[..], words].concat(), out);
        };
        run(&whole, &[], &whole.join("wall.tif"));
        run(&joined, &["--seams"], &parts);
        for number in (1..=shards).rev() {
            run(&joined, &["--shard", &format!("{number}/{shards}")], &parts);
        }
        run(&joined, &["--join", text(&parts)], &joined.join("wall.tif"));
        let results = |folder: &Path| {
            let mut files = outputs(folder);
            // It has the command line.
            files.remove(Path::new("wall.tif.run.toml"));
            files
        };
        assert!(results(&whole).len() >= if name == "maps" { 6 } else { 1 });
        assert!(results(&whole) == results(&joined), "{name}");
    }
}

#[test]
fn parts_of_another_panorama_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("s");
    support::simulate(&survey, &["--frames", "4", "--size", "96x72"]);
    let [parts, out] = ["parts", "out.tif"].map(|name| dir.path().join(name));
    let call = |words: &[&'static str], out: &Path, code: i32| {
        let out = ["--out", text(out)];
        fail(
            &[&["stitch", text(&survey)], words, &out[..]].concat(),
            code,
        )
    };
    let parts_text: &'static str = Box::leak(text(&parts).to_owned().into_boxed_str());
    let message = call(&["--shard", "1/2"], &parts, 3);
    assert!(message.contains("seams.state"), "{message}");
    let words = ["stitch", text(&survey), "--out", text(&parts)];
    succeed(&[&words[..], &["--seams"]].concat());
    let message = call(&["--shard", "1/2", "--px-per-metre", "50"], &parts, 3);
    assert!(message.contains("its options differ"), "{message}");
    for shard in ["1/2", "2/2"] {
        succeed(&[&words[..], &["--shard", shard]].concat());
    }
    let join = ["--join", parts_text];
    let message = call(&join, &dir.path().join("out.png"), 2);
    assert!(message.contains(".tif"), "{message}");
    let tiles = parts.join("shard-2-of-2/panorama");
    let mut bytes = std::fs::read(&tiles).unwrap();
    bytes[9] ^= 1;
    std::fs::write(&tiles, bytes).unwrap();
    let message = call(&join, &out, 3);
    assert!(message.contains("hash does not match"), "{message}");
    std::fs::remove_dir_all(parts.join("shard-2-of-2")).unwrap();
    let message = call(&join, &out, 3);
    assert!(message.contains("shard-2-of-2"), "{message}");
    assert!(!out.exists());
}

/// More shards than bands, textures of grey pictures.
#[test]
fn tiles_in_shards_are_those_of_a_whole_export() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("s");
    support::simulate(&survey, &["--frames", "20", "--size", "96x72"]);
    let [parts, whole, joined] = ["parts", "whole", "joined"].map(|name| dir.path().join(name));
    let words = |out: &Path| -> Vec<String> {
        let words = [
            "export",
            text(&survey),
            "--px-per-metre",
            "160",
            "--3dtiles",
            text(out),
        ];
        words.map(str::to_owned).to_vec()
    };
    let export = |out: &Path, more: &[&str]| {
        let words = words(out);
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        succeed(&[&words[..], more].concat());
    };
    export(&whole, &[]);
    export(&parts, &["--seams"]);
    for number in (1..=9).rev() {
        export(&parts, &["--shard", &format!("{number}/9")]);
    }
    export(&joined, &["--join", text(&parts)]);
    assert!(outputs(&whole).len() > 9);
    assert!(outputs(&whole) == outputs(&joined));
    // Bands that are damaged, missing, or of other textures.
    let again = words(&dir.path().join("again"));
    let again: Vec<&str> = again.iter().map(String::as_str).collect();
    let join = ["--join", text(&parts)];
    let message = fail(&[&again[..], &join, &["--quality", "50"]].concat(), 3);
    assert!(message.contains("its options differ"), "{message}");
    let folder = parts.join("shard-9-of-9");
    let band = std::fs::read_dir(&folder)
        .unwrap()
        .next()
        .unwrap()
        .unwrap()
        .path();
    let mut bytes = std::fs::read(&band).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&band, bytes).unwrap();
    let message = fail(&[&again[..], &join].concat(), 3);
    assert!(message.contains("hash does not match"), "{message}");
    std::fs::remove_file(&band).unwrap();
    let message = fail(&[&again[..], &join].concat(), 3);
    assert!(message.contains("band-"), "{message}");
}

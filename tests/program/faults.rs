//! Faults of the system at every call that opens or writes, and kills there, by `strace`: what was
//! there before stays or is replaced as a whole, and the same command ends with the same bytes.
//! Marks that `view` has acknowledged are kept.
#![cfg(target_os = "linux")]

use crate::support::outputs::{Outputs, files, outputs};
use crate::support::server::{JSON, Running, export_site, mark};
use crate::support::{first_frames, missing, npm, succeed, text};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Calls of the system that open or write files, and how each fails.
const CALLS: [(&str, &str); 9] = [
    ("openat", "EMFILE"),
    ("write", "ENOSPC"),
    ("fsync", "EIO"),
    ("rename", "EIO"),
    ("renameat2", "EIO"),
    ("mkdir", "ENOSPC"),
    ("ftruncate", "EIO"),
    ("unlink", "EACCES"),
    ("flock", "EINTR"),
];

/// The program under `strace` with an option.
fn strace(trace: &Path, call: &str, option: &str) -> Command {
    let mut strace = Command::new("strace");
    strace
        // The program is the child itself, so that it can be killed.
        .args(["-D", "-f", "--seccomp-bpf", "-o", text(trace)])
        .args(["-e", &format!("trace={call}"), "-e", option])
        .arg(env!("CARGO_BIN_EXE_tunnelstitch"));
    strace
}

/// A command over the results of an earlier one.
struct Job<'a> {
    arguments: Vec<&'a str>,
    /// Folder with everything that it writes.
    folder: PathBuf,
    /// Files of the earlier command.
    files: Outputs,
    /// Results of the earlier command, and those of this one without a fault.
    old: Outputs,
    new: Outputs,
    /// Folder of traces.
    traces: &'a Path,
}

impl<'a> Job<'a> {
    /// Runs both commands once.
    fn new(earlier: &[&str], arguments: Vec<&'a str>, folder: PathBuf, traces: &'a Path) -> Self {
        std::fs::create_dir_all(&folder).unwrap();
        succeed(earlier);
        let (files, old) = (files(&folder), outputs(&folder));
        succeed(&arguments);
        let new = outputs(&folder);
        assert!(old != new);
        Self {
            arguments,
            folder,
            files,
            old,
            new,
            traces,
        }
    }

    /// Runs the command over the old results under `strace` with an option; its output and trace.
    fn traced(&self, call: &str, option: &str) -> (Output, String) {
        std::fs::remove_dir_all(&self.folder).unwrap();
        for (name, content) in &self.files {
            let path = self.folder.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, content).unwrap();
        }
        let trace = self.traces.join("trace");
        let output = strace(&trace, call, option)
            .args(&self.arguments)
            .output()
            .unwrap();
        (output, std::fs::read_to_string(trace).unwrap())
    }

    /// Numbers of a call in a run without a fault, at most `most` of them; `strace` counts those of
    /// each thread.
    fn moments(&self, call: &str, most: usize) -> Vec<usize> {
        let (_, trace) = self.traced(call, "signal=none");
        let calls = trace
            .lines()
            .filter(|line| line.contains(&format!(" {call}(")))
            .count();
        let step = calls.div_ceil(most).max(1);
        (1..=calls).step_by(step).collect()
    }

    /// Files that a user sees: neither temporary files nor checkpoints.
    fn seen(&self) -> Outputs {
        let mut seen = outputs(&self.folder);
        seen.retain(|path, _| {
            !text(path).contains("tunnelstitch-") && !text(path).contains(".unfinished")
        });
        seen
    }

    /// The `nth` call fails.
    fn fail(&self, call: &str, error: &str, nth: usize) {
        let option = format!("inject={call}:error={error}:when={nth}");
        let (output, trace) = self.traced(call, &option);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let code = output.status.code();
        // Before the program begins, the system's loader fails.
        let is_loader = code == Some(127) && said.contains("shared libraries");
        assert!(
            is_loader || matches!(code, Some(0 | 3 | 75)),
            "{option}: {code:?}, {said}"
        );
        let seen = self.seen();
        // The result may be whole, and its checkpoint not be removed.
        let is_old = code != Some(0) && seen == self.old;
        let names = seen.keys();
        assert!(
            is_old || seen == self.new,
            "{option}: {said} {names:?} {trace}"
        );
        self.assert_ends(&option);
    }

    /// The program is killed at the `nth` call.
    fn kill(&self, call: &str, nth: usize) {
        let option = format!("inject={call}:signal=KILL:when={nth}");
        self.traced(call, &option);
        for (path, content) in self.seen() {
            let whole = [&self.old, &self.new].map(|outputs| outputs.get(&path));
            let is_whole = whole.contains(&Some(&content));
            assert!(is_whole, "{option}: {}", path.display());
        }
        self.assert_ends(&option);
    }

    /// Checks that the same command ends with the same files and nothing else.
    fn assert_ends(&self, option: &str) {
        succeed(&self.arguments);
        let found = outputs(&self.folder);
        let names = |outputs: &Outputs| outputs.keys().cloned().collect::<Vec<_>>();
        assert_eq!(names(&found), names(&self.new), "{option}");
        assert!(found == self.new, "{option}");
    }

    /// Faults and kills at no more than `most` moments of each call; their number.
    fn endure(&self, most: usize) -> [usize; 2] {
        let mut done = [0; 2];
        for (call, error) in CALLS {
            let moments = self.moments(call, most);
            for &nth in &moments {
                self.fail(call, error, nth);
                self.kill(call, nth);
            }
            done = done.map(|count| count + moments.len());
        }
        done
    }
}

/// True if programs can be traced here.
fn can_trace() -> bool {
    if missing::find_program(&["strace"]).is_none() {
        return false;
    }
    let traced = Command::new("strace")
        .args(["-f", "--seccomp-bpf", "-o", "/dev/null", "true"])
        .output();
    traced.is_ok_and(|output| output.status.success())
}

/// Faults in `stitch` with all kinds of files, over an earlier panorama.
fn stitch(most: usize) -> [usize; 2] {
    let survey = first_frames(3);
    let folder = survey.path().join("out");
    let path = |name: &str| folder.join(name);
    let (out, dzi, maps) = (path("w.tif"), path("w.dzi"), path("maps"));
    let stitch = |poses, scale| {
        let files = [
            "--out",
            text(&out),
            "--dzi",
            text(&dzi),
            "--maps",
            text(&maps),
        ];
        let drawn = ["stitch", text(survey.path()), "--poses", poses];
        [&drawn[..], &["--px-per-metre", scale, "--quiet"], &files].concat()
    };
    let traces = tempfile::tempdir().unwrap();
    let job = Job::new(
        &stitch("initial", "10"),
        stitch("truth", "10"),
        folder.clone(),
        traces.path(),
    );
    job.endure(most)
}

/// Faults in `refine`, over the results of one with other options.
fn refine(most: usize) -> [usize; 2] {
    let survey = first_frames(2);
    let folder = survey.path().join("out");
    let refine = [
        "refine",
        text(survey.path()),
        "--out",
        text(&folder),
        "--quiet",
    ];
    let traces = tempfile::tempdir().unwrap();
    let job = Job::new(
        &[&refine[..], &["--max-iterations", "2"]].concat(),
        refine.to_vec(),
        folder.clone(),
        traces.path(),
    );
    job.endure(most)
}

/// Faults in `export` of a mesh or its tiles, over those of other poses.
fn export(most: usize) -> [usize; 2] {
    let survey = first_frames(2);
    let folder = survey.path().join("out");
    let (glb, tiles) = (folder.join("wall.glb"), folder.join("tiles"));
    let export = |poses, kind, out| {
        let poses = ["export", text(survey.path()), "--poses", poses];
        [&poses[..], &["--px-per-metre", "10", "--quiet", kind, out]].concat()
    };
    let traces = tempfile::tempdir().unwrap();
    let kinds = [("--glb", text(&glb)), ("--3dtiles", text(&tiles))];
    let done = kinds.map(|(kind, out)| {
        let arguments = export("truth", kind, out);
        Job::new(
            &export("initial", kind, out),
            arguments,
            folder.clone(),
            traces.path(),
        )
        .endure(most)
    });
    [0, 1].map(|k| done[0][k] + done[1][k])
}

/// Changes of marks that a server is asked for: identifier, and mark or none.
fn changes() -> [(&'static str, Option<String>); 4] {
    [
        ("a", Some(mark("a"))),
        ("b", Some(mark("b"))),
        ("a", Some(mark("a").replace("4:30", "7:15"))),
        ("b", None),
    ]
}

/// Marks by their identifier, as a server tells them; None if it does not.
fn marks_of(server: &Running) -> Option<BTreeMap<String, serde_json::Value>> {
    let (status, said) = server.ask("GET /api/marks", "", "");
    let mut marks: serde_json::Value = (status == 200)
        .then(|| serde_json::from_str(&said))?
        .unwrap();
    let marks = marks["features"].as_array_mut().unwrap();
    let named = marks.iter_mut().map(serde_json::Value::take);
    Some(
        named
            .map(|mark| (mark["id"].as_str().unwrap().to_owned(), mark))
            .collect(),
    )
}

/// Asks for all changes; for each mark its clock position, of those that may now be kept: the last
/// acknowledged one and those after it.
fn change(server: &Running) -> BTreeMap<&'static str, Vec<Option<String>>> {
    let mut possible = BTreeMap::from([("a", vec![None]), ("b", vec![None])]);
    for (id, mark) in changes() {
        let status = match &mark {
            Some(mark) => server.ask(&format!("PUT /api/marks/{id}"), JSON, mark).0,
            None => server.ask(&format!("DELETE /api/marks/{id}"), JSON, "").0,
        };
        let clock = mark.map(|mark| {
            if mark.contains("7:15") {
                "7:15"
            } else {
                "4:30"
            }
            .to_owned()
        });
        let kept = possible.get_mut(id).unwrap();
        if status == 200 {
            kept.clear();
        }
        kept.push(clock);
    }
    possible
}

/// Faults and kills in a server that is asked to change marks, at no more than `most` calls of each
/// kind in every thread; their number.
fn view(most: usize) -> [usize; 2] {
    let dir = tempfile::tempdir().unwrap();
    let site = export_site(dir.path(), "10");
    let trace = dir.path().join("trace");
    let mut done = [0; 2];
    for (call, error) in CALLS {
        for nth in 1..=most {
            let kinds = [format!("error={error}"), "signal=KILL".to_owned()];
            for (done, kind) in done.iter_mut().zip(kinds) {
                let option = format!("inject={call}:{kind}:when={nth}");
                for name in ["marks.geojson", "marks.csv"] {
                    let _ = std::fs::remove_file(site.join(name));
                }
                let program = strace(&trace, call, &option);
                let possible = Running::run(program, &[text(&site)]).map(|server| change(&server));
                let again = Running::start(&[text(&site)]);
                let kept = marks_of(&again).unwrap();
                for (id, clocks) in possible.iter().flatten() {
                    let clock = kept
                        .get(*id)
                        .map(|mark| mark["properties"]["clock"].as_str().unwrap());
                    let is_possible = clocks.iter().any(|one| one.as_deref() == clock);
                    assert!(is_possible, "{option}: {id} has {clock:?} of {clocks:?}");
                }
                assert!(
                    change(&again).values().all(|clocks| clocks.len() == 1),
                    "{option}"
                );
                let names = marks_of(&again).unwrap().into_keys().collect::<Vec<_>>();
                assert_eq!(names, ["a"], "{option}");
                *done += 1;
            }
        }
    }
    done
}

#[test]
fn some_faults_lose_nothing() {
    if can_trace() {
        stitch(2);
        export(1);
    }
}

#[test]
fn acknowledged_marks_survive_faults_and_kills() {
    if can_trace() && !npm::is_viewer_missing() {
        view(2);
    }
}

#[test]
#[ignore = "minutes: a fault and a kill at every call"]
fn no_fault_loses_anything() {
    if can_trace() {
        let done = [stitch, refine, export].map(|endure| endure(usize::MAX));
        println!("faults and kills of stitch, of refine and of export: {done:?}");
        assert!(done.iter().map(|[faults, _]| faults).sum::<usize>() >= 200);
    }
    if can_trace() && !npm::is_viewer_missing() {
        println!("faults and kills of view: {:?}", view(12));
    }
}

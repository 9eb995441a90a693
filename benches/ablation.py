#!/usr/bin/env python3
"""What each technique of the estimator contributes: the program is built without it, and refines the same surveys.

    python3 benches/ablation.py                        # all rows
    python3 benches/ablation.py --only "blur test" --frames 24 SURVEY...

A row is an edit of the source, made in a copy of the last commit under `target/ablation`; it fails if the text to be
replaced is no longer there. SURVEYs (folders with `survey.toml` and true poses) are refined besides the simulated ones.

Prints for every row, over all surveys: the processor time and the wall error relative to the whole program (geometric means),
the worst ratio of errors and its survey, the frames called photometric, and the false successes among them: frames
that are farther off than 3.5 of their stated σ and than half a pixel. With `--every`, also a line per survey.
"""
import argparse
import math
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
WORK = ROOT / "target" / "ablation"
TREE = WORK / "tree"
REFINE = "crates/refine/src/"

# Name of the technique, file, text, and what takes its place.
EDITS = [
    ("correlation search", "tracking/registration.rs",
     "let hypotheses = registration.search();",
     "let hypotheses = [Hypothesis { pose: predicted.pose, score: 0.0, attainable_score: 0.0 }];"),
    ("sliding windows", "tracking/track.rs", "if k > 0 {", "if false {"),
    ("long windows", "tracking/track.rs", "if k.is_multiple_of(LONG_WINDOW_STRIDE) {", "if false {"),
    ("windows from the coarsest level", "tracking/windows.rs", "if !drifted {", "if true {"),
    ("repeated tracking of the first frames", "tracking/alternating_calibration.rs",
     "if change < MAX_SHADING_CHANGE {", "if true {"),
    ("shading from all overlaps", "stages/plan.rs", "        Stage::CorrectShading,\n", ""),
    ("pairwise NCC", "comparison/inconsistent_frames.rs",
     "    for pair in pairs {\n        comparison",
     "    if true { return Vec::new(); }\n    for pair in pairs {\n        comparison"),
    ("blur test", "thresholds.rs", "pub const MIN_SHARPNESS_RATIO: f64 = 0.5;",
     "pub const MIN_SHARPNESS_RATIO: f64 = 0.0;"),
    ("registering rejected frames again", "tracking/track.rs",
     "let mut registered_frames = 0;", "if true { return Ok(0); }\n    let mut registered_frames = 0;"),
    ("alias test", "validation/alias_search.rs",
     ") -> Result<Vec<GaugeMotion>, ProblemError> {\n    let side",
     ") -> Result<Vec<GaugeMotion>, ProblemError> {\n    if true { return Ok(Vec::new()); }\n    let side"),
    ("outlier mask", "samples/outlier_mask.rs", "self.tiles.extend(outliers.concat());", "let _ = outliers;"),
    ("denoised slopes", "tiles/denoising.rs",
     "(1.0 - noise[l][k] / self.squares[l][k].max(f64::MIN_POSITIVE)).max(0.0) as f32",
     "{ let _ = (l, k); 1.0f32 }"),
    ("variance by the gradient", "stages/plan.rs", "variance_weighting: true,", ""),
    ("curvature factor of σ", "solver/solve_record.rs",
     "let steps = self", "if true { return 1.0; }\n        let steps = self"),
    ("two samples per pixel", "options.rs", "final_density: 2.0,", "final_density: 1.0,"),
]

# Name and arguments of `simulate free`; each with seeds of its own.
SURVEYS = [
    ("brick", "--wall brick --seed 1"),
    ("brick, 6°", "--wall brick --rotation-sigma-deg 6 --seed 2"),
    ("tiled brick", "--wall tiled-brick --seed 3"),
    ("tiled brick, 6°", "--wall tiled-brick --rotation-sigma-deg 6 --seed 4"),
    ("concrete", "--wall concrete --seed 5"),
    ("concrete, 6°", "--wall concrete --rotation-sigma-deg 6 --seed 6"),
    ("concrete, lamp", "--wall concrete --lamp-corner 0.4 --gain-percent 20 --bias-grey 5 --seed 7"),
    ("damp brick", "--wall brick --specular-percent 5 --moving 4 --seed 8"),
    ("bad frames", "--wall brick --bad-frames 5:black,9:blurred,12:occluded,15:repeated --seed 9"),
    ("segments", "--wall brick --segments 6 --step-mm 3 --seed 10"),
    ("oval", "--wall brick --ovality-mm 10 --undulation-mm 2 --undulation-length-m 1.5 --seed 11"),
    ("noise 4", "--wall concrete --noise 4 --seed 12"),
]
# Of 24 frames of 240 × 180 px, with poses that are far off or frames that are wrong.
SMALL = "--frames 24 --size 240x180"
BAD = "--bad-frames 5:black,9:blurred,12:occluded,15:repeated"
HARD = [
    ("brick, 12°", f"{SMALL} --wall brick --jitter independent --rotation-sigma-deg 12 --translation-sigma-m 0.12,0.12,0.18 --seed 27"),
    ("concrete, 8°", f"{SMALL} --wall concrete --rotation-sigma-deg 8 --translation-sigma-m 0.08,0.08,0.12 --seed 24"),
    ("concrete, 9°", f"{SMALL} --wall concrete --jitter independent --rotation-sigma-deg 9 --seed 25"),
    ("concrete, 11°", f"{SMALL} --wall concrete --jitter independent --rotation-sigma-deg 11 --translation-sigma-m 0.1,0.1,0.15 --seed 31"),
    ("tiled brick, independent, 5°", f"{SMALL} --wall tiled-brick --jitter independent --rotation-sigma-deg 5 --seed 32"),
    ("tiled brick, steps, 6°", f"{SMALL} --wall tiled-brick --rotation-sigma-deg 6 --seed 21"),
    ("tiled brick, 7°", f"{SMALL} --wall tiled-brick --rotation-sigma-deg 7 --seed 33"),
    ("bad frames, brick, 6°", f"{SMALL} --wall brick --rotation-sigma-deg 6 {BAD} --seed 28"),
    ("bad frames, tiled brick, 4°", f"{SMALL} --wall tiled-brick --rotation-sigma-deg 4 {BAD} --seed 29"),
    ("bad frames, concrete, 5°", f"{SMALL} --wall concrete --rotation-sigma-deg 5 {BAD} --seed 30"),
]
LONG = ("long concrete", "--wall concrete --frames 160 --size 160x120 --seed 13")


def run(command, **kwargs):
    return subprocess.run([str(word) for word in command], check=True, **kwargs)


def check_out():
    """A copy of the last commit."""
    if TREE.exists():
        run(["git", "worktree", "remove", "--force", TREE], cwd=ROOT)
    WORK.mkdir(parents=True, exist_ok=True)
    run(["git", "worktree", "add", "--quiet", "--detach", TREE, "HEAD"], cwd=ROOT)


def build(name, edit):
    """The benchmark built without a technique, or with all of them."""
    program = WORK / name.replace(" ", "_").replace("/", "_")
    path = original = None
    if edit:
        path, text, instead = TREE / REFINE / edit[0], edit[1], edit[2]
        original = path.read_text()
        if original.count(text) != 1:
            sys.exit(f"{name}: {edit[0]} has its text {original.count(text)} times:\n{text}")
        path.write_text(original.replace(text, instead))
    command = ["cargo", "build", "--quiet", "--profile", "quick", "--bench", "ablation", "--message-format", "short"]
    run(command, cwd=TREE, env={**os.environ, "CARGO_TARGET_DIR": str(WORK / "build"), "RUSTFLAGS": "-Awarnings"})
    built = max((WORK / "build" / "quick" / "deps").glob("ablation-*"), key=lambda p: (p.suffix == "", p.stat().st_mtime))
    program.write_bytes(built.read_bytes())
    program.chmod(0o755)
    if path:
        path.write_text(original)
    return program


def simulate(name, arguments, frames, program):
    """A survey drawn by the program."""
    folder = WORK / "surveys" / f"{name} {frames}".replace(" ", "_").replace(",", "")
    if not (folder / "survey.toml").exists():
        size = [] if "--size" in arguments else ["--size", "320x240"]
        many = [] if "--frames" in arguments else ["--frames", frames]
        run([program, "simulate", "free", "--force", "--quiet", "--out", folder, *arguments.split(), *size, *many])
    return folder


def measure(program, surveys):
    """Seconds of processor time, error, frames, photometric ones and false successes; None where refining failed."""
    results = {}
    for survey in surveys:
        before = os.times()
        done = subprocess.run([str(program), str(survey)], capture_output=True, text=True)
        after = os.times()
        seconds = after.children_user + after.children_system - before.children_user - before.children_system
        fields = done.stdout.split("\t")[1:]
        results[survey] = (seconds, float(fields[0]), *map(int, fields[1:])) if len(fields) == 4 else None
    return results


def ratio(pairs):
    """Geometric mean of ratios."""
    logs = [math.log(a / b) for a, b in pairs if a > 0 and b > 0]
    return math.exp(sum(logs) / len(logs)) if logs else math.nan


def row(name, results, whole, every):
    """Prints a row of the table."""
    both = [s for s in whole if results[s] and whole[s]]
    errors = {s: (results[s][1], whole[s][1]) for s in both if results[s][3] and whole[s][3]}
    worst = max(errors, key=lambda s: errors[s][0] / errors[s][1], default=None)
    worst_text = f"{errors[worst][0] / errors[worst][1]:.2f}, {worst.name}" if worst else "none"
    photometric, false = (sum(results[s][k] for s in both) for k in (3, 4))
    frames = sum(whole[s][2] for s in both)
    lost = "" if len(both) == len(whole) else f", {len(whole) - len(both)} surveys without a result"
    print(f"| {name} | {ratio((results[s][0], whole[s][0]) for s in both):.2f} | {ratio(errors.values()):.2f} | "
          f"{worst_text} | {photometric} of {frames}{lost} | {false} |", flush=True)
    for survey in both if every else []:
        print("    {}: {:.2f} s, {:.4f} px, {} frames, {} photometric, {} false".format(survey.name, *results[survey]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("surveys", nargs="*", type=pathlib.Path, metavar="SURVEY")
    parser.add_argument("--only", nargs="+", help="rows, by name")
    parser.add_argument("--frames", type=int, default=48)
    parser.add_argument("--hard", action="store_true", help="surveys that are hard to refine instead")
    parser.add_argument("--every", action="store_true", help="a line per survey, too")
    options = parser.parse_args()
    edits = [edit for edit in EDITS if not options.only or edit[0] in options.only]
    check_out()
    program = ROOT / "target" / "quick" / "tunnelstitch"
    run(["cargo", "build", "--quiet", "--profile", "quick"], cwd=ROOT)
    drawn = HARD if options.hard else SURVEYS + [LONG]
    named = [simulate(name, arguments, options.frames, program) for name, arguments in drawn]
    surveys = named + [survey.resolve() for survey in options.surveys]
    whole = measure(build("whole program", None), surveys)
    print("| without | time | error | worst | photometric | false |\n| --- | --- | --- | --- | --- | --- |")
    row("nothing", whole, whole, options.every)
    for name, *edit in edits:
        row(name, measure(build(name, edit), surveys), whole, options.every)
    run(["git", "worktree", "remove", "--force", TREE], cwd=ROOT)


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""A panorama of 200 m at 400 px/m: how fast it is drawn, and in how much memory.

    python3 benches/long_survey.py [--tiff] [FOLDER] [options of stitch]

Makes a survey of 2,000 grey JPEG frames of 1920 x 1080 px (with --tiff uncompressed TIFF frames, of which decoding is
next to nothing; 36 simulated ones, again and again, on the plan's poses; the camera shows the wall at 400 px/m), unless FOLDER has it already, and stitches it with `--compression jpeg`. Prints Mpx of
panorama per second by the clock, processor time, and the most memory resident. Needs pillow (PyPI), a Rust toolchain
and Linux.
"""
import json
import math
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

from PIL import Image

FRAMES, DIFFERENT, SIZE, PX_PER_METRE, RADIUS_M = 2000, 36, (1920, 1080), 400, 3
PROGRAM = Path(__file__).parent.parent / "target" / "release" / "tunnelstitch"


def run(*arguments):
    return subprocess.run([str(argument) for argument in (PROGRAM, "--quiet", *arguments)],
                          check=True, stdout=subprocess.PIPE, text=True).stdout


def survey(folder, suffix):
    """Simulates the different frames and links to them."""
    few = folder / "few"
    fov_deg = 2 * math.degrees(math.atan(0.5 * SIZE[1] / (PX_PER_METRE * RADIUS_M)))
    run("simulate", "free", "--frames", DIFFERENT, "--size", "%dx%d" % SIZE, "--fov-deg", fov_deg,
        "--rotation-sigma-deg", 0, "--translation-sigma-m", "0,0,0", "--out", few)
    frames = sorted((few / "frames").iterdir())
    for k, frame in enumerate(frames):
        frames[k] = frame.with_suffix(suffix)
        Image.open(frame).convert("L").save(frames[k], quality=90)
    (folder / "frames").mkdir()
    for k in range(FRAMES):
        os.link(frames[k % len(frames)], folder / "frames" / f"{k:06}{suffix}")
    (folder / "camera.json").write_bytes((few / "camera.json").read_bytes())
    with open(folder / "plan.tum", "w") as poses:
        for k in range(FRAMES):
            half = math.radians(30 * k) / 2
            poses.write(f"{k} 0 {0.1 * k:.3f} 0 0 {math.sin(half):.15f} 0 {math.cos(half):.15f}\n")
    (folder / "survey.toml").write_text(f"""[tunnel]
shape = "circle"
radius_m = {RADIUS_M}
[camera]
file = "camera.json"
[frames]
images = "frames/*{suffix}"
[poses]
initial = "plan.tum"
""")


def main():
    options = sys.argv[1:]
    suffix = ".jpg"
    if options[:1] == ["--tiff"]:
        suffix, options = ".tif", options[1:]
    folder = Path(options[0] if options else "long-survey" + suffix[1:])
    subprocess.run(["cargo", "build", "--quiet", "--release"], check=True, cwd=Path(__file__).parent.parent)
    if not (folder / "survey.toml").exists():
        folder.mkdir(parents=True, exist_ok=True)
        survey(folder, suffix)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    since = time.perf_counter()
    report = json.loads(run("stitch", folder, "--poses", "initial", "--px-per-metre", PX_PER_METRE, "--compression",
                            "jpeg", "--out", folder / "panorama.tif", "--json", *options[1:]))
    elapsed = time.perf_counter() - since
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    pixels = report["width"] * report["height"]
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"{report['width']} x {report['height']} px in {elapsed:.1f} s: {pixels / elapsed / 1e6:.1f} Mpx/s")
    print(f"processor time {used:.1f} s: {pixels / used / 1e6:.1f} Mpx/s of one core")
    print(f"memory {after.ru_maxrss / 2**20:.2f} GiB")


if __name__ == "__main__":
    main()

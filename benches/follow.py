#!/usr/bin/env python3
"""Measures whether `tunnelstitch refine --follow` keeps up with a camera.

    python3 benches/follow.py TUNNELSTITCH [FRAMES [RATE [SIZE]]]

Simulates a survey (default: 600 frames of 640x480), and moves its pictures into the folder of a second survey, RATE a second
(default 30), while `refine --follow` runs there. Prints, second by second, the pictures there, the frames tracked, those that do
not match or were skipped, and the lag; at the end the largest lag, the share of the frames that were tracked, and how far the
provisional poses are off the truth on the wall. Ctrl-C ends the capture, and once more the solve, which is not measured.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

LINE = re.compile(r"(\d+) frames, (\d+) tracked.*?lag ([\d.]+) s")
SKIPPED = re.compile(r"(\d+) skipped")


def run(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def capture(pictures, folder, rate, pace):
    """Moves the pictures in, one every 1/rate seconds, as a camera would; records how late it was itself."""
    start = time.monotonic()
    for k, picture in enumerate(pictures):
        wait = start + k / rate - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        pace.append(max(0.0, -wait))
        shutil.copyfile(picture, folder / f".{picture.name}")
        os.rename(folder / f".{picture.name}", folder / picture.name)


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    program = Path(sys.argv[1]).resolve()
    frames, rate, size = (sys.argv[2:] + ["600", "30", "640x480"][len(sys.argv) - 2 :])[:3]
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        full, live, out = folder / "full", folder / "live", folder / "out"
        run(program, "simulate", "free", "--frames", frames, "--size", size, "--out", full)
        shutil.copytree(full, live, ignore=lambda path, names: [n for n in names if Path(path).name == "frames"])
        pictures = sorted((full / "frames").iterdir())
        (live / "frames").mkdir(exist_ok=True)
        follow = [program, "refine", live, "--follow", "--follow-until", "3", "--out", out]
        child = subprocess.Popen([str(part) for part in follow], stdout=subprocess.PIPE, text=True)
        pace, lags, poses = [], [], None
        camera = threading.Thread(target=capture, args=(pictures, live / "frames", float(rate), pace), daemon=True)
        camera.start()
        for line in child.stdout:
            print(line.rstrip())
            found = LINE.search(line)
            if found and "has ended" not in line:
                lags.append(float(found[3]))
            if "has ended" in line:
                tracked, skipped = int(found[2]), SKIPPED.search(line)
                poses = shutil.copyfile(out / "preview.tum", folder / "preview.tum")
                break
        child.send_signal(signal.SIGINT)
        child.stdout.close()
        child.wait()
        print(f"camera: {frames} frames of {size} at {rate}/s, itself at most {1e3 * max(pace):.0f} ms late")
        print(f"lag: {max(lags):.1f} s at most, {sorted(lags)[len(lags) // 2]:.1f} s in the median")
        print(f"tracked: {100 * tracked / int(frames):.1f} %, skipped: {skipped[1] if skipped else 0}")
        if poses:
            print(run(program, "compare", full, "--refined", poses, "--out", folder / "compare"))


main()

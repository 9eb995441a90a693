#!/usr/bin/env python3
"""Surveys that must fail: how far their results are from the truth, what is said of them, and how long that takes.

    cargo build --release && python3 benches/failing.py [--program target/release/tunnelstitch] [--frames 24]

Simulates two surveys (brick and concrete) and damages copies of them in ways that no refinement can mend: blank, black,
noisy, blurred and equal pictures, pictures or poses in another order, quaternions that begin with w, other units, wrong
calibrations and radii. Prints for each: the distance of the poses from the truth after and before, in the gauge that
fits best (it must not grow by more than 1 %), the frames called photometric, the exit code, and the processor time
relative to the undamaged survey. A survey that is mended nevertheless (every frame within its σ) counts as good.
Needs numpy and pillow (PyPI).
"""
import argparse
import json
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys
import tempfile

import numpy as np
from PIL import Image, ImageFilter


def pictures(survey):
    return sorted((survey / "frames").iterdir())


def each_picture(change):
    """A damage that changes every picture: `change(array, index)`."""
    def damage(survey):
        for index, path in enumerate(pictures(survey)):
            picture = np.asarray(Image.open(path))
            Image.fromarray(change(picture, index).clip(0, 255).astype(np.uint8)).save(path)
    return damage


def reorder_pictures(order):
    def damage(survey):
        paths = pictures(survey)
        contents = [path.read_bytes() for path in paths]
        for path, k in zip(paths, order(len(paths))):
            path.write_bytes(contents[k])
    return damage


def change_poses(change):
    """A damage of the initial poses: `change(rows)`, rows of `t x y z qx qy qz qw`."""
    def damage(survey):
        path = survey / "baseline.tum"
        rows = np.loadtxt(path)
        np.savetxt(path, change(rows), fmt="%.9f")
    return damage


def change_camera(**factors):
    def damage(survey):
        path = survey / "camera.json"
        camera = json.loads(path.read_text())
        for key, change in factors.items():
            camera[key] = change(camera[key])
        path.write_text(json.dumps(camera))
    return damage


def scale_radius(factor):
    def damage(survey):
        path = survey / "survey.toml"
        radius = lambda found: f"radius_m = {float(found[1]) * factor}"
        path.write_text(re.sub(r"radius_m = ([0-9.]+)", radius, path.read_text(), count=1))
    return damage


def in_columns(rows, columns):
    return rows[:, [0, *columns]]


def with_positions(change):
    def changed(rows):
        rows = rows.copy()
        rows[:, 1:4] = change(rows[:, 1:4])
        return rows
    return change_poses(changed)


def blurred(picture, _):
    return np.asarray(Image.fromarray(picture).filter(ImageFilter.GaussianBlur(12)))


def shuffled(count):
    order = list(range(count))
    random.Random(1).shuffle(order)
    return order


def by_text(count):
    """The order of names without leading zeros."""
    return sorted(range(count), key=str)


GENERATOR = np.random.default_rng(1)
DAMAGES = {
    "blank": each_picture(lambda picture, _: np.full_like(picture, 200)),
    "black": each_picture(lambda picture, _: GENERATOR.normal(2, 1, picture.shape)),
    "noise alone": each_picture(lambda picture, _: GENERATOR.normal(120, 40, picture.shape)),
    "blurred": each_picture(blurred),
    "one picture": reorder_pictures(lambda count: [0] * count),
    "pictures shuffled": reorder_pictures(shuffled),
    "pictures in the order of texts": reorder_pictures(by_text),
    "poses reversed": change_poses(lambda rows: np.column_stack([rows[:, 0], rows[::-1, 1:]])),
    "quaternions w first": change_poses(lambda rows: in_columns(rows, [1, 2, 3, 7, 4, 5, 6])),
    "chainage tenfold": with_positions(lambda xyz: xyz * [1, 10, 1]),
    "focal length × 1.3": change_camera(fx=lambda f: 1.3 * f, fy=lambda f: 1.3 * f),
    "focal length × 0.7": change_camera(fx=lambda f: 0.7 * f, fy=lambda f: 0.7 * f),
    "diameter for radius": scale_radius(2.0),
    "radius for diameter": scale_radius(0.5),
    "mirrored": each_picture(lambda picture, _: picture[:, ::-1]),
    "upside down": each_picture(lambda picture, _: picture[::-1, ::-1]),
}


def run(command):
    """Result and seconds of processor time of a command."""
    before = os.times()
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    after = os.times()
    return done, after.children_user + after.children_system - before.children_user - before.children_system


def distance_m(poses, truth):
    """Root mean square distance of the points that are seen 3 m ahead of the cameras, after the rotation about the
    tunnel's axis (y) and the translation along it that fit best."""
    def points(path):
        rows = np.loadtxt(path)[:, 1:]
        x, y, z, w = rows[:, 3:].T
        ahead = np.column_stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
        return rows[:, :3] + 3 * ahead
    a, b = points(poses), points(truth)
    shift = (b[:, 1] - a[:, 1]).mean()
    ca, cb = a[:, 2] + 1j * a[:, 0], b[:, 2] + 1j * b[:, 0]
    turn = np.vdot(ca, cb)
    across = np.abs(ca * turn / max(abs(turn), 1e-30) - cb)
    return float(np.sqrt((across**2 + (a[:, 1] + shift - b[:, 1])**2).mean()))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/tunnelstitch")
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("--only", help="part of the names of the damages to try")
    options = parser.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        print("| survey | after / before, mm | photometric | exit code | time |\n| --- | --- | --- | --- | --- |")
        for wall in ["brick", "concrete"]:
            whole = folder / wall
            done, _ = run([options.program, "simulate", "free", "--wall", wall, "--frames", options.frames,
                           "--size", "240x180", "--seed", 3, "--out", whole, "--quiet"])
            if done.returncode:
                sys.exit(done.stderr)
            clean_s = None
            for name, damage in {"nothing": lambda _: None, **DAMAGES}.items():
                if options.only and name != "nothing" and options.only not in name:
                    continue
                survey, out = folder / "survey", folder / "out"
                for path in (survey, out):
                    shutil.rmtree(path, ignore_errors=True)
                shutil.copytree(whole, survey)
                damage(survey)
                done, seconds = run([options.program, "refine", survey, "--out", out])
                clean_s = clean_s or seconds
                time = seconds / clean_s
                if not (out / "refine.json").exists():
                    print(f"| {wall}, {name} | refused | | {done.returncode} | {time:.1f} |", flush=True)
                    bad += done.returncode not in (2, 3)
                    continue
                frames = json.loads((out / "refine.json").read_text())["frames"]
                photometric = sum(frame["flag"] == "photometric" for frame in frames)
                before = distance_m(survey / "baseline.tum", whole / "groundtruth.tum")
                after = distance_m(out / "poses.tum", whole / "groundtruth.tum")
                is_worse = after > 1.01 * before
                bad += is_worse or (name != "nothing" and time > 3)
                print(f"| {wall}, {name} | {1e3 * after:.1f} / {1e3 * before:.1f}{' WORSE' if is_worse else ''} | "
                      f"{photometric} | {done.returncode} | {time:.1f} |", flush=True)
    print(f"{bad} worse than their input, slower than three times the undamaged survey, or ended abnormally")
    sys.exit(bad > 0)


if __name__ == "__main__":
    main()

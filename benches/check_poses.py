#!/usr/bin/env python3
"""Checks the poses that `tunnelstitch` writes through the programs of others: evo and pycolmap.

    python3 benches/check_poses.py TUNNELSTITCH SURVEY [REFINED]

TUNNELSTITCH is the program, SURVEY a survey with true poses, REFINED poses of it (default: its initial ones).

evo: `evo_ape` and `evo_rpe` read what `convert --to tum` and `--to kitti` write, and their statistics, without alignment, are
those of `unaligned` in compare.json. What `compare` measures after removing the gauge is checked, too: evo measures the same
poses once they are turned about and shifted along the axis by what compare.json says was removed.

COLMAP: pycolmap reads what `convert --to colmap` writes, with a plain lens and with a distorted one, and projects points of
the wall to the pixels that `locate` tells. nerfstudio: the same points through the matrices and the camera of transforms.json,
by its documented convention.

Prints the largest differences; ends with status 1 if one is above 1e-6. Needs from PyPI: evo, numpy, pycolmap.
"""

import json
import math
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pycolmap

LIMIT = 1e-6
# Ours, as evo calls them.
STATISTICS = {"rms": "rmse", "median": "median", "max": "max"}
failed = False


def report(what, difference, unit):
    global failed
    failed |= not difference <= LIMIT
    print(f"{what:<64} {difference:9.2e} {unit}{'' if difference <= LIMIT else '   TOO MUCH'}")


def run(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def evo(program, kind, truth, estimate, relation, folder):
    """The statistics that evo prints, with all digits."""
    results = folder / "results.zip"
    results.unlink(missing_ok=True)
    here = Path(sys.executable).with_name(program)
    delta = ["--delta", "1", "--delta_unit", "f"] if program == "evo_rpe" else []
    run(here, kind, truth, estimate, "-r", relation, "--save_results", results, "--no_warnings", *delta)
    with zipfile.ZipFile(results) as archive:
        return json.loads(archive.read("stats.json"))


def furthest(ours, theirs):
    return max(abs(ours[our] - theirs[their]) for our, their in STATISTICS.items())


def moved(tum, motion, out):
    """Turns poses about the axis and shifts them along it."""
    half = 0.5 * motion["turn_rad"]
    w, y = math.cos(half), math.sin(half)
    c, s = math.cos(2 * half), math.sin(2 * half)
    lines = []
    for line in tum.read_text().splitlines():
        time, tx, ty, tz, qx, qy, qz, qw = map(float, line.split())
        t = (c * tx + s * tz, ty + motion["shift_m"], -s * tx + c * tz)
        # (w, 0, y, 0) times (qw, qx, qy, qz).
        q = (w * qx + y * qz, w * qy + y * qw, w * qz - y * qx, w * qw - y * qy)
        lines.append(" ".join(repr(value) for value in (time, *t, *q)))
    out.write_text("\n".join(lines) + "\n")
    return out


def check_evo(tunnelstitch, survey, refined, folder):
    estimates = {"baseline": "initial", "refined": refined}
    files = {}
    for name, poses in {"truth": "truth", **estimates}.items():
        for kind in ["tum", "kitti"]:
            files[name, kind] = folder / f"{name}.{kind}"
            run(tunnelstitch, "convert", survey, "--poses", poses, "--to", kind, "--out", files[name, kind])
    run(tunnelstitch, "compare", survey, "--refined", files["refined", "tum"], "--out", folder / "compared", "--px-per-metre", 20)
    scores = json.loads((folder / "compared/compare.json").read_text())
    for name in estimates:
        for program, measure in [("evo_ape", "ape"), ("evo_rpe", "rpe")]:
            for relation, ours, unit in [("trans_part", "translation_m", "m"), ("angle_deg", "rotation_deg", "°")]:
                expected = scores[name]["unaligned"][f"{measure}_{ours}"]
                for kind in ["tum", "kitti"]:
                    theirs = evo(program, kind, files["truth", kind], files[name, kind], relation, folder)
                    what = f"{program} {kind} -r {relation}, {name} (rmse {theirs['rmse']:.6g} {unit})"
                    report(what, furthest(expected, theirs), unit)
        trajectory = scores[name]["trajectory"]
        aligned = moved(files[name, "tum"], trajectory["gauge"], folder / f"{name}-aligned.tum")
        for relation, ours, unit in [("trans_part", "translation_m", "m"), ("angle_deg", "rotation_deg", "°")]:
            theirs = evo("evo_ape", "tum", files["truth", "tum"], aligned, relation, folder)
            what = f"evo_ape tum -r {relation}, {name}, gauge removed (rmse {theirs['rmse']:.6g} {unit})"
            report(what, furthest(trajectory[ours], theirs), unit)


def copy_with_lens(survey, folder, k1, k2):
    """A copy of the survey with another lens; frames are not looked at."""
    copy = folder / f"lens{k1}"
    shutil.copytree(survey, copy)
    camera = json.loads((copy / "camera.json").read_text())
    camera.update({"k1": k1, "k2": k2} if k1 else {})
    (copy / "camera.json").write_text(json.dumps(camera))
    return copy


def check_projections(tunnelstitch, survey, folder):
    model, json_file = folder / "sparse", survey / "transforms.json"
    run(tunnelstitch, "convert", survey, "--poses", "truth", "--to", "colmap", "--out", model)
    run(tunnelstitch, "convert", survey, "--poses", "truth", "--to", "nerfstudio", "--out", json_file)
    reconstruction = pycolmap.Reconstruction(str(model))
    images = {image.name: image for image in reconstruction.images.values()}
    transforms = json.loads(json_file.read_text())
    by_path = {frame["file_path"]: np.array(frame["transform_matrix"]) for frame in transforms["frames"]}
    assert set(images) == set(by_path), "frames are called otherwise"
    assert all((survey / name).is_file() for name in images), "frames are not where they are said to be"
    radius = next(float(line.split("=")[1]) for line in (survey / "survey.toml").read_text().splitlines() if line.startswith("radius_m"))
    count, colmap_worst, nerfstudio_worst = 0, 0.0, 0.0
    for chainage in np.linspace(0.2, 4.0, 6):
        for degrees in range(5, 360, 40):
            told = json.loads(run(tunnelstitch, "locate", survey, "--poses", "truth", "--wall", f"{chainage},{degrees}", "--json"))
            theta = math.radians(told["theta_deg"])
            point = np.array([radius * math.sin(theta), told["chainage_m"], radius * math.cos(theta)])
            for frame in told["frames"]:
                # From the corner of the first pixel, not from its centre.
                pixel = np.array(frame["pixel"]) + 0.5
                name = next(name for name in images if name.endswith(frame["file"]))
                colmap_worst = max(colmap_worst, np.abs(images[name].project_point(point) - pixel).max())
                nerfstudio_worst = max(nerfstudio_worst, np.abs(project(transforms, by_path[name], point) - pixel).max())
                count += 1
    camera = next(iter(reconstruction.cameras.values())).model.name
    report(f"pycolmap, {len(images)} images, {camera}, {count} projections", colmap_worst, "px")
    report(f"nerfstudio's convention, {camera}, {count} projections", nerfstudio_worst, "px")


def project(camera, matrix, point):
    """A point through a camera-to-world matrix in OpenGL's axes."""
    x, y, z = matrix[:3, :3].T @ (point - matrix[:3, 3])
    x, y = x / -z, -y / -z
    q = x * x + y * y
    factor = 1.0 + q * (camera.get("k1", 0.0) + q * camera.get("k2", 0.0))
    return np.array([camera["fl_x"] * x * factor + camera["cx"], camera["fl_y"] * y * factor + camera["cy"]])


def main():
    tunnelstitch, survey = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
    refined = Path(sys.argv[3]).resolve() if len(sys.argv) > 3 else "initial"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        check_evo(tunnelstitch, survey, refined, folder)
        for lens in [(0.0, 0.0), (-0.08, 0.012)]:
            check_projections(tunnelstitch, copy_with_lens(survey, folder, *lens), folder)
    sys.exit(failed)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main()

#!/usr/bin/env python3
"""Checks a GLB of `tunnelstitch export` through Blender: renders it from the poses of frames and compares with these frames.

    tunnelstitch export SURVEY --poses truth --glb wall.glb
    python3 benches/check_glb.py wall.glb SURVEY/camera.json SURVEY/groundtruth.tum SURVEY/frames/*.jpg

The poses must be those that the GLB was drawn from, the camera a pinhole without distortion. Blender imports the file by itself, and
the world's coordinates must come back: cameras are placed at the poses as they are written. Every EVERY-th frame is rendered
(8, or --every N). Prints the PSNR of each; ends with status 1 if the mean is below 28 dB.

Needs from PyPI: bpy 5.0 (Python 3.11), numpy, pillow.
"""

import argparse
import json
import math
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector
from PIL import Image

LEAST_DB = 28.0


def imported(path):
    """The GLB in an empty scene, shown as it is: no light, no tone curve."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(path))
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 16
    scene.cycles.use_denoising = False
    scene.render.film_transparent = False
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.look = "None"
    scene.render.image_settings.file_format = "PNG"
    return scene


def extent(scene):
    corners = [o.matrix_world @ Vector(c) for o in scene.objects if o.type == "MESH" for c in o.bound_box]
    return [[f(c[k] for c in corners) for k in range(3)] for f in (min, max)]


def camera_of(scene, calibration):
    """A pinhole: focal length in widths of the picture, and the principal point as a shift."""
    if any(calibration.get(name, 0.0) for name in ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")):
        sys.exit("the camera has distortion, which Blender's has not")
    half = 0.5 if calibration.get("pixel_centre") == "integer" else 0.0
    width, height = calibration["width"], calibration["height"]
    data = bpy.data.cameras.new("camera")
    data.sensor_fit = "HORIZONTAL"
    data.lens = calibration["fx"] * data.sensor_width / width
    data.shift_x = (width / 2 - calibration["cx"] - half) / width
    data.shift_y = (calibration["cy"] + half - height / 2) / width
    data.clip_start = 0.001
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.pixel_aspect_x = 1.0
    scene.render.pixel_aspect_y = calibration["fx"] / calibration["fy"]
    camera = bpy.data.objects.new("camera", data)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return camera


def rendered(scene, camera, pose, path):
    tx, ty, tz, qx, qy, qz, qw = pose
    # x right, y down, z forward -> x right, y up, z backwards.
    flip = Matrix.Diagonal((1, -1, -1)).to_4x4()
    camera.matrix_world = Matrix.Translation((tx, ty, tz)) @ Quaternion((qw, qx, qy, qz)).to_matrix().to_4x4() @ flip
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return np.asarray(Image.open(path).convert("L"), dtype=float)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("glb", type=Path)
    arguments.add_argument("camera", type=Path)
    arguments.add_argument("poses", type=Path)
    arguments.add_argument("frames", type=Path, nargs="+")
    arguments.add_argument("--every", type=int, default=8)
    arguments.add_argument("--keep", type=Path, help="a folder for the pictures")
    given = arguments.parse_args()
    poses = np.loadtxt(given.poses)[:, 1:]
    frames = sorted(given.frames)
    if len(poses) != len(frames):
        sys.exit(f"{len(poses)} poses and {len(frames)} frames")
    scene = imported(given.glb)
    low, high = extent(scene)
    print("extent in Blender, m:", *(f"{name} {a:.3f} to {b:.3f}" for name, a, b in zip("xyz", low, high)), sep="  ")
    camera = camera_of(scene, json.loads(given.camera.read_text()))
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        for k in range(0, len(frames), given.every):
            picture = rendered(scene, camera, poses[k], folder / f"{frames[k].stem}.png")
            frame = np.asarray(Image.open(frames[k]).convert("L"), dtype=float)
            rms = math.sqrt(np.mean((picture - frame) ** 2))
            found.append(20 * math.log10(255 / rms))
            print(f"{frames[k].name}: PSNR {found[-1]:.2f} dB")
    mean = sum(found) / len(found)
    print(f"{len(found)} frames, mean PSNR {mean:.2f} dB, least {min(found):.2f} dB")
    sys.exit(mean < LEAST_DB)


if __name__ == "__main__":
    main()

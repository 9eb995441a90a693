#!/usr/bin/env python3
"""The warp against OpenCV's, in one run and with one thread each.

Needs opencv-python-headless and numpy (PyPI) and a Rust toolchain. Runs `cargo bench --bench warp -- --json` and, before
and after it, OpenCV's `remap` (four RGB8 frames of 1920 x 1080 in turn, ready-made float maps of the same cylinder) and its
cylindrical `PyRotationWarper`, three times; prints Mpx per second of processor time and the ratios, medians of the three.
"""
import json
import os
import statistics
import subprocess
import sys
import time

import cv2
import numpy as np

WIDTH, HEIGHT, FOV_DEG, ROUNDS, RUNS = 1920, 1080, 30, 15, 3
THREADS = int(sys.argv[1]) if len(sys.argv) > 1 else 1


def maps():
    """Pixels of the frame for each pixel of the unrolled wall that it sees, at its own resolution."""
    f = 0.5 * HEIGHT / np.tan(np.radians(FOV_DEG / 2))
    cx, cy = 0.5 * (WIDTH - 1), 0.5 * (HEIGHT - 1)
    half = np.arctan(cx / f)
    theta = np.arange(-half, half, 1 / f)
    h = np.arange(-cy / f, cy / f, 1 / f)
    theta, h = np.meshgrid(theta, h)
    u = f * np.tan(theta) + cx
    v = f * h / np.cos(theta) + cy
    return u.astype(np.float32), v.astype(np.float32), f, (cx, cy)


def speed(pixels, photos, work):
    times = []
    for _ in range(ROUNDS):
        since = time.process_time()
        for photo in photos:
            work(photo)
        times.append(time.process_time() - since)
    return len(photos) * pixels / statistics.median(times) / 1e6


def opencv():
    u, v, f, (cx, cy) = maps()
    photos = np.random.default_rng(1).integers(0, 256, (4, HEIGHT, WIDTH, 3), dtype=np.uint8)
    out = np.empty(u.shape + (3,), np.uint8)
    found = {}
    for name, flag in [("bilinear", cv2.INTER_LINEAR), ("bicubic", cv2.INTER_CUBIC), ("lanczos4", cv2.INTER_LANCZOS4)]:
        found[f"remap {name}"] = speed(u.size, photos, lambda photo: cv2.remap(photo, u, v, flag, dst=out))
    warper = cv2.PyRotationWarper("cylindrical", f)
    k = np.array([[f, 0, cx], [0, f, cy], [0, 0, 1]], np.float32)
    r = np.eye(3, dtype=np.float32)
    _, warped = warper.warp(photos[0], k, r, cv2.INTER_LINEAR, cv2.BORDER_CONSTANT)
    pixels = warped.shape[0] * warped.shape[1]
    found["PyRotationWarper bilinear"] = speed(
        pixels, photos, lambda photo: warper.warp(photo, k, r, cv2.INTER_LINEAR, cv2.BORDER_CONSTANT))
    return found


def ours():
    environment = dict(os.environ, RAYON_NUM_THREADS=str(THREADS))
    text = subprocess.run(["cargo", "bench", "--quiet", "--bench", "warp", "--", "--json"],
                          env=environment, check=True, capture_output=True, text=True).stdout
    return {row["what"]: row["mpx_per_s"] for row in map(json.loads, filter(None, text.splitlines()))}


def main():
    cv2.setNumThreads(THREADS)
    # In turn, so that what else the machine does meets both.
    theirs, own = [opencv()], []
    for _ in range(RUNS):
        own.append(ours())
        theirs.append(opencv())
    median = lambda runs: {name: statistics.median(run[name] for run in runs) for name in runs[0]}
    theirs, own = median(theirs), median(own)
    print(f"{THREADS} thread(s), Mpx/s of processor time")
    for name, value in {**theirs, **{f"tunnelstitch {k}": v for k, v in own.items()}}.items():
        print(f"  {name:28} {value:10.1f}")
    print("ratios")
    for name, mine, other in [
        ("bilinear / remap", "bilinear", "remap bilinear"),
        ("bilinear / PyRotationWarper", "bilinear", "PyRotationWarper bilinear"),
        ("bicubic / remap", "bicubic", "remap bicubic"),
        ("lanczos3 / remap (lanczos4)", "lanczos3", "remap lanczos4"),
    ]:
        print(f"  {name:28} {own[mine] / theirs[other]:10.2f}")
    print(f"  {'bilinear / copy':28} {own['bilinear'] / own['copy']:10.4f}")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""The warp against OpenCV's, in one run and with one thread each.

Needs opencv-python-headless and numpy (PyPI) and a Rust toolchain. Runs `cargo bench --bench warp -- --ask` and OpenCV in
turn, a round of one and then a round of the other, so that what else the machine does meets both: OpenCV's `remap` (RGB8
frames of 1920 x 1080, ready-made float maps of the same cylinder) and its cylindrical `PyRotationWarper`. Prints Mpx per
second of processor time and the ratio of neighbouring rounds: the median, and the quartiles.
"""
import os
import statistics
import subprocess
import sys
import time

import cv2
import numpy as np

WIDTH, HEIGHT, FOV_DEG, ROUNDS = 1920, 1080, 30, 25
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
    """Mpx per second of processor time in one round."""
    since = time.process_time()
    for photo in photos:
        work(photo)
    return len(photos) * pixels / (time.process_time() - since) / 1e6


def opencv():
    """What is compared: the name of ours, that of OpenCV's, and a round of it."""
    u, v, f, (cx, cy) = maps()
    photos = np.random.default_rng(1).integers(0, 256, (8, HEIGHT, WIDTH, 3), dtype=np.uint8)
    out = np.empty(u.shape + (3,), np.uint8)
    remap = lambda flag: lambda: speed(u.size, photos, lambda photo: cv2.remap(photo, u, v, flag, dst=out))
    warper = cv2.PyRotationWarper("cylindrical", f)
    k = np.array([[f, 0, cx], [0, f, cy], [0, 0, 1]], np.float32)
    warp = lambda photo: warper.warp(photo, k, np.eye(3, dtype=np.float32), cv2.INTER_LINEAR, cv2.BORDER_CONSTANT)
    pixels = np.prod(warp(photos[0])[1].shape[:2])
    return [
        ("bilinear", "remap bilinear", remap(cv2.INTER_LINEAR)),
        ("bilinear", "PyRotationWarper bilinear", lambda: speed(pixels, photos, warp)),
        ("bicubic", "remap bicubic", remap(cv2.INTER_CUBIC)),
        ("lanczos3", "remap lanczos4", remap(cv2.INTER_LANCZOS4)),
    ]


def quartiles(values, digits):
    low, median, high = statistics.quantiles(values, n=4)
    return f"{median:8.{digits}f}  ({low:.{digits}f} to {high:.{digits}f})"


def main():
    cv2.setNumThreads(THREADS)
    bench = subprocess.Popen(
        ["cargo", "bench", "--quiet", "--bench", "warp", "--", "--ask"], text=True, bufsize=1,
        env=dict(os.environ, RAYON_NUM_THREADS=str(THREADS)), stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def ours(what):
        print(what, file=bench.stdin)
        return float(bench.stdout.readline())

    print(f"{THREADS} thread(s), {ROUNDS} rounds in turn, Mpx/s of processor time: median (quartiles)")
    for name, other, theirs in opencv() + [("bilinear", "a copy", lambda: ours("copy"))]:
        rounds = [(ours(name), theirs()) for _ in range(ROUNDS + 1)][1:]
        print(f"  {name:9} {quartiles([own for own, _ in rounds], 1)}")
        print(f"    {other:26} {quartiles([other for _, other in rounds], 1)}")
        print(f"    ratio                      {quartiles([own / other for own, other in rounds], 3)}", flush=True)
    bench.stdin.close()
    sys.exit(bench.wait())


if __name__ == "__main__":
    main()

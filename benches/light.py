#!/usr/bin/env python3
"""How well light and exposure are undone: a panorama against one of the same wall, evenly lit and without noise.

    tunnelstitch simulate free --frames 36 --gain-percent 30 --lamp-corner 0.4 --out lit
    tunnelstitch simulate free --frames 36 --noise 0 --out even
    tunnelstitch stitch lit --poses truth --out lit.png --maps maps
    tunnelstitch stitch even --poses truth --no-blend --out even.png
    python3 benches/light.py lit.png even.png maps/frames.tif

Prints the PSNR as it is and after one common factor (the overall brightness cannot be known), and the steps over seams:
the difference of the error's means over 8 px on either side, in stretches of 16 px along the seam (of noise of 2 grey
levels, 0.25 are left). Needs numpy, pillow and rasterio (PyPI).
"""
import sys

import numpy as np
import rasterio
from PIL import Image

Image.MAX_IMAGE_PIXELS = None
SIDE, ALONG, NONE = 8, 16, 2**32 - 1


def psnr(difference):
    return 10 * np.log10(255**2 / np.mean(difference**2))


def steps(error, frames):
    """Steps over seams that run down the picture."""
    found = []
    rows, columns = frames.shape
    changes = frames[:, 1:] != frames[:, :-1]
    for y in range(0, rows - ALONG, ALONG):
        for x in np.flatnonzero(changes[y + ALONG // 2]):
            part = []
            for row in range(y, y + ALONG):
                near = np.flatnonzero(changes[row, max(x - 5, 0):x + 6])
                if len(near) != 1:
                    continue
                seam = max(x - 5, 0) + near[0] + 1
                left, right = slice(seam - SIDE, seam), slice(seam, seam + SIDE)
                if seam < SIDE or seam + SIDE > columns:
                    continue
                a, b = frames[row, left], frames[row, right]
                if NONE in (a[-1], b[0]) or (a != a[-1]).any() or (b != b[0]).any():
                    continue
                part.append(error[row, right].mean() - error[row, left].mean())
            if len(part) >= ALONG * 3 // 4:
                found.append(np.mean(part))
    return found


def main():
    lit, even = (np.asarray(Image.open(name).convert("LA"), float) for name in sys.argv[1:3])
    with rasterio.open(sys.argv[3]) as source:
        frames = source.read(1)
    covered = (lit[..., 1] > 0) & (even[..., 1] > 0)
    x, y = lit[..., 0][covered], even[..., 0][covered]
    factor = (x * y).sum() / (x * x).sum()
    error = np.where(covered, lit[..., 0] - even[..., 0], np.nan)
    found = np.array(steps(error, frames) + steps(error.T, frames.T))
    found = found[np.isfinite(found)]
    print(f"PSNR {psnr(x - y):.2f} dB; {psnr(factor * x - y):.2f} dB after a factor of {factor:.4f}")
    print(f"steps over seams {np.sqrt(np.mean(found**2)):.2f} grey levels RMS over {len(found)} stretches")


if __name__ == "__main__":
    main()

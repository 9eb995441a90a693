#!/usr/bin/env python3
"""Checks through GDAL (rasterio) that writing on a wall is readable in a GIS, for both layouts of a panorama.

    python3 benches/check_gis.py target/release/tunnelstitch DIR

Simulates a wall with a letter F, stitches it from the true poses, warps the GeoTIFFs to north-up, and correlates them with the
letter and with its mirror image, in all four directions. Prints the correlations; ends with status 1 if a picture is mirrored.

Needs from PyPI: numpy, pillow, rasterio.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
import rasterio
from PIL import Image, ImageDraw
from rasterio.transform import from_bounds
from rasterio.warp import Resampling, reproject

PX_PER_METRE = 100
# Least correlation of the letter with its picture, and least distance to that of the mirrored one.
MIN_NCC, MIN_DISTANCE = 0.9, 0.1


def letter():
    """A letter that is none of its mirror images, one metre wide."""
    picture = Image.new("L", (400, 400), 90)
    draw = ImageDraw.Draw(picture)
    for box in ([120, 60, 170, 340], [120, 60, 300, 110], [120, 180, 250, 225]):
        draw.rectangle(box, fill=240)
    return picture


def max_ncc(picture, template):
    """Largest normalised cross-correlation over all places."""

    def correlated(a, b):
        return np.fft.irfft2(np.fft.rfft2(a) * np.conj(np.fft.rfft2(b, a.shape)), a.shape)

    centred, ones = template - template.mean(), np.ones_like(template)
    variance = correlated(picture**2, ones) - correlated(picture, ones) ** 2 / template.size
    ncc = correlated(picture, centred) / np.sqrt(np.maximum(variance, 1e3) * (centred**2).sum())
    height, width = template.shape
    return ncc[: picture.shape[0] - height, : picture.shape[1] - width].max()


def north_up(path):
    """The first band of a GeoTIFF, warped so that x goes to the right and y up."""
    with rasterio.open(path) as raster:
        corners = [raster.transform * corner for corner in [(0, 0), (raster.width, raster.height)]]
        (west, east), (south, north) = [sorted(values) for values in zip(*corners)]
        size = [round((south_east - north_west) * PX_PER_METRE)
                for north_west, south_east in [(west, east), (south, north)]]
        warped = np.zeros(size[::-1])
        reproject(raster.read(1).astype(float), warped, src_transform=raster.transform, src_crs=raster.crs,
                  dst_transform=from_bounds(west, south, east, north, *size), dst_crs=raster.crs,
                  resampling=Resampling.bilinear)
    return warped


def main():
    program, folder = sys.argv[1], Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    texture, survey = folder / "letter.png", folder / "survey"
    letter().save(texture)
    subprocess.run([program, "simulate", "free", "--frames", "14", "--size", "320x240", "--texture", texture,
                    "--texture-width-m", "1", "--light", "even", "--out", survey, "--force", "--quiet"], check=True)
    template = np.asarray(letter().resize((PX_PER_METRE, PX_PER_METRE), Image.BOX)).astype(float)
    failed = False
    for layout in ["theta-right", "chainage-right"]:
        out = folder / f"{layout}.tif"
        subprocess.run([program, "stitch", survey, "--poses", "truth", "--out", out, "--layout", layout,
                        "--px-per-metre", str(PX_PER_METRE), "--quiet"], check=True)
        picture = north_up(out)
        readable, mirrored = [max(max_ncc(picture, np.rot90(form, k)) for k in range(4))
                              for form in (template, template[:, ::-1])]
        print(f"{layout}: correlation {readable:.3f} as written, {mirrored:.3f} mirrored")
        failed |= readable < MIN_NCC or readable - mirrored < MIN_DISTANCE
    sys.exit(bool(failed))


main()

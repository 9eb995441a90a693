#!/usr/bin/env python3
"""Checks what `tunnelstitch stitch` writes through the programs of others: GDAL (rasterio), rio-cogeo, tifffile, Pillow.

    tunnelstitch stitch SURVEY --out DIR/panorama.tif --dzi DIR/panorama.dzi --maps DIR
    python3 benches/check_raster.py DIR/*.tif DIR/*.dzi

For every .tif: rio-cogeo's validation without errors or warnings, the blocks' leaders and trailers and their order, the
geotransform, unit and axes of the plane, every tile through tifffile, the pixels through GDAL in windows, and every
overview against the level before it. For every .dzi: all tiles of all levels and their sizes. Prints what was verified; ends with status 1 if anything is wrong.

Needs from PyPI: imagecodecs, numpy, pillow, rasterio, rio-cogeo, tifffile.
"""

import re
import sys
import warnings
from pathlib import Path

import numpy as np
import rasterio
import tifffile
from PIL import Image
from rasterio.enums import MaskFlags
from rasterio.errors import NotGeoreferencedWarning
from rasterio.windows import Window
from rio_cogeo.cogeo import cog_validate

EDGE = 512
# Largest mean absolute difference of JPEG's 8-bit samples that are covered, the example's quality.
JPEG_MEAN = 6.0


class Wrong(Exception):
    """Something is not as it should be."""


def demand(condition, what):
    if not condition:
        raise Wrong(what)


def same(left, right):
    return np.array_equal(left, right, equal_nan=left.dtype.kind == "f")


def coverage(pixels, alpha, nodata):
    """Which samples (rows, columns, channels) are something, and the channels."""
    if alpha:
        channels = pixels[..., :-1]
        return np.broadcast_to(pixels[..., -1:] > 0, channels.shape), channels
    if nodata is None:
        return np.ones(pixels.shape, bool), pixels
    return (~np.isnan(pixels) if np.isnan(nodata) else pixels != nodata), pixels


def reduced(channels, covered, first):
    """Twice as small: the mean of what is covered, or the first of it; and what is covered."""
    rows, columns = channels.shape[:2]
    pad = ((0, rows % 2), (0, columns % 2), (0, 0))
    channels, covered = np.pad(channels, pad), np.pad(covered, pad)
    corners = [(slice(y, None, 2), slice(x, None, 2)) for y in (0, 1) for x in (0, 1)]
    count = sum(covered[c].astype(np.int64) for c in corners)
    if first:
        out = np.zeros_like(channels[corners[0]])
        for c in reversed(corners):
            out = np.where(covered[c], channels[c], out)
        return out, count > 0
    wide = np.float64 if channels.dtype.kind == "f" else np.int64
    total = sum(np.where(covered[c], channels[c], 0).astype(wide) for c in corners)
    some = np.maximum(count, 1)
    mean = total / some if wide is np.float64 else (total + count // 2) // some
    return mean.astype(channels.dtype), count > 0


def check_blocks(path):
    """Leader, trailer and order of the blocks; every tile through tifffile. Says how many there are."""
    with tifffile.TiffFile(path) as tif:
        pages = list(tif.pages)
        head = path.read_bytes()[: 1 << 12]
        ghost = re.search(rb"GDAL_STRUCTURAL_METADATA_SIZE=(\d{6}) bytes\n", head)
        demand(ghost and ghost.start() == 16, "no ghost area behind the header")
        text = head[ghost.end() : ghost.end() + int(ghost[1])].decode()
        for line in ("LAYOUT=IFDS_BEFORE_DATA", "BLOCK_LEADER=SIZE_AS_UINT4", "BLOCK_TRAILER=LAST_4_BYTES_REPEATED"):
            demand(line in text.split("\n"), f"{line} is missing")
        # The end of the text is that of its last line.
        demand(text.endswith("\n") or text.endswith("\n "), "the ghost area's size is wrong")
        masked = any(page.subfiletype & 4 for page in pages)
        demand(masked == ("MASK_INTERLEAVED_WITH_IMAGERY=YES" in text), "the mask's line is wrong")
        levels = len(pages) // (2 if masked else 1)
        steps = [pages[i * 2 : i * 2 + 2] if masked else pages[i : i + 1] for i in range(levels)]
        at, blocks, sparse = None, 0, 0
        with open(path, "rb") as file:
            for step in reversed(steps):
                for places in zip(*(zip(page.dataoffsets, page.databytecounts) for page in step)):
                    for offset, count in places:
                        if count == 0:
                            demand(offset == 0, "a tile without bytes has a place")
                            sparse += 1
                            continue
                        file.seek(offset - 4)
                        demand(at in (None, file.tell()), "a block does not follow the one before")
                        leader, block, trailer = file.read(4), file.read(count), file.read(4)
                        demand(leader == count.to_bytes(4, "little"), "a leader is wrong")
                        demand(trailer == block[-4:], "a trailer is wrong")
                        at, blocks = offset + count + 4, blocks + 1
        demand(at is None or at == path.stat().st_size, "the file goes on behind its last block")
        for page in pages:
            page.asarray()
    return f"{blocks} blocks in order, {sparse} sparse"


def level_pixels(path, level, masked):
    """Pixels (rows, columns, samples) of a level through GDAL; a mask comes as alpha."""
    with rasterio.open(path, **({} if level == 0 else {"overview_level": level - 1})) as src:
        pixels = np.moveaxis(src.read(), 0, -1)
        if masked:
            mask = src.dataset_mask()[..., None]
            demand(set(np.unique(mask)) <= {0, 255}, "the mask is neither 0 nor 255")
            pixels = np.concatenate([pixels, mask], axis=2)
    return pixels


def check_tif(path):
    said = []
    valid, errors, notes = cog_validate(path, strict=True)
    demand(valid and not errors and not notes, f"rio-cogeo: {errors} {notes}")
    said.append("rio-cogeo: valid, no warnings")
    said.append(check_blocks(path))
    with rasterio.open(path) as src:
        jpeg = src.profile.get("compress") == "jpeg"
        masked = src.mask_flag_enums[0] == [MaskFlags.per_dataset]
        alpha = masked or MaskFlags.alpha in src.mask_flag_enums[0]
        nodata, factors, dtype = src.nodata, src.overviews(1), np.dtype(src.dtypes[0])
        first = dtype == np.uint32
        t = src.transform
        crs = src.crs.to_wkt() if src.crs else ""
        axes = re.findall(r'AXIS\["([^"]+)",(\w+)\]', crs)
        demand(axes == [("Chainage", "EAST"), ("Arc length", "NORTH")], f"the axes are {axes}")
        demand('UNIT["metre",1' in crs, "the unit is no metre")
        said.append(f"origin ({t.c}, {t.f}), steps ({t.a}, {t.e}), {crs[:12]}… crs with its axes")
        pixels = level_pixels(path, 0, masked)
        right, lower = src.width - 130, src.height - 45
        for window in (Window(right // 3, lower // 2, 77, 43), Window(right, lower, 130, 45)):
            part = np.moveaxis(src.read(window=window), 0, -1)
            rows, columns = window.toslices()
            demand(same(part, pixels[rows, columns, : part.shape[2]]), "a window differs from the whole")
    covered, channels = coverage(pixels, alpha, nodata)
    for level in range(1, len(factors) + 1):
        channels, covered = reduced(channels, covered, first)
        pixels = level_pixels(path, level, masked)
        found, values = coverage(pixels, alpha, nodata)
        demand(values.shape == channels.shape, f"overview {level} is of the wrong size")
        demand(jpeg and not alpha or same(found, covered), f"overview {level} covers other pixels")
        off = np.abs(values[covered].astype(float) - channels[covered])
        off = off.mean() if off.size else 0.0
        demand(off < JPEG_MEAN if jpeg else off == 0, f"overview {level} is off by {off:.3f}")
    if factors:
        said.append(f"overviews {factors} {'close' if jpeg else 'exact'}")
    return said


def check_dzi(path):
    text = path.read_text()
    width, height = (int(re.search(rf'{name}="(\d+)"', text)[1]) for name in ("Width", "Height"))
    kind = re.search(r'Format="(\w+)"', text)[1]
    folder = path.with_name(path.stem + "_files")
    top = max(width, height) - 1
    levels = top.bit_length() + 1
    demand(len(list(folder.iterdir())) == levels, f"there are not {levels} levels")
    before, count = None, 0
    for level in reversed(range(levels)):
        scale = 1 << (levels - 1 - level)
        columns, rows = -(-width // scale), -(-height // scale)
        whole = None
        across, down = -(-columns // EDGE), -(-rows // EDGE)
        demand(len(list((folder / str(level)).iterdir())) == across * down, f"level {level} has not all tiles")
        for row in range(down):
            for column in range(across):
                tile = np.asarray(Image.open(folder / str(level) / f"{column}_{row}.{kind}"))
                tile = tile.reshape(*tile.shape[:2], -1)
                if whole is None:
                    whole = np.zeros((rows, columns, tile.shape[2]), np.uint8)
                place = whole[row * EDGE : (row + 1) * EDGE, column * EDGE : (column + 1) * EDGE]
                demand(tile.shape == place.shape, f"tile {column}, {row} of level {level} is of the wrong size")
                place[:] = tile
                count += 1
        if kind == "png":
            alpha = whole.shape[2] in (2, 4)
            if before is not None:
                channels, covered = reduced(before[1], before[0], False)
                found, values = coverage(whole, alpha, None)
                demand(same(values, channels) and same(found, covered), f"level {level} is wrong")
            before = coverage(whole, alpha, None)
    return [f"{levels} levels, {count} tiles, {'levels exact' if kind == 'png' else 'all decoded'}"]


def main():
    warnings.simplefilter("ignore", NotGeoreferencedWarning)
    failed = False
    for path in map(Path, sys.argv[1:]):
        try:
            said = check_tif(path) if path.suffix == ".tif" else check_dzi(path)
            print(f"{path.name}: " + "; ".join(said))
        except Wrong as wrong:
            print(f"{path.name}: WRONG: {wrong}")
            failed = True
    sys.exit(failed)


if __name__ == "__main__":
    main()

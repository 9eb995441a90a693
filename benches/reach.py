#!/usr/bin/env python3
"""How close to the Cramér–Rao bound an estimate can come that does not know the wall's texture beforehand.

    python3 benches/reach.py brick concrete

The bound (`converge --efficiency`) takes the slopes of the texture for known. Here the texture is a Gaussian process with the
wall's own spectrum P, that of a frame with eight times as many pixels along each axis, and what a frame's pixels show at a
frequency is the sum of all frequencies g that look alike to them. For N frames at sub-pixel places x_i, the values at one
frequency have the covariance

    C = Σ_g P(g) a_g a_gᴴ + σ² I,    a_g = (exp(2πi g·x_i))_i,

and the Fisher information of the places is F_ij = tr(C⁻¹ ∂_i C C⁻¹ ∂_j C) (Bangs), with the texture integrated out; with the
slopes known it is J = 2 Σ_g (2πg)² P(g)/σ² (I − 11ᵀ/N). Printed: √(tr F⁻¹/tr J⁻¹) of what frames are displaced against one
another, along the wall, around it, and both, over places drawn at random.

Source: W. J. Bangs, "Array processing with generalized beamformers", thesis, Yale, 1971. Needs the program built
(`cargo build --release`), numpy and pillow (PyPI).
"""
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

FINER = 8  # times as many pixels along each axis as a frame of 640 × 480 has
FIELD_OF_VIEW = np.degrees(2 * np.arctan(0.25 * np.tan(np.radians(30))))  # of the middle quarter of 60°
PATCH = 64  # side of the patches whose spectra are averaged, pixels of a frame
ALIASES = 3  # multiples of the sampling frequency to either side
FREQUENCIES, PLACES = 800, 6  # drawn at random
FRAMES = (5, 10)  # that see a point of the wall
NOISE = (1, 2, 4)  # grey levels


def wall_spectrum(wall):
    """Power spectral density of what pixels see, (grey level)² px², and its frequencies, cycles/px."""
    with tempfile.TemporaryDirectory() as folder:
        survey = Path(folder) / "s"
        command = ["target/release/tunnelstitch", "--quiet", "simulate", "centred", "--wall", wall, "--noise", "0"]
        # The middle quarter of a frame, where a pixel of it is square on the wall.
        command += ["--size", f"{160 * FINER}x{120 * FINER}", "--fov-deg", f"{FIELD_OF_VIEW}", "--out", str(survey)]
        subprocess.run(command, check=True)
        files = sorted((survey / "frames").iterdir())
        pictures = [np.asarray(Image.open(file).convert("L"), float) for file in files]
    side = PATCH * FINER
    window = np.outer(np.hanning(side), np.hanning(side))
    patches = [
        picture[y:y + side, x:x + side]
        for picture in pictures
        for y in range(0, picture.shape[0] - side + 1, side // 2)
        for x in range(0, picture.shape[1] - side + 1, side // 2)
    ]
    spectra = [np.abs(np.fft.fft2((patch - patch.mean()) * window)) ** 2 for patch in patches]
    density = np.mean(spectra, axis=0) / (window**2).sum() / FINER**2
    frequency = np.fft.fftfreq(side) * FINER
    return density * np.outer(np.sinc(frequency), np.sinc(frequency)) ** 2


def information(density, frames, noise, random):
    """F and J of displacements along the wall, then around it (2N × 2N)."""
    alias = np.arange(-ALIASES, ALIASES + 1)
    alias = np.array([(a, b) for a in alias for b in alias])
    none = np.zeros((2 * frames, 2 * frames))
    found, known = none.copy(), none.copy()
    difference = np.eye(frames) - 1 / frames
    for _ in range(FREQUENCIES):
        base = random.integers(-PATCH // 2, PATCH // 2, 2)
        places = (base + PATCH * alias) % (PATCH * FINER)
        power = density[places[:, 0], places[:, 1]]
        slopes = 2 * np.pi * (base / PATCH + alias)
        for axis in (0, 1):
            own = slice(axis * frames, (axis + 1) * frames)
            known[own, own] += PLACES * 2 * (slopes[:, axis] ** 2 * power).sum() / noise**2 * difference
        for _ in range(PLACES):
            shown = np.exp(1j * random.uniform(0, 1, (frames, 2)) @ slopes.T)
            inverse = np.linalg.inv((shown * power) @ shown.conj().T + noise**2 * np.eye(frames))
            changes = []
            for axis in (0, 1):
                rows = (1j * shown * slopes[:, axis] * power) @ shown.conj().T
                for k in range(frames):
                    change = np.zeros_like(rows)
                    change[k] = rows[k]
                    changes.append(inverse @ (change + change.conj().T))
            changes = np.array(changes)
            found += np.einsum("aij,bji->ab", changes, changes).real
    return found, known


def variances(information, frames):
    """Mean variance of the displacements against one another along the wall and around it."""
    apart = np.linalg.svd(np.eye(frames) - 1 / frames)[0][:, : frames - 1]
    blocks = (information[:frames, :frames], information[frames:, frames:])
    return np.array([np.trace(np.linalg.inv(apart.T @ block @ apart)) for block in blocks])


def main():
    for wall in sys.argv[1:] or ["brick", "concrete"]:
        density = wall_spectrum(wall)
        for noise in NOISE:
            for frames in FRAMES:
                random = np.random.default_rng(1)
                found, known = (variances(i, frames) for i in information(density, frames, noise, random))
                along, around = np.sqrt(found / known)
                both = np.sqrt(found.sum() / known.sum())
                print(f"{wall}, noise {noise}, {frames} frames: {along:.2f} along, {around:.2f} around, {both:.2f} × the bound")


if __name__ == "__main__":
    main()

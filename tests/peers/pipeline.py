"""The host's maps as carefully as numpy and scipy can: a peer that checks ours and is timed against them.

    pipeline.py FOLDER

FOLDER holds `case.json` (sizes and settings), `ours.npz` (our inputs and results) and, for raw samples, `words.bin`. It first
compares its results with ours and prints one line of JSON with the largest differences, or fails. Then for every line `run N`
on its input it computes N times and prints one line of JSON: the least time of each stage in microseconds.

One thread, complex64, transforms in place. What does not depend on the samples is computed once.
"""

import json
import os
import sys
import time
from pathlib import Path

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[threads] = "1"

import numpy as np
import scipy.fft

# Largest differences that pass: powers as amplitudes relative to full scale, squares of 0 to 1, covariance relative to
# its largest element.
POWER_BOUND = 3e-6
SQUARE_BOUND = 2e-3
COVARIANCE_BOUND = 1e-4
# The scale of a bridge's maps, whose ends powers are clamped to.
FLOOR_DB, STEP_DB = -130.0, 0.5


def hann(length, total):
    return (total / length * (1 - np.cos(2 * np.pi * (np.arange(length) + 0.5) / length))).astype(np.float32)


def axis(cells, points):
    """Weights of one axis, points x cells: linear interpolation where it grows, means where it shrinks."""
    step = cells / points
    width = max(step, 1.0)
    centre = (np.arange(points) + 0.5) * step
    cell = np.arange(cells)
    low, high = cell.astype(float), cell + 1.0
    low[0], high[-1] = -np.inf, np.inf
    start, end = (centre - width / 2)[:, None], (centre + width / 2)[:, None]
    return (np.clip(np.minimum(end, high) - np.maximum(start, low), 0, None) / width).astype(np.float32)


class Square:
    """A map to points x points of 0 to 1."""

    def __init__(self, rows, columns, points):
        self.rows, self.columns = axis(rows, points), np.ascontiguousarray(axis(columns, points).T)
        self.wide = np.empty((rows, points), np.float32)
        self.out = np.empty((points, points), np.float32)

    def __call__(self, levels):
        np.matmul(levels, self.columns, out=self.wide)
        np.matmul(self.rows, self.wide, out=self.out)
        least = self.out.min()
        self.out -= least
        most = self.out.max()
        if most > 0:
            self.out *= 1 / most
        return self.out


class Music:
    """Signal-subspace MUSIC over azimuth x elevation of a covariance, forward-backward averaged, order by MDL."""

    def __init__(self, positions, points, snapshots=64):
        angle = np.radians(np.linspace(-60, 60, points))
        x, y = np.array(positions, float).T
        u = np.sin(angle)[None, :] * np.cos(angle)[:, None]
        w = np.broadcast_to(np.sin(angle)[:, None], u.shape)
        phase = -np.pi * (x[:, None] * u.reshape(1, -1) + y[:, None] * w.reshape(1, -1))
        self.steering = np.exp(1j * phase).astype(np.complex64)
        self.n, self.snapshots, self.points = len(x), snapshots, points
        flipped = [(x.max() + x.min() - a, y.max() + y.min() - b) for a, b in zip(x, y)]
        self.opposite = [list(zip(x, y)).index(f) for f in flipped]

    def __call__(self, covariance):
        flipped = covariance[np.ix_(self.opposite, self.opposite)].conj()
        values, vectors = np.linalg.eigh((covariance + flipped) / 2)
        values = np.maximum(values[::-1], values[-1] * 1e-9)
        n, costs = self.n, []
        for k in range(n - 1):
            tail = values[k:]
            ratio = np.log(tail).mean() - np.log(tail.mean())
            costs.append(-self.snapshots * len(tail) * ratio + 0.5 * k * (2 * n - k) * np.log(self.snapshots))
        order = min(max(int(np.argmin(costs)), 1), 4)
        signal = np.ascontiguousarray(vectors[:, n - order :].conj().T).astype(np.complex64)
        projected = signal @ self.steering
        within = np.square(projected.real)
        within += np.square(projected.imag)
        within = within.sum(0)
        noise = np.maximum(n - within, np.float32(1e-6 * n))
        level = np.log10(noise, out=noise).reshape(self.points, self.points)
        level *= -10
        level -= level.min()
        level *= 1 / level.max()
        return level


class Stages:
    """Times from mark to mark, us."""

    def __init__(self):
        self.times = {}

    def start(self):
        self.last = time.perf_counter()

    def mark(self, name):
        now = time.perf_counter()
        self.times.setdefault(name, []).append((now - self.last) * 1e6)
        self.last = now


class Raw:
    """Words of one frame to three maps."""

    def __init__(self, case, folder):
        self.case = case
        n, loops = case["samples"], case["loops"]
        self.virtuals = case["slots"] * case["receivers"]
        self.words = np.frombuffer((folder / "words.bin").read_bytes(), np.int16).reshape(-1, n // 2, 4)
        self.window = hann(n, 1 / 32768)
        self.cube = np.empty((loops, self.virtuals, n), np.complex64)
        self.parts = self.cube.view(np.float32).reshape(-1, n // 2, 4)
        self.gated = slice(case["first"], case["first"] + case["bins"])
        self.doppler_window = hann(loops, 1.0)
        leakage = np.fft.fft(self.doppler_window.astype(np.float64))
        self.leakage = {k: np.complex64(leakage[k]) for k in (0, 1, -1)}
        signed = (np.arange(loops) + loops // 2) % loops - loops // 2
        slot = np.arange(self.virtuals) // case["receivers"]
        self.turn = np.exp(-2j * np.pi * signed[:, None] * slot / (case["slots"] * loops)).astype(np.complex64)
        self.moves = np.abs(signed) > case["guard"]
        self.threshold = np.float32(10 ** (case["detection_db"] / 10))
        points = case["points"]
        self.squares = [Square(case["bins"], columns, points) for columns in (loops, case["columns"])]
        self.music = Music(case["positions"], points)

    def __call__(self, stages):
        case, virtuals = self.case, self.virtuals
        loops, bins, columns = case["loops"], case["bins"], case["columns"]
        stages.start()
        # Q0 Q1 I0 I1 to I0 Q0 I1 Q1, then the window in place.
        for to, word in enumerate((2, 0, 3, 1)):
            self.parts[..., to] = self.words[..., word]
        np.multiply(self.cube, self.window, out=self.cube)
        spectra = scipy.fft.fft(self.cube, axis=2, overwrite_x=True, workers=1)
        stages.mark("range")

        spectra = spectra[:, :, self.gated]
        # Behind the window the static part is bin 0; a Hann window has three bins.
        first = spectra[:, :: case["receivers"]]
        mean = np.tensordot(self.doppler_window, first, 1)
        still = first - mean
        squared = np.square(still.view(np.float32)).reshape(columns, -1, 2 * bins).sum(1)
        time_power = np.ascontiguousarray((squared[:, ::2] + squared[:, 1::2]).T)
        time_power *= np.float32(columns / (loops * case["slots"]))
        weighed = spectra * self.doppler_window[:, None, None]
        doppler = scipy.fft.fft(weighed, axis=0, overwrite_x=True, workers=1)
        static = doppler[0].copy()
        for k, leak in self.leakage.items():
            doppler[k] -= static * leak
        parts = doppler.view(np.float32)
        squared = np.einsum("dvr,dvr->dr", parts, parts)
        power = squared[:, ::2] + squared[:, 1::2]
        power *= np.float32(1 / virtuals)
        stages.mark("doppler")

        by_bin = np.ascontiguousarray(power.T)
        noise = by_bin.reshape(bins, 8, -1).mean(2).min(1)
        moving = (by_bin > noise[:, None] * self.threshold) & self.moves
        for row in np.flatnonzero(moving.sum(1) > 8):
            weak = np.argsort(np.where(moving[row], by_bin[row], -1))[:-8]
            moving[row, weak] = False
        cells, dopplers = np.nonzero(moving)
        snapshots = doppler[dopplers, :, cells] * self.turn[dopplers]
        covariance = snapshots.T @ snapshots.conj() / max(len(cells), 1)
        rows, starts = np.unique(cells, return_index=True)
        of_bins = np.zeros((bins, virtuals, virtuals), np.complex64)
        if len(cells):
            outer = snapshots[:, :, None] * snapshots[:, None, :].conj()
            of_bins[rows] = np.add.reduceat(outer, starts)
        stages.mark("covariance")

        range_doppler = np.concatenate((by_bin[:, loops // 2 :], by_bin[:, : loops // 2]), 1)
        squares = [square(levels(p)) for square, p in zip(self.squares, (range_doppler, time_power))]
        stages.mark("squares")
        angle = self.music(covariance)
        stages.mark("angle")
        return {
            "range_doppler": range_doppler,
            "range_time": time_power,
            "covariance": covariance,
            "cells": len(cells),
            "square_doppler": squares[0],
            "square_time": squares[1],
            "angle": angle,
        }


def levels(power):
    with np.errstate(divide="ignore"):
        level = np.log10(power)
    level *= 10 / STEP_DB
    level -= FLOOR_DB / STEP_DB
    return np.clip(level, 0, 255, out=level)


class Packets:
    """A bridge's codes and covariance to three maps."""

    def __init__(self, case, ours):
        points = case["points"]
        self.codes = [ours["codes_doppler"], ours["codes_time"]]
        self.squares = [Square(*codes.shape, points) for codes in self.codes]
        self.covariance = ours["covariance"]
        self.music = Music(case["positions"], points)

    def __call__(self, stages):
        stages.start()
        squares = [square(codes.astype(np.float32)) for square, codes in zip(self.squares, self.codes)]
        stages.mark("squares")
        angle = self.music(self.covariance)
        stages.mark("angle")
        return {"square_doppler": squares[0], "square_time": squares[1], "angle": angle}


def amplitude(got, want):
    return float(np.abs(np.sqrt(got) - np.sqrt(want)).max())


def compare(got, ours):
    """Largest differences by result; fails where one is over its bound."""
    differences = {}
    for name in ("range_doppler", "range_time"):
        if name in got:
            differences[name] = (amplitude(got[name], ours[name]), POWER_BOUND)
    if "cells" in got:
        largest = np.abs(ours["covariance"]).max()
        difference = np.abs(got["covariance"] - ours["covariance"]).max() / largest
        differences["covariance"] = (float(difference), COVARIANCE_BOUND)
    for name in ("square_doppler", "square_time"):
        differences[name] = (float(np.abs(got[name] - ours[name]).max()), SQUARE_BOUND)
    over = {name: d for name, d in differences.items() if not d[0] <= d[1]}
    if over:
        sys.exit(f"differs from ours by (difference, bound): {over}")
    return {name: difference for name, (difference, _) in differences.items()}


def main():
    folder = Path(sys.argv[1])
    case = json.loads((folder / "case.json").read_text())
    ours = np.load(folder / "ours.npz")
    work = Packets(case, ours) if "codes_doppler" in ours else Raw(case, folder)
    print(json.dumps(compare(work(Stages()), ours)), flush=True)
    for line in sys.stdin:
        _, count = line.split()
        stages = Stages()
        for _ in range(int(count)):
            work(stages)
        print(json.dumps({name: min(t) for name, t in stages.times.items()}), flush=True)


if __name__ == "__main__":
    main()

"""Pseudo-spectra of spatial covariances by numpy and scipy, to compare RF-HOI's with. Nothing of RF-HOI's code is used.

Usage: music.py IN.npz OUT.npz

IN, for each case NAME:
  NAME.covariance  (F, N, N) complex: F covariances R = mean(x x^H)
  NAME.antennas    (N, 3) int: x to the right, y upwards in half wavelengths, sign by which samples are multiplied
  NAME.azimuth     (A,) degrees to the right, NAME.elevation (E,) degrees upwards
  NAME.settings    (method, forward_backward, columns, rows, loading); method 0 Bartlett, 1 Capon, 2 MUSIC;
                   columns x rows is the subarray of spatial smoothing, 0 for none
  NAME.order       (F,) number of sources of MUSIC

OUT, for each case: NAME (F, E, A) dB. A wave from direction cosines u (right), w (up) reaches antenna (x, y) with phase
-pi (x u + y w). Bartlett: a^H R a / N^2. Capon: 1 / (a^H (R + loading tr(R) / N)^-1 a). MUSIC: N / |En^H a|^2.
"""

import sys

import numpy as np
import scipy.linalg


def steering(positions, azimuth, elevation):
    """(E, A, N)"""
    el, az = np.meshgrid(np.radians(elevation), np.radians(azimuth), indexing="ij")
    direction = np.stack([np.sin(az) * np.cos(el), np.sin(el)], axis=-1)
    return np.exp(-1j * np.pi * (direction @ positions.T))


def smooth(r, positions, columns, rows):
    """The mean of R over all complete rectangles, and the positions of one."""
    cells = [(x, y) for y in range(rows) for x in range(columns)]
    index = {tuple(p): i for i, p in reversed(list(enumerate(positions)))}
    found = []
    for x0, y0 in sorted(index):
        places = [index.get((x0 + x, y0 + y)) for x, y in cells]
        if None not in places:
            found.append(r[np.ix_(places, places)])
    return np.mean(found, axis=0), np.array(cells)


def forward_backward(r, positions):
    total = positions.min(axis=0) + positions.max(axis=0)
    mirror = [next(j for j, q in enumerate(positions) if (p + q == total).all()) for p in positions]
    exchange = np.eye(len(positions))[mirror]
    return (r + exchange @ r.conj() @ exchange) / 2


def spectrum(r, antennas, azimuth, elevation, settings, order):
    method, averaged, columns, rows, loading = settings
    positions, signs = antennas[:, :2], antennas[:, 2]
    r = r * np.outer(signs, signs)
    if columns:
        r, positions = smooth(r, positions, int(columns), int(rows))
    if averaged:
        r = forward_backward(r, positions)
    n = len(positions)
    a = steering(positions, azimuth, elevation)
    if method == 0:
        power = np.einsum("eai,ij,eaj->ea", a.conj(), r, a, optimize=True).real / n**2
    elif method == 1:
        loaded = r + loading * np.trace(r).real / n * np.eye(n)
        factor = scipy.linalg.cholesky(loaded, lower=True)
        whitened = scipy.linalg.solve_triangular(factor, a.reshape(-1, n).T, lower=True)
        power = (1 / np.sum(np.abs(whitened) ** 2, axis=0)).reshape(a.shape[:2])
    else:
        _, vectors = scipy.linalg.eigh(r)
        noise = vectors[:, : n - order]
        power = n / np.sum(np.abs(a @ noise.conj()) ** 2, axis=-1)
    return 10 * np.log10(power)


def main(source, target):
    given = np.load(source)
    names = sorted(key[: -len(".covariance")] for key in given if key.endswith(".covariance"))
    maps = {}
    for name in names:
        get = lambda field: given[f"{name}.{field}"]
        maps[name] = np.array(
            [
                spectrum(
                    r.astype(np.complex128),
                    get("antennas").astype(float).astype(int),
                    get("azimuth").astype(np.float64),
                    get("elevation").astype(np.float64),
                    get("settings"),
                    int(order),
                )
                for r, order in zip(get("covariance"), get("order"))
            ]
        )
    np.savez(target, **maps)


main(*sys.argv[1:])

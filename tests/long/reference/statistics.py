"""Compares two renderers by the means of tiles of pixels."""

import math

import numpy as np

TILE = 16
# Relative difference of the renderers' lookups in the same picture: an error that more samples do not reduce.
INTERPOLATION = 0.0003


def tiles(picture):
    """Means of the tiles and of the whole picture, luminance of each."""
    luminance = picture @ [0.2126, 0.7152, 0.0722]
    n = luminance.shape[0] // TILE
    means = luminance[: n * TILE, : n * TILE].reshape(n, TILE, n, TILE).mean((1, 3)).ravel()
    return np.append(means, luminance.mean())


def critical_t(degrees, probability):
    """Value that the magnitude of Student's t exceeds with this probability, by bisection of its tail's integral."""

    def tail(t):
        x = np.tan(np.linspace(math.atan(t), math.pi / 2, 20001))[:-1]
        log_norm = math.lgamma((degrees + 1) / 2) - math.lgamma(degrees / 2) - 0.5 * math.log(degrees * math.pi)
        density = np.exp(log_norm - (degrees + 1) / 2 * np.log1p(x * x / degrees))
        return 2 * np.sum(0.5 * (density[1:] + density[:-1]) * np.diff(x))

    low, high = 0.0, 1e3
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if tail(middle) > probability else (low, middle)
    return high


def compare(ours, theirs, false_alarms, allowed=0.0):
    """Compares lists of independent pictures. Returns the largest deviation of a tile in units of what chance would
    exceed with the probability `false_alarms` anywhere in the picture (above 1: they differ), the relative difference
    of the whole picture, and the standard error of that difference. `allowed`: relative difference of a tile that is
    not counted."""
    a, b = (np.array([tiles(picture) for picture in pictures]) for pictures in (ours, theirs))
    error = np.sqrt(a.var(0, ddof=1) / len(a) + b.var(0, ddof=1) / len(b))
    # The fewest degrees of freedom that Welch's test can have: a bound that errs on the side of fewer alarms.
    degrees = min(len(a), len(b)) - 1
    least = critical_t(degrees, false_alarms / a.shape[1])
    # Both interpolate the environment's picture, whose pixels are at different places: not the errors of samples alone.
    error = np.maximum(error, INTERPOLATION * b.mean(0) + 1e-12)
    deviation = np.maximum(np.abs(a.mean(0) - b.mean(0)) - allowed * b.mean(0), 0) / error
    whole = b[:, -1].mean()
    return deviation.max() / least, (a[:, -1].mean() - whole) / whole, error[-1] / whole

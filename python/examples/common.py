"""Shapes, directions and files that the examples share."""

import argparse
import struct
import zlib

import numpy as np


def arguments(about, output, size, takes_file=False):
    """Reads the command line: the file to write, and a size that each example explains."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("-o", "--output", default=output, help="default: %(default)s")
    parser.add_argument("--size", type=int, default=size, help="default: %(default)s")
    if takes_file:
        parser.add_argument("file", nargs="?")
    return parser.parse_args()


def box(low, high):
    """A box between two corners: vertices (8, 3), triangles (12, 3), whose normals point outwards."""
    corner = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij")).reshape(3, 8).T
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return np.where(corner, high, low).astype(np.float32), quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


def torus_knot(n_along=256, n_around=32, thickness=0.35):
    """A closed tube along the knot (2, 3): vertices (N, 3), triangles (M, 3), normals (N, 3)."""
    t = np.linspace(0, 2 * np.pi, n_along, endpoint=False)
    radius = 2 + np.cos(3 * t)
    middle = np.stack([radius * np.cos(2 * t), radius * np.sin(2 * t), -np.sin(3 * t)], axis=1)
    along = np.roll(middle, -1, axis=0) - np.roll(middle, 1, axis=0)
    side = np.cross(along, middle * [1, 1, 0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(side, along)
    other /= np.linalg.norm(other, axis=1, keepdims=True)
    turn = np.linspace(0, 2 * np.pi, n_around, endpoint=False)[:, None]
    normals = np.cos(turn) * side[:, None] + np.sin(turn) * other[:, None]
    vertices = middle[:, None] + thickness * normals
    i, j = np.meshgrid(np.arange(n_along), np.arange(n_around), indexing="ij")
    at = lambda i, j: (i % n_along * n_around + j % n_around).reshape(-1)  # noqa: E731
    a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
    triangles = np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)])
    return vertices.reshape(-1, 3).astype(np.float32), triangles, normals.reshape(-1, 3).astype(np.float32)


def cosine_rays(points, normals, n, seed=1):
    """Rays (N, n, 6) from points (N, 3) over their hemispheres, the more the closer to the normal."""
    sphere = np.random.default_rng(seed).normal(size=(len(points), n, 3)).astype(np.float32)
    sphere /= np.linalg.norm(sphere, axis=2, keepdims=True)
    directions = normals[:, None] + 0.999 * sphere
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    return np.concatenate([np.broadcast_to(points[:, None], directions.shape), directions], axis=2)


def write_png(path, pixels):
    """Writes (height, width, 3) or (height, width) values: uint8, or floats from 0 to 1."""
    if pixels.dtype != np.uint8:
        pixels = np.uint8(np.clip(pixels, 0, 1) * 255 + 0.5)
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[..., None], 3, axis=2)
    height, width, _ = pixels.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)))
        file.write(chunk(b"IDAT", zlib.compress(rows.tobytes())) + chunk(b"IEND", b""))
    print(path)

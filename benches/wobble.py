#!/usr/bin/env python3
"""Writes a glTF file for `kdray bench motion`: above a floor, a glass knot that a skin of eight joints deforms.

    python3 benches/wobble.py knot.glb [--along 613] [--around 158]

The knot has 2 * along * around triangles, by default 193,708, and the floor two. The animation takes four seconds.
"""

import argparse
import json
import struct

import numpy as np

N_JOINTS = 8
HEIGHT = 0.62
FLOAT, BYTE, WORD = 5126, 5121, 5125


class Arrays:
    """The buffer of a glTF file, with the accessors of its arrays."""

    def __init__(self):
        self.bytes, self.views, self.accessors = b"", [], []

    def add(self, array, component, kind):
        """Appends an array, one row per element, and returns the index of its accessor."""
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.bytes), "byteLength": array.nbytes})
        self.bytes += array.tobytes()
        accessor = {"bufferView": len(self.views) - 1, "componentType": component, "type": kind, "count": len(array)}
        if component == FLOAT:
            bounds = (("min", np.min), ("max", np.max))
            accessor |= {name: np.atleast_1d(bound(array, 0)).tolist() for name, bound in bounds}
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def knot(n_along, n_around):
    """Positions, normals and faces of a tube around a knot."""

    def middle(t):
        radius = 1 + 0.4 * np.cos(3 * t)
        return np.stack([radius * np.cos(2 * t), 0.4 * np.sin(3 * t) + HEIGHT, radius * np.sin(2 * t)], -1)

    def unit(v):
        return v / np.linalg.norm(v, axis=-1, keepdims=True)

    t = np.linspace(0, 2 * np.pi, n_along, endpoint=False)
    along = unit(middle(t + 1e-3) - middle(t - 1e-3))
    u = unit(np.cross(along, middle(t) * [1, 0, 1]))
    angle = np.linspace(0, 2 * np.pi, n_around, endpoint=False)[None, :, None]
    normals = u[:, None] * np.cos(angle) + np.cross(u, along)[:, None] * np.sin(angle)
    positions = middle(t)[:, None] + 0.15 * normals
    i, k = np.meshgrid(np.arange(n_along), np.arange(n_around), indexing="ij")
    row, next_row = i * n_around, (i + 1) % n_along * n_around
    a, b, c, d = row + k, next_row + k, next_row + (k + 1) % n_around, row + (k + 1) % n_around
    faces = np.concatenate([np.stack(corners, -1).reshape(-1, 3) for corners in ((a, c, b), (a, d, c))])
    positions, normals = (v.reshape(-1, 3).astype("f4") for v in (positions, normals))
    corners = positions[faces]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces_outwards = (sides * normals[faces[:, 0]]).sum() > 0
    return positions, normals, (faces if faces_outwards else faces[:, ::-1]).astype("u4")


def document(arrays, positions, normals, faces):
    """The glTF document of the knot, its skin and animation, and the floor."""
    centres = np.linspace(-1.6, 1.6, N_JOINTS)
    place = (positions[:, 0] + 1.6) / 3.2 * (N_JOINTS - 1)
    first = np.clip(np.floor(place), 0, N_JOINTS - 2)
    weight = np.clip(place - first, 0, 1)
    none = np.zeros_like(first)
    inverse = np.tile(np.eye(4), (N_JOINTS, 1, 1))
    inverse[:, 0, 3], inverse[:, 1, 3] = -centres, -HEIGHT
    floor = np.array([[-2.2, 0, -2.2], [2.2, 0, -2.2], [2.2, 0, 2.2], [-2.2, 0, 2.2]], "f4")
    attributes = {
        "POSITION": arrays.add(positions, FLOAT, "VEC3"),
        "NORMAL": arrays.add(normals, FLOAT, "VEC3"),
        "JOINTS_0": arrays.add(np.stack([first, first + 1, none, none], -1).astype("u1"), BYTE, "VEC4"),
        "WEIGHTS_0": arrays.add(np.stack([1 - weight, weight, none, none], -1).astype("f4"), FLOAT, "VEC4"),
    }
    quad = np.array([0, 2, 1, 0, 3, 2], "u4")
    ground = {"POSITION": arrays.add(floor, FLOAT, "VEC3")}
    primitives = [
        {"attributes": attributes, "indices": arrays.add(faces.reshape(-1), WORD, "SCALAR"), "material": 0},
        {"attributes": ground, "indices": arrays.add(quad, WORD, "SCALAR"), "material": 1},
    ]
    times = np.linspace(0, 4, 41).astype("f4")
    input_ix = arrays.add(times, FLOAT, "SCALAR")
    samplers, channels = [], []
    for joint, centre in enumerate(centres):
        half = 0.25 * np.sin(2 * np.pi * times / 4 + joint * 0.7)
        y = 0.72 + 0.1 * np.sin(2 * np.pi * times / 4 + joint * 0.9)
        z = 0.12 * np.cos(2 * np.pi * times / 4 + joint * 1.1)
        rotation = np.stack([np.sin(half), 0 * half, 0 * half, np.cos(half)], -1)
        moves = (("rotation", rotation, "VEC4"), ("translation", np.stack([0 * y + centre, y, z], -1), "VEC3"))
        for path, values, kind in moves:
            channels.append({"sampler": len(samplers), "target": {"node": 2 + joint, "path": path}})
            samplers.append({"input": input_ix, "output": arrays.add(values.astype("f4"), FLOAT, kind)})
    joints = [{"translation": [centre, HEIGHT, 0]} for centre in centres]
    bind = arrays.add(inverse.transpose(0, 2, 1).reshape(-1, 16).astype("f4"), FLOAT, "MAT4")
    glass = {"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_ior": {"ior": 1.5}}
    smooth = {"baseColorFactor": [0.9, 1, 0.95, 1], "roughnessFactor": 0, "metallicFactor": 0}
    rough = {"baseColorFactor": [0.6, 0.5, 0.4, 1], "roughnessFactor": 0.9, "metallicFactor": 0}
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(2 + N_JOINTS))}],
        "nodes": [{"name": "knot", "mesh": 0, "skin": 0}, {"name": "floor", "mesh": 1}, *joints],
        "meshes": [{"primitives": [primitive]} for primitive in primitives],
        "materials": [
            {"name": "glass", "pbrMetallicRoughness": smooth, "extensions": glass},
            {"name": "floor", "pbrMetallicRoughness": rough},
        ],
        "extensionsUsed": list(glass),
        "skins": [{"joints": list(range(2, 2 + N_JOINTS)), "inverseBindMatrices": bind}],
        "animations": [{"name": "wobble", "samplers": samplers, "channels": channels}],
        "accessors": arrays.accessors,
        "bufferViews": arrays.views,
        "buffers": [{"byteLength": len(arrays.bytes)}],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file")
    parser.add_argument("--along", type=int, default=613)
    parser.add_argument("--around", type=int, default=158)
    options = parser.parse_args()
    arrays = Arrays()
    text = json.dumps(document(arrays, *knot(options.along, options.around))).encode()
    chunks = [(text + b" " * (-len(text) % 4), b"JSON"), (arrays.bytes + b"\0" * (-len(arrays.bytes) % 4), b"BIN\0")]
    with open(options.file, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 12 + sum(8 + len(chunk) for chunk, _ in chunks)))
        for chunk, name in chunks:
            file.write(struct.pack("<I4s", len(chunk), name) + chunk)


if __name__ == "__main__":
    main()

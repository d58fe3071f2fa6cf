"""Measures how long kdray takes from a file to a scene that is ready to render. Needs numpy. Usage:

    python3 tests/long/loading.py KDRAY [--repeat N] [--only NAME,NAME] [--obj FILE]

The script makes four scenes, renders each by the CPU in a tiny picture, and prints medians of the times that `kdray
render --profile` reports. It fails if one exceeds its bound, which is for two cores.

| name | file | bound |
|---|---|---|
| textures | glTF, 262,088 triangles in 48 primitives, 48 PNG images of 1024x1024 | 2 s to load and to build the tree |
| ply | binary PLY, 9,999,392 triangles | 5 s to load |
| instances | TOML that names a PLY file of 69,938 triangles a hundred times | 2 s to load |
| files | TOML that names 40 PLY files of 249,218 triangles | 2 s to load |

--obj measures an OBJ file as well, without a bound.
"""

import argparse
import json
import os
import statistics
import struct
import subprocess
import sys
import tempfile
import zlib

import numpy as np


def surface(n_rows, n_columns):
    """Returns the points and the triangles of a rippled rectangle of n_rows x n_columns squares."""
    y, x = np.mgrid[0 : n_rows + 1, 0 : n_columns + 1].astype(np.float32)
    height = np.sin(x / 9) * np.cos(y / 7)
    points = np.stack([x, height, y], axis=-1).reshape(-1, 3).astype("<f4")
    first = (np.arange(n_rows)[:, None] * (n_columns + 1) + np.arange(n_columns)).reshape(-1)
    below = first + n_columns + 1
    triangles = np.stack([first, below, first + 1, first + 1, below, below + 1], axis=-1).reshape(-1, 3)
    return points, triangles.astype("<u4")


def png(random, side):
    """Returns a PNG file of a noisy gradient."""
    ramp = np.add.outer(np.arange(side), np.arange(side))[..., None] // 8
    pixels = (ramp + random.integers(0, 6, (side, side, 3))).astype(np.uint8)
    # Each row is filtered by differences to its left neighbours, as most programs do.
    rows = np.diff(pixels, axis=1, prepend=np.zeros((side, 1, 3), np.uint8)).reshape(side, -1)
    rows = np.concatenate([np.full((side, 1), 1, np.uint8), rows], axis=1)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    data = zlib.compress(rows.tobytes(), 6)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def write_ply(path, n_rows, n_columns):
    points, triangles = surface(n_rows, n_columns)
    faces = np.empty(len(triangles), dtype=[("n", "u1"), ("corners", "<u4", 3)])
    faces["n"], faces["corners"] = 3, triangles
    header = f"""ply
format binary_little_endian 1.0
element vertex {len(points)}
property float x
property float y
property float z
element face {len(triangles)}
property list uchar uint vertex_indices
end_header
"""
    with open(path, "wb") as file:
        file.write(header.encode() + points.tobytes() + faces.tobytes())


def write_textured(folder, n_images=48, side=1024):
    """Writes a glTF file whose triangles are shared evenly among primitives, each with its own image."""
    points, triangles = surface(362, 362)
    uvs = np.ascontiguousarray(points[:, [0, 2]] / 362).astype("<f4")
    random = np.random.default_rng(1)
    for ix in range(n_images):
        with open(os.path.join(folder, f"{ix}.png"), "wb") as file:
            file.write(png(random, side))
    parts = [points.tobytes(), uvs.tobytes(), triangles.tobytes()]
    with open(os.path.join(folder, "mesh.bin"), "wb") as file:
        file.write(b"".join(parts))
    bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    accessors = [
        {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": len(points), **bounds},
        {"bufferView": 1, "componentType": 5126, "type": "VEC2", "count": len(points)},
    ]
    ends = [len(triangles) * ix // n_images for ix in range(n_images + 1)]
    for begin, end in zip(ends, ends[1:]):
        count = 3 * (end - begin)
        indices = {"componentType": 5125, "type": "SCALAR", "count": count}
        accessors.append({"bufferView": 2, "byteOffset": 12 * begin, **indices})
    attributes = {"POSITION": 0, "TEXCOORD_0": 1}
    offsets = np.cumsum([0] + [len(part) for part in parts]).tolist()
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {"primitives": [{"attributes": attributes, "indices": 2 + ix, "material": ix} for ix in range(n_images)]}
        ],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": ix}}} for ix in range(n_images)],
        "textures": [{"source": ix} for ix in range(n_images)],
        "images": [{"uri": f"{ix}.png"} for ix in range(n_images)],
        "accessors": accessors,
        "bufferViews": [
            {"buffer": 0, "byteOffset": offset, "byteLength": len(part)} for offset, part in zip(offsets, parts)
        ],
        "buffers": [{"uri": "mesh.bin", "byteLength": offsets[-1]}],
    }
    path = os.path.join(folder, "textured.gltf")
    with open(path, "w") as file:
        json.dump(document, file)
    return path


def write_instances(folder, n):
    path = os.path.join(folder, f"instances{n}.toml")
    with open(path, "w") as file:
        for ix in range(n):
            position = f"[{200.0 * (ix % 10)}, 0.0, {200.0 * (ix // 10)}]"
            file.write(f'[[mesh]]\nfile = "bunny.ply"\ntransform = {{ translate = {position} }}\n')
    return path


def write_files(folder, n):
    path = os.path.join(folder, "files.toml")
    with open(path, "w") as file:
        file.write("ambient = [1, 1, 1]\n[camera]\neye = [1600, 900, 3000]\ntarget = [1600, 0, 1000]\n")
        for ix in range(n):
            write_ply(os.path.join(folder, f"{ix}.ply"), 353, 353)
            position = f"[{400.0 * (ix % 8)}, 0.0, {400.0 * (ix // 8)}]"
            file.write(f'[[mesh]]\nfile = "{ix}.ply"\ntransform = {{ translate = {position} }}\n')
    return path


def times(kdray, scene, repeat, build=True):
    """Returns the median times of loading and of building, s. Without `build`, the structure is a grid, which is
    built quickly."""
    measured = []
    for _ in range(repeat):
        with tempfile.TemporaryDirectory() as folder:
            profile = os.path.join(folder, "profile.json")
            command = [kdray, "render", scene, "--cpu", "--size", "8x8", "--spp", "1", "-q", "--profile", profile]
            accel = [] if build else ["--accel", "grid"]
            subprocess.run(command + accel + ["-o", os.path.join(folder, "x.png")], check=True)
            with open(profile) as file:
                report = json.load(file)
            measured.append((report["load_ms"] / 1e3, report["build_ms"] / 1e3))
    return [statistics.median(column) for column in zip(*measured)]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("kdray")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--only", default="textures,ply,instances,files")
    parser.add_argument("--obj")
    arguments = parser.parse_args()
    kdray, repeat, names = os.path.abspath(arguments.kdray), arguments.repeat, arguments.only.split(",")
    failures = []

    def report(name, load, build, fails):
        print(f"{name:10} load {load:6.3f} s   build {build:6.3f} s{'   too slow' if fails else ''}", flush=True)
        if fails:
            failures.append(name)

    with tempfile.TemporaryDirectory() as folder:
        if "textures" in names:
            load, build = times(kdray, write_textured(folder), repeat)
            report("textures", load, build, load + build > 2.0)
        if "ply" in names:
            path = os.path.join(folder, "large.ply")
            write_ply(path, 2236, 2236)
            load, build = times(kdray, path, 1, build=False)
            report("ply", load, build, load > 5.0)
        if "instances" in names:
            write_ply(os.path.join(folder, "bunny.ply"), 187, 187)
            one, build_one = times(kdray, write_instances(folder, 1), repeat)
            report("instance", one, build_one, False)
            load, build = times(kdray, write_instances(folder, 100), 1, build=False)
            report("instances", load, build, load > 2.0)
        if "files" in names:
            load, build = times(kdray, write_files(folder, 40), repeat, build=False)
            report("files", load, build, load > 2.0)
    if arguments.obj:
        load, build = times(kdray, arguments.obj, repeat)
        report("obj", load, build, False)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
"""Measures grids against the kd-tree where grids do well and where they do badly.

    python3 benches/grids.py target/release/kdray [--mesh dragon.obj] [--size 1920x1080] [--repeat 5] [--cpu]

There are four scenes: a soup of triangles of one size in a uniform distribution, an interior of coarse walls and
furniture with finer ornaments, a mesh in a closed room (the OBJ file that --mesh names, or a generated knot), and a
small detailed body in the middle of a stadium. In each scene, `kdray bench traversal` casts the same rays through all
structures. The script prints Markdown tables of million rays per second.
"""

import argparse
import json
import pathlib
import random
import subprocess
import sys
import tempfile

VARIANTS = ["mask", "ropes", "grid", "grid2"]

KNOT = """\
[camera]
eye = [0.0, 0.0, 6.0]
target = [0.0, 0.0, 0.0]
vertical_fov = 45

[[mesh]]
generator = "torus_knot"
p = 2
q = 5
radius = 1.35
swing = 0.62
tube = 0.36
segments = 2300
triangles = 800000
ripples = [14, 4]
ripple_depth = 0.07
"""

# The "teapot in a stadium": a bowl with a radius of 100 units, and a body of 1 unit on its ground.
STADIUM = """\
[camera]
eye = [1.4, 1.1, 2.2]
target = [0.0, 0.5, 0.0]
vertical_fov = 45

[[light]]
kind = "point"
position = [20.0, 60.0, 30.0]
intensity = [5000.0, 5000.0, 5000.0]

[[mesh]]
generator = "lathe"
segments = 256
steps = 8
profile = [
    [100.0, 60.0], [98.0, 40.0], [90.0, 40.0], [84.0, 32.0], [76.0, 24.0], [68.0, 16.0], [60.0, 8.0],
    [54.0, 4.0], [54.0, 0.0], [54.0, 0.0], [0.0, 0.0],
]

[[mesh]]
generator = "torus_knot"
p = 2
q = 3
radius = 0.5
swing = 0.24
tube = 0.145
segments = 400
triangles = 40000
transform = { translate = [0.0, 0.6, 0.0] }
"""


# The floor is half a unit above 0. At 0 it would have no rounding margin, and chance would decide whether rays that
# start on it hit it.
ROOM = """\
[camera]
eye = [0.0, 3.2, 9.0]
target = [0.0, 1.8, 0.0]
vertical_fov = 60

[[light]]
kind = "point"
position = [0.5, 5.0, 1.0]
intensity = [50.0, 50.0, 50.0]

[[mesh]]
generator = "room"
size = [14.0, 5.0, 20.0]
transform = { translate = [0.0, 3.0, 0.0] }
"""

ORNAMENT = """
[[mesh]]
generator = "torus_knot"
p = 2
q = 3
radius = %.3f
swing = %.3f
tube = %.3f
segments = 220
triangles = 12000
transform = { translate = [%.3f, %.3f, %.3f], rotate = [%.0f, %.0f, 0] }
"""

TABLE = """
[[mesh]]
generator = "box"
size = [%.3f, %.3f, %.3f]
transform = { translate = [%.3f, %.3f, %.3f], rotate = [0, %.0f, 0] }
"""


def write_interior(path, n_tables):
    """Writes a scene file: a room with tables of 12 triangles, each with an ornament of 12,000 triangles on it."""
    rng = random.Random(3)
    with open(path, "w") as file:
        file.write(ROOM)
        for _ in range(n_tables):
            x, z = rng.uniform(-6, 6), rng.uniform(-9, 6)
            width, height, radius = rng.uniform(0.4, 1.2), rng.uniform(0.4, 1.4), rng.uniform(0.08, 0.2)
            file.write(TABLE % (width, height, width, x, 0.5 + height / 2, z, rng.uniform(0, 90)))
            middle = 0.5 + height + 1.9 * radius
            turns = rng.uniform(0, 90), rng.uniform(0, 90)
            file.write(ORNAMENT % ((radius, 0.48 * radius, 0.29 * radius, x, middle, z) + turns))


def write_soup(path, n_triangles):
    """Writes an OBJ file of triangles of one size, uniformly distributed in a cube of 2 units."""
    rng = random.Random(7)
    size = 1.5 / n_triangles ** (1 / 3)
    with open(path, "w") as file:
        for _ in range(n_triangles):
            center = [rng.uniform(-1, 1) for _ in range(3)]
            for _ in range(3):
                corner = [x + rng.uniform(-size, size) for x in center]
                file.write("v %.6f %.6f %.6f\n" % tuple(corner))
        for i in range(n_triangles):
            file.write("f %d %d %d\n" % (3 * i + 1, 3 * i + 2, 3 * i + 3))


def measure(binary, scene, options):
    """Runs `kdray bench traversal` on a scene and returns its report as parsed JSON."""
    with tempfile.NamedTemporaryFile(suffix=".json") as report:
        words = [binary, "bench", "traversal", str(scene), "--variants", ",".join(VARIANTS)]
        subprocess.run(words + options + ["--json", report.name], check=True, stdout=subprocess.DEVNULL)
        return json.load(open(report.name))


def table(name, report):
    """Returns a scene's Markdown table: one row per kind of ray, one column per variant."""
    lines = ["%s: %d triangles, on %s" % (name, report["n_triangles"], report["device"]), ""]
    lines.append("| rays | " + " | ".join("`%s`, Mrays/s" % variant for variant in VARIANTS) + " | `grid2` / `mask` |")
    lines.append("|---|" + "---:|" * (len(VARIANTS) + 1))
    for rays in report["sets"]:
        rates = {variant["traversal"]: variant["mrays_per_s"]["median"] for variant in rays["variants"]}
        cells = ["%.1f" % rates[variant] for variant in VARIANTS] + ["%.2f" % (rates["grid2"] / rates["mask"])]
        lines.append("| %s | %s |" % (rays["rays"], " | ".join(cells)))
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary", help="the program `kdray`")
    parser.add_argument("--mesh", help="an OBJ file for the mesh in a room, such as the Stanford dragon")
    parser.add_argument("--size", default="1920x1080", help="pixels, one primary ray each")
    parser.add_argument("--repeat", default="5", help="timed casts of each set of rays")
    parser.add_argument("--cpu", action="store_true", help="cast on the CPU, without Vulkan")
    parser.add_argument("--json", help="write all reports to this file")
    args = parser.parse_args()
    common = ["--size", args.size, "--repeat", args.repeat] + ["--cpu"] * args.cpu
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        write_soup(folder / "soup.obj", 200_000)
        write_interior(folder / "interior.toml", 40)
        (folder / "knot.toml").write_text(KNOT)
        (folder / "stadium.toml").write_text(STADIUM)
        scenes = [
            ("Even soup in a room", folder / "soup.obj", []),
            ("Interior", folder / "interior.toml", ["--no-room"]),
            ("Mesh in a room", args.mesh or folder / "knot.toml", []),
            ("Body in a stadium", folder / "stadium.toml", ["--no-room"]),
        ]
        reports = {}
        for name, scene, options in scenes:
            print("measuring: %s" % name, file=sys.stderr)
            reports[name] = measure(args.binary, scene, options + common)
            print(table(name, reports[name]), flush=True)
    if args.json:
        pathlib.Path(args.json).write_text(json.dumps(reports, indent=2))


if __name__ == "__main__":
    main()

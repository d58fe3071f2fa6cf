"""A camera goes around what a file shows, or around a knot: eight pictures of a turn."""

import sys
import tempfile
from pathlib import Path

import numpy as np
from common import arguments, torus_knot, write_png

import kdray

args = arguments(__doc__, "turntable.png", 240, takes_file=True)  # size: pixels of a side of a picture

with tempfile.TemporaryDirectory() as directory:
    path = args.file
    if path is None:
        path = Path(directory) / "knot.obj"
        vertices, triangles, _ = torus_knot()
        lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in triangles + 1]
        path.write_text("\n".join(lines))
    scene = kdray.load(path, size=(args.size, args.size), integrator="path")
print(scene, *scene.notes, sep="\n", file=sys.stderr)

low, high = scene.bounds
middle, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
pictures = []
for angle in np.linspace(0, 2 * np.pi, 8, endpoint=False):
    eye = middle + 3 * radius * np.array([np.sin(angle), 0.4, np.cos(angle)])  # +y is up
    camera = {"eye": eye, "target": middle, "up": [0, 1, 0], "vertical_fov": 35}
    pictures.append(scene.render(spp=16, camera=camera)["picture"])
rows = [np.concatenate(pictures[first : first + 4], axis=1) for first in (0, 4)]
write_png(args.output, np.concatenate(rows))

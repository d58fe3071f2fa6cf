"""A slice of the signed distance of a knot: blue inside, brown outside, with lines of equal distance."""

import numpy as np
from common import arguments, torus_knot, write_png

import kdray

args = arguments(__doc__, "signed_distance.png", 512)  # size: points along each side of the slice
SIDE = 8.0

vertices, triangles, _ = torus_knot()
scene = kdray.RaycastingScene()
scene.add_triangles(vertices, triangles)

along = (np.arange(args.size) + 0.5) / args.size * SIDE - SIDE / 2
x, y = np.meshgrid(along, along[::-1])
distance = scene.compute_signed_distance(np.stack([x, y, np.zeros_like(x)], axis=-1))

colour = np.where(distance[..., None] < 0, [0.3, 0.5, 0.9], [0.85, 0.65, 0.4])
lines = 0.8 + 0.2 * np.cos(2 * np.pi * distance / 0.1)
fade = 1 - 0.6 * np.exp(-6 * np.abs(distance))
on_surface = np.abs(distance) < 1.5 * SIDE / args.size
picture = np.where(on_surface[..., None], 1.0, colour * (lines * fade)[..., None])
write_png(args.output, picture)

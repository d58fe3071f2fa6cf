"""How much of the sky each place of a city sees: 1 on open ground, little in narrow streets."""

import numpy as np
from common import arguments, box, cosine_rays, write_png

import kdray

args = arguments(__doc__, "sky_view.png", 256)  # size: places along each side of the map
SIDE, BLOCK = 240.0, 20.0

random = np.random.default_rng(3)
scene = kdray.RaycastingScene()
scene.add_triangles([[0, 0, 0], [SIDE, 0, 0], [SIDE, SIDE, 0], [0, SIDE, 0]], [[0, 1, 2], [0, 2, 3]])
for x in np.arange(0, SIDE, BLOCK):
    for y in np.arange(0, SIDE, BLOCK):
        if random.random() < 0.85:
            height = random.uniform(5, 15) + 60 * np.exp(-((x - 120) ** 2 + (y - 120) ** 2) / 3000)
            scene.add_triangles(*box([x + 3, y + 3, 0], [x + BLOCK - 3, y + random.uniform(10, 17), height]))

# The highest surface at each place of the map, from above.
middles = (np.arange(args.size) + 0.5) * SIDE / args.size
x, y = (grid.reshape(-1) for grid in np.meshgrid(middles, middles[::-1]))
down = np.stack([x, y, np.full_like(x, 500), 0 * x, 0 * x, -np.ones_like(x)], axis=1)
surface = down[:, :3] - [0, 0, 1] * scene.cast_rays(down)["t_hit"][:, None]

sky_view = []
for part in np.array_split(surface + [0, 0, 0.01], 16):  # bounds the memory of rays
    up = np.tile(np.float32([0, 0, 1]), (len(part), 1))
    sky_view.append(1 - scene.test_occlusions(cosine_rays(part.astype(np.float32), up, n=96)).mean(axis=1))
sky_view = np.concatenate(sky_view).reshape(args.size, args.size)
print(f"mean sky view factor {sky_view.mean():.2f}")
colours = np.array([[0.05, 0.05, 0.2], [0.5, 0.15, 0.4], [0.95, 0.5, 0.25], [1, 0.97, 0.8]])
write_png(args.output, np.stack([np.interp(sky_view, [0, 0.33, 0.67, 1], c) for c in colours.T], axis=-1))

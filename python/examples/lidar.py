"""A spinning lidar drives along a street, past cars that drive, too, and writes its points to a PLY file."""

import numpy as np
from common import arguments, box

import kdray

args = arguments(__doc__, "lidar.ply", 900)  # size: steps of a turn

scene = kdray.RaycastingScene()
scene.add_triangles(*box([-100, -40, -1], [100, 40, 0]))
for x in range(-90, 90, 20):
    for side in (-1, 1):
        near, far = sorted([side * 9, side * 25])
        scene.add_triangles(*box([x, near, 0], [x + 14, far, 8 + abs(x) % 17]))
cars = [scene.add_triangles(*box([-2, -0.9, 0.3], [2, 0.9, 1.6])) for _ in range(8)]

# 32 beams, from 25 degrees below the horizon to 5 above it.
azimuth = np.linspace(0, 2 * np.pi, args.size, endpoint=False)
elevation = np.radians(np.linspace(-25, 5, 32))[:, None]
directions = np.stack(
    np.broadcast_arrays(
        np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)
    ),
    axis=-1,
)

points = []
for turn in range(5):
    places = np.tile(np.eye(3, 4), (len(cars), 1, 1))
    places[:, 0, 3] = np.linspace(-60, 60, len(cars)) + turn * np.tile([2.5, -2.5], len(cars) // 2)
    places[:, 1, 3] = np.tile([-4, 4], len(cars) // 2)
    scene.update_transforms(cars, places)
    lidar = np.array([-6.0 + 3 * turn, 0, 1.9])
    rays = np.concatenate([np.broadcast_to(lidar, directions.shape), directions], axis=-1)
    hits = scene.cast_rays(rays, t_min=0.5, t_max=80)
    is_hit = np.isfinite(hits["t_hit"])
    rows = np.empty(is_hit.sum(), [("place", "<f4", 3), ("object", "<i4"), ("turn", "<i4")])
    rows["place"] = lidar + hits["t_hit"][is_hit][:, None] * directions[is_hit]
    rows["object"], rows["turn"] = hits["geometry_ids"][is_hit], turn
    points.append(rows)

points = np.concatenate(points)
with open(args.output, "wb") as file:
    properties = "".join(f"property float {axis}\n" for axis in "xyz") + "property int object\nproperty int turn\n"
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{properties}end_header\n"
    file.write(header.encode() + points.tobytes())
print(f"{args.output}: {len(points)} points, cast on {scene.device}")

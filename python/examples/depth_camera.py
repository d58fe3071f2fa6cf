"""A depth camera looks at a robot arm that moves: each picture shows the arm where it is."""

import numpy as np
from common import arguments, box, write_png

import kdray

args = arguments(__doc__, "depth_camera.png", 240)  # size: pixels of a side of a picture
LENGTHS = [0.8, 0.7, 0.4]

scene = kdray.RaycastingScene()
scene.add_triangles(*box([-2, -2, -0.1], [2, 2, 0]))
scene.add_triangles(*box([0.9, -0.2, 0], [1.3, 0.2, 0.4]))
links = [scene.add_triangles(*box([-0.1, -0.1, 0], [0.1, 0.1, length])) for length in LENGTHS]


def turn(axis, angle):
    """The matrix (4, 4) that turns around an axis: 1 (y) or 2 (z)."""
    matrix, c, s = np.eye(4), np.cos(angle), np.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
    return matrix


def poses(shoulder_yaw, angles):
    """The place of each link, (4, 4): each bends around the end of the one before."""
    at, places = turn(2, shoulder_yaw), []
    for angle, length in zip(angles, LENGTHS):
        at = at @ turn(1, angle)
        places.append(at)
        at = at @ np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, length], [0, 0, 0, 1]])
    return np.array(places)


rays = scene.create_rays_pinhole(
    fov_deg=50, center=[0.3, 0, 0.6], eye=[2.4, -2.2, 1.6], up=[0, 0, -1], width_px=args.size, height_px=args.size
)
pictures = []
for time in np.linspace(0, 1, 6):
    scene.update_transforms(links, poses(1.5 - 2 * time, [0.3 + 0.5 * time, 0.4 + 0.6 * time, 0.9 - 0.4 * time]))
    depth = scene.cast_rays(rays)["t_hit"]
    pictures.append(np.where(np.isfinite(depth), 1.1 - depth / 4.5, 0))
write_png(args.output, np.concatenate([np.concatenate(pictures[:3], axis=1), np.concatenate(pictures[3:], axis=1)]))

"""Bakes ambient occlusion to the vertices of a knot, and shows them."""

import numpy as np
from common import arguments, cosine_rays, torus_knot, write_png

import kdray

args = arguments(__doc__, "ambient_occlusion.png", 480)  # size: pixels of a side of the picture

vertices, triangles, normals = torus_knot()
scene = kdray.RaycastingScene()
scene.add_triangles(vertices, triangles)

# What is farther than 2.5 darkens nothing. Rays begin a little above the surface.
rays = cosine_rays(vertices + 1e-3 * normals, normals, n=512)
openness = 1 - scene.test_occlusions(rays, tfar=2.5).mean(axis=1)
print(f"openness from {openness.min():.2f} to {openness.max():.2f}")

camera = scene.create_rays_pinhole(
    fov_deg=45, center=[0, 0, 0], eye=[3, -6, 7], up=[0, 0, -1], width_px=args.size, height_px=args.size
)
hits = scene.cast_rays(camera)
is_hit = np.isfinite(hits["t_hit"])
u, v = hits["primitive_uvs"][is_hit].T
corners = openness[triangles[hits["primitive_ids"][is_hit]]]
picture = np.full(is_hit.shape, 0.15)
picture[is_hit] = (corners * np.stack([1 - u - v, u, v], axis=1)).sum(axis=1) ** 1.5  # more contrast
write_png(args.output, picture)

"""The five scenes, made from a few numbers."""

from pathlib import Path

import numpy as np
from PIL import Image

from .description import Diffuse, Emitting, Glass, Mesh, Metal, Scene, SphereLight


def quad(name, a, b, c, d, material, with_uvs=False):
    """Corners counter-clockwise from the side that is seen."""
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float) if with_uvs else None
    return Mesh(name, np.array([a, b, c, d], float), np.array([[0, 1, 2], [0, 2, 3]]), material, uvs)


def box(name, low, high, material):
    low, high = np.array(low, float), np.array(high, float)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [triangle for a, b, c, d in faces for triangle in ([a, b, c], [a, c, d])]
    return Mesh(name, low + corners * (high - low), np.array(triangles), material)


def sphere(name, centre, radius, material, n=96):
    """Fine enough that flat faces look round."""
    theta = np.linspace(0, np.pi, n + 1)
    phi = np.linspace(0, 2 * np.pi, 2 * n, endpoint=False)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    at = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], -1).reshape(-1, 3)
    faces = []
    for i in range(n):
        for j in range(2 * n):
            a, b = i * 2 * n + j, i * 2 * n + (j + 1) % (2 * n)
            c, d = a + 2 * n, b + 2 * n
            if i > 0:
                faces.append([a, b, d])
            if i < n - 1:
                faces.append([a, d, c])
    return Mesh(name, np.array(centre) + radius * at, np.array(faces), material)


def walls(half, material_of):
    """A room's walls, seen from inside: floor, ceiling, left, right, back."""
    x, y, z = half
    corners = {
        "floor": [(-x, -y, z), (x, -y, z), (x, -y, -z), (-x, -y, -z)],
        "ceiling": [(-x, y, -z), (x, y, -z), (x, y, z), (-x, y, z)],
        "left": [(-x, -y, z), (-x, -y, -z), (-x, y, -z), (-x, y, z)],
        "right": [(x, -y, -z), (x, -y, z), (x, y, z), (x, y, -z)],
        "back": [(-x, -y, -z), (x, -y, -z), (x, y, -z), (-x, y, -z)],
    }
    return [quad(name, *at, material_of(name)) for name, at in corners.items()]


def cornell():
    white, red, green = Diffuse((0.73, 0.73, 0.73)), Diffuse((0.63, 0.06, 0.05)), Diffuse((0.14, 0.45, 0.09))
    meshes = walls((1, 1, 1), lambda name: {"left": red, "right": green}.get(name, white))
    lamp = [(-0.25, 0.99, 0.25), (-0.25, 0.99, -0.25), (0.25, 0.99, -0.25), (0.25, 0.99, 0.25)]
    meshes.append(quad("lamp", *lamp, Emitting((17.0, 12.0, 4.0))))
    meshes.append(box("tall", (-0.6, -1, -0.6), (-0.05, 0.2, -0.1), white))
    meshes.append(box("short", (0.1, -1, 0.0), (0.65, -0.4, 0.55), white))
    return Scene("cornell", (0, 0, 3.9), (0, 0, 0), 39, 9, meshes)


def veach():
    """Plates of growing roughness below spheres of growing size (Veach, Guibas: Optimally Combining Sampling
    Techniques, 1995)."""
    meshes = [
        quad("floor", (-9, -3.2, 9), (9, -3.2, 9), (9, -3.2, -7), (-9, -3.2, -7), Diffuse((0.4, 0.4, 0.4))),
        quad("wall", (-9, -3.2, -7), (9, -3.2, -7), (9, 9, -7), (-9, 9, -7), Diffuse((0.4, 0.4, 0.4))),
    ]
    eye, lights_at = np.array([0.0, 1.5, 11.0]), np.array([0.0, 4.0, -3.0])
    for i, alpha in enumerate((0.02, 0.06, 0.15, 0.35)):
        centre = np.array([0.0, -2.6 + 0.75 * i, 2.4 - 1.6 * i])
        # The plate mirrors the eye to the lights.
        to_eye, to_light = eye - centre, lights_at - centre
        normal = to_eye / np.linalg.norm(to_eye) + to_light / np.linalg.norm(to_light)
        normal /= np.linalg.norm(normal)
        along = np.cross([1.0, 0.0, 0.0], normal)
        x, z = np.array([3.8, 0, 0]), 0.55 * along / np.linalg.norm(along)
        corners = [centre - x - z, centre - x + z, centre + x + z, centre + x - z]
        a, b, c = corners[0], corners[1], corners[2]
        if np.dot(np.cross(b - a, c - a), normal) < 0:
            corners.reverse()
        meshes.append(quad(f"plate{i}", *corners, Metal(alpha)))
    lights = []
    for x, radius in ((-3.75, 0.05), (-1.25, 0.15), (1.25, 0.4), (3.75, 0.9)):
        strength = 8.0 * (0.4 / radius) ** 2
        lights.append(SphereLight((x, *lights_at[1:]), radius, (strength,) * 3))
    return Scene("veach", tuple(eye), (0, -0.4, 0), 38, 5, meshes, lights)


def sky(u, v):
    """Radiance of a smooth sky with a broad bright spot, at places of its picture: to the right and down, 0 to 1."""
    up = np.cos(np.pi * v)
    spot = np.exp(-((u - 0.8) ** 2) / 0.005 - ((v - 0.3) ** 2) / 0.01)
    colour = np.stack([0.4 + 0.2 * up, 0.5 + 0.3 * up, 0.6 + 0.4 * up], -1)
    return colour + 12 * spot[..., None] * np.array([1.0, 0.9, 0.7])


def rough():
    meshes = [
        quad("floor", (-6, -1, 6), (6, -1, 6), (6, -1, -6), (-6, -1, -6), Diffuse((0.3, 0.3, 0.3))),
        sphere("glass", (-1.15, 0, 0), 1, Glass(0.15)),
        sphere("metal", (1.15, 0, 0), 1, Metal(0.25)),
    ]
    return Scene("rough", (0, 1.6, 6), (0, -0.1, 0), 30, 12, meshes, environment=sky)


def window(folder):
    """A room whose light comes through a window from a bright environment. Its floor has a texture."""
    path = Path(folder) / "tiles.png"
    random = np.random.default_rng(1)
    Image.fromarray(random.integers(40, 230, (8, 8, 3), dtype=np.uint8)).save(path)
    white = Diffuse((0.7, 0.7, 0.7))
    x, y, z = 2.0, 1.25, 2.5
    meshes = [mesh for mesh in walls((x, y, z), lambda _: white) if mesh.name not in ("floor", "right")]
    floor = [(-x, -y, z), (x, -y, z), (x, -y, -z), (-x, -y, -z)]
    meshes.append(quad("floor", *floor, Diffuse(texture=str(path)), with_uvs=True))
    meshes.append(quad("front", (x, -y, z), (-x, -y, z), (-x, y, z), (x, y, z), white))
    # The right wall has a window from z0 to z1 and from y0 to y1.
    y0, y1, z0, z1 = -0.4, 0.8, -1.2, 0.6
    for name, low, high in (
        ("below", (-y, -z), (y0, z)), ("above", (y1, -z), (y, z)),
        ("behind", (y0, -z), (y1, z0)), ("before", (y0, z1), (y1, z)),
    ):  # fmt: skip
        (a, b), (c, d) = low, high
        meshes.append(quad(name, (x, a, b), (x, a, d), (x, c, d), (x, c, b), white))
    meshes.append(box("chest", (-1.2, -1.25, -1.6), (-0.3, -0.5, -0.8), Diffuse((0.5, 0.3, 0.2))))
    return Scene("window", (-1.2, 0.2, 2.3), (0.6, -0.4, -1.5), 60, 9, meshes, environment=lambda u, v: 4 * sky(u, v))


def many():
    """Two thousand triangles that give off light of all colours, above a floor."""
    random = np.random.default_rng(7)
    n = 2000
    centre = np.stack([random.uniform(-3, 3, n), random.uniform(0.2, 2.5, n), random.uniform(-3, 3, n)], -1)
    corners = centre[:, None] + 0.04 * random.normal(size=(n, 3, 3))
    meshes = [quad("floor", (-5, 0, 5), (5, 0, 5), (5, 0, -5), (-5, 0, -5), Diffuse((0.6, 0.6, 0.6)))]
    for i, radiance in enumerate(((9, 2, 1), (1, 6, 2), (2, 3, 12), (20, 18, 15))):
        part = corners[i::4]
        faces = np.arange(3 * len(part)).reshape(-1, 3)
        meshes.append(Mesh(f"lamps{i}", part.reshape(-1, 3), faces, Emitting(radiance)))
    return Scene("many", (0, 2.5, 7), (0, 0.7, 0), 40, 4, meshes)


def all_scenes(folder):
    return [cornell(), veach(), rough(), window(folder), many()]

"""Closed meshes, and a soup of loose triangles."""

from dataclasses import dataclass

import numpy as np


def normalized(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@dataclass
class Mesh:
    """Float32 vertices (N x 3) and triangles (M x 3 indices), counter-clockwise seen from outside."""

    name: str
    vertices: np.ndarray
    triangles: np.ndarray
    inner: object = None  # only in closed meshes: called with (rng, K), it returns K points deep inside

    def corners(self, triangle_ix, dtype=np.float64):
        return [self.vertices[self.triangles[triangle_ix, i]].astype(dtype) for i in range(3)]


def in_ball(rng, n, radius):
    """Returns n random points in a ball around the origin."""
    return normalized(rng.normal(size=(n, 3))) * radius * rng.random((n, 1)) ** (1 / 3)


def icosphere(levels):
    """Returns the vertices and triangles of a unit sphere: an icosahedron subdivided `levels` times."""
    golden = (1 + 5**0.5) / 2
    vertices = [(a, b * golden, 0) for a in (-1, 1) for b in (-1, 1)]
    vertices = np.array(vertices + [(0, a, b) for a, b, _ in vertices] + [(b, 0, a) for a, b, _ in vertices], float)
    near = [np.flatnonzero(np.isclose(np.linalg.norm(vertices - v, axis=1), 2)) for v in vertices]
    triangles = [(i, j, k) for i in range(12) for j in near[i] for k in near[i] if i < j < k and k in near[j]]
    vertices, triangles = normalized(vertices), np.array(triangles)
    inward = np.linalg.det(vertices[triangles]) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    for _ in range(levels):
        edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        edges, edge_ix = np.unique(edges, axis=0, return_inverse=True)
        middles = len(vertices) + edge_ix.reshape(-1, 3)
        vertices = np.vstack([vertices, normalized(vertices[edges].sum(axis=1))])
        (a, b, c), (ab, bc, ca) = triangles.T, middles.T
        quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])
    return vertices, triangles


def sphere(levels):
    vertices, triangles = icosphere(levels)
    return Mesh("sphere", vertices.astype(np.float32), triangles, lambda rng, n: in_ball(rng, n, 0.5))


def bumpy(rng, levels):
    """Returns a sphere with bumps. One in twenty vertices is the tip of a needle, thin and up to ten radii long."""
    vertices, triangles = icosphere(levels)
    radii = 1 + 0.1 * np.sin(7 * vertices).prod(axis=1) + 0.02 * rng.random(len(vertices))
    tips = rng.random(len(vertices)) < 0.05
    radii[tips] *= 10 ** rng.random(tips.sum())
    vertices = (vertices * radii[:, None]).astype(np.float32)
    return Mesh("needles", vertices, triangles, lambda rng, n: in_ball(rng, n, 0.5))


def torus(n_around, n_across):
    """Returns a torus of radii 1 and 0.4 with 2 * n_around * n_across triangles."""

    def inner(rng, n):
        angle = rng.random(n) * 2 * np.pi
        return np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) + in_ball(rng, n, 0.2)

    around, across = (2 * np.pi * np.arange(n) / n for n in (n_around, n_across))
    around, across = (x.ravel() for x in np.meshgrid(around, across, indexing="ij"))
    distance = 1 + 0.4 * np.cos(across)
    vertices = np.stack([distance * np.cos(around), distance * np.sin(around), 0.4 * np.sin(across)], axis=1)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(n_around), np.arange(n_across), indexing="ij"))

    def corner(di, dj):
        return (i + di) % n_around * n_across + (j + dj) % n_across

    lower = np.stack([corner(0, 0), corner(1, 0), corner(1, 1)], axis=1)
    upper = np.stack([corner(0, 0), corner(1, 1), corner(0, 1)], axis=1)
    return Mesh("torus", vertices.astype(np.float32), np.concatenate([lower, upper]), inner)


def soup(rng, n):
    """Returns loose triangles. Half of them are needles, whose short edge is 1e-5 to 1e-2 of the long one."""
    a = rng.uniform(-1, 1, (n, 1, 3))
    corners = a + np.concatenate([np.zeros((n, 1, 3)), rng.normal(size=(n, 2, 3)) * 0.3], axis=1)
    thin = np.arange(n) % 2 == 0
    short_edges = rng.normal(size=(n, 3)) * 10 ** rng.uniform(-5.5, -2.5, (n, 1))
    corners[thin, 2] = corners[thin, 1] + short_edges[thin]
    corners = corners.astype(np.float32).astype(float)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    corners = corners[area > 0]
    return Mesh("soup", corners.reshape(-1, 3).astype(np.float32), np.arange(3 * len(corners)).reshape(-1, 3))


def assert_closed(mesh):
    """Asserts that each edge has exactly one partner in the opposite direction, and that the faces point outwards."""
    edges = mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()
    directed = set(map(tuple, edges))
    assert len(directed) == len(edges) and all((b, a) in directed for a, b in directed), f"{mesh.name} is not closed"
    a, b, c = mesh.corners(slice(None))
    assert np.linalg.det(np.stack([a, b, c], axis=1)).sum() > 0, f"{mesh.name} is inside out"

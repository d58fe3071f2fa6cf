"""Sets of rays: at edges and vertices, random ones, and nasty ones."""

from dataclasses import dataclass

import numpy as np

from meshes import normalized


@dataclass
class Rays:
    """Origins and directions, float32 arrays of K x 3 each."""

    origins: np.ndarray
    directions: np.ndarray

    def __post_init__(self):
        self.origins = self.origins.astype(np.float32)
        self.directions = self.directions.astype(np.float32)

    def __len__(self):
        return len(self.origins)

    def __getitem__(self, selection):
        return Rays(self.origins[selection], self.directions[selection])

    @staticmethod
    def joined(parts):
        return Rays(np.concatenate([x.origins for x in parts]), np.concatenate([x.directions for x in parts]))


def on_edges(rng, mesh, n):
    """Returns n points on random edges. A quarter of them are vertices."""
    triangle, edge = rng.integers(len(mesh.triangles), size=n), rng.integers(3, size=n)
    ends = [mesh.vertices[mesh.triangles[triangle, i]].astype(float) for i in (edge, (edge + 1) % 3)]
    weight = rng.random((n, 1)) * (rng.random((n, 1)) < 0.75)
    return ends[0] * (1 - weight) + ends[1] * weight


def leak_rays(rng, mesh, n, inside):
    """Returns n rays at edges and vertices of a closed mesh: from points deep inside, or from outside towards such
    points."""
    targets, inner = on_edges(rng, mesh, n), mesh.inner(rng, n)
    if inside:
        return Rays(inner, targets - inner.astype(np.float32))
    reach = 2 * np.abs(mesh.vertices).max()
    origins = (targets + normalized(targets - inner) * (2 * reach + reach * rng.random((n, 1)))).astype(np.float32)
    return Rays(origins, inner - origins)


def judged_rays(rng, mesh, n):
    """Yields random rays, and four kinds of nasty rays, n of each."""
    box = mesh.vertices.min(axis=0).astype(float), mesh.vertices.max(axis=0).astype(float)
    size = np.linalg.norm(box[1] - box[0])

    def anywhere():
        return rng.uniform(*box, (n, 3))

    def around():
        return anywhere() + normalized(rng.normal(size=(n, 3))) * size * rng.random((n, 1))

    origins = around()
    yield Rays(origins, anywhere() - origins)
    # Rays parallel to an axis. The lines of half of them pass through a vertex.
    axis = np.eye(3)[rng.integers(3, size=n)]
    through = np.where(rng.random((n, 1)) < 0.5, mesh.vertices[rng.integers(len(mesh.vertices), size=n)], anywhere())
    yield Rays(through - axis * size * rng.choice([-2, 0, 1], (n, 1)), axis * rng.choice([-1, 1], (n, 1)))
    # Rays at edges. The lengths of their directions vary by six orders of magnitude.
    origins = around()
    scales = 10 ** rng.uniform(-3, 3, (n, 1))
    yield Rays(origins, (on_edges(rng, mesh, n) - origins.astype(np.float32)) * scales)
    # Rays almost in the plane of a triangle.
    a, b, c = mesh.corners(rng.integers(len(mesh.triangles), size=n))
    weights = rng.dirichlet([1, 1, 1], n)
    target = a * weights[:, :1] + b * weights[:, 1:2] + c * weights[:, 2:]
    tilt = np.cross(b - a, c - a) * 10 ** rng.uniform(-7, -2, (n, 1))
    direction = normalized(b - a + (c - a) * rng.normal(size=(n, 1))) + tilt
    yield Rays(target - direction * size, direction)
    # Rays from afar.
    origins = normalized(rng.normal(size=(n, 3))) * size * 10 ** rng.uniform(2, 4, (n, 1))
    yield Rays(origins, anywhere() - origins.astype(np.float32))

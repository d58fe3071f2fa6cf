"""Functions that find leaks and wrong answers. The rules are at the top of __main__.py."""

from dataclasses import dataclass

import numpy as np

from engines import MISS, Hits
from meshes import normalized

MARGIN = 1e-6  # 8 units in the last place of a float32
TOLERANCE = 1e-5


def scale_of(mesh, rays):
    """Returns the scale of each ray, the greatest coordinate of mesh and origin."""
    return np.maximum(np.abs(mesh.vertices).max(), np.abs(rays.origins).max(axis=1)).astype(float)


@dataclass
class Crossings:
    """Crossings of rays with the planes of triangles, one per pair of a ray and a triangle. Lengths are fractions of
    the scale; t is in units of the direction's length."""

    inside: np.ndarray  # distance of the ray from the nearest edge; negative if the ray passes outside
    t: np.ndarray
    slope: np.ndarray  # distance by which the ray moves away from the plane as t grows by 1
    unit: np.ndarray  # length of the direction
    corner_ts: tuple  # least and greatest t of the corners, projected on the ray

    @staticmethod
    def of(mesh, rays, triangle_ix, dtype):
        directions = rays.directions.astype(dtype)
        unit = normalized(directions)
        a, b, c = (x - rays.origins.astype(dtype) for x in mesh.corners(triangle_ix, dtype))
        scale = scale_of(mesh, rays).astype(dtype)
        normal = np.cross(b - a, c - a)
        facing = (normal * unit).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            distances = []
            for p, q in ((a, b), (b, c), (c, a)):
                area = (np.cross(p, q - p) * unit).sum(axis=1) * np.where(facing < 0, -1, 1)
                distances.append(area / np.linalg.norm(np.cross(q - p, unit), axis=1))
            inside = np.nanmin(distances, axis=0) / scale
            t = (normal * a).sum(axis=1) / (normal * directions).sum(axis=1)
        slope = np.abs((normalized(normal) * directions).sum(axis=1)) / scale
        length = np.linalg.norm(directions, axis=1)
        corner_ts = [(corner * unit).sum(axis=1) / length for corner in (a, b, c)]
        return Crossings(inside, t, slope, length / scale, (np.min(corner_ts, axis=0), np.max(corner_ts, axis=0)))


@dataclass
class Pairs:
    """Pairs of a ray and a triangle, as indices, and their crossings."""

    ray_ix: np.ndarray
    triangle_ix: np.ndarray
    crossings: Crossings


def pair_up(mesh, rays, dtype=np.float64):
    """Pairs each ray with all triangles whose bounding spheres are near the ray's line."""
    a, b, c = mesh.corners(slice(None))
    centres = (a + b + c) / 3
    radii = np.sqrt(np.max([((x - centres) ** 2).sum(axis=1) for x in (a, b, c)], axis=0))
    ray_ix, triangle_ix = [], []
    for first in range(0, len(rays), 64):
        part = rays[first : first + 64]
        origins, directions = part.origins.astype(float), normalized(part.directions.astype(float))
        # The origin is replaced by the line's point nearest to (0, 0, 0), so that distant origins lose no digits.
        origins = origins - (origins * directions).sum(axis=1, keepdims=True) * directions
        along = directions @ centres.T - (origins * directions).sum(axis=1)[:, None]
        squared = (origins**2).sum(axis=1)[:, None] - 2 * origins @ centres.T + (centres**2).sum(axis=1) - along**2
        slack = 1e-4 * np.abs(mesh.vertices).max() + 1e-5 * scale_of(mesh, part)[:, None]
        i, j = np.nonzero(squared < (radii + slack) ** 2)
        ray_ix.append(first + i)
        triangle_ix.append(j)
    ray_ix, triangle_ix = np.concatenate(ray_ix), np.concatenate(triangle_ix)
    return Pairs(ray_ix, triangle_ix, Crossings.of(mesh, rays[ray_ix], triangle_ix, dtype))


def judge(mesh, rays, hits, pairs, dtype=np.float64):
    """Returns three arrays of booleans: the answers that are lost, that are false, and that have a wrong t."""
    t, crossings = hits.t.astype(dtype), pairs.crossings
    clear = (crossings.inside > MARGIN) & (crossings.t * crossings.unit > MARGIN)
    with np.errstate(invalid="ignore"):
        in_front = (t[pairs.ray_ix] - crossings.t) * crossings.slope > TOLERANCE
    lost = np.bincount(pairs.ray_ix[clear & in_front], minlength=len(rays)) > 0
    false, wrong_t = np.zeros((2, len(rays)), bool)
    hit = np.flatnonzero(hits.triangle_ix != MISS)
    reported = Crossings.of(mesh, rays[hit], hits.triangle_ix[hit], dtype)
    false[hit] = ~(reported.inside > -MARGIN)
    off_plane = np.abs(t[hit] - reported.t) * reported.slope
    off_corners = np.maximum(reported.corner_ts[0] - t[hit], t[hit] - reported.corner_ts[1]) * reported.unit
    wrong_t[hit] = ~(np.maximum(off_plane, off_corners) <= TOLERANCE)
    return lost & ~false, false, wrong_t & ~lost & ~false


def count_wrong(mesh, rays, hits, pairs):
    """Counts the lost, the false and the wrong-t answers. Those that seem wrong are judged twice."""
    suspects = np.flatnonzero(np.any(judge(mesh, rays, hits, pairs), axis=0))
    if len(suspects) == 0:
        return np.zeros(3, int)
    rays, hits = rays[suspects], hits[suspects]
    return np.sum(judge(mesh, rays, hits, pair_up(mesh, rays, np.longdouble), np.longdouble), axis=1)


def find_leaks(mesh, rays, hits, inside):
    """Returns an array of booleans: the rays that leaked. `inside` says whether the rays begin inside the mesh."""
    if not inside:
        return ~(hits.t < 1)  # the point at t = 1 is deep inside
    hit = np.flatnonzero(hits.triangle_ix != MISS)
    a, b, c = mesh.corners(hits.triangle_ix[hit])
    outward = normalized(np.cross(b - a, c - a))
    # A hit at the aimed edge (t = 1) may be of either of its faces.
    enters = ((outward * normalized(rays.directions[hit].astype(float))).sum(axis=1) < -1e-6) & (hits.t[hit] > 1.001)
    leaks = hits.triangle_ix == MISS
    leaks[hit[enters]] = True
    return leaks

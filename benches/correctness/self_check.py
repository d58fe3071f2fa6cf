"""A check of the judge: it plants errors among right answers, all of which must be counted."""

import numpy as np

from engines import MISS, Hits
from judge import count_wrong, find_leaks, pair_up
from meshes import sphere
from rays import judged_rays, leak_rays


def exact_hits(mesh, rays, pairs):
    """Returns the judge's own answers: the nearest triangle that each ray crosses."""
    ray_ix, triangle_ix, crossings = pairs.ray_ix, pairs.triangle_ix, pairs.crossings
    crossed = np.flatnonzero((crossings.inside >= 0) & (crossings.t > 0))
    crossed = crossed[np.lexsort((crossings.t[crossed], ray_ix[crossed]))]
    rays_hit, first = np.unique(ray_ix[crossed], return_index=True)
    hits = Hits(np.full(len(rays), np.inf), np.full(len(rays), MISS))
    hits.t[rays_hit], hits.triangle_ix[rays_hit] = crossings.t[crossed[first]], triangle_ix[crossed[first]]
    return hits


def self_check(rng, n):
    """Plants wrong answers among right ones. Asserts that all of them are counted, and nothing else."""
    mesh, n_planted = sphere(3), 7
    rays = next(judged_rays(rng, mesh, n))
    pairs = pair_up(mesh, rays)
    right = exact_hits(mesh, rays, pairs)
    assert count_wrong(mesh, rays, right, pairs).tolist() == [0, 0, 0], "right answers are counted as wrong"
    hit, missed = (np.flatnonzero(x)[:n_planted] for x in (right.triangle_ix != MISS, right.triangle_ix == MISS))
    assert len(hit) == len(missed) == n_planted
    for name, rays_ix, t, triangle_ix, expected in [
        ("lost", hit, np.inf, MISS, [n_planted, 0, 0]),
        ("false", missed, 1.0, 0, [0, n_planted, 0]),
        ("another triangle", hit, right.t[hit], (right.triangle_ix[hit] + 640) % 1280, [0, n_planted, 0]),
        ("wrong t", hit, right.t[hit] * 0.999, right.triangle_ix[hit], [0, 0, n_planted]),
    ]:
        hits = right.copy()
        hits.t[rays_ix], hits.triangle_ix[rays_ix] = t, triangle_ix
        counted = count_wrong(mesh, rays, hits, pairs).tolist()
        assert counted == expected, f"{name}: {counted} were counted of {n_planted} planted"
    for inside in (True, False):
        rays = leak_rays(rng, mesh, n, inside)
        hits = exact_hits(mesh, rays, pair_up(mesh, rays))
        before = find_leaks(mesh, rays, hits, inside)
        planted = np.flatnonzero(~before)[:n_planted]
        a, b, c = mesh.corners(slice(None))
        facing = rays.directions[planted] @ np.cross(b - a, c - a).T
        for name, t, triangle_ix in [("misses", np.inf, MISS), ("far faces", 2, facing.argmin(axis=1))]:
            leaking = hits.copy()
            leaking.t[planted], leaking.triangle_ix[planted] = t, triangle_ix
            counted = find_leaks(mesh, rays, leaking, inside).sum() - before.sum()
            assert counted == n_planted, f"{counted} leaks were counted of {n_planted} planted {name}"

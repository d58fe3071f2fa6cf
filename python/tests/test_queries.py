"""Answers that are known in advance."""

import numpy as np
from conftest import ball, fresh, random_rays, soup

import kdray


def brute_force(vertices, triangles, rays):
    """All hits of rays in double precision: (rays, triangles) of t, inf where there is none."""
    corners = vertices.astype(np.float64)[triangles]
    begin, along = (rays[:, None, part].astype(np.float64) for part in (slice(0, 3), slice(3, 6)))
    edge_u, edge_v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(along, edge_v)
    determinant = np.einsum("rtk,tk->rt", across, edge_u)
    offset = begin - corners[:, 0]
    u = np.einsum("rtk,rtk->rt", offset, across) / determinant
    other = np.cross(offset, edge_u)
    v = np.einsum("rtk,rtk->rt", np.broadcast_to(along, other.shape), other) / determinant
    t = np.einsum("rtk,tk->rt", other, edge_v) / determinant
    return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)


def test_hits_are_those_of_brute_force(device, random):
    parts = [soup(random, 100), soup(random, 50)]
    scene, rays = fresh(device, parts), random_rays(random, 5000)
    t = np.concatenate([brute_force(*part, rays) for part in parts], axis=1)
    hits, nearest = scene.cast_rays(rays), t.argmin(axis=1)
    is_hit = t.min(axis=1) < np.inf
    assert 0.2 < is_hit.mean() < 0.9
    np.testing.assert_allclose(hits["t_hit"], t.min(axis=1), rtol=1e-3, atol=1e-5)
    flat = np.where(hits["geometry_ids"] == 1, hits["primitive_ids"].astype(np.int64) + 100, hits["primitive_ids"])
    assert np.mean(flat[is_hit] == nearest[is_hit]) > 0.999
    assert (hits["geometry_ids"][~is_hit] == kdray.RaycastingScene.INVALID_ID).all()
    counts = scene.count_intersections(rays)
    assert np.mean(counts == np.sum(t < np.inf, axis=1)) > 0.999
    lists = scene.list_intersections(rays)
    assert (np.diff(lists["ray_splits"]) == counts).all()
    assert (lists["ray_ids"] == np.repeat(np.arange(len(rays)), counts)).all()
    sorted_t = np.sort(t, axis=1)[np.arange(t.shape[1]) < counts[:, None]]
    assert np.mean(np.isclose(lists["t_hit"], sorted_t, rtol=1e-3, atol=1e-5)) > 0.998
    assert (scene.test_occlusions(rays) == (hits["t_hit"] < np.inf)).all()


def test_few_queries_have_the_answers_of_many(device, random):
    scene, rays = fresh(device, [soup(random, 1500), soup(random, 1500)]), random_rays(random, 1000)
    queries = [
        lambda rays, n: scene.cast_rays(rays, nthreads=n),
        lambda rays, n: {"occluded": scene.test_occlusions(rays, nthreads=n)},
        lambda rays, n: {"counts": scene.count_intersections(rays, nthreads=n)},
        lambda rays, n: {"t_hit": scene.list_intersections(rays, nthreads=n, max_hits=2)["t_hit"]},
        lambda rays, n: scene.compute_closest_points(rays[:, :3], nthreads=n),
    ]
    for moves in [False, True]:
        if moves:
            scene.update_transforms([1], [np.diag([1, -2, 1, 1])])
        for query in queries:
            for size, n_threads, n in [(1, 1, 50), (64, 0, 640), (65, 2, 650)]:
                parts = [query(rays[first : first + size], n_threads) for first in range(0, n, size)]
                for name, column in query(rays[:n], 0).items():
                    np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), column)


def test_points_of_hits(device, random):
    parts = [soup(random, 100), soup(random, 50)]
    scene, rays = fresh(device, parts), random_rays(random, 3000)
    for hits, points in [
        (scene.cast_rays(rays), None),
        (closest := scene.compute_closest_points(rays[:, :3]), closest["points"]),
    ]:
        is_hit = hits["geometry_ids"] != kdray.RaycastingScene.INVALID_ID
        if points is None:
            points = rays[:, :3] + np.where(is_hit, hits["t_hit"], 0)[:, None] * rays[:, 3:]
        for id, (vertices, triangles) in enumerate(parts):
            chosen = is_hit & (hits["geometry_ids"] == id)
            corners = vertices[triangles[hits["primitive_ids"][chosen]]]
            u, v = hits["primitive_uvs"][chosen].T[..., None]
            by_weights = corners[:, 0] * (1 - u - v) + corners[:, 1] * u + corners[:, 2] * v
            np.testing.assert_allclose(points[chosen], by_weights, atol=2e-4)
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
            np.testing.assert_allclose(hits["primitive_normals"][chosen], normals, atol=1e-3)
    assert (hits["distances"] == scene.compute_distance(rays[:, :3])).all()


def test_signs_in_a_ball(device, random):
    scene = fresh(device, [ball(12)])
    points = random.uniform(-1.3, 1.3, (3000, 3)).astype(np.float32)
    radius = np.linalg.norm(points, axis=1)
    inside, outside = radius < np.cos(np.pi / 12) ** 2, radius > 1
    assert inside.sum() > 500 and outside.sum() > 500
    signed = scene.compute_signed_distance(points)
    np.testing.assert_array_equal(np.abs(signed), scene.compute_distance(points))
    assert (signed[inside] < 0).all() and (signed[outside] > 0).all()
    occupancy = scene.compute_occupancy(points, nsamples=5)
    assert ((occupancy == 1) == (signed < 0)).all()
    lattice = np.stack(np.meshgrid(*[np.linspace(-0.9, 0.9, 13)] * 3), axis=-1)
    is_in = np.linalg.norm(lattice, axis=-1) < 0.92
    assert (scene.compute_occupancy(lattice)[is_in] == 1).all(), "points on axes and planes of the mesh's edges"
    assert (scene.compute_occupancy(lattice)[np.linalg.norm(lattice, axis=-1) > 1] == 0).all()


def test_large_casts_are_those_of_small_ones(random):
    scene = fresh("cpu", [soup(random, 50)])
    rays = random_rays(random, 600_000)
    hits = scene.cast_rays(rays)
    for part in [slice(0, 1000), slice(262_000, 263_000), slice(599_000, 600_000)]:
        small = scene.cast_rays(rays[part])
        assert all((hits[key][part] == small[key]).all() for key in small)


def test_columns_alone_are_those_of_all(device, random):
    """t alone, origins and directions alone, and both have ways of their own."""
    scene, rays = fresh(device, [soup(random, 100)]), random_rays(random, 3000)
    ends = np.tile(np.array([0, np.inf], np.float32), (len(rays), 1))
    for given in [{"t_min": 0.0}, {"t_min": -5.0}, {"t_max": 0.4}, {"t_min": random.random(len(rays)) * 0.2}]:
        hits = scene.cast_rays(rays, **given)
        t = scene.cast_rays(rays, **given, out={"t_hit": np.empty(len(rays), np.float32)})["t_hit"]
        assert np.array_equal(t, hits["t_hit"]) and 0.05 < np.mean(t < np.inf) < 0.95
        given = {name.replace("t_min", "tnear").replace("t_max", "tfar"): value for name, value in given.items()}
        assert np.array_equal(scene.test_occlusions(rays, **given), t < np.inf)
    assert (scene.cast_rays(rays, t_min=-5.0)["t_hit"] < 0).any()
    whole, bare = (scene.cast_rays(given) for given in (np.concatenate([rays, ends], axis=1), rays))
    assert all(np.array_equal(whole[name], bare[name]) for name in bare)


def test_rays_that_can_only_miss(device):
    scene = fresh(device, [ball()])
    rays = np.array([[np.nan, 0, 0, 0, 0, 1], [0, 0, 0, 0, 0, 0], [0, 0, np.inf, 0, 0, 1], [0, 0, 0, 0, 0, 1]])
    hits = scene.cast_rays(rays)
    assert (hits["t_hit"] < np.inf).tolist() == [False, False, False, True]
    assert scene.compute_distance([[np.nan, 0, 0]]).tolist() == [np.inf]


def test_no_rays(device):
    scene = fresh(device, [ball()])
    assert scene.cast_rays(np.zeros((0, 6)))["primitive_uvs"].shape == (0, 2)
    assert scene.list_intersections(np.zeros((0, 6)))["ray_splits"].tolist() == [0]
    assert scene.compute_signed_distance(np.zeros((0, 3))).shape == (0,)

"""Masks: a query finds what it finds in a scene without the geometries that its mask does not meet."""

import pickle

import numpy as np
import pytest
from conftest import assert_same_hits, ball, fresh, random_rays, soup

import kdray

MASKS = [0x81, 0x01, 0x02, 0x00]


def masked(device, parts, masks=MASKS):
    scene = kdray.RaycastingScene(device=device)
    for (vertices, triangles), mask in zip(parts, masks):
        scene.add_triangles(vertices, triangles, mask=mask)
    return scene


def without(device, parts, masks, mask):
    """A scene without the geometries that the mask does not meet, with the same ids."""
    scene = fresh(device, parts)
    for id, own in enumerate(masks):
        if not own & mask:
            scene.remove(id)
    return scene


@pytest.mark.parametrize("mask", [0xFF, 0x01, 0x80, 0x82])
def test_masked_geometries_are_not_there(device, random, mask):
    parts = [soup(random, 60) for _ in MASKS]
    rays = random_rays(random, 5000)
    scene, expected = masked(device, parts), without(device, parts, MASKS, mask)
    assert_same_hits(scene.cast_rays(rays, mask=mask), expected.cast_rays(rays))
    with pytest.raises(AssertionError):
        assert_same_hits(scene.cast_rays(rays, mask=0x02), expected.cast_rays(rays))
    for name in ["test_occlusions", "count_intersections"]:
        ours, theirs = getattr(scene, name)(rays, mask=mask), getattr(expected, name)(rays)
        assert np.mean(ours == theirs) > 0.999, name
    ours, theirs = scene.list_intersections(rays, mask=mask), expected.list_intersections(rays)
    n_of_geometries = [np.bincount(it["geometry_ids"], minlength=len(MASKS)) for it in (ours, theirs)]
    assert np.abs(n_of_geometries[0] - n_of_geometries[1]).max() <= 5
    assert (n_of_geometries[0] > 0).tolist() == [own & mask > 0 for own in MASKS]
    points = rays[:1000, :3]
    for name in ["compute_distance", "compute_signed_distance"]:
        ours, theirs = getattr(scene, name)(points, mask=mask), getattr(expected, name)(points)
        assert np.mean(np.abs(ours - theirs) < 1e-5) > 0.998, name
    ids = scene.compute_closest_points(points, mask=mask)["geometry_ids"]
    assert {id for id, own in enumerate(MASKS) if own & mask} == set(ids.tolist())


def test_masks_change_and_stay(device, random):
    parts, rays = [soup(random, 60) for _ in range(3)], random_rays(random, 5000)
    scene = fresh(device, parts)
    everything = scene.cast_rays(rays)
    assert_same_hits(scene.cast_rays(rays, mask=0x10), everything, most=0)
    scene.set_masks([0, 2], [0x10, 0])
    for again in [scene, pickle.loads(pickle.dumps(scene))]:
        assert_same_hits(again.cast_rays(rays, mask=0x10), without(device, parts, [1, 1, 0], 1).cast_rays(rays))
        assert_same_hits(again.cast_rays(rays, mask=0x01), without(device, parts, [0, 1, 0], 1).cast_rays(rays))
    scene.update_vertices(0, parts[0][0] * 0.5)
    parts[0] = (parts[0][0] * np.float32(0.5), parts[0][1])
    assert_same_hits(scene.cast_rays(rays, mask=0x10), without(device, parts, [1, 1, 0], 1).cast_rays(rays))
    scene.set_masks([0, 1, 2], 0xFF)
    assert_same_hits(scene.cast_rays(rays, mask=0x10), fresh(device, parts).cast_rays(rays))


def test_rays_that_meet_no_geometry_miss(device):
    scene = masked(device, [ball(8)], [0x02])
    ray = [0, 0, 3, 0, 0, -1]
    assert scene.cast_rays(ray, mask=0x01)["t_hit"] == np.inf and scene.cast_rays(ray, mask=0x03)["t_hit"] == 2
    assert scene.count_intersections(ray, mask=0x01) == 0 and scene.compute_distance([0, 0, 3], mask=1) == np.inf
    assert scene.compute_occupancy([[0, 0, 0]], mask=0x01) == 0 and scene.compute_occupancy([[0, 0, 0]]) == 1

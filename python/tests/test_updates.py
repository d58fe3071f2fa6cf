"""Scenes that change: hits are those of a new scene."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import assert_same_hits, ball, fresh, random_rays, soup

import kdray


def random_transforms(random, n, mirrors=False):
    """Turns and shifts, all or none of which mirror."""
    turns, _ = np.linalg.qr(random.normal(size=(n, 3, 3)))
    turns *= random.uniform(0.5, 1.2, (n, 1, 1))
    turns[(np.linalg.det(turns) < 0) != mirrors] *= -1
    return np.concatenate([turns, random.uniform(-0.5, 0.5, (n, 3, 1))], axis=2)


def placed(vertices, transform):
    return (vertices @ transform[:, :3].T + transform[:, 3]).astype(np.float32)


def assert_same_lists(ours, expected):
    """Compares the hits of rays that have equally many. Hits at the same t may come in another order."""
    counts = [np.diff(it["ray_splits"]) for it in (ours, expected)]
    agree = counts[0] == counts[1]
    assert np.mean(agree) > 0.999
    lists = []
    for it in (ours, expected):
        order = np.lexsort([it["primitive_ids"], it["geometry_ids"], it["ray_ids"]])
        order = order[agree[it["ray_ids"][order]]]
        lists.append({key: it[key][order] for key in ["geometry_ids", "primitive_ids", "t_hit", "primitive_uvs"]})
    same = (lists[0]["geometry_ids"] == lists[1]["geometry_ids"]) & (
        lists[0]["primitive_ids"] == lists[1]["primitive_ids"]
    )
    assert np.mean(same) > 0.999
    for key in ["t_hit", "primitive_uvs"]:
        assert np.mean(np.abs(lists[0][key] - lists[1][key])[same] < 2e-3) > 0.999


@pytest.mark.parametrize("mirrors", [False, True])
def test_transforms(device, random, mirrors):
    parts = [soup(random, 40) for _ in range(8)]
    scene, rays = fresh(device, parts), random_rays(random, 5000)
    scene.cast_rays(rays)
    transforms = np.tile(np.eye(3, 4), (8, 1, 1))
    for ids in [[3], [0, 5, 7], [3, 1]]:
        transforms[ids] = random_transforms(random, len(ids), mirrors)
        scene.update_transforms(ids, transforms[ids])
        moved = [(placed(vertices, at), triangles) for (vertices, triangles), at in zip(parts, transforms)]
        again = fresh(device, moved)
        assert_same_hits(scene.cast_rays(rays), again.cast_rays(rays))
        assert np.mean(scene.test_occlusions(rays) == again.test_occlusions(rays)) > 0.999
        assert_same_lists(scene.list_intersections(rays), again.list_intersections(rays))
        assert (np.diff(scene.list_intersections(rays)["ray_splits"]) == scene.count_intersections(rays)).all()
        closest, expected = (it.compute_closest_points(rays[:, :3]) for it in (scene, again))
        np.testing.assert_allclose(closest["distances"], expected["distances"], atol=1e-5)
        same = closest["primitive_ids"] == expected["primitive_ids"]
        assert np.mean(same) > 0.99
        np.testing.assert_allclose(closest["points"][same], expected["points"][same], atol=1e-4)
        near = np.abs(closest["primitive_uvs"] - expected["primitive_uvs"])[same]
        assert np.mean(near < 1e-3) > 0.99


def test_vertices(device, random):
    parts = [soup(random, 40), soup(random, 60)]
    scene, rays = fresh(device, parts), random_rays(random, 5000)
    scene.cast_rays(rays)
    changed = random.uniform(-1, 1, (30, 3)).astype(np.float32)
    scene.update_vertices(1, changed, first=12)
    parts[1][0][12:42] = changed
    expected = fresh(device, parts)
    assert_same_hits(scene.cast_rays(rays), expected.cast_rays(rays), most=0)
    scene.update_transforms([0], random_transforms(random, 1))
    scene.update_vertices(0, parts[0][0] * 0.5)
    scene.update_transforms([0], [np.eye(4)])
    expected = fresh(device, [(parts[0][0] * 0.5, parts[0][1]), parts[1]])
    assert_same_hits(scene.cast_rays(rays), expected.cast_rays(rays))


def test_many_hits_are_described_as_few_are(device, random):
    """Of many rays, hits are looked up in a table of all triangles, which is that of the scene as it is now."""
    parts = [soup(random, 3000), soup(random, 3000)]
    few, many, rays = fresh(device, parts), fresh(device, parts), random_rays(random, 5000)
    mirrored, turned = (random_transforms(random, 2, mirrors) for mirrors in [True, False])
    changes = [
        lambda scene: None,
        lambda scene: scene.update_transforms([1], mirrored[:1]),
        lambda scene: scene.update_transforms([0, 1], [mirrored[1], turned[0]]),
        lambda scene: scene.set_masks([0], [2]),
        lambda scene: (scene.set_masks([0], [255]), scene.update_transforms([1], turned[1:])),
        lambda scene: (scene.update_transforms([1], mirrored[:1]), scene.set_masks([1], [6])),
        lambda scene: scene.update_vertices(1, 0.5 * parts[1][0]),
    ]
    for change in changes:
        change(few), change(many)
        expected, hits = few.cast_rays(rays), many.cast_rays(np.tile(rays, (2, 1)))
        assert np.mean(expected["t_hit"] < np.inf) > 0.2
        for key in expected:
            assert hits[key][:5000].tobytes() == expected[key].tobytes(), key


@pytest.mark.parametrize("width", [6, 8])
def test_ranges_of_rays(device, random, width):
    """One range for all rays, or one for each, in rays or beside them."""
    scene, rays = fresh(device, [soup(random, 100)]), random_rays(random, 20_000)
    t = scene.cast_rays(rays)["t_hit"]
    low, high = (random.uniform(0, 2, len(rays)).astype(np.float32) for _ in range(2))
    for t_min, t_max in [(low, high), (0.25, high), (low, np.inf), (0.25, 1.5)]:
        ends = {"t_min": t_min, "t_max": t_max}
        wide = np.column_stack([rays, *(np.broadcast_to(it, len(rays)) for it in ends.values())]).astype(np.float32)
        found = scene.cast_rays(wide)["t_hit"] if width == 8 else scene.cast_rays(rays, **ends)["t_hit"]
        assert ((found == np.inf) | ((t_min < found) & (found <= t_max))).all()
        is_within = (t_min < t) & (t <= t_max)
        assert is_within.any() and (found[is_within] == t[is_within]).all()


def test_remove(device, random):
    parts = [soup(random, 40) for _ in range(3)]
    scene, rays = fresh(device, parts), random_rays(random, 5000)
    scene.remove(1)
    hits, expected = scene.cast_rays(rays), fresh(device, [parts[0], parts[2]]).cast_rays(rays)
    expected["geometry_ids"][expected["geometry_ids"] == 1] = 2
    assert_same_hits(hits, expected, most=0)
    assert set(hits["geometry_ids"]) == {0, 2, scene.INVALID_ID}
    assert scene.add_triangles(*parts[1]) == 3, "ids are not given out again"
    assert set(scene.compute_closest_points(rays[:, :3])["geometry_ids"]) == {0, 2, 3}
    with pytest.raises(IndexError, match="geometry 1 was removed"):
        scene.update_vertices(1, parts[1][0])


def test_only_changed_geometries_get_new_structures(device, random):
    parts = [soup(random, 40) for _ in range(4)]
    scene, rays = fresh(device, parts), random_rays(random, 3000)

    def structures():
        assert_same_hits(scene.cast_rays(rays), expected.cast_rays(rays))
        return scene._core.structures()

    expected = fresh(device, parts)
    assert structures() == [], "geometries that never changed have one structure"
    parts[2] = (parts[2][0] * np.float32(0.7), parts[2][1])
    scene.update_vertices(2, parts[2][0])
    expected = fresh(device, parts)
    first = structures()
    assert len(set(first)) == 4
    parts[1] = (parts[1][0] * np.float32(0.8), parts[1][1])
    scene.update_vertices(1, parts[1][0])
    expected = fresh(device, parts)
    second = structures()
    assert [a == b for a, b in zip(first, second)] == [True, False, True, True]
    scene.remove(0)
    parts.append(soup(random, 20))
    assert scene.add_triangles(*parts[4]) == 4
    expected = fresh(device, parts)
    expected.remove(0)
    third = structures()
    assert third[:3] == second[1:] and third[3] not in second
    scene.set_masks([4], 0)
    expected.remove(4)
    assert structures() == third
    scene.update_transforms([3], random_transforms(random, 1))
    scene.update_transforms([3], [np.eye(4)])
    scene.update_vertices(3, parts[3][0])
    assert [a == b for a, b in zip(structures(), third)] == [True, True, False, True]


def test_a_stale_scene_would_be_noticed(device, random):
    """The comparison of the tests above fails for a scene that has missed a change."""
    parts = [soup(random, 40), soup(random, 60)]
    scene, rays = fresh(device, parts), random_rays(random, 5000)
    parts[1][0][:9] += 0.3
    again = fresh(device, parts)
    with pytest.raises(AssertionError):
        assert_same_hits(scene.cast_rays(rays), again.cast_rays(rays))
    with pytest.raises(AssertionError):
        assert_same_lists(scene.list_intersections(rays), again.list_intersections(rays))


def test_memory_stays_constant(random):
    scene = fresh("cpu", [ball(8) for _ in range(10)])
    rays, ids = random_rays(random, 64), np.arange(10)

    def updates(n):
        for _ in range(n):
            scene.update_transforms(ids, random_transforms(random, 10))
            scene.cast_rays(rays)
            scene.compute_closest_points(rays[:, :3])
            scene.count_intersections(rays)
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    before = updates(500)
    assert updates(2500) - before < 4096, "KiB"


@pytest.mark.parametrize("n_geometries", [1, 2])
def test_the_world_before_is_freed_first(n_geometries):
    """Updates need no more memory than the first build, in a process that keeps nothing of what is freed."""
    code = f"""
from pathlib import Path
import numpy as np
from conftest import ball
import kdray

def peak():
    return int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0])

vertices, triangles = ball(220)
peaks, scene = [peak()], kdray.RaycastingScene(device="cpu")
for _ in range({n_geometries}):
    scene.add_triangles(vertices, triangles)
for size in [1, 2, 3]:
    scene.update_vertices(0, vertices * np.float32(size))
    assert np.isfinite(scene.cast_rays([[5, 0.1, 0.1, -1, 0, 0]])["t_hit"]).all()
    peaks.append(peak())
print(*np.diff(peaks))
"""
    environment = os.environ | {"MALLOC_MMAP_THRESHOLD_": "65536"}
    here = Path(__file__).parent
    done = subprocess.run([sys.executable, "-c", code], cwd=here, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    first, *others = map(int, done.stdout.split())
    assert sum(others) < 0.15 * first, "KiB"


def test_transforms_that_cannot_keep_a_space_of_their_own(device, random):
    parts = [ball(8), soup(random, 20)]
    scene, rays = fresh(device, parts), random_rays(random, 3000)
    thin = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1e-7, 0.25]])
    scene.update_transforms([0], [thin])
    again = fresh(device, [(placed(parts[0][0], thin), parts[0][1]), parts[1]])
    ours, expected = scene.cast_rays(rays), again.cast_rays(rays)
    np.testing.assert_allclose(ours["t_hit"], expected["t_hit"], rtol=1e-3, atol=1e-4)
    scene.update_transforms([0], [np.eye(3, 4)])
    assert_same_hits(scene.cast_rays(rays), fresh(device, parts).cast_rays(rays))

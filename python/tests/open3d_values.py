"""The values that Open3D documents for RaycastingScene, for either package.

``python open3d_values.py kdray`` and ``python open3d_values.py open3d`` check them: only the import differs.
``python open3d_values.py both`` also casts random rays with both, and compares all that they return.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

BOX_VERTICES = np.array(
    [[0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1], [0, 1, 0], [1, 1, 0], [0, 1, 1], [1, 1, 1]], np.float32
)
BOX_TRIANGLES = np.array(
    [[4, 7, 5], [4, 6, 7], [0, 2, 4], [2, 6, 4], [0, 1, 2], [1, 3, 2],
     [1, 5, 7], [1, 7, 3], [2, 3, 7], [2, 7, 6], [0, 4, 1], [1, 4, 5]], np.uint32
)  # fmt: skip


class Package:
    """Open3D or kdray."""

    def __init__(self, name: str, device: str | None = "cpu") -> None:
        self.name = name
        if name == "open3d":
            import open3d

            self.tensor: Any = open3d.core.Tensor
            self.scene_class: Any = open3d.t.geometry.RaycastingScene
            self.new_scene: Any = open3d.t.geometry.RaycastingScene
        else:
            import kdray

            self.tensor = np.asarray
            self.scene_class = kdray.RaycastingScene
            self.new_scene = lambda: kdray.RaycastingScene(device=device)

    def scene(self, *geometries: tuple[Any, Any]) -> Any:
        scene = self.new_scene()
        for vertices, triangles in geometries:
            scene.add_triangles(self.tensor(vertices), self.tensor(triangles))
        return scene

    def call(self, method: Any, values: Any, **kwargs: Any) -> Any:
        """Calls a method with an array, and returns arrays."""
        result = method(self.tensor(np.asarray(values, np.float32)), **kwargs)
        return {key: to_numpy(value) for key, value in result.items()} if isinstance(result, dict) else to_numpy(result)


def to_numpy(value: Any) -> Any:
    return value if isinstance(value, np.ndarray) else value.numpy()


def check_cast(package: Package) -> None:
    triangle = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0]], np.float32), np.array([[0, 1, 2]], np.uint32)
    scene = package.scene(triangle)
    hits = package.call(scene.cast_rays, [[0.2, 0.1, 1, 0, 0, -1], [10, 10, 10, 1, 0, 0]])
    invalid = package.scene_class.INVALID_ID
    assert invalid == 2**32 - 1
    np.testing.assert_array_equal(hits["geometry_ids"], [0, invalid])
    np.testing.assert_array_equal(hits["primitive_ids"], [0, invalid])
    np.testing.assert_allclose(hits["t_hit"], [1, np.inf], rtol=1e-6)
    np.testing.assert_allclose(hits["primitive_uvs"], [[0.1, 0.1], [0, 0]], atol=1e-6)
    np.testing.assert_allclose(hits["primitive_normals"], [[0, 0, 1], [0, 0, 0]], atol=1e-6)
    types = {"t_hit": "float32", "geometry_ids": "uint32", "primitive_ids": "uint32"}
    types |= {"primitive_uvs": "float32", "primitive_normals": "float32"}
    assert {key: str(value.dtype) for key, value in hits.items()} == types


def check_occlusions(package: Package) -> None:
    scene = package.scene((BOX_VERTICES, BOX_TRIANGLES))
    rays = [[0.3, 0.5, -1, 0, 0, 1], [0.3, 0.5, -1, 0, 0, -1]]
    for kwargs, expected in [({}, [True, False]), ({"tfar": 0.5}, [False, False]), ({"tnear": 2.5}, [False, False])]:
        result = package.call(scene.test_occlusions, rays, **kwargs)
        assert result.dtype == bool and result.tolist() == expected, kwargs


def check_all_hits(package: Package) -> None:
    scene = package.scene((BOX_VERTICES, BOX_TRIANGLES))
    rays = [[0.5, 0.25, -1, 0, 0, 1], [0.5, 0.25, 0.5, 0, 0, 1], [10, 10, 10, 1, 0, 0]]
    counts = package.call(scene.count_intersections, rays)
    assert counts.dtype == np.int32 and counts.tolist() == [2, 1, 0]
    lists = package.call(scene.list_intersections, rays)
    assert lists["ray_splits"].tolist() == [0, 2, 3, 3] and lists["ray_ids"].tolist() == [0, 0, 1]
    np.testing.assert_allclose(np.sort(lists["t_hit"][:2]), [1, 2], rtol=1e-6)
    np.testing.assert_allclose(lists["t_hit"][2], 0.5, rtol=1e-6)
    assert lists["geometry_ids"].tolist() == [0, 0, 0] and lists["primitive_uvs"].shape == (3, 2)
    types = {key: str(value.dtype) for key, value in lists.items()}
    uints = ["ray_splits", "ray_ids", "geometry_ids", "primitive_ids"]
    assert types == {**dict.fromkeys(uints, "uint32"), "t_hit": "float32", "primitive_uvs": "float32"}


def check_points(package: Package) -> None:
    triangle = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0]], np.float32), np.array([[0, 1, 2]], np.uint32)
    closest = package.call(package.scene(triangle).compute_closest_points, [[0.2, 0.1, 1], [10, 10, 10]])
    np.testing.assert_allclose(closest["points"], [[0.2, 0.1, 0], [1, 1, 0]], atol=1e-6)
    assert closest["geometry_ids"].tolist() == [0, 0] and closest["primitive_ids"].tolist() == [0, 0]
    np.testing.assert_allclose(closest["primitive_uvs"], [[0.1, 0.1], [0, 1]], atol=1e-6)
    np.testing.assert_allclose(closest["primitive_normals"], [[0, 0, 1], [0, 0, 1]], atol=1e-6)
    box = package.scene((BOX_VERTICES, BOX_TRIANGLES))
    points = [[0.5, 0.5, 0.5], [-0.5, -0.5, -0.5], [0, 0, 0]]
    far = np.sqrt(3 * 0.5**2)
    np.testing.assert_allclose(package.call(box.compute_distance, points), [0.5, far, 0], rtol=1e-6)
    np.testing.assert_allclose(package.call(box.compute_signed_distance, points), [-0.5, far, 0], rtol=1e-6)
    np.testing.assert_array_equal(package.call(box.compute_occupancy, points[:2]), [1, 0])
    for nsamples in [3, 5]:
        occupancy = package.call(box.compute_occupancy, points[:2], nsamples=nsamples)
        assert occupancy.dtype == np.float32 and occupancy.tolist() == [1, 0]


def check_shapes(package: Package) -> None:
    scene = package.scene((BOX_VERTICES, BOX_TRIANGLES))
    for shape in [(1,), (3,), (2, 3), (4, 2, 3)]:
        rays, points = np.ones((*shape, 6), np.float32), np.ones((*shape, 3), np.float32)
        ends = {"t_hit": (), "geometry_ids": (), "primitive_ids": (), "primitive_uvs": (2,), "primitive_normals": (3,)}
        hits = package.call(scene.cast_rays, rays)
        assert {key: value.shape for key, value in hits.items()} == {key: shape + end for key, end in ends.items()}
        closest = package.call(scene.compute_closest_points, points)
        assert closest["points"].shape == (*shape, 3) and closest["primitive_uvs"].shape == (*shape, 2)
        for method in ["compute_distance", "compute_signed_distance", "compute_occupancy"]:
            assert package.call(getattr(scene, method), points).shape == shape
        for method in ["test_occlusions", "count_intersections"]:
            assert package.call(getattr(scene, method), rays).shape == shape


# A view from (1, 2, 3) to the origin, as Open3D 0.20 returns it: the direction of the first and of the last ray.
VIEW_FIRST = [0.1923256814479828, -0.7784975171089172, -0.7923293113708496]
VIEW_LAST = [-0.7268481850624084, -0.2905474901199341, -0.8112380504608154]


def check_pinhole(package: Package) -> None:
    create, tensor = package.scene_class.create_rays_pinhole, package.tensor
    center, eye, up = (tensor(np.array(it, np.float64)) for it in ([0, 0, 0], [1, 2, 3], [0, 1, 0]))
    rays = to_numpy(create(fov_deg=60, center=center, eye=eye, up=up, width_px=4, height_px=3))
    assert rays.shape == (3, 4, 6) and rays.dtype == np.float32
    np.testing.assert_allclose(rays[0, 0], [1, 2, 3, *VIEW_FIRST], rtol=1e-5)
    np.testing.assert_allclose(rays[2, 3], [1, 2, 3, *VIEW_LAST], rtol=1e-5)
    intrinsic = tensor(np.array([[100, 0, 2], [0, 100, 1.5], [0, 0, 1]]))
    turned = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], np.float64)
    rays = to_numpy(create(intrinsic, tensor(turned), 4, 3))
    np.testing.assert_allclose(rays[0, 1], [-2, 1, -3, -0.01, 0.005, 1], atol=1e-6)


CHECKS = [check_cast, check_occlusions, check_all_hits, check_points, check_shapes, check_pinhole]


def compare() -> None:
    """Compares both packages on random triangles, rays and points."""
    random = np.random.default_rng(1)
    geometries = []
    for n in [200, 1, 500]:
        corners = random.uniform(-1, 1, (n, 1, 3)) + random.uniform(-0.1, 0.1, (n, 3, 3))
        geometries.append((corners.reshape(-1, 3).astype(np.float32), np.arange(3 * n, dtype=np.uint32).reshape(n, 3)))
    rays = random.uniform(-1, 1, (100_000, 6)).astype(np.float32)
    points = rays[:20_000, :3].copy()
    packages = [Package("open3d"), Package("kdray")]
    scenes = [package.scene(*geometries) for package in packages]
    call = [lambda name, values, p=p, s=s: p.call(getattr(s, name), values) for p, s in zip(packages, scenes)]
    theirs, ours = (it("cast_rays", rays) for it in call)
    same = (theirs["geometry_ids"] == ours["geometry_ids"]) & (theirs["primitive_ids"] == ours["primitive_ids"])
    print(f"cast_rays: {np.mean(ours['t_hit'] < np.inf):.0%} hit, {np.sum(~same)} of {len(rays)} differ")
    assert np.mean(same) > 0.9999
    for key, tolerance in [("t_hit", 1e-4), ("primitive_uvs", 1e-3), ("primitive_normals", 1e-3)]:
        np.testing.assert_allclose(ours[key][same], theirs[key][same], rtol=1e-3, atol=tolerance)
    theirs, ours = (it("count_intersections", rays) for it in call)
    print(f"count_intersections: {np.sum(theirs != ours)} of {len(rays)} differ, {ours.sum()} hits")
    assert np.mean(theirs == ours) > 0.9999
    theirs, ours = (it("compute_closest_points", points) for it in call)
    distances = [np.linalg.norm(it["points"] - points, axis=1) for it in (theirs, ours)]
    np.testing.assert_allclose(distances[1], distances[0], rtol=1e-4, atol=1e-6)
    same = (theirs["geometry_ids"] == ours["geometry_ids"]) & (theirs["primitive_ids"] == ours["primitive_ids"])
    print(f"compute_closest_points: {np.sum(~same)} of {len(points)} differ in the triangle, none in the distance")
    np.testing.assert_allclose(ours["primitive_normals"][same], theirs["primitive_normals"][same], atol=1e-3)
    theirs, ours = (it("test_occlusions", rays) for it in call)
    assert np.mean(theirs == ours) > 0.9999


if __name__ == "__main__":
    for name in ["open3d", "kdray"] if sys.argv[1:] == ["both"] else sys.argv[1:]:
        package = Package(name)
        for check in CHECKS:
            check(package)
        print(f"{name}: {len(CHECKS)} checks hold")
    if sys.argv[1:] == ["both"]:
        compare()

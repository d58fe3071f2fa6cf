"""The interface of Open3D."""

import numpy as np
import pytest
from open3d_values import BOX_TRIANGLES, BOX_VERTICES, CHECKS, Package

import kdray


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_documented_values(check, device):
    check(Package("kdray", device))


def test_the_values_tell_a_wrong_scene():
    class Wrong(Package):
        def scene(self, *geometries):
            return super().scene(*[(vertices * 1.01, triangles) for vertices, triangles in geometries])

    for check in CHECKS[:4]:
        if check.__name__ != "check_occlusions":
            with pytest.raises(AssertionError):
                check(Wrong("kdray"))


def test_one_ray_has_results_without_axes(device):
    scene = kdray.RaycastingScene(device=device)
    scene.add_triangles(BOX_VERTICES, BOX_TRIANGLES)
    hits = scene.cast_rays([0.5, 0.25, 3, 0, 0, -1])
    assert hits["t_hit"].shape == () and hits["t_hit"] == 2
    assert hits["primitive_normals"].tolist() == [0, 0, 1]
    assert scene.compute_distance([0.5, 0.5, 3]) == 2


def test_meshes_are_added(random):
    class Mesh:
        vertices, faces = BOX_VERTICES, BOX_TRIANGLES

    scene = kdray.RaycastingScene(device="cpu")
    assert [scene.add_triangles(Mesh()), scene.add_triangles(Mesh())] == [0, 1]
    assert scene.count_intersections([0.5, 0.25, 3, 0, 0, -1]) == 4, "triangles that coincide all count"


def test_the_range_of_t(device):
    scene = kdray.RaycastingScene(device=device)
    scene.add_triangles(BOX_VERTICES, BOX_TRIANGLES)
    rays = np.array([[0.5, 0.25, 3, 0, 0, -1]] * 3, np.float32)
    np.testing.assert_array_equal(scene.cast_rays(rays, t_min=[0, 2, 3])["t_hit"], [2, 3, np.inf])
    np.testing.assert_array_equal(scene.cast_rays(rays, t_max=[1, 2, 3])["t_hit"], [np.inf, 2, 2])
    np.testing.assert_array_equal(scene.count_intersections(rays, t_min=2), [1, 1, 1])
    assert scene.list_intersections(rays, max_hits=1)["t_hit"].tolist() == [2, 2, 2]
    own = np.concatenate([rays, [[0, 10], [2, 10], [0, 1]]], axis=1)
    np.testing.assert_array_equal(scene.cast_rays(own)["t_hit"], [2, 3, np.inf])
    assert scene.test_occlusions(own).tolist() == [True, True, False]
    assert scene.test_occlusions(rays, tfar=[1, 2, 3]).tolist() == [False, True, True]


def test_results_go_where_they_are_wanted(device):
    scene = kdray.RaycastingScene(device=device)
    scene.add_triangles(BOX_VERTICES, BOX_TRIANGLES)
    rays = np.tile(np.array([0.5, 0.25, 3, 0, 0, -1], np.float32), (4, 2, 1))
    out = {"t_hit": np.zeros((4, 2), np.float32), "primitive_uvs": np.zeros((4, 2, 2), np.float32)}
    result = scene.cast_rays(rays, out=out)
    assert result["t_hit"] is out["t_hit"] and set(result) == set(out)
    assert (out["t_hit"] == 2).all() and (out["primitive_uvs"] == scene.cast_rays(rays)["primitive_uvs"]).all()


@pytest.mark.parametrize("width", [6, 8])
@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.float16, np.int32])
def test_layouts(width, dtype):
    scene = kdray.RaycastingScene(device="cpu")
    scene.add_triangles(BOX_VERTICES.astype(np.float64), BOX_TRIANGLES.astype(np.int64))
    row = [0.5, 0.25, 3, 0, 0, -1, 0, 9] if dtype != np.int32 else [0, 0, 3, 0, 0, -1, 0, 9]
    rays = np.tile(np.array(row[:width], dtype), (5, 1))
    for view in [rays, np.asfortranarray(rays), np.repeat(rays, 2, axis=0)[::2], memoryview(rays), rays.tolist()]:
        assert scene.cast_rays(view)["t_hit"].tolist() == [2] * 5


def test_map_coordinates_keep_millimetres():
    corner = np.array([691_234.0, 5_335_678.0, 512.0])
    scene = kdray.RaycastingScene(device="cpu")
    scene.add_triangles(BOX_VERTICES * 0.01 + corner, BOX_TRIANGLES)
    np.testing.assert_array_equal(scene.origin, np.rint(corner + 0.005))
    ray = [*(corner + [0.005, 0.0025, 2]), 0, 0, -1]
    np.testing.assert_allclose(scene.cast_rays(ray)["t_hit"], 1.99, atol=1e-6)
    point = corner + [0.005, 0.0025, 2]
    closest = scene.compute_closest_points(point)
    np.testing.assert_allclose(closest["points"], corner + [0.005, 0.0025, 0.01], rtol=0, atol=1e-7)
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    moved = np.column_stack([turn, corner + [0, 0, 1] - turn @ corner])
    scene.update_transforms(0, moved)
    np.testing.assert_allclose(scene.cast_rays([*(corner + [-0.005, 0.0025, 2]), 0, 0, -1])["t_hit"], 0.99, atol=1e-6)


def test_near_coordinates_are_as_they_are():
    scene = kdray.RaycastingScene(device="cpu")
    scene.add_triangles(BOX_VERTICES.astype(np.float64), BOX_TRIANGLES)
    assert not scene.origin.any() and scene.compute_closest_points(np.zeros(3))["points"].dtype == np.float32
    scene = kdray.RaycastingScene(device="cpu", origin=[1, 2, 3])
    scene.add_triangles(BOX_VERTICES, BOX_TRIANGLES)
    assert scene.cast_rays([0.5, 0.25, 3, 0, 0, -1])["t_hit"] == 2
    assert scene.compute_closest_points(np.float32([0.5, 0.25, 3]))["points"].tolist() == [0.5, 0.25, 1]

"""Bad input: one error that names the argument, and what was expected and given."""

import enum

import numpy as np
import pytest
from conftest import ball

import kdray


@pytest.fixture
def scene():
    scene = kdray.RaycastingScene(device="cpu")
    scene.add_triangles(*ball(6))
    return scene


VERTICES, TRIANGLES = ball(6)
HUGE = VERTICES.astype(np.float64)
RAYS = np.zeros((4, 6), np.float32)


class OnCuda:
    """A tensor as torch has it on a GPU."""

    def __dlpack_device__(self):
        return 2, 0


class OnlyDlpack:
    """A tensor of a package that knows no other protocol."""

    def __init__(self, array):
        self.array = array

    def __dlpack__(self, **kwargs):
        return self.array.__dlpack__(**kwargs)

    def __dlpack_device__(self):
        return enum.Enum("Kind", ["CPU"]).CPU, 0


CASES = [
    (lambda s: s.cast_rays(np.zeros((4, 5))), ValueError, r"rays: expected the shape \(..., 6\) or .* not \(4, 5\)"),
    (lambda s: s.cast_rays([[1, 2, 3], [4]]), ValueError, "rays: expected an array of numbers"),
    (lambda s: s.cast_rays([["a"] * 6]), TypeError, "rays: expected an array of numbers, not of <U1"),
    (lambda s: s.cast_rays(None), TypeError, "rays: expected an array of numbers"),
    (lambda s: s.cast_rays(np.zeros((2, 6), complex)), TypeError, "rays: .* not of complex128"),
    (lambda s: s.cast_rays(OnCuda()), TypeError, r"rays: .*\.cpu\(\)"),
    (lambda s: s.cast_rays(RAYS, t_min=[0, 1]), ValueError, r"t_min: .* \(4,\), not \(2,\)"),
    (lambda s: s.test_occlusions(RAYS, tfar=[0, 1]), ValueError, r"tfar: .* \(4,\), not \(2,\)"),
    (lambda s: s.cast_rays(RAYS, nthreads=-1), ValueError, "nthreads: expected an integer from 0 on, not -1"),
    (lambda s: s.cast_rays(RAYS, nthreads=1.5), TypeError, "nthreads: expected an integer, not float"),
    (lambda s: s.list_intersections(RAYS, max_hits="all"), TypeError, "max_hits: expected an integer, not str"),
    (lambda s: s.cast_rays(RAYS, out={"t": RAYS}), ValueError, "out: expected the keys t_hit, .* not t"),
    (lambda s: s.cast_rays(RAYS, out={"t_hit": np.zeros(4)}), TypeError, r'out\["t_hit"\]: .* float32, not float64'),
    (lambda s: s.cast_rays(RAYS, out={"t_hit": np.zeros(3, "f4")}), ValueError, r"shape \(4,\), not \(3,\)"),
    (lambda s: s.cast_rays(RAYS, out={"t_hit": np.zeros(8, "f4")[::2]}), ValueError, "C-contiguous"),
    (lambda s: s.compute_distance(RAYS), ValueError, r"query_points: expected the shape \(..., 3\), not \(4, 6\)"),
    (lambda s: s.compute_signed_distance(VERTICES, nsamples=2), ValueError, "nsamples: expected an odd number, not 2"),
    (lambda s: s.add_triangles(VERTICES[:, :2], TRIANGLES), ValueError, r"vertex_positions: .* not \(32, 2\)"),
    (lambda s: s.add_triangles(VERTICES[0], TRIANGLES), ValueError, r"vertex_positions: .*\(N, 3\), not \(3,\)"),
    (lambda s: s.add_triangles(VERTICES, TRIANGLES[:, :2]), ValueError, r"triangle_indices: .* not \(60, 2\)"),
    (lambda s: s.add_triangles(VERTICES, TRIANGLES * 1.0), TypeError, "triangle_indices: expected integers, not float"),
    (lambda s: s.add_triangles(VERTICES, TRIANGLES + 1), IndexError, "triangle_indices: .*index 32.* 32 vertices"),
    (lambda s: s.add_triangles(VERTICES, TRIANGLES.astype(int) - 1), IndexError, "triangle_indices: .* not -1 to 30"),
    (lambda s: s.add_triangles(VERTICES * np.nan, TRIANGLES), ValueError, "vertex_positions: vertex 0 .* not finite"),
    (lambda s: s.add_triangles(1e300 * HUGE, TRIANGLES), ValueError, "vertex_positions: vertex .* not finite"),
    (lambda s: s.add_triangles(VERTICES), TypeError, "triangle_indices: is missing"),
    (lambda s: s.cast_rays(RAYS, mask=0), ValueError, "mask: expected an integer from 1 on, not 0"),
    (lambda s: s.compute_distance(VERTICES, mask=256), ValueError, "mask: expected an integer up to 255, not 256"),
    (lambda s: s.test_occlusions(RAYS, mask="all"), TypeError, "mask: expected an integer, not str"),
    (lambda s: s.add_triangles(VERTICES, TRIANGLES, mask=-1), ValueError, "mask: expected an integer from 0 on"),
    (lambda s: s.set_masks([0, 1], [1, 2]), IndexError, "there is no geometry 1 among 1"),
    (lambda s: s.set_masks([0], [1, 2]), ValueError, r"masks: expected the shape \(1,\), not \(2,\)"),
    (lambda s: s.set_masks([0], 1.5), TypeError, "masks: expected an integer, not float64"),
    (lambda s: s.update_vertices(1, VERTICES), IndexError, "there is no geometry 1 among 1"),
    (lambda s: s.update_vertices(0, VERTICES, first=1), IndexError, "first: vertices 1 to 33 of 32"),
    (lambda s: s.update_vertices(0, VERTICES + np.inf), ValueError, "vertex_positions: vertex 0 .* not finite"),
    (lambda s: s.update_transforms([0, 0.5], np.zeros((2, 3, 4))), ValueError, "ids: expected integers"),
    (lambda s: s.update_transforms([0], np.zeros((2, 3, 4))), ValueError, r"transforms: .*\(1, 3, 4\), not \(2, 3"),
    (lambda s: s.update_transforms([0], np.zeros((1, 3, 4))), ValueError, r"transforms\[0\]: .* flattens"),
    (lambda s: s.update_transforms([0], np.full((1, 3, 4), np.nan)), ValueError, r"transforms\[0\]: .* not finite"),
    (lambda s: s.update_transforms([7], np.eye(4)[None]), IndexError, "there is no geometry 7 among 1"),
    (lambda s: s.update_transforms([-1], np.eye(4)[None]), IndexError, "ids: there is no geometry -1"),
    (lambda s: s.remove(-1), ValueError, "id: expected an integer from 0 on, not -1"),
    (lambda s: s.create_rays_pinhole(200, [0, 0, 1], [0, 0, 0], [0, 1, 0], 4, 4), ValueError, "fov_deg: .* not 200"),
    (lambda s: s.create_rays_pinhole(60, [0, 0, 1], [0, 0, 0], [0, 0, 1], 4, 4), ValueError, "up: "),
    (lambda s: s.create_rays_pinhole(60, [0, 0, 1], [0, 0], [0, 1, 0], 4, 4), ValueError, r"eye: .* not \(2,\)"),
    (lambda s: s.create_rays_pinhole(np.eye(4), np.eye(4), 4, 4), ValueError, r"intrinsic_matrix: .* not \(4, 4\)"),
    (lambda s: kdray.RaycastingScene(device=999), RuntimeError, "999"),
    (lambda s: kdray.RaycastingScene(device="no such device"), RuntimeError, "no such device"),
    (lambda s: kdray.RaycastingScene(device=1.5), TypeError, "device: expected None"),
    (lambda s: kdray.RaycastingScene(device="cpu", origin=[0, 0]), ValueError, "origin: expected three finite numbers"),
]


@pytest.mark.parametrize("ix", range(len(CASES)))
def test_bad_input(ix, scene):
    call, kind, message = CASES[ix]
    with pytest.raises(kind, match=message) as raised:
        call(scene)
    assert type(raised.value) is kind and "\n" not in str(raised.value)
    assert scene.cast_rays([0, 0, 0, 0, 0, 1])["geometry_ids"] == 0, "the scene is as it was"


def test_too_far_away(device):
    scene = kdray.RaycastingScene(device=device)
    scene.add_triangles(VERTICES * np.float32(1e20), TRIANGLES)
    with pytest.raises(ValueError, match="1e9"):
        scene.cast_rays(RAYS)


def test_an_empty_scene(device):
    scene = kdray.RaycastingScene(device=device)
    for call in [scene.cast_rays, scene.test_occlusions, scene.count_intersections, scene.list_intersections]:
        with pytest.raises(RuntimeError, match="the scene has no triangles"):
            call(RAYS)
    with pytest.raises(RuntimeError, match="the scene has no triangles"):
        scene.compute_distance(RAYS[:, :3])
    scene.add_triangles(np.zeros((0, 3)), np.zeros((0, 3), int))
    with pytest.raises(RuntimeError, match="the scene has no triangles"):
        scene.cast_rays(RAYS)


def test_a_closed_scene(device):
    with kdray.RaycastingScene(device=device) as scene:
        scene.add_triangles(VERTICES, TRIANGLES)
        assert scene.compute_distance([0, 0, 2]) == 1
    scene.close()
    for call in [
        lambda: scene.cast_rays(RAYS),
        lambda: scene.add_triangles(VERTICES, TRIANGLES),
        lambda: scene.remove(0),
        lambda: scene.update_transforms([], np.zeros((0, 3, 4))),
    ]:
        with pytest.raises(RuntimeError, match="the scene is closed"):
            call()


def test_tensors_that_know_only_dlpack(scene):
    rays = np.array([[0, 0, 0, 0, 0, 1]], np.float32)
    assert scene.cast_rays(OnlyDlpack(rays))["t_hit"].tolist() == [1]

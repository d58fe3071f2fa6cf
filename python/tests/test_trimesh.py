"""The interface of trimesh, beside trimesh with Embree."""

import copy
import pickle

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector as Embree

from kdray.trimesh import RayMeshIntersector


@pytest.fixture(params=["ball", "torus", "far"])
def mesh(request):
    ball = trimesh.creation.icosphere(subdivisions=3)
    match request.param:
        case "ball":
            return ball
        case "torus":
            return trimesh.creation.torus(1.0, 0.4)
    ball.apply_scale(0.001)
    ball.apply_translation([100, 200, 300])
    return ball


def rays_at(mesh, random, n):
    size, middle = mesh.extents.max(), mesh.bounds.mean(axis=0)
    origins = middle + size * random.uniform(-1, 1, (n, 3))
    return origins, middle + size * random.uniform(-0.5, 0.5, (n, 3)) - origins


def by_ray(index_ray, index_tri):
    return sorted(zip(index_ray.tolist(), index_tri.tolist()))


def test_answers_are_those_of_embree(mesh, random):
    ours, theirs = RayMeshIntersector(mesh, device="cpu"), Embree(mesh)
    origins, directions = rays_at(mesh, random, 5000)
    first = ours.intersects_first(origins, directions)
    assert first.dtype == np.int64 and (first >= 0).mean() > 0.2
    # trimesh's own intersects_first rounds origins to single precision before it scales them.
    expected = np.full(len(first), -1)
    triangles, rays = theirs.intersects_id(origins, directions, multiple_hits=False)
    expected[rays] = triangles
    assert np.mean(first == expected) > 0.998
    any_hit = ours.intersects_any(origins, directions)
    assert any_hit.dtype == bool and ((first >= 0) == any_hit).all()
    for multiple_hits in [True, False]:
        index_tri, index_ray = ours.intersects_id(origins, directions, multiple_hits=multiple_hits)
        expected_tri, expected_ray = theirs.intersects_id(origins, directions, multiple_hits=multiple_hits)
        found, expected = set(by_ray(index_ray, index_tri)), set(by_ray(expected_ray, expected_tri))
        assert len(found ^ expected) < 0.004 * len(expected)
        assert len(found) == len(index_tri), "each hit once"
        locations, rays, triangles = ours.intersects_location(origins, directions, multiple_hits=multiple_hits)
        assert (triangles == index_tri).all() and (rays == index_ray).all() and locations.dtype == np.float64
        normals, corners = mesh.face_normals[index_tri], mesh.triangles[index_tri]
        height = np.einsum("ij,ij->i", normals, locations - corners[:, 0])
        assert np.abs(height).max() < 1e-6 * mesh.scale, "on the plane"
        weights = trimesh.triangles.points_to_barycentric(corners, locations)
        assert weights.min() > -1e-2, "in the triangle"
        beside = np.cross(locations - origins[rays], trimesh.unitize(directions[rays]))
        assert np.linalg.norm(beside, axis=1).max() < 1e-5 * mesh.scale


def test_points_inside(mesh, random):
    points = mesh.bounds.mean(axis=0) + mesh.extents * random.uniform(-0.6, 0.6, (2000, 3))
    ours, theirs = (it.contains_points(points) for it in (RayMeshIntersector(mesh, device="cpu"), Embree(mesh)))
    assert ours.dtype == bool and 0.1 < ours.mean() < 0.9 and np.mean(ours == theirs) > 0.998


def test_it_takes_the_place_of_the_meshs_own(mesh):
    mesh = mesh.copy()
    mesh.ray = RayMeshIntersector(mesh, device="cpu")
    middle = mesh.bounds.mean(axis=0)
    outside = middle + [0, 0, mesh.extents.max() * 2]
    assert mesh.ray.contains_points([outside]).tolist() == [False]
    location, *_ = mesh.ray.intersects_location([outside + mesh.extents * [0.4, 0.013, 0]], [[0, 0, -1]])
    assert len(location) == 2
    mesh.apply_translation([0, 0, mesh.extents.max()])
    moved, *_ = mesh.ray.intersects_location([outside + mesh.extents * [0.4, 0.013, 0]], [[0, 0, -1]])
    np.testing.assert_allclose(moved - location, [[0, 0, mesh.extents.max()]] * 2, atol=1e-5 * mesh.scale)


def test_copies_and_limits():
    box = trimesh.creation.box()
    ray = RayMeshIntersector(box, device="cpu")
    ray.intersects_any([[0, 0, 0]], [[0, 0, 1]])
    for again in [copy.copy(ray), copy.deepcopy(ray), pickle.loads(pickle.dumps(ray))]:
        index_tri, index_ray = again.intersects_id([[0.1, 0.2, 2]], [[0, 0, -1]], max_hits=1)
        assert index_ray.tolist() == [0] and index_tri.shape == (1,)
    tri, rays, locations = ray.intersects_id([[0.1, 0.2, 2]], [[0, 0, -5]], return_locations=True)
    np.testing.assert_allclose(locations, [[0.1, 0.2, 0.5], [0.1, 0.2, -0.5]], atol=1e-12)
    with pytest.raises(ValueError, match="ray_directions: expected the shape of ray_origins"):
        ray.intersects_any([[0, 0, 0]], [[0, 0, 1], [0, 1, 0]])


def test_flat_rays_meet_the_mesh_at_their_hits():
    box = trimesh.creation.box()
    ray = RayMeshIntersector(box, device="cpu")
    locations, _, _ = ray.intersects_location([[-2, 0.1, 0.5 - 2e-6]], [[1, 0, 1e-6]])
    assert len(locations) and np.abs(np.abs(locations[:, 0]) - 0.5).min() < 1e-6 and np.abs(locations).max() < 0.51


def test_points_in_a_cavity_are_outside():
    hole = trimesh.creation.box([0.1, 0.1, 0.1])
    hole.invert()
    mesh = trimesh.util.concatenate([trimesh.creation.box(), hole])
    points = [[0, 0, 0], [0.2, 0, 0], [0.3, 0.1, -0.2], [0, 0, 0.6]]
    assert RayMeshIntersector(mesh, device="cpu").contains_points(points).tolist() == [False, True, True, False]


def test_points_in_the_planes_of_faces():
    """A cube without one of its eight parts. Rays that are parallel to axes would run in faces and along edges."""
    cells = [cell for cell in np.ndindex(2, 2, 2) if cell != (1, 1, 1)]
    parts = [trimesh.creation.box(bounds=[cell, np.add(cell, 1)]) for cell in cells]
    mesh = trimesh.util.concatenate(parts)
    mesh.merge_vertices()
    beyond = np.floor(mesh.triangles_center + 0.1 * mesh.face_normals).astype(int)
    mesh.update_faces([tuple(cell) not in cells for cell in beyond.tolist()])
    assert mesh.is_watertight and np.isclose(mesh.volume, 7)
    points = [[0.5, 1, 1], [1, 1, 0.5], [0.25, 1, 0.25], [1.5, 1.5, 1.5], [1.25, 1.5, 1.25], [3, 1, 1], [1, 1, -0.5]]
    expected = [True, True, True, False, False, False, False]
    assert RayMeshIntersector(mesh, device="cpu").contains_points(points).tolist() == expected

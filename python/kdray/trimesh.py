"""The ray interface of trimesh: ``mesh.ray = kdray.trimesh.RayMeshIntersector(mesh)``. It needs no trimesh."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import arrays
from .device import Device
from .scene import RaycastingScene

_I64 = NDArray[np.int64]
_F64 = NDArray[np.float64]

# Sine of the angle between a ray and a plane below which their meeting point says little about the hit.
_LEAST_SINE = 1e-4


class RayMeshIntersector:
    """Rays into one mesh, as ``trimesh.ray.ray_pyembree.RayMeshIntersector`` casts them.

    Parameters
    ----------
    geometry : a mesh with ``vertices`` (n, 3) and ``faces`` (m, 3). If the mesh's hash changes, as that of trimesh's
        meshes does with their vertices and faces, the next query sees the changed mesh.
    scale_to_box : has no effect. kdray needs no scaling.
    device, nthreads : as those of :class:`kdray.RaycastingScene`.
    """

    def __init__(
        self,
        geometry: Any,
        scale_to_box: bool = True,
        *,
        device: int | str | Device | None = None,
        nthreads: int = 0,
    ) -> None:
        self.mesh = geometry
        self._options: dict[str, Any] = {"device": device, "nthreads": nthreads}
        self._made: tuple[int, RaycastingScene, _F64] | None = None

    def intersects_location(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple_hits: bool = True
    ) -> tuple[_F64, _I64, _I64]:
        """Returns where rays (n, 3), (n, 3) hit: locations (h, 3), index_ray (h,), index_tri (h,)."""
        index_tri, index_ray, locations = self.intersects_id(
            ray_origins, ray_directions, multiple_hits=multiple_hits, return_locations=True
        )
        return locations, index_ray, index_tri

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int | None = None,
        return_locations: bool = False,
        **kwargs: Any,
    ) -> Any:
        """Returns which triangles rays hit: index_tri (h,), index_ray (h,), and locations (h, 3) if asked for.

        The hits are in the order of rays, and those of a ray from near to far. ``max_hits``: the most hits of a ray;
        None for all.
        """
        rays = _rays(ray_origins, ray_directions)
        scene, triangles = self._scene()
        if multiple_hits:
            hits = scene.list_intersections(rays, max_hits=max_hits)
            index_ray, index_tri, uvs = hits["ray_ids"], hits["primitive_ids"], hits["primitive_uvs"]
        else:
            nearest = scene.cast_rays(rays)
            index_ray = np.flatnonzero(nearest["geometry_ids"] != scene.INVALID_ID)
            index_tri, uvs = nearest["primitive_ids"][index_ray], nearest["primitive_uvs"][index_ray]
        found = index_tri.astype(np.int64), index_ray.astype(np.int64)
        return (*found, _locations(triangles[found[0]], rays[found[1]], uvs)) if return_locations else found

    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> _I64:
        """Returns the first triangle that each ray hits, -1 for none: (n,)."""
        hits = self._scene()[0].cast_rays(_rays(ray_origins, ray_directions))
        is_hit = hits["geometry_ids"] != RaycastingScene.INVALID_ID
        return np.where(is_hit, hits["primitive_ids"].astype(np.int64), -1)

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.bool_]:
        """Tells of each ray whether it hits the mesh: (n,)."""
        return self._scene()[0].test_occlusions(_rays(ray_origins, ray_directions))

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tells of each point (n, 3) whether it is inside the mesh, which should be watertight: (n,)."""
        return self._scene()[0].compute_occupancy(points) > 0.5

    def _scene(self) -> tuple[RaycastingScene, _F64]:
        """Returns the scene of the mesh as it is now, and its triangles (m, 3, 3)."""
        version = hash(self.mesh)
        if self._made is None or self._made[0] != version:
            vertices = np.asarray(self.mesh.vertices, np.float64).reshape(-1, 3)
            faces = np.asarray(self.mesh.faces).reshape(-1, 3)
            middle = vertices.min(axis=0) / 2 + vertices.max(axis=0) / 2 if len(vertices) else np.zeros(3)
            scene = RaycastingScene(origin=middle, **self._options)
            scene.add_triangles(vertices, faces)
            self._made = version, scene, vertices[faces]
        return self._made[1:]

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_made": None}

    def __copy__(self) -> RayMeshIntersector:
        return RayMeshIntersector(self.mesh, **self._options)

    def __deepcopy__(self, memo: dict[int, Any]) -> RayMeshIntersector:
        return self.__copy__()


def _rays(origins: ArrayLike, directions: ArrayLike) -> _F64:
    """Returns rays (n, 6) with directions of unit length."""
    begin = arrays.floats("ray_origins", origins, "(n, 3)", (3,))
    along = arrays.floats("ray_directions", directions, "(n, 3)", (3,))
    if begin.ndim != 2 or begin.shape != along.shape:
        raise ValueError(f"ray_directions: expected the shape of ray_origins (n, 3), not {along.shape}, {begin.shape}")
    rays = np.concatenate([begin, along], axis=1, dtype=np.float64)
    lengths = np.linalg.norm(rays[:, 3:], axis=1, keepdims=True)
    rays[:, 3:] /= np.where(lengths > 0, lengths, 1)
    return rays


def _locations(triangles: _F64, rays: _F64, uvs: NDArray[np.float32]) -> _F64:
    """Returns the points of hits in double precision: where rays meet planes, or by weights if a ray is too flat."""
    corner, edges = triangles[:, 0], triangles[:, 1:] - triangles[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1])
    begin, along = rays[:, :3], rays[:, 3:]
    sines = np.einsum("ij,ij->i", normals, along)
    is_flat = np.abs(sines) <= _LEAST_SINE * np.linalg.norm(normals, axis=1)
    t = np.einsum("ij,ij->i", normals, corner - begin) / np.where(is_flat, 1, sines)
    by_weights: _F64 = corner + np.einsum("ij,ijk->ik", uvs, edges)
    return np.where(is_flat[:, None], by_weights, begin + t[:, None] * along)

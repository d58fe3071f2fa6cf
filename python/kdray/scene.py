"""Scenes of triangles, with the interface of Open3D's ``RaycastingScene``."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Any, ClassVar, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from . import arrays, pinhole
from ._kdray import Core
from .device import Device, selector

_F32 = NDArray[np.float32]
_U32 = NDArray[np.uint32]
_Outputs = tuple[_F32 | None, _U32 | None, _U32 | None, _F32 | None, _F32 | None, _F32 | None]

# Results in the order of the compiled part: name, type, shape of a ray's or a point's entry.
_COLUMNS: list[tuple[str, DTypeLike, tuple[int, ...]]] = [
    ("t_hit", np.float32, ()),
    ("geometry_ids", np.uint32, ()),
    ("primitive_ids", np.uint32, ()),
    ("primitive_uvs", np.float32, (2,)),
    ("primitive_normals", np.float32, (3,)),
    ("points", np.float32, (3,)),
]
# What `cast_rays` returns.
_OF_RAYS = [name for name, _, _ in _COLUMNS[:5]]

# Beyond this coordinate, single precision has steps of more than 6e-5.
_NEAR = 1024.0


class RaycastingScene:
    """Triangles, into which rays are cast and whose closest points are found.

    Methods have the names, shapes and types of Open3D's ``t.geometry.RaycastingScene``, and take anything that numpy
    can read: arrays, nested lists, tensors of the CPU by ``__array__`` or ``__dlpack__``. Integers and booleans become
    float32 where numbers are expected. Every method may be called from any thread; a scene does one thing at a time.
    Structures are built when a query first needs them, and those of changed geometries again after changes.

    Lengths are in the unit of the vertices. Coordinates may be float64: they are rounded to float32 relative to the
    scene's ``origin``.

    Parameters
    ----------
    nthreads : threads that work for queries on the CPU. 0: as many as :func:`kdray.set_threads` says.
    device : None for the best GPU, or the CPU where there is none; "cpu"; the index of one of :func:`kdray.devices`,
        or part of its name. Batches of fewer than 4096 rays or points are cast by the CPU, whatever the GPU: this is
        quicker, and finds the same hits but for rounding.
    origin : the point (3,) that coordinates are relative to inside the scene. None: 0, or if the first triangles have
        float64 vertices that lie beyond 1024, the middle of these vertices.
    """

    INVALID_ID: ClassVar[int] = 2**32 - 1
    """The id of a miss."""

    def __init__(
        self, nthreads: int = 0, device: int | str | Device | None = None, *, origin: ArrayLike | None = None
    ) -> None:
        self._nthreads = arrays.integer("nthreads", nthreads)
        self._device = device
        self._core = Core(selector(device))
        self._origin: NDArray[np.float64] = np.zeros(3)
        self._has_origin = origin is not None
        if origin is not None:
            self._origin = arrays.vector("origin", origin)

    @property
    def device(self) -> str:
        """The name of the Vulkan device, or "cpu"."""
        return self._core.device_name

    @property
    def origin(self) -> NDArray[np.float64]:
        """The point (3,) to which coordinates are relative inside the scene."""
        return self._origin.copy()

    # What the scene holds

    def add_triangles(
        self, vertex_positions: Any, triangle_indices: ArrayLike | None = None, *, mask: int = 0xFF
    ) -> int:
        """Adds a geometry, and returns its id: 0, 1, 2, ... No id is given out twice.

        Parameters
        ----------
        vertex_positions : (N, 3) float32 or float64. Or a mesh with ``vertices`` and ``faces`` as trimesh's, or with
            ``vertex.positions`` and ``triangle.indices`` as Open3D's; then there is no other argument.
        triangle_indices : (M, 3) integers, the indices of each triangle's vertices.
        mask : 0 to 255. See :meth:`set_masks`.
        """
        if triangle_indices is None:
            vertex_positions, triangle_indices = _parts_of_mesh(vertex_positions)
        vertices = _matrix_of_points("vertex_positions", vertex_positions)
        triangles = arrays.triangles("triangle_indices", triangle_indices)
        if not self._has_origin:
            self._origin = _origin_of(vertices)
            self._has_origin = True
        return self._core.add(arrays.relative(vertices, self._origin), triangles, arrays.mask("mask", mask, 0))

    def update_vertices(self, id: int, vertex_positions: ArrayLike, first: int = 0) -> None:
        """Replaces vertices of a geometry, from the index ``first`` on: (N, 3). Triangles and transform stay."""
        vertices = _matrix_of_points("vertex_positions", vertex_positions)
        first = arrays.integer("first", first)
        self._core.set_vertices(arrays.integer("id", id), first, arrays.relative(vertices, self._origin))

    def update_transforms(self, ids: ArrayLike, transforms: ArrayLike) -> None:
        """Moves geometries, without a new structure for any of them.

        Parameters
        ----------
        ids : (N,) integers. One integer moves one geometry.
        transforms : (N, 3, 4) or (N, 4, 4), from the geometries' vertices, as they were given, to the world. Each one
            replaces the transform before. No transform may flatten its geometry.
        """
        id_array = arrays.ids("ids", ids)
        matrices = arrays.floats("transforms", transforms, "(N, 3, 4)", (4,)).astype(np.float64)
        if matrices.ndim == 2:
            matrices = matrices[None]
        if matrices.shape not in [(len(id_array), 3, 4), (len(id_array), 4, 4)]:
            raise ValueError(f"transforms: expected the shape ({len(id_array)}, 3, 4), not {matrices.shape}")
        affine = np.ascontiguousarray(matrices[:, :3])
        # Inside, points are relative to the origin c: A (p + c) + b - c.
        affine[:, :, 3] += affine[:, :, :3] @ self._origin - self._origin
        self._core.set_transforms(id_array, affine)

    def set_masks(self, ids: ArrayLike, masks: ArrayLike) -> None:
        """Says which queries meet which geometries: those whose ``mask`` has a bit in common with the geometry's.

        A query without a mask has all bits, 0xff, as a geometry without one.

        Parameters
        ----------
        ids : (N,) integers. One integer masks one geometry.
        masks : (N,) integers from 0 to 255, or one for all. A geometry with 0 is met by no query.
        """
        id_array, values = arrays.ids("ids", ids), arrays.as_array("masks", masks)
        if values.shape not in [(), id_array.shape]:
            raise ValueError(f"masks: expected the shape ({len(id_array)},), not {values.shape}")
        checked = [arrays.mask("masks", value, 0) for value in values.reshape(-1)]
        self._core.set_masks(id_array, np.broadcast_to(np.array(checked, np.uint8), id_array.shape).copy())

    def remove(self, id: int) -> None:
        """Removes a geometry. The ids of all others stay."""
        self._core.remove(arrays.integer("id", id))

    def build(self, nthreads: int = 0, *, progress: Callable[[float], object] | None = None) -> None:
        """Builds what the next query would build, and uploads it. Ctrl-C ends it, as it does in a query.

        ``progress`` is called with the share that is done, 0 to 1, some times a second, on this thread. If it raises an
        exception, the build ends with it. A build that was ended leaves the scene as it was.
        """
        self._core.build(self._threads(nthreads), progress)

    # Rays

    def cast_rays(
        self,
        rays: ArrayLike,
        nthreads: int = 0,
        *,
        t_min: ArrayLike = 0.0,
        t_max: ArrayLike = np.inf,
        mask: int = 0xFF,
        out: dict[str, NDArray[Any]] | None = None,
    ) -> dict[str, NDArray[Any]]:
        """Finds the nearest hit of each ray.

        Parameters
        ----------
        rays : (..., 6): origin and direction, which need not have unit length. Or (..., 8): these, t_min and t_max.
        nthreads : threads of the CPU; 0: as many as the scene's.
        t_min, t_max : a hit at origin + t * direction counts if t_min < t <= t_max. One number, or one per ray (...).
            Rays of the shape (..., 8) have their own.
        mask : 1 to 255. Geometries without a bit in common with it are not there. See :meth:`set_masks`.
        out : arrays for some or all of the results, C-contiguous and of the types and shapes below. Only they are
            returned.

        Returns
        -------
        dict with

        - ``t_hit`` (...) float32: t of the hit. It is a distance if the direction has unit length. A miss: inf.
        - ``geometry_ids`` (...) uint32: the id of the geometry. A miss: ``INVALID_ID``.
        - ``primitive_ids`` (...) uint32: the triangle of the geometry. A miss: ``INVALID_ID``.
        - ``primitive_uvs`` (..., 2) float32: barycentric weights of the triangle's second and third vertex.
        - ``primitive_normals`` (..., 3) float32: unit normal by the right-hand rule, also where a transform mirrors.
          A miss, or a triangle without an area: 0.
        """
        rows, shape = arrays.rays("rays", rays, self._origin)
        outputs, results = _outputs(shape, _OF_RAYS, out)
        self._core.cast(rows, _range(shape, t_min, t_max), _mask(mask), self._threads(nthreads), outputs)
        return results

    def test_occlusions(
        self,
        rays: ArrayLike,
        tnear: ArrayLike = 0.0,
        tfar: ArrayLike = np.inf,
        nthreads: int = 0,
        *,
        mask: int = 0xFF,
    ) -> NDArray[np.bool_]:
        """Tells of each ray whether it hits anything: (...) bool. See :meth:`cast_rays`.

        ``tnear`` and ``tfar``: a hit counts if tnear < t <= tfar. One number, or one per ray (...). ``mask`` is as in
        :meth:`cast_rays`, here and in all other queries.
        """
        rows, shape = arrays.rays("rays", rays, self._origin)
        hits = np.zeros(len(rows), np.bool_)
        t_range = _range(shape, tnear, tfar, ("tnear", "tfar"))
        self._core.occluded(rows, t_range, _mask(mask), self._threads(nthreads), hits)
        return hits.reshape(shape)

    def count_intersections(
        self,
        rays: ArrayLike,
        nthreads: int = 0,
        *,
        t_min: ArrayLike = 0.0,
        t_max: ArrayLike = np.inf,
        mask: int = 0xFF,
    ) -> NDArray[np.int32]:
        """Counts the triangles that each ray hits: (...) int32. Triangles that coincide count one by one."""
        rows, shape = arrays.rays("rays", rays, self._origin)
        counts = np.zeros(len(rows), np.int32)
        self._core.count(rows, _range(shape, t_min, t_max), _mask(mask), self._threads(nthreads), counts)
        return counts.reshape(shape)

    def list_intersections(
        self,
        rays: ArrayLike,
        nthreads: int = 0,
        *,
        t_min: ArrayLike = 0.0,
        t_max: ArrayLike = np.inf,
        mask: int = 0xFF,
        max_hits: int | None = None,
    ) -> dict[str, NDArray[Any]]:
        """Lists all hits of each ray, or the ``max_hits`` nearest ones, in the order of t.

        Returns
        -------
        dict with

        - ``ray_splits`` (K + 1) uint32: the hits of ray i are those from ``ray_splits[i]`` to ``ray_splits[i + 1]``.
        - ``ray_ids`` (I) uint32: the ray of each hit, by its place among all K rays.
        - ``t_hit`` (I) float32, ``geometry_ids`` (I) uint32, ``primitive_ids`` (I) uint32, ``primitive_uvs`` (I, 2)
          float32: as :meth:`cast_rays` returns them.
        """
        rows, shape = arrays.rays("rays", rays, self._origin)
        most = None if max_hits is None else arrays.integer("max_hits", max_hits)
        lists = self._core.list(rows, _range(shape, t_min, t_max), _mask(mask), most, self._threads(nthreads))
        names = ["ray_splits", "ray_ids", "t_hit", "geometry_ids", "primitive_ids"]
        results: dict[str, NDArray[Any]] = dict(zip(names, lists))
        results["primitive_uvs"] = lists[5].reshape(-1, 2)
        return results

    # Points

    def compute_closest_points(
        self, query_points: ArrayLike, nthreads: int = 0, *, mask: int = 0xFF
    ) -> dict[str, NDArray[Any]]:
        """Finds the point of the triangles that is closest to each query point (..., 3).

        Returns
        -------
        dict with ``points`` (..., 3) float32 (float64 for float64 queries in a scene whose origin is not 0),
        ``distances`` (...) float32, and ``geometry_ids``, ``primitive_ids``, ``primitive_uvs``, ``primitive_normals``
        as :meth:`cast_rays` returns them. A query point that is not finite has the point NaN, an infinite distance and
        the id ``INVALID_ID``.
        """
        query = arrays.floats("query_points", query_points, "(..., 3)", (3,))
        shape = query.shape[:-1]
        results = self._closest(
            arrays.relative(query, self._origin), shape, _mask(mask), nthreads, [*_OF_RAYS, "points"]
        )
        points = results.pop("points")
        if self._origin.any():
            points = points + self._origin
            if query.dtype == np.float32:
                points = points.astype(np.float32)
        return {"points": points, "distances": results.pop("t_hit"), **results}

    def compute_distance(
        self, query_points: ArrayLike, nthreads: int = 0, *, mask: int = 0xFF
    ) -> NDArray[np.float32]:
        """Computes the distance of each query point (..., 3) from the triangles: (...) float32."""
        query = arrays.floats("query_points", query_points, "(..., 3)", (3,))
        points = arrays.relative(query, self._origin)
        return self._closest(points, query.shape[:-1], _mask(mask), nthreads, ["t_hit"])["t_hit"]

    def compute_signed_distance(
        self, query_points: ArrayLike, nthreads: int = 0, nsamples: int = 1, *, mask: int = 0xFF
    ) -> NDArray[np.float32]:
        """Computes the distance of each query point (..., 3): (...) float32, negative inside.

        A point is inside if most of ``nsamples`` rays in fixed directions cross the triangles an odd number of times.
        ``nsamples`` is odd; at least 3 rays decide, of which the last is only cast where the others disagree.
        Crossings are counted exactly, with no offsets, so that a wrong sign takes rays through edges or vertices in
        most directions. This holds for watertight meshes. An open mesh has no inside: there, the answer is that of most
        directions.
        """
        query = arrays.floats("query_points", query_points, "(..., 3)", (3,))
        points, n = arrays.relative(query, self._origin), _n_samples(nsamples)
        distances = self._closest(points, (len(points),), _mask(mask), nthreads, ["t_hit"])["t_hit"]
        inside = self._is_inside(points, _mask(mask), nthreads, n)
        return np.where(inside, -distances, distances).astype(np.float32).reshape(query.shape[:-1])

    def compute_occupancy(
        self, query_points: ArrayLike, nthreads: int = 0, nsamples: int = 1, *, mask: int = 0xFF
    ) -> NDArray[np.float32]:
        """Tells of each query point (..., 3) whether it is inside: (...) float32, 1 or 0.

        It is decided as by :meth:`compute_signed_distance`.
        """
        query = arrays.floats("query_points", query_points, "(..., 3)", (3,))
        points, n = arrays.relative(query, self._origin), _n_samples(nsamples)
        return self._is_inside(points, _mask(mask), nthreads, n).astype(np.float32).reshape(query.shape[:-1])

    # Cameras

    @overload
    @staticmethod
    def create_rays_pinhole(
        fov_deg: float, center: ArrayLike, eye: ArrayLike, up: ArrayLike, width_px: int, height_px: int
    ) -> _F32: ...

    @overload
    @staticmethod
    def create_rays_pinhole(
        *, intrinsic_matrix: ArrayLike, extrinsic_matrix: ArrayLike, width_px: int, height_px: int
    ) -> _F32: ...

    @overload
    @staticmethod
    def create_rays_pinhole(
        intrinsic_matrix: ArrayLike, extrinsic_matrix: ArrayLike, width_px: int, height_px: int, /
    ) -> _F32: ...

    @staticmethod
    def create_rays_pinhole(*args: Any, **kwargs: Any) -> _F32:
        """Makes the rays of a pinhole camera through the middles of pixels: (height_px, width_px, 6) float32.

        ``create_rays_pinhole(intrinsic_matrix (3, 3), extrinsic_matrix (4, 4), width_px, height_px)``: the second
        matrix leads from the world to the camera. t is then the depth along the optical axis.

        ``create_rays_pinhole(fov_deg, center (3,), eye (3,), up (3,), width_px, height_px)``: the horizontal field of
        view in degrees, the point that the camera looks at, where it is, and the direction in which the rows of pixels
        follow each other. As with Open3D, a picture whose first row is its top is upright if this points down.
        """
        make: Callable[..., _F32] = pinhole.of_matrices
        if "fov_deg" in kwargs or len(args) + len(kwargs) == 6:
            make = pinhole.of_view
        return make(*args, **kwargs)

    # The life of a scene

    def close(self) -> None:
        """Frees everything that the scene holds. Later calls fail with a RuntimeError, but for this one."""
        self._core.close()

    def __enter__(self) -> RaycastingScene:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<kdray.RaycastingScene on {self.device}>"

    def __getstate__(self) -> dict[str, Any]:
        geometries = [self._core.geometry(id) for id in range(self._core.n_ids())]
        origin = self._origin if self._has_origin else None
        return {"nthreads": self._nthreads, "device": self._device, "origin": origin, "geometries": geometries}

    def __setstate__(self, state: dict[str, Any]) -> None:
        RaycastingScene.__init__(self, state["nthreads"], state["device"], origin=state["origin"])
        moved = []
        for id, geometry in enumerate(state["geometries"]):
            if geometry is None:
                self._core.add_removed()
                continue
            vertices, triangles, transform, mask = geometry
            self._core.add(vertices.reshape(-1, 3), triangles.reshape(-1, 3), mask)
            if not np.array_equal(transform.reshape(3, 4), np.eye(3, 4)):
                moved.append((id, transform.reshape(3, 4)))
        if moved:
            ids, transforms = zip(*moved)
            self._core.set_transforms(np.array(ids, np.uint32), np.array(transforms))

    # Within

    def _threads(self, nthreads: int) -> int:
        return arrays.integer("nthreads", nthreads) or self._nthreads

    def _closest(
        self, points: _F32, shape: tuple[int, ...], mask: int, nthreads: int, names: list[str]
    ) -> dict[str, NDArray[Any]]:
        outputs, results = _outputs(shape, names)
        self._core.closest(points, mask, self._threads(nthreads), outputs)
        return results

    def _is_inside(self, points: _F32, mask: int, nthreads: int, n_samples: int) -> NDArray[np.bool_]:
        votes = np.zeros(len(points), np.int64)
        open_ix = np.arange(len(points))
        t_range = _range((), 0.0, np.inf)
        for n_cast, direction in enumerate(_directions(n_samples), 1):
            rays = np.empty((len(open_ix), 6), np.float32)
            rays[:, :3], rays[:, 3:] = points[open_ix], direction
            counts = np.zeros(len(rays), np.int32)
            self._core.count(rays, t_range, mask, self._threads(nthreads), counts)
            votes[open_ix] += counts % 2
            most = n_samples // 2
            open_ix = open_ix[(votes[open_ix] <= most) & (n_cast - votes[open_ix] <= most)]
            if not len(open_ix):
                break
        return votes > n_samples // 2


def _parts_of_mesh(mesh: Any) -> tuple[Any, Any]:
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        return mesh.vertices, mesh.faces
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):
        return mesh.vertex.positions.numpy(), mesh.triangle.indices.numpy()
    raise TypeError(f"triangle_indices: is missing, and vertex_positions is no mesh but {type(mesh).__name__}")


def _matrix_of_points(name: str, value: Any) -> NDArray[Any]:
    points = arrays.floats(name, value, "(N, 3)", (3,))
    if points.ndim != 2:
        raise ValueError(f"{name}: expected the shape (N, 3), not {points.shape}")
    return points


def _origin_of(vertices: NDArray[Any]) -> NDArray[np.float64]:
    """Returns the origin that suits the first vertices of a scene, in whole units."""
    if vertices.dtype != np.float64 or not len(vertices) or not np.isfinite(vertices).all():
        return np.zeros(3)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    is_far = max(np.abs(low).max(), np.abs(high).max()) > _NEAR
    return np.rint(low / 2 + high / 2) if is_far else np.zeros(3)


def _mask(mask: int) -> int:
    return arrays.mask("mask", mask, 1)


def _range(
    shape: tuple[int, ...], low: ArrayLike, high: ArrayLike, names: tuple[str, str] = ("t_min", "t_max")
) -> tuple[_F32, _F32]:
    return arrays.per_ray(names[0], low, shape), arrays.per_ray(names[1], high, shape)


def _outputs(
    shape: tuple[int, ...], names: list[str], out: dict[str, NDArray[Any]] | None = None
) -> tuple[_Outputs, dict[str, NDArray[Any]]]:
    """Returns the arrays that results are written to, as the compiled part and as the caller see them.

    ``names``: those of all results. Where the caller has given some arrays in ``out``, only they are written.
    """
    if out is not None and (unknown := set(out) - set(names)):
        raise ValueError(f"out: expected the keys {', '.join(names)}, not {', '.join(map(str, sorted(unknown)))}")
    columns: list[Any] = []
    results = {}
    for name, dtype, entry in _COLUMNS:
        if name not in (names if out is None else out):
            columns.append(None)
            continue
        column = np.empty(shape + entry, dtype) if out is None else out[name]
        if out is not None:
            _check_out(name, column, np.dtype(dtype), shape + entry)
        results[name] = column
        columns.append(column.reshape(-1, *entry))
    return (columns[0], columns[1], columns[2], columns[3], columns[4], columns[5]), results


def _check_out(name: str, column: Any, dtype: np.dtype[Any], shape: tuple[int, ...]) -> None:
    if not isinstance(column, np.ndarray) or column.dtype != dtype:
        given = column.dtype if isinstance(column, np.ndarray) else type(column).__name__
        raise TypeError(f'out["{name}"]: expected a numpy array of {dtype}, not {given}')
    if column.shape != shape:
        raise ValueError(f'out["{name}"]: expected the shape {shape}, not {column.shape}')
    if not (column.flags.c_contiguous and column.flags.writeable):
        raise ValueError(f'out["{name}"]: expected a C-contiguous array that can be written to')


def _n_samples(nsamples: int) -> int:
    if arrays.integer("nsamples", nsamples, 1) % 2 == 0:
        raise ValueError(f"nsamples: expected an odd number, not {nsamples}")
    return max(nsamples, 3)


def _directions(n: int) -> _F32:
    """Returns n unit vectors (n, 3) that are spread over the sphere, along no axis or diagonal.

    They are those of Roberts' R2 sequence: The Unreasonable Effectiveness of Quasirandom Sequences, 2018.
    """
    ix = np.arange(1, n + 1)
    z = 1 - 2 * ((0.5 + ix * 0.7548776662466927) % 1)
    azimuth = 2 * np.pi * ((0.5 + ix * 0.5698402909980532) % 1)
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=1).astype(np.float32)

"""Rays of pinhole cameras."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import arrays


def of_view(
    fov_deg: float, center: ArrayLike, eye: ArrayLike, up: ArrayLike, width_px: int, height_px: int
) -> NDArray[np.float32]:
    """Returns the rays of a camera that looks from ``eye`` to ``center``: see ``create_rays_pinhole``."""
    width, height = arrays.integer("width_px", width_px, 1), arrays.integer("height_px", height_px, 1)
    if not 0 < fov_deg < 180:
        raise ValueError(f"fov_deg: expected a number between 0 and 180, not {fov_deg}")
    from_point, to_point, upward = (_matrix(*it, (3,)) for it in [("eye", eye), ("center", center), ("up", up)])
    forward = to_point - from_point
    right = np.cross(upward, forward)
    lengths = np.linalg.norm(forward), np.linalg.norm(right)
    if not min(lengths) > 0:
        raise ValueError(f"up: expected another direction than from eye {eye!r} to center {center!r}, not {up!r}")
    forward, right = forward / lengths[0], right / lengths[1]
    # Rows of pixels follow each other along the camera's y axis.
    world_to_camera = np.stack([right, np.cross(forward, right), forward])
    focal = 0.5 * width / np.tan(0.5 * np.deg2rad(fov_deg))
    intrinsic = np.array([[focal, 0, 0.5 * width], [0, focal, 0.5 * height], [0, 0, 1]])
    return _rays(intrinsic, world_to_camera, from_point, (width, height))


def of_matrices(
    intrinsic_matrix: ArrayLike, extrinsic_matrix: ArrayLike, width_px: int, height_px: int
) -> NDArray[np.float32]:
    """Returns the rays of a camera that matrices describe: see ``create_rays_pinhole``."""
    width, height = arrays.integer("width_px", width_px, 1), arrays.integer("height_px", height_px, 1)
    intrinsic = _matrix("intrinsic_matrix", intrinsic_matrix, (3, 3))
    extrinsic = _matrix("extrinsic_matrix", extrinsic_matrix, (4, 4))
    rotation = extrinsic[:3, :3]
    if np.linalg.det(intrinsic) == 0 or np.linalg.det(rotation) == 0:
        raise ValueError("intrinsic_matrix, extrinsic_matrix: expected matrices that can be inverted")
    eye = -np.linalg.inv(rotation) @ extrinsic[:3, 3]
    return _rays(intrinsic, rotation, eye, (width, height))


def _matrix(name: str, value: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    array = arrays.as_array(name, value).astype(np.float64)
    if array.shape != shape:
        raise ValueError(f"{name}: expected the shape {shape}, not {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: expected finite numbers")
    return array


def _rays(
    intrinsic: NDArray[np.float64], rotation: NDArray[np.float64], eye: NDArray[np.float64], size: tuple[int, int]
) -> NDArray[np.float32]:
    width, height = size
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    pixels = np.stack([x, y, np.ones_like(x)], axis=-1)
    rays = np.empty((height, width, 6), np.float32)
    rays[..., :3] = eye
    rays[..., 3:] = pixels @ (np.linalg.inv(rotation) @ np.linalg.inv(intrinsic)).T
    return rays

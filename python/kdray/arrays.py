"""Checks what callers hand over, and lays it out as the compiled part reads it."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from numpy.typing import NDArray

_CPU = 1  # kDLCPU of dlpack.h
_ALL_BITS = 0xFF


def as_array(name: str, value: Any) -> NDArray[Any]:
    """Returns an array of anything that has one, without a copy where numpy can read its memory."""
    if not isinstance(value, np.ndarray):
        device = getattr(value, "__dlpack_device__", None)
        if device is not None:
            kind = device()[0]
            is_on_cpu = getattr(kind, "value", kind) == _CPU  # Open3D has an enum that is no integer.
        else:
            is_on_cpu = not hasattr(value, "__cuda_array_interface__")
        if not is_on_cpu:
            raise TypeError(f"{name}: expected an array in the memory of the CPU: use .cpu()")
        reads = any(hasattr(value, it) for it in ("__array__", "__array_interface__", "__buffer__"))
        if device is not None and not reads and not isinstance(value, (bytes, bytearray, memoryview)):
            value = np.from_dlpack(value)
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(f"{name}: expected an array of numbers, not rows of different lengths") from None
    if array.dtype == object or array.dtype.kind not in "fiub":
        raise TypeError(f"{name}: expected an array of numbers, not of {array.dtype}")
    return array


def floats(name: str, value: Any, shape: str, widths: tuple[int, ...]) -> NDArray[Any]:
    """Returns an array of float32 or float64 whose last axis has one of the widths. Other numbers become float32.

    ``shape``: the expected shape in words.
    """
    array = as_array(name, value)
    if array.ndim == 0 or array.shape[-1] not in widths:
        raise ValueError(f"{name}: expected the shape {shape}, not {array.shape}")
    if array.dtype in (np.float32, np.float64):
        return array
    return array.astype(np.float32)


def triangles(name: str, value: Any) -> NDArray[np.uint32]:
    """Returns indices of vertices, (M, 3) uint32. Whether they are in range is checked later, but for negative ones."""
    array = as_array(name, value)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{name}: expected the shape (M, 3), not {array.shape}")
    if array.size and array.dtype.kind not in "iu":
        raise TypeError(f"{name}: expected integers, not {array.dtype}")
    if array.size and array.dtype != np.uint32 and not 0 <= array.min() <= array.max() < 2**32:
        raise IndexError(f"{name}: expected indices of vertices, not {array.min()} to {array.max()}")
    return np.ascontiguousarray(array, np.uint32)


def integer(name: str, value: Any, least: int = 0) -> int:
    """Returns an integer of at least ``least``."""
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{name}: expected an integer, not {type(value).__name__}") from None
    if not least <= number < 2**32:
        raise ValueError(f"{name}: expected an integer from {least} on, not {number}")
    return number


def mask(name: str, value: Any, least: int) -> int:
    """Returns a mask of 8 bits that is at least ``least``."""
    number = integer(name, value, least)
    if number > _ALL_BITS:
        raise ValueError(f"{name}: expected an integer up to 255, not {number}")
    return number


def ids(name: str, value: Any) -> NDArray[np.uint32]:
    """Returns ids of geometries, (N,) uint32; (1,) for one integer. Whether they exist is checked later."""
    array = np.atleast_1d(as_array(name, value))
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
        raise ValueError(f"{name}: expected integers of the shape (N,), not {array.dtype} of {array.shape}")
    if array.size and not 0 <= array.min() <= array.max() < 2**32:
        raise IndexError(f"{name}: there is no geometry {array.min()} or {array.max()}")
    return np.ascontiguousarray(array, np.uint32)


def vector(name: str, value: Any) -> NDArray[np.float64]:
    """Returns three finite numbers (3,)."""
    array = as_array(name, value).astype(np.float64)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ValueError(f"{name}: expected three finite numbers, not {value!r}")
    return array


def relative(points: NDArray[Any], origin: NDArray[np.float64]) -> NDArray[np.float32]:
    """Returns points (..., 3) relative to an origin, which are rounded after the subtraction: (K, 3) float32."""
    if origin.any():
        points = points.astype(np.float64) - origin
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(points.reshape(-1, 3), np.float32)


def rays(name: str, value: Any, origin: NDArray[np.float64]) -> tuple[NDArray[np.float32], tuple[int, ...]]:
    """Returns rays as (K, 6) or (K, 8) float32, relative to an origin, and the shape of results."""
    array = floats(name, value, "(..., 6) or (..., 8)", (6, 8))
    shape = array.shape[:-1]
    array = array.reshape(-1, array.shape[-1])
    if origin.any():
        array = array.astype(np.float64)
        array[:, :3] -= origin
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, np.float32), shape


def per_ray(name: str, value: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Returns one number for all rays, or one for each: (1,) or (K,) float32."""
    array = as_array(name, value)
    if array.ndim == 0:
        return array.reshape(1).astype(np.float32)
    if array.shape != shape:
        raise ValueError(f"{name}: expected a number or the rays' shape {shape}, not {array.shape}")
    return np.ascontiguousarray(array.reshape(-1), np.float32)

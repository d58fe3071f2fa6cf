"""Rays, closest points and moving scenes, on any Vulkan device or the CPU.

>>> import kdray
>>> scene = kdray.RaycastingScene(device="cpu")
>>> scene.add_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
0
>>> scene.cast_rays([[0.25, 0.25, 2, 0, 0, -1]])["t_hit"]
array([2.], dtype=float32)
"""

from . import trimesh
from ._kdray import set_threads
from .device import Device, devices
from .pictures import Scene, load, render
from .scene import RaycastingScene

__all__ = ["Device", "RaycastingScene", "Scene", "devices", "load", "render", "set_threads", "trimesh"]

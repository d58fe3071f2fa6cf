"""What both renderers are given: a scene in terms that both define alike.

Lobes: Lambertian reflection; the microfacet distribution GGX with Smith's height-correlated masking, sampled by visible
normals, on a metal that reflects everything (F = 1) and on rough glass (exact Fresnel equations); each without energy
compensation. Lights: emitting triangles, spheres, an equirectangular environment. A box filter, no lens.
"""

from dataclasses import dataclass, field

import numpy as np


ENVIRONMENT_HEIGHT = 256


def environment_image(environment, rows):
    """The picture of an environment whose rows are at these heights, 0 to 1. Columns are at their middles."""
    width = 2 * ENVIRONMENT_HEIGHT
    v, u = np.meshgrid(rows, (np.arange(width) + 0.5) / width, indexing="ij")
    return np.ascontiguousarray(environment(u, v), np.float32)


@dataclass
class Diffuse:
    reflectance: tuple = (0.5, 0.5, 0.5)
    texture: str | None = None


@dataclass
class Metal:
    """Reflects all light. alpha: width of the distribution of normals."""

    alpha: float


@dataclass
class Glass:
    alpha: float
    ior: float = 1.5


@dataclass
class Emitting:
    radiance: tuple


@dataclass
class Mesh:
    name: str
    vertices: np.ndarray  # n x 3, world units
    faces: np.ndarray  # m x 3, counter-clockwise from outside
    material: object
    uvs: np.ndarray | None = None  # n x 2, v upwards


@dataclass
class SphereLight:
    centre: tuple
    radius: float
    radiance: tuple


@dataclass
class Scene:
    name: str
    eye: tuple
    target: tuple
    vertical_fov: float  # degrees
    max_depth: int  # surfaces that a path meets at most
    meshes: list
    lights: list = field(default_factory=list)
    environment: object = None  # a function of places in an equirectangular picture (to the right, down: 0 to 1)
    size: int = 128  # width and height, pixels

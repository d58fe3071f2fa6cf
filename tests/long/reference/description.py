"""What both renderers are given: a scene in terms that both define alike.

Lobes: Lambertian reflection; the microfacet distribution GGX with Smith's height-correlated masking, sampled by visible
normals, on a metal that reflects everything (F = 1) and on rough glass (exact Fresnel equations); each without energy
compensation. Lights: emitting triangles, spheres, an equirectangular environment. A box filter, no lens.
"""

from dataclasses import dataclass, field

import numpy as np


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
    environment: np.ndarray | None = None  # height x width x 3, radiance; the first row is straight up
    size: int = 128  # width and height, pixels

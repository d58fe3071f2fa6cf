"""Pictures of files."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import arrays
from ._kdray import CoreScene
from .device import Device, selector

_VIEW = ("eye", "target", "up", "vertical_fov")

Camera = str | int | Mapping[str, Any]


class Scene:
    """A scene of a file that is ready to be rendered: what :func:`load` returns.

    Its structure is kept. It is made again if a picture asks for another size, camera of the file, moment or integrator
    than the picture before.
    """

    def __init__(self, core: CoreScene, choices: dict[str, Any]) -> None:
        self._core, self._choices = core, choices
        self._n_triangles, *bounds, self._notes = core.facts(choices)
        self._bounds = np.array(bounds)

    @property
    def device(self) -> str:
        """The name of the Vulkan device, or "cpu"."""
        return self._core.device_name

    @property
    def n_triangles(self) -> int:
        """The number of triangles."""
        return self._n_triangles

    @property
    def bounds(self) -> NDArray[np.float64]:
        """The minimum and maximum corner of what the scene shows (2, 3), in the coordinates of the file."""
        return self._bounds.copy()

    @property
    def notes(self) -> list[str]:
        """What kdray has assumed about the file, and measured in it, one line each."""
        return list(self._notes)

    def __repr__(self) -> str:
        return f"<kdray.Scene of {self.n_triangles} triangles on {self.device}>"

    def render(
        self,
        *,
        spp: int | None = None,
        size: tuple[int, int] | None = None,
        camera: Camera | None = None,
        at: float | None = None,
        integrator: str | None = None,
    ) -> dict[str, NDArray[Any]]:
        """Renders a picture. :func:`render` has the arguments. What is left out is as in :func:`load`."""
        view = dict.fromkeys(_VIEW)
        if isinstance(camera, Mapping):
            view, camera = _view(camera), None
        asked = _choices(size, camera, at, integrator)
        choices = {key: self._choices[key] if value is None else value for key, value in asked.items()}
        samples = None if spp is None else arrays.integer("spp", spp, 1)
        return self._core.render(choices, view, samples)


def load(
    path: str | os.PathLike[str],
    *,
    size: tuple[int, int] | None = None,
    camera: str | int | None = None,
    at: float | None = None,
    integrator: str | None = None,
    device: int | str | Device | None = None,
) -> Scene:
    """Loads a file: a scene of kdray, glTF, or a mesh in any format that the command reads.

    ``device`` is as in :class:`RaycastingScene`, all other arguments as in :func:`render`. A file that cannot be read
    or understood gives a ValueError with the line of the command.
    """
    if isinstance(camera, Mapping):
        raise TypeError("camera: expected a name or an index of the file's cameras; render takes points")
    choices = _choices(size, camera, at, integrator)
    return Scene(CoreScene(os.fspath(path), selector(device), choices), choices)


def render(
    scene: Scene | str | os.PathLike[str],
    *,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    camera: Camera | None = None,
    at: float | None = None,
    integrator: str | None = None,
    device: int | str | Device | None = None,
) -> dict[str, NDArray[Any]]:
    """Renders a picture, as the command ``kdray render`` does.

    Parameters
    ----------
    scene : what :func:`load` returns, or a file.
    spp : samples per pixel. None: those of the scene.
    size : width and height, pixels. None: those of the scene.
    camera : the name or index of a camera of the file; or a dict with some of ``eye`` and ``target`` (3,) in the
        coordinates of the file, ``up`` (3,) and ``vertical_fov`` in degrees. What is left out is that of the scene's
        camera.
    at : the moment of animations, seconds. None: animated things stand as the file has them at rest.
    integrator : "whitted" or "path". None: that of the scene.
    device : of a file; a scene has its own.

    Returns
    -------
    dict of arrays with rows from the top. All layers of docs/guide.md come with the picture; those of paths alone only
    with the integrator "path".

    - ``picture`` (height, width, 3) uint8: what the command writes into a PNG, sRGB.
    - ``radiance`` (height, width, 3) float32, linear.
    - ``normal``, ``position``, ``albedo``, ``emission``, ``direct``, ``indirect`` (height, width, 3) float32.
    - ``motion`` (height, width, 2) float32: until 1/24 s later.
    - ``depth``, ``variance`` (height, width) float32; ``id``, ``material``, ``rays``, ``cost``, ``samples`` (height,
      width) uint32.
    """
    if not isinstance(scene, Scene):
        name = None if isinstance(camera, Mapping) else camera
        scene = load(scene, size=size, camera=name, at=at, integrator=integrator, device=device)
    elif device is not None:
        raise ValueError(f"device: the scene is on {scene.device} already; load takes a device")
    return scene.render(spp=spp, size=size, camera=camera, at=at, integrator=integrator)


def _choices(
    size: tuple[int, int] | None, camera: str | int | None, at: float | None, integrator: str | None
) -> dict[str, Any]:
    if size is not None:
        if not isinstance(size, (tuple, list)) or len(size) != 2:
            raise ValueError(f"size: expected (width, height), not {size!r}")
        size = (arrays.integer("size", size[0], 1), arrays.integer("size", size[1], 1))
    if camera is not None and not isinstance(camera, str):
        camera = str(arrays.integer("camera", camera))
    if integrator is not None and not isinstance(integrator, str):
        raise TypeError(f"integrator: expected a word, not {type(integrator).__name__}")
    moment = None if at is None else _number("at", at)
    return {"size": size, "camera": camera, "at": moment, "integrator": integrator}


def _view(camera: Mapping[str, Any]) -> dict[str, Any]:
    if unknown := set(camera) - set(_VIEW):
        raise ValueError(f"camera: expected the keys {', '.join(_VIEW)}, not {', '.join(map(str, sorted(unknown)))}")
    view = dict.fromkeys(_VIEW)
    for key, value in camera.items():
        name = f'camera["{key}"]'
        view[key] = _number(name, value) if key == "vertical_fov" else arrays.vector(name, value).tolist()
    return view


def _number(name: str, value: ArrayLike) -> float:
    number = arrays.as_array(name, value)
    if number.shape != () or not np.isfinite(number):
        raise ValueError(f"{name}: expected a finite number, not {value!r}")
    return float(number)

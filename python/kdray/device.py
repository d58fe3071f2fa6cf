"""The machine's Vulkan devices."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

from . import _kdray, arrays


@dataclass(frozen=True)
class Device:
    """A Vulkan device.

    ``kind`` is "discrete GPU", "integrated GPU", "virtual GPU", "CPU" (a driver that computes on the CPU) or "other".
    ``missing`` lists what kdray needs and the device lacks: it is empty for a device that can be used.
    """

    index: int
    name: str
    kind: str
    driver: str
    memory_bytes: int
    missing: tuple[str, ...]


def devices() -> list[Device]:
    """Lists the Vulkan devices, usable or not. The list is empty where there is no Vulkan loader or driver."""
    return [Device(*row[:5], tuple(row[5])) for row in _kdray.devices()]


_KINDS = ["discrete GPU", "integrated GPU", "virtual GPU"]
_has_warned = False


def best_gpu() -> int | None:
    """Returns the index of the best GPU. Warns at the first time that there is none.

    Drivers that compute on the CPU do not count: kdray's own engine for the CPU is faster than they are.
    """
    usable = [device for device in devices() if device.kind in _KINDS and not device.missing]
    if usable:
        return min(usable, key=lambda device: (_KINDS.index(device.kind), device.index)).index
    global _has_warned
    if not _has_warned:
        _has_warned = True
        warnings.warn(
            'kdray finds no GPU with Vulkan 1.3: the CPU casts rays (device="cpu" says so without this warning)',
            RuntimeWarning,
            stacklevel=4,
        )
    return None


def selector(device: int | str | Device | None) -> int | str | None:
    """Returns how the compiled part names a device: None is the CPU."""
    if device is None:
        return best_gpu()
    if isinstance(device, Device):
        return device.index
    if isinstance(device, str):
        return None if device.lower() in ("cpu", "cpu:0") else device
    if isinstance(device, int) and not isinstance(device, bool):
        return arrays.integer("device", device)
    raise TypeError(f'device: expected None, "cpu", an index or a name, not {type(device).__name__}')

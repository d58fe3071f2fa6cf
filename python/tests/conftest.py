import numpy as np
import pytest

import kdray


def software_device() -> kdray.Device:
    """The driver that computes on the CPU: the tests need one, as those of the library do."""
    found = [device for device in kdray.devices() if device.kind == "CPU" and not device.missing]
    assert found, "the tests need Mesa's lavapipe: ./setup installs it"
    return found[0]


@pytest.fixture(params=["cpu", "device"])
def device(request: pytest.FixtureRequest) -> str | int:
    """Both engines: the CPU's, and a Vulkan device."""
    return "cpu" if request.param == "cpu" else software_device().index


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(7)


def soup(random: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Random triangles in a cube of side 2."""
    corners = random.uniform(-1, 1, (n, 1, 3)) + random.uniform(-0.5, 0.5, (n, 3, 3))
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * n, dtype=np.uint32).reshape(n, 3)


def ball(n: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """A closed ball of radius 1 around 0, of 2 n (n - 1) triangles."""
    around, down = np.meshgrid(np.arange(n), np.arange(1, n))
    azimuth, polar = 2 * np.pi * around / n, np.pi * down / n
    rows = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)
    vertices = np.concatenate([rows.reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]]).astype(np.float32)
    ix, right = n * (down - 1) + around, n * (down - 1) + (around + 1) % n
    upper = np.stack([ix[:-1], ix[1:], right[1:]], axis=-1).reshape(-1, 3)
    lower = np.stack([ix[:-1], right[1:], right[:-1]], axis=-1).reshape(-1, 3)
    top = np.stack([np.full(n, len(vertices) - 2), ix[0], right[0]], axis=-1)
    bottom = np.stack([np.full(n, len(vertices) - 1), right[-1], ix[-1]], axis=-1)
    return vertices, np.concatenate([upper, lower, top, bottom]).astype(np.uint32)


def random_rays(random: np.random.Generator, n: int) -> np.ndarray:
    return random.uniform(-1.5, 1.5, (n, 6)).astype(np.float32)


def fresh(device: str | int, geometries: list[tuple[np.ndarray, np.ndarray]]) -> kdray.RaycastingScene:
    scene = kdray.RaycastingScene(device=device)
    for vertices, triangles in geometries:
        scene.add_triangles(vertices, triangles)
    return scene


def assert_same_hits(ours: dict[str, np.ndarray], expected: dict[str, np.ndarray], most: float = 0.001) -> None:
    """Compares hits. Up to a share of `most` of them may differ, where rounding decides at edges."""
    same = np.ones(ours["t_hit"].shape, bool)
    for key in ["geometry_ids", "primitive_ids"]:
        same &= ours[key] == expected[key]
    assert np.mean(~same) <= most, f"{np.sum(~same)} of {same.size} hits differ"
    for key in ["t_hit", "primitive_uvs", "primitive_normals"]:
        np.testing.assert_allclose(ours[key][same], expected[key][same], rtol=1e-3, atol=1e-3)



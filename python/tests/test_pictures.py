"""Pictures are those of the command."""

import base64
import json
import os
import signal
import subprocess
import threading
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

import kdray

SCENES = Path(__file__).parents[2] / "scenes"
CORNELL = SCENES / "cornell.toml"


def of_command(directory, scene, *arguments):
    """Renders by the command whose path is in KDRAY: the picture, and all channels."""
    command = [os.environ.get("KDRAY", "kdray"), "render", str(scene), "--quiet", *arguments]
    layers = "depth,normal,position,albedo,id,material,motion,rays,cost"
    layers += ",variance,samples,emission,direct,indirect" if "path" in arguments else ""
    subprocess.run([*command, "--aov", layers, "-o", directory / "picture.png"], check=True)
    picture = np.array(Image.open(directory / "picture.png").convert("RGB"))
    channels = OpenEXR.File(str(directory / "picture.exr"), separate_channels=True).channels()
    return picture, {name: channel.pixels for name, channel in channels.items()}


def assert_same(ours, expected):
    """Compares all bits, of all layers of both."""
    picture, channels = expected
    np.testing.assert_array_equal(ours["picture"], picture)
    channels = dict(channels)
    for name, layer in ours.items():
        if name == "picture":
            continue
        prefix = "" if name == "radiance" else f"{name}."
        components = {2: ["XY", "RGB", "XYZ"], 3: ["RGB", "XYZ", "XY"]}[layer.ndim]
        known = [letters for letters in components if all(prefix + letter in channels for letter in letters)]
        names = [prefix + letter for letter in known[0]] if layer.ndim == 3 else [
            key for key in channels if key.startswith(prefix)
        ]
        stacked = np.stack([channels.pop(key) for key in names], axis=-1).reshape(layer.shape)
        assert layer.dtype == stacked.dtype, name
        np.testing.assert_array_equal(layer, stacked, err_msg=name)
    assert not channels, "layers that are missing"


@pytest.mark.parametrize("integrator", ["whitted", "path"])
def test_pictures_are_those_of_the_command(tmp_path, integrator):
    expected = of_command(
        tmp_path, CORNELL, "--cpu", "--size", "64x48", "--spp", "4", "--integrator", integrator
    )
    ours = kdray.render(CORNELL, size=(64, 48), spp=4, integrator=integrator, device="cpu")
    assert_same(ours, expected)
    again = kdray.load(CORNELL, device="cpu").render(size=(64, 48), spp=4, integrator=integrator)
    assert_same(again, expected)
    other = kdray.render(CORNELL, size=(64, 48), spp=5, integrator=integrator, device="cpu")
    with pytest.raises(AssertionError):
        assert_same(other, expected)


def test_samples_are_those_of_the_scene(tmp_path):
    expected = of_command(tmp_path, CORNELL, "--cpu", "--size", "16x12")
    assert_same(kdray.render(CORNELL, size=(16, 12), device="cpu"), expected)


def test_a_device_draws_what_the_cpu_draws(device):
    scene = kdray.load(CORNELL, size=(48, 36), device=device)
    assert scene.device == "cpu" or device != "cpu"
    ours, expected = scene.render(spp=2), kdray.render(CORNELL, size=(48, 36), spp=2, device="cpu")
    assert ours.keys() == expected.keys()
    assert np.mean(ours["id"] != expected["id"]) < 0.02
    assert np.mean(np.abs(ours["radiance"] - expected["radiance"]) > 0.01) < 0.02


def test_cameras(tmp_path):
    scene = kdray.load(CORNELL, size=(32, 24), device="cpu")
    assert scene.n_triangles == 34 and scene.bounds.shape == (2, 3) and (scene.bounds[0] < scene.bounds[1]).all()
    camera = {"eye": [0.5, 2, 9], "target": [0, 2.5, 0], "vertical_fov": 50}
    look = ["--eye=0.5,2,9", "--target=0,2.5,0", "--fov=50"]
    expected = of_command(tmp_path, CORNELL, "--cpu", "--size", "32x24", *look)
    ours = scene.render(camera=camera)
    assert_same(ours, expected)
    with pytest.raises(AssertionError):
        assert_same(scene.render(), expected)


def test_moments(tmp_path):
    """A triangle that moves to the right by 1 a second."""
    arrays = [np.float32([[-1, -1, 0], [1, -1, 0], [0, 1, 0]]), np.float32([0, 4]), np.float32([[0] * 3, [4, 0, 0]])]
    data, views = b"".join(array.tobytes() for array in arrays), []
    for array in arrays:
        begin = sum(view["byteLength"] for view in views)
        views.append({"buffer": 0, "byteOffset": begin, "byteLength": array.nbytes})
    accessor = {"componentType": 5126, "type": "VEC3"}
    file = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 0, 6]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "buffers": [
            {
                "byteLength": len(data),
                "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode(),
            }
        ],
        "bufferViews": views,
        "accessors": [
            {"bufferView": 0, "count": 3, "min": [-1, -1, 0], "max": [1, 1, 0], **accessor},
            {"bufferView": 1, "count": 2, "min": [0], "max": [4], "componentType": 5126, "type": "SCALAR"},
            {"bufferView": 2, "count": 2, **accessor},
        ],
        "animations": [
            {
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
                "samplers": [{"input": 1, "output": 2}],
            }
        ],
    }
    path = tmp_path / "moves.gltf"
    path.write_text(json.dumps(file))
    scene = kdray.load(path, size=(64, 32), device="cpu")
    layers = [scene.render(at=at, spp=1) for at in [0.0, 1.0]]
    hits = [np.argwhere(it["id"] == 0) for it in layers]
    # At the distance 6, a unit is 32 / (2 * 6 * tan(0.4)) pixels wide.
    n_px = 32 / (12 * np.tan(0.4))
    assert np.abs(hits[1].mean(axis=0) - hits[0].mean(axis=0) - [0, n_px]).max() < 0.5
    motion = layers[0]["motion"][layers[0]["id"] == 0]
    np.testing.assert_allclose(motion, np.tile([n_px / 24, 0], (len(motion), 1)), atol=1e-3)


def test_refusals(tmp_path):
    (tmp_path / "bad.toml").write_text("[camera\n")
    for path, what in [
        (tmp_path / "none.toml", "none.toml: cannot be read: No such file or directory"),
        (tmp_path / "bad.toml", "bad.toml"),
        (tmp_path / "bad.xyz", "bad.xyz"),
    ]:
        with pytest.raises(ValueError, match=what) as error:
            kdray.load(path, device="cpu")
        assert "\n" not in str(error.value)
    scene = kdray.load(CORNELL, size=(8, 8), device="cpu")
    for arguments, kind, what in [
        ({"size": (0, 8)}, ValueError, "size: expected an integer from 1 on, not 0"),
        ({"size": (8, 100_000)}, ValueError, "height"),
        ({"size": 8}, ValueError, r"size: expected \(width, height\), not 8"),
        ({"spp": 0}, ValueError, "spp: expected an integer from 1 on, not 0"),
        ({"spp": 1 << 31}, ValueError, "samples"),
        ({"integrator": "photons"}, ValueError, "integrator: .*photons.*whitted, path"),
        ({"integrator": 3}, TypeError, "integrator: expected a word, not int"),
        ({"camera": "front"}, ValueError, "front"),
        ({"camera": {"eye": [0, 1]}}, ValueError, r'camera\["eye"\]: expected three finite numbers'),
        ({"camera": {"fov": 3}}, ValueError, "camera: expected the keys eye, target, up, vertical_fov, not fov"),
        ({"camera": {"eye": [0, 1, 0], "target": [0, 1, 0]}}, ValueError, "camera: "),
        ({"camera": {"vertical_fov": 200}}, ValueError, "camera: .*200"),
        ({"at": np.nan}, ValueError, "at: expected a finite number, not nan"),
    ]:
        with pytest.raises(kind, match=what) as error:
            scene.render(**arguments)
        assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match="device: the scene is on cpu already"):
        kdray.render(scene, device="cpu")
    assert scene.render(spp=1)["depth"].shape == (8, 8), "a scene outlives what it has refused"


def test_ctrl_c_ends_a_picture():
    scene = kdray.load(CORNELL, size=(64, 64), device="cpu")
    # Python does not set this handler where a shell ignores SIGINT, as it does for what runs in the background.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    try:
        with pytest.raises(KeyboardInterrupt):
            scene.render(spp=60_000, integrator="path")
    finally:
        signal.signal(signal.SIGINT, before)

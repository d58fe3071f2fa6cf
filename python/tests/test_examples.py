"""The examples run, and write what they say."""

import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

EXAMPLES = Path(__file__).parents[1] / "examples"
SIZES = {
    "ambient_occlusion": (48, (48, 48)),
    "depth_camera": (32, (96, 64)),
    "signed_distance": (32, (32, 32)),
    "sky_view": (32, (32, 32)),
    "turntable": (24, (96, 48)),
}


def run(name, output, size):
    command = [sys.executable, EXAMPLES / f"{name}.py", "-o", output, "--size", str(size)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def test_all_examples_are_run():
    names = {path.stem for path in EXAMPLES.glob("*.py")}
    assert names == {"common", "lidar", *SIZES}


@pytest.mark.parametrize("name", SIZES)
def test_pictures(name, tmp_path):
    size, expected = SIZES[name]
    assert "picture.png" in run(name, tmp_path / "picture.png", size)
    picture = Image.open(tmp_path / "picture.png")
    assert picture.size == expected
    low, high = picture.convert("L").getextrema()
    assert high - low > 60, "it shows something"


def test_lidar(tmp_path):
    run("lidar", tmp_path / "points.ply", 60)
    header, points = (tmp_path / "points.ply").read_bytes().split(b"end_header\n", 1)
    n = int(header.split(b"element vertex ")[1].split()[0])
    assert len(points) == 20 * n and 5 * 32 * 60 / 2 < n <= 5 * 32 * 60

"""trimesh's own tests of rays, from its source distribution, with kdray in place of its engines.

The distribution has no model files: meshes of `trimesh.creation` stand for them.
"""

import logging
import subprocess
import sys
import tarfile
import time
import types
from pathlib import Path

import numpy as np
import pytest
import trimesh
from conftest import ball

from kdray.trimesh import RayMeshIntersector


def sources() -> Path:
    """The folder of the tests of the trimesh that is installed, which are fetched once a machine."""
    version = trimesh.__version__
    folder = Path.home() / ".cache" / "kdray" / f"trimesh-{version}"
    archive = folder / f"trimesh-{version}.tar.gz"
    if not archive.exists():
        fetch = ["download", "-q", "--no-deps", "--no-binary", "trimesh", "-d", str(folder), f"trimesh=={version}"]
        subprocess.run([sys.executable, "-m", "pip", *fetch], check=True)
    with tarfile.open(archive) as files:
        files.extractall(folder, filter="data")
    return folder / f"trimesh-{version}" / "tests"


def open_ball():
    vertices, triangles = ball(12)
    return trimesh.Trimesh(vertices, triangles[:-30])


MODELS = {
    "unit_cube.STL": trimesh.creation.box,
    "unit_sphere.STL": trimesh.creation.icosphere,
    "teapot.stl": open_ball,
    "featuretype.STL": lambda: trimesh.creation.annulus(0.5, 1, 0.4),
}

GENERIC = types.SimpleNamespace(
    np=np,
    trimesh=trimesh,
    time=time,
    log=logging.getLogger("trimesh"),
    random=np.random.default_rng(1).random,
    get_mesh=lambda name, **_: MODELS[name](),
)

# They need model files or packages. test_trimesh.py asks the same of other meshes.
LEFT_OUT = {"test_rays", "test_on_edge", "test_contains_cavity"}

# Where kdray's documented answer is another one.
DIFFERS = {
    "test_on_vertex": "a ray through a vertex meets all triangles there",
    "test_issue_457_multihit_cylinder_count": "a ray through an edge meets both triangles",
    "test_embree_duplicate_hits": "a hit at t = 0 does not count, and one at a vertex is one of all triangles there",
}


def cases():
    for file in ["test_ray", "test_ray_upstream"]:
        text = (SOURCES / f"{file}.py").read_text()
        names = [line[4 : line.index("(")] for line in text.splitlines() if line.startswith("def test_")]
        for name in names:
            if name in LEFT_OUT:
                continue
            marks = [pytest.mark.xfail(reason=DIFFERS[name], strict=True)] if name in DIFFERS else []
            yield pytest.param(file, name, id=name, marks=marks)


SOURCES = sources()


@pytest.mark.parametrize("file, name", list(cases()))
def test_own(file, name, monkeypatch):
    made = []

    def engine(mesh, **options):
        made.append(RayMeshIntersector(mesh, device="cpu", **options))
        return made[-1]

    for module in [trimesh.ray.ray_pyembree, trimesh.ray.ray_triangle]:
        monkeypatch.setattr(module, "RayMeshIntersector", engine)
    monkeypatch.setitem(sys.modules, "generic", GENERIC)
    namespace = {"__name__": file}
    exec(compile((SOURCES / f"{file}.py").read_text(), file, "exec"), namespace)
    namespace[name]()
    assert made, "the test has asked kdray"

"""Threads, processes, signals, pickles, devices, types."""

import copy
import os
import pickle
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from conftest import assert_same_hits, ball, fresh, random_rays, soup

import kdray


def run(code, **kwargs):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, **kwargs)


def test_threads_cast_while_another_updates(device, random):
    scene = fresh(device, [ball(8), soup(random, 50)])
    rays = random_rays(random, 500)
    expected = [fresh(device, [(ball(8)[0] * size, ball(8)[1]), soup(np.random.default_rng(3), 50)]) for size in [1, 2]]
    scene = fresh(device, [ball(8), soup(np.random.default_rng(3), 50)])
    states = [it.cast_rays(rays)["t_hit"] for it in expected]
    assert (states[0] != states[1]).any()
    errors, is_over = [], threading.Event()

    def cast():
        try:
            while not is_over.is_set():
                t = scene.cast_rays(rays)["t_hit"]
                if not any((t == state).all() for state in states):
                    raise AssertionError("a cast saw neither state")
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=cast) for _ in range(4)]
    for thread in threads:
        thread.start()
    for turn in range(20):
        scene.update_vertices(0, ball(8)[0] * (2 - turn % 2))
    is_over.set()
    for thread in threads:
        thread.join()
    assert not errors, errors


def test_python_runs_while_rays_fly(random):
    scene, rays = fresh("cpu", [soup(random, 3000)]), random_rays(random, 300_000)
    scene.cast_rays(rays[:1])
    thread = threading.Thread(target=scene.count_intersections, args=(rays,))
    n_ticks = 0
    thread.start()
    while thread.is_alive():
        n_ticks += 1
        time.sleep(0.001)
    assert n_ticks > 20


@pytest.mark.parametrize("make", [lambda scene: pickle.loads(pickle.dumps(scene)), copy.deepcopy])
def test_pickles(make, device, random):
    scene = fresh(device, [soup(random, 40), soup(random, 40), soup(random, 40)])
    scene.update_transforms([0], [[[0, -1, 0, 0.1], [1, 0, 0, 0], [0, 0, 1, 0]]])
    scene.remove(1)
    again = make(scene)
    rays = random_rays(random, 2000)
    assert_same_hits(again.cast_rays(rays), scene.cast_rays(rays), most=0)
    assert again.add_triangles(*ball(6)) == 3 and again.device == scene.device


def test_a_forked_child_is_told_to_spawn(device, random):
    scene = fresh(device, [ball(6)])
    scene.cast_rays(random_rays(random, 10))
    cornell = kdray.load(Path(__file__).parents[2] / "scenes" / "cornell.toml", size=(8, 8), device=device)
    reader, writer = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        try:
            for call in [lambda: scene.cast_rays(np.zeros((1, 6))), scene.close, cornell.render, kdray.devices]:
                try:
                    call()
                    os.write(writer, b"no error;")
                except RuntimeError as error:
                    os.write(writer, b"spawn;" if "spawn" in str(error) else repr(error).encode())
            del scene, cornell
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as said:
        assert said.read() == "spawn;" * 4
    assert os.waitpid(child, 0)[1] == 0


def test_a_spawned_child_casts(random):
    scene = fresh("cpu", [ball(6)])
    code = "import pickle, sys; print(pickle.load(sys.stdin.buffer).cast_rays([0, 0, 2, 0, 0, -1])['t_hit'])"
    child = subprocess.run([sys.executable, "-c", code], input=pickle.dumps(scene), capture_output=True, timeout=60)
    assert child.stdout.decode().strip() == "1.0", child.stderr


def test_interrupts():
    code = """
import os, signal, threading, numpy as np, kdray
random = np.random.default_rng(1)
corners = random.uniform(-1, 1, (2000, 1, 3)) + random.uniform(-0.3, 0.3, (2000, 3, 3))
scene = kdray.RaycastingScene(device="cpu")
scene.add_triangles(corners.reshape(-1, 3), np.arange(6000).reshape(-1, 3))
scene.cast_rays(np.zeros((1, 6)))
rays = np.tile(random.uniform(-1, 1, (200_000, 6)).astype(np.float32), (100, 1))
signal.signal(signal.SIGINT, signal.default_int_handler)  # which Python does not set where a shell ignores SIGINT
threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    scene.count_intersections(rays)
    print("not interrupted")
except KeyboardInterrupt:
    print("interrupted", scene.cast_rays([0, 0, 0, 0, 0, 1])["t_hit"].shape)
"""
    begin = time.monotonic()
    child = run(code)
    assert child.stdout == "interrupted ()\n", child.stderr
    assert time.monotonic() - begin < 30


def test_builds_tell_of_their_progress(device, random):
    scene, shares = kdray.RaycastingScene(device=device), []
    for _ in range(4):
        scene.add_triangles(*soup(random, 40_000), mask=1)
    scene.build(progress=shares.append)
    assert shares == sorted(shares) and shares[0] == 0 and shares[-1] == 1 and any(0 < share < 1 for share in shares)
    before = scene._core.structures()
    scene.build()
    assert len(before) == 4 and scene._core.structures() == before


def test_what_the_progress_raises_ends_the_build(random):
    scene = fresh("cpu", [soup(random, 60_000)])

    def refuse(share):
        raise LookupError(f"at {share:.1f}")

    with pytest.raises(LookupError, match="at 0"):
        scene.build(progress=refuse)
    assert scene._core.is_built() is False
    assert scene.cast_rays([0, 0, 0, 0, 0, 1])["t_hit"] > 0 and scene._core.is_built()
    with pytest.raises(TypeError):
        scene.build(progress=lambda: None)


def test_interrupts_end_builds():
    code = """
import os, signal, threading, numpy as np, kdray
random = np.random.default_rng(1)
corners = random.uniform(-1, 1, (1_000_000, 1, 3)) + random.uniform(-0.1, 0.1, (1_000_000, 3, 3))
scene = kdray.RaycastingScene(device="cpu")
scene.add_triangles(corners.reshape(-1, 3), np.arange(3_000_000).reshape(-1, 3))
signal.signal(signal.SIGINT, signal.default_int_handler)
threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    scene.cast_rays([0, 0, 0, 0, 0, 1])
    print("not interrupted")
except KeyboardInterrupt:
    print("interrupted", scene.device)
"""
    child = run(code)
    assert child.stdout == "interrupted cpu\n", child.stderr


def test_a_signals_handler_cannot_wait_for_the_call_that_it_interrupts():
    code = """
import os, signal, threading, numpy as np, kdray
random = np.random.default_rng(1)
scene = kdray.RaycastingScene(device="cpu")
corners = random.uniform(-1, 1, (2000, 1, 3)) + random.uniform(-0.3, 0.3, (2000, 3, 3))
scene.add_triangles(corners.reshape(-1, 3), np.arange(6000).reshape(-1, 3))
rays = np.tile(random.uniform(-1, 1, (200_000, 6)).astype(np.float32), (100, 1))
signal.signal(signal.SIGINT, lambda *_: scene.close())
threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    scene.count_intersections(rays)
except RuntimeError as error:
    print(error)
"""
    assert "in use by a call that this one interrupts" in run(code).stdout


def test_exit_with_work_in_flight():
    code = """
import threading, numpy as np, kdray
random = np.random.default_rng(1)
scene = kdray.RaycastingScene(device="cpu")
corners = random.uniform(-1, 1, (2000, 1, 3)) + random.uniform(-0.3, 0.3, (2000, 3, 3))
scene.add_triangles(corners.reshape(-1, 3), np.arange(6000).reshape(-1, 3))
scene.cast_rays(np.zeros((1, 6)))
rays = random.uniform(-1, 1, (2_000_000, 6))
threading.Thread(target=scene.count_intersections, args=(rays,), daemon=True).start()
print("over")
"""
    child = run(code)
    assert (child.returncode, child.stdout) == (0, "over\n"), child.stderr


def test_devices():
    found = kdray.devices()
    assert [device.index for device in found] == list(range(len(found)))
    usable = next(device for device in found if not device.missing)
    for selector in [usable, usable.index, usable.name, usable.name[1:-1].upper()]:
        assert kdray.RaycastingScene(device=selector).device == usable.name
    assert kdray.RaycastingScene(device="CPU").device == "cpu"


def test_without_a_driver_the_cpu_casts_and_one_warning_says_so():
    code = """
import warnings, kdray
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    scenes = [kdray.RaycastingScene() for _ in range(3)]
print([scene.device for scene in scenes], len(caught), caught[0].filename, kdray.devices())
"""
    nowhere = {**os.environ, "VK_DRIVER_FILES": "/nowhere.json", "VK_ICD_FILENAMES": "/nowhere.json"}
    assert run(code, env=nowhere).stdout == "['cpu', 'cpu', 'cpu'] 1 <string> []\n"


def test_libvulkan_is_loaded_late():
    maps = "print('libvulkan' in open('/proc/self/maps').read())"
    scenes = [f"scene = kdray.RaycastingScene(device={device}); {maps}" for device in ["'cpu'", 0]]
    code = f"import kdray; {'; '.join(scenes)}"
    assert run(code).stdout == "False\nTrue\n"


def test_numbers_of_threads(random):
    scene, rays = fresh("cpu", [soup(random, 30)]), random_rays(random, 3000)
    expected = scene.cast_rays(rays)
    for set_to, given in [(1, 0), (2, 3), (0, 0)]:
        kdray.set_threads(set_to)
        assert_same_hits(scene.cast_rays(rays, given), expected, most=0)


def test_types():
    package = Path(kdray.__file__).parent
    assert (package / "py.typed").exists()
    options = ["--strict", "--no-incremental", "--cache-dir=/dev/null"]
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", *options, "-p", "kdray"], cwd="/", capture_output=True, text=True
    )
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_docstrings():
    import doctest

    assert doctest.testmod(kdray).failed == 0
    classes = [kdray.RaycastingScene, kdray.Scene, kdray.Device]
    public = [*classes, kdray.devices, kdray.load, kdray.render, kdray.set_threads]
    members = [getattr(it, name) for it in classes[:2] for name in dir(it) if name[0] != "_"]
    assert all(it.__doc__ for it in public + members if not isinstance(it, int))


@pytest.mark.filterwarnings("ignore:kdray finds no GPU")
@pytest.mark.parametrize("document", ["README.md", "docs/python.md"])
def test_examples_of_documents(document, monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[2])
    code = "".join(part.split("```")[0] for part in Path(document).read_text().split("```python\n")[1:])
    vertices, triangles = ball(6)
    mesh = trimesh.Trimesh(vertices, triangles)
    names = {"vertices": vertices, "triangles": triangles, "points": vertices, "mesh": mesh, "poses": [np.eye(4)]}
    names["eyes"] = [[3, 3, 9], [-3, 3, 9]]
    exec(code, names)
    assert 0.01 < np.mean(names["depth"] < np.inf) < 1
    assert 0.5 < np.mean(names["layers"]["depth"] < np.inf) <= 1

"""A film that the tests of farm/ render by units, and what they share."""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
FARM = ROOT / "farm"
KDRAY = os.environ.get("KDRAY", str(ROOT / "target/release/kdray"))
BIN = pathlib.Path(sys.executable).parent
FRAMES, TILES, BLOCKS, SPP = 10, 4, 2, 32
OPTIONS = "--size 40x30 --integrator path --max-depth 3 --cpu --threads 1 -q"
PATH = """
[[keyframe]]
frame = 0
eye = [0.0, 2.75, 10.7]
target = [0.0, 2.75, 0.0]

[[keyframe]]
frame = 9
eye = [2.0, 2.75, 9.5]
target = [0.0, 2.0, 0.0]
"""


def run(*command, **options):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True, **options)


def header_and_pixels(path):
    """The attributes of a picture by their names, and all bytes after them and after the table of offsets."""
    data, at, attributes = path.read_bytes(), 8, {}
    while data[at]:
        (name, kind, rest) = data[at : at + 600].split(b"\0", 2)
        begin = at + len(name) + len(kind) + 6
        end = begin + int.from_bytes(data[begin - 4 : begin], "little")
        attributes[name.decode()] = data[begin:end]
        at = end
    return attributes, data[int.from_bytes(data[at + 1 : at + 9], "little") :]


def record(path):
    """What a picture says of itself."""
    return json.loads(header_and_pixels(path)[0]["kdray"])


def film(folder):
    """The bytes of all frames, in order."""
    return [(folder / f"{frame:04}.exr").read_bytes() for frame in range(FRAMES)]


class FilmCase(unittest.TestCase):
    """A pack of a film, and the film as a single process renders it."""

    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="kdray farm's "))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        (cls.folder / "path.toml").write_text(PATH)
        cls.pack = cls.folder / "film.kdpack"
        run(KDRAY, "pack", ROOT / "scenes/cornell.toml", "--path", cls.folder / "path.toml", "-o", cls.pack)
        alone = cls.folder / "alone"
        alone.mkdir()
        options = [*OPTIONS.split(), "--spp", SPP, "--denoise", "off", "--frames", f"0-{FRAMES - 1}"]
        run(KDRAY, "render", cls.pack, *options, "-o", alone / "####.exr")
        cls.alone = film(alone)

    def out(self):
        return pathlib.Path(tempfile.mkdtemp(dir=self.folder))

    def unit(self, out, *words, changed=None, **options):
        """Starts a unit. `changed`: variables of its environment that are not those of the film."""
        env = {
            **os.environ, "SCENE": self.pack, "OUT": out, "KDRAY": KDRAY, "OPTIONS": OPTIONS, "TILES": TILES,
            "BLOCKS": BLOCKS, "SPP": SPP, **(changed or {}),
        }  # fmt: skip
        env = {name: str(value) for name, value in env.items()}
        command = [FARM / "unit", *map(str, words)]
        return subprocess.Popen(command, env=env, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **options)

    def do(self, out, *words, code=0, named="", **options):
        """Does a unit, which has to end with an exit code and a message that contains `named`. Returns its output."""
        unit = self.unit(out, *words, **options)
        output, errors = unit.communicate()
        self.assertEqual(unit.returncode, code, errors)
        self.assertIn(named, errors)
        return output

    def finish(self, out, frames=f"0-{FRAMES - 1}", changed=None):
        """Does all units one after the other. Those that are done already are left out."""
        changed = changed or {}
        for tile in range(1, changed.get("TILES", TILES) + 1):
            for block in range(1, changed.get("BLOCKS", BLOCKS) + 1):
                self.do(out, "render", frames, tile, block, changed=changed)
        self.do(out, "merge", frames, changed=changed)

    def wait_for(self, is_so):
        until = time.monotonic() + 120
        while not is_so():
            self.assertLess(time.monotonic(), until, "it takes too long")
            time.sleep(0.02)

    def duration_of_a_unit(self):
        out, begin = self.out(), time.monotonic()
        self.do(out, "render", "0", 1, 1)
        return time.monotonic() - begin

    def on_another_worker(self, options):
        """A command that calls kdray with further options for rendering."""
        command = self.out() / "kdray"
        command.write_text(f'#!/bin/sh\n[ "$1" != render ] || set -- "$@" {options}\nexec "{KDRAY}" "$@"\n')
        command.chmod(0o755)
        return command

    def packed(self, scene):
        pack = scene.with_suffix(".kdpack")
        run(KDRAY, "pack", scene, "--path", self.folder / "path.toml", "-o", pack)
        return pack


def obey_signals():
    """Lets a signal end a process that is about to start, even if a shell has started the tests in the background."""
    for name in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(name, signal.SIG_DFL)


def end(process):
    """Kills a process and its children, whatever they do."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    process.wait()

#!/usr/bin/env python3
"""Tests of farm/: the same film from one process and from each engine, with workers that are killed on the way.

Needs `openjd-cli` and `distributed` (PyPI). KDRAY names the command. Slurm is tested by tests/long/slurm.py.
"""

import collections
import json
import os
import pathlib
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import zipfile

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


class Farm(unittest.TestCase):
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

    def test_openjd(self):
        out, template = self.out(), FARM / "openjd.yaml"
        run(BIN / "openjd", "check", template)
        values = {
            "Scene": self.pack, "Out": out, "Unit": FARM / "unit", "Kdray": KDRAY, "Frames": f"0-{FRAMES - 1}",
            "Tiles": TILES, "Blocks": BLOCKS, "Spp": SPP, "Options": OPTIONS,
        }  # fmt: skip
        parameters = [word for name, value in values.items() for word in ("-p", f"{name}={value}")]
        summary = run(BIN / "openjd", "summary", template, *parameters).stdout
        self.assertIn(f"Total tasks: {FRAMES * TILES * BLOCKS + FRAMES}", summary)
        log = run(BIN / "openjd", "run", template, *parameters, "--step", "Merge", "--run-dependencies").stdout
        self.assertIn("openjd_progress: 100.0", log)
        self.assertEqual(film(out), self.alone)
        # What fails is told to the engine.
        parameters += ["-p", "Options=--size none", "-p", f"Out={self.out()}"]
        command = [BIN / "openjd", "run", template, *parameters, "--step", "Render", "--maximum-tasks", "1"]
        failed = subprocess.run([str(word) for word in command], capture_output=True, text=True)
        self.assertNotEqual(failed.returncode, 0)
        self.assertIn("openjd_fail: invalid value 'none'", failed.stdout)

    def test_dask_loses_a_worker(self):
        out, addresses = self.out(), self.out()
        address = addresses / "scheduler.json"
        engine = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
        scheduler = [BIN / "dask", "scheduler", "--scheduler-file", address, "--port", "0", "--no-dashboard"]
        worker = [BIN / "dask", "worker", "--scheduler-file", address, "--nthreads", "1", "--no-dashboard"]
        started = [subprocess.Popen([*map(str, command)], **engine) for command in (scheduler, worker, worker)]
        self.addCleanup(lambda: [end(process) for process in started])
        command = [
            sys.executable, FARM / "dask_film.py", self.pack, out, "--frames", f"0-{FRAMES - 1}", "--tiles", TILES,
            "--blocks", BLOCKS, "--spp", SPP, "--options", OPTIONS, "--kdray", KDRAY, "--scheduler-file", address,
        ]  # fmt: skip
        driver = subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.wait_for(lambda: len(list(out.glob("parts/*.exr"))) >= 3)
        end(started[1])
        self.assertLess(len(list(out.glob("[0-9]*.exr"))), FRAMES, "the worker is lost before the film is complete")
        output, errors = driver.communicate(timeout=300)
        self.assertEqual(driver.returncode, 0, errors)
        self.assertIn(f"{FRAMES} of {FRAMES}", output)
        self.assertEqual(film(out), self.alone)

    def dask(self, out, *words, kdray=KDRAY, options=OPTIONS):
        """Renders a film by Dask on this computer, and returns how it ends."""
        command = [sys.executable, FARM / "dask_film.py", self.pack, out, "--spp", SPP, "--options", options]
        command = [*map(str, [*command, "--kdray", kdray, *words])]
        return subprocess.run(command, capture_output=True, text=True, timeout=120)

    def codes(self, out):
        """The exit codes of all runs of each unit."""
        codes = collections.defaultdict(list)
        for line in (out / "units.tsv").read_text().splitlines():
            *_, code, unit = line.split("\t")
            codes[unit].append(int(code))
        return codes

    def test_dask_tries_again_what_may_succeed(self):
        # A command that fails twice as if the device had, and then works. Parts are of two kinds of devices.
        out, worker = self.out(), self.out()
        kdray = worker / "kdray"
        kdray.write_text(
            "#!/bin/sh\n"
            f"mkdir '{worker}/1' 2>&- && exit 4 || mkdir '{worker}/2' 2>&- && exit 5\n".replace("farm's", "farm'\\''s")
            + f'case "$*" in *"--tile 1/2"*) exec "{KDRAY}" "$@" --cpu ;; *) exec "{KDRAY}" "$@" ;; esac\n'
        )
        kdray.chmod(0o755)
        options = "--size 40x30 --integrator path --max-depth 3"
        done = self.dask(out, "--frames", "0", "--tiles", "2", kdray=kdray, options=options)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue((out / "0000.exr").exists())
        codes = sorted(code for codes in self.codes(out).values() for code in codes)
        self.assertEqual(codes, [0, 0, 0, 4, 5])
        self.assertIn("merge 0-0: note: the parts come from several devices", done.stderr)

    def test_dask_names_the_unit_that_fails(self):
        out = self.out()
        failed = self.dask(out, "--frames", "3", options="--size none")
        self.assertEqual((failed.returncode, len(failed.stderr.splitlines())), (1, 1), failed.stderr)
        self.assertIn("error: unit render 3-3 tile 1 block 1: exit code 2: invalid value 'none'", failed.stderr)
        self.assertEqual(list(self.codes(out).values()), [[2]], "it is not tried again")
        out, kdray = self.out(), self.out() / "kdray"
        kdray.write_text("#!/bin/sh\necho 'error: the device is lost' >&2\nexit 4\n")
        kdray.chmod(0o755)
        failed = self.dask(out, "--frames", "3", kdray=kdray)
        self.assertEqual((failed.returncode, len(failed.stderr.splitlines())), (1, 1), failed.stderr)
        self.assertIn("error: unit render 3-3 tile 1 block 1: exit code 4: the device is lost", failed.stderr)
        self.assertEqual(list(self.codes(out).values()), [[4] * 4], "it is tried three times more")
        for words in (("--frames", "3-1"), ("--frames", "a"), ("--frames", "0-4x2"), ("--tiles", "0")):
            refused = self.dask(out, *words)
            self.assertEqual(refused.returncode, 2)
            self.assertIn(words[0], refused.stderr.splitlines()[-1])

    def wait_for(self, is_so):
        until = time.monotonic() + 120
        while not is_so():
            self.assertLess(time.monotonic(), until, "it takes too long")
            time.sleep(0.02)

    def duration_of_a_unit(self):
        out, begin = self.out(), time.monotonic()
        self.do(out, "render", "0", 1, 1)
        return time.monotonic() - begin

    def test_units_that_are_killed_at_any_time(self):
        out, chance = self.out(), random.Random(1)
        duration = min(self.duration_of_a_unit() for _ in range(3))
        n_killed = 0
        for _ in range(100):
            words = (chance.randrange(FRAMES), chance.randint(1, TILES), chance.randint(1, BLOCKS))
            unit = self.unit(out, "render", *words, start_new_session=True)
            time.sleep(chance.uniform(0, 1.2 * duration))
            signal_of_kill = chance.choice([signal.SIGKILL, signal.SIGTERM])
            os.killpg(unit.pid, signal_of_kill)
            begin = time.monotonic()
            n_killed += unit.wait() != 0
            self.assertLess(time.monotonic() - begin, 1.0, "a unit ends within a second")
            unit.communicate()
        self.assertGreater(n_killed, 30)
        # The parts that are there are not rendered again, so each of them must be whole.
        self.assertGreater(len(list(out.glob("parts/t*.exr"))), 10)
        self.finish(out)
        self.assertEqual(film(out), self.alone)

    def test_two_workers_have_one_unit(self):
        out = self.out()
        units = [self.unit(out, "render", f"0-{FRAMES - 1}", 1, 1) for _ in range(2)]
        for unit in units:
            _, errors = unit.communicate()
            self.assertEqual(unit.returncode, 0, errors)
        self.finish(out)
        self.assertEqual(film(out), self.alone)

    def test_wrong_parts_are_refused(self):
        out = self.out()
        self.finish(out, "0")
        part = out / "parts/t2of4_b1of2.0000.exr"
        good = part.read_bytes()

        part.write_bytes(good[: len(good) // 2])
        self.do(out, "merge", "0", code=3, named="t2of4_b1of2.0000.exr")
        flipped = bytearray(good)
        flipped[-40] ^= 16
        part.write_bytes(flipped)
        self.do(out, "merge", "0", code=3, named="t2of4_b1of2.0000.exr")
        part.unlink()
        self.do(out, "merge", "0", code=3, named="the parts have gaps")
        # A scene that has changed between units.
        text = (ROOT / "scenes/cornell.toml").read_text()
        changed = self.out() / "cornell.toml"
        changed.write_text(text.replace("intensity = [", "intensity = [1", 1))
        self.assertNotEqual(changed.read_text(), text)
        # Its unit is refused. If it were not, its part would be.
        other = {"SCENE": self.packed(changed)}
        self.do(out, "render", "0", 2, 1, changed=other, code=2, named="SCENE is `cornell.kdpack ")
        (out / "film.txt").unlink()
        self.do(out, "render", "0", 2, 1, changed=other)
        (out / "film.txt").unlink()
        self.do(out, "merge", "0", code=3, named="scene_hash")
        part.write_bytes(good)
        self.do(out, "merge", "0")
        self.assertEqual((out / "0000.exr").read_bytes(), self.alone[0])

    def test_an_engine_of_open_job_description_learns_what_a_unit_does(self):
        out, openjd = self.out(), {"PROGRESS": "openjd"}
        output = self.do(out, "render", "5-4", 1, 1, changed=openjd, code=2)
        self.assertEqual(output, "openjd_fail: unit: `5-4` are no frames A-B\n")
        self.assertEqual(self.do(out, "render", "5-4", 1, 1, code=2), "")
        one = {"TILES": 1, "BLOCKS": 1, **openjd}
        output = self.do(out, "render", "0-2", 1, 1, changed=one)
        self.assertTrue(output.startswith("openjd_status: frames 0-2, tile 1 of 1, block 1 of 1\n"), output)
        self.assertTrue(output.endswith("\nopenjd_progress: 100.0\n"), output)
        # The frames of a merge share the percents.
        lines = self.do(out, "merge", "0-2", changed=one).splitlines()
        told = [float(line.split()[1]) for line in lines if line.startswith("openjd_progress: ")]
        self.assertEqual((told, sorted(set(told))), (sorted(told), [0, 33, 66, 100]))
        output = self.do(out, "merge", "3", changed=one, code=3)
        self.assertIn("\nopenjd_fail: ", output)
        # A block without samples is done at once.
        output = self.do(self.out(), "render", "0", 1, 3, changed={"BLOCKS": 3, **openjd})
        self.assertEqual(output, "openjd_progress: 100\n")

    def test_a_signal_to_the_unit_alone_ends_its_command(self):
        chance, durations = random.Random(2), [self.duration_of_a_unit() for _ in range(3)]
        n_ended = 0
        for _ in range(40):
            out = self.out()
            unit = self.unit(out, "render", f"0-{FRAMES - 1}", 1, 1, start_new_session=True, preexec_fn=obey_signals)
            time.sleep(chance.uniform(0, 2 * min(durations)))
            unit.send_signal(chance.choice([signal.SIGTERM, signal.SIGINT, signal.SIGHUP]))
            begin = time.monotonic()
            unit.wait()
            self.assertLess(time.monotonic() - begin, 1.0, "a unit ends within a second")
            # All processes of the unit are in its group.
            self.assertRaises(ProcessLookupError, os.killpg, unit.pid, 0)
            unit.communicate()
            self.assertEqual([*out.glob("**/.kdray-*"), *out.glob("**/.film-*")], [])
            n_ended += unit.returncode > 128 or unit.returncode < 0
        self.assertGreater(n_ended, 25)

    def test_a_signal_just_before_the_command_starts_is_not_lost(self):
        out, folder = self.out(), self.out()
        # The unit makes a folder before it starts the command. This `mkdir` sends the unit a signal.
        mkdir = folder / "mkdir"
        mkdir.write_text("#!/bin/sh\nkill -TERM $(cut -d ' ' -f 6 /proc/$$/stat)\nexec /bin/mkdir \"$@\"\n")
        mkdir.chmod(0o755)
        path = {"PATH": f"{folder}:{os.environ['PATH']}"}
        self.do(out, "render", "0", 1, 1, changed=path, code=128 + signal.SIGTERM, start_new_session=True)
        self.assertEqual(list(out.glob("parts/*")), [])

    def test_units_of_another_film_are_refused(self):
        out = self.out()
        other = self.out() / "other.kdpack"
        run(KDRAY, "pack", ROOT / "scenes/lamp.toml", "--path", self.folder / "path.toml", "-o", other)
        self.do(out, "render", "0", 1, 1)
        description = (out / "film.txt").read_bytes()
        for name, value in (("SPP", 64), ("TILES", 2), ("BLOCKS", 1), ("OPTIONS", "--cpu"), ("SCENE", other)):
            words = dict(changed={name: value}, code=2, named=f"{name} is `")
            self.do(out, "render", "1", 1, 1, **words)
            self.do(out, "merge", "0", **words)
        self.assertEqual((out / "film.txt").read_bytes(), description)
        self.assertEqual(len(list(out.glob("parts/*"))), 1)
        # A pack is the same wherever it is, and a word that is written in another way is the same.
        copy = self.out() / self.pack.name
        shutil.copyfile(self.pack, copy)
        same = {"SCENE": copy, "OPTIONS": OPTIONS.replace(" ", "  ") + "\n"}
        self.do(out, "render", "1", 1, 1, changed=same)
        # The pack's scene may be named, as in a folder.
        with zipfile.ZipFile(self.pack) as pack:
            name = json.loads(pack.read("kdpack.json"))["scene"]
        inside = {"SCENE": f"{self.pack}/{name}", "OPTIONS": f"{OPTIONS} --path path.toml"}
        out = self.out()
        self.do(out, "render", "1", 1, 1, changed=inside, cwd=self.folder)
        self.assertIn(f"SCENE film.kdpack/{name} ", (out / "film.txt").read_text())

    def test_one_of_many_workers_describes_the_film(self):
        out = self.out()
        # Half of the workers have another film: either film may be the first.
        units = [self.unit(out, "render", "0", 1, 1, changed={"SPP": 32 + 16 * (n % 2)}) for n in range(12)]
        errors = [unit.communicate()[1] for unit in units]
        codes = [unit.returncode for unit in units]
        self.assertIn(codes, ([0, 2] * 6, [2, 0] * 6), errors)
        self.assertEqual(list(out.glob(".film-*")), [])
        # What could not work describes no film.
        out = self.out()
        self.do(out, "render", "0", 1, 1, changed={"OPTIONS": "--size none"}, code=2)
        self.do(out, "render", "0", 1, 1, changed={"SCENE": "none.kdpack"}, code=3)
        self.do(out, "render", "0", 1, 1)

    def test_the_methods_that_workers_choose_change_no_pixel(self):
        """Workers may find other trees and traversals quicker than each other, so these must not change a bit."""
        methods = ["--traversal stack", "--traversal ropes", "--traversal mask", "--build fast", "--build best"]
        for integrator in ("path", "whitted"):
            wanted, records = None, set()
            for method in [*methods, "--accel grid2", "--primary auto" if integrator == "path" else "--primary trace"]:
                out, options = self.out(), f"--size 40x30 --cpu --threads 1 -q --integrator {integrator} {method}"
                self.do(out, "render", "0", 2, 1, changed={"BLOCKS": 1, "SPP": 2, "OPTIONS": options})
                part = out / "parts/t2of4_b1of1.0000.exr"
                pixels = header_and_pixels(part)[1]
                wanted = wanted or pixels
                self.assertEqual(pixels, wanted, method)
                records.add(record(part)["accel"])
            self.assertGreater(len(records), 4, "the methods were taken")

    def test_primary_rays_are_found_in_one_way_by_all_workers(self):
        alone = self.out() / "alone.exr"
        whitted = "--size 40x30 --integrator whitted --cpu --threads 1 -q"
        run(KDRAY, "render", self.pack, *whitted.split(), "-o", alone)
        self.assertTrue(record(alone)["whole"]["is_rasterized"], "the rule would rasterize so few triangles")
        for option, is_rasterized in (("", False), ("--primary auto", True), ("--primary=raster", True)):
            out = self.out()
            self.do(out, "render", "0", 1, 1, changed={"BLOCKS": 1, "SPP": 1, "OPTIONS": f"{whitted} {option}"})
            part = record(out / "parts/t1of4_b1of1.0000.exr")
            self.assertEqual(part["whole"]["is_rasterized"], is_rasterized, option)

    def test_parts_have_the_exposure_of_the_whole(self):
        scene = self.out() / "metered.toml"
        text = (ROOT / "scenes/cornell.toml").read_text()
        metered = text.replace("[render]", "[render]\nmetered = true", 1).replace("8.6, 8.0, 6.9", "860, 800, 690")
        scene.write_text(metered)
        out, pack = self.out(), self.packed(scene)
        self.finish(out, "0-1", changed={"SCENE": pack, "TILES": 2, "BLOCKS": 2})
        exposures = {record(part)["whole"]["exposure"] for part in [*out.glob("parts/*.exr"), *out.glob("*.exr")]}
        alone = self.out()
        options = [*OPTIONS.split(), "--spp", SPP, "--denoise", "off", "--frames", "0-1"]
        run(KDRAY, "render", pack, *options, "-o", alone / "####.exr")
        self.assertEqual(exposures, {record(alone / "0000.exr")["whole"]["exposure"]})
        self.assertNotEqual(exposures, {1.0})
        self.assertEqual((out / "0001.exr").read_bytes(), (alone / "0001.exr").read_bytes())

    def test_options_that_a_unit_sets_are_refused(self):
        for options, named in (
            ("--denoise edge", "--denoise off"), ("--denoise=paper", "--denoise off"), ("--tile 1/2", "--tile"),
            ("--denoise-threshold 1", "--denoise-threshold"), ("--spp 4", "SPP"), ("--frames=2", "--frames"),
        ):  # fmt: skip
            self.do(self.out(), "render", "0", 1, 1, changed={"OPTIONS": f"{OPTIONS} {options}"}, code=2, named=named)
        for options in ("--denoise off", "--denoise=off"):
            self.do(self.out(), "render", "0", 1, 1, changed={"OPTIONS": f"{OPTIONS} {options}"})
        # Without blocks, a filter is no matter of the unit.
        filtered = {"BLOCKS": 1, "OPTIONS": f"{OPTIONS} --denoise edge"}
        self.do(self.out(), "render", "0", 1, 1, changed=filtered)
        for name in ("TILES", "BLOCKS", "SPP"):
            self.do(self.out(), "render", "0", 1, 1, changed={name: "a[$(date)]"}, code=2, named=name)

    def on_another_worker(self, options):
        """A command that calls kdray with further options for rendering."""
        command = self.out() / "kdray"
        command.write_text(f'#!/bin/sh\n[ "$1" != render ] || set -- "$@" {options}\nexec "{KDRAY}" "$@"\n')
        command.chmod(0o755)
        return command

    def test_parts_of_several_devices_are_named(self):
        """Workers of two kinds: the CPU and a Vulkan driver."""
        out = self.out()
        changed = {"TILES": 2, "BLOCKS": 1, "OPTIONS": "--size 40x30 --integrator path --max-depth 3"}
        self.do(out, "render", "0", 1, 1, changed={**changed, "KDRAY": self.on_another_worker("--cpu")})
        self.do(out, "render", "0", 2, 1, changed=changed)
        self.do(out, "merge", "0", changed=changed, named="note: the parts come from several devices")
        self.assertIn("CPU; ", record(out / "0000.exr")["device"])

    def test_parts_of_several_versions_are_refused(self):
        out, changed = self.out(), {"TILES": 2, "BLOCKS": 1}
        self.do(out, "render", "0", 1, 1, changed=changed)
        self.do(out, "render", "0", 2, 1, changed=changed)
        self.do(out, "merge", "0", changed=changed)
        part = out / "parts/t2of2_b1of1.0000.exr"
        version = f'"version":"{record(part)["whole"]["version"]}"'
        other = version[:-2] + ("2" if version[-2] != "2" else "3") + '"'
        good = part.read_bytes()
        self.assertEqual(good.count(version.encode()), 1)
        part.write_bytes(good.replace(version.encode(), other.encode()))
        self.do(out, "merge", "0", changed=changed, code=3, named="has written it, and this is kdray")

    def test_the_folder_is_removed_while_a_unit_works(self):
        out = self.out() / "out"
        unit = self.unit(out, "render", "0-9", 1, 1, changed={"SPP": 4096})
        self.wait_for(lambda: list(out.glob("parts/*.exr")))
        # Until nothing is written any more.
        while out.exists():
            shutil.rmtree(out, ignore_errors=True)
        _, errors = unit.communicate()
        self.assertEqual(unit.returncode, 5, errors)
        self.assertIn("parts", errors)
        self.assertFalse(out.exists())
        self.do(out, "render", "0", 1, 1)

    def packed(self, scene):
        pack = scene.with_suffix(".kdpack")
        run(KDRAY, "pack", scene, "--path", self.folder / "path.toml", "-o", pack)
        return pack

    def test_exit_codes_tell_whether_to_try_again(self):
        self.do(self.out(), "render", "0", 1, 1, changed={"SCENE": "none.kdpack"}, code=3, named="none.kdpack")
        for words in (("render", "9-0", 1, 1), ("merge", "9-0"), ("merge", "0-4x2"), ("merge", "abc"), ("merge",)):
            self.do(self.out(), *words, code=2, named="are no frames A-B")
        self.do(self.out(), "render", "0", 5, 1, code=2, named="there is no tile 5 of 4")
        self.do(self.out(), "render", "0", 1, 3, code=2, named="there is no block 3 of 2")
        # What cannot be noted does not change the code.
        unwritable = self.out()
        (unwritable / "units.tsv").symlink_to("/dev/full")
        self.do(unwritable, "render", "0", 1, 1)
        self.do(unwritable, "render", "0", 1, 2, changed={"SCENE": "none.kdpack"}, code=3, named="none.kdpack")
        # The folder is gone, or the disk is full.
        gone = self.out()
        (gone / "parts").write_text("no folder")
        self.do(gone, "render", "0", 1, 1, code=5, named="parts")
        full = self.out()
        few_bytes = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
        self.do(full, "render", "0", 1, 1, code=5, named="cannot write", preexec_fn=few_bytes)
        self.assertEqual(list(full.glob("parts/*")), [])
        self.do(full, "render", "0", 1, 1)

    def test_report(self):
        out = self.out()
        self.finish(out, "0")
        (out / "parts/t1of4_b1of2.0000.exr").unlink()
        self.do(out, "render", "0", 1, 1)
        self.do(out, "render", "0", 1, 1, changed={"SCENE": "none.kdpack"}, code=3)
        report, text = self.report(out)
        self.assertEqual(len(report["units"]), TILES * BLOCKS + 1)
        self.assertEqual(report["done_again"], {"frames 0 tile 1/4 block 1/2": 2})
        self.assertEqual(report["failed"], {"frames 0 tile 1/4 block 1/2": 1})
        self.assertIn(f"{TILES * BLOCKS + 1} units", text)

    def report(self, out):
        text = run(sys.executable, FARM / "report.py", out, "--json", out / "report.json").stdout
        return json.loads((out / "report.json").read_text()), text

    def test_a_run_that_finds_its_parts_is_no_time_of_a_unit(self):
        out = self.out()
        lines = [
            "100.0\t110.0\ta\t0\tframes 0 tile 1/1 block 1/1",
            # The parts were there. Also, a run that failed late took longer than the one that did the work.
            "120.0\t120.1\tb\t0\tframes 0 tile 1/1 block 1/1",
            "130.0\t190.0\tb\t143\tframes 0 tile 1/1 block 1/1",
            "100.0\t112.0\tb\t0\tframes 1 tile 1/1 block 1/1",
            "100.0\t126.0\tb\t0\tframes 2 tile 1/1 block 1/1",
            "200.0\t200.5\ta\t0\tmerge 0000",
        ]
        (out / "units.tsv").write_text("\n".join(lines) + "\n")
        report, text = self.report(out)
        seconds = {"frames 0 tile 1/1 block 1/1": 10, "frames 1 tile 1/1 block 1/1": 12, "merge 0000": 0.5}
        self.assertEqual(report["units"], {**seconds, "frames 2 tile 1/1 block 1/1": 26})
        self.assertEqual(report["median_s"], {"frames": 12, "merge": 0.5})
        self.assertEqual(report["stragglers"], ["frames 2 tile 1/1 block 1/1"])
        self.assertEqual(report["failed"], {"frames 0 tile 1/1 block 1/1": 1})
        self.assertEqual((report["elapsed_s"], report["malformed_lines"]), (100.5, 0))
        self.assertNotIn("malformed", text)

    def test_lines_that_a_killed_worker_has_cut_are_counted(self):
        out = self.out()
        good = "100.0\t110.0\ta\t0\tframes 0 tile 1/1 block 1/1"
        bad = ["100.0", "1.0\t2.0\ta\t0", "x\t2.0\ta\t0\tmerge 1", "1.0\t2.0\ta\t\tmerge 1", "1\tnan\ta\t0\tmerge 2"]
        bad += [good + "100.0\t110.0\ta\t0\tmerge 0001", "3.0\t2.0\ta\t0\tmerge 0001", "1.0\t2.0\ta\t0\t"]
        (out / "units.tsv").write_bytes("\n".join([*bad, "", good, "\0\0"]).encode() + b"\xff")
        report, text = self.report(out)
        self.assertEqual((report["units"], report["busy_s"]), ({"frames 0 tile 1/1 block 1/1": 10}, 10))
        self.assertEqual(report["malformed_lines"], len(bad) + 1)
        self.assertIn(f"{len(bad) + 1} malformed lines", text)
        # A film that has no units yet, and one that has no file.
        (out / "units.tsv").write_text("")
        self.assertIn("0 units", self.report(out)[1])
        missing = subprocess.run([sys.executable, FARM / "report.py", self.out()], capture_output=True, text=True)
        self.assertEqual(missing.returncode, 3)
        self.assertRegex(missing.stderr, r"^error: .*units.tsv.*\n$")


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


if __name__ == "__main__":
    unittest.main()

"""Tests of farm/unit: it may be ended at any time and done again, and refuses what is no unit of its film."""

import json
import os
import random
import resource
import shutil
import signal
import time
import zipfile

from film import BLOCKS, FRAMES, KDRAY, OPTIONS, ROOT, TILES, FilmCase, film, obey_signals, run


class Units(FilmCase):
    def test_units_that_are_killed_at_any_time(self):
        out, chance = self.out(), random.Random(1)
        longest = 1.2 * min(self.duration_of_a_unit() for _ in range(3))
        n_tries = n_killed = n_parts = 0
        while n_tries < 100 or min(n_killed, 3 * n_parts) <= 30 and n_tries < 400:
            n_tries += 1
            words = (chance.randrange(FRAMES), chance.randint(1, TILES), chance.randint(1, BLOCKS))
            unit = self.unit(out, "render", *words, start_new_session=True)
            time.sleep(chance.uniform(0, longest))
            signal_of_kill = chance.choice([signal.SIGKILL, signal.SIGTERM])
            os.killpg(unit.pid, signal_of_kill)
            begin = time.monotonic()
            is_killed = unit.wait() != 0
            self.assertLess(time.monotonic() - begin, 1.0, "a unit ends within a second")
            unit.communicate()
            n_killed += is_killed
            n_parts = len(list(out.glob("parts/t*.exr")))
            # Other work on the computer makes units longer or shorter than those that were measured.
            longest *= 1.05 if is_killed else 0.95
        self.assertGreater(n_killed, 30)
        # The parts that are there are not rendered again, so each of them must be whole.
        self.assertGreater(n_parts, 10)
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
        n_tries = n_ended = 0
        while n_tries < 40 or n_ended <= 25 and n_tries < 200:
            n_tries += 1
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

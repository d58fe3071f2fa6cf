"""Tests of farm/openjd.yaml and farm/dask_film.py, with the schedulers themselves."""

import collections
import subprocess
import sys

from film import BIN, BLOCKS, FARM, FRAMES, KDRAY, OPTIONS, SPP, TILES, FilmCase, end, film, run


class Schedulers(FilmCase):
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
        # What fails is told to the scheduler.
        parameters += ["-p", "Options=--size none", "-p", f"Out={self.out()}"]
        command = [BIN / "openjd", "run", template, *parameters, "--step", "Render", "--maximum-tasks", "1"]
        failed = subprocess.run([str(word) for word in command], capture_output=True, text=True)
        self.assertNotEqual(failed.returncode, 0)
        self.assertIn("openjd_fail: invalid value 'none'", failed.stdout)

    def test_dask_loses_a_worker(self):
        out, addresses = self.out(), self.out()
        address = addresses / "scheduler.json"
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
        scheduler = [BIN / "dask", "scheduler", "--scheduler-file", address, "--port", "0", "--no-dashboard"]
        worker = [BIN / "dask", "worker", "--scheduler-file", address, "--nthreads", "1", "--no-dashboard"]
        # In sessions of their own, they outlive a test that is killed, but not for ever.
        limited = [["timeout", "900", *map(str, command)] for command in (scheduler, worker, worker)]
        started = [subprocess.Popen(command, **quiet) for command in limited]
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

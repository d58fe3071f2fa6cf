"""Tests of farm/report.py."""

import json
import subprocess
import sys

from film import BLOCKS, FARM, TILES, FilmCase, run


class Costs(FilmCase):
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

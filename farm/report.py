#!/usr/bin/env python3
"""Reports what a film has cost: `report.py out` reads out/units.tsv, which `farm/unit` writes, and prints a table.

A run is one call of a unit. The time of a unit is that of its longest run that succeeded: other runs have found parts
that were there. With --json FILE, the same is written as JSON: seconds of each unit, seconds of all runs, units that
failed or were done again, and stragglers (units that took more than twice as long as half of their kind).
"""

import argparse
import collections
import json
import math
import pathlib
import statistics
import sys

Run = collections.namedtuple("Run", "begin end host code unit")


def kind_of(unit):
    """The first word of a unit: `frames` if it renders, `merge` if it joins parts."""
    return unit.split()[0]


def run_of(line):
    """The run that a line states, or None if the line is cut or two lines are in one."""
    fields = line.split("\t")
    try:
        begin, end, host, code, unit = fields
        run = Run(float(begin), float(end), host, int(code), unit)
    except ValueError:
        return None
    is_run = math.isfinite(run.begin) and math.isfinite(run.end) and run.begin <= run.end and host and unit.strip()
    return run if is_run else None


def report(lines):
    """What the lines of units.tsv say, as main writes it to the file of --json."""
    lines = [line for line in lines if line.strip()]
    runs = [run for line in lines if (run := run_of(line))]
    good = collections.defaultdict(list)
    for run in runs:
        if run.code == 0:
            good[run.unit].append(run.end - run.begin)
    seconds = {unit: max(times) for unit, times in good.items()}
    medians = {
        kind: statistics.median(time for unit, time in seconds.items() if kind_of(unit) == kind)
        for kind in {kind_of(unit) for unit in seconds}
    }
    return {
        "units": {unit: round(time, 3) for unit, time in seconds.items()},
        "hosts": dict(collections.Counter(run.host for run in runs if run.code == 0)),
        "busy_s": round(sum(run.end - run.begin for run in runs), 3),
        "elapsed_s": round(max(run.end for run in runs) - min(run.begin for run in runs), 3) if runs else 0.0,
        "median_s": {kind: round(median, 3) for kind, median in medians.items()},
        "stragglers": sorted(unit for unit, time in seconds.items() if time > 2 * medians[kind_of(unit)]),
        "done_again": {unit: len(times) for unit, times in good.items() if len(times) > 1},
        "failed": dict(collections.Counter(run.unit for run in runs if run.code != 0)),
        "malformed_lines": len(lines) - len(runs),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=pathlib.Path, help="folder of the pictures")
    parser.add_argument("--json", type=pathlib.Path, help="file to write the report to")
    args = parser.parse_args()
    try:
        text = (args.out / "units.tsv").read_text(errors="replace")
    except OSError as error:
        print(f"error: {args.out / 'units.tsv'}: {error.strerror}", file=sys.stderr)
        sys.exit(3)
    found = report(text.split("\n"))
    if args.json:
        args.json.write_text(json.dumps(found, indent=2) + "\n")
    print(f"{len(found['units'])} units, {found['busy_s']:.1f} s of work in {found['elapsed_s']:.1f} s")
    for kind, median in sorted(found["median_s"].items()):
        print(f"{kind:8} median {median:.3f} s")
    for name in ("hosts", "done_again", "failed"):
        for what, n in found[name].items():
            print(f"{name.replace('_', ' ')}: {what}: {n}")
    for unit in found["stragglers"]:
        print(f"straggler: {unit}: {found['units'][unit]:.3f} s")
    if found["malformed_lines"]:
        print(f"{found['malformed_lines']} malformed lines were left out: a worker was killed while it wrote")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Reports what a film has cost: `report.py out` reads out/units.tsv, which `farm/unit` writes, and prints a table.

With --json FILE, the same is written as JSON: seconds of each unit, seconds of all, units that failed or were done
twice, and stragglers (units that took more than twice as long as half of their kind).
"""

import argparse
import collections
import json
import pathlib
import statistics


def kind_of(unit):
    return unit.split()[0]


def report(lines):
    runs = [line.split("\t") for line in lines if line.strip()]
    runs = [(float(begin), float(end), host, int(code), unit) for begin, end, host, code, unit in runs]
    good = collections.defaultdict(list)
    for begin, end, _, code, unit in runs:
        if code == 0:
            good[unit].append(end - begin)
    medians = {
        kind: statistics.median(min(times) for unit, times in good.items() if kind_of(unit) == kind)
        for kind in {kind_of(unit) for unit in good}
    }
    return {
        "units": {unit: round(min(times), 3) for unit, times in good.items()},
        "hosts": dict(collections.Counter(host for _, _, host, code, _ in runs if code == 0)),
        "busy_s": round(sum(end - begin for begin, end, *_ in runs), 3),
        "elapsed_s": round(max(end for _, end, *_ in runs) - min(begin for begin, *_ in runs), 3) if runs else 0.0,
        "median_s": {kind: round(median, 3) for kind, median in medians.items()},
        "stragglers": sorted(unit for unit, times in good.items() if min(times) > 2 * medians[kind_of(unit)]),
        "done_again": {unit: len(times) for unit, times in good.items() if len(times) > 1},
        "failed": dict(collections.Counter(unit for *_, code, unit in runs if code != 0)),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=pathlib.Path, help="folder of the pictures")
    parser.add_argument("--json", type=pathlib.Path, help="file to write the report to")
    args = parser.parse_args()
    found = report((args.out / "units.tsv").read_text().splitlines())
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


if __name__ == "__main__":
    main()

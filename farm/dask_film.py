#!/usr/bin/env python3
"""Renders a film on a Dask cluster, or on processes of this computer: `dask_film.py film.kdpack out --frames 0-9`.

Needs `distributed` (PyPI). The folder of the pictures and the pack must have the same paths on all workers. A unit
whose worker is lost runs again elsewhere; parts that were written are not rendered again.
"""

import argparse
import os
import pathlib
import subprocess
import sys

from distributed import Client, LocalCluster, as_completed

UNIT = pathlib.Path(__file__).resolve().with_name("unit")


def do(job, name, *words, after=()):
    """Runs a unit of `farm/unit` on a worker. `after`: results of the units that it needs."""
    done = subprocess.run([UNIT, *map(str, words)], env={**os.environ, **job}, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{name}: exit code {done.returncode}: {done.stderr.strip()[-500:]}")
    return name


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=pathlib.Path, help="pack of the scene and its camera path")
    parser.add_argument("out", type=pathlib.Path, help="folder of the pictures")
    parser.add_argument("--frames", default="0-9", help="frames A-B [0-9]")
    parser.add_argument("--chunk", type=int, default=1, help="frames of a unit, which loads the scene once [1]")
    parser.add_argument("--tiles", type=int, default=1, help="tiles of a picture [1]")
    parser.add_argument("--blocks", type=int, default=1, help="blocks of samples of a picture [1]")
    parser.add_argument("--spp", type=int, default=64, help="samples of each pixel [64]")
    parser.add_argument("--options", default="--integrator path", help="further options of `kdray render`")
    parser.add_argument("--kdray", default="kdray", help="the command on the workers [kdray]")
    parser.add_argument("--scheduler", help="address of a Dask scheduler [processes of this computer]")
    parser.add_argument("--scheduler-file", type=pathlib.Path, help="file that a Dask scheduler has written")
    parser.add_argument("--workers", type=int, default=1, help="processes of this computer, without a scheduler [1]")
    return parser.parse_args()


def connect(args):
    if args.scheduler_file:
        return Client(scheduler_file=str(args.scheduler_file))
    local = {"n_workers": args.workers, "threads_per_worker": 1, "dashboard_address": None}
    return Client(args.scheduler or LocalCluster(**local))


def main():
    args = arguments()
    args.out.mkdir(parents=True, exist_ok=True)
    job = {
        "SCENE": str(args.scene.resolve()),
        "OUT": str(args.out.resolve()),
        "KDRAY": args.kdray,
        "OPTIONS": args.options,
        "TILES": str(args.tiles),
        "BLOCKS": str(args.blocks),
        "SPP": str(args.spp),
    }
    first, last = int(args.frames.split("-")[0]), int(args.frames.split("-")[-1])
    with connect(args) as client:
        # A unit of a lost worker is tried on three others, and one that fails three times more.
        common = {"pure": False, "retries": 3}
        merges = []
        for begin in range(first, last + 1, args.chunk):
            frames = f"{begin}-{min(begin + args.chunk - 1, last)}"
            parts = [
                client.submit(do, job, f"{frames} {tile} {block}", "render", frames, tile, block, **common)
                for tile in range(1, args.tiles + 1)
                for block in range(1, args.blocks + 1)
            ]
            merges.append(client.submit(do, job, f"merge {frames}", "merge", frames, after=parts, **common))
        try:
            for n_done, merge in enumerate(as_completed(merges), 1):
                print(f"{merge.result()}: {n_done} of {len(merges)}", flush=True)
        except Exception as error:
            client.cancel(merges)
            sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Renders a film on a Dask cluster, or on processes of this computer: `dask_film.py film.kdpack out --frames 0-9`.

Needs `distributed` (PyPI). The folder of the pictures and the pack must have the same paths on all workers. A unit
whose worker is lost runs again elsewhere; parts that were written are not rendered again.
"""

import argparse
import logging
import os
import pathlib
import re
import subprocess
import sys
import uuid

from distributed import Client, KilledWorker, LocalCluster, as_completed

UNIT = pathlib.Path(__file__).resolve().with_name("unit")
# Exit codes of wrong options and of wrong scenes or parts: trying again does not help.
HOPELESS = (2, 3)


def do(job, name, *words, after=()):
    """Does a unit of `farm/unit` on a worker. Returns its error, or None, and its notes.

    `after`: results of the units that it needs. If one of them has failed, so has this one.
    """
    for error, _ in after:
        if error:
            return error, []
    done = subprocess.run([UNIT, *map(str, words)], env={**os.environ, **job}, capture_output=True, text=True)
    lines = done.stderr.strip().splitlines()
    if done.returncode == 0:
        return None, [f"{name}: {line}" for line in lines if line.startswith(("note: ", "warning: "))]
    errors = [line for line in lines if line.startswith("error: ")] or lines or ["no message"]
    error = f"unit {name}: exit code {done.returncode}: {errors[-1].removeprefix('error: ')[:500]}"
    if done.returncode in HOPELESS:
        # A result, because Dask would try again after an exception.
        return error, []
    raise RuntimeError(error)


def frames(word):
    """The first and the last frame of A-B, or of a single number."""
    if not re.fullmatch(r"[0-9]{1,9}(-[0-9]{1,9})?", word):
        raise argparse.ArgumentTypeError(f"`{word}` are no frames A-B")
    first, last = int(word.split("-")[0]), int(word.split("-")[-1])
    if first > last:
        raise argparse.ArgumentTypeError(f"`{word}`: the first frame comes after the last")
    return first, last


def count(word):
    if not re.fullmatch(r"[1-9][0-9]{0,8}", word):
        raise argparse.ArgumentTypeError(f"`{word}` is no number from 1 on")
    return int(word)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=pathlib.Path, help="pack of the scene and its camera path")
    parser.add_argument("out", type=pathlib.Path, help="folder of the pictures")
    parser.add_argument("--frames", type=frames, default=(0, 9), metavar="A-B", help="frames of the film [0-9]")
    parser.add_argument("--chunk", type=count, default=1, help="frames of a unit, which loads the scene once [1]")
    parser.add_argument("--tiles", type=count, default=1, help="tiles of a picture [1]")
    parser.add_argument("--blocks", type=count, default=1, help="blocks of samples of a picture [1]")
    parser.add_argument("--spp", type=count, default=64, help="samples of each pixel [64]")
    parser.add_argument("--options", default="--integrator path", help="further options of `kdray render`")
    parser.add_argument("--kdray", default="kdray", help="the command on the workers [kdray]")
    parser.add_argument("--scheduler", help="address of a Dask scheduler [processes of this computer]")
    parser.add_argument("--scheduler-file", type=pathlib.Path, help="file that a Dask scheduler has written")
    parser.add_argument("--workers", type=count, default=1, help="processes of this computer, without a scheduler [1]")
    return parser.parse_args()


def connect(args):
    """A client of the scheduler that the user names, or of one with workers of its own on this computer."""
    if args.scheduler_file:
        return Client(scheduler_file=str(args.scheduler_file))
    if args.scheduler:
        return Client(args.scheduler)
    # What goes wrong is told once, at the end.
    quiet = {"dashboard_address": None, "silence_logs": logging.CRITICAL}
    return Client(LocalCluster(n_workers=args.workers, threads_per_worker=1, **quiet))


def submit_all(client, args, job):
    """Submits the units of the film. Returns their names by their futures, and the futures of merges."""
    first, last = args.frames
    names, merges = {}, set()

    def submit(name, *words, after=()):
        # A unit that fails is tried three times more. The key says which unit it is if its workers are lost.
        key = f"{name} {uuid.uuid4()}"
        future = client.submit(do, job, name, *words, after=after, key=key, pure=False, retries=3)
        names[future] = name
        return future

    for begin in range(first, last + 1, args.chunk):
        chunk = f"{begin}-{min(begin + args.chunk - 1, last)}"
        parts = [
            submit(f"render {chunk} tile {tile} block {block}", "render", chunk, tile, block)
            for tile in range(1, args.tiles + 1)
            for block in range(1, args.blocks + 1)
        ]
        merges.add(submit(f"merge {chunk}", "merge", chunk, after=parts))
    return names, merges


def error_of(future, name):
    """The error of a unit that has ended, or None. Prints its notes."""
    try:
        error, notes = future.result()
    except KilledWorker as lost:
        return f"unit {name}: the workers that had it were lost, {lost.allowed_failures + 1} times"
    except Exception as failed:
        return str(failed).splitlines()[0]
    for note in notes:
        print(note, file=sys.stderr)
    return error


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
    with connect(args) as client:
        names, merges = submit_all(client, args, job)
        n_merged = 0
        for future in as_completed(list(names)):
            error = error_of(future, names[future])
            if error:
                client.cancel(list(names))
                sys.exit(f"error: {error}")
            if future in merges:
                n_merged += 1
                print(f"{names[future]}: {n_merged} of {len(merges)}", flush=True)


if __name__ == "__main__":
    main()

"""Counts the rays that leak through closed meshes and the wrong answers of `kdray cast`, and those of Embree.

Leaks: rays are aimed at edges and vertices of closed meshes. A ray that begins inside must hit the mesh, and the face
that it hits first must be one through which it leaves. A ray that begins outside and goes to a point deep inside
must hit the mesh on the way. These rules need no tolerance, since they are also true of every ray near the aimed one.

Wrong answers: each answer is compared with all triangles that the ray comes near, in double precision. A ray crosses a
triangle clearly if it passes inside all three edges by more than MARGIN * scale. It misses the triangle clearly if it
passes outside of an edge by as much. Here, scale is the greatest coordinate of mesh and origin. An answer is wrong in
one of three ways:
  lost     a triangle that the ray crosses clearly is in front of the reported hit, or nothing was reported
  false    the reported triangle is one that the ray misses clearly
  wrong t  the reported point is off the reported triangle's plane, or nearer or farther than all of its corners, by
           more than TOLERANCE * scale
Each answer that seems wrong is judged again in the widest floating-point type of the machine. It counts only if it is
wrong there too.

The script needs two packages: pip install numpy embreex
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from engines import Embree, Kdray
from judge import count_wrong, find_leaks, pair_up
from meshes import assert_closed, bumpy, soup, sphere, torus
from rays import Rays, judged_rays, leak_rays
from self_check import self_check


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    built = Path(__file__).resolve().parents[2] / "target/release/kdray"

    def add(flag, default, explanation):
        parser.add_argument(flag, type=type(default), default=default, help=f"{explanation} [default: %(default)s]")

    parser.add_argument("--kdray", default=built, help="the program to check [default: %(default)s]")
    parser.add_argument("--device", help="the Vulkan device, by index or name [default: kdray's choice]")
    add("--leak-rays", 100_000, "rays at edges and vertices, from each side of each closed mesh")
    add("--rays", 10_000, "rays to judge, of each of five kinds for each mesh")
    add("--levels", 4, "size of the closed meshes, which have 20 * 4^LEVELS triangles")
    add("--seed", 1, "start of the random numbers")
    parser.add_argument("--self-check", action="store_true", help="only plant errors, to see that they are counted")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    self_check(rng, 2000)
    if arguments.self_check:
        print("self-check: every planted error was counted")
        return
    with tempfile.TemporaryDirectory() as folder:
        flags = ["--device", arguments.device] if arguments.device else []
        engines = [
            Kdray(arguments.kdray, "kdray, CPU", ["--cpu"], folder),
            Kdray(arguments.kdray, "kdray, Vulkan", flags, folder),
            Embree(robust=True),
            Embree(robust=False),
        ]
        report(rng, engines, arguments)


def report(rng, engines, arguments):
    """Casts the rays of all meshes with each engine. Prints one row of counts per mesh and engine, and the totals."""
    levels = arguments.levels
    closed = [sphere(levels), torus(5 * 2**levels, 2 * 2**levels), bumpy(rng, levels)]
    print_row("mesh", "triangles", "engine", "rays at edges", "leaks", "rays judged", "lost", "false", "wrong t")
    totals = {engine.name: np.zeros(6, int) for engine in engines}
    for mesh in [*closed, soup(rng, 1000)]:
        n_triangles = len(mesh.triangles)
        if mesh.inner:
            assert_closed(mesh)
        n = arguments.leak_rays
        sides = [(inside, leak_rays(rng, mesh, n, inside)) for inside in (True, False) if mesh.inner]
        judged = Rays.joined(list(judged_rays(rng, mesh, arguments.rays)))
        pairs = pair_up(mesh, judged)
        for engine in engines:
            hits = engine.cast(mesh, Rays.joined([*(rays for _, rays in sides), judged]))
            n_leaks = 0
            for i, (inside, rays) in enumerate(sides):
                n_leaks += find_leaks(mesh, rays, hits[i * n : (i + 1) * n], inside).sum()
            first = n * len(sides)
            wrong = count_wrong(mesh, judged, hits[first:], pairs)
            counts = np.array([first, n_leaks, len(judged), *wrong])
            totals[engine.name] += counts
            print_row(mesh.name, n_triangles, engine.name, *counts)
    for name, counts in totals.items():
        print_row("all", "", name, *counts)


def print_row(mesh, n_triangles, engine, *counts):
    widths = (13, 7, 12, 7, 7, 8)
    print(f"{mesh:8} {n_triangles:>9}  {engine:21}", *(f"{x:>{w}}" for x, w in zip(counts, widths)), flush=True)


if __name__ == "__main__":
    main()

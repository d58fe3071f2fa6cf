"""Compares the noise of kdray's path tracing with that of Mitsuba 3 after equal times.

Needs from PyPI: mitsuba, numpy, OpenEXR, pillow. Usage, in the repository's folder:

    python3 -m tests.long.reference.equal_time KDRAY [--variant llvm_ad_rgb] [--cpu] [--spp N] [--runs N] [--size N]

Each of the five scenes is rendered by both, in several runs of independent samples. The noise is the variance of a
pixel among the runs, relative to its squared mean, averaged over the picture. The time is that of drawing alone, the
median of the runs, after a first run that is not counted: the scene is loaded, and kernels are compiled. Since the
variance of independent samples falls as the time grows, 1 / (variance * time) tells how good a renderer is; the last
column is kdray's divided by Mitsuba's.
"""

import argparse
import dataclasses
import json
import tempfile
import time
from pathlib import Path

import numpy as np

# Part of the picture's mean below which darkness does not increase relative errors.
DARK = 0.1


def relative_variance(pictures):
    """Mean over all pixels and colours of the variance among the pictures, relative to the squared mean."""
    pictures = np.array(pictures)
    mean = pictures.mean(0)
    return float((pictures.var(0, ddof=1) / (mean**2 + (DARK * mean.mean()) ** 2)).mean())


def by_kdray(scene, folder, options, device):
    from . import in_kdray

    file = in_kdray.write(scene, folder)
    arguments = ["--spp", str(options.spp * (options.runs + 1)), *device]
    pictures, times = [], []
    for run in range(options.runs + 1):
        profile = folder / "profile.json"
        samples = (run * options.spp, (run + 1) * options.spp)
        pictures.append(in_kdray.render(options.kdray, file, samples, [*arguments, "--profile", str(profile)]))
        times.append(json.loads(profile.read_text())["frame_ms"] / 1e3)
    return relative_variance(pictures[1:]), float(np.median(times[1:]))


def by_mitsuba(scene, options):
    import drjit as dr

    from . import in_mitsuba

    # Code in Python may be slower than what Mitsuba has.
    built = in_mitsuba.build(scene, is_own=True)
    pictures, times = [], []
    for run in range(options.runs + 1):
        begin = time.perf_counter()
        picture = in_mitsuba.mi.render(built, spp=options.spp, seed=run)
        dr.eval(picture)
        dr.sync_thread()
        times.append(time.perf_counter() - begin)
        pictures.append(np.asarray(picture, np.float64))
    return relative_variance(pictures[1:]), float(np.median(times[1:]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kdray")
    parser.add_argument("--variant", default="llvm_ad_rgb", help="of Mitsuba [default: llvm_ad_rgb]")
    parser.add_argument("--cpu", action="store_true", help="kdray renders without Vulkan")
    parser.add_argument("--runs", type=int, default=8, help="counted pictures of each renderer [default: 8]")
    parser.add_argument("--spp", type=int, default=64, help="samples of a run, a power of two from 16 on [default: 64]")
    parser.add_argument("--size", type=int, help="side of the pictures, pixels [default: the scene's]")
    parser.add_argument("--only", help="names of scenes, separated by commas [default: all]")
    options = parser.parse_args()

    import mitsuba as mi

    mi.set_variant(options.variant)
    from .scenes import all_scenes

    device = ["--cpu"] if options.cpu else []
    print(f"{options.spp} samples, {options.runs} runs, Mitsuba {mi.__version__} {options.variant}")
    print(f"{'scene':10} {'kdray':>22} {'Mitsuba':>22} {'kdray / Mitsuba':>30}")
    print(f"{'':10} {'variance':>11} {'ms':>10} {'variance':>11} {'ms':>10} {'speed':>10} {'noise':>9} {'both':>9}")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for scene in all_scenes(folder):
            if options.only and scene.name not in options.only.split(","):
                continue
            if options.size:
                scene = dataclasses.replace(scene, size=options.size)
            ours, our_time = by_kdray(scene, folder, options, device)
            theirs, their_time = by_mitsuba(scene, options)
            speed, noise = their_time / our_time, theirs / ours
            figures = f"{ours:11.5f} {1e3 * our_time:10.1f} {theirs:11.5f} {1e3 * their_time:10.1f}"
            print(f"{scene.name:10} {figures} {speed:10.2f} {noise:9.2f} {speed * noise:9.2f}", flush=True)


if __name__ == "__main__":
    main()

"""Compares kdray's path tracing with Mitsuba 3, a renderer by other people.

Needs from PyPI: mitsuba, numpy, OpenEXR, pillow. Usage, in the repository's folder:

    python3 -m tests.long.reference KDRAY [--cpu] [--runs N] [--spp N] [--only NAME,NAME] [--keep FOLDER]

Each of five scenes is rendered by both, in several runs of independent samples. The pictures' tiles of 16 x 16 pixels
are compared by their means, with the errors of these means as the runs show them (Welch's t-test). False alarms have a
probability of 1 % for each scene. Then an error is planted: kdray's light is increased by 2 %, which must be found.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from . import in_kdray, in_mitsuba
from .scenes import all_scenes
from .statistics import compare

FALSE_ALARMS = 0.01
PLANTED = 1.02


def save(path, ours, theirs):
    """Writes both pictures side by side, and between them nothing."""
    both = np.concatenate([np.mean(ours, 0), np.mean(theirs, 0)], 1)
    shown = np.clip(both / np.percentile(both, 98), 0, 1) ** (1 / 2.2)
    Image.fromarray((255 * shown + 0.5).astype(np.uint8)).save(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kdray")
    parser.add_argument("--runs", type=int, default=8, help="independent pictures of each renderer [default: 8]")
    parser.add_argument("--spp", type=int, default=64, help="samples of a run, a multiple of 16 [default: 64]")
    parser.add_argument("--only", help="names of scenes, separated by commas [default: all]")
    parser.add_argument("--keep", help="folder for scenes and pictures [default: a temporary one]")
    parser.add_argument("--cpu", action="store_true", help="renders without Vulkan")
    options = parser.parse_args()
    arguments = ["--spp", str(options.runs * options.spp), *(["--cpu"] if options.cpu else [])]
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(options.keep or temporary)
        folder.mkdir(exist_ok=True, parents=True)
        failed = False
        print(f"{'scene':10} {'worst tile':>10} {'difference':>11} {'its error':>10} {'planted 2 %':>12}")
        for scene in all_scenes(folder):
            if options.only and scene.name not in options.only.split(","):
                continue
            file = in_kdray.write(scene, folder)
            ranges = [(run * options.spp, (run + 1) * options.spp) for run in range(options.runs)]
            ours = [in_kdray.render(options.kdray, file, samples, arguments) for samples in ranges]
            built = in_mitsuba.build(scene)
            theirs = [in_mitsuba.render(built, options.spp, seed) for seed in range(options.runs)]
            save(folder / f"{scene.name}.png", ours, theirs)
            worst, difference, error = compare(ours, theirs, FALSE_ALARMS)
            planted, _, _ = compare([PLANTED * picture for picture in ours], theirs, FALSE_ALARMS)
            is_right = worst < 1 < planted
            failed |= not is_right
            verdict = "" if is_right else "  WRONG"
            figures = f"{worst:10.2f} {difference:11.3%} {error:10.3%} {planted:12.2f}"
            print(f"{scene.name:10} {figures}{verdict}", flush=True)
    sys.exit(failed)


if __name__ == "__main__":
    main()

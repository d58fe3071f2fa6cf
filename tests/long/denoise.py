"""Measures the noise filters of `--denoise` on pictures of paths.

Needs from PyPI: numpy, OpenEXR, pillow, flip-evaluator. Usage, in the repository's folder:

    python3 -m tests.long.denoise KDRAY FOLDER [--cpu] [--only NAME,NAME] [--size N] [--reference-spp N]

The five scenes of tests/long/reference are rendered with 1, 4 and 16 samples by each filter, and compared with
pictures of many samples, which are kept in FOLDER for the next time. Printed are the relative mean squared error
(squared differences over the squared reference plus 0.01) and LDR-FLIP (Andersson et al. 2020). Pictures are kept in
FOLDER, too: the reference and those of all filters side by side, for each number of samples. "WORSE" marks where
`edge` does not have the smallest error of both kinds. The program fails if its FLIP is not the smallest, or its
relative error not less than that without a filter.
"""

import argparse
import subprocess
import sys
from pathlib import Path

import flip_evaluator
import numpy as np
import OpenEXR
from PIL import Image

from .reference import in_kdray
from .reference.scenes import all_scenes

FILTERS = ("off", "paper", "edge")
N_SAMPLES = (1, 4, 16)


def render(kdray, scene_file, picture, arguments):
    """Returns the radiance as a height x width x 3 array."""
    command = [kdray, "render", scene_file, "-q", "-o", picture, *arguments]
    subprocess.run([*map(str, command)], check=True)
    channels = OpenEXR.File(str(picture)).channels()
    return np.asarray(channels["RGB" if "RGB" in channels else "RGBA"].pixels, np.float32)[..., :3]


def displayed(radiance):
    """sRGB, 0 to 1."""
    x = np.clip(radiance, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055).astype(np.float32)


def relative_error(picture, reference):
    return float(np.mean((picture - reference) ** 2 / (reference**2 + 0.01)))


def flip(picture, reference):
    shown = displayed(reference), displayed(picture)
    return float(flip_evaluator.evaluate(*shown, "LDR", applyMagma=False)[1])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kdray")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cpu", action="store_true", help="renders without Vulkan")
    parser.add_argument("--only", help="names of scenes, separated by commas [default: all]")
    parser.add_argument("--size", type=int, default=256, help="width and height, pixels [default: 256]")
    parser.add_argument("--reference-spp", type=int, default=4096, help="samples of the reference [default: 4096]")
    options = parser.parse_args()
    options.folder.mkdir(exist_ok=True, parents=True)
    engine = ["--cpu"] if options.cpu else []
    failed = False
    titles = [f"{name} {kind}" for kind in ("error", "FLIP") for name in FILTERS]
    print(f"{'scene':10} {'samples':>7} " + " ".join(f"{title:>11}" for title in titles))
    for scene in all_scenes(options.folder):
        if options.only and scene.name not in options.only.split(","):
            continue
        scene.size = options.size
        file = in_kdray.write(scene, options.folder)
        path = options.folder / f"{scene.name}_{options.size}_{options.reference_spp}.exr"
        if path.exists():
            channels = OpenEXR.File(str(path)).channels()
            reference = np.asarray(channels["RGB" if "RGB" in channels else "RGBA"].pixels, np.float32)[..., :3]
        else:
            of_reference = ["--spp", options.reference_spp, "--denoise", "off", *engine]
            reference = render(options.kdray, file, path, of_reference)
        for n_samples in N_SAMPLES:
            picture = options.folder / "last.exr"
            pictures = [
                render(options.kdray, file, picture, ["--spp", n_samples, "--denoise", name, *engine])
                for name in FILTERS
            ]
            both = [[measure(one, reference) for one in pictures] for measure in (relative_error, flip)]
            is_best = all(errors[2] < min(errors[:2]) for errors in both)
            (off, _, edge), flips = both
            failed |= not (edge < off and flips[2] < min(flips[:2]))
            figures = " ".join(f"{error:11.4f}" for errors in both for error in errors)
            print(f"{scene.name:10} {n_samples:7} {figures}{'' if is_best else '  WORSE'}", flush=True)
            shown = np.concatenate([displayed(one) for one in (reference, *pictures)], 1)
            Image.fromarray((255 * shown + 0.5).astype(np.uint8)).save(
                options.folder / f"{scene.name}_{n_samples}.png"
            )
    sys.exit(failed)


if __name__ == "__main__":
    main()

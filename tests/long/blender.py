"""What the scripts with Blender share: Blender as a module, runs of kdray, and the command line.

This module has to be imported before `bpy`. Blender has a module `cycles` of its own, and would otherwise find the
script of that name, which is in the same folder.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
sys.path[:] = [path for path in sys.path if Path(path).resolve() != FOLDER]

import bpy
import numpy as np

# Blender has found its own module, and other scripts of the folder may be imported.
sys.path.append(str(FOLDER))

# This module exists once `bpy` has been imported.
import bmesh

# Turns Blender's axes into those of the exported files, whose y axis points up.
YUP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
# Blender prints to the descriptor 1 while it works. Reports go to this copy of the standard output.
STANDARD_OUTPUT = os.dup(1)


class KdrayError(Exception):
    """A command of kdray has failed."""


def run(kdray, *arguments):
    """Runs kdray and returns what it printed."""
    done = subprocess.run([str(part) for part in (kdray, *arguments)], capture_output=True, text=True)
    if done.returncode != 0:
        raise KdrayError(f"kdray {arguments[0]} failed with {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def render(arguments, path, out, size, *options):
    """Renders a file by kdray into `out`: direct light, without the noise filter and with traced primary rays."""
    options = [*options, "--denoise", "off", "--primary", "trace", "--quiet", *arguments.options]
    # With this integrator, one sample is at the pixel's centre.
    sampling = ["--integrator", "whitted", "--spp", "1"]
    run(arguments.kdray, "render", path, "-o", out, "--size", f"{size[0]}x{size[1]}", *sampling, *options)


def triangulate(data):
    """Cuts the polygons of a mesh into triangles, since each program may cut bent polygons in its own way."""
    cut = bmesh.new()
    cut.from_mesh(data)
    bmesh.ops.triangulate(cut, faces=cut.faces)
    cut.to_mesh(data)
    cut.free()


def camera_matrix(seen):
    """Returns the rotation and the position of a camera object as a matrix of 4 x 4, without its scale."""
    bpy.context.scene.view_layers[0].update()
    matrix = np.array(seen.matrix_world)
    matrix[:3, :3] /= np.linalg.norm(matrix[:3, :3], axis=0)
    return matrix


def link(name, data=None):
    """Makes an object, adds it to the scene and returns it. Without data, it is an empty one."""
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def report(line):
    """Prints a line to the standard output that the script began with."""
    os.write(STANDARD_OUTPUT, f"{line}\n".encode())


def main(description, checks):
    """Runs the checks that the command line selects, and returns the exit status.

    `checks` has pairs of a case's name and a function of the parsed arguments and the folder for files. The function
    returns whether all is as it must be. Several checks may have one name.
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kdray", type=Path, help="the command to test")
    parser.add_argument("--keep", type=Path, help="folder in which the files and pictures stay")
    parser.add_argument("--cpu", action="store_true", help="cast and render by kdray without Vulkan")
    parser.add_argument("--only", help="names of cases, separated by commas")
    arguments = parser.parse_args()
    arguments.kdray = arguments.kdray.resolve()
    arguments.options = ["--cpu"] if arguments.cpu else []
    known = {name for name, _ in checks}
    names = set(arguments.only.split(",")) if arguments.only else known
    if names - known:
        parser.error(f"there is no case {', '.join(sorted(names - known))}")
    # Blender prints what it does.
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    with tempfile.TemporaryDirectory() as temporary:
        folder = (arguments.keep or Path(temporary)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        good = [check(arguments, folder) for name, check in checks if name in names]
        os.chdir("/")
    report(f"{sum(good)} of {len(good)} comparisons are as they must be")
    return 0 if all(good) else 1

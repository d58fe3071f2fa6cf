"""Compares kdray's path tracing with Cycles, Blender's path tracer, and with closed forms, feature by feature.

Needs from PyPI, in Python 3.11: bpy==4.5.15, numpy, OpenEXR, pillow. Usage:

    python3 tests/long/cycles_paths.py KDRAY [--keep FOLDER] [--cpu] [--only NAME,NAME]

Each case is a small scene that this script makes in Blender, with all light: any number of reflections, soft shadows,
rough glass. Blender exports its meshes and materials as .glb, and `path_files.py` writes camera, lights and
environment into a scene file of kdray's. With --keep, the files and the pictures stay in FOLDER. NAME.png shows kdray
on the left, the reference in the middle, and on the right where kdray is brighter (red) or darker (blue), with full
colour from 5 % on.

Test. Both programs render several pictures of independent samples. Tiles of 16 x 16 pixels are compared by their means,
with the errors of these means as the pictures show them (Welch's t-test). False alarms have a probability of 1 % for
each case. `worst tile` is the greatest deviation of a tile in units of the one that is an alarm. Then an error of 2 to
5 % is planted into the reference, which must be found: `planted` is the worst tile with that error.

References. Cases with a `closed` form are compared with `path_albedos.py`, which integrates the papers' formulas
numerically: a ball in white surroundings shows its albedo. All others are compared with Cycles. The planted errors are
in `CASES`. Where the models are not the same by definition, a case allows for a relative difference of tiles:

| cases | allowed | reason |
|---|---:|---|
| `coat` | 2 % | glTF and kdray have Schlick's approximation of the coat's reflectance, Cycles has the exact one. Where the view and the normal enclose 55 degrees, the coat's albedo differs by 18 % |
| `metal` | 0.5 % | light that bounces between microfacets is added by approximations of each program's own |
| `metal_albedo` | 0.2 % | kdray's albedos of microfacets are polynomials |

Further differences of the models, and what the cases do about them:

| cases | difference |
|---|---|
| `area` | light passes through lamps in Cycles, and not in kdray. A black card is behind the lamp |
| `spot` | glTF's edge is soft over 0.001 of the cosine, Cycles's is sharp. Cycles gets a cone of the same light |
| `metal` | Cycles spreads the light of further bounces as the first one's, kdray as a Lambertian surface does, so that a ball by daylight differs by some percent. In white surroundings, only the sum counts |
| `thin_glass` | Cycles's material has no thin sheets. The case makes one of Cycles's simple closures, after glTF's formula |
| `glass_albedo`, `glass_inside` | the formula has single scattering, so kdray's material has `single_scattering`. `glass` compares what both programs make of light that bounces between microfacets |
| `glass` | Cycles's formula of absorption has another parameter, which is computed from glTF's |
| `sheen_albedo` | glTF and kdray have the fibres of Estevez and Kulla. Cycles has those of Zeltner, Burley, Chiang (2022) and of Ashikhmin, but not these |
"""

import math
import os
import sys
from dataclasses import dataclass
from functools import partial

# This import has to come first.
import blender
from blender import report

import bpy
import numpy as np

import path_albedos
import path_files
import path_scenes
from in_blender import absorption_of_gltf, encoded, principled, read_exr, render_cycles, write_sheet
from path_albedos import boundary, clear_layer, dielectric, metal, of_ball, of_plane, sheen, sheet
from path_scenes import FROSTED, GOLD, PLASTIC, SIZE
from path_scenes import black_coat, clear_glass, cloth, coated, frosted, gold, in_white, on_floor
from path_scenes import plane_in_white, plastic
from reference.statistics import compare

FALSE_ALARMS = 0.01
N_RUNS = 8
SHOWN = 0.05  # relative difference with full colour in NAME.png


@dataclass
class Case:
    """A scene, its reference, and an error that must be found."""

    build: object
    # Changes Blender's scene after the export, or returns the albedo with an error.
    plant: object
    # Returns the albedo of a ball or a plane in white surroundings, in place of Cycles.
    closed: object = None
    # Cosines at which `closed` is seen.
    view: object = of_ball
    # Changes Blender's scene after the export, where the exported file says something else.
    change: object = None
    # Relative difference of a tile that is not counted.
    allowed: float = 0.0
    # Samples of each of the runs.
    n_samples: int = 32


def lamp():
    return bpy.data.lights[0]


def scale(thing, name, factor):
    """Returns a change that multiplies an attribute of what `thing` returns."""

    def change():
        setattr(thing(), name, factor * getattr(thing(), name))
        # Blender does not notice changes of a lens by itself.
        thing().id_data.update_tag()

    return change


def scale_input(material, name, factor, node="Principled BSDF"):
    """Returns a change that multiplies an input of a material's node."""

    def change():
        socket = bpy.data.materials[material].node_tree.nodes[node].inputs[name]
        value = socket.default_value
        socket.default_value = factor * value if isinstance(value, float) else [factor * part for part in value]

    return change


def turn_environment():
    """Plants an error: the environment is turned by five degrees more."""
    bpy.context.scene.world.node_tree.nodes["Mapping"].inputs["Rotation"].default_value[2] += math.radians(5.0)


def soften_spot():
    """Makes the spot's cone as much narrower as glTF's soft edge, whose cosine varies by 0.001, takes off its light."""
    lamp().spot_size = 2.0 * math.acos(math.cos(lamp().spot_size / 2.0) + 0.001 * 2.0 / 3.0)


def thin_sheet():
    """Replaces the pane's material by what glTF states of a thin sheet: light is reflected as by a mirror, by Schlick's
    formula, and the rest passes straight on, tinted."""
    nodes, links, node = principled(bpy.data.materials["pane"])
    mirror, passing, mix = (nodes.new(f"ShaderNode{kind}") for kind in ("BsdfGlossy", "BsdfTransparent", "MixShader"))
    mirror.inputs["Roughness"].default_value = 0.0
    mirror.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    passing.inputs["Color"].default_value = node.inputs["Base Color"].default_value
    place, dot = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeVectorMath")
    dot.operation = "DOT_PRODUCT"
    links.new(place.outputs["Normal"], dot.inputs[0])
    links.new(place.outputs["Incoming"], dot.inputs[1])

    def computed(operation, *operands):
        """Adds a node of arithmetic and returns its result. Operands are numbers or results."""
        step = nodes.new("ShaderNodeMath")
        step.operation = operation
        for socket, operand in zip(step.inputs, operands):
            if isinstance(operand, float):
                socket.default_value = operand
            else:
                links.new(operand, socket)
        return step.outputs[0]

    cosine = computed("ABSOLUTE", dot.outputs["Value"])
    reflected = computed("MULTIPLY_ADD", computed("POWER", computed("SUBTRACT", 1.0, cosine), 5.0), 0.96, 0.04)
    links.new(reflected, mix.inputs[0])
    links.new(passing.outputs[0], mix.inputs[1])
    links.new(mirror.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], nodes["Material Output"].inputs["Surface"])


def denser_card():
    """Plants an error: the card's opacity is multiplied by 1.03."""
    nodes, links, node = principled(bpy.data.materials["card"])
    scaled = nodes.new("ShaderNodeMath")
    scaled.operation = "MULTIPLY"
    scaled.inputs[1].default_value = 1.03
    links.new(nodes["Image Texture"].outputs["Alpha"], scaled.inputs[0])
    links.new(scaled.outputs[0], node.inputs["Alpha"])


def seen():
    return bpy.context.scene.camera.data


CASES = {
    "area": Case(path_scenes.area, scale(lamp, "energy", 1.02)),
    "sun": Case(path_scenes.sun, scale(lamp, "energy", 1.02)),
    "sky": Case(path_scenes.sky_light, turn_environment),
    "sphere": Case(path_scenes.sphere_light, scale(lamp, "energy", 1.02)),
    "spot": Case(path_scenes.spot, scale(lamp, "spot_size", 1.02), change=soften_spot),
    "textured_lamp": Case(path_scenes.textured_lamp, scale_input("glowing", "Emission Strength", 1.02)),
    "coat": Case(on_floor(coated), scale_input("coated", "Base Color", 1.05), allowed=0.02),
    "plastic": Case(on_floor(plastic), scale_input("plastic", "Base Color", 0.97)),
    "metal": Case(in_white(gold), scale_input("gold", "Base Color", 0.98), allowed=0.005),
    "glass": Case(
        path_scenes.glass,
        scale_input("glass", "Base Color", 0.95),
        change=absorption_of_gltf,
    ),
    "thin_glass": Case(
        path_scenes.thin_glass,
        scale_input("pane", "Color", 0.98, "Transparent BSDF"),
        change=thin_sheet,
    ),
    "coverage": Case(path_scenes.coverage, denser_card),
    "lens": Case(path_scenes.lens, scale(lambda: seen().dof, "aperture_fstop", 0.95)),
    "orthographic": Case(path_scenes.orthographic, scale(seen, "ortho_scale", 1.02)),
    # The planted errors are of the roughness.
    "coat_albedo": Case(in_white(black_coat), partial(clear_layer, 0.8, 0.42), partial(clear_layer, 0.8, 0.4)),
    "sheen_albedo": Case(in_white(cloth), partial(sheen, 0.52), partial(sheen, 0.5)),
    "plastic_albedo": Case(in_white(plastic), partial(dielectric, PLASTIC, 0.52), partial(dielectric, PLASTIC, 0.5)),
    "metal_albedo": Case(in_white(gold), partial(metal, GOLD, 0.82), partial(metal, GOLD, 0.8), allowed=0.002),
    "thin_albedo": Case(plane_in_white(frosted), partial(sheet, FROSTED, 0.52), partial(sheet, FROSTED, 0.5), of_plane),
    "glass_albedo": Case(
        plane_in_white(clear_glass), partial(boundary, 0.42, 1 / 1.5), partial(boundary, 0.4, 1 / 1.5), of_plane
    ),
    "glass_inside": Case(
        plane_in_white(clear_glass, is_front=False), partial(boundary, 0.42, 1.5), partial(boundary, 0.4, 1.5), of_plane
    ),
}


def by_kdray(arguments, path, options, n_samples):
    """Returns the pictures of all runs."""
    pictures = []
    total = N_RUNS * n_samples
    for run in range(N_RUNS):
        out = path.with_name(f"kdray{run}.exr")
        samples = f"{run * n_samples}-{(run + 1) * n_samples}"
        given = ["--samples", samples, "--spp", total, "--pixel-filter", "box", "--quiet", *options, *arguments.options]
        blender.run(arguments.kdray, "render", path, "-o", out, *given)
        pictures.append(read_exr(out))
    return pictures


def by_cycles(stem, n_samples):
    """Returns the pictures of all runs. The names of their files begin with `stem`."""
    cycles = bpy.context.scene.cycles
    cycles.samples = n_samples
    pictures = []
    for run in range(N_RUNS):
        cycles.seed = run
        pictures.append(render_cycles(stem.with_name(f"{stem.name}{run}.exr")))
    return pictures


def show(path, ours, theirs):
    """Writes the pictures and their relative difference side by side."""
    ours, theirs = np.mean(ours, 0), np.mean(theirs, 0)
    relative = np.clip((ours - theirs) / (theirs + 1e-6) / SHOWN, -1.0, 1.0).mean(-1)
    coloured = np.stack([1.0 + np.minimum(relative, 0.0), 1.0 - abs(relative), 1.0 - np.maximum(relative, 0.0)], -1)
    write_sheet(path, np.concatenate([*encoded(ours, theirs), coloured], axis=1), 4)


def check(name, case, arguments, folder):
    """Compares a case, prints its differences, and returns whether they are as they must be."""
    place = folder / name
    place.mkdir(exist_ok=True)
    os.chdir(place)
    path_scenes.reset()
    case.build()
    path, options = path_files.export()
    ours = by_kdray(arguments, path, options, case.n_samples)
    if case.closed:
        albedos = case.closed(), case.plant()
        theirs, planted = ([path_albedos.picture(albedo, SIZE, case.view)] * N_RUNS for albedo in albedos)
    else:
        if case.change:
            case.change()
        theirs = by_cycles(place / "cycles", case.n_samples)
        case.plant()
        planted = by_cycles(place / "planted", case.n_samples)
    show(folder / f"{name}.png", ours, theirs)
    worst, difference, error = compare(ours, theirs, FALSE_ALARMS, case.allowed)
    found, _, _ = compare(ours, planted, FALSE_ALARMS, case.allowed)
    is_right = worst < 1 < found
    report(
        f"{'ok  ' if is_right else 'FAIL'} {name:16} mean {difference:+8.3%}, its error {error:7.3%}, "
        f"worst tile {worst:6.2f}, planted {found:6.2f}"
    )
    return is_right


if __name__ == "__main__":
    sys.exit(blender.main(__doc__, [(name, partial(check, name, case)) for name, case in CASES.items()]))

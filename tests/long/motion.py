"""Compares kdray's animations and motion blur with those of Cycles, Blender's path tracer.

Needs from PyPI, in Python 3.11: bpy==4.5.15, numpy, OpenEXR, pillow. Usage:

    python3 tests/long/motion.py KDRAY [--keep FOLDER] [--cpu] [--only NAME,NAME]

Each case is a small scene that this script animates in Blender, with direct light from a sun or a spot without an area.
Blender exports it as .glb with its animations. With --keep, files, pictures and contact sheets stay in FOLDER.

Times. Both programs render the scene at five times, three of them between two frames, with one sample at each pixel's
centre. Pictures are compared as in `cycles.py`, which describes `mean`, `p95`, `outliers` and the sheets: outliers are
outlines that differ. The bounds are those of its still scenes: of `skin` and `spot_hard` for `skin` and `lamp`, and of
most others for the rest. Then Cycles renders a time that is wrong by a tenth of a frame, which must come out of the
bounds.

Keys. The exporter writes a key for each frame, between which glTF interpolates rotations spherically. In Blender,
things turn about one axis at a constant speed, so that this is exact. The case `spline` is written with the keys that
Blender has: as steps, and as cubic splines, which are exact, too, since the handles are at thirds of the intervals.
Its things do not turn, as the exporter's tangents of rotations are not those of Blender's quaternions.

Blur. `blur_` cases expose a picture, with the shutter open from, around or until its time. They are compared as in
`cycles_paths.py`, by tiles of 16 x 16 pixels of eight pictures with independent samples: a tile above 1 is an alarm,
and a false one in any tile has a probability of 1 %. Then errors are planted in Cycles's scene, which must be found:
`shifted` is a shutter that opens and closes later by a quarter of its length, `next_frame` a picture's time that is
wrong by one frame, and `by_matrices` a wheel whose matrix is interpolated linearly while the shutter is open. Cycles
does not blur lights. For `blur_lamp`, its pictures of 256 moments are added up.
"""

import math
import os
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path

# This import has to come first.
import blender
from blender import link, report

import bpy
import numpy as np

from cycles_paths import FALSE_ALARMS, N_RUNS, by_cycles, by_kdray, show, soften_spot
from in_blender import (
    contact_sheet,
    differences,
    direct_light,
    export_glb,
    light,
    look,
    material,
    mesh,
    read_exr,
    rectangle,
    render_cycles,
    sphere,
    take,
)
from reference.statistics import compare

# Frames a second, and the last frame.
FPS, LAST = 24, 24
# Times at which pictures are compared, and by how much a planted one is wrong, in frames.
TIMES, WRONG_BY = (0.0, 5.3, 12.0, 17.5, 22.85), 0.1
SIZE, SIZE_BLUR = (160, 120), (128, 128)
# Bounds of mean, p95 and outliers: of `cycles.py`'s `skin`, of most other cases there, and of `spot_hard`.
SKIN, STILL, SPOT = (0.001, 0.001, 0.004), (0.001, 0.001, 0.001), (0.012, 0.001, 0.015)
# Samples of each of the pictures of a blurred case.
N_SAMPLES = 32
EYE = (0.0, -7.0, 3.2)


# --- Scenes -------------------------------------------------------------------------------------------------------


def keys(thing, path, *values):
    """Sets keys of a property, spread evenly over all frames."""
    for ix, value in enumerate(values):
        setattr(thing, path, value)
        thing.keyframe_insert(path, frame=LAST * ix / (len(values) - 1))


def turn(thing, axis, *degrees):
    """Sets keys of a rotation about one axis."""
    thing.rotation_mode = "XYZ"
    keys(thing, "rotation_euler", *(tuple(math.radians(angle) * np.eye(3)["xyz".index(axis)]) for angle in degrees))


def curves():
    return [curve for action in bpy.data.actions for curve in action.fcurves]


def interpolate(kind, animated):
    for point in (point for curve in animated for point in curve.keyframe_points):
        point.interpolation = kind


def box(name, parent, centre, size, colour):
    """Adds a box that moves with its parent."""
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    thing = take(material(name, colour), False)
    thing.name, thing.parent, thing.location, thing.scale = name, parent, centre, size
    return thing


def child(name, parent=None, place=(0.0, 0.0, 0.0)):
    thing = link(name)
    thing.parent, thing.location = parent, place
    return thing


def stage():
    """Adds what all scenes have: a floor and a sun."""
    rectangle("floor", (-4, -4, 0), (8, 0, 0), (0, 8, 0), material("floor", (0.6, 0.6, 0.6)))
    light("SUN", 3.0, (-2.0, -3.0, 4.0))


def pendulum():
    """A double pendulum under a carriage that moves, with a bob that turns."""
    carriage = child("carriage")
    keys(carriage, "location", (-1.0, 0.0, 2.1), (1.0, 0.4, 2.1))
    box("beam", carriage, (0.0, 0.0, 0.0), (0.8, 0.3, 0.15), (0.3, 0.5, 0.8))
    arm = child("arm", carriage)
    turn(arm, "y", 60.0, -60.0, 50.0)
    box("rod", arm, (0.0, 0.0, -0.5), (0.08, 0.08, 1.0), (0.8, 0.8, 0.3))
    elbow = child("elbow", arm, (0.0, 0.0, -1.0))
    turn(elbow, "y", -80.0, 70.0, -90.0)
    box("rod2", elbow, (0.0, 0.0, -0.3), (0.06, 0.06, 0.6), (0.3, 0.8, 0.4))
    bob = child("bob", elbow, (0.0, 0.0, -0.6))
    turn(bob, "z", 0.0, 700.0)
    box("weight", bob, (0.0, 0.0, 0.0), (0.5, 0.3, 0.2), (0.9, 0.3, 0.2))


def wheel():
    """A wheel of spokes of different colours that rolls, whose axle is inclined."""
    axle = child("axle")
    axle.rotation_euler = (0.0, 0.0, 0.4)
    keys(axle, "location", (-0.7, 0.0, 1.25), (0.7, 0.0, 1.25))
    hub = child("wheel", axle)
    turn(hub, "y", 0.0, 1400.0)
    bpy.ops.mesh.primitive_torus_add(
        major_radius=1.1, minor_radius=0.09, major_segments=48, minor_segments=8, rotation=(math.pi / 2.0, 0.0, 0.0)
    )
    take(material("rim", (0.2, 0.2, 0.25)), False).parent = hub
    for ix, colour in enumerate([(0.9, 0.2, 0.1), (0.1, 0.8, 0.2), (0.1, 0.2, 0.9), (0.9, 0.9, 0.9), (0.9, 0.8, 0.1)]):
        angle = 2.0 * math.pi * ix / 5.0
        place = (0.6 * math.sin(angle), 0.0, 0.6 * math.cos(angle))
        box(f"spoke{ix}", hub, place, (0.12, 0.1, 0.9), colour).rotation_euler = (0.0, angle, 0.0)


def skin():
    """A cylinder with rings of two colours that two bones bend, whose armature turns."""
    n, rings = 20, np.linspace(0.0, 2.2, 23)
    turns = 2.0 * math.pi * np.arange(n) / n
    points = [(0.4 * math.cos(a), 0.4 * math.sin(a), z) for z in rings.tolist() for a in turns.tolist()]
    corners = [(r * n + i, r * n + (i + 1) % n) for r in range(len(rings) - 1) for i in range(n)]
    faces = [face for a, b in corners for face in ((a, b, b + n), (a, b + n, a + n))]
    tube = mesh("tube", points, faces, material("light", (0.8, 0.7, 0.3)))
    tube.data.materials.append(material("dark", (0.2, 0.3, 0.5)))
    for ix, face in enumerate(tube.data.polygons):
        face.material_index = ix // (4 * n) % 2
    armature = link("armature", bpy.data.armatures.new("armature"))
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    lower, upper = (armature.data.edit_bones.new(name) for name in ("lower", "upper"))
    lower.head, lower.tail, upper.tail = (0.0, 0.0, 0.0), (0.0, 0.0, 1.1), (0.0, 0.0, 2.2)
    upper.parent, upper.use_connect = lower, True
    bpy.ops.object.mode_set(mode="OBJECT")
    groups = [tube.vertex_groups.new(name=name) for name in ("lower", "upper")]
    for ix, point in enumerate(points):
        share = float(np.clip((point[2] - 0.6) / 1.0, 0.0, 1.0))
        for group, weight in zip(groups, (1.0 - share, share)):
            group.add([ix], weight, "REPLACE")
    tube.modifiers.new("armature", "ARMATURE").object = armature
    tube.parent = armature
    turn(armature.pose.bones["lower"], "z", 25.0, -30.0, 20.0)
    turn(armature.pose.bones["upper"], "x", -60.0, 75.0)
    turn(armature, "z", 0.0, 100.0)


def morph():
    """A ball with two morph targets, whose weights rise and fall."""
    ball = sphere(material("ball", (0.8, 0.4, 0.2)), segments=32, smooth=False)
    ball.shape_key_add(name="Basis")
    bent, flat = ball.shape_key_add(name="bent"), ball.shape_key_add(name="flat")
    for bent_point, flat_point in zip(bent.data, flat.data):
        x, y, z = bent_point.co
        bent_point.co = (x * (1.0 + 0.5 * z) + 0.4 * z * z, y * (1.0 - 0.4 * z), 0.9 * z + 0.3 * x * x)
        flat_point.co = (x, y, 0.2 * z)
    keys(bent, "value", 0.0, 1.0, 0.1, 0.9, 0.0)
    keys(flat, "value", 0.9, 0.1, 0.7)


def towers():
    """Adds boxes that stand."""
    for ix, colour in enumerate([(0.9, 0.2, 0.1), (0.1, 0.8, 0.2), (0.1, 0.2, 0.9), (0.9, 0.8, 0.1)]):
        angle = math.pi * ix / 2.0
        box(f"box{ix}", None, (math.cos(angle), math.sin(angle), 0.5 + 0.2 * ix), (0.5, 0.5, 1.0 + 0.4 * ix), colour)


def camera():
    """A camera that rides on a turntable, moves and turns on it."""
    towers()
    table, seen = child("table"), bpy.context.scene.camera
    turn(table, "z", 0.0, 150.0)
    seen.parent = table
    keys(seen, "location", EYE, (0.4, -5.5, 3.6))
    pitch = seen.rotation_euler.x
    keys(seen, "rotation_euler", (pitch, 0.0, 0.0), (pitch - 0.15, 0.0, 0.0))


def lamp():
    """A spot that a turning arm carries, in place of the sun."""
    towers()
    bpy.data.lights.remove(bpy.data.lights["light"])
    light("SPOT", 900.0, (-1.5, -2.5, 4.0), (0.0, 0.0, 0.5), spot_size=1.1, spot_blend=0.0)
    arm = child("arm")
    bpy.data.objects["light"].parent = arm
    turn(arm, "z", -30.0, 150.0, 60.0)


def spline():
    """A box that moves and grows along cubic splines, and a box that jumps."""
    thing = box("box", None, (0.0, 0.0, 1.0), (0.8, 0.5, 0.6), (0.9, 0.3, 0.2))
    keys(thing, "location", (-1.5, 0.0, 0.8), (0.5, 1.0, 1.6), (-0.7, -1.0, 0.9), (1.4, 0.0, 1.2))
    keys(thing, "scale", (1.0, 0.6, 0.7), (0.5, 0.9, 1.2), (1.1, 0.4, 0.5))
    for curve in curves():
        points = curve.keyframe_points
        third = LAST / (len(points) - 1) / 3.0
        slopes = np.gradient([point.co.y for point in points], 3.0 * third)
        for ix, (point, slope) in enumerate(zip(points, slopes)):
            point.handle_left_type = point.handle_right_type = "FREE"
            # A key's speed is not the one that Blender would choose, so that tangents count.
            rise = (1.0 + 0.8 * (ix % 2)) * slope * third
            point.handle_left = (point.co.x - third, point.co.y - rise)
            point.handle_right = (point.co.x + third, point.co.y + rise)
    jumping = box("jumping", None, (0.0, 0.0, 0.0), (0.4, 0.4, 0.4), (0.2, 0.4, 0.9))
    keys(jumping, "location", (-1.0, -1.5, 0.2), (1.0, -1.5, 0.2), (0.0, -2.0, 0.2))
    interpolate("CONSTANT", jumping.animation_data.action.fcurves)


def build(scene, size):
    """Makes a scene, exports it and returns the file. Things move at constant speeds between keys, but for `spline`."""
    direct_light(size)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 0, LAST
    bpy.context.scene.render.fps = FPS
    look(bpy.context.scene.camera, EYE, (0.0, 0.0, 0.9))
    stage()
    scene()
    if scene is not spline:
        interpolate("LINEAR", curves())
    path = Path.cwd() / "scene.glb"
    # Without normals, both programs compute those of the deformed triangles.
    options = {"export_normals": False, "export_morph_normal": False}
    export_glb(path, export_force_sampling=scene is not spline, **options)
    if scene is lamp:
        soften_spot()
    return path


def go_to(frame):
    bpy.context.scene.frame_set(math.floor(frame), subframe=frame % 1.0)


# --- Times --------------------------------------------------------------------------------------------------------


def check_times(scene, bounds, arguments, folder):
    """Compares a scene at all times, prints the differences, and returns whether they are as they must be."""
    name = scene.__name__
    place = folder / name
    place.mkdir(exist_ok=True)
    os.chdir(place)
    path = build(scene, SIZE)
    return all([check_time(path, frame, bounds, arguments, folder) for frame in TIMES])


def check_time(path, frame, bounds, arguments, folder):
    name = f"{path.parent.name}_{frame:05.2f}"
    out = path.with_name(f"kdray_{frame:05.2f}.exr")
    blender.render(arguments, path, out, SIZE, "--at", frame / FPS)
    ours = read_exr(out)
    go_to(frame)
    theirs = render_cycles(path.with_name(f"cycles_{frame:05.2f}.exr"))
    go_to(frame + WRONG_BY)
    planted = render_cycles(path.with_name("planted.exr"))
    mean, p95, outliers, relative, _ = differences(ours, theirs, 1e-3)
    contact_sheet(folder / f"{name}.png", ours, theirs, relative)
    found = differences(ours, planted, 1e-3)[:3]
    good = is_within((mean, p95, outliers), bounds) and not is_within(found, bounds)
    report(
        f"{'ok  ' if good else 'FAIL'} {name:16} mean {mean:+8.4%} (bound {bounds[0]:.1%}), p95 {p95:8.4%} "
        f"({bounds[1]:.1%}), outliers {outliers:8.4%} ({bounds[2]:.1%}); "
        f"planted {found[0]:+.3%}, {found[1]:.3%}, {found[2]:.3%}"
    )
    return good


def is_within(measured, bounds):
    return all(abs(value) <= bound for value, bound in zip(measured, bounds))


# --- Blur ---------------------------------------------------------------------------------------------------------


@dataclass
class Blur:
    """A scene whose picture is exposed: the frame, from when to when in frames, and errors that must be found."""

    scene: object
    frame: float
    position: str
    shutter: tuple
    planted: tuple


def shifted(blur):
    """Plants an error: the shutter opens and closes later by a quarter of its length."""
    go_to(blur.frame + 0.25 * (blur.shutter[1] - blur.shutter[0]))


def next_frame(blur):
    """Plants an error: the picture is of the next frame."""
    go_to(blur.frame + 1.0)


def by_matrices(blur):
    """Plants an error: the wheel's matrix is interpolated linearly from the shutter's opening to its closing."""
    hub = bpy.data.objects["wheel"]
    moments = [blur.frame + moment for moment in blur.shutter]
    angles = []
    for moment in moments:
        go_to(moment)
        angles.append(hub.rotation_euler.y)
    hub.animation_data_clear()
    for share in np.linspace(0.0, 1.0, 33):
        # In the wheel's plane, a mean of two rotations is a rotation with a scale: a complex number.
        mixed = (1.0 - share) + share * np.exp(1j * (angles[1] - angles[0]))
        hub.rotation_euler.y, hub.scale = angles[0] + np.angle(mixed), (abs(mixed), 1.0, abs(mixed))
        for path in ("rotation_euler", "scale"):
            hub.keyframe_insert(path, frame=moments[0] + share * (moments[1] - moments[0]))
    go_to(blur.frame)


BLURS = {
    "blur_pendulum": Blur(pendulum, 8.0, "CENTER", (-0.5, 0.5), (shifted, next_frame)),
    "blur_wheel": Blur(wheel, 10.0, "START", (0.0, 0.9), (shifted, next_frame, by_matrices)),
    "blur_camera": Blur(camera, 15.0, "END", (-0.6, 0.0), (shifted, next_frame)),
    "blur_lamp": Blur(lamp, 7.0, "END", (-1.5, 0.0), (shifted, next_frame)),
    "blur_morph": Blur(morph, 18.2, "START", (0.0, 2.0), (shifted, next_frame)),
    "blur_skin": Blur(skin, 6.3, "CENTER", (-0.75, 0.75), (shifted, next_frame)),
}


def expose(blur):
    """Sets up Cycles for a blurred picture whose samples are spread evenly over each pixel."""
    scene = bpy.context.scene
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 1.0
    scene.render.use_motion_blur, scene.render.motion_blur_position = True, blur.position
    scene.render.motion_blur_shutter = blur.shutter[1] - blur.shutter[0]
    for thing in bpy.data.objects:
        # 33 moments, between which Cycles interpolates: rotations spherically, corners of deformed meshes linearly.
        thing.cycles.motion_steps = 6
    go_to(blur.frame)


def by_moments(blur, stem, n_moments):
    """Returns pictures as `by_cycles` does, each the mean of unblurred ones: Cycles does not blur lights that move."""
    scene = bpy.context.scene
    now = scene.frame_float
    scene.render.use_motion_blur, scene.cycles.samples = False, 8
    pictures = []
    for run in range(N_RUNS):
        shown = []
        for ix in range(n_moments):
            share = (ix + (run + 0.5) / N_RUNS) / n_moments
            scene.cycles.seed = n_moments * run + ix
            go_to(now + blur.shutter[0] + share * (blur.shutter[1] - blur.shutter[0]))
            shown.append(render_cycles(stem.with_suffix(".exr")))
        pictures.append(np.mean(shown, 0))
    return pictures


def check_blur(name, blur, arguments, folder):
    """Compares a blurred picture, prints its differences, and returns whether they are as they must be."""
    place = folder / name
    place.mkdir(exist_ok=True)
    os.chdir(place)
    path = build(blur.scene, SIZE_BLUR)
    size, shutter = "{}x{}".format(*SIZE_BLUR), "--shutter={},{}".format(*blur.shutter)
    options = ["--integrator", "path", "--max-depth", 1, "--denoise", "off", "--size", size, shutter]
    ours = by_kdray(arguments, path, [*options, "--at", blur.frame / FPS, "--fps", FPS], N_SAMPLES)
    expose(blur)
    render = partial(by_moments, blur) if blur.scene is lamp else by_cycles
    theirs = render(place / "cycles", N_SAMPLES)
    show(folder / f"{name}.png", ours, theirs)
    worst, difference, error = compare(ours, theirs, FALSE_ALARMS)
    found = {}
    for plant in blur.planted:
        plant(blur)
        planted = render(place / plant.__name__, N_SAMPLES)
        show(folder / f"{name}.{plant.__name__}.png", ours, planted)
        found[plant.__name__] = compare(ours, planted, FALSE_ALARMS)[0]
    good = worst < 1 < min(found.values())
    report(
        f"{'ok  ' if good else 'FAIL'} {name:16} mean {difference:+8.3%}, its error {error:7.3%}, "
        f"worst tile {worst:6.2f}, planted {', '.join(f'{plant} {tile:.1f}' for plant, tile in found.items())}"
    )
    return good


if __name__ == "__main__":
    STILLS = {scene: STILL for scene in (pendulum, wheel, morph, camera, spline)} | {skin: SKIN, lamp: SPOT}
    CHECKS = [(scene.__name__, partial(check_times, scene, bounds)) for scene, bounds in STILLS.items()]
    CHECKS += [(name, partial(check_blur, name, blur)) for name, blur in BLURS.items()]
    sys.exit(blender.main(__doc__, CHECKS))

"""What the scripts with Cycles share: scenes that a script makes in Blender, and pictures of Cycles.

Either this module or `blender.py` has to be imported before `bpy`.
"""

import math
from pathlib import Path

from blender import YUP, link, triangulate

import bpy
import numpy as np
import OpenEXR

# This module exists once `bpy` has been imported.
from mathutils import Vector

# Relative difference of a pixel from which on it is an outlier.
OUTLIER = 0.1


# --- Scenes -------------------------------------------------------------------------------------------------------


def empty(size):
    """Empties Blender, and sets Cycles up to write linear radiance without any bias. Returns Cycles's settings."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.film_transparent = False
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.image_settings.color_depth = "32"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.light_sampling_threshold = 0.0
    cycles.sample_clamp_direct = 0.0
    cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0
    return cycles


def look(thing, eye, target):
    """Puts an object at `eye` and turns its -z axis towards `target`."""
    thing.location = eye
    thing.rotation_euler = (Vector(target) - Vector(eye)).to_track_quat("-Z", "Y").to_euler()


def add(name, data):
    """Adds an object to the scene."""
    return without_offsets(link(name, data))


def without_offsets(thing):
    """Returns an object after it has told Cycles not to move the origins of shadow rays away from smooth surfaces."""
    thing.cycles.shadow_terminator_geometry_offset = 0.0
    thing.cycles.shadow_terminator_offset = 0.0
    return thing


def camera(eye, target, degrees=40.0):
    """Sets the scene's camera; `degrees` is its horizontal field of view."""
    data = bpy.data.cameras.new("camera")
    data.angle = math.radians(degrees)
    thing = add("camera", data)
    look(thing, eye, target)
    bpy.context.scene.camera = thing


def direct_light(size):
    """Empties Blender, sets Cycles up for direct light, one sample at each pixel's centre, and adds a camera."""
    cycles = empty(size)
    cycles.samples = 1
    cycles.max_bounces = 0
    cycles.transparent_max_bounces = 16
    # A filter of almost no width: all samples are at the pixel's centre.
    cycles.pixel_filter_type = "GAUSSIAN"
    cycles.filter_width = 0.01
    camera((0.0, -6.0, 3.0), (0.0, 0.0, 0.6))


def light(kind, power, eye, target=(0.0, 0.0, 0.0), colour=(1.0, 1.0, 1.0), **values):
    """Adds a light of radius 0. `power`: watts, or of a sun watts per square metre."""
    data = bpy.data.lights.new("light", kind)
    data.energy, data.color = power, colour
    if kind == "SUN":
        data.angle = 0.0
    else:
        data.shadow_soft_size = 0.0
    for key, value in values.items():
        setattr(data, key, value)
    look(add("light", data), eye, target)


def material(name, colour=(0.8, 0.8, 0.8), specular=0.0, **values):
    """Makes a material of the Principled BSDF without multiple scattering. `specular`: 0.5 for a dielectric as it is.

    Further values are inputs of the node, with underscores for the spaces of their names. Returns the material.
    """
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    made.cycles.emission_sampling = "NONE"
    node = made.node_tree.nodes["Principled BSDF"]
    node.distribution = "GGX"
    node.inputs["Base Color"].default_value = (*colour, 1.0)
    node.inputs["Roughness"].default_value = 1.0
    node.inputs["Specular IOR Level"].default_value = specular
    for key, value in values.items():
        node.inputs[key.replace("_", " ")].default_value = value
    return made


def principled(made):
    """Returns the nodes, the links and the Principled BSDF of a material."""
    tree = made.node_tree
    return tree.nodes, tree.links, tree.nodes["Principled BSDF"]


def mesh(name, points, faces, made, uvs=None):
    """Adds a mesh of polygons. `uvs`: one for each point."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(points, [], faces)
    if uvs is not None:
        layer = data.uv_layers.new(name="UVMap")
        for loop in data.loops:
            layer.data[loop.index].uv = uvs[loop.vertex_index]
    data.materials.append(made)
    return add(name, data)


def rectangle(name, origin, along, up, made, inset=0.0):
    """Adds a parallelogram with texture coordinates from (0, 0) at `origin` to (1, 1), less `inset` at each side."""
    o, a, u = np.array(origin), np.array(along), np.array(up)
    points = [tuple(map(float, p)) for p in (o, o + a, o + a + u, o + u)]
    a, b = inset, 1.0 - inset
    return mesh(name, points, [(0, 1, 2, 3)], made, [(a, a), (b, a), (b, b), (a, b)])


def take(made, smooth):
    """Takes the object that an operator has just made: gives it a material and smooth or flat faces.

    Faces become triangles, since the exporter gives a flat, bent quadrangle one normal, and Cycles two.
    """
    thing = bpy.context.object
    triangulate(thing.data)
    for polygon in thing.data.polygons:
        polygon.use_smooth = smooth
    thing.data.materials.append(made)
    return without_offsets(thing)


def sphere(made, centre=(0.0, 0.0, 1.0), radius=1.0, segments=64, smooth=True):
    """Adds a sphere of `segments` by half as many faces."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=segments, ring_count=segments // 2, radius=radius, location=centre)
    return take(made, smooth)


def image(name, pixels, linear=False):
    """Saves an array of rows from the top, of RGBA from 0 to 1, as a PNG in the working directory, and loads it."""
    height, width = pixels.shape[:2]
    made = bpy.data.images.new(name, width, height, alpha=True)
    made.colorspace_settings.name = "Non-Color" if linear else "sRGB"
    made.pixels.foreach_set(np.ascontiguousarray(pixels[::-1], dtype=np.float32).ravel())
    made.filepath_raw, made.file_format = str(Path.cwd() / name), "PNG"
    made.save()
    loaded = bpy.data.images.load(str(Path.cwd() / name))
    loaded.colorspace_settings.name = "Non-Color" if linear else "sRGB"
    # Colours would otherwise be multiplied by opacity, and rounded.
    loaded.alpha_mode = "CHANNEL_PACKED"
    return loaded


def texture(made, loaded, filtering="Linear", extension="REPEAT"):
    """Adds a node that shows an image to a material, and returns it."""
    nodes, _, _ = principled(made)
    node = nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation, node.extension = loaded, filtering, extension
    return node


def letters():
    """Returns an image of 8 by 8 pixels without any symmetry: an F, and corners of different colours."""
    rows = ["#......g", "..####..", "..#.....", "..###...", "..#.....", "..#.....", "..#.....", "b......w"]
    colours = {".": (0.35, 0.30, 0.25), "#": (0.9, 0.2, 0.1), "w": (1.0, 1.0, 1.0)}
    colours |= {"g": (0.1, 0.8, 0.2), "b": (0.1, 0.2, 0.9)}
    return np.array([[(*colours[c], 1.0) for c in row] for row in rows])


def gradient(n=64):
    """Returns an image whose red grows to the right, whose green grows downwards, and whose blue is 0.5."""
    y, x = np.mgrid[0:n, 0:n] / (n - 1)
    return np.stack([0.15 + 0.8 * x, 0.15 + 0.8 * y, np.full_like(x, 0.5), np.ones_like(x)], axis=-1)


def gltf_output():
    """Makes the group of nodes that tells the exporter of glTF what Blender's own nodes do not have."""
    group = bpy.data.node_groups.new("glTF Material Output", "ShaderNodeTree")
    for name in ("Occlusion", "Thickness"):
        group.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketFloat")
    return group


def absorbing_glass(ior, roughness):
    """Makes a material "glass" of a tinted solid, which the exporter writes with its absorption."""
    made = material("glass", (0.9, 0.8, 0.95), Roughness=roughness, IOR=ior, Transmission_Weight=1.0)
    nodes, links, _ = principled(made)
    group, volume = nodes.new("ShaderNodeGroup"), nodes.new("ShaderNodeVolumeAbsorption")
    group.node_tree = gltf_output()
    group.inputs["Thickness"].default_value = 1.0
    volume.inputs["Color"].default_value = (0.3, 0.8, 0.5, 1.0)
    volume.inputs["Density"].default_value = 0.6
    links.new(volume.outputs["Volume"], nodes["Material Output"].inputs["Volume"])
    return made


def absorption_of_gltf():
    """Gives the volume in Cycles the absorption that glTF's formula states: exp(-s t) = colour^(t / distance).

    Cycles's own s is density * (1 - colour).
    """
    volume = principled(bpy.data.materials["glass"])[0]["Volume Absorption"]
    colour, density = volume.inputs["Color"], volume.inputs["Density"]
    absorbed = -np.log(np.array(colour.default_value)[:3]) * density.default_value
    density.default_value = absorbed.max()
    colour.default_value = (*(1.0 - absorbed / absorbed.max()), 1.0)
    return 1.0


def export_glb(path, **options):
    """Exports Blender's scene with its camera and its lights, whose watts stay."""
    bpy.ops.export_scene.gltf(
        filepath=str(path),
        export_format="GLB",
        export_cameras=True,
        export_lights=True,
        export_import_convert_lighting_mode="COMPAT",
        **options,
    )


# --- Pictures -----------------------------------------------------------------------------------------------------


def read_exr(path):
    """Reads the colours of an EXR file, of any names of their layer, as an array of height, width, 3."""
    channels = OpenEXR.File(str(path)).channels()
    for name in ("RGB", "RGBA", "Combined", "ViewLayer.Combined"):
        if name in channels:
            return np.asarray(channels[name].pixels, dtype=np.float64)[..., :3]
    return np.stack([np.asarray(channels[c].pixels, dtype=np.float64) for c in "RGB"], axis=-1)


def render_cycles(path):
    """Renders Blender's scene by Cycles into an EXR file and returns its colours."""
    bpy.context.scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return read_exr(path)


def yup(vector):
    """Returns a vector of Blender's in the axes of the exported files, as a list."""
    return (YUP @ np.array(vector)).tolist()


def encoded(*pictures):
    """Returns pictures as a display shows them, with one white for all."""
    white = np.percentile(np.maximum.reduce(pictures), 99.5) or 1.0
    return [np.clip(picture / white, 0.0, 1.0) ** (1.0 / 2.2) for picture in pictures]


def write_sheet(path, shown, scale=2):
    """Writes a picture of values from 0 to 1 as a PNG, enlarged by the integer `scale`."""
    sheet = shown.repeat(scale, axis=0).repeat(scale, axis=1)
    pixels = np.concatenate([sheet, np.ones((*sheet.shape[:2], 1))], axis=-1)
    made = bpy.data.images.new("sheet", sheet.shape[1], sheet.shape[0])
    made.pixels.foreach_set(np.ascontiguousarray(pixels[::-1], dtype=np.float32).ravel())
    made.filepath_raw, made.file_format = str(path), "PNG"
    made.save()
    bpy.data.images.remove(made)


def differences(ours, theirs, share):
    """Compares the pixels that exceed `share` of the greatest radiance.

    Returns the relative difference of means (positive if ours is greater), p95, the share of outliers, the relative
    differences of all pixels, and which pixels are compared.
    """
    least = share * max(ours.max(), theirs.max())
    lit = np.maximum(ours, theirs).max(axis=-1) > least
    greater = np.maximum(np.maximum(ours, theirs), least)
    relative = (np.abs(ours - theirs) / greater).max(axis=-1)
    mean = ours[lit].mean() / theirs[lit].mean() - 1.0 if lit.any() and theirs[lit].any() else math.inf
    if not lit.any():
        return math.inf, math.inf, 1.0, relative, lit
    return mean, np.percentile(relative[lit], 95), (relative[lit] > OUTLIER).mean(), relative, lit


def contact_sheet(path, ours, theirs, relative):
    """Writes both pictures and their relative difference side by side."""
    difference = np.repeat(np.clip(relative / 0.2, 0.0, 1.0)[..., None], 3, axis=-1)
    write_sheet(path, np.concatenate([*encoded(ours, theirs), difference], axis=1))

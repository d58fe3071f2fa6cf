"""Compares kdray's pictures with those of Cycles, Blender's path tracer, feature by feature.

Needs from PyPI, in Python 3.11: bpy==4.5.15, numpy, OpenEXR. Usage:

    python3 tests/long/cycles.py KDRAY [--keep FOLDER] [--cpu] [--only NAME,NAME]

Each case is a small scene that this script makes in Blender: objects, one light of radius 0, a camera. Blender exports
it as .glb or .obj and renders it by Cycles with direct light alone: rays bounce off nothing but glass. kdray renders
the exported file. Both take their samples at the pixels' centres, so that pictures are compared pixel by pixel, edges
included. With --keep, the files, the pictures and contact sheets stay in FOLDER. A sheet, NAME.png, shows kdray on the
left, Cycles in the middle, and their relative difference on the right, white from 20 % on.

Units. No factor is fitted. The exporter's lighting mode `COMPAT` keeps watts: a point light or spot of P watts gets the
intensity P / (4 pi) W/sr, and a sun of S W/m^2 the illuminance S. kdray divides both by pi and has no 1/pi in its
reflectances, so that a Lambertian surface of reflectance c under the irradiance E shows c E / pi in both programs.

Bounds. Compared are the pixels in which either picture exceeds a thousandth of the greater picture's maximum (or
`least` of the case), in all three channels together. `mean` is the relative difference of the means, `p95` the 95th
percentile of the relative difference of pixels (the absolute difference, divided by the greater value), `outliers` the
share of pixels that differ by more than 10 %. A case that comes out of its bounds, which are in `CASES`, fails. After
the cases, errors are planted in Cycles's scene, such as an image upside down; these must come out of the bounds. Bounds
above a tenth of a percent, and changes of Cycles's scene after the export, have these reasons:

| cases | known difference |
|---|---|
| `highlight`, `dielectric`, `half_metal`, `obj_pbr` | glTF and kdray have Schlick's approximation of a dielectric's reflectance, and Cycles the exact one, which is 0.7 % higher where light and view enclose 40 degrees, and 4 % where they enclose 60 |
| `dielectric`, `half_metal`, `obj_pbr` | diffuse light is weakened by the reflectance at the half vector in glTF, and in Cycles by all that the highlight reflects towards the viewer, which grows at grazing views: 40 % at the rim of a smooth sphere |
| `spot_hard` | glTF's formula, as its specification recommends, has an edge of at least 0.001 in the cosine. Cycles's edge is sharp |
| `spot_soft` | none: as the formulas differ, Cycles renders a point light, and this script multiplies its picture by glTF's formula |
| `texture_wrapped` | kdray shows smaller levels of an image where the surface is seen at a grazing angle, Cycles has no levels |
| `texture_linear`, `obj_phong`, `obj_pbr`, `obj_transform` | Cycles blends the encoded values of neighbouring pixels, kdray the decoded ones. The images are gradients, in which this is little |
| `normal_map` | both weaken light on bent normals after Estevez et al. (2019). Near the horizon of the unbent surface (`normal_map_side`), where the light is weak, their pixels differ by more than a percent |
| `vertex_colours`, `vertex_colours_texture` | kdray rounds colours of corners to 8 bits of sRGB |
| `smooth_heads`, `skin`, `obj_phong`, `obj_pbr` | both move the origins of shadow rays up to the curved surface that the normals suggest, where the light is near the horizon of the triangle's plane, but fade this out by formulas of their own |
| `many_lights` | Cycles selects one light for each sample, so that its picture has noise |
| `occlusion` | Cycles ignores occlusion textures, and its ambient light would be dimmed by what hides it. The card emits there what glTF's formula states |
| `transmission_thin` | glTF's surface without thickness is a sheet that does not bend rays, Cycles's a single boundary that bends them and takes the square root of the colour. Cycles therefore gets the index 1 and the square of the colour, and this script multiplies its picture by what Schlick's formula leaves |
| `transmission_texture` | Cycles selects by chance whether light is transmitted. At the borders of the image's pixels, rounding selects the pixel |
| `glass_absorbing`, `glass_refracting` | Cycles's formula of absorption has another parameter, which this script computes from glTF's. With the index 1, light is only absorbed |
| `glass_refracting` | Cycles selects by chance whether light is reflected or refracted, so that its picture has noise. Both programs follow rays over four bounces, but kdray leaves out those of which less than 1/1024 reaches the camera |
| `normal_map_turned` | none: the file has tangents, as Cycles takes them along coordinates that are not transformed |
| `alpha_blend` | Cycles selects by chance what a see-through surface shows. kdray's shadows of such surfaces are full or none, so that they are not compared |
"""

import math
import os
import sys
from dataclasses import dataclass
from functools import partial

# This import has to come first.
import blender
from blender import camera_matrix, link, report

import bpy
import numpy as np

from in_blender import (
    absorbing_glass,
    absorption_of_gltf,
    camera,
    contact_sheet,
    differences,
    direct_light,
    export_glb,
    gltf_output,
    gradient,
    image,
    letters,
    light,
    material,
    principled,
    read_exr,
    rectangle,
    render_cycles,
    sphere,
    take,
    texture,
    yup,
)

# This module exists once `bpy` has been imported.
from mathutils import Vector

SIZE = (160, 120)
# Ambient light of the case `occlusion`.
AMBIENT = np.array([0.5, 0.7, 0.9])
# Places of lights: beside the camera, and where most lights are.
FRONT, SIDE = (-0.6, -6.0, 4.0), (-2.5, -3.0, 5.0)


# --- Scenes -------------------------------------------------------------------------------------------------------


def point_light():
    """Adds the light of most cases."""
    light("POINT", 600.0, SIDE, colour=(1.0, 0.9, 0.7))


def floor(made=None):
    """Adds a square of 8 by 8 in the plane z = 0."""
    return rectangle("floor", (-4, -4, 0), (8, 0, 0), (0, 8, 0), made or material("floor", (0.6, 0.6, 0.6)))


def monkey(made, centre=(0.0, 0.0, 1.0), scale=(1.0, 1.0, 1.0), smooth=False):
    """Adds Blender's head of a monkey."""
    bpy.ops.mesh.primitive_monkey_add(location=centre)
    bpy.context.object.scale = scale
    return take(made, smooth)


def waves(n=64):
    """Returns an image that repeats without a seam, of one wave of red along x and two of green along y."""
    y, x = np.mgrid[0:n, 0:n] / n
    red, green = 0.6 + 0.25 * np.sin(2 * np.pi * x), 0.6 + 0.25 * np.sin(4 * np.pi * y + 0.5)
    return np.stack([red, green, np.full_like(x, 0.5), np.ones_like(x)], axis=-1)


def slopes(strength, n=64):
    """Returns a normal map: waves along x in the upper half, along y in the lower half, a tilt at the right."""
    y, x = np.mgrid[0:n, 0:n] / n
    dx = np.where(y < 0.5, 0.6 * np.sin(6 * np.pi * x), 0.0) + np.where(x > 0.75, 0.4, 0.0)
    dy = np.where(y >= 0.5, 0.6 * np.sin(6 * np.pi * y), 0.0) - np.where(x > 0.75, 0.2, 0.0)
    normal = np.stack([strength * dx, strength * dy, np.ones_like(dx)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.concatenate([normal * 0.5 + 0.5, np.ones((n, n, 1))], axis=-1)


def diffuse():
    """A diffuse sphere on a diffuse floor, by a point light."""
    floor()
    sphere(material("diffuse", (0.8, 0.4, 0.2)))
    point_light()


def sun():
    """The same by a sun that is not overhead."""
    floor()
    monkey(material("diffuse", (0.8, 0.4, 0.2)))
    light("SUN", 3.0, (-2.0, -3.0, 4.0), colour=(1.0, 0.8, 0.6))


def spot_hard():
    """A spot with a sharp edge, aimed beside the middle."""
    floor()
    sphere(material("diffuse", (0.8, 0.4, 0.2)))
    light("SPOT", 900.0, (-2.5, -2.0, 5.0), (0.3, 0.4, 0.2), spot_size=math.radians(40), spot_blend=0.0)


def spot_soft():
    """A spot with a soft edge."""
    floor()
    light("SPOT", 900.0, (-2.5, -2.0, 5.0), (0.3, 0.4, 0.2), spot_size=math.radians(40), spot_blend=0.4)


def pixel_rays():
    """Returns the position of the scene's camera, and the directions of the rays through the pixels' centres."""
    seen = bpy.context.scene.camera
    matrix, half = camera_matrix(seen), math.tan(seen.data.angle / 2.0)
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]] + 0.5
    aside, up = (2.0 * x / SIZE[0] - 1.0) * half, (1.0 - 2.0 * y / SIZE[1]) * half * SIZE[1] / SIZE[0]
    return matrix[:3, 3], np.stack([aside, up, -np.ones_like(x)], axis=-1) @ matrix[:3, :3].T


def gltf_spot():
    """Makes the spot a point light, and returns what glTF's formula makes of its light on the floor, for each pixel."""
    eye, rays = pixel_rays()
    lamp = next(thing for thing in bpy.data.objects if thing.type == "LIGHT")
    outer = lamp.data.spot_size / 2.0
    inner = outer * (1.0 - lamp.data.spot_blend)
    lamp.data.type = "POINT"
    bpy.data.lights[0].shadow_soft_size = 0.0
    points = eye - rays * (eye[2] / rays[..., 2:])
    towards = points - np.array(lamp.location)
    axis = np.array(lamp.matrix_world.to_3x3() @ Vector((0.0, 0.0, -1.0)))
    cosine = towards @ axis / np.linalg.norm(towards, axis=-1)
    share = (cosine - math.cos(outer)) / (math.cos(inner) - math.cos(outer))
    return np.clip(share, 0.0, 1.0)[..., None] ** 2


def metal(roughness):
    """Returns a case of a coloured metal."""

    def build():
        sphere(material("metal", (0.9, 0.6, 0.3), Metallic=1.0, Roughness=roughness, specular=0.5))
        light("POINT", 600.0, (-2.5, -4.0, 5.0))

    return build


def orthographic(build):
    """Another case's scene, as an orthographic camera shows it. `ortho_scale` is the picture's width."""

    def seen_in_parallel():
        build()
        seen = bpy.context.scene.camera.data
        seen.type, seen.ortho_scale = "ORTHO", 4.4

    return seen_in_parallel


def dielectric(roughness, colour=(0.0, 0.0, 0.0)):
    """Returns a case of a dielectric; a black one shows its highlight alone."""

    def build():
        sphere(material("dielectric", colour, Roughness=roughness, specular=0.5))
        light("POINT", 600.0, (-2.5, -4.0, 5.0))

    return build


def half_metal():
    """A sphere that is metal by 40 %."""
    sphere(material("mixed", (0.9, 0.6, 0.3), Metallic=0.4, Roughness=0.5, specular=0.5))
    light("POINT", 600.0, (-2.5, -4.0, 5.0))


def card(made):
    """Adds an upright rectangle that faces the camera and its light."""
    thing = rectangle("card", (-1.6, 0.0, -0.6), (3.2, 0, 0), (0, 0.8, 2.3), made)
    light("POINT", 600.0, (-1.5, -4.0, 4.0))
    return thing


def base_texture(pixels, filtering, extension):
    """Returns a case of a texture of the base colour."""

    def build():
        made = material("textured")
        _, links, node = principled(made)
        shown = texture(made, image("base.png", pixels()), filtering, extension)
        links.new(shown.outputs["Color"], node.inputs["Base Color"])
        card(made)

    return build


def map_coordinates(made, shown, location, scale, degrees=0.0):
    """Adds nodes that scale, turn and move the coordinates of a texture's node, in this order."""
    nodes, links, _ = principled(made)
    mapping, coordinates = nodes.new("ShaderNodeMapping"), nodes.new("ShaderNodeTexCoord")
    mapping.inputs["Location"].default_value = (*location, 0.0)
    mapping.inputs["Rotation"].default_value = (0.0, 0.0, math.radians(degrees))
    mapping.inputs["Scale"].default_value = (*scale, 1.0)
    links.new(coordinates.outputs["UV"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], shown.inputs["Vector"])


def wrapped_texture():
    """A texture on a sphere, moved, scaled and turned by a mapping node."""
    made = material("textured")
    _, links, node = principled(made)
    shown = texture(made, image("base.png", letters()), "Closest")
    map_coordinates(made, shown, (0.15, 0.3), (3.0, 2.0), 25.0)
    links.new(shown.outputs["Color"], node.inputs["Base Color"])
    sphere(made)
    point_light()


def texture_outside(extension):
    """Returns a case of a card whose coordinates go beyond the image at all sides, where it continues in this way."""

    def build():
        made = material("textured")
        _, links, node = principled(made)
        shown = texture(made, image("base.png", letters()), "Closest", extension)
        map_coordinates(made, shown, (-0.7, -0.4), (2.3, 1.9))
        links.new(shown.outputs["Color"], node.inputs["Base Color"])
        card(made)

    return build


def unlit():
    """A card that shows its image whatever the light is."""
    made = material("textured")
    nodes, links, _ = principled(made)
    shown = texture(made, image("base.png", letters()), "Closest")
    links.new(shown.outputs["Color"], nodes["Material Output"].inputs["Surface"])
    card(made)


def emission_texture():
    """A card that emits by a texture more than its factor can say, and reflects light."""
    made = material("glowing", (0.3, 0.3, 0.3), Emission_Strength=1.5)
    _, links, node = principled(made)
    shown = texture(made, image("emission.png", letters()), "Closest")
    links.new(shown.outputs["Color"], node.inputs["Emission Color"])
    card(made)


def use_second_uvs(made, shown):
    """Adds a node by which a texture's node uses the second set of coordinates."""
    nodes, links, _ = principled(made)
    coordinates = nodes.new("ShaderNodeUVMap")
    coordinates.uv_map = "second"
    links.new(coordinates.outputs["UV"], shown.inputs["Vector"])


def add_second_uvs(data):
    """Adds a second set of coordinates to a mesh, in which an image is turned by a quarter and enlarged."""
    data.uv_layers.new(name="second")
    first, second = data.uv_layers
    for corner, turned in zip(first.data, second.data):
        turned.uv = (0.1 + 0.7 * corner.uv[1], 0.9 - 0.7 * corner.uv[0])
    data.uv_layers.active = first


def second_uvs():
    """A texture that uses the second set of coordinates."""
    made = material("textured")
    _, links, node = principled(made)
    shown = texture(made, image("base.png", letters()), "Closest")
    use_second_uvs(made, shown)
    links.new(shown.outputs["Color"], node.inputs["Base Color"])
    add_second_uvs(card(made).data)


def occlusion():
    """An occlusion texture of strength 0.7 on a card that has ambient light, and light of a sun, which it must not dim.

    Cycles has no such term. `ambient_emission` shows the card's ambient light by the formula.
    """
    made = material("dusty", (0.8, 0.5, 0.3))
    nodes, links, _ = principled(made)
    split, mix, group = (nodes.new(f"ShaderNode{kind}") for kind in ("SeparateColor", "Mix", "Group"))
    shown = texture(made, image("occlusion.png", letters(), True), "Closest")
    links.new(shown.outputs["Color"], split.inputs["Color"])
    mix.data_type = "RGBA"
    mix.inputs["Factor"].default_value = 0.7
    mix.inputs["A"].default_value = (1.0, 1.0, 1.0, 1.0)
    links.new(split.outputs["Red"], mix.inputs["B"])
    group.node_tree = gltf_output()
    links.new(mix.outputs["Result"], group.inputs["Occlusion"])
    rectangle("card", (-1.6, 0.0, -0.6), (3.2, 0, 0), (0, 0.8, 2.3), made)
    light("SUN", 1.0, (-2.0, -3.0, 4.0))


def ambient_emission():
    """Makes the card emit its colour times the ambient light times 1 + strength * (occlusion - 1)."""
    made = bpy.data.materials["dusty"]
    nodes, links, node = principled(made)
    seen = nodes.new("ShaderNodeMix")
    seen.data_type, seen.blend_type = "RGBA", "MULTIPLY"
    seen.inputs["Factor"].default_value = 1.0
    links.new(nodes["Mix"].outputs["Result"], seen.inputs["A"])
    colour = np.array(node.inputs["Base Color"].default_value)
    seen.inputs["B"].default_value = (*(colour[:3] * AMBIENT).tolist(), 1.0)
    links.new(seen.outputs["Result"], node.inputs["Emission Color"])
    node.inputs["Emission Strength"].default_value = 1.0
    return 1.0


def normal_map(place, strength):
    """Returns a case of a normal map on what `place` adds."""

    def build():
        made = material("bumpy", (0.7, 0.7, 0.7))
        nodes, links, node = principled(made)
        mapped = nodes.new("ShaderNodeNormalMap")
        links.new(texture(made, image("normal.png", slopes(strength), True)).outputs["Color"], mapped.inputs["Color"])
        links.new(mapped.outputs["Normal"], node.inputs["Normal"])
        place(made)

    return build


def normal_mapped_sphere(x_scale, eye):
    """Returns a place of a normal map on a sphere, which its node mirrors if `x_scale` is -1, with a light at `eye`."""

    def place(made):
        sphere(made).scale = (x_scale, 1.0, 1.0)
        light("POINT", 600.0, eye)

    return place


def turned_normal_map():
    """A normal map whose image is moved, scaled and turned, with tangents from the file.

    In Cycles, tangents are along the coordinates before this transform. Without tangents in the file, kdray takes them
    along the transformed ones, as three.js and Khronos's viewer do.
    """
    made = material("bumpy", (0.7, 0.7, 0.7))
    nodes, links, node = principled(made)
    mapped, shown = nodes.new("ShaderNodeNormalMap"), texture(made, image("normal.png", slopes(1.0), True))
    map_coordinates(made, shown, (0.2, 0.1), (1.5, 1.2), 30.0)
    links.new(shown.outputs["Color"], mapped.inputs["Color"])
    links.new(mapped.outputs["Normal"], node.inputs["Normal"])
    card(made)


def normal_map_second_uvs():
    """A normal map that uses the second set of coordinates, along which its tangents are. The file has no tangents."""
    made = material("textured", (0.7, 0.7, 0.7))
    nodes, links, node = principled(made)
    mapped, shown = nodes.new("ShaderNodeNormalMap"), texture(made, image("normal.png", slopes(1.0), True))
    mapped.uv_map = "second"
    use_second_uvs(made, shown)
    links.new(shown.outputs["Color"], mapped.inputs["Color"])
    links.new(mapped.outputs["Normal"], node.inputs["Normal"])
    add_second_uvs(card(made).data)


def metallic_roughness():
    """Roughness in green and metallic in blue of one texture, as glTF packs them."""
    n = 64
    y, x = np.mgrid[0:n, 0:n] / (n - 1)
    packed = np.stack([np.zeros_like(x), 0.4 + 0.6 * x, (y > 0.5) * 1.0, np.ones_like(x)], axis=-1)
    made = material("packed", (0.8, 0.5, 0.3), specular=0.0)
    nodes, links, node = principled(made)
    split = nodes.new("ShaderNodeSeparateColor")
    links.new(texture(made, image("packed.png", packed, True), "Closest").outputs["Color"], split.inputs["Color"])
    links.new(split.outputs["Green"], node.inputs["Roughness"])
    links.new(split.outputs["Blue"], node.inputs["Metallic"])
    card(made)


def vertex_colours():
    """Colours of corners, linear, on a sphere of flat faces."""
    made = material("coloured")
    nodes, links, node = principled(made)
    colours = nodes.new("ShaderNodeVertexColor")
    colours.layer_name = "Col"
    links.new(colours.outputs["Color"], node.inputs["Base Color"])
    thing = sphere(made, segments=16, smooth=False)
    layer = thing.data.color_attributes.new("Col", "FLOAT_COLOR", "CORNER")
    rng = np.random.default_rng(1)
    for entry in layer.data:
        entry.color = (*rng.uniform(0.05, 0.95, 3), 1.0)
    point_light()


def coloured_texture():
    """Colours of corners that multiply a texture."""
    made = material("textured")
    nodes, links, node = principled(made)
    colours, shown = nodes.new("ShaderNodeVertexColor"), texture(made, image("base.png", letters()), "Closest")
    colours.layer_name = "Col"
    mix = nodes.new("ShaderNodeMix")
    mix.data_type, mix.blend_type = "RGBA", "MULTIPLY"
    mix.inputs["Factor"].default_value = 1.0
    links.new(shown.outputs["Color"], mix.inputs["A"])
    links.new(colours.outputs["Color"], mix.inputs["B"])
    links.new(mix.outputs["Result"], node.inputs["Base Color"])
    layer = card(made).data.color_attributes.new("Col", "FLOAT_COLOR", "CORNER")
    shades = [(0.9, 0.5, 0.3), (0.4, 0.9, 0.6), (0.5, 0.4, 0.9), (0.8, 0.8, 0.4)]
    for entry, shade in zip(layer.data, shades):
        entry.color = (*shade, 1.0)


def holes(round_alpha, alpha):
    """Returns a case of a card with opacity above a floor, which shows the card's shadow."""

    def build():
        floor()
        made = material("holes", (0.8, 0.3, 0.2))
        nodes, links, node = principled(made)
        pixels = letters()
        pixels[..., 3] = alpha(pixels)
        shown = texture(made, image("holes.png", pixels), "Closest")
        links.new(shown.outputs["Color"], node.inputs["Base Color"])
        if round_alpha:
            rounding = nodes.new("ShaderNodeMath")
            rounding.operation = "ROUND"
            links.new(shown.outputs["Alpha"], rounding.inputs[0])
            links.new(rounding.outputs[0], node.inputs["Alpha"])
        else:
            links.new(shown.outputs["Alpha"], node.inputs["Alpha"])
            made.surface_render_method = "BLENDED"
            bpy.context.scene.cycles.samples = 4096
        thing = rectangle("card", (-1.2, 0.0, 0.4), (2.4, 0, 0), (0, 0, 2.0), made)
        # Light passes through such surfaces unweakened in kdray, if their opacity is below 0.5.
        thing.visible_shadow = round_alpha
        light("POINT", 900.0, (-0.5, -3.0, 5.0))

    return build


def emission():
    """A sphere that emits more than its factor can say, on a floor."""
    floor()
    made = material("glowing", (0.3, 0.3, 0.3), Emission_Color=(0.5, 0.2, 0.1, 1.0), Emission_Strength=3.0)
    # Cycles would otherwise light the floor by the sphere.
    sphere(made).visible_diffuse = False
    point_light()


def negative_scale(smooth):
    """Returns a case of mirrored, stretched and turned heads on a floor."""

    def build():
        floor()
        made = material("diffuse", (0.8, 0.4, 0.2))
        monkey(made, (-1.2, 0.0, 1.0), (-1.0, 1.0, 1.0), smooth)
        monkey(made, (1.2, 0.0, 1.0), (0.8, -0.8, -1.2), smooth).rotation_euler = (0.2, 0.4, 0.6)
        light("SUN", 3.0, (-2.0, -3.0, 4.0))

    return build


def see_through(n_bounces, samples):
    """Lets Cycles follow rays through glass, over this number of bounces, and take this number of samples."""
    cycles = bpy.context.scene.cycles
    cycles.max_bounces = cycles.transmission_bounces = cycles.glossy_bounces = n_bounces
    cycles.diffuse_bounces = cycles.volume_bounces = 0
    # Dark rays would otherwise be ended by chance.
    cycles.min_light_bounces = n_bounces
    cycles.samples = samples


def wall():
    """Adds a card with a coarse image, in front of which glass is put, and the light of these cases."""
    made = material("wall")
    _, links, node = principled(made)
    links.new(texture(made, image("wall.png", letters()), "Closest").outputs["Color"], node.inputs["Base Color"])
    card(made)


# A pane in front of the wall: a corner and two edges.
PANE = ((-0.9, -1.5, 0.5), (1.6, 0.3, 0.0), (0.0, 0.3, 1.1))


def thin_pane():
    """A pane of thin, tinted glass, as glTF has it without thickness: it does not bend rays, but it reflects."""
    wall()
    rectangle("pane", *PANE, material("glass", (0.5, 0.8, 0.9), 0.5, Roughness=0.0, Transmission_Weight=1.0))
    see_through(1, 1)


def thin_as_boundary():
    """Gives the pane in Cycles what a boundary needs to act as a thin sheet: the index of refraction 1, and the square
    of its colour. Returns what Schlick's formula leaves of the light that the pane transmits, for each pixel."""
    node = principled(bpy.data.materials["glass"])[2]
    node.inputs["IOR"].default_value = 1.0
    colour = node.inputs["Base Color"]
    colour.default_value = [part**2 for part in colour.default_value]
    origin, along, up = map(np.array, PANE)
    normal = np.cross(along, up) / np.linalg.norm(np.cross(along, up))
    eye, rays = pixel_rays()
    points = eye + rays * ((origin - eye) @ normal / (rays @ normal))[..., None] - origin
    weights = points @ np.linalg.pinv(np.stack([along, up]))
    inside = ((weights > 0.0) & (weights < 1.0)).all(axis=-1)
    cosine = abs(rays @ normal) / np.linalg.norm(rays, axis=-1)
    reflected = 0.04 + 0.96 * (1.0 - cosine) ** 5
    return np.where(inside, 1.0 - reflected, 1.0)[..., None]


def transmission_texture():
    """A pane whose share of transmitted light is in the red of a texture, and which reflects the rest diffusely.

    It has the index of refraction 1 and no highlight, so that nothing but this share counts. Its channels are 0 or 1,
    whose square roots are the same.
    """
    wall()
    made = material("glass", (1.0, 1.0, 0.0), Roughness=0.0, IOR=1.0)
    nodes, links, node = principled(made)
    split = nodes.new("ShaderNodeSeparateColor")
    shown = texture(made, image("transmission.png", letters(), True), "Closest")
    links.new(shown.outputs["Color"], split.inputs["Color"])
    links.new(split.outputs["Red"], node.inputs["Transmission Weight"])
    rectangle("pane", *PANE, made)
    see_through(1, 1024)


def solid_glass(ior, samples):
    """Returns a case of a cuboid and a sphere of tinted glass that absorbs light, in front of the wall.

    It has no highlights, which Cycles does not show on a smooth surface by a light of radius 0.
    """

    def build():
        wall()
        made = absorbing_glass(ior, 0.0)
        sphere(made, (-0.7, -1.2, 0.8), 0.6)
        bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.8, -1.3, 0.8), rotation=(0.3, 0.2, 0.5))
        take(made, False)
        see_through(4, samples)

    return build


def skin():
    """Two smooth heads, which are one mesh, each turned and moved by a bone of its own in the armature's pose."""
    floor()
    made = material("diffuse", (0.8, 0.4, 0.2))
    left, right = (monkey(made, (x, 0.0, 1.0), smooth=True) for x in (-1.2, 1.2))
    n_left = len(left.data.vertices)
    bpy.ops.object.select_all(action="DESELECT")
    left.select_set(True)
    right.select_set(True)
    bpy.context.view_layer.objects.active = left
    bpy.ops.object.join()
    armature = link("armature", bpy.data.armatures.new("armature"))
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for name, x in (("left", -1.2), ("right", 1.2)):
        bone = armature.data.edit_bones.new(name)
        bone.head, bone.tail = (x, 0.0, 0.5), (x, 0.3, 1.5)
    bpy.ops.object.mode_set(mode="OBJECT")
    everything = range(len(left.data.vertices))
    for name, members in (("left", everything[:n_left]), ("right", everything[n_left:])):
        left.vertex_groups.new(name=name).add(list(members), 1.0, "REPLACE")
        armature.pose.bones[name].rotation_mode = "XYZ"
    left.modifiers.new("armature", "ARMATURE").object = armature
    left.parent = armature
    armature.pose.bones["left"].rotation_euler = (0.3, 0.6, -0.2)
    armature.pose.bones["right"].rotation_euler = (-0.4, -0.3, 0.5)
    armature.pose.bones["right"].location = (0.2, 0.3, 0.1)
    armature.pose.bones["right"].scale = (0.8, 0.8, 0.8)
    armature.rotation_euler = (0.0, 0.0, 0.2)
    light("SUN", 3.0, (-2.0, -3.0, 4.0))


def morph():
    """A smooth ball with two morph targets: one that bends it, with its whole weight, and one with the weight 0."""
    floor()
    ball = sphere(material("diffuse", (0.8, 0.4, 0.2)))
    ball.shape_key_add(name="Basis")
    bent, flat = ball.shape_key_add(name="bent"), ball.shape_key_add(name="flat")
    for bent_point, flat_point in zip(bent.data, flat.data):
        x, y, z = bent_point.co
        bent_point.co = (x * (1.0 + 0.5 * z) + 0.4 * z * z, y * (1.0 - 0.4 * z), 0.9 * z + 0.3 * x * x)
        flat_point.co = (x, y, 0.2 * z)
    bent.value, flat.value = 1.0, 0.0
    light("SUN", 3.0, (-2.0, -3.0, 4.0))


def terminator():
    """A smooth sphere of few faces, whose facets shadow themselves, by a sun from the side."""
    sphere(material("diffuse"), segments=16)
    light("SUN", 3.0, (-4.0, -1.0, 1.5))


def many_lights():
    """Three lights of different kinds and colours."""
    floor()
    sphere(material("diffuse"))
    light("POINT", 400.0, (-2.5, -3.0, 5.0), colour=(1.0, 0.3, 0.3))
    light("SUN", 1.0, (2.0, -3.0, 4.0), colour=(0.3, 1.0, 0.3))
    light("SPOT", 900.0, (0.5, -2.0, 5.0), colour=(0.3, 0.3, 1.0), spot_size=1.0, spot_blend=0.0)
    bpy.context.scene.cycles.samples = 1024


def obj_transform():
    """A card whose texture is scaled and moved by the options `-s` and `-o` of its line in the MTL file."""
    made = material("textured")
    _, links, node = principled(made)
    shown = texture(made, image("base.png", waves()))
    map_coordinates(made, shown, (0.15, 0.3), (1.5, 0.7))
    links.new(shown.outputs["Color"], node.inputs["Base Color"])
    rectangle("card", (-1.6, 0.0, -0.6), (3.2, 0, 0), (0, 0.8, 2.3), made)
    light("SUN", 3.0, (-2.0, -3.0, 4.0), colour=(1.0, 0.8, 0.6))


def obj_scene(specular):
    """Returns a case of a card with a texture whose name has spaces, and a smooth head, by a sun, for OBJ, which has no
    lights of its own."""

    def build():
        made = material("textured", specular=specular)
        _, links, node = principled(made)
        shown = texture(made, image("my picture of (a) gradient.png", gradient()))
        links.new(shown.outputs["Color"], node.inputs["Base Color"])
        # The border is left out, since OBJ files repeat the image, and colours are blended differently there.
        rectangle("card", (-2.2, 0.6, 0.0), (2.2, 0, 0), (0, 0.3, 2.0), made, 0.02)
        monkey(material("diffuse", (0.2, 0.5, 0.8), specular=specular), (1.0, 0.0, 1.0), smooth=True)
        light("SUN", 3.0, (-2.0, -3.0, 4.0), colour=(1.0, 0.8, 0.6))

    return build


# --- Pictures -----------------------------------------------------------------------------------------------------


@dataclass
class Case:
    """A scene and the bounds of its differences."""

    build: object
    mean: float
    p95: float
    outliers: float
    kind: str = "glb"
    # Share of the greatest radiance from which on pixels are compared.
    least: float = 1e-3
    # Changes Blender's scene after the export, and returns what to multiply Cycles's picture by.
    change: object = None


CASES = {
    "diffuse": Case(diffuse, 0.001, 0.001, 0.001),
    "sun": Case(sun, 0.001, 0.001, 0.001),
    "spot_hard": Case(spot_hard, 0.012, 0.001, 0.015),
    "spot_soft": Case(spot_soft, 0.001, 0.001, 0.001, change=gltf_spot),
    "many_lights": Case(many_lights, 0.002, 0.005, 0.004),
    "metal_0.3": Case(metal(0.3), 0.001, 0.001, 0.002),
    "metal_0.5": Case(metal(0.5), 0.001, 0.001, 0.001),
    "metal_0.8": Case(metal(0.8), 0.001, 0.001, 0.001),
    "orthographic": Case(orthographic(metal(0.3)), 0.001, 0.001, 0.002),
    "highlight_0.2": Case(dielectric(0.2), 0.01, 0.01, 0.001),
    "highlight_0.5": Case(dielectric(0.5), 0.01, 0.01, 0.001),
    "dielectric_0.3": Case(dielectric(0.3, (0.6, 0.3, 0.2)), 0.03, 0.18, 0.11),
    "dielectric_0.8": Case(dielectric(0.8, (0.6, 0.3, 0.2)), 0.012, 0.045, 0.001),
    "half_metal": Case(half_metal, 0.018, 0.1, 0.042),
    "metallic_roughness": Case(metallic_roughness, 0.001, 0.001, 0.001),
    "texture_nearest": Case(base_texture(letters, "Closest", "REPEAT"), 0.001, 0.001, 0.001),
    "texture_linear": Case(base_texture(gradient, "Linear", "EXTEND"), 0.001, 0.002, 0.001),
    "texture_wrapped": Case(wrapped_texture, 0.002, 0.001, 0.016),
    "normal_map": Case(normal_map(card, 1.0), 0.0005, 0.001, 0.001),
    "normal_map_sphere": Case(normal_map(normal_mapped_sphere(1.0, FRONT), 0.5), 0.001, 0.004, 0.002, least=0.4),
    "normal_map_mirrored": Case(normal_map(normal_mapped_sphere(-1.0, FRONT), 0.5), 0.001, 0.004, 0.002, least=0.4),
    "normal_map_side": Case(normal_map(normal_mapped_sphere(1.0, SIDE), 1.0), 0.002, 0.02, 0.03),
    "vertex_colours": Case(vertex_colours, 0.001, 0.006, 0.001),
    "alpha_mask": Case(holes(True, lambda p: np.where(p[..., 0] > 0.5, 1.0, 0.2)), 0.001, 0.001, 0.001),
    "alpha_blend": Case(holes(False, lambda p: np.where(p[..., 0] > 0.5, 0.45, 0.2)), 0.001, 0.001, 0.001),
    "texture_mirror": Case(texture_outside("MIRROR"), 0.001, 0.001, 0.001),
    "texture_extend": Case(texture_outside("EXTEND"), 0.001, 0.001, 0.001),
    "unlit": Case(unlit, 0.001, 0.001, 0.001),
    "emission_texture": Case(emission_texture, 0.001, 0.001, 0.001),
    "texture_second_uvs": Case(second_uvs, 0.001, 0.001, 0.001),
    "normal_map_second_uvs": Case(normal_map_second_uvs, 0.001, 0.001, 0.001),
    "vertex_colours_texture": Case(coloured_texture, 0.001, 0.006, 0.001),
    "normal_map_turned": Case(turned_normal_map, 0.001, 0.001, 0.001, "glb+tangents"),
    "occlusion": Case(occlusion, 0.001, 0.001, 0.001, "glb+ambient", change=ambient_emission),
    "transmission_thin": Case(thin_pane, 0.001, 0.001, 0.001, change=thin_as_boundary),
    "transmission_texture": Case(transmission_texture, 0.001, 0.001, 0.002),
    "glass_absorbing": Case(solid_glass(1.0, 1), 0.001, 0.001, 0.001, change=absorption_of_gltf),
    "glass_refracting": Case(solid_glass(1.45, 1024), 0.001, 0.01, 0.006, change=absorption_of_gltf),
    "skin": Case(skin, 0.001, 0.001, 0.004),
    "morph": Case(morph, 0.001, 0.001, 0.001),
    "emission": Case(emission, 0.001, 0.001, 0.001),
    "negative_scale": Case(negative_scale(False), 0.001, 0.001, 0.001),
    "smooth_heads": Case(negative_scale(True), 0.001, 0.001, 0.004),
    "terminator": Case(terminator, 0.001, 0.001, 0.001),
    "obj_phong": Case(obj_scene(0.0), 0.002, 0.002, 0.005, "obj"),
    "obj_transform": Case(obj_transform, 0.001, 0.004, 0.001, "obj"),
    "obj_pbr": Case(obj_scene(0.5), 0.01, 0.018, 0.012, "obj+pbr"),
}


def brighter():
    """Plants an error: the light has half a percent more power."""
    bpy.data.lights[0].energy *= 1.005


def wider():
    """Plants an error: the orthographic camera shows one percent more."""
    bpy.context.scene.camera.data.ortho_scale *= 1.01


def replace_image(change):
    """Replaces the image that a material of the scene shows by what `change` makes of its rows from the top."""
    nodes = [node for made in bpy.data.materials for node in made.node_tree.nodes if node.type == "TEX_IMAGE"]
    shown = nodes[0].image
    pixels = np.array(shown.pixels[:]).reshape(shown.size[1], shown.size[0], 4)[::-1]
    nodes[0].image = image("planted.png", change(pixels.copy()), shown.colorspace_settings.name == "Non-Color")
    return nodes[0].image


def upside_down():
    """Plants an error: the image is upside down."""
    replace_image(lambda pixels: pixels[::-1])


def repeated():
    """Plants an error: the image repeats."""
    bpy.data.materials["textured"].node_tree.nodes["Image Texture"].extension = "REPEAT"


def green_down():
    """Plants an error: the green of a normal map points down."""
    replace_image(lambda pixels: np.abs(pixels - (0.0, 1.0, 0.0, 0.0)))


def not_decoded():
    """Plants an error: the colours of the image count as linear."""
    replace_image(lambda pixels: pixels).colorspace_settings.name = "Non-Color"


def set_input(node, name, change):
    """Replaces the value of an input of a node by what `change` makes of it."""
    node.inputs[name].default_value = change(node.inputs[name].default_value)


def darker_glass():
    """Plants an error: the green of the glass is one percent less."""
    set_input(principled(bpy.data.materials["glass"])[2], "Base Color", lambda c: (c[0], 0.99 * c[1], c[2], 1.0))


def denser_glass():
    """Plants an error: the glass absorbs two percent more."""
    set_input(principled(bpy.data.materials["glass"])[0]["Volume Absorption"], "Density", lambda d: 1.02 * d)


def bends_more():
    """Plants an error: the index of refraction is greater by 0.01."""
    set_input(principled(bpy.data.materials["glass"])[2], "IOR", lambda ior: ior + 0.01)


def more_occlusion():
    """Plants an error: the occlusion's strength is 0.72."""
    set_input(bpy.data.materials["dusty"].node_tree.nodes["Mix"], "Factor", lambda strength: strength + 0.02)


def first_uvs():
    """Plants an error: the texture uses the first set of coordinates."""
    bpy.data.materials["textured"].node_tree.nodes["UV Map"].uv_map = "UVMap"


def tangents_of_first():
    """Plants an error: the tangents of a normal map are along the first set of coordinates."""
    bpy.data.materials["textured"].node_tree.nodes["Normal Map"].uv_map = "UVMap"


def moved_texture():
    """Plants an error: the texture is moved by a hundredth of its width."""
    node = bpy.data.materials["textured"].node_tree.nodes["Mapping"]
    set_input(node, "Location", lambda place: (place[0] + 0.01, place[1], 0.0))


def turned_bone():
    """Plants an error: a bone is turned by a degree."""
    bpy.data.objects["armature"].pose.bones["left"].rotation_euler.x += math.radians(1.0)


def less_bent():
    """Plants an error: the weight of a morph target is 0.98."""
    bpy.data.shape_keys[0].key_blocks["bent"].value = 0.98


# Errors that are planted in Cycles's scene after the export, and must be found, by the name of the case.
PLANTED = [
    ("diffuse", brighter),
    ("orthographic", wider),
    ("texture_linear", upside_down),
    ("texture_linear", not_decoded),
    ("normal_map", green_down),
    ("normal_map_sphere", green_down),
    ("normal_map_mirrored", green_down),
    ("normal_map_turned", green_down),
    ("texture_wrapped", moved_texture),
    ("texture_mirror", repeated),
    ("texture_extend", repeated),
    ("unlit", not_decoded),
    ("emission_texture", upside_down),
    ("texture_second_uvs", first_uvs),
    ("normal_map_second_uvs", tangents_of_first),
    ("vertex_colours_texture", upside_down),
    ("occlusion", upside_down),
    ("occlusion", more_occlusion),
    ("transmission_thin", darker_glass),
    ("transmission_texture", upside_down),
    ("glass_absorbing", denser_glass),
    ("glass_refracting", denser_glass),
    ("glass_refracting", bends_more),
    ("skin", turned_bone),
    ("morph", less_bent),
    ("obj_transform", moved_texture),
]


def export(kind, stem):
    """Exports Blender's scene and returns the file for kdray."""
    if not kind.startswith("glb"):
        path = stem.with_suffix(".obj")
        bpy.ops.wm.obj_export(filepath=str(path), path_mode="COPY", export_pbr_extensions=kind == "obj+pbr")
        return scene_file(path)
    path = stem.with_suffix(".glb")
    # Bones keep their pose.
    export_glb(path, export_tangents=kind == "glb+tangents", export_rest_position_armature=False)
    return scene_file(path, f"ambient = {AMBIENT.tolist()}\n") if kind == "glb+ambient" else path


def scene_file(path, keys=""):
    """Writes a scene file of kdray with a mesh file, Blender's camera and its sun, and returns the path."""
    seen = bpy.context.scene.camera
    target = seen.matrix_world @ Vector((0.0, 0.0, -1.0))
    fov = math.degrees(2.0 * math.atan(math.tan(seen.data.angle / 2.0) * SIZE[1] / SIZE[0]))
    lamp = next(thing for thing in bpy.data.objects if thing.type == "LIGHT")
    travels = lamp.matrix_world.to_3x3() @ Vector((0.0, 0.0, -1.0))
    irradiance = [lamp.data.energy * part / math.pi for part in lamp.data.color]
    toml = path.with_suffix(".toml")
    toml.write_text(
        f"{keys}[camera]\neye = {yup(seen.location)}\ntarget = {yup(target)}\nvertical_fov = {fov}\n"
        f'[[light]]\nkind = "directional"\ndirection = {yup(travels)}\nirradiance = {irradiance}\n'
        f'[[mesh]]\nfile = "{path.name}"\n'
    )
    return toml


def compare(name, case, planted, arguments, folder):
    """Renders a case by both programs, prints its differences, and returns whether they are within the bounds, or with
    a planted error whether they are not."""
    if planted:
        name = f"{name}.{planted.__name__}"
    place = folder / name
    place.mkdir(exist_ok=True)
    os.chdir(place)
    direct_light(SIZE)
    case.build()
    path = export(case.kind, place / "scene")
    factor = case.change() if case.change else 1.0
    if planted:
        planted()
    theirs = render_cycles(place / "cycles.exr") * factor
    blender.render(arguments, path, place / "kdray.exr", SIZE)
    ours = read_exr(place / "kdray.exr")
    mean, p95, outliers, relative, lit = differences(ours, theirs, case.least)
    contact_sheet(folder / f"{name}.png", ours, theirs, relative)
    is_within = abs(mean) <= case.mean and p95 <= case.p95 and outliers <= case.outliers
    good = is_within != bool(planted)
    report(
        f"{'ok  ' if good else 'FAIL'} {name:32} {lit.sum():6} pixels, mean {mean:+8.4%} (bound {case.mean:.1%}), "
        f"p95 {p95:8.4%} ({case.p95:.1%}), outliers {outliers:8.4%} ({case.outliers:.1%})"
    )
    return good


# --- The command --------------------------------------------------------------------------------------------------

if __name__ == "__main__":
    CHECKS = [(name, partial(compare, name, case, None)) for name, case in CASES.items()]
    CHECKS += [(name, partial(compare, name, CASES[name], change)) for name, change in PLANTED]
    sys.exit(blender.main(__doc__, CHECKS))

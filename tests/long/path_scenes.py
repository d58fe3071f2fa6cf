"""The scenes of `cycles_paths.py`, made in Blender, and the scene files of kdray that show the same.

Units. No factor is fitted. P is the power in watts that Blender states for a lamp, and E the irradiance of its sun.

| lamp | physical quantity in Cycles | value in kdray's scene file |
|---|---|---|
| sphere of radius r | radiance P / (4 pi^2 r^2) | the same |
| rectangle of area A | radiance P / (pi A) | the same |
| spot | intensity P / (4 pi) | divided by pi, as of all lights without an area |
| sun | irradiance E | divided by pi |
"""

import math
from pathlib import Path

from in_blender import (
    absorbing_glass,
    camera,
    empty,
    image,
    letters,
    light,
    look,
    material,
    principled,
    rectangle,
    sphere,
    take,
    texture,
    yup,
)
from path_albedos import FOV, HEIGHT, PITCH
from reference.description import ENVIRONMENT_HEIGHT, environment_image
from reference.scenes import sky

import bpy
import numpy as np
import OpenEXR

# This module exists once `bpy` has been imported.
from mathutils import Vector

SIZE = 96  # width and height of the pictures, pixels
MAX_DEPTH = 25  # surfaces that a path meets at most
# By how much Cycles turns the environment about the vertical axis, counter-clockwise as seen from above, degrees.
TURNED = 40.0
# Colours of materials.
PLASTIC, GOLD, FROSTED = (0.5, 0.3, 0.1), (1.0, 0.78, 0.34), (0.5, 0.8, 0.9)


# --- Parts of scenes ----------------------------------------------------------------------------------------------


def reset():
    """Empties Blender and sets Cycles up for all light, with samples spread evenly over each pixel."""
    cycles = empty((SIZE, SIZE))
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = MAX_DEPTH - 1
    cycles.transparent_max_bounces = 64
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.pixel_filter_type = "BOX"
    cycles.filter_width = 1.0
    camera((0.0, -6.0, 3.0), (0.0, 0.0, 0.6))


def write_environment(picture):
    """Writes an equirectangular picture into the working directory, and returns its path."""
    path = Path.cwd() / "environment.exr"
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": picture}).write(str(path))
    return path


def environment(picture):
    """Gives the scene an environment."""
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    shown, mapping, coordinates = (nodes.new(f"ShaderNode{kind}") for kind in ("TexEnvironment", "Mapping", "TexCoord"))
    shown.image = bpy.data.images.load(str(write_environment(picture)))
    mapping.vector_type = "TEXTURE"
    mapping.inputs["Rotation"].default_value = (0.0, 0.0, math.radians(TURNED))
    links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], shown.inputs["Vector"])
    links.new(shown.outputs["Color"], nodes["Background"].inputs["Color"])
    bpy.context.scene.world = world


def daylight():
    """Gives the scene a smooth sky with a bright spot."""
    environment(environment_image(sky, (np.arange(ENVIRONMENT_HEIGHT) + 0.5) / ENVIRONMENT_HEIGHT))


def floor():
    """Adds a square of 8 by 8 in the plane z = 0."""
    rectangle("floor", (-4, -4, 0), (8, 0, 0), (0, 8, 0), material("floor", (0.6, 0.5, 0.4)))


def ball(made, centre=(0.0, 0.0, 1.0), radius=1.0):
    """Adds a sphere of flat faces, so fine that it looks round."""
    return sphere(made, centre, radius, segments=128, smooth=False)


def block(made, centre=(0.2, 0.1, 0.6), edge=1.2):
    """Adds a cube that is turned about the vertical axis."""
    bpy.ops.mesh.primitive_cube_add(size=edge, location=centre, rotation=(0.0, 0.0, 0.4))
    return take(made, False)


def room():
    """Adds a matt room that is open at the front, with a block, and a camera that does not see the ceiling."""
    white, red, green = (material(*of) for of in (
        ("white", (0.75, 0.75, 0.75)), ("red", (0.7, 0.1, 0.1)), ("green", (0.1, 0.5, 0.15)),
    ))  # fmt: skip
    x, y, z = (3, 0, 0), (0, 3, 0), (0, 0, 3)
    rectangle("ground", (-1.5, -1.5, 0), x, y, white)
    rectangle("ceiling", (-1.5, -1.5, 3), y, x, white)
    rectangle("back", (-1.5, 1.5, 0), x, z, white)
    rectangle("left", (-1.5, -1.5, 0), y, z, red)
    rectangle("right", (1.5, 1.5, 0), (0, -3, 0), z, green)
    block(white)
    camera((0.0, -6.5, 1.5), (0.0, 0.0, 1.5), 20.0)


# --- Cases --------------------------------------------------------------------------------------------------------


def area():
    """A rectangle. In Cycles, light passes through it, so that a black card is put behind it."""
    room()
    rectangle("card", (-0.25, -0.35, 2.901), (0, 0.5, 0), (0.9, 0, 0), material("black", (0.0, 0.0, 0.0)))
    light("AREA", 60.0, (0.2, -0.1, 2.9), (0.2, -0.1, 0.0), (1.0, 0.8, 0.6), shape="RECTANGLE", size=0.9, size_y=0.5)


def sun():
    floor()
    block(material("matt", (0.3, 0.5, 0.7)))
    light("SUN", 3.0, (-2.0, -1.0, 3.0), angle=math.radians(20.0))


def sky_light():
    floor()
    ball(material("matt", (0.3, 0.5, 0.7)))
    daylight()


def sphere_light():
    floor()
    block(material("matt", (0.3, 0.5, 0.7)))
    light("POINT", 500.0, (-1.5, -0.5, 4.0), shadow_soft_size=0.5)


def spot():
    room()
    light("SPOT", 200.0, (0.0, -0.5, 2.9), (0.3, 0.3, 0.0), spot_size=math.radians(80.0), spot_blend=0.0)


def textured_lamp():
    """A card that emits by a texture, and lights the floor and a block."""
    floor()
    made = material("glowing", (0.3, 0.3, 0.3), Emission_Strength=4.0)
    made.cycles.emission_sampling = "FRONT_BACK"
    _, links, node = principled(made)
    shown = texture(made, image("emission.png", letters()), "Closest")
    links.new(shown.outputs["Color"], node.inputs["Emission Color"])
    rectangle("lamp", (-1.4, 1.0, 0.2), (2.8, 0, 0), (0, 0.3, 1.8), made)
    block(material("matt", (0.8, 0.8, 0.8)), (0.5, -0.6, 0.3), 0.6)


def coated(colour=(0.5, 0.1, 0.1)):
    return material("coated", colour, Coat_Weight=0.8, Coat_Roughness=0.4, Coat_IOR=1.5)


def with_multiple_scattering(made):
    principled(made)[2].distribution = "MULTI_GGX"
    return made


def plastic():
    return with_multiple_scattering(material("plastic", PLASTIC, 0.5, Roughness=0.5))


def gold():
    return with_multiple_scattering(material("gold", GOLD, 0.5, Metallic=1.0, Roughness=0.8))


def frosted():
    return material("frosted", FROSTED, 0.5, Roughness=0.5, Transmission_Weight=1.0)


def cloth():
    return material("cloth", (0.0, 0.0, 0.0), Sheen_Weight=1.0, Sheen_Roughness=0.5, Sheen_Tint=(1.0, 1.0, 1.0, 1.0))


def on_floor(make):
    """Returns a case of a ball on the floor, by daylight."""

    def build():
        floor()
        ball(make())
        daylight()

    return build


def glass():
    """A ball and a block of rough glass that absorbs light."""
    floor()
    made = absorbing_glass(1.5, 0.4)
    ball(made, (-0.8, 0.0, 0.9), 0.8)
    block(made, (1.0, -0.2, 0.7), 1.2)
    daylight()


def thin_glass():
    """A smooth pane in front of a block."""
    floor()
    block(material("matt", (0.3, 0.5, 0.7)))
    made = material("pane", (0.5, 0.8, 0.9), 0.5, Roughness=0.0, Transmission_Weight=1.0)
    rectangle("pane", (-1.0, -1.5, 0.1), (2.0, 0.6, 0.0), (0.0, 0.3, 1.6), made)
    daylight()


def coverage():
    """A card whose opacity is 0.7 or 0.3, above the floor."""
    floor()
    made = material("card", (0.8, 0.3, 0.2))
    _, links, node = principled(made)
    pixels = letters()
    pixels[..., 3] = np.where(pixels[..., 0] > 0.5, 0.7, 0.3)
    shown = texture(made, image("card.png", pixels), "Closest")
    links.new(shown.outputs["Color"], node.inputs["Base Color"])
    links.new(shown.outputs["Alpha"], node.inputs["Alpha"])
    made.surface_render_method = "BLENDED"
    rectangle("card", (-1.2, 0.0, 0.3), (2.4, 0, 0), (0, 0.6, 1.8), made)
    light("POINT", 500.0, (-1.5, -0.5, 4.0), shadow_soft_size=0.5)


def balls():
    """Adds three balls at three distances."""
    floor()
    for x, y, colour in ((-1.2, -1.5, (0.8, 0.2, 0.2)), (0.0, 0.0, (0.2, 0.7, 0.2)), (1.3, 2.0, (0.2, 0.3, 0.8))):
        ball(material("ball", colour), (x, y, 0.6), 0.6)
    daylight()


def lens():
    """A lens of the radius 0.25, whose focus is at the ball in the middle."""
    balls()
    seen = bpy.context.scene.camera.data
    seen.dof.use_dof = True
    seen.dof.focus_distance = 6.4
    # Blender states the lens by its focal length in millimetres, divided by its diameter.
    seen.dof.aperture_fstop = seen.lens / 1000.0 / (2 * 0.25)


def orthographic():
    balls()
    seen = bpy.context.scene.camera.data
    seen.type, seen.ortho_scale = "ORTHO", 4.4


def in_white(make):
    """Returns a case of a ball in white surroundings, as an orthographic camera from the front sees it."""

    def build():
        ball(make(), (0.0, 0.0, 0.0))
        environment(np.ones((16, 32, 3), np.float32))
        look(bpy.context.scene.camera, (0.0, -6.0, 0.0), (0.0, 0.0, 0.0))
        seen = bpy.context.scene.camera.data
        seen.type, seen.ortho_scale = "ORTHO", HEIGHT

    return build


def sheet_in_white():
    """A thin sheet in white surroundings, as large as the picture. Behind it is nothing else."""
    rectangle("sheet", (-200, -200, 0), (400, 0, 0), (0, 400, 0), frosted())
    environment(np.ones((16, 32, 3), np.float32))
    pitch = math.radians(PITCH)
    camera((0.0, 0.0, 1.0), (0.0, math.cos(pitch), 1.0 - math.sin(pitch)), FOV)


# --- Files for kdray ----------------------------------------------------------------------------------------------


def lamp_keys(lamp):
    """Returns the keys of a lamp in a scene file."""
    data, matrix = lamp.data, lamp.matrix_world
    power = data.energy * np.array(data.color)
    place = {"position": yup(matrix.translation)}
    direction = {"direction": yup(matrix.to_3x3() @ Vector((0.0, 0.0, -1.0)))}
    match data.type:
        case "SUN":
            angle = math.degrees(data.angle)
            return {"kind": "directional", **direction, "irradiance": power / math.pi, "angle": angle}
        case "POINT":
            radius = data.shadow_soft_size
            radiance = power / (4.0 * math.pi**2 * radius**2)
            return {"kind": "sphere", **place, "radius": radius, "radiance": radiance}
        case "AREA":
            radiance = power / (math.pi * data.size * data.size_y)
            up = {"up": yup(matrix.to_3x3() @ Vector((0.0, 1.0, 0.0)))}
            shape = {"width": data.size, "height": data.size_y}
            return {"kind": "rectangle", **place, **direction, **up, **shape, "radiance": radiance}
        case "SPOT":
            outer = math.degrees(data.spot_size / 2.0)
            angles = {"inner_angle": outer * (1.0 - data.spot_blend), "outer_angle": outer}
            return {"kind": "spot", **place, **direction, **angles, "intensity": power / (4.0 * math.pi**2)}


def camera_keys():
    """Returns the keys of Blender's camera in a scene file."""
    seen = bpy.context.scene.camera
    eye, towards = seen.matrix_world.translation, seen.matrix_world.to_3x3() @ Vector((0.0, 0.0, -1.0))
    keys = {"eye": yup(eye), "target": yup(eye + towards)}
    if seen.data.type == "ORTHO":
        return keys | {"orthographic_height": seen.data.ortho_scale}
    return keys | {"vertical_fov": math.degrees(seen.data.angle)}


def table(header, keys):
    """Returns a table of a TOML file."""
    lines = [f"{key} = {value!r}\n" if isinstance(value, str) else f"{key} = {np.array(value).tolist()}\n"
             for key, value in keys.items()]  # fmt: skip
    return f"{header}\n{''.join(lines)}"


def export():
    """Writes Blender's scene into the working directory, and returns the scene file for kdray and options of it."""
    bpy.context.view_layer.update()
    bpy.ops.export_scene.gltf(filepath=str(Path.cwd() / "scene.glb"), export_format="GLB")
    tables = [
        table("[render]", {"integrator": "path", "width": SIZE, "height": SIZE, "max_depth": MAX_DEPTH}),
        table("[camera]", camera_keys()),
        table("[[mesh]]", {"file": "scene.glb"}),
        *(table("[[light]]", lamp_keys(lamp)) for lamp in bpy.data.objects if lamp.type == "LIGHT"),
    ]
    if bpy.context.scene.world:
        # The middle of the picture is the direction +x in Blender, and -z, which is Blender's +y, in kdray.
        tables.append(table("[environment]", {"file": "environment.exr", "rotation": TURNED - 90.0}))
    path = Path.cwd() / "scene.toml"
    path.write_text("\n".join(tables))
    dof = bpy.context.scene.camera.data.dof
    radius = bpy.context.scene.camera.data.lens / 1000.0 / (2.0 * dof.aperture_fstop)
    return path, ["--aperture", radius, "--focus", dof.focus_distance] if dof.use_dof else []

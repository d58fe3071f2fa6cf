"""The scenes of `cycles_paths.py`, made in Blender. `path_files.py` writes them for kdray."""

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
)
from path_albedos import FOV, HEIGHT, PITCH
from reference.description import ENVIRONMENT_HEIGHT, environment_image
from reference.scenes import sky

import bpy
import numpy as np
import OpenEXR

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


def sphere_lamp():
    """Adds a light that is a sphere. With "soft falloff", it would be a disk that faces each point."""
    light("POINT", 500.0, (-1.5, -0.5, 4.0), shadow_soft_size=0.5, use_soft_falloff=False)


def room():
    """Adds a diffuse room that is open at the front, with a block, and a camera that does not see the ceiling."""
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
    block(material("diffuse", (0.3, 0.5, 0.7)))
    light("SUN", 3.0, (-2.0, -1.0, 3.0), angle=math.radians(20.0))


def sky_light():
    floor()
    ball(material("diffuse", (0.3, 0.5, 0.7)))
    daylight()


def sphere_light():
    floor()
    block(material("diffuse", (0.3, 0.5, 0.7)))
    sphere_lamp()


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
    block(material("diffuse", (0.8, 0.8, 0.8)), (0.5, -0.6, 0.3), 0.6)


def coated(colour=(0.1, 0.03, 0.03)):
    return material("coated", colour, Coat_Weight=0.8, Coat_Roughness=0.4, Coat_IOR=1.5)


def black_coat():
    return coated((0.0, 0.0, 0.0))


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
    """A ball and a block of rough glass that absorbs light. Light that bounces between microfacets is not lost."""
    floor()
    made = absorbing_glass(1.5, 0.4)
    principled(made)[2].distribution = "MULTI_GGX"
    ball(made, (-0.8, 0.0, 0.9), 0.8)
    block(made, (1.0, -0.2, 0.7), 1.2)
    daylight()


def thin_glass():
    """A smooth pane in front of a block."""
    floor()
    block(material("diffuse", (0.3, 0.5, 0.7)))
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
    sphere_lamp()


def balls():
    """Adds three balls at three distances."""
    floor()
    for x, y, colour in ((-1.2, -1.5, (0.8, 0.2, 0.2)), (0.0, 0.0, (0.2, 0.7, 0.2)), (1.3, 2.0, (0.2, 0.3, 0.8))):
        ball(material("ball", colour), (x, y, 0.6), 0.6)
    daylight()


def lens():
    """A lens of the radius 0.5, whose focus is at the ball in the middle. A lamp near the lens shows as a soft disk,
    whose brightness depends on the lens's radius."""
    balls()
    made = material("lamp", (0.0, 0.0, 0.0), Emission_Color=(1.0, 0.9, 0.8, 1.0), Emission_Strength=4.0)
    made.cycles.emission_sampling = "FRONT"
    sphere(made, (-0.5, -3.0, 1.9), 0.2, segments=32, smooth=False)
    seen = bpy.context.scene.camera.data
    seen.dof.use_dof = True
    seen.dof.focus_distance = 6.4
    # Blender states the lens by its focal length in millimetres, divided by its diameter.
    seen.dof.aperture_fstop = seen.lens / 1000.0 / (2 * 0.5)


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


def plane_in_white(make, is_front=True):
    """Returns a case of a plane's front or back in white surroundings, with nothing behind it."""

    def build():
        edges = (400, 0, 0), (0, 400, 0)
        rectangle("plane", (-200, -200, 0), *(edges if is_front else edges[::-1]), make())
        environment(np.ones((16, 32, 3), np.float32))
        pitch = math.radians(PITCH)
        camera((0.0, 0.0, 1.0), (0.0, math.cos(pitch), 1.0 - math.sin(pitch)), FOV)

    return build


def clear_glass():
    made = absorbing_glass(1.5, 0.4)
    made["single_scattering"] = True
    principled(made)[2].inputs["Base Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    principled(made)[0]["Volume Absorption"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    return made

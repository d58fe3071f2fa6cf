"""Scene files of kdray that show what is in Blender, with the lights and options of the integrator `path`.

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

from in_blender import yup
from path_scenes import MAX_DEPTH, SIZE, TURNED

import bpy
import numpy as np

# This module exists once `bpy` has been imported.
from mathutils import Vector


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
    # Materials that have no compensation for light between microfacets, as the formula that they are compared with.
    single = [made.name for made in bpy.data.materials if made.get("single_scattering")]
    tables = [
        # With a stated ambient light, kdray chooses no lights by itself.
        "ambient = [0, 0, 0]\n",
        table("[render]", {"integrator": "path", "width": SIZE, "height": SIZE, "max_depth": MAX_DEPTH}),
        table("[camera]", camera_keys()),
        table("[[mesh]]", {"file": "scene.glb"}) + ("override = true\n" if single else ""),
        *(f"[materials.{name}]\nsingle_scattering = true\n" for name in single),
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

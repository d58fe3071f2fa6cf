"""Writes a scene for kdray, and renders it."""

import json
import subprocess
from pathlib import Path

import numpy as np
import OpenEXR

from .description import ENVIRONMENT_HEIGHT, Diffuse, Emitting, Glass, Metal, environment_image


def write_obj(path, mesh):
    with open(path, "w") as file:
        file.writelines(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in mesh.vertices)
        if mesh.uvs is not None:
            file.writelines(f"vt {u:.9g} {v:.9g}\n" for u, v in mesh.uvs)
        corner = "{0}/{0}" if mesh.uvs is not None else "{0}"
        file.writelines("f " + " ".join(corner.format(ix + 1) for ix in face) + "\n" for face in mesh.faces)


def material_keys(material):
    match material:
        case Diffuse(texture=None):
            return {"Kd": list(material.reflectance)}
        case Diffuse():
            return {"map_Kd": Path(material.texture).name}
        case Emitting():
            return {"Kd": [0.0, 0.0, 0.0], "Ke": list(material.radiance)}
        case Metal():
            rough = material.alpha**0.5
            return {"Kd": [1.0, 1.0, 1.0], "metallic": 1.0, "roughness": rough, "single_scattering": True}
        case Glass():
            rough = material.alpha**0.5
            return {
                "Kd": [1.0, 1.0, 1.0], "transmission": 1.0, "roughness": rough, "Ni": material.ior,
                "single_scattering": True,
            }  # fmt: skip


def toml(value):
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml(float(item)) for item in value) + "]"
    return json.dumps(float(value) if isinstance(value, np.floating) else value)


def write(scene, folder):
    """Returns the scene file. Meshes are beside it; so must be the textures."""
    tables = [
        f'[render]\nintegrator = "path"\nwidth = {scene.size}\nheight = {scene.size}\nmax_depth = {scene.max_depth}\n',
        f"[camera]\neye = {toml(scene.eye)}\ntarget = {toml(scene.target)}\n",
        f"vertical_fov = {float(scene.vertical_fov)}\n",
    ]
    if scene.environment is not None:
        rows = (np.arange(ENVIRONMENT_HEIGHT) + 0.5) / ENVIRONMENT_HEIGHT
        path = Path(folder) / f"{scene.name}_sky.exr"
        channels = {"RGB": environment_image(scene.environment, rows)}
        OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(str(path))
        tables.append(f'[environment]\nfile = "{path.name}"\n')
    for light in scene.lights:
        keys = {"position": light.centre, "radius": light.radius, "radiance": light.radiance}
        lines = "".join(f"{key} = {toml(value)}\n" for key, value in keys.items())
        tables.append(f'[[light]]\nkind = "sphere"\n{lines}')
    for mesh in scene.meshes:
        write_obj(Path(folder) / f"{scene.name}_{mesh.name}.obj", mesh)
        tables.append(f"[materials.{mesh.name}]\n" + "".join(
            f"{key} = {toml(value)}\n" for key, value in material_keys(mesh.material).items()
        ))  # fmt: skip
        tables.append(
            f'[[mesh]]\nfile = "{scene.name}_{mesh.name}.obj"\nmaterial = "{mesh.name}"\nsmooth = false\n'
        )
    path = Path(folder) / f"{scene.name}.toml"
    path.write_text("\n".join(tables))
    return path


def render(kdray, scene_file, samples, arguments):
    """Returns the radiance of the samples [first, end) as a height x width x 3 array."""
    picture = scene_file.with_suffix(".exr")
    command = [kdray, "render", scene_file, "--samples", f"{samples[0]}-{samples[1]}", "--pixel-filter", "box"]
    subprocess.run([*map(str, command), "-q", "-o", str(picture), *arguments], check=True)
    channels = OpenEXR.File(str(picture)).channels()
    return np.asarray(channels["RGB" if "RGB" in channels else "RGBA"].pixels, np.float64)[..., :3]

"""Builds a scene for Mitsuba 3, and renders it."""

import drjit as dr
import mitsuba as mi
import numpy as np

from .description import ENVIRONMENT_HEIGHT, Diffuse, Emitting, Glass, Metal, environment_image

if mi.variant() is None:
    mi.set_variant("llvm_ad_rgb", "scalar_rgb")


class HeightCorrelated(mi.BSDF):
    """Rough metal or glass of Mitsuba's, with masking and shadowing that are correlated in height.

    Mitsuba has the product of both, 1 / ((1 + a) (1 + b)) with Smith's Lambda of each direction, which darkens rough
    surfaces. kdray has 1 / (1 + a + b) (Heitz, Understanding the Masking-Shadowing Function, JCGT 2014). The
    densities of directions do not depend on it.
    """

    def __init__(self, properties):
        super().__init__(properties)
        self.separable, self.alpha = properties["separable"], properties["alpha"]
        self.m_components = [self.separable.flags(i) for i in range(self.separable.component_count())]
        self.m_flags = self.separable.flags()

    def smith_lambda(self, direction):
        squared = dr.square(mi.Frame3f.cos_theta(direction))
        return 0.5 * (dr.sqrt(1 + self.alpha**2 * dr.maximum(1 / squared - 1, 0)) - 1)

    def ratio(self, si, wo):
        a, b = self.smith_lambda(si.wi), self.smith_lambda(wo)
        return (1 + a) * (1 + b) / (1 + a + b)

    def sample(self, context, si, sample1, sample2, active=True):
        sampled, weight = self.separable.sample(context, si, sample1, sample2, active)
        return sampled, weight * self.ratio(si, sampled.wo)

    def eval(self, context, si, wo, active=True):
        return self.separable.eval(context, si, wo, active) * self.ratio(si, wo)

    def pdf(self, context, si, wo, active=True):
        return self.separable.pdf(context, si, wo, active)

    def eval_pdf(self, context, si, wo, active=True):
        return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)

    def to_string(self):
        return f"HeightCorrelated[alpha={self.alpha}]"


mi.register_bsdf("heightcorrelated", HeightCorrelated)


def rough(separable, alpha, is_own):
    return separable if is_own else {"type": "heightcorrelated", "alpha": alpha, "separable": separable}


def rgb(colour):
    return {"type": "rgb", "value": [float(part) for part in colour]}


def bsdf(material, is_own):
    match material:
        case Diffuse(texture=None):
            return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(material.reflectance)}}
        case Diffuse():
            texture = {"type": "bitmap", "filename": material.texture, "filter_type": "bilinear"}
            return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": texture}}
        case Emitting():
            return {"type": "diffuse", "reflectance": rgb((0, 0, 0))}
        case Metal():
            conductor = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": material.alpha}
            return rough({"type": "twosided", "bsdf": conductor}, material.alpha, is_own)
        case Glass():
            alpha = material.alpha
            glass = {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha, "int_ior": material.ior}
            return rough(glass, alpha, is_own)


def both_sides(mesh):
    """Emitters shine from their front alone. So each triangle is there twice, a hair's breadth apart."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    aside = 1e-5 * normal / np.linalg.norm(normal, axis=1, keepdims=True)
    front, back = np.stack([a, b, c], 1) + aside[:, None], np.stack([a, c, b], 1) - aside[:, None]
    vertices = np.concatenate([front, back]).reshape(-1, 3)
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def shape(mesh, is_own):
    vertices, faces = (mesh.vertices, mesh.faces)
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf(mesh.material, is_own))
    if isinstance(mesh.material, Emitting):
        vertices, faces = both_sides(mesh)
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": rgb(mesh.material.radiance)})
    made = mi.Mesh(mesh.name, len(vertices), len(faces), props=properties, has_vertex_texcoords=mesh.uvs is not None)
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = np.ravel(vertices).astype(np.float32)
    parameters["faces"] = np.ravel(faces).astype(np.uint32)
    if mesh.uvs is not None:
        # Here v points down.
        parameters["vertex_texcoords"] = np.ravel(mesh.uvs * [1, -1] + [0, 1]).astype(np.float32)
    parameters.update()
    return made


def build(scene, is_own=False):
    """`is_own`: whether rough surfaces are Mitsuba's own, in place of `HeightCorrelated`."""
    camera = mi.ScalarTransform4f().look_at(list(scene.eye), list(scene.target), [0, 1, 0])
    parts = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": scene.max_depth + 1, "rr_depth": 5},
        "sensor": {
            "type": "perspective",
            "to_world": camera,
            "fov": float(scene.vertical_fov),
            "fov_axis": "y",
            "film": {
                "type": "hdrfilm", "width": scene.size, "height": scene.size, "pixel_format": "rgb",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "independent"},
        },
    }  # fmt: skip
    for mesh in scene.meshes:
        parts[mesh.name] = shape(mesh, is_own)
    for i, light in enumerate(scene.lights):
        parts[f"light{i}"] = {
            "type": "sphere", "center": list(light.centre), "radius": light.radius,
            "emitter": {"type": "area", "radiance": rgb(light.radiance)},
        }  # fmt: skip
    if scene.environment is not None:
        # Mitsuba's first and last row are the poles themselves.
        image = environment_image(scene.environment, np.linspace(0, 1, ENVIRONMENT_HEIGHT))
        parts["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(image), "to_world": ENVIRONMENT_TO_WORLD}
    return mi.load_dict(parts)


# Turns the middle column of the picture to where kdray has it.
ENVIRONMENT_TO_WORLD = mi.ScalarTransform4f().rotate([0, 1, 0], 180)


def render(built, n_samples, seed):
    """Returns the radiance as a height x width x 3 array."""
    return np.asarray(mi.render(built, spp=n_samples, seed=seed), np.float64)

"""What kdray's materials look like in white surroundings, by numeric quadrature of the papers' formulas.

In surroundings of radiance 1, a convex surface shows its albedo: the integral of the reflectance times the cosine over
all directions of light. `docs/materials.md` has the formulas and their sources; here they are written once more, in the
frame of the surface, and share nothing with kdray.
"""

import numpy as np

N_LIGHT = (512, 256)  # directions of light: polar, azimuthal angles
N_VIEW = 96  # cosines of the view
SUBPIXELS = 8  # per pixel, along each axis
# Height of the picture of a ball of radius 1.
HEIGHT = 2.2
# Field of view of the camera above a plane, and the angle by which it looks down, degrees.
FOV, PITCH = 60.0, 35.0

COSINES = np.linspace(0.004, 1.0, N_VIEW)


def half_sphere():
    """Returns directions to the light, and their solid angles. They are denser where the light grazes the surface."""
    t = (np.arange(N_LIGHT[0]) + 0.5) / N_LIGHT[0]
    theta = 0.5 * np.pi * (1.0 - (1.0 - t) ** 2)
    weight = np.sin(theta) * np.pi * (1.0 - t) / N_LIGHT[0] * 2.0 * np.pi / N_LIGHT[1]
    phi = 2.0 * np.pi * (np.arange(N_LIGHT[1]) + 0.5) / N_LIGHT[1]
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    light = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    return light, np.broadcast_to(weight[:, None], theta.shape)


def integrals(reflectance):
    """Returns the integral of `reflectance` times the light's cosine for all `COSINES` of the view, along axis 0.

    `reflectance`: a function of the cosines of light, view and half vector to the normal, and of the view to the half
    vector. It may return several values, along axis 0.
    """
    light, weight = half_sphere()
    sums = []
    for cosine in COSINES:
        view = np.array([np.sqrt(1.0 - cosine**2), 0.0, cosine])
        half = light + view
        half /= np.linalg.norm(half, axis=-1, keepdims=True)
        values = reflectance(light[..., 2], cosine, half[..., 2], half @ view)
        sums.append(np.sum(values * light[..., 2] * weight, axis=(-2, -1)))
    return np.array(sums)


def ggx(roughness):
    """Returns the albedos of GGX with the Fresnel terms 1 and (1 - V.H)^5, for all `COSINES`."""
    squared = roughness**4

    def smith_lambda(cosine):
        return 0.5 * (np.sqrt(1.0 + squared * (1.0 / cosine**2 - 1.0)) - 1.0)

    def reflectance(light, view, half, view_half):
        distribution = squared / (np.pi * (1.0 + (squared - 1.0) * half**2) ** 2)
        masking = 1.0 / (1.0 + smith_lambda(light) + smith_lambda(view))
        lobe = distribution * masking / (4.0 * light * view)
        return np.stack([lobe, lobe * (1.0 - view_half) ** 5])

    return integrals(reflectance).T


def mean(albedo):
    """Returns the mean over the hemisphere, weighted by the cosine."""
    return np.trapz(COSINES * albedo, COSINES) / np.trapz(COSINES, COSINES)


def schlick(at_normal, whole, grazing):
    """Returns the albedo for Schlick's Fresnel term, which is 1 at grazing angles."""
    return at_normal * (whole - grazing) + grazing


def compensated(at_normal, whole, grazing):
    """Returns the albedo with the light that bounces between microfacets, after Kulla and Conty."""
    reflectance = at_normal + (1.0 - at_normal) / 21.0
    later = reflectance**2 * mean(whole) / (1.0 - reflectance * (1.0 - mean(whole)))
    return schlick(at_normal, whole, grazing) + later * (1.0 - whole)


def clear_layer(weight, roughness):
    """A clear layer above a black surface."""
    return weight * schlick(0.04, *ggx(roughness))


def dielectric(colour, roughness):
    """A Lambertian surface below a dielectric's microfacets."""
    above = compensated(0.04, *ggx(roughness))
    return np.stack([above + part * (1.0 - above) for part in colour])


def metal(colour, roughness):
    lobes = ggx(roughness)
    return np.stack([compensated(part, *lobes) for part in colour])


def sheet(colour, roughness):
    """A sheet that reflects by a dielectric's Fresnel term, and lets the rest pass, tinted by `colour`. Light that
    bounces between microfacets more than once is shared out like the other."""
    whole, grazing = ggx(roughness)
    reflected = schlick(0.04, whole, grazing)
    return np.stack([(reflected + part * (whole - reflected)) / whole for part in colour])


def sheen(roughness):
    """Upright fibres above a black surface (Estevez, Kulla, 2017)."""
    width = roughness**2
    weight = (1.0 - width) ** 2
    narrow, wide = (25.3245, 3.32435, 0.16801, -1.27393, -4.85967), (21.5473, 3.82987, 0.19823, -1.97760, -4.32054)
    a, b, c, d, e = (weight * n + (1.0 - weight) * w for n, w in zip(narrow, wide))

    def exponent(cosine):
        return a / (1.0 + b * cosine**c) + d * cosine + e

    def smith_lambda(cosine):
        return np.exp(np.where(cosine < 0.5, exponent(cosine), 2.0 * exponent(0.5) - exponent(1.0 - cosine)))

    def reflectance(light, view, half, _):
        sine = np.sqrt(np.maximum(1.0 - half**2, 0.0))
        distribution = (2.0 + 1.0 / width) * sine ** (1.0 / width) / (2.0 * np.pi)
        return distribution / (1.0 + smith_lambda(light) + smith_lambda(view)) / (4.0 * light * view)

    return integrals(reflectance)


def exact_fresnel(cosine, eta):
    """Returns the reflectance of a smooth dielectric, and the cosine of the refracted light, 0 in total reflection.
    `eta`: index on the viewer's side divided by that beyond."""
    refracted = np.sqrt(np.maximum(1.0 - eta**2 * (1.0 - cosine**2), 0.0))
    cosine = np.maximum(cosine, 1e-9)
    across = (eta * cosine - refracted) / (eta * cosine + refracted)
    along = (cosine - eta * refracted) / (cosine + eta * refracted)
    return np.where(refracted > 0.0, 0.5 * (across**2 + along**2), 1.0), refracted


def boundary(roughness, eta):
    """The rough boundary of a clear solid, without anything behind it (Walter et al., 2007). Light that bounces between
    microfacets is lost. Radiance changes by `eta` squared where light is refracted."""
    squared = roughness**4
    half, weight = half_sphere()
    distribution = squared / (np.pi * (1.0 + (squared - 1.0) * half[..., 2] ** 2) ** 2)

    def smith_lambda(cosine):
        return 0.5 * (np.sqrt(1.0 + squared * (1.0 / np.maximum(cosine**2, 1e-12) - 1.0)) - 1.0)

    sums = []
    for cosine in COSINES:
        view = np.array([np.sqrt(1.0 - cosine**2), 0.0, cosine])
        at = half @ view
        reflectance, refracted = exact_fresnel(np.maximum(at, 0.0), eta)
        mirrored = 2.0 * at * half[..., 2] - cosine
        passed = (eta * at - refracted) * half[..., 2] - eta * cosine
        visible = distribution * np.maximum(at, 0.0) / cosine * weight
        masking = [1.0 / (1.0 + smith_lambda(cosine) + smith_lambda(light)) for light in (mirrored, passed)]
        sums.append(
            np.sum(visible * reflectance * masking[0], where=mirrored > 0.0)
            + eta**2 * np.sum(visible * (1.0 - reflectance) * masking[1], where=passed < 0.0)
        )
    return np.array(sums)


def of_ball(size):
    """Returns the cosines of the view to a ball of radius 1 for the subpixels of an orthographic camera's picture, and
    whether they show the ball."""
    n = size * SUBPIXELS
    at = ((np.arange(n) + 0.5) / n - 0.5) * HEIGHT
    squared = at[:, None] ** 2 + at**2
    return np.sqrt(np.maximum(1.0 - squared, 0.0)), squared < 1.0


def of_plane(size):
    """Returns the cosines of the view to an infinite, horizontal plane that fills the picture of a camera, and that all
    subpixels show it."""
    n = size * SUBPIXELS
    at = ((np.arange(n) + 0.5) / n - 0.5) * 2.0 * np.tan(np.radians(FOV) / 2.0)
    pitch = np.radians(PITCH)
    downwards = np.sin(pitch) + at[:, None] * np.cos(pitch)
    cosine = downwards / np.sqrt(1.0 + at[:, None] ** 2 + at**2)
    return cosine, np.ones_like(cosine, bool)


def picture(albedo, size, view=of_ball):
    """Returns a picture of a surface in surroundings of radiance 1. `albedo` has the values for all `COSINES`, for one
    or three colours. `view` returns the cosines of the picture's subpixels."""
    cosine, is_surface = view(size)
    shown = []
    for part in np.broadcast_to(albedo, (3, N_VIEW)):
        fine = np.where(is_surface, np.interp(cosine, COSINES, part), 1.0)
        shown.append(fine.reshape(size, SUBPIXELS, size, SUBPIXELS).mean((1, 3)))
    return np.stack(shown, -1)

"""Fits the polynomials of glsl/shared/bsdf/albedo.glsl and the table of glsl/shared/bsdf/solid_loss.glsl. Needs numpy
from PyPI. Usage: python3 tests/long/albedo_fit.py

The directional albedo of a lobe, for a viewer at the cosine mu, is computed by quasi-Monte Carlo over visible normals
(Dupuy & Benyoub 2023; the weight of a sample is F G2 / G1) or, for sheen, over the hemisphere. It is fitted by least
squares to a sum of products of powers of two variables, of which each is centred. One is r, the roughness. The other is
z = mu / (mu + r^2), since the albedo of GGX depends on the slope of the view relative to the slopes of the microfacets,
or x = 1 - mu for sheen. What a solid's boundary loses depends on three variables, and polynomials of 90 terms err by
1.6 % (root of the mean square, at cosines above 0.1) where light leaves the solid. A table of 384 nodes that is
interpolated errs by 0.5 % (above 0.05). The
script prints the coefficients and the table in GLSL and in Rust, and the errors.
"""

import numpy as np

N = 1 << 14


def sobol_like(n):
    """The R2 sequence of Roberts, two numbers a row."""
    i = np.arange(1, n + 1)[:, None]
    return (0.5 + i * np.array([0.7548776662466927, 0.5698402909980532])) % 1.0


def visible_normals(mu, a, u):
    v = np.array([np.sqrt(max(0, 1 - mu * mu)), 0.0, mu])
    s = np.array([a * v[0], a * v[1], v[2]])
    s /= np.linalg.norm(s)
    z = (1 - u[:, 1]) * (1 + s[2]) - s[2]
    t = np.sqrt(np.clip(1 - z * z, 0, 1))
    h = np.stack([t * np.cos(2 * np.pi * u[:, 0]), t * np.sin(2 * np.pi * u[:, 0]), z], 1) + s
    h = np.stack([a * h[:, 0], a * h[:, 1], h[:, 2]], 1)
    return v, h / np.linalg.norm(h, axis=1)[:, None]


def root(c, a):
    return np.sqrt(c * c * (1 - a * a) + a * a)


def g2_over_g1(mu, cos_l, a):
    """Height-correlated masking and shadowing, divided by masking; 0 below the horizon."""
    c = np.maximum(cos_l, 0)
    return np.where(c > 0, c * (mu + root(mu, a)) / (c * root(mu, a) + mu * root(c, a) + 1e-30), 0.0)


def fresnel(c, eta):
    s = 1 - eta * eta * (1 - c * c)
    t = np.sqrt(np.maximum(s, 0))
    p, q = (c - eta * t) / (c + eta * t + 1e-30), (eta * c - t) / (eta * c + t + 1e-30)
    return np.where(s > 0, 0.5 * (p * p + q * q), 1.0), t


U = sobol_like(N)


def reflection_albedo(mu, r):
    """The albedo of reflection by GGX with Fresnel term 1, and with Schlick's weight as Fresnel term."""
    a = r * r
    v, h = visible_normals(mu, a, U)
    c = h @ v
    w = g2_over_g1(mu, 2 * c * h[:, 2] - mu, a)
    return w.mean(), (w * (1 - c) ** 5).mean()


def glass_albedo(mu, r, eta):
    """The share of light that a rough boundary reflects and refracts together. eta: index of the viewer's side over
    that of the other side."""
    a = r * r
    v, h = visible_normals(mu, a, U)
    c = h @ v
    f, t = fresnel(c, eta)
    reflected = g2_over_g1(mu, 2 * c * h[:, 2] - mu, a)
    refracted = g2_over_g1(mu, -(-eta * mu + (eta * c - t) * h[:, 2]), a)
    return (f * reflected + (1 - f) * refracted).mean()


def sheen_lambda(c, a):
    t = (1 - a) ** 2
    p = [25.3245 * t + 21.5473 * (1 - t), 3.32435 * t + 3.82987 * (1 - t), 0.16801 * t + 0.19823 * (1 - t),
         -1.27393 * t - 1.97760 * (1 - t), -4.85967 * t - 4.32054 * (1 - t)]
    l = lambda x: p[0] / (1 + p[1] * np.power(x, p[2])) + p[3] * x + p[4]
    return np.where(c < 0.5, np.exp(l(np.minimum(c, 0.5))), np.exp(2 * l(0.5) - l(1 - np.maximum(c, 0.5))))


def sheen_albedo(mu, r):
    a = r * r
    v = np.array([np.sqrt(1 - mu * mu), 0.0, mu])
    z = U[:, 0]
    t = np.sqrt(1 - z * z)
    l = np.stack([t * np.cos(2 * np.pi * U[:, 1]), t * np.sin(2 * np.pi * U[:, 1]), z], 1)
    h = v + l
    h /= np.linalg.norm(h, axis=1)[:, None]
    d = (2 + 1 / a) * np.power(np.maximum(1 - h[:, 2] ** 2, 1e-12), 0.5 / a) / (2 * np.pi)
    g = 1 / (1 + sheen_lambda(np.array(mu), a) + sheen_lambda(z, a))
    return (d * g / (4 * mu) * 2 * np.pi).mean()



def fitted(columns, values, weights=1.0):
    """Coefficients of the least squares, and the fitted values."""
    a = np.stack([column.ravel() for column in columns], 1)
    w = np.broadcast_to(weights, values.shape).ravel()
    c = np.linalg.lstsq(a * w[:, None], values.ravel() * w, rcond=None)[0]
    c = c.astype(np.float32).astype(float)
    return c, (a @ c).reshape(values.shape)


def evened(columns, values, weights, n):
    """Coefficients that even out the errors, by Lawson's algorithm: n times, weights grow where errors are large."""
    by_error = np.ones(values.shape)
    for _ in range(n):
        error = abs(fitted(columns, values, np.sqrt(by_error * weights))[1] - values) * weights
        by_error *= (error / error.max() + 1e-3) ** 0.3
        by_error /= by_error.max()
    return fitted(columns, values, np.sqrt(by_error * weights))


def centred(x):
    """A variable of [-1, 1] for one of [0, 1]. Its polynomials have small coefficients, which round little."""
    return 2 * x - 1


def nodes_of(n):
    """Chebyshev's nodes in [0, 1], which are dense at the ends, where polynomials err most."""
    return (1 - np.cos(np.pi * (np.arange(n) + 0.5) / n)) / 2


def number(value):
    """The shortest decimal that is this number in single precision."""
    return np.format_float_positional(np.float32(value), unique=True, trim="0")


def polynomial(row, language):
    """A polynomial in 2 r - 1. `powers` are the powers 1 to 4 of this variable, `fifth` the fifth."""
    middle = ", ".join(number(value) for value in row[1:5])
    product = f"dot(vec4({middle}), powers)" if language == "GLSL" else f"Vec4::new({middle}).dot(powers)"
    return f"{number(row[0])} + {product}" + (f" + {number(row[5])} * fifth" if len(row) > 5 else "")


def printed(name, rows):
    """Prints the polynomials in r, one for each power of the other variable from the highest on, in both languages."""
    for language, first, more in (("GLSL", "float y = ", "y = y * z + "), ("Rust", "let y = ", "let y = y * z + ")):
        for ix, row in enumerate(rows[::-1]):
            print(f"    {first if ix == 0 else more}{polynomial(row, language)};   // {language} {name}")


def report(name, found, exact):
    error = abs(found - exact)
    print(f"{name}: greatest error {error.max():.4f}, root of the mean square {np.sqrt((error ** 2).mean()):.4f}")


# Numbers of nodes of the table of losses of a solid's boundary: roots of the cosine, roughnesses, indices.
LOSS_NODES = (8, 8, 6)
# The greatest index of the table.
MOST_INDEX = 2.6


def hats(x, n):
    """The share of each of n nodes, spread evenly from 0 to 1, in the linear interpolation at x."""
    return np.maximum(0, 1 - abs(x[:, None] * (n - 1) - np.arange(n)))


def solid_losses(leaves):
    """The table of the shares that a solid's boundary loses, first index fastest, and the errors of interpolation
    relative to what is left. leaves: whether the light's path, followed from the viewer, leaves the solid."""
    mus, rs = nodes_of(32), np.append(nodes_of(20), 1.0)
    indices = np.array([1.001, 1.05, 1.1, 1.2, 1.35, 1.5, 1.65, 1.8, 2.0, 2.3, 2.6])
    losses = np.array([[[1 - glass_albedo(mu, r, n if leaves else 1 / n) for mu in mus] for r in rs] for n in indices])
    n, r, mu = (axis.ravel() for axis in np.meshgrid(indices, rs, mus, indexing="ij"))
    places = (np.sqrt(mu), r, np.sqrt((1 - 1 / n) / (1 - 1 / MOST_INDEX)))
    of_mu, of_r, of_n = (hats(place, nodes) for place, nodes in zip(places, LOSS_NODES))
    shares = (of_n[:, :, None, None] * of_r[:, None, :, None] * of_mu[:, None, None, :]).reshape(mu.size, -1)
    # A perfectly smooth boundary loses nothing.
    is_smooth = (np.arange(shares.shape[1]) // LOSS_NODES[0]) % LOSS_NODES[1] == 0
    shares[:, is_smooth] = 0
    # Rays that graze the surface are few.
    left = 1 - losses.ravel()
    weights = (0.2 + mu) / left
    table = np.linalg.lstsq(shares * weights[:, None], losses.ravel() * weights, rcond=None)[0]
    table = np.where(is_smooth, 0, np.round(np.clip(table, 0, 1) * 65535) / 65535)
    return table, (shares @ table - losses.ravel()) / left


def print_losses():
    """Prints the table as pairs of numbers of 16 bits: first where light enters, then where it leaves."""
    tables = []
    for leaves in (False, True):
        table, errors = solid_losses(leaves)
        report(f"solid, {'leaves' if leaves else 'enters'}", errors, 0)
        tables.append(table)
    numbers = np.round(np.concatenate(tables) * 65535).astype(int)
    pairs = [f"0x{high:04x}{low:04x}" for low, high in numbers.reshape(-1, 2)]
    for language, end in (("GLSL", "u"), ("Rust", "")):
        print(f"// {language}")
        for first in range(0, len(pairs), 8):
            print("    " + " ".join(pair + end + "," for pair in pairs[first : first + 8]))


def main():
    mus, rs = nodes_of(48), np.append(nodes_of(40), 1.0)
    table = np.array([[reflection_albedo(mu, r) for mu in mus] for r in rs])
    r, mu = np.meshgrid(rs, mus, indexing="ij")
    z = mu / (mu + r * r)
    columns = [(1 - z) * centred(z) ** i * centred(r) ** j for i in range(6) for j in range(6)]
    smooth = (1 - mu) ** 5
    fits = []
    for name, values in (("loss", 1 - table[..., 0]), ("grazing", table[..., 1] - smooth)):
        c, found = evened(columns, values, 0.5 + mu, 0 if name == "loss" else 6)
        printed(name, c.reshape(6, 6))
        report(name, found, values)
        fits.append(c)
    # The averages over the hemisphere, weighted by the cosine, are those of the fits, so that the compensation has
    # exactly the albedo of the loss.
    nodes, weights = np.polynomial.legendre.leggauss(200)
    nodes, weights = (nodes + 1) / 2, weights / 2
    rs = np.linspace(0, 1, 65)[1:]
    r, mu = np.meshgrid(rs, nodes, indexing="ij")
    z = mu / (mu + r * r)
    columns = [(1 - z) * centred(z) ** i * centred(r) ** j for i in range(6) for j in range(6)]
    for name, c in zip(("mean loss", "mean grazing"), fits):
        value = sum(column * number for column, number in zip(columns, c))
        mean = (value * 2 * mu * weights).sum(1)
        c, found = fitted([rs * centred(rs) ** j for j in range(6)], mean, 1 / rs if name == "mean loss" else 1.0)
        for language in ("GLSL", "Rust"):
            print(f"    roughness * ({polynomial(c, language)})   // {language} {name}")
        report(name, found, mean)
    mus = ((np.arange(32) + 0.5) / 32) ** 1.5
    rs = np.linspace(LEAST_SHEEN_ROUGHNESS, 1, 25)
    r, mu = np.meshgrid(rs, mus, indexing="ij")
    values = np.array([[sheen_albedo(mu, r) for mu in mus] for r in rs])
    c, found = fitted([centred(1 - mu) ** i * centred(r) ** j for i in range(7) for j in range(5)], np.sqrt(values))
    printed("sheen", c.reshape(7, 5))
    report("sheen", np.maximum(found, 0) ** 2, values)
    print_losses()


LEAST_SHEEN_ROUGHNESS = 0.25


if __name__ == "__main__":
    main()

"""Writes the textures of room.toml and still_life.gltf, and still_life.gltf itself.

    python3 scenes/still_life.py

kdray render scenes/still_life.gltf --exposure 0.0095 --max-depth 6 --spp 16 then makes the picture.

Everything is made here from formulas, with Python's standard library alone. A second run writes the same bytes.

Lengths are metres, y is up. Images are written as PNG: colours with a palette, normals as RGB. A texture is a function
of (u, v), 0 to 1 from the upper left corner of the image to the lower right one.
"""

import base64
import json
import math
import random
import struct
import zlib
from pathlib import Path

HERE = Path(__file__).resolve().parent
TAU = 2 * math.pi

# ---- Images ----


def write_png(name, width, height, colour_type, bits, rows, chunks=()):
    """Writes a PNG. `rows` are bytes of scan lines with their filter bytes."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, bits, colour_type, 0, 0, 0)
    body = b"".join(chunk(kind, data) for kind, data in chunks)
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + body
    data += chunk(b"IDAT", zlib.compress(b"".join(rows), 9)) + chunk(b"IEND", b"")
    (HERE / "textures" / name).write_bytes(data)


def paint(name, width, height, colour, limit=64, samples=2):
    """Writes an image with a palette of at most `limit` colours.

    `colour(u, v)` returns r, g, b in sRGB and perhaps an opacity, each 0 to 1. A pixel is the mean of samples^2 points.
    Colours are rounded ever more coarsely until they fit into the palette.
    """
    pixels = []
    for y in range(height):
        for x in range(width):
            points = [
                colour((x + (i + 0.5) / samples) / width, (y + (k + 0.5) / samples) / height)
                for k in range(samples)
                for i in range(samples)
            ]
            weights = [point[3] if len(point) > 3 else 1 for point in points]
            whole = sum(weights)
            if whole == 0:
                pixels.append((*points[0][:3], 0))
                continue
            mean = [sum(point[c] * w for point, w in zip(points, weights)) / whole for c in range(3)]
            pixels.append((*mean, whole / len(points)))
    for levels in (64, 52, 43, 37, 32, 26, 22, 18, 16, 13, 11, 9, 8, 7, 6, 5):
        rounded = [tuple(round(round(c * levels) / levels * 255) for c in pixel) for pixel in pixels]
        palette = sorted(set(rounded), key=lambda c: (c[3], c))
        if len(palette) <= limit:
            break
    index = {entry: ix for ix, entry in enumerate(palette)}
    bits = 4 if len(palette) <= 16 else 8
    rows = []
    for y in range(height):
        row = [index[pixel] for pixel in rounded[y * width : (y + 1) * width]]
        if bits == 4:
            row = [a << 4 | b for a, b in zip(row[::2], row[1::2])]
        rows.append(b"\0" + bytes(row))
    chunks = [(b"PLTE", bytes(c for entry in palette for c in entry[:3]))]
    if any(entry[3] < 255 for entry in palette):
        chunks.append((b"tRNS", bytes(entry[3] for entry in palette)))
    write_png(name, width, height, 3, bits, rows, chunks)


def paint_rgb(name, width, height, colour):
    """Writes an image of 8-bit RGB without a palette. `colour(u, v)` returns three integers, 0 to 255."""
    rows = []
    before = bytes(3 * width)
    for y in range(height):
        row = bytes(c for x in range(width) for c in colour((x + 0.5) / width, (y + 0.5) / height))
        shifted = b"\0\0\0" + row[:-3]
        filtered = [
            bytes([0]) + row,
            bytes([1]) + bytes((a - b) & 255 for a, b in zip(row, shifted)),
            bytes([2]) + bytes((a - b) & 255 for a, b in zip(row, before)),
        ]
        rows.append(min(filtered, key=lambda line: sum(min(c, 256 - c) for c in line[1:])))
        before = row
    write_png(name, width, height, 2, 8, rows)


def paint_normals(name, width, height, heights, strength):
    """Writes a normal map of periodic heights. `strength` is a factor on the slope per width of the image."""

    def colour(u, v):
        e = 0.5 / width
        along_u = (heights(u + e, v) - heights(u - e, v)) / (2 * e) * strength
        along_v = (heights(u, v + e) - heights(u, v - e)) / (2 * e) * strength
        length = math.sqrt(1 + along_u * along_u + along_v * along_v)
        return [round(127.5 + 127 * c / length) for c in (-along_u, along_v, 1)]

    paint_rgb(name, width, height, colour)


def mix(a, b, t):
    return tuple(x + (y - x) * t for x, y in zip(a, b))


def clamp(x, low=0.0, high=1.0):
    return max(low, min(high, x))


def ramp(a, b, x):
    """Returns 0 below a, 1 above b, and a smooth step between them."""
    t = clamp((x - a) / (b - a))
    return t * t * (3 - 2 * t)


def hex_colour(text):
    return tuple(int(text[i : i + 2], 16) / 255 for i in (0, 2, 4))


def scatter(*key):
    """Returns a number from 0 to 1 that depends on integers alone."""
    return zlib.crc32(repr(key).encode()) / 0xFFFFFFFF


def noise(u, v, nu, nv, seed=0):
    """Returns smooth noise, 0 to 1, with period 1 in u and v and a lattice of nu by nv points."""
    x, y = u * nu, v * nv
    i, k = math.floor(x), math.floor(y)
    s, t = ramp(0, 1, x - i), ramp(0, 1, y - k)

    def at(di, dk):
        return scatter(seed, (i + di) % nu, (k + dk) % nv)

    return (at(0, 0) * (1 - s) + at(1, 0) * s) * (1 - t) + (at(0, 1) * (1 - s) + at(1, 1) * s) * t


# ---- Textures of the room ----

N_PLANKS = 7


def plank(u, v):
    """Returns a plank's number and the position in it: across 0 to 1, along 0 to 1."""
    column = math.floor(u * N_PLANKS) % N_PLANKS
    along = (v + [0.05, 0.52, 0.23, 0.78, 0.38, 0.91, 0.64][column]) % 1
    return column * 2 + (along > 0.55), u * N_PLANKS % 1, along / 0.55 if along <= 0.55 else (along - 0.55) / 0.45


def floor_colour(u, v):
    number, across, along = plank(u, v)
    tone = scatter("tone", number)
    light, dark = mix(hex_colour("b98a58"), hex_colour("c79f6d"), tone), mix(
        hex_colour("7d5130"), hex_colour("96673f"), tone
    )
    bend = 0.012 * math.sin(TAU * (v * 2 + tone)) + 0.02 * noise(u, v, 4, 3, number)
    grain = 0.55 * noise(u + bend, v, 56, 3, number) + 0.3 * noise(u + bend, v, 112, 8, 50 + number)
    grain += 0.15 * noise(u, v, 7, 4, 90)
    colour = mix(light, dark, ramp(0.25, 0.85, grain))
    gap = min(min(across, 1 - across) / 0.022, min(along, 1 - along) / 0.0055)
    return mix(hex_colour("2e1c10"), colour, ramp(0.2, 1.0, gap))


def floor_height(u, v):
    number, across, along = plank(u, v)
    edge = min(ramp(0, 0.06, across), ramp(0, 0.06, 1 - across), ramp(0, 0.012, along), ramp(0, 0.012, 1 - along))
    tilt = (scatter("tilt", number) - 0.5) * 0.10 * across + (scatter("slope", number) - 0.5) * 0.16 * along
    return edge * 1.0 + tilt - 0.12 * (across - 0.5) ** 2 + 0.03 * noise(u, v, 5, 5, 4)


def leaf_shape(x, y, length, width):
    """Returns how far a point is inside of a leaf from (0, 0) along +y: above 0 inside, in the unit of x."""
    t = y / length
    if not 0 < t < 1:
        return -1
    return width * math.sin(math.pi * t**0.75) ** 1.1 - abs(x)


def turn(x, y, degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return c * x + s * y, c * y - s * x


def sprig(x, y):
    """Returns the wallpaper's ornament around (0, 0), 0 to 1: a stem with leaves, and a bud at its top."""
    inside = -1.0
    x = abs(x)
    inside = max(inside, 0.006 - abs(x) if -0.27 < y < 0.2 else -1)
    for at, degrees, length, width in [
        (-0.22, 62, 0.2, 0.032),
        (-0.12, 52, 0.22, 0.036),
        (-0.01, 44, 0.2, 0.034),
        (0.09, 34, 0.15, 0.028),
    ]:
        inside = max(inside, leaf_shape(*turn(x, y - at, -degrees), length, width))
    inside = max(inside, leaf_shape(x, y - 0.14, 0.19, 0.05))
    for k in range(3):
        dx, dy = x - 0.05 - 0.03 * k, y - 0.30 + 0.045 * k
        inside = max(inside, 0.011 - math.hypot(dx, dy))
    return inside


def wallpaper_colour(u, v):
    ground, light, deep = hex_colour("5d7a72"), hex_colour("8fa598"), hex_colour("4d6a64")
    colour = ground
    x, y = u, v * 1.5
    for cx, cy in [(0.5, 0.75), (0, 0), (1, 0), (0, 1.5), (1, 1.5)]:
        dx, dy = x - cx, cy - y
        # A ring of leaves as a frame, and a sprig in it
        inside = sprig(dx * 1.05, dy * 0.85)
        if inside > 0:
            vein = abs(dx) < 0.004
            colour = mix(light, ground, 0.55 if vein else 0.0)
    # An ogee of two waves in a deeper tone
    for sign in (-1, 1):
        wave = (x + sign * 0.25 * math.cos(TAU * y / 1.5)) % 1
        near = abs(wave - 0.5)
        if near < 0.014:
            colour = deep
        elif 0.020 < near < 0.026:
            colour = mix(ground, light, 0.45)
    return colour


RED, NAVY, CREAM = hex_colour("9c3d2c"), hex_colour("22314f"), hex_colour("e4d3b2")
OCHRE, TEAL, ROSE = hex_colour("c98d3a"), hex_colour("4a7a78"), hex_colour("c27a62")


def rug_colour(u, v):
    """A quarter of the rug, woven of knots: (0, 0) is its corner, (1, 1) its middle."""
    n_x, n_y = 96, 64
    x, y = math.floor(u * n_x), math.floor(v * n_y)
    edge = min(x, y)
    along = x if y <= x else y
    worn = 0.93 + 0.14 * scatter("worn", y // 2) - 0.06 * scatter("knot", x, y)
    if edge < 2:
        colour = NAVY
    elif edge < 9:
        tooth = abs((along + 3) % 12 - 6)
        colour = OCHRE if edge - 2 < tooth else RED
    elif edge < 11:
        colour = CREAM
    elif edge < 21:
        d = abs(along % 14 - 7) + abs(edge - 15.5)
        colour = CREAM if d < 2.6 else TEAL if d < 4.6 else OCHRE if d < 6 else NAVY
    elif edge < 23:
        colour = CREAM
    elif edge < 25:
        colour = RED if along % 4 < 2 else OCHRE
    else:
        dx, dy = n_x - 1 - x, n_y - 1 - y
        d = dx * 0.62 + dy
        small = abs(dx % 16 - 8) + abs(dy % 14 - 7)
        if d < 6:
            colour = CREAM
        elif d < 12:
            colour = RED
        elif d < 14:
            colour = CREAM
        elif d < 22:
            colour = TEAL if (dx // 2 + dy // 2) % 3 else OCHRE
        elif d < 24:
            colour = CREAM
        elif d < 36:
            colour = NAVY if small > 3 else ROSE
        elif d < 38:
            colour = OCHRE
        else:
            colour = CREAM if small < 2 else OCHRE if small < 4 else RED
    return tuple(clamp(c * worn) for c in colour)


def picture_colour(u, v):
    """A painting of hills and a lake before sunset, in flat tones."""
    sky = mix(hex_colour("2f5d78"), hex_colour("f2b56b"), ramp(0.0, 0.55, v))
    colour = mix(sky, hex_colour("f7d9a0"), 0.8 * ramp(0.45, 0.1, math.hypot((u - 0.63) * 1.3, v - 0.44)))
    if math.hypot((u - 0.63) * 1.35, v - 0.42) < 0.085:
        colour = hex_colour("fff1cf")
    for k, (y0, y1) in enumerate([(0.12, 0.15), (0.2, 0.222), (0.27, 0.3)]):
        at, half = [0.28, 0.74, 0.2][k], [0.2, 0.17, 0.13][k]
        t = (u - at) / half
        if abs(t) < 1 and y0 - 0.012 * math.sin(9 * t) * (1 - t * t) < v < y1:
            colour = mix(colour, hex_colour("f7c79a"), 0.75)
    hills = [
        (0.50, 0.05, 2.3, 0.2, "8c6f86"),
        (0.545, 0.06, 1.7, 1.9, "6a5a7c"),
        (0.59, 0.035, 3.1, 4.0, "463f63"),
    ]
    for base, height, waves, phase, tone in hills:
        if v > base - height * math.sin(waves * math.pi * u + phase) - 0.35 * height * math.sin(7 * u + 2 * phase):
            colour = hex_colour(tone)
    if v > 0.62:
        depth = (v - 0.62) / 0.38
        colour = mix(hex_colour("c98a6a"), hex_colour("23415c"), depth**0.7)
        glitter = 0.03 + 0.10 * depth
        stripe = math.sin(70 * depth**0.6 + 2.0 * math.sin(5 * u)) > 0.1 + 0.5 * depth
        if abs(u - 0.63) < glitter * (1.2 + math.sin(40 * depth)) and stripe:
            colour = hex_colour("fbe0ae")
        elif stripe and scatter("wave", math.floor(u * 9), math.floor(22 * depth**0.6)) > 0.55:
            colour = mix(colour, hex_colour("e0a07a"), 0.45)
    shore = 0.9 + 0.05 * math.sin(3 * u + 0.5) - 0.10 * ramp(0.35, 0.0, u)
    if v > shore:
        colour = hex_colour("1c2433")
    for at, height, width in [(0.10, 0.62, 0.035), (0.19, 0.48, 0.028), (0.04, 0.42, 0.025)]:
        t = (shore + 0.02 - v) / height
        if 0 < t < 1 and abs(u - at) < width * (1 - t) ** 0.8 * (0.75 + 0.25 * math.cos(60 * t)):
            colour = hex_colour("1c2433")
    return colour


def view_colour(u, v):
    """What the window shows: sky, clouds, hills and trees."""
    colour = mix(hex_colour("8fbfe6"), hex_colour("e8f1f4"), ramp(0.0, 0.6, v))
    cloud = 0.6 * noise(u, v, 5, 9, 7) + 0.4 * noise(u, v, 11, 19, 8)
    colour = mix(colour, (1, 1, 1), 0.85 * ramp(0.52, 0.72, cloud) * ramp(0.62, 0.35, v))
    hills = [(0.60, 0.06, "b9cdd2"), (0.66, 0.05, "9dbdaa"), (0.73, 0.045, "86ad78"), (0.82, 0.05, "6b9a57")]
    for k, (base, height, tone) in enumerate(hills):
        if v > base + height * (noise(u, 0.5, 6 + 3 * k, 1, 20 + k) - 0.5) * 2:
            colour = mix(hex_colour(tone), hex_colour("dfe8c0"), 0.25 * noise(u, v, 40, 30, k))
    return colour


def frond_colour(u, v):
    """A palm's frond, from its foot (v = 0) to its tip, with leaflets; transparent between them."""
    x, side = abs(u - 0.5) * 2, u > 0.5
    n = 17
    inside = 0.022 * (1.1 - v) - x * 0.5 if v < 0.97 else -1
    shade = 0.35
    reach = 0.95 * ramp(-0.02, 0.22, v) * (1 - ramp(0.45, 1.08, v)) ** 0.8
    # A leaflet leaves the rib at v = foot and goes on towards the tip.
    for k in range(n):
        foot = 0.10 + 0.84 * (k + (0.5 if side else 0)) / n
        length = 0.95 * ramp(0.0, 0.30, foot + 0.08) * (1 - 0.72 * ramp(0.4, 1.0, foot))
        t = x / max(length, 1e-6)
        if t >= 1:
            continue
        middle = foot + 0.115 * t**1.25 * (length / 0.95)
        width = 0.0205 * math.sin(math.pi * (0.16 + 0.84 * t)) ** 0.8
        near = width - abs(v - middle)
        if near > 0:
            inside = max(inside, near)
            shade = 0.35 + 0.35 * (abs(v - middle) / width) + 0.3 * scatter("leaflet", k, side) - 0.2 * t
    colour = mix(hex_colour("2f5a2a"), hex_colour("86a84e"), clamp(shade))
    return (*colour, 1 if inside > 0 else 0)


def weave_height(u, v):
    """Threads over and under, 8 by 8 of them."""
    x, y = u * 8, v * 8
    over = (math.floor(x) + math.floor(y)) % 2
    a, b = math.sin(math.pi * (x % 1)), math.sin(math.pi * (y % 1))
    return a**0.5 * (0.6 + 0.4 * b) if over else b**0.5 * (0.6 + 0.4 * a)


def write_room_textures():
    paint("floor.png", 256, 256, floor_colour, 96, 1)
    paint_normals("floor_normal.png", 256, 256, floor_height, 0.0035)
    paint("wallpaper.png", 128, 192, wallpaper_colour, 16, 3)
    paint("rug.png", 192, 128, rug_colour, 64, 1)
    paint("painting.png", 224, 160, picture_colour, 128, 3)
    paint("view.png", 256, 128, view_colour, 64, 2)
    paint("frond.png", 128, 256, frond_colour, 32, 3)
    paint_normals("weave_normal.png", 64, 64, weave_height, 0.05)


# ---- Textures of the still life ----


def linen_colour(u, v):
    """Linen with blue stripes along v."""
    thread = 0.5 + 0.25 * noise(u, v, 64, 3, 1) + 0.25 * noise(u, v, 3, 64, 2)
    colour = mix(hex_colour("d9cdb8"), hex_colour("f2eadb"), thread)
    x = abs(u - 0.5)
    if x < 0.055 or 0.085 < x < 0.1 or 0.125 < x < 0.132:
        colour = mix(hex_colour("34558a"), hex_colour("5577a8"), thread)
    return colour


def wall_colour(u, v):
    mottled = 0.5 * noise(u, v, 4, 4, 3) + 0.3 * noise(u, v, 9, 9, 4) + 0.2 * noise(u, v, 23, 23, 5)
    return mix(hex_colour("66736d"), hex_colour("88948a"), ramp(0.15, 0.85, mottled))


GLAZE, COBALT, PALE = hex_colour("f3f1ea"), hex_colour("24479b"), hex_colour("88a4d8")


def vase_colour(u, v):
    """Blue painting on white: bands, petals, and tendrils around the belly."""
    colour = GLAZE
    for at, half, tone in [
        (0.025, 0.02, COBALT),
        (0.20, 0.006, COBALT),
        (0.222, 0.004, PALE),
        (0.36, 0.005, COBALT),
        (0.80, 0.005, COBALT),
        (0.965, 0.02, COBALT),
    ]:
        if abs(v - at) < half:
            colour = tone
    # Petals that hang from the shoulder and stand on the foot
    for n, top, height, way in [(12, 0.232, 0.115, 1), (14, 0.955, 0.135, -1)]:
        x, y = (u * n % 1 - 0.5), (v - top) * way / height
        if 0 < y < 1:
            width = 0.46 * math.sqrt(max(0, 1 - y * y))
            if abs(x) < width:
                colour = COBALT if width - abs(x) < 0.09 or (abs(x) < 0.05 and y < 0.6) else PALE
    # Flowers with tendrils
    n = 5
    cell, x = math.floor(u * n), (u * n % 1 - 0.5) * 0.62
    y = v - 0.575
    tendril = 0.10 * math.sin(TAU * u * n)
    if abs(y - tendril) < 0.0065:
        colour = COBALT
    for k in range(8):
        at = (k + 0.5) / 8
        lx, ly = (u * n % 1 - at) * 0.62, y - 0.10 * math.sin(TAU * at)
        degrees = (35 if k % 2 else 145) + 30 * math.cos(TAU * at)
        inside = leaf_shape(*turn(lx, ly, degrees), 0.10, 0.021)
        if inside > 0:
            colour = COBALT if inside < 0.006 else PALE
    fx, fy = (u * n + 0.5) % 1 - 0.5, y
    for cx, cy, size in [(0.25, 0.028, 1.0), (-0.25, -0.028, 1.0)]:
        dx, dy = (fx - cx) * 0.62, fy - cy
        r, angle = math.hypot(dx, dy), math.atan2(dy, dx)
        petal = size * (0.050 + 0.014 * math.cos(6 * angle))
        if r < petal:
            colour = COBALT if petal - r < 0.008 or r < 0.012 else PALE if r > 0.024 else GLAZE
    return colour


def vase_height(u, v):
    return 0.5 * math.sin(TAU * v * 2 + 0.6 * math.sin(TAU * u)) + 0.12 * noise(u, v, 6, 6, 31)


def hammer_height(u, v):
    """Dimples around the points of a shaken lattice."""
    n, best = 9, 9.0
    i, k = math.floor(u * n), math.floor(v * n)
    for di in (-1, 0, 1):
        for dk in (-1, 0, 1):
            cell = ((i + di) % n, (k + dk) % n)
            x = i + di + 0.5 + 0.95 * (scatter("x", *cell) - 0.5) - u * n
            y = k + dk + 0.5 + 0.95 * (scatter("y", *cell) - 0.5) - v * n
            best = min(best, x * x + y * y)
    return min(best, 0.8)


def brass_roughness(u, v):
    rough = 0.10 + 0.10 * ramp(0.45, 0.8, 0.6 * noise(u, v, 6, 6, 11) + 0.4 * noise(u, v, 17, 17, 12))
    return 0, round(rough * 255 / 6) * 6, 255


def apple_colour(u, v):
    streak = 0.5 * noise(u, v, 42, 3, 6) + 0.25 * noise(u, v, 90, 5, 8)
    blush = 0.5 + 0.45 * math.sin(TAU * u) + 0.5 * (streak - 0.4) - 0.5 * ramp(0.30, 0.0, v)
    colour = mix(hex_colour("d9b04a"), hex_colour("a81e22"), ramp(0.1, 0.75, blush + 0.15))
    if scatter("speck", math.floor(u * 60), math.floor(v * 36)) > 0.955:
        colour = mix(colour, hex_colour("f0d090"), 0.55)
    return mix(colour, hex_colour("7f7a35"), ramp(0.07, 0.0, v))


def pear_colour(u, v):
    blotch = 0.6 * noise(u, v, 5, 5, 14) + 0.4 * noise(u, v, 14, 14, 15)
    colour = mix(hex_colour("a9ae3e"), hex_colour("cfc05a"), blotch)
    colour = mix(
        colour, hex_colour("b8663a"), 0.75 * ramp(0.25, 0.95, 0.5 + 0.5 * math.sin(TAU * u + 1)) * ramp(0.3, 0.7, v)
    )
    if scatter("dot", math.floor(u * 80), math.floor(v * 60)) > 0.93:
        colour = mix(colour, hex_colour("6b5a2a"), 0.5)
    return mix(colour, hex_colour("6b5a2a"), ramp(0.05, 0.0, v))


def pore_height(u, v):
    n, best = 14, 9.0
    i, k = math.floor(u * n), math.floor(v * n)
    for di in (-1, 0, 1):
        for dk in (-1, 0, 1):
            cell = ((i + di) % n, (k + dk) % n)
            x = i + di + 0.2 + 0.6 * scatter("px", *cell) - u * n
            y = k + dk + 0.2 + 0.6 * scatter("py", *cell) - v * n
            best = min(best, math.hypot(x, y))
    return ramp(0.0, 0.45, best)


def slice_colour(u, v):
    """The cut face of an orange."""
    x, y = u - 0.5, v - 0.5
    r, angle = math.hypot(x, y) * 2, math.atan2(y, x) / TAU
    n = 10
    across = abs((angle * n + 0.25) % 1 - 0.5) * 2  # 0 in the middle of a segment, 1 at its wall
    wall = (1 - across) * r / n * math.pi
    if r > 0.94:
        return hex_colour("e58a1e")
    if r > 0.86 or r < 0.07 or wall < 0.012:
        return hex_colour("f6e3b8")
    grain = noise((angle * 3) % 1, r, 60, 7, 17)
    colour = mix(hex_colour("e8821a"), hex_colour("f9b548"), grain)
    return mix(colour, hex_colour("f6d79a"), ramp(0.03, 0.012, wall))


def leaf_colour(u, v):
    """A leaf along u from its stalk to its tip."""
    inside = leaf_shape((v - 0.5) * 0.5, u, 1.0, 0.22)
    vein = abs(v - 0.5) < 0.02 or abs(((u - abs(v - 0.5) * 0.8) * 9) % 1 - 0.5) < 0.06
    colour = mix(hex_colour("3f6b38"), hex_colour("7f9c5f"), 0.45 * noise(u, v, 8, 8, 1) + (0.5 if vein else 0.0))
    return (*colour, 1 if inside > 0 else 0)


def write_still_life_textures():
    paint("linen.png", 128, 128, linen_colour, 96, 1)
    paint("wall.png", 128, 128, wall_colour, 48, 1)
    paint("vase.png", 512, 256, vase_colour, 16, 2)
    paint_normals("vase_normal.png", 64, 64, vase_height, 0.012)
    paint_normals("brass_normal.png", 128, 128, hammer_height, 0.016)
    paint_rgb("brass_roughness.png", 64, 64, brass_roughness)
    paint("apple.png", 128, 96, apple_colour, 128, 2)
    paint("pear.png", 128, 96, pear_colour, 128, 2)
    paint_normals("pore_normal.png", 64, 64, pore_height, 0.02)
    paint("slice.png", 128, 128, slice_colour, 64, 2)
    paint("leaf.png", 64, 32, leaf_colour, 32, 3)


# ---- Shapes: (positions, normals, texture coordinates, triangles) ----


def spline(points, steps):
    """Returns the points of Catmull-Rom curves with their unit normals, in runs that end at sharp edges.

    A point that is given twice is a sharp edge. The outside is to the left of the way.
    """
    runs, run = [], [points[0]]
    for a, b in zip(points, points[1:]):
        if a == b:
            runs.append(run)
            run = []
        run.append(b)
    runs.append(run)
    for run in runs:

        def beyond(end, inner):
            return (-inner[0], inner[1]) if end[0] == 0 else (2 * end[0] - inner[0], 2 * end[1] - inner[1])

        p = [beyond(run[0], run[1]), *run, beyond(run[-1], run[-2])]
        curve = []
        for i in range(1, len(p) - 2):
            n = 1 if len(run) == 2 else steps
            for s in range(n + (i == len(p) - 3)):
                t = s / n
                at, way = [], []
                for a, b, c, d in zip(*p[i - 1 : i + 3]):
                    linear, square, cube = (c - a) / 2, a - 2.5 * b + 2 * c - 0.5 * d, (d - a) / 2 + 1.5 * (b - c)
                    at.append(b + t * (linear + t * (square + t * cube)))
                    way.append(linear + t * (2 * square + 3 * t * cube))
                length = math.hypot(*way) or 1
                normal = (-way[1] / length, way[0] / length)
                if at[0] < 1e-9:
                    normal = (0, math.copysign(1, normal[1]))
                curve.append((max(at[0], 0), at[1], *normal))
        yield curve


def lathe(points, segments, steps=4, wobble=None):
    """Turns a profile about the y axis. v grows with the length of the profile."""
    positions, normals, uvs, triangles = [], [], [], []
    curves = list(spline(points, steps))
    whole = sum(math.dist(a[:2], b[:2]) for curve in curves for a, b in zip(curve, curve[1:]))
    so_far = 0
    for curve in curves:
        for row, (r, y, nr, ny) in enumerate(curve):
            if row:
                so_far += math.dist(curve[row - 1][:2], (r, y))
            for k in range(segments + 1):
                c, s = math.cos(TAU * k / segments), math.sin(TAU * k / segments)
                positions.append((r * s, y, r * c))
                normals.append((nr * s, ny, nr * c))
                u = k / segments + (0.5 / segments if r == 0 and row == 0 else 0)
                uvs.append((min(u, 1), so_far / whole))
                if row and k:
                    b = len(positions) - 1
                    a = b - segments - 1
                    if curve[row - 1][0] > 0:
                        triangles.append((a - 1, b, a) if r == 0 else (a - 1, b - 1, a))
                    if r > 0:
                        triangles.append((a, b - 1, b))
    return positions, normals, uvs, triangles


def grid(n_u, n_v, point):
    """Returns a surface of n_u by n_v fields. `point(u, v)` returns its points; its front is on the right of u x v."""
    positions, normals, uvs, triangles = [], [], [], []
    for k in range(n_v + 1):
        for i in range(n_u + 1):
            u, v, e = i / n_u, k / n_v, 1e-4
            du = [b - a for a, b in zip(point(u - e, v), point(u + e, v))]
            dv = [b - a for a, b in zip(point(u, v - e), point(u, v + e))]
            normal = (dv[1] * du[2] - dv[2] * du[1], dv[2] * du[0] - dv[0] * du[2], dv[0] * du[1] - dv[1] * du[0])
            length = math.hypot(*normal) or 1
            positions.append(point(u, v))
            normals.append(tuple(c / length for c in normal))
            uvs.append((u, v))
            if i and k:
                d = len(positions) - 1
                a, b, c = d - n_u - 2, d - n_u - 1, d - 1
                triangles += [(a, c, d), (a, d, b)]
    return positions, normals, uvs, triangles


def joined(*parts):
    positions, normals, uvs, triangles = [], [], [], []
    for p, n, t, f in parts:
        triangles += [tuple(ix + len(positions) for ix in face) for face in f]
        positions, normals, uvs = positions + p, normals + n, uvs + t
    return positions, normals, uvs, triangles


def tube(path, radius, sides, n):
    """A tube along `path(t)`, t from 0 to 1, that tapers to half its radius."""

    def point(u, v):
        at, ahead = path(v), path(v + 1e-3)
        way = [b - a for a, b in zip(at, ahead)]
        length = math.hypot(*way)
        way = [c / length for c in way]
        side = (way[2], 0, -way[0]) if abs(way[1]) < 0.95 else (1, 0, 0)
        dot = sum(a * b for a, b in zip(side, way))
        side = [s - dot * w for s, w in zip(side, way)]
        length = math.hypot(*side)
        side = [c / length for c in side]
        up = (
            way[1] * side[2] - way[2] * side[1],
            way[2] * side[0] - way[0] * side[2],
            way[0] * side[1] - way[1] * side[0],
        )
        c, s, r = math.cos(TAU * u), math.sin(TAU * u), radius * (1 - 0.5 * clamp(v))
        return tuple(a + r * (c * b + s * d) for a, b, d in zip(at, side, up))

    return grid(sides, n, point)


# ---- The glTF file ----


class Gltf:
    """A glTF document whose geometry is one buffer of 16-bit integers, within the file."""

    def __init__(self):
        self.buffer = bytearray()
        self.extensions = set()
        self.lights = []
        self.sampler = {"magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497}
        self.json = {
            name: [] for name in ("nodes", "meshes", "materials", "textures", "images", "accessors", "bufferViews")
        }
        self.n_triangles = 0

    def add(self, kind, value):
        self.json[kind].append(value)
        return len(self.json[kind]) - 1

    def texture(self, name, tiles=None, offset=None, **keys):
        uri = f"textures/{name}"
        known = [image["uri"] for image in self.json["images"]]
        if uri not in known:
            self.add("textures", {"source": self.add("images", {"uri": uri}), "sampler": 0})
            known.append(uri)
        info = {"index": known.index(uri), **keys}
        if tiles:
            self.extensions.add("KHR_texture_transform")
            transform = {"scale": tiles} if not offset else {"scale": tiles, "offset": offset}
            info["extensions"] = {"KHR_texture_transform": transform}
        return info

    def material(self, name, colour=(1, 1, 1), metallic=0.0, roughness=0.5, pbr=None, extensions=None, **keys):
        factors = {"baseColorFactor": [*colour, 1], "metallicFactor": metallic, "roughnessFactor": roughness}
        extensions = {f"KHR_materials_{key}": value for key, value in (extensions or {}).items()}
        self.extensions.update(extensions)
        if extensions:
            keys["extensions"] = extensions
        return self.add("materials", {"name": name, "pbrMetallicRoughness": {**factors, **(pbr or {})}, **keys})

    def accessor(self, data, target, **keys):
        view = {"buffer": 0, "byteOffset": len(self.buffer), "byteLength": len(data), "target": target}
        if "stride" in keys:
            view["byteStride"] = keys.pop("stride")
        self.buffer += data + bytes(-len(data) % 4)
        return self.add("accessors", {"bufferView": self.add("bufferViews", view), **keys})

    def mesh(self, name, part, material):
        """Adds a mesh. Returns its index and the scale that its nodes need."""
        positions, normals, uvs, triangles = part
        scale = max(abs(c) for p in positions for c in p)
        quantized = [[round(c / scale * 32767) for c in p] for p in positions]
        bounds = {key: [f(p[c] for p in quantized) for c in range(3)] for key, f in (("min", min), ("max", max))}
        ints = {"componentType": 5122, "count": len(positions), "type": "VEC3", "normalized": True, "stride": 8}
        at = self.accessor(b"".join(struct.pack("<3hxx", *p) for p in quantized), 34962, **ints, **bounds)
        data = b"".join(struct.pack("<3hxx", *(round(c * 32767) for c in n)) for n in normals)
        normal = self.accessor(data, 34962, **ints)
        data = b"".join(struct.pack("<2H", *(round(clamp(c) * 65535) for c in t)) for t in uvs)
        ints = {"componentType": 5123, "count": len(uvs), "type": "VEC2", "normalized": True}
        uv = self.accessor(data, 34962, **ints)
        data = b"".join(struct.pack("<3H", *t) for t in triangles)
        index = self.accessor(data, 34963, componentType=5123, count=3 * len(triangles), type="SCALAR")
        attributes = {"POSITION": at, "NORMAL": normal, "TEXCOORD_0": uv}
        primitive = {"attributes": attributes, "indices": index, "material": material}
        return self.add("meshes", {"name": name, "primitives": [primitive]}), scale, len(triangles)

    def place(self, mesh, at=(0, 0, 0), turn=(0, 0, 0), scale=1.0, name=None):
        """Shows a mesh, turned about x, then z, then y, in degrees."""
        ix, size, n_triangles = mesh
        self.n_triangles += n_triangles
        node = {"mesh": ix, "translation": [round(c, 5) for c in at], "scale": [round(size * scale, 7)] * 3}
        if name:
            node["name"] = name
        if any(turn):
            node["rotation"] = quaternion(*turn)
        self.add("nodes", node)

    def light(self, kind, at=None, towards=None, **keys):
        self.extensions.add("KHR_lights_punctual")
        if (kind, keys) not in self.lights:
            self.lights.append((kind, keys))
        node = {"extensions": {"KHR_lights_punctual": {"light": self.lights.index((kind, keys))}}}
        if at:
            node["translation"] = [round(c, 4) for c in at]
        if towards:
            node["rotation"] = looking(towards)
        self.add("nodes", node)

    def camera(self, eye, target, vertical_fov):
        perspective = {"yfov": round(math.radians(vertical_fov), 5), "aspectRatio": 1.33333, "znear": 0.01}
        self.json["cameras"] = [{"type": "perspective", "perspective": perspective}]
        towards = [b - a for a, b in zip(eye, target)]
        self.add("nodes", {"name": "camera", "camera": 0, "translation": eye, "rotation": looking(towards)})

    def write(self, name):
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.buffer).decode()
        document = {
            "asset": {"version": "2.0", "generator": "scenes/still_life.py"},
            "extensionsUsed": sorted(self.extensions | {"KHR_mesh_quantization"}),
            "extensionsRequired": ["KHR_mesh_quantization"],
            "extensions": {"KHR_lights_punctual": {"lights": [{"type": kind, **keys} for kind, keys in self.lights]}},
            "scene": 0,
            "scenes": [{"nodes": list(range(len(self.json["nodes"])))}],
            "samplers": [self.sampler],
            **self.json,
            "buffers": [{"byteLength": len(self.buffer), "uri": uri}],
        }
        # One line for each node, mesh and so on
        lines = []
        for key, value in document.items():
            if isinstance(value, list) and value and isinstance(value[0], dict):
                items = ",\n".join("    " + json.dumps(item) for item in value)
                lines.append(f'  "{key}": [\n{items}\n  ]')
            else:
                lines.append(f'  "{key}": {json.dumps(value)}')
        (HERE / name).write_text("{\n" + ",\n".join(lines) + "\n}\n")


def product(a, b):
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def about(axis, degrees):
    half = math.radians(degrees) / 2
    return (*(math.sin(half) * c for c in axis), math.cos(half))


def quaternion(x, y, z):
    """Returns the rotation about x, then z, then y, in degrees."""
    q = product(about((0, 1, 0), y), product(about((0, 0, 1), z), about((1, 0, 0), x)))
    return [round(c, 6) for c in q]


def looking(towards):
    """Returns the rotation that turns -z to a direction and keeps x level."""
    x, y, z = towards
    yaw = math.degrees(math.atan2(-x, -z))
    pitch = math.degrees(math.atan2(y, math.hypot(x, z)))
    return [round(c, 6) for c in product(about((0, 1, 0), yaw), about((1, 0, 0), pitch))]


# ---- The still life ----

TABLE_FRONT = 0.40


def cloth_point(u, v):
    """The table cloth: flat on the table, in folds before its edge."""
    x, way = (u - 0.5) * 2.6, v * 1.25
    flat = 0.95
    round_part = 0.035
    if way < flat:
        crease = 0.0016 * math.exp(-((((x * 0.9 + 0.1) % 0.5 - 0.25) / 0.02) ** 2))
        return x, crease + 0.0012 * math.sin(7 * x + 3 * way), TABLE_FRONT - flat + way
    t = way - flat
    angle = min(t / round_part, math.pi / 2)
    y = -round_part * (1 - math.cos(angle)) - max(0, t - round_part * math.pi / 2)
    z = TABLE_FRONT + round_part * math.sin(angle)
    fold = ramp(0.0, 0.25, t) * 0.035
    return x, y, z + fold * (1 + math.sin(19 * x + 1.2 * math.sin(5 * x)))


BOWL = [
    (0, 0.030),
    (0.06, 0.033),
    (0.12, 0.058),
    (0.165, 0.115),
    (0.172, 0.118),
    (0.174, 0.113),
    (0.130, 0.050),
    (0.075, 0.022),
    (0.05, 0.016),
    (0.05, 0.016),
    (0.055, 0.006),
    (0.062, 0.0),
    (0.062, 0.0),
    (0.0, 0.0),
]
VASE = [
    (0.0, 0.02),
    (0.05, 0.03),
    (0.055, 0.25),
    (0.036, 0.315),
    (0.045, 0.352),
    (0.049, 0.358),
    (0.053, 0.352),
    (0.041, 0.315),
    (0.062, 0.262),
    (0.098, 0.205),
    (0.102, 0.150),
    (0.075, 0.075),
    (0.054, 0.030),
    (0.058, 0.012),
    (0.058, 0.012),
    (0.058, 0.0),
    (0.058, 0.0),
    (0.0, 0.0),
]
GOBLET = [
    (0.0, 0.103),
    (0.018, 0.106),
    (0.036, 0.130),
    (0.040, 0.170),
    (0.0335, 0.214),
    (0.0342, 0.2155),
    (0.0349, 0.214),
    (0.0415, 0.170),
    (0.038, 0.127),
    (0.019, 0.099),
    (0.0055, 0.088),
    (0.0042, 0.055),
    (0.0055, 0.018),
    (0.020, 0.006),
    (0.037, 0.003),
    (0.038, 0.0015),
    (0.037, 0.0),
    (0.037, 0.0),
    (0.0, 0.0),
]
BOTTLE = [
    (0.0, 0.022),
    (0.030, 0.014),
    (0.0425, 0.022),
    (0.0435, 0.06),
    (0.0435, 0.170),
    (0.036, 0.212),
    (0.0135, 0.248),
    (0.0105, 0.310),
    (0.0125, 0.318),
    (0.016, 0.314),
    (0.0165, 0.302),
    (0.0145, 0.296),
    (0.0165, 0.255),
    (0.039, 0.217),
    (0.0475, 0.172),
    (0.0475, 0.060),
    (0.0475, 0.012),
    (0.043, 0.0),
    (0.030, 0.0),
    (0.0, 0.010),
]
APPLE = [
    (0.0, 0.0285),
    (0.006, 0.031),
    (0.016, 0.037),
    (0.028, 0.0335),
    (0.039, 0.012),
    (0.037, -0.014),
    (0.026, -0.034),
    (0.014, -0.039),
    (0.006, -0.036),
    (0.0, -0.034),
]
PEAR = [
    (0.0, 0.064),
    (0.008, 0.063),
    (0.014, 0.052),
    (0.019, 0.030),
    (0.032, 0.004),
    (0.038, -0.020),
    (0.030, -0.043),
    (0.014, -0.051),
    (0.0, -0.049),
]
LEMON = [
    (0.0, 0.043),
    (0.005, 0.040),
    (0.012, 0.033),
    (0.025, 0.019),
    (0.029, 0.0),
    (0.025, -0.019),
    (0.011, -0.033),
    (0.0, -0.038),
]


def ball(radius, low=-90, n=6):
    """Returns the profile of a sphere, or of its upper part."""
    angles = [math.radians(90 + (low - 90) * k / n) for k in range(n + 1)]
    return [(radius * max(0, round(math.cos(a), 9)), radius * math.sin(a)) for a in angles]


def leaf_part(length, width, droop):
    """A leaf along +z whose image has its stalk at u = 0."""

    def point(u, v):
        x = (v - 0.5) * width
        return x, 0.10 * length * math.sin(math.pi * u) - droop * u * u + abs(x) * 0.25, u * length

    return grid(6, 2, point)


def twig():
    """Returns a stem and its leaves, which grow towards +y and bend to +z."""

    def path(t):
        return 0.02 * math.sin(3 * t), 0.30 * t - 0.05 * t * t, 0.13 * t * t

    leaves = []
    for k in range(13):
        t = 0.30 + 0.70 * k / 12
        yaw, lift = math.radians(137.5 * k + 20), 0.75 if k < 12 else 1.4
        p, n, uvs, f = leaf_part(0.075 - 0.022 * t, 0.028, 0.012)

        def turned(q):
            x, y, z = q
            y, z = y * math.cos(lift) + z * math.sin(lift), z * math.cos(lift) - y * math.sin(lift)
            return x * math.cos(yaw) + z * math.sin(yaw), y, z * math.cos(yaw) - x * math.sin(yaw)

        at = path(t)
        leaves.append(([tuple(a + b for a, b in zip(turned(q), at)) for q in p], [turned(q) for q in n], uvs, f))
    return tube(path, 0.0022, 6, 10), joined(*leaves)


def make_still_life():
    gltf = Gltf()
    texture = gltf.texture

    # Materials
    linen = gltf.material(
        "linen",
        roughness=0.95,
        pbr={"baseColorTexture": texture("linen.png", [6, 2.9])},
        normalTexture=texture("weave_normal.png", [110, 53], scale=0.35),
    )
    wall = gltf.material("wall", roughness=0.9, pbr={"baseColorTexture": texture("wall.png", [1.5, 1])})
    window = gltf.material(
        "window",
        (0, 0, 0),
        roughness=1,
        emissiveFactor=[1, 0.96, 0.88],
        extensions={"emissive_strength": {"emissiveStrength": 900}},
    )
    dark = gltf.material("room", (0.42, 0.36, 0.29), roughness=1)
    brass = gltf.material(
        "brass",
        (0.91, 0.68, 0.33),
        metallic=1,
        roughness=1,
        pbr={"metallicRoughnessTexture": texture("brass_roughness.png", [4, 3])},
        normalTexture=texture("brass_normal.png", [4, 2], scale=0.8),
    )
    vase = gltf.material(
        "porcelain",
        roughness=0.12,
        pbr={"baseColorTexture": texture("vase.png", [1, 2.05], [0, -1.05])},
        normalTexture=texture("vase_normal.png", [3, 4], scale=0.6),
    )
    solid = {"transmission": {"transmissionFactor": 1}, "ior": {"ior": 1.5}}
    clear = gltf.material(
        "glass",
        roughness=0,
        extensions={
            **solid,
            "volume": {"thicknessFactor": 0.002, "attenuationColor": [0.85, 0.95, 0.92], "attenuationDistance": 0.03},
        },
    )
    green = gltf.material(
        "green glass",
        roughness=0,
        extensions={
            **solid,
            "volume": {"thicknessFactor": 0.004, "attenuationColor": [0.12, 0.42, 0.22], "attenuationDistance": 0.009},
        },
    )
    pores = texture("pore_normal.png", [4, 2], scale=0.35)
    apple = gltf.material("apple", roughness=0.28, pbr={"baseColorTexture": texture("apple.png")})
    pear = gltf.material("pear", roughness=0.42, pbr={"baseColorTexture": texture("pear.png")})
    orange = gltf.material("orange", (0.87, 0.28, 0.02), roughness=0.36, normalTexture=pores)
    lemon = gltf.material("lemon", (0.86, 0.62, 0.06), roughness=0.36, normalTexture=pores)
    cut = gltf.material("cut orange", roughness=0.35, pbr={"baseColorTexture": texture("slice.png")})
    grape = gltf.material("grape", (0.16, 0.03, 0.085), roughness=0.22)
    stalk = gltf.material("stalk", (0.16, 0.10, 0.05), roughness=0.8)
    leaf = gltf.material(
        "leaf",
        roughness=0.5,
        pbr={"baseColorTexture": texture("leaf.png")},
        alphaMode="MASK",
        alphaCutoff=0.5,
        doubleSided=True,
    )

    # The room: table, wall, and the window behind the camera, on the left
    gltf.place(gltf.mesh("cloth", grid(56, 30, cloth_point), linen))
    gltf.place(gltf.mesh("wall", grid(1, 1, lambda u, v: (4.4 * (u - 0.5), 1.4 - 2.4 * v, -0.75)), wall))
    sides = joined(
        grid(1, 1, lambda u, v: (-2.2, 1.4 - 2.4 * v, 2.4 - 3.15 * u)),
        grid(1, 1, lambda u, v: (2.2, 1.4 - 2.4 * v, -0.75 + 3.15 * u)),
        grid(1, 1, lambda u, v: (2.2 - 4.4 * u, 1.4 - 2.4 * v, 2.4)),
        grid(1, 1, lambda u, v: (4.4 * (u - 0.5), 1.4, 2.4 - 3.15 * v)),
    )
    gltf.place(gltf.mesh("room", sides, dark))
    panes = []
    for k in range(3):
        for i in range(2):
            z, y = WINDOW_Z + (i - 0.5) * 0.36, WINDOW_Y + (1 - k) * 0.31
            panes.append(grid(1, 1, lambda u, v: (WINDOW_X, y + 0.14 - 0.28 * v, z + 0.165 - 0.33 * u)))
            gltf.light("point", (WINDOW_X + 0.02, y, z), color=[1, 0.93, 0.82], intensity=PANE)
    gltf.place(gltf.mesh("window", joined(*panes), window))

    # Things on the table
    gltf.place(gltf.mesh("vase", lathe(VASE, 48, 2), vase), (-0.235, 0, -0.14), (0, 25, 0))
    gltf.place(gltf.mesh("bowl", lathe(BOWL, 52, 2), brass), (0.035, 0, 0.02))
    gltf.place(gltf.mesh("goblet", lathe(GOBLET, 36, 2), clear), (0.335, 0.001, 0.10))
    gltf.place(gltf.mesh("bottle", lathe(BOTTLE, 36, 2), green), (0.255, 0.001, -0.16))

    stem, leaves = twig()
    stem, leaves = gltf.mesh("twig", stem, stalk), gltf.mesh("leaves", leaves, leaf)
    for x, z, turn, scale in [
        (0.0, 0.01, (6, 75, 0), 0.8),
        (-0.012, 0, (10, -70, 0), 0.76),
        (0.01, -0.01, (-4, 170, 0), 0.84),
        (0, 0.012, (14, 10, 0), 0.66),
    ]:
        for part in (stem, leaves):
            gltf.place(part, (-0.235 + x, 0.27, -0.14 + z), turn, scale)

    apple, pear = gltf.mesh("apple", lathe(APPLE, 28, 2), apple), gltf.mesh("pear", lathe(PEAR, 28, 2), pear)
    orange = gltf.mesh("orange", lathe(ball(0.038, n=12), 28, 1), orange)
    lemon = gltf.mesh("lemon", lathe(LEMON, 24, 2), lemon)
    stem = gltf.mesh("stalk", tube(lambda t: (0.004 * t * t, 0.022 * t, 0.0), 0.0016, 6, 3), stalk)
    big_leaf = gltf.mesh("leaf", leaf_part(0.075, 0.034, 0.02), leaf)

    def fruit(mesh, at, turn, scale=1.0, stalk_at=None):
        gltf.place(mesh, at, turn, scale)
        if stalk_at:
            x, y, z, w = quaternion(*turn)
            # The fruit's axis, turned
            up = (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x))
            gltf.place(stem, [a + stalk_at * scale * c for a, c in zip(at, up)], turn, scale)

    fruit(apple, (-0.045, 0.108, 0.050), (18, 160, 12), 1.0, 0.029)
    fruit(orange, (0.045, 0.098, 0.075), (30, 40, 0), 1.05)
    fruit(apple, (0.110, 0.118, 0.000), (-10, 215, -18), 0.95, 0.029)
    fruit(pear, (0.020, 0.150, -0.010), (-8, 30, 16), 1.0, 0.062)
    fruit(lemon, (-0.055, 0.118, -0.045), (70, 50, 0), 1.0)
    fruit(orange, (0.055, 0.110, -0.075), (0, 0, 0), 1.0)
    fruit(pear, (-0.150, 0.0335, 0.215), (0, 205, 78), 0.98, 0.062)
    fruit(lemon, (0.225, 0.029, 0.190), (90, 62, 0), 1.0)
    gltf.place(big_leaf, (0.005, 0.150, 0.058), (10, 30, 0))

    # Half an orange, which leans on its other half
    half = gltf.mesh(
        "half",
        lathe(ball(0.038, low=0, n=6), 32, 1),
        gltf.material("peel", (0.87, 0.28, 0.02), roughness=0.36, normalTexture=pores),
    )

    def face_point(u, v):
        return 0.038 * (2 * u - 1), 0, 0.038 * (2 * v - 1)

    n = 32
    rim = [(math.sin(TAU * k / n), math.cos(TAU * k / n)) for k in range(n)]
    face = (
        [(0, 0, 0)] + [(0.038 * x, 0, 0.038 * z) for x, z in rim],
        [(0, -1, 0)] * (n + 1),
        [(0.5, 0.5)] + [(0.5 + 0.5 * x, 0.5 + 0.5 * z) for x, z in rim],
        [(0, 1 + (k + 1) % n, 1 + k) for k in range(n)],
    )
    face = gltf.mesh("cut face", face, cut)
    for at, turn in [((0.075, 0.0335, 0.262), (-116, -42, 0))]:
        gltf.place(half, at, turn)
        gltf.place(face, at, turn)

    # Grapes over the bowl's rim and on the cloth
    grape = gltf.mesh("grape", lathe(ball(0.0125, n=8), 16, 1), grape)
    rng = random.Random(7)
    centres = []
    for k in range(60):
        # From the bowl over its rim, down, and along the cloth
        t = k / 59
        angle = math.radians(226 + 14 * t)
        r = 0.10 + 0.095 * ramp(0, 0.45, t) + 0.06 * ramp(0.72, 1, t)
        height = 0.152 - 0.14 * clamp((t - 0.38) / 0.38)
        spread = 0.021 - 0.006 * t
        for _ in range(300):
            x = 0.035 + r * math.sin(angle) + rng.gauss(0, spread)
            z = 0.02 - r * math.cos(angle) + rng.gauss(0, spread)
            y = max(0.0125, height + rng.gauss(0, 0.010))
            from_axis = math.hypot(x - 0.035, z - 0.02)
            if from_axis < 0.187 and y < 0.13 and from_axis > 0.10 + 0.05 * clamp(y / 0.1):
                continue
            if all(math.dist((x, y, z), c) > 0.0205 for c in centres):
                centres.append((x, y, z))
                break
    for x, y, z in centres:
        gltf.place(grape, (x, y, z), (rng.randrange(360), 0, 0), round(rng.uniform(0.92, 1.08), 3))

    # Weak light from the rest of the room
    gltf.light("point", (1.7, 1.15, 1.5), color=[0.85, 0.92, 1], intensity=FILL)
    gltf.light("point", (-0.3, 1.30, 2.2), color=[1, 0.95, 0.9], intensity=FILL)
    gltf.light("point", (0.3, 1.36, 0.0), color=[1, 0.94, 0.86], intensity=0.22 * FILL)
    gltf.light("point", (1.7, 0.55, 0.35), color=[1, 0.9, 0.8], intensity=0.4 * FILL)
    gltf.camera([0.08, 0.42, 1.30], [0.02, 0.155, 0.0], 27.5)
    gltf.write("still_life.gltf")
    print(f"still_life.gltf: {gltf.n_triangles} triangles, {len(gltf.buffer)} bytes of geometry")


WINDOW_X, WINDOW_Y, WINDOW_Z = -1.75, 0.72, 0.75
PANE = 260
FILL = 170


if __name__ == "__main__":
    (HERE / "textures").mkdir(exist_ok=True)
    write_room_textures()
    write_still_life_textures()
    make_still_life()

"""Compares the triangles, colours and cameras that kdray reads with those that other programs wrote.

Needs from PyPI, in Python 3.11: bpy==4.5.15, numpy, trimesh, pygltflib, OpenEXR. Usage:

    python3 tests/long/geometry.py KDRAY [--keep FOLDER] [--cpu] [--only NAME,NAME]

The script makes files by pygltflib, trimesh and Blender: glTF with hierarchies of nodes, mirrored nodes, instances, all
modes and types of indices, sparse and quantized positions, morph targets and skins, OBJ, PLY and STL. Each time it
knows the triangles that the file stands for, in double precision, either from its own numbers or from the program that
wrote the file. With --keep, the files stay in FOLDER.

| compared | with | bound |
|---|---|---|
| number of triangles, by `kdray inspect` | the number that the file stands for | equal |
| bounding box, by `kdray inspect` | that of the triangles | 2e-5 of the largest coordinate or side: kdray enlarges it against rounding |
| a hit of each triangle from close by, and of 500 random rays, by `kdray cast` | a test of all triangles in double precision | same hits and misses; t within 2e-5 of the longest side; normals, with their sides, within 0.001 |
| colours of corners, by the layer `albedo` | colours interpolated over the triangle of the layer `id` | 0.006: kdray rounds corners to 8 bits of sRGB |
| cameras, by the layer `position` | hits of rays through the pixels' centres, from Blender's own camera | 1e-4 of the longest side |

Rays that pass within 1e-4 of an edge (in weights of corners) are left out, as are those within 1e-3 of a surface that
they only graze. Last, the script plants errors: a vertex that is moved by a hundredth of the size, a triangle that is
turned round, a colour that is changed by 0.05, a camera or a bone that is turned by a degree, elements that are not
replaced, another divisor, other weights, and joints in another pose. The comparison must find each.
"""

import json
import math
import struct
import sys
from functools import partial

# This import has to come first.
import blender
from blender import YUP, KdrayError, camera_matrix, link, report, triangulate

import bpy
import numpy as np
import OpenEXR
import pygltflib as gltf
import trimesh

# This module exists once `bpy` has been imported.
from mathutils import Matrix

SIZE = (96, 64)


class Difference(Exception):
    """What kdray reads differs from what the file stands for."""


# --- The comparison -----------------------------------------------------------------------------------------------


def hits_of(triangles, rays):
    """Tests all triangles. Returns for each ray t (infinity for a miss), the unit normal, and whether the ray is clear:
    it neither passes an edge closely nor grazes a surface."""
    a, ab, ac = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normals = np.cross(ab, ac)
    lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    units = normals / np.where(lengths > 0.0, lengths, 1.0)
    ts, found, clear = np.empty(len(rays)), np.zeros((len(rays), 3)), np.ones(len(rays), bool)
    for ix, ray in enumerate(rays):
        origin, direction = ray[:3], ray[3:6]
        across = np.cross(direction, ac)
        determinant = np.einsum("ij,ij->i", ab, across)
        with np.errstate(all="ignore"):
            inverse = 1.0 / determinant
            start = origin - a
            u = inverse * np.einsum("ij,ij->i", start, across)
            along = np.cross(start, ab)
            v = inverse * (along @ direction)
            t = inverse * np.einsum("ij,ij->i", ac, along)
            least = np.minimum(np.minimum(u, v), 1.0 - u - v)
        ahead = np.isfinite(t) & (t > 0.0) & (t < np.inf)
        hit = ahead & (least >= 0.0)
        t = np.where(hit, t, np.inf)
        closest = int(np.argmin(t))
        ts[ix], found[ix] = t[closest], units[closest]
        steep = abs(units @ direction) > 1e-3 * np.linalg.norm(direction)
        clear[ix] = not (ahead & (abs(least) < 1e-4)).any() and steep[hit].all()
    return ts, found, clear


def rays_at(triangles, rng):
    """Returns rays from close above each triangle, alternately on both of its sides, and 500 through the whole."""
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    size = np.linalg.norm(high - low)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=-1)
    usable = lengths > 1e-9 * size**2
    picked = np.flatnonzero(usable)
    picked = rng.permutation(picked)[:1500]
    units = normals[picked] / lengths[picked][:, None] * np.where(picked % 2, 1.0, -1.0)[:, None]
    weights = rng.dirichlet((2.0, 2.0, 2.0), len(picked))
    points = np.einsum("ij,ijk->ik", weights, triangles[picked])
    near = np.hstack([points + 0.02 * size * units, -units])
    outside = rng.normal(size=(500, 3))
    outside = (low + high) / 2.0 + size * outside / np.linalg.norm(outside, axis=-1, keepdims=True)
    inside = rng.uniform(low, high, (500, 3))
    far = np.hstack([outside, (inside - outside) / np.linalg.norm(inside - outside, axis=-1, keepdims=True)])
    return np.vstack([near, far]).astype(np.float32)


def compare_triangles(arguments, path, triangles, folder):
    """Compares number, bounds and hits. Returns a line for the report."""
    told = json.loads(blender.run(arguments.kdray, "inspect", path, "--json"))
    if told["triangles"] != len(triangles):
        raise Difference(f"{told['triangles']} triangles in place of {len(triangles)}")
    bounds = np.array([triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))])
    side = (bounds[1] - bounds[0]).max()
    off = abs(np.array(told["bounds"]) - bounds).max()
    if off > 2e-5 * max(side, abs(bounds).max()):
        raise Difference(f"bounds differ by {off:.3g}: {told['bounds']} in place of {bounds.tolist()}")
    rays = rays_at(triangles, np.random.default_rng(1))
    np.save(folder / "rays.npy", rays)
    cast = ["cast", path, folder / "rays.npy", "-o", folder / "hits.npz", "--quiet"]
    blender.run(arguments.kdray, *cast, *arguments.options)
    ours = np.load(folder / "hits.npz")
    ts, normals, clear = hits_of(triangles, rays.astype(np.float64))
    is_hit = np.isfinite(ts)
    wrong = clear & (np.isfinite(ours["t_hit"]) != is_hit)
    if wrong.any():
        raise Difference(f"{wrong.sum()} of {clear.sum()} rays hit where they must miss, or miss where they must hit")
    both = clear & is_hit
    off_t = abs(ours["t_hit"][both] - ts[both]).max() / side
    if off_t > 2e-5:
        raise Difference(f"t differs by up to {off_t:.3g} of the longest side")
    off_normal = np.linalg.norm(ours["primitive_normals"][both] - normals[both], axis=-1).max()
    if off_normal > 1e-3:
        raise Difference(f"normals differ by up to {off_normal:.3g}")
    return f"{len(triangles)} triangles, {both.sum()} hits, t within {off_t:.1e}, normals within {off_normal:.1e}"


def layers(arguments, path, folder, names):
    """Renders a file and returns the layers of these names, by name."""
    out = folder / "layers.exr"
    blender.render(arguments, path, out, SIZE, "--aov", ",".join(names))
    channels = OpenEXR.File(str(out), separate_channels=True).channels()
    parts = {"position": "XYZ", "albedo": "RGB", "id": ["ID"]}
    return {name: np.stack([channels[f"{name}.{part}"].pixels for part in parts[name]], axis=-1) for name in names}


def compare_colours(arguments, path, triangles, colours, folder):
    """Compares colours of corners, linear, in the order of the file's triangles. Returns a line for the report."""
    shown = layers(arguments, path, folder, ["position", "albedo", "id"])
    is_hit = shown["id"][..., 0] != 0xFFFFFFFF
    if is_hit.sum() < 500:
        raise Difference(f"only {is_hit.sum()} pixels show the mesh")
    ids, points = shown["id"][is_hit][:, 0], shown["position"][is_hit].astype(np.float64)
    corners = triangles[ids]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    squared = np.einsum("ij,ij->i", normals, normals)
    weights = []
    for k in range(3):
        first, second = corners[:, (k + 1) % 3], corners[:, (k + 2) % 3]
        weights.append(np.einsum("ij,ij->i", np.cross(second - first, points - first), normals) / squared)
    expected = np.einsum("ki,ikj->ij", np.array(weights), colours[ids])
    off = abs(shown["albedo"][is_hit] - expected).max()
    if off > 0.006:
        raise Difference(f"colours differ by up to {off:.3g}")
    return f"{is_hit.sum()} pixels, colours within {off:.1e}"


def compare_camera(arguments, path, triangles, rays, folder):
    """Compares the points that the pixels show with the hits of rays. Returns a line for the report."""
    points = layers(arguments, path, folder, ["position"])["position"].reshape(-1, 3).astype(np.float64)
    ts, _, clear = hits_of(triangles, rays)
    both = clear & np.isfinite(ts) & (points != 0.0).any(axis=-1)
    n_lost = (clear & (np.isfinite(ts) != (points != 0.0).any(axis=-1))).sum()
    if both.sum() < 200 or n_lost > 0.003 * len(rays):
        raise Difference(f"{n_lost} pixels show a surface where they must not, or none where they must")
    side = np.ptp(triangles.reshape(-1, 3), axis=0).max()
    off = np.linalg.norm(points[both] - (rays[both, :3] + ts[both, None] * rays[both, 3:]), axis=-1)
    worst = np.percentile(off, 99.5) / side
    if worst > 1e-4:
        raise Difference(f"points of pixels differ by {worst:.3g} of the longest side")
    return f"{both.sum()} pixels, points within {worst:.1e}"


# --- Files by pygltflib -------------------------------------------------------------------------------------------


class Writer:
    """A glTF document in the making."""

    def __init__(self):
        self.document = gltf.GLTF2(scene=0, scenes=[gltf.Scene(nodes=[])], asset=gltf.Asset(version="2.0"))
        self.blob = bytearray()
        # Weights of morph targets by node, since pygltflib's nodes have none.
        self.weights = {}

    def view(self, array):
        """Adds an array's bytes and returns the index of their buffer view."""
        self.blob.extend(b"\0" * (-len(self.blob) % 4))
        view = gltf.BufferView(buffer=0, byteOffset=len(self.blob), byteLength=array.nbytes)
        self.blob.extend(np.ascontiguousarray(array).tobytes())
        self.document.bufferViews.append(view)
        return len(self.document.bufferViews) - 1

    def accessor(self, array, component, kind, normalized=False, bounds=False):
        """Adds an array and returns the index of its accessor."""
        made = gltf.Accessor(bufferView=self.view(array), componentType=component, count=len(array), type=kind)
        made.normalized = normalized
        if bounds:
            made.min, made.max = array.min(axis=0).tolist(), array.max(axis=0).tolist()
        self.document.accessors.append(made)
        return len(self.document.accessors) - 1

    def sparse(self, array, indices, values, base=True):
        """Adds an array of float vectors in which some elements are replaced, and returns the index of its accessor.

        Without `base`, the array is of zeros and the file does not have it.
        """
        replaced = np.asarray(indices, "<u2"), np.asarray(values, "<f4")
        views = [self.view(part) for part in replaced]
        ix = self.accessor(array.astype("<f4"), gltf.FLOAT, "VEC3")
        made = self.document.accessors[ix]
        if not base:
            made.bufferView = None
        made.sparse = gltf.Sparse(
            count=len(indices),
            indices=gltf.AccessorSparseIndices(bufferView=views[0], componentType=gltf.UNSIGNED_SHORT),
            values=gltf.AccessorSparseValues(bufferView=views[1]),
        )
        whole = array.copy()
        whole[indices] = values
        made.min, made.max = whole.min(axis=0).tolist(), whole.max(axis=0).tolist()
        return ix

    def primitive(self, points, indices=None, component=gltf.UNSIGNED_INT, mode=gltf.TRIANGLES, colours=None):
        """Makes a primitive. `colours`: the array, its component type, and whether it is normalized."""
        attributes = gltf.Attributes(POSITION=self.accessor(points.astype("<f4"), gltf.FLOAT, "VEC3", bounds=True))
        if colours is not None:
            array, kind, normalized = colours
            attributes.COLOR_0 = self.accessor(array, kind, f"VEC{array.shape[1]}", normalized)
        made = gltf.Primitive(attributes=attributes, mode=mode)
        if indices is not None:
            types = {gltf.UNSIGNED_BYTE: "<u1", gltf.UNSIGNED_SHORT: "<u2", gltf.UNSIGNED_INT: "<u4"}
            made.indices = self.accessor(np.array(indices).astype(types[component]), component, "SCALAR")
        return made

    def mesh(self, *primitives):
        """Adds a mesh and returns its index."""
        self.document.meshes.append(gltf.Mesh(primitives=list(primitives)))
        return len(self.document.meshes) - 1

    def node(self, parent=None, **values):
        """Adds a node and returns its index."""
        self.document.nodes.append(gltf.Node(**values))
        ix = len(self.document.nodes) - 1
        siblings = self.document.scenes[0].nodes if parent is None else self.document.nodes[parent].children
        siblings.append(ix)
        return ix

    def save(self, path):
        """Writes the document as .glb."""
        self.document.buffers = [gltf.Buffer(byteLength=len(self.blob))]
        told = json.loads(self.document.to_json())
        for node, weights in self.weights.items():
            told["nodes"][node]["weights"] = weights
        body = b""
        for kind, data, padding in [(b"JSON", json.dumps(told).encode(), b" "), (b"BIN\0", bytes(self.blob), b"\0")]:
            data += padding * (-len(data) % 4)
            body += struct.pack("<I", len(data)) + kind + data
        path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body)


def placed(triangles, matrix):
    """Moves triangles by a matrix. A mirrored triangle is turned round, so that its outside stays outside."""
    moved = triangles @ matrix[:3, :3].T + matrix[:3, 3]
    return moved[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0.0 else moved


def hierarchy(path):
    """Writes nested nodes of all kinds of transforms, with a shared mesh. Returns the triangles."""
    rng = np.random.default_rng(2)
    points = rng.normal(size=(12, 3)).astype(np.float32)
    faces = rng.permuted(np.tile(np.arange(12), (10, 1)), axis=1)[:, :3]
    writer = Writer()
    shared = writer.mesh(
        writer.primitive(points, faces.ravel(), gltf.UNSIGNED_BYTE),
        writer.primitive(points + 1.0, faces.ravel(), gltf.UNSIGNED_SHORT),
    )
    triangles = np.vstack([points[faces], (points + np.float32(1.0))[faces]]).astype(np.float64)
    half = math.sqrt(0.5)
    root = writer.node(translation=[1.0, 2.0, -3.0], rotation=[0.0, half, 0.0, half], mesh=shared)
    m_root = translation(1, 2, -3) @ turn("y", 90)
    mirrored = writer.node(root, scale=[-1.0, 2.0, 0.5], rotation=[half, 0.0, 0.0, half], mesh=shared)
    m_mirrored = m_root @ turn("x", 90) @ np.diag([-1.0, 2.0, 0.5, 1.0])
    sheared = np.array([[1, 0.5, 0, 4], [0, 1, 0.25, 0], [0, 0, 1.5, -2], [0, 0, 0, 1.0]])
    writer.node(mirrored, matrix=sheared.T.ravel().tolist(), mesh=shared)
    inverted = writer.node(root, scale=[-1.0, -1.0, -1.0])
    writer.node(inverted, scale=[1.0, -3.0, 1.0], translation=[0.0, 0.0, 5.0], mesh=shared)
    m_inverted = m_root @ np.diag([-1.0, -1.0, -1.0, 1.0]) @ translation(0, 0, 5) @ np.diag([1.0, -3.0, 1.0, 1.0])
    writer.save(path)
    return np.vstack([placed(triangles, m) for m in (m_root, m_mirrored, m_mirrored @ sheared, m_inverted)])


def modes(path):
    """Writes lists, strips and fans, with and without indices. Returns the triangles."""
    rng = np.random.default_rng(3)
    angle = np.linspace(0.0, 5.0, 11)
    fan = np.stack([np.cos(angle), np.sin(angle), 0.2 * angle], axis=-1).astype(np.float32)
    fan[0] = (0.0, 0.0, 0.5)
    strip = np.stack([np.arange(12) // 2, np.arange(12) % 2, rng.uniform(0, 0.4, 12)], axis=-1).astype(np.float32)
    loose = rng.normal(size=(30, 3)).astype(np.float32) + np.float32(3.0)
    order = rng.permutation(12)
    writer = Writer()
    parts = [
        writer.primitive(loose),
        writer.primitive(strip, mode=gltf.TRIANGLE_STRIP),
        writer.primitive(strip[order] - np.float32(4.0), np.argsort(order), gltf.UNSIGNED_INT, gltf.TRIANGLE_STRIP),
        writer.primitive(fan, mode=gltf.TRIANGLE_FAN),
        writer.primitive(fan + np.float32(6.0), np.arange(11), gltf.UNSIGNED_BYTE, gltf.TRIANGLE_FAN),
    ]
    writer.node(mesh=writer.mesh(*parts))
    writer.save(path)
    strips = np.array([[i, i + 1 + i % 2, i + 2 - i % 2] for i in range(10)])
    fans = np.array([[i + 1, i + 2, 0] for i in range(9)])
    moved = [strip - np.float32(4.0), fan + np.float32(6.0)]
    all_parts = [loose.reshape(-1, 3, 3), strip[strips], moved[0][strips], fan[fans], moved[1][fans]]
    return np.vstack(all_parts).astype(np.float64)


def ball():
    """Returns the points and the faces of a ball of 80 triangles, in single precision."""
    shape = trimesh.creation.icosphere(subdivisions=1)
    return shape.vertices.astype(np.float32), np.asarray(shape.faces)


def sparse(path, is_planted=False):
    """Writes positions of which some are replaced, and positions that are zero where they are not replaced. Returns the
    triangles, or with `is_planted` those without replacements."""
    points, faces = ball()
    rng = np.random.default_rng(6)
    writer, parts = Writer(), []
    chosen = np.sort(rng.permutation(len(points))[:9])
    everything = np.arange(len(points))
    shifted = points + np.float32(3.0)
    for base, indices, values in [
        (points, chosen, points[chosen] * np.float32(1.5)),
        (np.zeros_like(points), everything[1:], shifted[1:]),
    ]:
        part = writer.primitive(points, faces.ravel(), gltf.UNSIGNED_SHORT)
        part.attributes.POSITION = writer.sparse(base, indices, values, base.any())
        writer.node(mesh=writer.mesh(part))
        whole = base.copy()
        whole[indices] = values
        parts.append(whole[faces])
    writer.save(path)
    if is_planted:
        parts[0] = points[faces]
    return np.vstack(parts).astype(np.float64)


def quantized(path, is_planted=False):
    """Writes positions of 16 bits, normalized and not, and of 8 bits, which nodes scale. Returns the triangles, or with
    `is_planted` those of another divisor."""
    points, faces = ball()
    writer, parts = Writer(), []
    kinds = [("<i2", gltf.SHORT, 32767, True), ("<u2", gltf.UNSIGNED_SHORT, 0, False), ("<i1", gltf.BYTE, 127, True)]
    for place, (kind, component, divisor, normalized) in enumerate(kinds):
        array = np.round(points * divisor if divisor else 1000.0 * points + 2000.0).astype(kind)
        # Each element has a multiple of four bytes, the last ones of which are padding.
        padded = np.zeros((len(array), 4), kind)
        padded[:, :3] = array
        part = writer.primitive(points, faces.ravel(), gltf.UNSIGNED_SHORT)
        ix = writer.accessor(padded, component, "VEC3", normalized)
        part.attributes.POSITION = ix
        view = writer.document.bufferViews[writer.document.accessors[ix].bufferView]
        view.byteStride, view.target = padded.itemsize * 4, gltf.ARRAY_BUFFER
        made = writer.document.accessors[ix]
        made.min, made.max = array.min(axis=0).tolist(), array.max(axis=0).tolist()
        size = 1.5 if divisor else 0.001
        writer.node(mesh=writer.mesh(part), translation=[4.0 * place, 0.0, 0.0], scale=[size] * 3)
        values = np.maximum(array / float(divisor + is_planted), -1.0) if divisor else array.astype(np.float64)
        parts.append(size * values[faces] + (4.0 * place, 0.0, 0.0))
    writer.document.extensionsUsed = writer.document.extensionsRequired = ["KHR_mesh_quantization"]
    writer.save(path)
    return np.vstack(parts)


def morphed(path, is_planted=False):
    """Writes morph targets: weights of the mesh, of a node, and a sparse target. Returns the triangles, or with
    `is_planted` those of other weights."""
    points, faces = ball()
    rng = np.random.default_rng(7)
    moves = [rng.normal(0.0, 0.2, points.shape).astype(np.float32) for _ in range(2)]
    chosen = np.arange(5, 20)
    few = np.zeros_like(points)
    few[chosen] = rng.normal(0.0, 0.3, (len(chosen), 3)).astype(np.float32)
    writer = Writer()
    part = writer.primitive(points, faces.ravel(), gltf.UNSIGNED_SHORT)
    targets = [writer.accessor(move, gltf.FLOAT, "VEC3", bounds=True) for move in moves]
    targets.append(writer.sparse(np.zeros_like(points), chosen, few[chosen], False))
    part.targets = [{"POSITION": target} for target in targets]
    shared = writer.mesh(part)
    of_mesh, of_node = [0.5, 0.0, 1.0], [-0.25, 1.5, 0.75]
    writer.document.meshes[shared].weights = of_mesh
    writer.node(mesh=shared)
    writer.weights[writer.node(mesh=shared, translation=[4.0, 0.0, 0.0], scale=[1.0, -1.0, 1.0])] = of_node
    writer.save(path)
    places = [np.eye(4), translation(4, 0, 0) @ np.diag([1.0, -1.0, 1.0, 1.0])]
    parts = []
    for weights, matrix in zip((of_mesh, of_mesh if is_planted else of_node), places):
        whole = points + sum(weight * move.astype(np.float64) for weight, move in zip(weights, [*moves, few]))
        parts.append(placed(whole[faces], matrix))
    return np.vstack(parts)


def skinned(path, is_planted=False):
    """Writes a skin of three joints in a pose that is not that of the bind, with weights of floats and of 8 bits, and a
    mesh node whose own place does not count. Returns the triangles, or with `is_planted` those of the bind pose."""
    points, faces = ball()
    rng = np.random.default_rng(8)
    writer = Writer()
    half = math.sqrt(0.5)
    root = writer.node(translation=[1.0, 0.0, 2.0])
    arm = writer.node(root, translation=[0.0, 1.0, 0.0], rotation=[half, 0.0, 0.0, half])
    hand = writer.node(arm, translation=[0.5, 0.5, 0.0], scale=[1.2, 0.7, 1.1])
    poses = [translation(1, 0, 2)]
    poses.append(poses[0] @ translation(0, 1, 0) @ turn("x", 90))
    poses.append(poses[1] @ translation(0.5, 0.5, 0) @ np.diag([1.2, 0.7, 1.1, 1.0]))
    bind = [np.eye(4), translation(0, -1, 0), translation(0.3, -1, 0.2) @ turn("z", 30)]
    bind = [matrix.astype(np.float32) for matrix in bind]
    matrices = np.array([matrix.T.ravel() for matrix in bind], "<f4")
    skin = gltf.Skin(joints=[root, arm, hand], inverseBindMatrices=writer.accessor(matrices, gltf.FLOAT, "MAT4"))
    writer.document.skins.append(skin)
    joints = np.tile(np.array([0, 1, 2, 0], "<u1"), (len(points), 1))
    shares = rng.dirichlet((1.0, 1.0, 1.0), len(points))
    shares = np.hstack([shares, np.zeros((len(points), 1))])
    bytes_of = np.floor(shares * 255.0).astype("<u1")
    bytes_of[:, 0] += (255 - bytes_of.sum(axis=1, dtype=int)).astype("<u1")
    joint_matrices = np.array([pose @ matrix for pose, matrix in zip(poses, bind)])
    if is_planted:
        joint_matrices[:] = poses[0]
    parts = []
    for array, kind in ((shares.astype("<f4"), gltf.FLOAT), (bytes_of, gltf.UNSIGNED_BYTE)):
        move = np.float32(0.0 if kind == gltf.FLOAT else 3.0)
        part = writer.primitive(points + move, faces.ravel(), gltf.UNSIGNED_SHORT)
        part.attributes.JOINTS_0 = writer.accessor(joints, gltf.UNSIGNED_BYTE, "VEC4")
        part.attributes.WEIGHTS_0 = writer.accessor(array, kind, "VEC4", kind != gltf.FLOAT)
        writer.node(mesh=writer.mesh(part), skin=0, translation=[9.0, 9.0, 9.0], scale=[2.0, 2.0, 2.0])
        weights = array[:, :3] / (1.0 if kind == gltf.FLOAT else 255.0)
        whole = np.hstack([points + move, np.ones((len(points), 1))])
        moved = np.einsum("ij,jkl,il->ik", weights, joint_matrices, whole)[:, :3]
        parts.append(moved[faces])
    writer.save(path)
    return np.vstack(parts).astype(np.float64)


def translation(x, y, z):
    """Returns the matrix of a translation."""
    matrix = np.eye(4)
    matrix[:3, 3] = (x, y, z)
    return matrix


def turn(axis, degrees):
    """Returns the matrix of a rotation."""
    return np.array(Matrix.Rotation(math.radians(degrees), 4, axis.upper()))


def coloured(kind):
    """Returns a writer of a glTF file whose colours have this type."""

    def write(path, changed=0.0):
        shape = trimesh.creation.icosphere(subdivisions=1)
        colours = np.random.default_rng(4).uniform(0.1, 0.9, (len(shape.vertices), 3))
        largest = {gltf.FLOAT: None, gltf.UNSIGNED_BYTE: 255, gltf.UNSIGNED_SHORT: 65535}[kind]
        if largest:
            array = np.round(colours * largest).astype("<u1" if largest == 255 else "<u2")
            # An element must have a multiple of four bytes.
            array = np.hstack([array, np.full((len(array), 1), largest, array.dtype)])
            colours = array[:, :3] / largest
        else:
            array = colours.astype("<f4")
        writer = Writer()
        part = writer.primitive(shape.vertices, shape.faces.ravel(), colours=(array, kind, largest is not None))
        writer.node(mesh=writer.mesh(part))
        writer.save(path)
        return shape.triangles, colours[shape.faces] + changed

    return write


def linear(encoded):
    """Returns the linear values of sRGB values from 0 to 1."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def coloured_mesh(path):
    """Writes colours of points by trimesh as OBJ or PLY. They are sRGB, and albedos without a material."""
    shape = trimesh.creation.icosphere(subdivisions=1)
    colours = np.random.default_rng(5).integers(20, 235, (len(shape.vertices), 4)).astype(np.uint8)
    colours[:, 3] = 255
    shape.visual.vertex_colors = colours
    shape.export(path)
    return shape.triangles, linear(colours[:, :3] / 255.0)[shape.faces]


# --- Files by trimesh ---------------------------------------------------------------------------------------------


def shapes():
    """Returns a scene of several meshes in a hierarchy, with an instance that is mirrored."""
    scene = trimesh.Scene()
    knot = trimesh.creation.torus(1.0, 0.3, major_sections=24, minor_sections=12)
    box = trimesh.creation.box((1.0, 2.0, 0.5))
    scene.add_geometry(knot, node_name="torus", geom_name="torus", transform=turn("x", 40))
    move = translation(0, 2, 1) @ turn("z", 30)
    scene.add_geometry(box, node_name="box", geom_name="box", parent_node_name="torus", transform=move)
    mirror = translation(-3, 0, 0) @ np.diag([-1.0, 1.5, 1.0, 1.0])
    scene.graph.update(frame_to="again", frame_from="box", matrix=mirror, geometry="torus")
    return scene


def by_trimesh(path):
    """Writes the scene as glTF, or its meshes as one mesh. Returns the triangles."""
    scene = shapes()
    nodes = [scene.graph[node] for node in scene.graph.nodes_geometry]
    whole = np.vstack([placed(scene.geometry[name].triangles, matrix) for matrix, name in nodes])
    if path.suffix in (".glb", ".gltf"):
        scene.export(path)
        return whole
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(whole))
    options = {}
    if path.stem.endswith("_text"):
        options = {"file_type": "stl_ascii"} if path.suffix == ".stl" else {"encoding": "ascii"}
    mesh.export(path, **options)
    return mesh.triangles


# --- Files by Blender ---------------------------------------------------------------------------------------------


def blender_scene():
    """Makes parents and children, modifiers, an instance of a collection, and objects that are mirrored."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_monkey_add(location=(0.0, 0.0, 1.0), rotation=(0.2, 0.3, 0.4))
    parent = bpy.context.object
    triangulate(parent.data)
    parent.scale = (1.0, 1.5, 0.7)
    bpy.ops.mesh.primitive_cone_add(vertices=9, location=(2.0, 0.5, 0.0))
    child = bpy.context.object
    child.parent, child.scale = parent, (-0.8, 0.6, 0.9)
    array = child.modifiers.new("array", "ARRAY")
    array.count = 3
    bpy.ops.mesh.primitive_torus_add(location=(-3.0, 1.0, 0.5), major_segments=16, minor_segments=8)
    torus = bpy.context.object
    torus.scale = (-1.0, -1.0, -1.0)
    linked = link("linked", torus.data)
    linked.matrix_world = Matrix.Translation((0.0, -3.0, 1.0)) @ Matrix.Rotation(0.7, 4, "X")
    group = bpy.data.collections.new("group")
    group.objects.link(linked)
    instance = link("instance")
    instance.instance_type, instance.instance_collection = "COLLECTION", group
    instance.location, instance.scale = (4.0, 2.0, 0.0), (0.5, 0.7, -0.5)


def deformed(path, is_planted=False):
    """Writes a mesh that bones of an armature bend, whose vertices follow up to three bones, with shape keys, by
    Blender. Returns the triangles that Blender shows, or with `is_planted` those of a bone that is turned further."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_cylinder_add(vertices=10, radius=0.5, depth=3.0)
    tube = bpy.context.object
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.subdivide(number_cuts=5)
    bpy.ops.object.mode_set(mode="OBJECT")
    triangulate(tube.data)
    tube.shape_key_add(name="Basis")
    for name, weight in (("wide", 0.6), ("wavy", 0.3)):
        key = tube.shape_key_add(name=name)
        for point in key.data:
            x, y, z = point.co
            point.co = (1.5 * x, 1.2 * y, z) if name == "wide" else (x + 0.3 * math.sin(4.0 * z), y, z)
        key.value = weight
    armature = link("armature", bpy.data.armatures.new("armature"))
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    heights = (-1.5, -0.5, 0.5, 1.5)
    for ix in range(3):
        bone = armature.data.edit_bones.new(f"bone{ix}")
        bone.head, bone.tail = (0.0, 0.0, heights[ix]), (0.0, 0.0, heights[ix + 1])
        bone.parent = armature.data.edit_bones[f"bone{ix - 1}"] if ix else None
    bpy.ops.object.mode_set(mode="OBJECT")
    for ix in range(3):
        group = tube.vertex_groups.new(name=f"bone{ix}")
        for vertex in tube.data.vertices:
            group.add([vertex.index], math.exp(-((vertex.co.z - heights[ix] - 0.5) ** 2)), "REPLACE")
        armature.pose.bones[f"bone{ix}"].rotation_mode = "XYZ"
        armature.pose.bones[f"bone{ix}"].rotation_euler = (0.3 * ix, 0.2, -0.4 * ix)
    armature.pose.bones["bone2"].scale = (1.3, 0.8, 1.0)
    tube.modifiers.new("armature", "ARMATURE").object = armature
    tube.parent = armature
    armature.location, armature.rotation_euler, armature.scale = (1.0, 2.0, 0.5), (0.3, 0.2, 0.1), (1.0, 1.4, -1.2)
    options = {"export_rest_position_armature": False, "export_skins": True, "export_morph": True}
    bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLB", **options)
    if is_planted:
        armature.pose.bones["bone1"].rotation_euler.x += math.radians(1.0)
    return blender_triangles()


def blender_triangles(turns_mirrored=True):
    """Returns the triangles that Blender shows, with y up. `turns_mirrored`: whether mirrored ones are turned round."""
    bpy.context.scene.view_layers[0].update()
    graph = bpy.context.evaluated_depsgraph_get()
    yup = np.eye(4)
    yup[:3, :3] = YUP
    parts = []
    for instance in graph.object_instances:
        if instance.object.type != "MESH":
            continue
        matrix, mesh = np.array(instance.matrix_world), instance.object.to_mesh()
        points = np.array([vertex.co for vertex in mesh.vertices])
        faces = np.array([triangle.vertices for triangle in mesh.loop_triangles])
        moved = placed(points[faces], yup @ matrix)
        is_mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
        parts.append(moved[:, ::-1] if is_mirrored and not turns_mirrored else moved)
    return np.vstack(parts)


def by_blender(path):
    """Writes Blender's scene in the format that the path's ending names. Returns the triangles."""
    blender_scene()
    if path.suffix in (".glb", ".gltf"):
        kind = "GLB" if path.suffix == ".glb" else "GLTF_SEPARATE"
        bpy.ops.export_scene.gltf(filepath=str(path), export_format=kind, export_apply=True)
        return blender_triangles()
    # These exporters leave out instances of collections.
    bpy.data.objects.remove(bpy.data.objects["instance"])
    export = {".obj": bpy.ops.wm.obj_export, ".ply": bpy.ops.wm.ply_export, ".stl": bpy.ops.wm.stl_export}[path.suffix]
    options = {"ascii_format": path.stem.endswith("_text")} if path.suffix in (".ply", ".stl") else {}
    export(filepath=str(path), forward_axis="NEGATIVE_Z", up_axis="Y", **options)
    # The exporter of PLY leaves mirrored objects inside out.
    return blender_triangles(path.suffix != ".ply")


def camera(values, location, rotation, parented=False):
    """Returns a writer of a Blender scene with a camera whose data have these values."""

    def write(path, turned=0.0):
        blender_scene()
        scene = bpy.context.scene
        scene.render.resolution_x, scene.render.resolution_y = SIZE
        data = bpy.data.cameras.new("camera")
        for name, value in values.items():
            setattr(data, name, value)
        seen = link("camera", data)
        seen.location, seen.rotation_euler = location, rotation
        scene.camera = seen
        if parented:
            holder = link("holder")
            holder.location, holder.rotation_euler, holder.scale = (0.3, -0.5, 0.2), (0.1, 0.2, 0.3), (2.0, 2.0, 2.0)
            seen.parent = holder
        bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLB", export_apply=True, export_cameras=True)
        triangles = blender_triangles()
        seen.rotation_euler.z += math.radians(turned)
        matrix = camera_matrix(seen)
        frame = np.array(data.view_frame(scene=scene))
        x, y = (np.arange(SIZE[0]) + 0.5) / SIZE[0], (np.arange(SIZE[1]) + 0.5) / SIZE[1]
        low, high = frame.min(axis=0), frame.max(axis=0)
        aside, up = np.meshgrid(low[0] + x * (high[0] - low[0]), high[1] - y * (high[1] - low[1]))
        in_image = np.stack([aside, up, np.zeros_like(up)], axis=-1).reshape(-1, 3)
        # An orthographic camera's rays begin in the image plane, and are parallel to its -z axis.
        is_parallel = data.type == "ORTHO"
        directions = np.array([0.0, 0.0, -1.0]) if is_parallel else in_image + (0.0, 0.0, frame[0, 2])
        origins = in_image if is_parallel else np.zeros(3)
        directions = np.broadcast_to(directions, in_image.shape) @ matrix[:3, :3].T @ YUP.T
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        origins = (origins @ matrix[:3, :3].T + matrix[:3, 3]) @ YUP.T
        return triangles, np.hstack([np.broadcast_to(origins, directions.shape), directions])

    return write


# --- Cases --------------------------------------------------------------------------------------------------------

TRIANGLES = {
    "pygltflib_hierarchy.glb": hierarchy,
    "pygltflib_modes.glb": modes,
    "pygltflib_sparse.glb": sparse,
    "pygltflib_quantized.glb": quantized,
    "pygltflib_morphed.glb": morphed,
    "pygltflib_skinned.glb": skinned,
    "trimesh.glb": by_trimesh,
    "trimesh.obj": by_trimesh,
    "trimesh.ply": by_trimesh,
    "trimesh_text.ply": by_trimesh,
    "trimesh.stl": by_trimesh,
    "trimesh_text.stl": by_trimesh,
    "blender.glb": by_blender,
    "blender.gltf": by_blender,
    "blender_deformed.glb": deformed,
    "blender.obj": by_blender,
    "blender.ply": by_blender,
    "blender_text.ply": by_blender,
    "blender.stl": by_blender,
    "blender_text.stl": by_blender,
}
COLOURS = {
    "colours_float.glb": coloured(gltf.FLOAT),
    "colours_u8.glb": coloured(gltf.UNSIGNED_BYTE),
    "colours_u16.glb": coloured(gltf.UNSIGNED_SHORT),
    "colours.obj": coloured_mesh,
    "colours.ply": coloured_mesh,
}
CAMERAS = {
    "camera_plain.glb": camera({"lens": 35.0}, (0.0, -9.0, 4.0), (1.2, 0.0, 0.0)),
    "camera_rolled.glb": camera({"lens": 28.0}, (6.0, -7.0, 3.0), (1.3, 0.5, 0.7)),
    "camera_vertical.glb": camera(
        {"lens": 30.0, "sensor_fit": "VERTICAL", "sensor_height": 20.0}, (0.0, -9.0, 4.0), (1.2, 0.0, 0.0)
    ),
    "camera_parented.glb": camera({"lens": 24.0}, (0.0, -5.0, 1.0), (1.4, 0.0, 0.0), True),
    "camera_orthographic.glb": camera({"type": "ORTHO", "ortho_scale": 9.0}, (6.0, -7.0, 3.0), (1.3, 0.5, 0.7)),
    "camera_orthographic_parented.glb": camera(
        {"type": "ORTHO", "ortho_scale": 8.0}, (0.0, -5.0, 1.0), (1.4, 0.0, 0.0), True
    ),
}


def check(name, compare, write, arguments, folder):
    """Writes and compares one file, prints a line, and returns whether nothing differs."""
    try:
        made = write(folder / name)
        line = compare(arguments, folder / name, *(made if isinstance(made, tuple) else (made,)), folder)
    except (Difference, KdrayError) as difference:
        report(f"FAIL {name:26} {difference}")
        return False
    report(f"ok   {name:26} {line}")
    return True


def check_planted(name, compare, write, arguments, folder):
    """Compares a file with what it does not stand for, and returns whether the difference is found."""
    try:
        made = write(folder / name)
        compare(arguments, folder / name, *(made if isinstance(made, tuple) else (made,)), folder)
    except Difference as difference:
        report(f"ok   planted in {name:15} found: {difference}")
        return True
    report(f"FAIL planted in {name:15} not found")
    return False


def moved(path):
    """Plants an error: one vertex is moved by a hundredth of the size."""
    triangles = by_trimesh(path).copy()
    size = np.ptp(triangles.reshape(-1, 3), axis=0).max()
    vertex = triangles[17, 0].copy()
    normal = np.cross(triangles[17, 1] - vertex, triangles[17, 2] - vertex)
    triangles[(triangles == vertex).all(axis=-1)] += 0.01 * size * normal / np.linalg.norm(normal)
    return triangles


def turned_round(path):
    """Plants an error: one triangle is turned round."""
    triangles = by_trimesh(path).copy()
    triangles[17] = triangles[17, ::-1]
    return triangles


PLANTED = [
    ("trimesh.obj", compare_triangles, moved),
    ("trimesh.obj", compare_triangles, turned_round),
    ("pygltflib_sparse.glb", compare_triangles, partial(sparse, is_planted=True)),
    ("pygltflib_quantized.glb", compare_triangles, partial(quantized, is_planted=True)),
    ("pygltflib_morphed.glb", compare_triangles, partial(morphed, is_planted=True)),
    ("pygltflib_skinned.glb", compare_triangles, partial(skinned, is_planted=True)),
    ("blender_deformed.glb", compare_triangles, partial(deformed, is_planted=True)),
    ("colours_float.glb", compare_colours, partial(COLOURS["colours_float.glb"], changed=0.05)),
    ("camera_plain.glb", compare_camera, partial(CAMERAS["camera_plain.glb"], turned=1.0)),
    ("camera_orthographic.glb", compare_camera, partial(CAMERAS["camera_orthographic.glb"], turned=1.0)),
]

if __name__ == "__main__":
    CASES = [(compare_triangles, TRIANGLES), (compare_colours, COLOURS), (compare_camera, CAMERAS)]
    FILES = [(name, compare, write) for compare, files in CASES for name, write in files.items()]
    CHECKS = [(name, partial(check, name, compare, write)) for name, compare, write in FILES]
    CHECKS += [(name, partial(check_planted, name, compare, write)) for name, compare, write in PLANTED]
    sys.exit(blender.main(__doc__, CHECKS))

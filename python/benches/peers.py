"""Times kdray beside Open3D, trimesh with embreex, and Mitsuba, those of them that are installed.

python peers.py MESH [--rays N] [--boxes N] [--meshes N] [--triangles N] [--repeat N]

All libraries answer the same queries in one process, on as many threads as they take by themselves. A time is the
least of the repetitions, from arrays of numpy to arrays of numpy. Hits differ if one of kdray's CPU engine and the
library has none, or if their t (for trimesh: their triangle) differ. Lines are those of the library's class below that
the task needs: building and asking.
"""

import argparse
import inspect
import time
import warnings
from importlib.metadata import version

import numpy as np

import kdray


class KdrayCpu:
    name, device = "kdray, CPU", "cpu"

    def build(self, vertices, triangles):
        self.scene = kdray.RaycastingScene(device=self.device)
        self.scene.add_triangles(vertices, triangles)

    def nearest(self, rays):
        return self.scene.cast_rays(rays)["t_hit"]

    def occluded(self, rays):
        return self.scene.test_occlusions(rays)

    def distance(self, points):
        return self.scene.compute_distance(points)

    def build_parts(self, parts):
        self.scene = kdray.RaycastingScene(device=self.device)
        self.ids = [self.scene.add_triangles(*part) for part in parts]

    def moved(self, transforms, rays):
        self.scene.update_transforms(self.ids, transforms)
        return self.scene.cast_rays(rays)["t_hit"]


class KdrayGpu(KdrayCpu):
    name, device = "kdray, GPU", None

    def __init__(self):
        if not [device for device in kdray.devices() if device.kind.endswith("GPU") and not device.missing]:
            raise ImportError("no GPU")


class Open3D:
    def __init__(self):
        import open3d

        self.o3d, self.name = open3d, f"Open3D {open3d.__version__}"

    def build(self, vertices, triangles):
        self.scene = self.o3d.t.geometry.RaycastingScene()
        self.scene.add_triangles(self.o3d.core.Tensor(vertices), self.o3d.core.Tensor(triangles))

    def nearest(self, rays):
        return self.scene.cast_rays(self.o3d.core.Tensor(rays))["t_hit"].numpy()

    def occluded(self, rays):
        return self.scene.test_occlusions(self.o3d.core.Tensor(rays)).numpy()

    def distance(self, points):
        return self.scene.compute_distance(self.o3d.core.Tensor(points)).numpy()

    def build_parts(self, parts):
        self.parts = parts

    def moved(self, transforms, rays):
        scene = self.o3d.t.geometry.RaycastingScene()
        for (vertices, triangles), at in zip(self.parts, transforms):
            placed = vertices @ at[:, :3].T + at[:, 3]
            scene.add_triangles(self.o3d.core.Tensor(placed.astype(np.float32)), self.o3d.core.Tensor(triangles))
        return scene.cast_rays(self.o3d.core.Tensor(rays))["t_hit"].numpy()


class Trimesh:
    share_of_points = 0.01

    def __init__(self):
        import embreex  # noqa: F401
        import trimesh

        self.trimesh, self.name = trimesh, f"trimesh {trimesh.__version__}, embreex {version('embreex')}"

    def build(self, vertices, triangles):
        self.mesh = self.trimesh.Trimesh(vertices, triangles, process=False)
        self.rays = self.trimesh.ray.ray_pyembree.RayMeshIntersector(self.mesh)

    def nearest(self, rays):
        return self.rays.intersects_first(rays[:, :3], rays[:, 3:])

    def occluded(self, rays):
        return self.rays.intersects_any(rays[:, :3], rays[:, 3:])

    def distance(self, points):
        return self.trimesh.proximity.closest_point(self.mesh, points)[1]


class Mitsuba:
    def __init__(self):
        import mitsuba

        self.mi, self.name = mitsuba, f"Mitsuba {mitsuba.__version__}, llvm"
        mitsuba.set_variant("llvm_ad_rgb")

    def build(self, vertices, triangles):
        mesh = self.mi.Mesh("mesh", len(vertices), len(triangles))
        arrays = self.mi.traverse(mesh)
        arrays["vertex_positions"], arrays["faces"] = vertices.reshape(-1), triangles.reshape(-1)
        arrays.update()
        self.scene = self.mi.load_dict({"type": "scene", "mesh": mesh})

    def rays_of(self, rays):
        columns = np.ascontiguousarray(rays.T)
        return self.mi.Ray3f(self.mi.Point3f(columns[:3]), self.mi.Vector3f(columns[3:]))

    def nearest(self, rays):
        return np.array(self.scene.ray_intersect_preliminary(self.rays_of(rays)).t)

    def occluded(self, rays):
        return np.array(self.scene.ray_test(self.rays_of(rays)))


def installed():
    for peer in [KdrayCpu, KdrayGpu, Open3D, Trimesh, Mitsuba]:
        try:
            yield peer()
        except ImportError as error:
            print(f"without {peer.__name__}: {error}")


def lines(peer, *methods):
    if isinstance(peer, Mitsuba) and "distance" not in methods:
        methods += ("rays_of",)
    return sum(len(inspect.getsource(getattr(peer, it)).strip().splitlines()) - 1 for it in methods)


def timed(repeat, call):
    """Calls once more than it measures: the first call builds."""
    result, times = call(), []
    for _ in range(repeat):
        begin = time.perf_counter()
        result = call()
        times.append(time.perf_counter() - begin)
    return result, min(times)


def differing(ours, expected):
    """Compares t, distances or flags."""
    if ours.dtype == bool:
        return int(np.sum(ours != expected))
    with np.errstate(invalid="ignore"):
        near = np.abs(ours - expected) <= 1e-4 * np.maximum(1e-3, np.abs(expected))
    return int(np.sum(~(near | (ours == expected))))


def row(task, peer, seconds, n, different, n_lines):
    rate = n / seconds / 1e6
    print(f"| {task} | {peer.name} | {1e3 * seconds:.1f} | {rate:.2f} | {different} | {n_lines} |", flush=True)


def queries(vertices, triangles, n):
    """Rays (n, 6) and points (n, 3) around a mesh."""
    random = np.random.default_rng(1)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
    side = int(n**0.5)
    eye = middle + radius * np.float32([0.6, 0.5, 1.7])
    camera = kdray.RaycastingScene.create_rays_pinhole(45, middle, eye, [0, -1, 0], side, side).reshape(-1, 6)
    scene = kdray.RaycastingScene(device="cpu")
    scene.add_triangles(vertices, triangles)
    hits = scene.cast_rays(camera)
    is_hit = np.flatnonzero(np.isfinite(hits["t_hit"]))
    chosen = np.sort(random.choice(is_hit, n))
    normals = hits["primitive_normals"][chosen]
    normals *= -np.sign(np.sum(normals * camera[chosen, 3:], axis=1, keepdims=True))
    points = camera[chosen, :3] + hits["t_hit"][chosen][:, None] * camera[chosen, 3:] + 1e-4 * radius * normals

    def sphere():
        points = random.normal(size=(n, 3))
        return points / np.linalg.norm(points, axis=1, keepdims=True)

    occlusion = np.concatenate([points, normals + 0.999 * sphere()], axis=1).astype(np.float32)
    begin, end = middle + radius * sphere(), middle + radius * sphere()
    scattered = np.concatenate([begin, end - begin], axis=1).astype(np.float32)
    return {
        "camera rays": ("nearest", camera),
        "ambient occlusion, any hit": ("occluded", occlusion),
        "ambient occlusion, nearest hit": ("nearest", occlusion),
        "random rays": ("nearest", scattered),
        "closest points": ("distance", random.uniform(low, high, (n, 3)).astype(np.float32)),
    }


def static(peers, mesh, n, repeat):
    vertices, triangles = np.float32(mesh.vertices), np.uint32(mesh.faces)
    for peer in peers:
        peer.build(vertices, triangles)
    for task, (method, asked) in queries(vertices, triangles, n).items():
        reference = getattr(peers[0], method)(asked)
        first = peers[0].scene.cast_rays(asked)["primitive_ids"].astype(np.int32) if method == "nearest" else None
        for peer in peers:
            if not hasattr(peer, method):
                continue
            share = getattr(peer, "share_of_points", 1) if method == "distance" else 1
            part = asked[: max(1, int(share * len(asked)))]
            result, seconds = timed(repeat, lambda: getattr(peer, method)(part))
            expected = first if isinstance(peer, Trimesh) and method == "nearest" else reference[: len(part)]
            different = differing(result, expected)
            row(task, peer, seconds, len(part), f"{different} of {len(part)}", lines(peer, "build", method))


def part_of(n_triangles):
    """A ball of about this many triangles, or a box for 12."""
    if n_triangles == 12:
        corner = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij")).reshape(3, 8).T
        quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
        return np.float32(corner - 0.5), np.uint32(quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))
    n = int((n_triangles / 2) ** 0.5)
    i, j = (it.reshape(-1) for it in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    down, around = np.meshgrid(np.linspace(0, np.pi, n + 1), np.linspace(0, 2 * np.pi, n + 1), indexing="ij")
    vertices = np.stack([np.sin(down) * np.cos(around), np.sin(down) * np.sin(around), np.cos(down)], axis=-1) / 2
    a, b = i * (n + 1) + j, (i + 1) * (n + 1) + j
    return np.float32(vertices.reshape(-1, 3)), np.uint32(np.stack([a, b, b + 1, a, b + 1, a + 1], 1).reshape(-1, 3))


def moving(peers, n_parts, n_triangles, n, repeat):
    random = np.random.default_rng(2)
    side = n_parts ** (1 / 3)
    origins = random.uniform(0, 2 * side, (n, 3))
    rays = np.concatenate([origins, random.normal(size=(n, 3))], axis=1).astype(np.float32)
    turns = [np.linalg.qr(random.normal(size=(n_parts, 3, 3)))[0] for _ in range(repeat + 1)]
    turns = [turn * np.sign(np.linalg.det(turn))[:, None, None] for turn in turns]
    moments = [np.concatenate([it, random.uniform(0, 2 * side, (n_parts, 3, 1))], axis=2) for it in turns]
    reference = None
    for peer in [peer for peer in peers if hasattr(peer, "moved")]:
        peer.build_parts([part_of(n_triangles)] * n_parts)
        frames = iter(moments)
        result, seconds = timed(repeat, lambda: peer.moved(next(frames), rays))
        reference = result if reference is None else reference
        task = f"{n_parts} moved meshes of {n_triangles} triangles"
        different = f"{differing(result, reference)} of {n}"
        row(task, peer, seconds, n, different, lines(peer, "build_parts", "moved"))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", help="a file that trimesh reads")
    parser.add_argument("--rays", type=int, default=1_000_000)
    parser.add_argument("--moving-rays", type=int, default=100_000)
    parser.add_argument("--boxes", type=int, default=1000)
    parser.add_argument("--meshes", type=int, default=1000)
    parser.add_argument("--triangles", type=int, default=10_000, help="of each of the meshes")
    parser.add_argument("--repeat", type=int, default=3)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    import trimesh

    mesh = trimesh.load(args.mesh, force="mesh", process=False)
    peers = list(installed())
    print(f"{args.mesh}: {len(mesh.faces)} triangles\n")
    print("| task | library | ms | million a second | hits that differ | lines |\n|---|---|--:|--:|--:|--:|")
    static(peers, mesh, args.rays, args.repeat)
    moving(peers, args.boxes, 12, args.moving_rays, args.repeat)
    moving(peers, args.meshes, args.triangles, args.moving_rays, args.repeat)


if __name__ == "__main__":
    main()

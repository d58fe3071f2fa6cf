"""The engines whose answers are judged: kdray, and Embree for comparison."""

import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

MISS = np.uint32(0xFFFFFFFF)


@dataclass
class Hits:
    """Distances in units of the direction's length, and triangle indices; infinity and MISS if a ray hits nothing."""

    t: np.ndarray
    triangle_ix: np.ndarray

    def __getitem__(self, selection):
        return Hits(self.t[selection], self.triangle_ix[selection])

    def copy(self):
        return Hits(self.t.copy(), self.triangle_ix.copy())


class Kdray:
    """The program kdray, called with `flags`. `folder` is for its files."""

    def __init__(self, program, name, flags, folder):
        self.program, self.name, self.flags, self.folder = program, name, flags, Path(folder)

    def cast(self, mesh, rays):
        obj, npy, npz = (self.folder / f"x.{suffix}" for suffix in ("obj", "npy", "npz"))
        with open(obj, "w") as file:
            # Nine digits represent a float32 exactly.
            file.writelines(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in mesh.vertices.tolist())
            file.writelines(f"f {a} {b} {c}\n" for a, b, c in (mesh.triangles + 1).tolist())
        np.save(npy, np.hstack([rays.origins, rays.directions]))
        subprocess.run([self.program, "cast", obj, npy, "-o", npz, "--quiet", *self.flags], check=True)
        with np.load(npz) as hits:
            return Hits(hits["t_hit"].astype(float), hits["primitive_ids"])


class Embree:
    """Embree, in its robust mode or its default mode."""

    def __init__(self, robust):
        self.robust, self.name = robust, "Embree, robust mode" if robust else "Embree, default mode"

    def cast(self, mesh, rays):
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        scene = EmbreeScene(robust=self.robust)
        TriangleMesh(scene, mesh.vertices, mesh.triangles.astype(np.int32))
        hits = scene.run(rays.origins, rays.directions, output=1)
        missed = hits["primID"] < 0
        return Hits(np.where(missed, np.inf, hits["tfar"]), np.where(missed, MISS, hits["primID"]).astype(np.uint32))

//! Meshes made by formulas and from fixed seeds.

use glam::Vec3;
use kdray::layout::Triangle;

/// Returns the triangle with these corners.
pub fn triangle(corners: [Vec3; 3]) -> Triangle {
    Triangle { v0: corners[0], v1: corners[1], v2: corners[2], ..Default::default() }
}

/// The random generator SplitMix64 (Steele, Lea and Flood 2014).
pub struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// Returns a number from 0 to 1, without 1.
    pub fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1 << 24) as f32
    }

    /// Returns a point in the cube from -1 to 1.
    pub fn point(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
}

/// Returns triangles whose corners are within `size`, along each axis, of random points in the cube from -1 to 1.
pub fn soup(n: usize, size: f32, seed: u64) -> Vec<Triangle> {
    let mut random = Random(seed);
    let mut corners = || {
        let center = random.point();
        triangle([(); 3].map(|()| center + random.point() * size))
    };
    (0..n).map(|_| corners()).collect()
}

/// Returns a patch of `n * n` squares of two triangles each. Their corners are `surface(u, v)`, with u and v from 0
/// to 1.
pub fn patch(n: usize, surface: impl Fn(f32, f32) -> Vec3) -> Vec<Triangle> {
    let corner = |i: usize, j: usize| surface(i as f32 / n as f32, j as f32 / n as f32);
    let square = |i: usize, j: usize| {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        [triangle([a, b, c]), triangle([a, c, d])]
    };
    (0..n * n).flat_map(|ix| square(ix % n, ix / n)).collect()
}

/// Returns a unit sphere by latitude and longitude. At the poles it has triangles without area.
pub fn sphere(n: usize) -> Vec<Triangle> {
    patch(n, |u, v| {
        let ((sin, cos), (height, radius)) = ((u * std::f32::consts::TAU).sin_cos(), {
            let (sin, cos) = (v * std::f32::consts::PI).sin_cos();
            (cos, sin)
        });
        Vec3::new(cos * radius, height, sin * radius)
    })
}

/// Returns a square of small hills on large hills.
pub fn terrain(n: usize) -> Vec<Triangle> {
    patch(n, |u, v| {
        let hills = |f: f32| (u * f).sin() * (v * f + 1.0).cos() / f;
        Vec3::new(u * 10.0, hills(5.0) + hills(23.0) + hills(71.0), v * 10.0)
    })
}

/// Returns a room of six flat walls of two triangles each, with two spheres in it.
pub fn room(n: usize) -> Vec<Triangle> {
    let mut triangles = boxed(Vec3::ZERO, Vec3::splat(10.0), 1);
    for (center, radius) in [(Vec3::new(3.0, 2.0, 4.0), 2.0), (Vec3::new(7.0, 1.0, 6.0), 1.0)] {
        triangles.extend(sphere(n).iter().map(|t| triangle([t.v0, t.v1, t.v2].map(|v| v * radius + center))));
    }
    triangles
}

/// Returns the six faces of a box, each of `n * n` squares. All triangles lie in planes perpendicular to an axis.
pub fn boxed(min: Vec3, max: Vec3, n: usize) -> Vec<Triangle> {
    let size = max - min;
    let mut triangles = Vec::new();
    for (axis, at) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, 0.0), (axis, 1.0)]) {
        triangles.extend(patch(n, |u, v| {
            let mut point = [at; 3];
            (point[(axis + 1) % 3], point[(axis + 2) % 3]) = (u, v);
            min + size * Vec3::from_array(point)
        }));
    }
    triangles
}

/// Returns random boxes. They have no symmetry, which would make many planes equally cheap.
pub fn boxes(n: usize) -> Vec<Triangle> {
    let mut random = Random(13);
    let mut next = || {
        let min = random.point() * 10.0;
        boxed(min, min + random.point().abs() * 2.0, 4)
    };
    (0..n).flat_map(|_| next()).collect()
}

/// Returns long thin triangles across the whole cube, the worst case for splits.
pub fn needles(n: usize, seed: u64) -> Vec<Triangle> {
    let mut random = Random(seed);
    let mut needle = || {
        let (from, to) = (random.point(), random.point());
        triangle([from, to, to + random.point() * 1e-3])
    };
    (0..n).map(|_| needle()).collect()
}

//! Tests of the smallest size of a scene: just above the limit its hits are those of the same scene at unit size;
//! below the limit it is refused.

use std::fmt::Write;

use glam::{Vec3, vec3};
use kdray::{
    accel::{
        Accel, Query,
        kdtree::{BuildOptions, KdTree, Traversal},
    },
    cast::{CpuCaster, GpuCaster},
    gpu::Context,
    layout::{Hit, NO_TRIANGLE, Ray, Triangle},
    scene::{MIN_EXTENT, SceneError},
    world::{FlatScene, Geometry},
};

use super::{
    load,
    support::{
        compare, devices,
        meshes::{placed, torus},
        random::Random,
    },
};

/// Returns a torus 2.8 units wide, and on its axis one that is 64 times smaller, whose triangles are down to 2^-13 of
/// the scene.
fn two_tori() -> Vec<Triangle> {
    [torus(64, 32), placed(torus(64, 32), 1.0 / 64.0, vec3(0.0, 0.25, 0.0))].concat()
}

fn scaled(triangles: &[Triangle], scale: f32) -> Vec<Triangle> {
    placed(triangles.to_vec(), scale, Vec3::ZERO)
}

/// Writes triangles to an OBJ file with all digits of their coordinates, and loads it.
fn load_triangles(triangles: &[Triangle]) -> Result<FlatScene, SceneError> {
    let mut obj = String::new();
    for (ix, t) in triangles.iter().enumerate() {
        for v in [t.v0, t.v1, t.v2] {
            writeln!(obj, "v {:e} {:e} {:e}", v.x, v.y, v.z).unwrap();
        }
        writeln!(obj, "f {} {} {}", 3 * ix + 1, 3 * ix + 2, 3 * ix + 3).unwrap();
    }
    load(&[("tori.obj", obj.as_bytes())])
}

/// Returns rays from around the scene towards points of its triangles and of their edges, and some in random
/// directions.
fn rays(triangles: &[Triangle], n: usize) -> Vec<Ray> {
    let mut random = Random(7);
    let ray = |_| {
        let t = random.of(triangles);
        let origin = 3.0 * random.direction() * random.unit();
        let target = match random.below(8) {
            0 => t.v0.lerp(t.v1, random.unit()),
            1 => t.v0,
            2 => origin + random.direction(),
            _ => t.v0.lerp(t.v1, random.unit()).lerp(t.v2, random.unit()),
        };
        Ray { origin, t_min: 0.0, direction: target - origin, t_max: f32::INFINITY }
    };
    (0..n).map(ray).collect()
}

fn cast_on_cpu(triangles: &[Triangle], traversal: Traversal, rays: &[Ray]) -> Vec<Hit> {
    let accel = Accel::KdTree(KdTree::build(triangles, &BuildOptions::default()));
    let geometry = Geometry::new(triangles, &accel).expect("a tree of these triangles");
    CpuCaster::new(geometry, traversal).cast(rays, Query::Closest)
}

fn cast_on_device(context: &std::sync::Arc<Context>, triangles: &[Triangle], rays: &[Ray]) -> Vec<Hit> {
    let accel = Accel::KdTree(KdTree::build(triangles, &BuildOptions::default()));
    let geometry = Geometry::new(triangles, &accel).expect("a tree of these triangles");
    GpuCaster::new(context, geometry, Traversal::Stack).unwrap().cast(rays, Query::Closest, 1).unwrap().hits
}

/// Returns the number of rays whose hits differ in the triangle or in the distance.
fn n_differing(expected: &[Hit], found: &[Hit]) -> usize {
    expected.iter().zip(found).filter(|(a, b)| a.triangle_ix != b.triangle_ix || a.t != b.t).count()
}

/// Returns the same rays in the scaled scene. Directions are scaled too, so that t stays the same.
fn scaled_rays(rays: &[Ray], scale: f32) -> Vec<Ray> {
    rays.iter().map(|ray| Ray { origin: scale * ray.origin, direction: scale * ray.direction, ..*ray }).collect()
}

#[test]
fn just_above_the_limit_every_ray_hits_what_it_hits_at_unit_size() {
    let unit = two_tori();
    let scale = 2f32.powi(-28);
    let small = load_triangles(&scaled(&unit, scale)).unwrap();
    assert_eq!(small.triangles.iter().map(|t| t.v2).collect::<Vec<_>>(), {
        scaled(&unit, scale).iter().map(|t| t.v2).collect::<Vec<_>>()
    });
    assert!(2.8 * scale < 1.05 * MIN_EXTENT, "the scene is just above the limit");
    let rays = rays(&unit, 40_000);
    let small_rays = scaled_rays(&rays, scale);
    for traversal in [Traversal::Stack, Traversal::Mask] {
        let expected = cast_on_cpu(&unit, traversal, &rays);
        let n_hits = expected.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count();
        assert!(n_hits > 20_000 && n_hits < 40_000, "{n_hits}");
        let found = cast_on_cpu(&small.triangles, traversal, &small_rays);
        assert_eq!(n_differing(&expected, &found), 0, "{traversal}");
    }
    let context = devices::device();
    let expected = cast_on_device(&context, &unit, &rays);
    let found = cast_on_device(&context, &small.triangles, &small_rays);
    // Where rays meet a common edge, rounding decides which of two triangles is hit at the same distance.
    compare::hits(0, &expected, &found).unwrap();
    assert!(context.validation_messages().is_empty());
}

/// Shows that the limit is necessary: far below it, the same comparison notices lost hits.
#[test]
fn far_below_the_limit_hits_are_lost() {
    let (unit, scale) = (two_tori(), 2f32.powi(-70));
    let rays = rays(&unit, 10_000);
    let expected = cast_on_cpu(&unit, Traversal::Stack, &rays);
    let found = cast_on_cpu(&scaled(&unit, scale), Traversal::Stack, &scaled_rays(&rays, scale));
    let is_lost = |(a, b): &(&Hit, &Hit)| a.triangle_ix != NO_TRIANGLE && b.triangle_ix == NO_TRIANGLE;
    assert!(expected.iter().zip(&found).filter(is_lost).count() > 100);
}

#[test]
fn just_below_the_limit_a_scene_is_refused() {
    let unit = two_tori();
    let error = load_triangles(&scaled(&unit, 2f32.powi(-29))).unwrap_err().to_string();
    for part in ["tori.obj: is too small", "longest side is 5.22e-9", "less than 1e-8", "scale it up"] {
        assert!(error.contains(part), "{error}");
    }
    let disc = "[[mesh]]\ngenerator = 'disc'\nradius = 1\nsegments = 8\n";
    let of_scale = |scale: &str| load(&[("a.toml", format!("{disc}transform.scale = {scale}").as_bytes())]);
    assert!(of_scale("5.1e-9").is_ok());
    let error = of_scale("4.9e-9").unwrap_err().to_string();
    assert!(error.contains("a.toml: is too small to be traced") && error.contains("9.80e-9"), "{error}");
    // Far from the origin, all corners of a triangle may be rounded to one point.
    let point = "v 500000 5200000.1 0\nv 500000.01 5200000.1 0\nv 500000 5200000.2 0\nf 1 2 3\n";
    let error = load(&[("utm.obj", point.as_bytes())]).unwrap_err().to_string();
    assert!(error.contains("5.00e-1 apart") && error.contains("move it to the origin"), "{error}");
}

/// A step of an eighth between points half a million away from 0 is lost in single precision, unless the points are
/// taken relative to an origin there.
#[test]
fn an_origin_keeps_the_details_of_far_points() {
    let far = [500_000.0, 4_100_000.0, -8.0];
    let points = [[0.125, 0.0, 0.0], [9.0, 0.0625, 0.0], [0.0, 7.0, 2.5]];
    let word = |p: [f64; 3]| format!("{} {} {}", far[0] + p[0], far[1] + p[1], far[2] + p[2]);
    let lines = points.map(word);
    let obj = format!("v {}\nv {}\nv {}\nf 1 2 3\n", lines[0], lines[1], lines[2]);
    let coloured = format!("v {} 1 0 0\nv {}\nv {}\nf 1 2 3\n", lines[0], lines[1], lines[2]);
    let ply = |colour: &str, value: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n{colour}\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n{}{value}\n{}{value}\n{}{value}\n\
             3 0 1 2\n",
            lines[0], lines[1], lines[2]
        )
    };
    let red = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    for (name, content) in
        [("a.obj", obj.clone()), ("a.obj", coloured), ("a.ply", ply("", "")), ("a.ply", ply(red, " 9 9 9"))]
    {
        let toml = format!("[[mesh]]\nfile = '{name}'\norigin = {far:?}\n");
        let scene = load(&[("a.toml", toml.as_bytes()), (name, content.as_bytes())]).unwrap();
        let t = &scene.triangles[0];
        let found = [t.v0, t.v1, t.v2].map(|v| v.as_dvec3().to_array());
        assert_eq!(found, points, "{content}");
        let plain = format!("[[mesh]]\nfile = '{name}'\n");
        let scene = load(&[("a.toml", plain.as_bytes()), (name, content.as_bytes())]).unwrap();
        assert_eq!(scene.triangles[0].v1.y, 4_100_000.0, "single precision has only multiples of 0.25 there");
    }
    let stl = format!(
        "solid a\nfacet normal 0 0 1\nouter loop\nvertex {}\nvertex {}\nvertex {}\nendloop\nendfacet\nendsolid a\n",
        lines[0], lines[1], lines[2]
    );
    let toml = format!("[[mesh]]\nfile = 'a.stl'\norigin = {far:?}\n");
    let scene = load(&[("a.toml", toml.as_bytes()), ("a.stl", stl.as_bytes())]).unwrap();
    assert_eq!(scene.triangles[0].v2.to_array(), [0.0, 7.0, 2.5]);
    // The warning of a bare file names an origin.
    let (scene, warnings) = super::materials::load_scene(&[("a.obj", obj.as_bytes())]);
    assert!(scene.is_ok());
    let names_origin = |warning: &String| warning.contains("`origin = [500005.0, 4100004.0, -7.0]`");
    assert!(warnings.iter().any(names_origin), "{warnings:?}");
    for origin in ["[1e13, 0, 0]", "[nan, 0, 0]"] {
        let toml = format!("[[mesh]]\nfile = 'a.obj'\norigin = {origin}\n");
        let error = load(&[("a.toml", toml.as_bytes()), ("a.obj", obj.as_bytes())]).unwrap_err().to_string();
        assert!(error.contains("a.toml:1: mesh 1: origin = ["), "{error}");
    }
}

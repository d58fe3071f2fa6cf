//! Tests of the slabs that a device computes for a kd-tree: they hold all triangles, resemble the host's and those of
//! the kernels' twin, and change no hit.

use std::sync::Arc;

use crate::support::{
    MeshWithTree, assert_silent, compare, device, meshes,
    random::Random,
    rays::{N_KINDS, nasty_ray},
};
use glam::{Vec3, vec3};
use kdray::{
    accel::{
        Accel, Query,
        kdtree::{BuildOptions, Invalid, KdArrays, KdTree, Traversal},
    },
    buffers::TreeBuffers,
    cast::{Ray, cast_on_cpu},
    gpu::{Context, Timer},
    layout::{Hit, KD_SLAB_MAX_ENTRIES, Slab, Triangle},
    passes::kd_slabs::SlabBuilder,
    reference::kd_slabs::kd_slabs,
    world::Geometry,
};

/// Returns the tree of the triangles, with slabs or without.
fn tree_of(triangles: &[Triangle], slabs: bool) -> KdTree {
    KdTree::build(triangles, &BuildOptions { slabs, ..BuildOptions::default() })
}

/// Returns the arrays of a tree with the slabs that the device computes. Two runs make the same bits.
fn arrays_with_slabs(context: &Arc<Context>, tree: &KdTree, triangles: &[Triangle]) -> KdArrays {
    let buffers = TreeBuffers::of_host(context, tree, triangles).expect("a tree");
    let builder = SlabBuilder::new(context, &buffers).expect("a builder");
    let run = || {
        builder.build(None).expect("slabs");
        (buffers.nodes.download().expect("nodes"), buffers.slabs.download().expect("slabs"))
    };
    let (nodes, slabs) = run();
    assert_eq!(run(), (nodes.clone(), slabs.clone()), "the second run");
    KdArrays { nodes, slabs, ..tree.clone().into_arrays() }
}

fn n_slabs(tree: &KdTree) -> usize {
    (0..tree.nodes().len() as u32).filter(|&node_ix| tree.slab_of(node_ix).is_some()).count()
}

/// Whether two slabs are the same but for rounding. Either normal of a surface makes the same slab. Half a slab of a
/// flat surface is some 256 units in the last place of the coordinates thick, of which rounding takes several.
fn are_near(found: &Slab, expected: &Slab) -> bool {
    let sign = if found.normal.dot(expected.normal) < 0.0 { -1.0 } else { 1.0 };
    (sign * found.normal - expected.normal).length() <= 1e-3 * expected.normal.length()
        && (sign * found.offset - expected.offset).abs() <= (2e-2 * expected.offset.abs()).max(0.1)
}

/// Returns the tree of the triangles with slabs of the device. They are valid and those of the twin, but for nodes that
/// are nearly too thick, and for rounding.
fn check(context: &Arc<Context>, name: &str, triangles: &[Triangle]) -> KdTree {
    let bare = tree_of(triangles, false);
    let arrays = arrays_with_slabs(context, &bare, triangles);
    let of_twin = kd_slabs(&bare, triangles);
    let n_far = arrays.slabs.iter().zip(&of_twin).filter(|(a, b)| !are_near(a, b)).count();
    // The slabs of an inclined plane depend on the last bits of quotients, which GPUs round differently.
    let most = if context.is_software() { of_twin.len() / 200 } else { of_twin.len() / 20 };
    assert!(n_far <= most, "{name}: {n_far} of {} slabs are not the twin's", of_twin.len());
    let tree = KdTree::from_arrays(arrays, triangles).unwrap_or_else(|error| panic!("{name}: {error}"));
    println!("{name}: {} slabs, the host has {}", n_slabs(&tree), n_slabs(&tree_of(triangles, true)));
    tree
}

/// Returns needles of length 1 in all directions.
fn needles(n: usize) -> Vec<Triangle> {
    let mut random = Random(4);
    let needle = |_| {
        let v0 = random.in_box(Vec3::NEG_ONE, Vec3::ONE);
        meshes::triangle(v0, v0 + random.direction(), v0 + 1e-4 * random.direction())
    };
    (0..n).map(needle).collect()
}

/// Returns a sheet in a slanted plane.
fn sheet() -> Vec<Triangle> {
    let in_plane = |v: Vec3| vec3(v.x, v.z, v.x + 0.5 * v.z);
    let flat = meshes::cube(24, 0.0).into_iter().filter(|t| t.v0.y == 1.0 && t.v1.y == 1.0 && t.v2.y == 1.0);
    flat.map(|t| meshes::triangle(in_plane(t.v0), in_plane(t.v1), in_plane(t.v2))).collect()
}

/// Returns tori of very different sizes, so that the tree has several scales.
fn tori_of_all_sizes() -> Vec<Triangle> {
    let sizes = (-3..=2).map(|exponent| 10_f32.powi(exponent));
    sizes.flat_map(|size| meshes::placed(meshes::torus(24, 12), size, 3.0 * size * Vec3::X)).collect()
}

#[test]
fn slabs_hold_all_triangles() {
    let context = device();
    let torus = || meshes::torus(60, 30);
    let n_equal = KD_SLAB_MAX_ENTRIES as usize;
    check(&context, "none", &[]);
    check(&context, "one", &[meshes::triangle(Vec3::X, Vec3::Y, Vec3::Z)]);
    assert!(n_slabs(&check(&context, "torus", &torus())) > 100);
    check(&context, "cube", &meshes::cube(12, 0.0));
    check(&context, "sphere", &meshes::cube(20, 1.0));
    check(&context, "soup", &meshes::soup(2000, 7));
    check(&context, "needles", &needles(500));
    assert!(n_slabs(&check(&context, "sheet", &sheet())) > 100);
    check(&context, "equal", &[meshes::triangle(Vec3::X, Vec3::Y, Vec3::Z); 40]);
    check(&context, "many equal", &vec![meshes::triangle(Vec3::X, Vec3::Y, Vec3::Z); n_equal]);
    let more = check(&context, "more equal", &vec![meshes::triangle(Vec3::X, Vec3::Y, Vec3::Z); n_equal + 1]);
    assert_eq!(n_slabs(&more), 0);
    check(&context, "points", &[meshes::triangle(Vec3::ONE, Vec3::ONE, Vec3::ONE); 40]);
    check(&context, "all sizes", &tori_of_all_sizes());
    assert!(n_slabs(&check(&context, "tiny", &meshes::placed(torus(), 1e-6, Vec3::ZERO))) > 100);
    assert!(n_slabs(&check(&context, "huge", &meshes::placed(torus(), 1e6, Vec3::ZERO))) > 100);
    check(&context, "far", &meshes::placed(torus(), 10.0, vec3(1e5, -1e5, 3.0)));
    check(&context, "1e-37", &meshes::placed(torus(), 1e-37, Vec3::ZERO));
    check(&context, "1e37", &meshes::placed(torus(), 1e37, Vec3::ZERO));
    assert_silent(&context);
}

/// Returns the mean half thickness of the slabs of nodes that have one in both trees, for each tree.
fn mean_thickness(trees: [&KdTree; 2]) -> [f32; 2] {
    let nodes = 0..trees[0].nodes().len() as u32;
    let both = nodes.filter_map(|node_ix| Some([trees[0].slab_of(node_ix)?, trees[1].slab_of(node_ix)?]));
    let both: Vec<[f32; 2]> = both.map(|slabs| slabs.map(|slab| 1.0 / slab.normal.length())).collect();
    [0, 1].map(|tree| both.iter().map(|pair| pair[tree]).sum::<f32>() / both.len() as f32)
}

#[test]
fn slabs_resemble_those_of_the_host() {
    let context = device();
    let triangles = meshes::knot(400, 25);
    let (on_device, on_host) = (check(&context, "knot", &triangles), tree_of(&triangles, true));
    let [found, expected] = [n_slabs(&on_device), n_slabs(&on_host)];
    assert!(found.abs_diff(expected) * 50 < expected, "{found} slabs, not {expected}");
    let [found, expected] = mean_thickness([&on_device, &on_host]);
    println!("mean half thickness {found:e}, {expected:e} on the host");
    assert!((found / expected - 1.0).abs() < 0.03, "{found} thick, not {expected}");
    assert_silent(&context);
}

#[test]
fn thinner_slabs_are_noticed() {
    let context = device();
    let triangles = meshes::torus(60, 30);
    let mut arrays = arrays_with_slabs(&context, &tree_of(&triangles, false), &triangles);
    for slab in &mut arrays.slabs {
        *slab = Slab { normal: 1.25 * slab.normal, offset: 1.25 * slab.offset };
    }
    assert!(matches!(KdTree::from_arrays(arrays, &triangles), Err(Invalid::OutsideSlab { .. })));
    assert_silent(&context);
}

#[test]
fn slabs_change_no_hit() {
    let context = device();
    for (name, triangles) in [
        ("knot", meshes::knot(120, 12)),
        ("soup", meshes::soup(600, 3)),
        ("sheet", sheet()),
        ("all sizes", tori_of_all_sizes()),
    ] {
        let tree = check(&context, name, &triangles);
        let world = MeshWithTree::with_tree(triangles, tree);
        let ray = |ix: usize| {
            let ray = nasty_ray(&mut Random(ix as u64), &world, ix);
            Ray { origin: ray.origin, t_min: 0.0, direction: ray.direction, t_max: ray.t_max }
        };
        let rays: Vec<Ray> = (0..200 * N_KINDS).map(ray).collect();
        let hits_through = |accel: &Accel, traversal| -> Vec<Hit> {
            let geometry = Geometry::new(&world.triangles, accel).expect("a tree of these triangles");
            cast_on_cpu(geometry, traversal, &rays, Query::Closest)
        };
        let expected = hits_through(&world.accel, Traversal::Brute);
        let on_host = Accel::KdTree(tree_of(&world.triangles, true));
        for accel in [&world.accel, &on_host] {
            for traversal in [Traversal::Mask, Traversal::Stack] {
                compare::exact(&expected, &hits_through(accel, traversal)).unwrap_or_else(|it| panic!("{name}: {it}"));
            }
        }
    }
    assert_silent(&context);
}

/// Prints the time of each kernel on a GPU. It is not run with the other tests: it shows times and asserts nothing.
#[test]
#[ignore = "prints times"]
fn times_of_kernels() {
    let context = device();
    let triangles = meshes::knot(4400, 100);
    let tree = tree_of(&triangles, false);
    println!("{} nodes, {} entries", tree.nodes().len(), tree.leaf_triangles().len());
    let buffers = TreeBuffers::of_host(&context, &tree, &triangles).expect("a tree");
    let builder = SlabBuilder::new(&context, &buffers).expect("a builder");
    let timer = Timer::new(&context, SlabBuilder::N_STAGES).expect("a timer");
    for run in 0..4 {
        for row in builder.build(Some(&timer)).expect("slabs") {
            println!("{run} {} {:?} ms", row.name, row.span_ms.map(|(begin, end)| end - begin));
        }
    }
}

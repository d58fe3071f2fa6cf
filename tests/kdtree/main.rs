//! Tests of the kd-tree. It is valid and within its bounds on any input, the same on any number of threads, about as
//! cheap as that of a plain exact builder, and finds the hits of brute force. Each check of the validator fails on a
//! planted error.

mod meshes;
mod oracle;
mod plants;

use glam::Vec3;
use kdray::{
    accel::kdtree::{BuildOptions, KdTree, Node},
    layout::{KD_MAX_DEPTH, Triangle},
};
use meshes::{Random, boxed, boxes, needles, room, soup, sphere, terrain, triangle};

/// Returns meshes of every kind, each with its name.
fn all_meshes() -> Vec<(&'static str, Vec<Triangle>)> {
    vec![
        ("sphere", sphere(70)),
        ("terrain", terrain(70)),
        ("room", room(40)),
        ("box", boxed(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0), 16)),
        // Most walls are inside the root's cell and lie in the planes of splits.
        ("boxes", boxes(20)),
        ("small soup", soup(5000, 0.02, 1)),
        ("large soup", soup(500, 0.5, 2)),
        ("needles", needles(500, 3)),
    ]
}

/// Builds a tree, and asserts that it is valid and within the limits of depth and of references.
fn build(triangles: &[Triangle], options: &BuildOptions) -> KdTree {
    let tree = KdTree::build(triangles, options);
    assert_eq!(tree.validate(triangles), Ok(()));
    assert!(tree.depth() <= options.depth_limit());
    let budget = triangles.len() * options.max_references_per_triangle as usize + 1024;
    assert!(tree.leaf_triangles().len() <= budget, "{} references", tree.leaf_triangles().len());
    tree
}

#[test]
fn is_as_cheap_as_a_plain_exact_build() {
    for (name, triangles) in all_meshes() {
        for (intersection_cost, empty_bonus) in [(0.5, 0.1), (1.0, 0.2), (0.35, 0.0)] {
            let max_references_per_triangle = 1000;
            let options =
                BuildOptions { intersection_cost, empty_bonus, max_references_per_triangle, ..Default::default() };
            let tree = build(&triangles, &options);
            let cost = tree.statistics(triangles.len(), &options).sah_cost.expect("a cost");
            let oracle = oracle::sah_cost(&triangles, &options);
            println!("{name}: {cost:.4}, plain {oracle:.4}");
            // The trees may differ, because rounding decides between planes of equal weight.
            assert!(cost <= oracle * 1.005, "{name}: {cost} against {oracle}");
        }
    }
}

/// Planes between bins make another tree, which is little worse. Cells of few triangles use no bins, so a small mesh
/// has the same tree.
#[test]
fn is_nearly_as_cheap_without_exact_planes() {
    let mut n_same = 0;
    for (name, triangles) in all_meshes() {
        let exact = BuildOptions::default();
        let fast = BuildOptions { exact_planes: false, ..exact.clone() };
        let trees = [&exact, &fast].map(|options| build(&triangles, options));
        let [cost, fast_cost] =
            [&trees[0], &trees[1]].map(|tree| tree.statistics(triangles.len(), &exact).sah_cost.expect("a cost"));
        println!("{name}: {cost:.4}, {fast_cost:.4}");
        assert!(fast_cost <= cost * 1.05, "{name}: {fast_cost} against {cost}");
        n_same += usize::from(trees[0] == trees[1]);
    }
    assert!(n_same < all_meshes().len() / 2);
    let few = soup(32, 0.5, 12);
    let [exact, fast] = [true, false].map(|exact_planes| BuildOptions { exact_planes, ..Default::default() });
    assert_eq!(build(&few, &exact), build(&few, &fast));
}

#[test]
fn is_the_same_on_any_number_of_threads() {
    // The mesh is large enough for parallel counting, sorting and partition.
    let triangles = [sphere(180), terrain(120), soup(3000, 0.2, 4)].concat();
    for options in [BuildOptions::default(), BuildOptions::fast()] {
        let build_with = |n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
            pool.install(|| build(&triangles, &options))
        };
        let first = build_with(1);
        for n_threads in [1, 2, 4] {
            assert_eq!(build_with(n_threads), first, "{n_threads} threads");
        }
    }
}

#[test]
fn of_nothing_or_one_triangle_is_a_leaf() {
    let none = build(&[], &BuildOptions::default());
    assert_eq!((none.nodes().len(), none.node(0)), (2, Node::Leaf { first: 0, count: 0 }));
    assert_eq!((none.box_min(), none.box_max()), (Vec3::splat(-f32::MIN_POSITIVE), Vec3::splat(f32::MIN_POSITIVE)));
    let one = build(&[triangle([Vec3::X, Vec3::Y, Vec3::Z])], &BuildOptions::default());
    assert_eq!((one.node(0), one.leaf_triangles()), (Node::Leaf { first: 0, count: 1 }, &[0][..]));
    let margin = 2f32.powi(-17);
    assert_eq!((one.box_min(), one.box_max()), (Vec3::splat(-margin), Vec3::splat(1.0 + margin)));
}

#[test]
fn survives_any_finite_input() {
    let point = |n: usize| vec![triangle([Vec3::ONE; 3]); n];
    let segments: Vec<_> = soup(2000, 0.3, 5).iter().map(|t| triangle([t.v0, t.v1, t.v0])).collect();
    let line: Vec<_> = (0..2000).map(|i| triangle([0, 1, 2].map(|k| Vec3::X * (i + k) as f32))).collect();
    let flat: Vec<_> = terrain(60).iter().map(|t| triangle([t.v0, t.v1, t.v2].map(|v| v.with_y(2.0)))).collect();
    let nested: Vec<_> = (0..100).flat_map(|i| scaled(&sphere(4), 1.5f32.powi(-i))).collect();
    let inputs = [
        ("points", point(20_000)),
        ("identical", vec![triangle([Vec3::X, Vec3::Y, Vec3::Z]); 20_000]),
        ("coincident meshes", vec![sphere(20); 10].concat()),
        ("segments", segments),
        ("a line", line),
        ("flat", flat),
        ("two planes", boxed(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), 30)),
        ("nested", nested),
        ("huge", scaled(&room(20), 1e18)),
        ("largest", scaled(&soup(1000, 1e-6, 6), 3.4e38)),
        ("tiny", scaled(&room(20), 1e-30)),
        ("tinier", scaled(&soup(1000, 0.1, 7), 1e-34)),
        ("nearly subnormal", scaled(&soup(1000, 0.1, 7), 1e-37)),
        ("subnormal", scaled(&soup(1000, 0.1, 7), 1e-42)),
        ("wide range", [scaled(&sphere(20), 1e-12), scaled(&sphere(20), 1e12)].concat()),
        ("far away", soup(3000, 0.1, 8).iter().map(|t| triangle([t.v0, t.v1, t.v2].map(|v| v + 1e5))).collect()),
        ("needles", needles(3000, 9)),
        ("large soup", soup(3000, 2.0, 10)),
    ];
    for (name, triangles) in inputs {
        for options in [BuildOptions::default(), BuildOptions::fast()] {
            let tree = build(&triangles, &options);
            let statistics = tree.statistics(triangles.len(), &options);
            println!("{name}: {}", serde_json::to_string(&statistics).unwrap());
        }
    }
}

fn scaled(triangles: &[Triangle], factor: f32) -> Vec<Triangle> {
    triangles.iter().map(|t| triangle([t.v0, t.v1, t.v2].map(|v| v * factor))).collect()
}

#[test]
fn leaves_out_what_is_not_finite() {
    let mut triangles = sphere(20);
    triangles[7].v1.x = f32::NAN;
    triangles[8].v2.z = f32::INFINITY;
    let tree = build(&triangles, &BuildOptions::default());
    assert!(!tree.leaf_triangles().contains(&7) && !tree.leaf_triangles().contains(&8));
    assert!(tree.leaf_triangles().contains(&9));
}

#[test]
fn keeps_its_limits() {
    let triangles = needles(2000, 11);
    let unbounded =
        BuildOptions { max_references_per_triangle: 1 << 20, intersection_cost: 10.0, ..Default::default() };
    let n_references = build(&triangles, &unbounded).leaf_triangles().len();
    for max_references_per_triangle in [0, 1, 2, 4] {
        let options = BuildOptions { max_references_per_triangle, ..unbounded.clone() };
        // The build keeps the limit, but is not much stricter than necessary.
        if max_references_per_triangle > 0 {
            let n = build(&triangles, &options).leaf_triangles().len();
            assert!(n < n_references && n > max_references_per_triangle as usize * 1000, "{n}");
        }
    }
    for max_depth in [0, 1, 5, 100] {
        let options = BuildOptions { max_depth: Some(max_depth), ..unbounded.clone() };
        assert!(build(&triangles, &options).depth() <= max_depth.min(KD_MAX_DEPTH - 2));
    }
}

#[test]
fn statistics_of_a_split_by_hand() {
    // Two small triangles are at either end of a box of 4 x 1 x 1. The candidate planes between them are 1 and 3.
    let at = |x: f32| triangle([Vec3::new(x, 0.0, 0.0), Vec3::new(x + 1.0, 1.0, 0.0), Vec3::new(x, 0.0, 1.0)]);
    let triangles = [at(0.0), at(3.0)];
    let options = BuildOptions { intersection_cost: 4.0, empty_bonus: 0.0, max_depth: Some(1), ..Default::default() };
    let tree = build(&triangles, &options);
    let statistics = tree.statistics(2, &options);
    // The cost is one step and one test in each child: of 1 x 1 x 1 (surface 6 of 18) and 3 x 1 x 1 (14 of 18).
    assert!((statistics.sah_cost.expect("a cost") - (1.0 + 4.0 * 20.0 / 18.0)).abs() < 1e-3, "{statistics:?}");
    assert_eq!((statistics.n_nodes, statistics.n_leaves, statistics.n_empty_leaves), (3, 2, Some(0)));
    assert_eq!((statistics.n_references, statistics.references_per_triangle, statistics.depth), (2, 1.0, 1));
    assert_eq!(statistics.bytes, 4 * 8 + 2 * 4 + 2 * 4 + 2 * 16 + 4 * 16);
}

#[test]
fn finds_what_brute_force_finds() {
    let mut random = Random(12);
    for (name, triangles) in all_meshes() {
        let tree = build(&triangles, &BuildOptions::default());
        let (center, size) = ((tree.box_min() + tree.box_max()) * 0.5, (tree.box_max() - tree.box_min()).length());
        for _ in 0..200 {
            let origin = center + random.point() * size;
            let direction = center + random.point() * size * 0.4 - origin;
            let all: Vec<u32> = (0..triangles.len() as u32).collect();
            let expected = closest(&triangles, &all, origin, direction);
            let found = closest(&triangles, &candidates(&tree, origin, direction), origin, direction);
            assert_eq!(found, expected, "{name}: ray from {origin} along {direction}");
        }
    }
}

/// Returns all triangles of the leaves whose cells a ray meets.
fn candidates(tree: &KdTree, origin: Vec3, direction: Vec3) -> Vec<u32> {
    let mut found = Vec::new();
    let mut stack = vec![(0, tree.box_min(), tree.box_max())];
    while let Some((node, min, max)) = stack.pop() {
        let slack = Vec3::splat((max - min).max_element() * 1e-5);
        let (to_min, to_max) = ((min - slack - origin) / direction, (max + slack - origin) / direction);
        if to_min.min(to_max).max_element() > to_min.max(to_max).min_element() {
            continue;
        }
        match tree.node(node) {
            Node::Leaf { first, count } => found.extend(&tree.leaf_triangles()[first as usize..][..count as usize]),
            Node::Split { axis, position, child } => {
                let (mut below_max, mut above_min) = (max, min);
                (below_max[axis], above_min[axis]) = (position, position);
                stack.extend([(child, min, below_max), (child + 1, above_min, max)]);
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

/// Returns the distance and the index of the closest hit (Moeller and Trumbore 1997).
fn closest(triangles: &[Triangle], candidates: &[u32], origin: Vec3, direction: Vec3) -> Option<(f32, u32)> {
    let hit = |&ix: &u32| {
        let t = &triangles[ix as usize];
        let (e1, e2, s) = (t.v1 - t.v0, t.v2 - t.v0, origin - t.v0);
        let p = direction.cross(e2);
        let (det, q) = (e1.dot(p), s.cross(e1));
        let (u, v, t) = (s.dot(p) / det, direction.dot(q) / det, e2.dot(q) / det);
        (det != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some((t, ix))
    };
    candidates.iter().filter_map(hit).min_by(|a, b| a.partial_cmp(b).expect("finite"))
}

//! Trees that a device builds: they are those of the twin, node for node, the host's validator accepts them, and they
//! cost hardly more than the host's trees.

use std::{f32::consts::TAU, sync::Arc};

use glam::{Vec3, vec3};
use kdray::{
    accel::{
        Statistics,
        kdtree::{self, BuildOptions, KdArrays, KdTree},
    },
    buffers::KdTreeRoom,
    gpu::{Buffer, BufferUse, Context, Timer},
    layout::{
        KD_BIN_BLOCK, KD_BLOCK_SIZE, KD_GROUPS_X, KD_HAS_SLAB, KD_LEAF, KD_PAIR_SHIFT, KD_SMALL_CELL, KD_WORD_DEPTH,
        KdNode, SCAN_GROUP_SIZE, Slab, StructurePlace, Triangle,
    },
    passes::kdtree::{BuiltTree, KdTreeBuilder, KdTreeBuilderOptions},
    reference::{
        kd_slabs::kd_slabs,
        kdtree_build::{Tree, kdtree_build},
    },
};

use crate::support::{assert_silent, device, meshes};

/// The most by which a device's tree may cost more than the host's.
const MOST_COST: f64 = 1.02;

/// Options of a tree without slabs.
fn bare() -> KdTreeBuilderOptions {
    let tree = BuildOptions { slabs: false, ..BuildOptions::default() };
    KdTreeBuilderOptions { tree, ..KdTreeBuilderOptions::default() }
}

fn builder(context: &Arc<Context>, triangles: &[Triangle], options: &KdTreeBuilderOptions) -> KdTreeBuilder {
    let buffer = Buffer::with(context, "triangles", triangles, BufferUse::Storage).expect("triangles");
    KdTreeBuilder::new(context, &buffer, options).expect("a builder")
}

fn built(builder: &KdTreeBuilder) -> (BuiltTree, KdArrays) {
    let built = builder.build(None).expect("a tree");
    let arrays = builder.read_back(&built).expect("its arrays");
    (built, arrays)
}

/// Returns the cost of a tree as a multiple of that of the host's tree.
fn relative_cost(tree: &KdTree, triangles: &[Triangle]) -> f64 {
    let host = BuildOptions { slabs: false, max_depth: Some(KD_WORD_DEPTH), ..BuildOptions::default() };
    let [cost, expected] = [tree, &KdTree::build(triangles, &host)]
        .map(|tree| tree.statistics(triangles.len(), &host).sah_cost.expect("a cost"));
    if expected > 0.0 { cost / expected } else { 1.0 + cost }
}

/// Checks a tree against the twin's, which knows only scale 0. Software drivers divide exactly, GPUs need not.
fn check_twin(context: &Context, name: &str, triangles: &[Triangle], (found, arrays): (&BuiltTree, &KdArrays)) {
    if context.is_software() && found.finest_scale == 0 {
        let KdArrays { nodes, parents, leaf_triangles, .. } = arrays.clone();
        let is_twin = Tree { nodes, parents, leaf_triangles } == kdtree_build(triangles, &BuildOptions::default());
        assert!(is_twin, "{name} has another tree than the twin's");
    }
}

/// Builds a tree twice and checks it.
fn check(context: &Arc<Context>, name: &str, triangles: &[Triangle]) {
    let builder = builder(context, triangles, &bare());
    let (found, arrays) = built(&builder);
    assert_eq!(found.n_limited, 0, "{name}");
    assert_eq!(built(&builder).1, arrays, "{name}, again");
    check_twin(context, name, triangles, (&found, &arrays));
    let tree = KdTree::from_arrays(arrays, triangles).unwrap_or_else(|invalid| panic!("{name}: {invalid}"));
    let cost = relative_cost(&tree, triangles);
    println!("{name}: {} nodes, {} entries, {cost} times the host's cost", found.n_nodes, found.n_entries);
    assert!(cost <= MOST_COST, "{name}: {cost} times the host's cost");
}

/// A tube around a knot that winds twice around one axis and three times around another.
fn knot(n_along: usize, n_around: usize) -> Vec<Triangle> {
    let middle = |i: usize| {
        let angle = (i % n_along) as f32 / n_along as f32 * TAU;
        let radius = 1.0 + 0.4 * (3.0 * angle).cos();
        vec3(radius * (2.0 * angle).cos(), radius * (2.0 * angle).sin(), 0.4 * (3.0 * angle).sin())
    };
    let point = |i: usize, k: usize| {
        let (at, next) = (middle(i), middle(i + 1));
        let u = (next - at).cross(at).normalize();
        let v = u.cross(next - at).normalize();
        let angle = (k % n_around) as f32 / n_around as f32 * TAU;
        at + 0.15 * (u * angle.cos() + v * angle.sin())
    };
    let quad = |(i, k)| {
        let (a, b, c, d) = (point(i, k), point(i + 1, k), point(i + 1, k + 1), point(i, k + 1));
        [meshes::triangle(a, b, c), meshes::triangle(a, c, d)]
    };
    (0..n_along).flat_map(|i| (0..n_around).map(move |k| (i, k))).flat_map(quad).collect()
}

/// Needles through the origin.
fn needles() -> Vec<Triangle> {
    let needle = |i: usize| {
        let at = vec3(i as f32 * 0.01, (i as f32 * 1.7).sin(), (i as f32 * 0.9).cos());
        meshes::triangle(-3.0 * at, 3.0 * at, 3.0 * at + vec3(1e-4, 0.0, 0.0))
    };
    (0..300).map(needle).collect()
}

#[test]
fn meshes_have_trees_as_good_as_the_hosts() {
    let context = device();
    let torus = || meshes::torus(40, 20);
    check(&context, "none", &[]);
    check(&context, "one", &[meshes::triangle(Vec3::X, Vec3::Y, Vec3::Z)]);
    check(&context, "torus", &torus());
    check(&context, "cube", &meshes::cube(9, 0.0));
    check(&context, "sphere", &meshes::cube(10, 1.0));
    check(&context, "soup", &meshes::soup(1200, 7));
    check(&context, "threefold", &meshes::threefold(meshes::soup(200, 2)));
    check(&context, "tiny", &meshes::placed(torus(), 1e-6, Vec3::ZERO));
    check(&context, "huge", &meshes::placed(torus(), 1e6, Vec3::ZERO));
    check(&context, "far", &meshes::placed(torus(), 0.3, vec3(1000.0, -70.0, 3.0)));
    check(&context, "farther", &meshes::placed(torus(), 10.0, vec3(1e5, -1e5, 3.0)));
    assert_silent(&context);
}

#[test]
fn degenerate_triangles_have_valid_trees() {
    let context = device();
    let [a, b] = [vec3(0.1, 0.2, 0.3), vec3(-1.0, 2.0, 0.5)];
    check(&context, "points", &[meshes::triangle(a, a, a); 300]);
    check(&context, "segments", &[meshes::triangle(a, b, a.lerp(b, 0.3)); 300]);
    check(&context, "origin", &[meshes::triangle(Vec3::ZERO, Vec3::ZERO, -Vec3::ZERO)]);
    check(&context, "coincident", &[meshes::triangle(a, b, Vec3::ONE); 200]);
    let sheet = |i: usize| {
        let corner = vec3((i % 20) as f32, (i / 20) as f32, 5.0);
        meshes::triangle(corner, corner + Vec3::X, corner + Vec3::Y)
    };
    check(&context, "sheet", &(0..400).map(sheet).collect::<Vec<_>>());
    check(&context, "needles", &needles());
    let mut holed = meshes::torus(30, 20);
    holed[7].v0.x = f32::NAN;
    holed[500].v1.y = f32::INFINITY;
    holed[1199].v2.z = f32::NEG_INFINITY;
    check(&context, "holed", &holed);
    holed.iter_mut().for_each(|triangle| triangle.v1.x = f32::NAN);
    check(&context, "nothing finite", &holed);
    assert_silent(&context);
}

#[test]
fn numbers_of_triangles_around_a_limit_have_valid_trees() {
    let context = device();
    let soup = meshes::soup(KD_BIN_BLOCK as usize + 1, 3);
    for limit in [KD_SMALL_CELL, KD_BLOCK_SIZE, KD_BIN_BLOCK] {
        for n in [limit - 1, limit, limit + 1] {
            check(&context, &format!("{n} triangles"), &soup[..n as usize]);
        }
    }
    assert_silent(&context);
}

#[test]
fn triangles_of_very_different_sizes_have_a_valid_tree() {
    let context = device();
    let mut triangles = meshes::placed(meshes::torus(40, 20), 1e-3, Vec3::ONE);
    triangles.extend(meshes::placed(meshes::cube(2, 0.0), 3000.0, Vec3::ZERO));
    check(&context, "small in large", &triangles);
    assert_silent(&context);
}

#[test]
fn a_knot_of_20000_triangles_has_a_good_tree() {
    let context = device();
    check(&context, "knot", &knot(400, 25));
    assert_silent(&context);
}

/// Dispatches have several rows of workgroups, and in the last row, workgroups beyond the last entry.
#[test]
fn more_workgroups_than_a_row_build_valid_trees() {
    let context = device();
    let in_leaves = |triangles: &[Triangle]| {
        let room = KdTreeRoom { references: 1, pairs: 0, cells: 0 };
        let tree = BuildOptions { max_depth: Some(4), slabs: false, ..BuildOptions::default() };
        let options = KdTreeBuilderOptions { tree, room, ..KdTreeBuilderOptions::default() };
        let (found, arrays) = built(&builder(&context, triangles, &options));
        assert_eq!([found.n_limited, found.depth], [0, 4]);
        let mut in_leaves = arrays.leaf_triangles.clone();
        KdTree::from_arrays(arrays, triangles).expect("a valid tree");
        in_leaves.sort_unstable();
        in_leaves.dedup();
        in_leaves
    };
    // Blocks of triangles: few of these are finite, and the last one is. An invocation has ten of the blocks' sums.
    let torus = meshes::torus(30, 20);
    let n = (KD_GROUPS_X + KD_GROUPS_X / 4) * KD_BLOCK_SIZE + 1;
    let mut triangles = vec![meshes::triangle(Vec3::NAN, Vec3::X, Vec3::Y); n as usize];
    let last = triangles.len() - 1;
    let places: Vec<_> = (0..torus.len()).map(|i| last - 873 * i).collect();
    places.iter().zip(&torus).for_each(|(place, triangle)| triangles[*place] = *triangle);
    let found = in_leaves(&triangles);
    assert!(found.into_iter().rev().map(|ix| ix as usize).eq(places));
    // Groups of references.
    let n = KD_GROUPS_X * SCAN_GROUP_SIZE + 1;
    let at = |i: u32| vec3((i % 363) as f32, (i / 363) as f32, 0.0);
    let apart = |i| meshes::triangle(at(i), at(i) + 0.25 * Vec3::X, at(i) + 0.25 * Vec3::Y);
    let found = in_leaves(&(0..n).map(apart).collect::<Vec<_>>());
    assert!(found.into_iter().eq(0..n));
    assert_silent(&context);
}

#[test]
fn a_build_without_room_ends_in_leaves() {
    let context = device();
    let triangles = meshes::torus(60, 40);
    let full = KdTreeRoom { references: 6, pairs: 5, cells: 2 };
    let rooms = [
        KdTreeRoom { references: 1, ..full },
        KdTreeRoom { pairs: 0, ..full },
        KdTreeRoom { cells: 0, ..full },
        KdTreeRoom { references: 1, pairs: 0, cells: 0 },
    ];
    for room in rooms {
        let options = KdTreeBuilderOptions { room, ..bare() };
        let builder = builder(&context, &triangles, &options);
        let (found, arrays) = built(&builder);
        let capacities = builder.buffers().capacities;
        assert!(found.n_limited > 0, "{room:?}");
        assert!(found.n_entries <= capacities.n_references && found.n_nodes <= 2 * capacities.n_pairs, "{room:?}");
        assert_eq!(built(&builder).1, arrays, "{room:?}, again");
        KdTree::from_arrays(arrays, &triangles).unwrap_or_else(|invalid| panic!("{room:?}: {invalid}"));
    }
    assert_silent(&context);
}

#[test]
fn submits_and_timers_do_not_change_the_tree() {
    let context = device();
    let triangles = meshes::torus(30, 20);
    let whole = built(&builder(&context, &triangles, &KdTreeBuilderOptions::default())).1;
    for levels_per_submit in [0, 1, 100] {
        let levels_per_submit = Some(levels_per_submit);
        let options = KdTreeBuilderOptions { levels_per_submit, ..KdTreeBuilderOptions::default() };
        assert_eq!(built(&builder(&context, &triangles, &options)).1, whole, "{levels_per_submit:?}");
    }
    let builder = builder(&context, &triangles, &KdTreeBuilderOptions::default());
    let timer = Timer::new(&context, builder.n_stages()).expect("a timer");
    let timed = builder.build(Some(&timer)).expect("a tree");
    assert_eq!(timed.stages.len(), builder.n_stages() as usize);
    assert_eq!(builder.read_back(&timed).expect("its arrays"), whole);
    assert_silent(&context);
}

/// Leaves out one barrier after the other. Synchronization validation of Debian 12 (1.3.239) sees all hazards but that
/// between `bounds` and `scales`, of words that atomics alone update. Without a barrier, software drivers still
/// run kernels in order. On a GPU, kernels overlap, and one that reads unfinished data may never end: seen on an H200.
#[test]
fn every_barrier_of_a_build_is_needed() {
    const N_LEVELS: u32 = 4;
    let context = device();
    if !context.is_software() {
        println!("left out: without its barriers, a build on a GPU may never end");
        return;
    }
    let tree = BuildOptions { max_depth: Some(N_LEVELS - 1), slabs: false, ..BuildOptions::default() };
    let options = KdTreeBuilderOptions { tree, ..KdTreeBuilderOptions::default() };
    let builder = builder(&context, &meshes::torus(30, 20), &options);
    built(&builder);
    assert_silent(&context);
    // Five before the first level, five in each, and those after `sum` and `place`.
    let n_barriers = 5 + 5 * N_LEVELS + 2;
    const AFTER_BOUNDS: u32 = 1;
    for n in (0..n_barriers).filter(|&n| n != AFTER_BOUNDS) {
        let n_before = context.validation_messages().len();
        context.leave_out_barrier_after(Some(n));
        builder.build(None).expect("a tree");
        assert_eq!(context.leave_out_barrier_after(None), None, "barrier {n}");
        assert!(context.validation_messages().len() > n_before, "barrier {n} is not needed");
    }
}

#[test]
fn trees_of_limited_depth_are_valid_and_cost_more() {
    let context = device();
    let triangles = meshes::torus(30, 20);
    for max_depth in [0, 1, 5] {
        let tree = BuildOptions { max_depth: Some(max_depth), ..bare().tree };
        let options = KdTreeBuilderOptions { tree, ..KdTreeBuilderOptions::default() };
        let (found, arrays) = built(&builder(&context, &triangles, &options));
        assert_eq!(found.depth, max_depth);
        let tree = KdTree::from_arrays(arrays, &triangles).expect("a valid tree");
        assert!(relative_cost(&tree, &triangles) > MOST_COST, "{max_depth} levels");
    }
    assert_silent(&context);
}

/// Builds a whole tree with slabs twice, and checks that it is the bare tree with slabs in many nodes.
fn check_slabs(context: &Arc<Context>, name: &str, triangles: &[Triangle]) {
    let bare = built(&builder(context, triangles, &bare())).1;
    let builder = builder(context, triangles, &KdTreeBuilderOptions::default());
    let (found, arrays) = built(&builder);
    assert_eq!(built(&builder).1, arrays, "{name}, again");
    let without = |node: &KdNode| KdNode { axis_and_child: node.axis_and_child & !KD_HAS_SLAB, ..*node };
    let nodes: Vec<KdNode> = arrays.nodes.iter().map(without).collect();
    let n_slabs = arrays.nodes.iter().zip(&nodes).filter(|(marked, bare)| marked != bare).count();
    assert_eq!(KdArrays { nodes, slabs: Vec::new(), ..arrays.clone() }, bare, "{name}");
    let tree = KdTree::from_arrays(arrays, triangles).unwrap_or_else(|invalid| panic!("{name}: {invalid}"));
    let twin = kd_slabs(&KdTree::from_arrays(bare, triangles).expect("a tree"), triangles);
    let of_twin = twin.iter().filter(|slab| **slab != Slab::default()).count();
    println!("{name}: {n_slabs} slabs, the twin has {of_twin}");
    assert!(n_slabs.abs_diff(of_twin) <= 1 + of_twin / 100, "{name}: {n_slabs} slabs, not {of_twin}");
    let options = BuildOptions::default();
    let Statistics::KdTree(known) = found.report(triangles.len()).statistics else { panic!("a tree") };
    let walked = tree.statistics(triangles.len(), &options);
    assert_eq!(kdtree::Statistics { n_slabs: None, n_empty_leaves: None, sah_cost: None, ..walked }, known, "{name}");
}

#[test]
fn whole_trees_have_slabs() {
    let context = device();
    check_slabs(&context, "none", &[]);
    check_slabs(&context, "one", &[meshes::triangle(Vec3::X, Vec3::Y, Vec3::Z)]);
    check_slabs(&context, "knot", &knot(120, 16));
    check_slabs(&context, "soup", &meshes::soup(1200, 7));
    check_slabs(&context, "needles", &needles());
    check_slabs(&context, "far", &meshes::placed(meshes::torus(40, 20), 0.3, vec3(1000.0, -70.0, 3.0)));
    assert_silent(&context);
}

#[test]
fn relocated_trees_have_the_indices_of_their_places() {
    let context = device();
    for n in [1, KD_BLOCK_SIZE as usize / 5, 3000] {
        let triangles = meshes::soup(n, 4);
        // There is room for more triangles than the tree has.
        let all = meshes::soup(n + 500, 9);
        let buffer = Buffer::with(&context, "triangles", &all, BufferUse::Storage).expect("triangles");
        let builder = KdTreeBuilder::new(&context, &buffer, &bare()).expect("a builder");
        buffer.upload(&triangles).expect("an upload");
        let built = builder.build_first(n, None).expect("a tree");
        let expected = builder.read_back(&built).expect("its arrays");
        check_twin(&context, "soup", &triangles, (&built, &expected));
        let place = StructurePlace { first_element: 14, first_entry: 1001, first_row: 77 };
        let tree = builder.copy_relocated(&built, &place, BufferUse::Storage).expect("a copy");
        let nodes = expected.nodes.iter().map(|&KdNode { split_or_first, axis_and_child }| {
            if axis_and_child & KD_LEAF != 0 {
                return KdNode { split_or_first: split_or_first + 1001, axis_and_child };
            }
            KdNode { split_or_first, axis_and_child: axis_and_child + (7 << KD_PAIR_SHIFT) }
        });
        assert_eq!(tree.nodes.download().expect("nodes"), nodes.collect::<Vec<_>>());
        let parents: Vec<_> = expected.parents.iter().map(|parent| parent + 14).collect();
        assert_eq!(tree.parents.download().expect("parents"), parents);
        let entries = tree.leaf_triangles.download().expect("entries");
        let rows: Vec<_> = expected.leaf_triangles.iter().map(|triangle_ix| triangle_ix + 77).collect();
        assert_eq!(entries.iter().map(|entry| entry.triangle_ix).collect::<Vec<_>>(), rows);
        assert_eq!(tree.leaf_planes.download().expect("planes"), expected.leaf_planes);
        // The next build does not depend on this one.
        let again = builder.build_first(n, None).expect("a tree");
        assert_eq!(builder.read_back(&again).expect("its arrays"), expected);
    }
    assert_silent(&context);
}

#[test]
#[should_panic(expected = "4 triangles, room for 3")]
fn more_triangles_than_there_is_room_for_are_refused() {
    let context = device();
    let builder = builder(&context, &meshes::soup(3, 1), &bare());
    let _ = builder.build_first(4, None);
}

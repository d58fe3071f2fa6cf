//! Tests of the kernels that compact rays against their twin on the CPU and against closed forms.

use glam::{Vec3, vec3};
use kdray::{
    frame::plan,
    layout::{
        Batch, Bounce, CHILD_REFLECTED, CHILD_TRANSMITTED, Frame, Hit, Material, NO_TRIANGLE, PathRay, SCAN_GROUP_SIZE,
        SPINE_ITEMS,
    },
    passes::Inputs,
    reference::{self, compact::Parents},
};

use super::stage::{FIRST, Stage, UNTOUCHED_RAY, UNTOUCHED_WORD, options};
use crate::support::{compare, meshes, random::Random, scenes};

/// Number of rays whose counts fit in one round of the spine, the prefix sum over workgroups, if it has the
/// fewest invocations.
const ROUND: u32 = SCAN_GROUP_SIZE * SCAN_GROUP_SIZE * SPINE_ITEMS;

/// Numbers of rays near the bounds of the kernels' loops: a workgroup, the rays whose counts a subgroup of 8
/// invocations loads at a time, the chunks of a subgroup of 8 and of 32 invocations, and a round.
const COUNTS: [u32; 14] = [
    0,
    1,
    SCAN_GROUP_SIZE - 1,
    SCAN_GROUP_SIZE,
    SCAN_GROUP_SIZE + 1,
    8 * SCAN_GROUP_SIZE,
    8 * SCAN_GROUP_SIZE + 1,
    5000,
    8 * SPINE_ITEMS * SCAN_GROUP_SIZE,
    8 * SPINE_ITEMS * SCAN_GROUP_SIZE + 1,
    32 * SPINE_ITEMS * SCAN_GROUP_SIZE + 1,
    ROUND - 1,
    ROUND,
    ROUND + 1,
];

/// Makes a stage whose rays have i children at triangle i: triangle 0 is diffuse, 1 is a mirror, 2 is glass.
fn stage(capacity: u32) -> Stage {
    stage_of(capacity, &[scenes::diffuse(Vec3::ONE), scenes::mirror(Vec3::splat(0.5)), scenes::glass(1.5)])
}

/// Makes a stage with a triangle of each material.
fn stage_of(capacity: u32, materials: &[Material]) -> Stage {
    let mut scene = scenes::empty();
    for &material in materials {
        let triangle = meshes::triangle(Vec3::ZERO, vec3(0.0, 0.0, 1.0), vec3(1.0, 0.0, 0.0));
        scenes::add(&mut scene, vec![triangle], material);
    }
    Stage::new(scene, options(8, 8), capacity)
}

/// Returns a ray whose pixel is its index, and its hit. Where some surfaces are blended, the rays have used 0 to 4 of
/// the five depths, by turns.
fn parent(stage: &Stage, i: usize, triangle_ix: u32) -> (PathRay, Hit) {
    let n_used = if stage.resources.constants().extra_bounces > 0 { i as u32 % 5 } else { 0 };
    let ray = PathRay {
        origin: vec3(0.3, 1.0, 0.3),
        pixel_ix: i as u32,
        direction: vec3(0.1, -1.0, 0.2).normalize(),
        source_triangle: NO_TRIANGLE,
        throughput: Vec3::ONE,
        t_max: f32::from_bits(f32::INFINITY.to_bits() - n_used),
    };
    (ray, Hit { t: 1.0, triangle_ix, u: 0.3, v: 0.3 })
}

/// The output of compaction.
struct Compacted {
    rays: Vec<PathRay>,
    child_flags: Vec<u32>,
    first_children: Vec<u32>,
    bounces: Vec<Bounce>,
}

/// Compacts the children of the second bounce, whose rays come after `n_before` rays of the first one.
fn on_device(stage: &Stage, n_before: u32, child_counts: &[u32]) -> Compacted {
    let resources = &stage.resources;
    let before = vec![parent(stage, 0, 0); n_before as usize];
    let parents = child_counts.iter().enumerate().map(|(i, &n)| parent(stage, i, n));
    let (rays, hits): (Vec<_>, Vec<_>) = before.into_iter().chain(parents).unzip();
    stage.set_n_rays(&[n_before, child_counts.len() as u32]);
    stage.set_rays(&rays);
    stage.set_hits(&hits);
    let queue = &resources.queue;
    for words in [&queue.child_flags, &queue.first_children, &queue.scan_blocks] {
        words.upload(&vec![UNTOUCHED_WORD; words.len()]).expect("words");
    }
    let batch = Batch { depth: 1, bounce_ix: 1, ..FIRST };
    stage.run(|commands| {
        let inputs = Inputs { batch, ..Inputs::default() };
        stage.passes.record_sequence(commands, resources, &plan::next_rays(), &inputs);
    });
    Compacted {
        rays: queue.rays.download().expect("rays"),
        child_flags: queue.child_flags.download().expect("child_flags"),
        first_children: queue.first_children.download().expect("first_children"),
        bounces: resources.bounces.download().expect("bounces"),
    }
}

fn on_cpu(stage: &Stage, n_before: u32, child_counts: &[u32]) -> Compacted {
    let (bindings, constants) = (stage.inputs(), stage.resources.constants());
    let capacity = stage.resources.queue.rays.len();
    let parents = child_counts.iter().enumerate().map(|(i, &n)| parent(stage, i, n));
    let (rays, hits): (Vec<_>, Vec<_>) = parents.unzip();
    let n = child_counts.len();
    let mut bounces = stage.set_n_rays(&[n_before, n as u32]);
    let mut all = vec![UNTOUCHED_RAY; capacity];
    all[..n_before as usize].fill(parent(stage, 0, 0).0);
    let (before, behind) = all.split_at_mut(n_before as usize + n);
    before[n_before as usize..].copy_from_slice(&rays);
    let untouched = || vec![UNTOUCHED_WORD; capacity];
    let (mut child_flags, mut first_children) = (untouched(), untouched());
    let places = n_before as usize..n_before as usize + n;
    let mut scan_blocks = vec![0; n.div_ceil(SCAN_GROUP_SIZE as usize)];
    let parents = Parents { rays: &rays, hits: &hits };
    reference::compact::reduce(&bindings, parents, &mut child_flags[places.clone()], &mut scan_blocks);
    let (this, mut next) = (bounces[1], bounces[2]);
    reference::compact::spine(&mut scan_blocks, constants, &this, &mut next);
    if next.overflow == 0 {
        reference::compact::scatter(
            &bindings,
            parents,
            &child_flags[places.clone()],
            &scan_blocks,
            next.first_ray,
            &mut first_children[places],
            &mut behind[..next.n_rays as usize],
        );
    }
    bounces[2] = next;
    bounces[0].any_overflow = next.overflow;
    Compacted { rays: all, child_flags, first_children, bounces }
}

fn check(stage: &Stage, n_before: u32, child_counts: &[u32]) -> Compacted {
    let expected = on_cpu(stage, n_before, child_counts);
    let found = on_device(stage, n_before, child_counts);
    compare::rays(1e-5, 0, &expected.rays, &found.rays).unwrap();
    compare::exact(&expected.child_flags, &found.child_flags).unwrap();
    compare::exact(&expected.first_children, &found.first_children).unwrap();
    compare::exact(&expected.bounces, &found.bounces).unwrap();
    found
}

#[test]
fn agrees_with_its_twin() {
    let stage = stage(3 * (ROUND + 1) + 70);
    for (n_rays, n_before) in COUNTS.into_iter().zip([0, 70].into_iter().cycle()) {
        let mut random = Random(u64::from(n_rays));
        let mut child_counts: Vec<u32> = (0..n_rays).map(|_| random.below(3) as u32).collect();
        // The last block, which has one ray or more, has at least one child.
        child_counts.iter_mut().last().into_iter().for_each(|count| *count = 2);
        check(&stage, n_before, &child_counts);
    }
}

#[test]
fn lanes_to_spare_are_shared_out_as_on_the_cpu() {
    let mut stage = stage(10_000);
    let constants = Frame { n_lanes: 5000, n_lights: 3, ..*stage.resources.constants() };
    stage.resources.set_constants(&constants);
    stage.resources.frame.upload(&[constants]).expect("frame");
    for n_rays in [0, 1, 50, 160, 1250, 1251, 2500, 2501, 5000] {
        let lanes = 1 << check(&stage, 0, &vec![1; n_rays]).bounces[2].trace_lanes_log2;
        assert!(lanes == 1 || lanes * n_rays <= 5000, "{n_rays}: {lanes}");
    }
}

/// The closed form of the children: each ray at glass has a reflected child and a refracted one, in this order, and
/// the children are in the order of their parents.
#[test]
fn all_children_keep_their_order() {
    let stage = stage(7500);
    let found = check(&stage, 0, &[2; 2500]);
    let children = &found.rays[2500..];
    assert!(children.iter().enumerate().all(|(i, ray)| ray.pixel_ix == i as u32 / 2));
    assert!(children.iter().enumerate().all(|(i, ray)| (ray.direction.y > 0.0) == i.is_multiple_of(2)));
    assert!((0..2500).all(|i| found.child_flags[i] == CHILD_REFLECTED | CHILD_TRANSMITTED));
    assert!((0..2500).all(|i| found.first_children[i] == 2500 + 2 * i as u32));
    assert_eq!((found.bounces[2].first_ray, found.bounces[2].n_rays, found.bounces[2].overflow), (2500, 5000, 0));
    let found = check(&stage, 10, &[1; 2490]);
    assert!(
        (0..2490).all(|i| found.rays[2500 + i].pixel_ix == i as u32 && found.child_flags[10 + i] == CHILD_REFLECTED)
    );
    let found = check(&stage, 0, &[0; 2500]);
    compare::exact(&[UNTOUCHED_RAY; 5000], &found.rays[2500..]).unwrap();
    let next = found.bounces[2];
    assert_eq!((next.n_rays, next.trace_groups_x, next.scan_groups_x, next.shade_groups_x), (0, 0, 0, 40));
}

/// Rays at the last depth go on only where they pass straight through a blended surface. Other children are
/// one deeper than their parents.
#[test]
fn depth_is_counted_where_surfaces_are_blended() {
    let stage = stage_of(100, &[scenes::veil(Vec3::ONE, 0.5), scenes::mirror(Vec3::splat(0.5)), scenes::glass(1.5)]);
    let found = check(&stage, 0, &[0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2]);
    let (both, depths) = (CHILD_REFLECTED | CHILD_TRANSMITTED, [1; 4].into_iter().chain([0]));
    let of_veil = [CHILD_TRANSMITTED; 5].into_iter();
    let expected: Vec<_> =
        of_veil.chain(depths.clone().map(|n| n * CHILD_REFLECTED)).chain(depths.map(|n| n * both)).collect();
    assert_eq!(found.child_flags[..15], expected);
    let n_used = |ray: &PathRay| f32::INFINITY.to_bits() - ray.t_max.to_bits();
    let of_children: Vec<_> = found.rays[15..32].iter().map(n_used).collect();
    assert_eq!(of_children, [0, 1, 2, 3, 4, 1, 2, 3, 4, 1, 1, 2, 2, 3, 3, 4, 4]);
}

/// If there is one ray more than the queue holds, no ray is made, and the loss is reported.
#[test]
fn a_full_queue_is_used_and_an_overfull_one_reported() {
    let stage = stage(6100);
    let mut child_counts = vec![1; 3000];
    assert_eq!(check(&stage, 100, &child_counts).bounces[2].n_rays, 3000);
    child_counts[1234] = 2;
    let found = check(&stage, 100, &child_counts);
    compare::exact(&[UNTOUCHED_RAY; 3000], &found.rays[3100..]).unwrap();
    let [first, _, next, ..] = found.bounces[..] else { panic!("three rows") };
    assert_eq!((next.overflow, next.n_rays, next.n_wanted), (1, 0, 3001));
    assert_eq!([first.any_overflow, first.overflow], [1, 0]);
}

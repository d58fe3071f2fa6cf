//! Compact against its twin and against closed forms.

use kdray::{
    cpu,
    layout::{Batch, Bounce, Frame, Ray, SCAN_BLOCK_SIZE, SCAN_GROUP_SIZE},
};

use super::stage::{FIRST, Stage, UNTOUCHED_RAY, UNTOUCHED_WORD, options};
use crate::support::{compare, random::Random, scenes};

/// Blocks that one round of the spine holds.
const ROUND: u32 = SCAN_GROUP_SIZE * SCAN_BLOCK_SIZE;

/// One more and less than a workgroup, a block, and a round of the spine.
const COUNTS: [u32; 12] = [
    0,
    1,
    SCAN_GROUP_SIZE - 1,
    SCAN_GROUP_SIZE,
    SCAN_GROUP_SIZE + 1,
    SCAN_BLOCK_SIZE - 1,
    SCAN_BLOCK_SIZE,
    SCAN_BLOCK_SIZE + 1,
    5 * SCAN_BLOCK_SIZE + 3,
    ROUND - 1,
    ROUND,
    ROUND + 1,
];

fn stage(capacity: u32) -> Stage {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    Stage::new(scene, options(8, 8), capacity)
}

/// A ray that says which one it is.
fn numbered(i: usize) -> Ray {
    Ray { pixel_ix: i as u32, ..UNTOUCHED_RAY }
}

/// The next queue and both rows of `bounces`.
fn on_device(stage: &Stage, child_counts: &[u32]) -> (Vec<Ray>, [Bounce; 2]) {
    let resources = &stage.resources;
    let n_rays = child_counts.len();
    let children: Vec<Ray> = (0..2 * n_rays).map(numbered).collect();
    stage.set_n_rays(n_rays as u32);
    resources.queues.child_rays.upload(&children).expect("child_rays");
    resources.queues.child_counts.upload(child_counts).expect("child_counts");
    resources
        .queues
        .scan_blocks
        .upload(&vec![UNTOUCHED_WORD; resources.queues.scan_blocks.len()])
        .expect("scan_blocks");
    resources.queues.ray_queues[1]
        .upload(&vec![UNTOUCHED_RAY; resources.queues.ray_queues[1].len()])
        .expect("next_rays");
    stage.run(&FIRST, |commands| stage.passes.compact.record(commands, resources, &FIRST));
    let bounces = resources.bounces.download().expect("bounces");
    (resources.queues.ray_queues[1].download().expect("next_rays"), [bounces[0], bounces[1]])
}

fn on_cpu(stage: &Stage, child_counts: &[u32]) -> (Vec<Ray>, [Bounce; 2]) {
    let (n_rays, capacity) = (child_counts.len(), stage.resources.queues.ray_queues[1].len());
    let children: Vec<Ray> = (0..2 * n_rays).map(numbered).collect();
    let constants = stage.resources.constants();
    let mut this = Bounce::of(n_rays as u32, constants);
    let mut next = this;
    let mut scan_blocks = vec![0; n_rays.div_ceil(SCAN_BLOCK_SIZE as usize)];
    let mut next_rays = vec![UNTOUCHED_RAY; capacity];
    cpu::compact::reduce(child_counts, &mut scan_blocks);
    cpu::compact::spine(&mut scan_blocks, constants, &mut next);
    if next.overflow == 0 {
        cpu::compact::scatter(&children, child_counts, &scan_blocks, &mut next_rays[..next.n_rays as usize]);
    }
    this.any_overflow = next.overflow;
    (next_rays, [this, next])
}

fn check(stage: &Stage, child_counts: &[u32]) {
    let (expected, expected_bounces) = on_cpu(stage, child_counts);
    let (found, bounces) = on_device(stage, child_counts);
    compare::exact(&expected, &found).unwrap();
    compare::exact(&expected_bounces, &bounces).unwrap();
}

#[test]
fn agrees_with_its_twin() {
    let stage = stage(2 * (ROUND + 1));
    for n_rays in COUNTS {
        let mut random = Random(u64::from(n_rays));
        let mut child_counts: Vec<u32> = (0..n_rays).map(|_| random.below(3) as u32).collect();
        // The last block, of one ray or more, moves something.
        child_counts.iter_mut().last().into_iter().for_each(|count| *count = 2);
        check(&stage, &child_counts);
    }
}

#[test]
fn lanes_to_spare_are_shared_out_as_on_the_cpu() {
    let mut stage = stage(5000);
    let constants = Frame { n_lanes: 5000, n_lights: 3, ..*stage.resources.constants() };
    stage.resources.set_constants(&constants);
    stage.resources.tree.frame.upload(&[constants]).expect("frame");
    for n_rays in [0, 1, 50, 160, 1250, 1251, 2500, 2501, 5000] {
        check(&stage, &vec![1; n_rays]);
        let lanes = 1 << on_device(&stage, &vec![1; n_rays]).1[1].trace_lanes_log2;
        assert!(lanes == 1 || lanes * n_rays <= 5000, "{n_rays}: {lanes}");
    }
}

#[test]
fn all_children_keep_their_order() {
    let stage = stage(5000);
    let (rays, bounces) = on_device(&stage, &[2; 2500]);
    compare::exact(&(0..5000).map(numbered).collect::<Vec<_>>(), &rays).unwrap();
    assert_eq!((bounces[1].n_rays, bounces[1].overflow), (5000, 0));
    let (rays, bounces) = on_device(&stage, &[0; 2500]);
    compare::exact(&[UNTOUCHED_RAY; 5000], &rays).unwrap();
    assert_eq!((bounces[1].n_rays, bounces[1].ray_groups_x, bounces[1].scan_groups_x), (0, 0, 0));
}

/// One ray more than the queue holds: none is moved, none lost without word.
#[test]
fn a_full_queue_is_used_and_an_overfull_one_reported() {
    let stage = stage(3000);
    let mut child_counts = vec![1; 3000];
    check(&stage, &child_counts);
    child_counts[1234] = 2;
    check(&stage, &child_counts);
    let (rays, bounces) = on_device(&stage, &child_counts);
    compare::exact(&[UNTOUCHED_RAY; 3000], &rays).unwrap();
    assert_eq!((bounces[1].overflow, bounces[1].n_rays, bounces[1].n_wanted), (1, 0, 3001));
    assert_eq!([bounces[0].any_overflow, bounces[0].overflow], [1, 0]);
}

/// Odd bounces read the second queue and fill the first.
#[test]
fn odd_bounces_fill_the_other_queue() {
    let stage = stage(100);
    let resources = &stage.resources;
    let batch = Batch { depth: 1, bounce_ix: 1, ..FIRST };
    stage.set_n_rays(50);
    stage.set_rays(&[]);
    resources.queues.ray_queues[1].upload(&[UNTOUCHED_RAY; 100]).expect("next_rays");
    resources.queues.child_rays.upload(&(0..100).map(numbered).collect::<Vec<_>>()).expect("child_rays");
    resources.queues.child_counts.upload(&[2; 50]).expect("child_counts");
    stage.run(&batch, |commands| stage.passes.compact.record(commands, resources, &batch));
    compare::exact(
        &(0..100).map(numbered).collect::<Vec<_>>(),
        &resources.queues.ray_queues[0].download().expect("rays"),
    )
    .unwrap();
    compare::exact(&[UNTOUCHED_RAY; 100], &resources.queues.ray_queues[1].download().expect("next_rays")).unwrap();
    assert_eq!(resources.bounces.download().expect("bounces")[2].n_rays, 100);
}

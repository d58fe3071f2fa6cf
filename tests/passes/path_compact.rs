//! Tests of the prefix sum over paths and of the kernel path_compact: the lists of the paths that go on and of those
//! with a shadow ray.

use kdray::{
    frame::{Access, Pass, PlanEntry},
    gpu::DeviceOverrides,
    layout::{Batch, Bounce, PATH_GOES_ON, PATH_HAS_SHADOW_RAY, SCAN_GROUP_SIZE, SPINE_ITEMS},
    passes::Inputs,
    reference::path_compact::{self, counts_of_block, flags_of_path},
};

use super::{
    path_stage::PathStage,
    stage::{FIRST, UNTOUCHED_WORD},
};
use crate::support::{compare, pretended, random::Random, scenes};

/// Number of paths for which the stage has room.
const CAPACITY: usize = 1200 << 7;
/// Number of paths whose counts fit in one round of the spine, if it has the fewest invocations.
const ROUND: usize = (SCAN_GROUP_SIZE * SCAN_GROUP_SIZE * SPINE_ITEMS) as usize;

/// Compacts `n` paths by the kernels and by their twin, and compares the results. The array has the share of the paths
/// that go on, and the share of those with a shadow ray.
fn check(stage: &PathStage, n: usize, [going_on, with_shadow_ray]: [f32; 2], random: &mut Random) {
    let flags = |random: &mut Random| flags_of_path(random.unit() < going_on, random.unit() < with_shadow_ray);
    let flags: Vec<u32> = (0..n).map(|_| flags(random)).collect();
    let live: Vec<u32> = (0..n as u32).map(|ix| 7 * ix + 3).collect();
    let mut blocks: Vec<_> = flags.chunks(SCAN_GROUP_SIZE as usize).map(counts_of_block).collect();
    let (queue, paths) = (&stage.resources.queue, stage.paths());
    let padded = |words: &[u32], len: usize| {
        let mut words = words.to_vec();
        words.resize(len, UNTOUCHED_WORD);
        words
    };
    // The bounce of depth 1 has the second list.
    let lists = [padded(&[], CAPACITY), padded(&live, CAPACITY), padded(&[], CAPACITY)].concat();
    paths.live_paths.upload(&lists).expect("live_paths");
    queue.child_flags.upload(&padded(&flags, CAPACITY)).expect("child_flags");
    queue.scan_blocks.upload(&padded(blocks.as_flattened(), queue.scan_blocks.len())).expect("scan_blocks");
    stage.set_n_paths(&[(0, 0), (n as u32, 0)]);
    let batch = Batch { n_pixels: 1200, bounce_ix: 1, depth: 1, ..FIRST };
    let wait = PlanEntry::Barrier { before: Access::Write, after: Access::Update, of: &[] };
    let wait_for_size = PlanEntry::Barrier { before: Access::Write, after: Access::Indirect, of: &[] };
    let sequence = [PlanEntry::Run(Pass::CompactSpine), wait, wait_for_size, PlanEntry::Run(Pass::PathCompact)];
    let inputs = Inputs { batch, false_color: None };
    stage.run(|commands| stage.passes.record_sequence(commands, &stage.resources, &sequence, &inputs));

    let found = stage.resources.bounces.download().expect("bounces");
    let (mut this, mut next) = (Bounce { n_shadow_rays: 0, ..found[1] }, Bounce::of_paths(0, stage.frame()));
    path_compact::spine(&mut blocks, stage.frame(), &mut this, &mut next);
    assert_eq!(found[1..3], [this, next], "{n} paths");
    let (mut going_on, mut with_shadow_ray) = (vec![UNTOUCHED_WORD; CAPACITY], vec![UNTOUCHED_WORD; CAPACITY]);
    path_compact::path_compact(&live, &flags, &blocks, &mut going_on, &mut with_shadow_ray);
    let found = paths.live_paths.download().expect("live_paths");
    compare::exact(&going_on, &found[..CAPACITY]).unwrap();
    compare::exact(&with_shadow_ray, &found[2 * CAPACITY..]).unwrap();
    // The twin's lists are those that follow from the flags.
    let lists = [(PATH_GOES_ON, next.n_rays, going_on), (PATH_HAS_SHADOW_RAY, this.n_shadow_rays, with_shadow_ray)];
    for (bit, n_listed, list) in lists {
        let of_flag = live.iter().zip(&flags).filter(|(_, flags)| **flags & bit != 0);
        let expected: Vec<_> = of_flag.map(|(ix, _)| *ix).collect();
        assert_eq!((n_listed as usize, &list[..expected.len()]), (expected.len(), &expected[..]));
    }
}

#[test]
fn agrees_with_its_twin() {
    let stage = PathStage::new(scenes::mixed(), 7);
    let mut random = Random(1);
    for n in [0, 1, 127, 128, 129, 1023, 1024, 1025, 8193, 19_200] {
        for shares in [[0.0, 0.5], [0.3, 0.0], [0.3, 1.0], [1.0, 0.6], [0.0, 0.0], [1.0, 1.0]] {
            check(&stage, n, shares, &mut random);
        }
    }
    for n in [ROUND - 1, ROUND, ROUND + 1, CAPACITY] {
        check(&stage, n, [0.3, 0.6], &mut random);
    }
}

/// On a GPU, the spine has as many invocations as the device allows.
#[test]
fn a_large_workgroup_agrees_with_the_twin() {
    let context = pretended(DeviceOverrides { n_lanes: Some(1 << 16), ..DeviceOverrides::default() });
    assert!(context.limits().group_size > SCAN_GROUP_SIZE);
    let stage = PathStage::on(context, scenes::mixed(), 7);
    for n in [1, 8193, ROUND + 1, CAPACITY] {
        check(&stage, n, [0.3, 0.6], &mut Random(2));
    }
}

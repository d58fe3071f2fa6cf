//! Tests of the prefix sum over paths and of the kernel path_compact: the lists of the paths that go on
//! and of those with a segment.

use kdray::{
    frame::{Pass, Step, Touch},
    layout::{Batch, Bounce, PATH_GOES_ON, PATH_HAS_SEGMENT, SCAN_GROUP_SIZE},
    passes::Inputs,
    reference::path_compact::{self, counts_of_block, kind_of_path},
};

use super::{
    path_stage::PathStage,
    stage::{FIRST, UNTOUCHED_WORD},
};
use crate::support::{compare, random::Random, scenes};

#[test]
fn agrees_with_its_twin() {
    let stage = PathStage::new(scenes::mixed(), 4);
    let mut random = Random(1);
    for n in [0, 1, 127, 128, 129, 1023, 1024, 1025, 19_200] {
        for share in [0.0, 0.3, 1.0] {
            let kind = |random: &mut Random| kind_of_path(random.unit() < share, random.unit() < 0.5);
            let kinds: Vec<u32> = (0..n).map(|_| kind(&mut random)).collect();
            let live: Vec<u32> = (0..n as u32).map(|ix| 7 * ix + 3).collect();
            let mut blocks: Vec<_> = kinds.chunks(SCAN_GROUP_SIZE as usize).map(counts_of_block).collect();
            let (queue, paths) = (&stage.resources.queue, stage.paths());
            let padded = |words: &[u32], len: usize| {
                let mut words = words.to_vec();
                words.resize(len, UNTOUCHED_WORD);
                words
            };
            // The bounce of depth 1 has the second list.
            let lists = [padded(&[], 19_200), padded(&live, 19_200), padded(&[], 19_200)].concat();
            paths.live_paths.upload(&lists).expect("live_paths");
            queue.child_kinds.upload(&padded(&kinds, 19_200)).expect("child_kinds");
            queue.scan_blocks.upload(&padded(blocks.as_flattened(), queue.scan_blocks.len())).expect("scan_blocks");
            stage.set_n_paths(&[(0, 0), (n as u32, 0)]);
            let batch = Batch { n_pixels: 1200, bounce_ix: 1, depth: 1, ..FIRST };
            let wait = Step::Barrier { before: Touch::Write, after: Touch::Update, of: &[] };
            let wait_for_size = Step::Barrier { before: Touch::Write, after: Touch::Indirect, of: &[] };
            let section = [Step::Run(Pass::CompactSpine), wait, wait_for_size, Step::Run(Pass::PathCompact)];
            let inputs = Inputs { batch, false_color: None };
            stage.run(|commands| stage.passes.record_section(commands, &stage.resources, &section, &inputs));

            let found = stage.resources.bounces.download().expect("bounces");
            let (mut this, mut next) = (Bounce { n_segments: 0, ..found[1] }, Bounce::of_paths(0, stage.frame()));
            path_compact::spine(&mut blocks, stage.frame(), &mut this, &mut next);
            assert_eq!(found[1..3], [this, next]);
            let (mut going_on, mut with_segment) = (vec![UNTOUCHED_WORD; 19_200], vec![UNTOUCHED_WORD; 19_200]);
            path_compact::path_compact(&live, &kinds, &blocks, &mut going_on, &mut with_segment);
            let found = paths.live_paths.download().expect("live_paths");
            compare::exact(&going_on, &found[..19_200]).unwrap();
            compare::exact(&with_segment, &found[38_400..]).unwrap();
            // The twin itself lists what the kinds say.
            let lists = [(PATH_GOES_ON, next.n_rays, going_on), (PATH_HAS_SEGMENT, this.n_segments, with_segment)];
            for (bit, n_listed, list) in lists {
                let of_kind = live.iter().zip(&kinds).filter(|(_, kind)| **kind & bit != 0);
                let expected: Vec<_> = of_kind.map(|(ix, _)| *ix).collect();
                assert_eq!((n_listed as usize, &list[..expected.len()]), (expected.len(), &expected[..]));
            }
        }
    }
}

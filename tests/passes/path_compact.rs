//! Tests of the prefix sum over paths and of the kernel path_compact: the list of the paths that go on.

use kdray::{
    frame::{Pass, Step, Touch},
    layout::{Batch, Bounce, SCAN_GROUP_SIZE},
    passes::Inputs,
    reference::path_compact,
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
            let kinds: Vec<u32> = (0..n).map(|_| u32::from(random.unit() < share)).collect();
            let live: Vec<u32> = (0..n as u32).map(|ix| 7 * ix + 3).collect();
            let of_block = |kinds: &[u32]| kinds.iter().sum::<u32>();
            let mut blocks: Vec<_> = kinds.chunks(SCAN_GROUP_SIZE as usize).map(of_block).collect();
            let (queue, paths) = (&stage.resources.queue, stage.paths());
            let padded = |words: &[u32], len: usize| {
                let mut words = words.to_vec();
                words.resize(len, UNTOUCHED_WORD);
                words
            };
            // The bounce of depth 1 has the second list.
            let lists = [padded(&[], 19_200), padded(&live, 19_200)].concat();
            paths.live_paths.upload(&lists).expect("live_paths");
            queue.child_kinds.upload(&padded(&kinds, 19_200)).expect("child_kinds");
            queue.scan_blocks.upload(&padded(&blocks, queue.scan_blocks.len())).expect("scan_blocks");
            stage.set_n_paths(&[0, n as u32]);
            let batch = Batch { n_pixels: 1200, bounce_ix: 1, depth: 1, ..FIRST };
            let wait = Step::Barrier { before: Touch::Write, after: Touch::Update, of: &[] };
            let wait_for_size = Step::Barrier { before: Touch::Write, after: Touch::Indirect, of: &[] };
            let section = [Step::Run(Pass::CompactSpine), wait, wait_for_size, Step::Run(Pass::PathCompact)];
            let inputs = Inputs { batch, false_color: None };
            stage.run(|commands| stage.passes.record_section(commands, &stage.resources, &section, &inputs));

            let this = stage.resources.bounces.download().expect("bounces")[1];
            let mut next = Bounce::of_paths(0, stage.frame());
            path_compact::spine(&mut blocks, stage.frame(), &this, &mut next);
            assert_eq!(stage.resources.bounces.download().expect("bounces")[2], next);
            let mut expected = vec![UNTOUCHED_WORD; 19_200];
            path_compact::path_compact(&live, &kinds, &blocks, &mut expected);
            compare::exact(&expected, &paths.live_paths.download_first(19_200).expect("live_paths")).unwrap();
            let going_on: Vec<_> = live.iter().zip(&kinds).filter(|(_, kind)| **kind == 1).map(|(ix, _)| *ix).collect();
            assert_eq!((next.n_rays as usize, &expected[..going_on.len()]), (going_on.len(), &going_on[..]));
        }
    }
}

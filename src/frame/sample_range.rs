//! Ranges of samples, and the sums of samples from which parts of a picture are joined.
//!
//! All samples of a picture of paths are added in one binary tree (glsl/passes/path_accumulate.comp). An aligned block
//! is a node of this tree: 2^n samples, of which the first is a multiple of 2^n. So a picture has the same bits whether
//! its samples are drawn at once or as blocks whose sums are joined later.

use std::{fmt, str::FromStr};

use rayon::prelude::*;

use crate::layout::SAMPLE_BLOCK_LOG2;

/// Samples of each pixel: those from `first` on, up to but without `end`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SampleRange {
    /// Index of the first sample.
    pub first: u32,
    /// Index after that of the last sample.
    pub end: u32,
}

impl SampleRange {
    /// The most samples of a picture.
    pub const MOST: u32 = 1 << 16;

    /// Returns the range of a picture's first `n_samples` samples.
    pub fn whole(n_samples: u32) -> Self {
        Self { first: 0, end: n_samples }
    }

    /// Number of samples.
    pub fn len(&self) -> u32 {
        self.end.saturating_sub(self.first)
    }

    /// Whether the range has no samples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the fewest aligned blocks that make up the range, in order.
    pub fn blocks(&self) -> impl Iterator<Item = Self> + use<> {
        let Self { mut first, end } = *self;
        std::iter::from_fn(move || {
            let most = end.checked_sub(first).filter(|most| *most > 0)?;
            let size = 1 << most.ilog2().min(first.trailing_zeros());
            first += size;
            Some(Self { first: first - size, end: first })
        })
    }

    /// Whether the range can be drawn as a part of a picture of `n_samples` samples: it begins and ends at a multiple
    /// of the samples in a block, or ends with the picture's last sample.
    pub fn is_part_of(&self, n_samples: u32) -> bool {
        let size = 1 << SAMPLE_BLOCK_LOG2;
        self.first.is_multiple_of(size)
            && self.end <= n_samples
            && (self.end.is_multiple_of(size) || self.end == n_samples)
    }

    /// Returns the block that consists of this block and the next one, if that is an aligned block.
    fn joined(&self, next: &Self) -> Option<Self> {
        let len = self.len().saturating_mul(2);
        let fits = self.end == next.first && self.len() == next.len() && self.first.is_multiple_of(len);
        fits.then_some(Self { first: self.first, end: next.end })
    }
}

impl FromStr for SampleRange {
    type Err = String;

    /// Parses `A-B`, two whole numbers of which the first is the smaller one.
    fn from_str(word: &str) -> Result<Self, Self::Err> {
        let number = |digits: &str| digits.parse().ok().filter(|n: &u32| *n <= Self::MOST);
        let ends = word.split_once('-').and_then(|(first, end)| Some((number(first)?, number(end)?)));
        match ends {
            Some((first, end)) if first < end => Ok(Self { first, end }),
            Some(_) => Err("the range is empty".to_owned()),
            None => Err(format!("expected A-B, whole numbers up to {}", Self::MOST)),
        }
    }
}

impl fmt::Display for SampleRange {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}-{}", self.first, self.end)
    }
}

/// The sum of the samples of each pixel over an aligned block.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockSum {
    /// The block.
    pub samples: SampleRange,
    /// The sum of each pixel's radiances, linear RGB, rows from the top.
    pub sums: Vec<[f32; 3]>,
}

/// Sums of the samples of consecutive aligned blocks. Of two blocks that make up a larger aligned block, only their
/// joined sum is kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SampleSums(Vec<BlockSum>);

impl SampleSums {
    /// The blocks, in order.
    pub fn blocks(&self) -> &[BlockSum] {
        &self.0
    }

    /// Returns the blocks, in order.
    pub fn into_blocks(self) -> Vec<BlockSum> {
        self.0
    }

    /// Returns the range of all samples.
    pub fn samples(&self) -> SampleRange {
        let ends = (self.0.first().zip(self.0.last())).map(|(first, last)| (first.samples.first, last.samples.end));
        let (first, end) = ends.unwrap_or_default();
        SampleRange { first, end }
    }

    /// Adds the next block.
    ///
    /// # Panics
    /// The block is not aligned, does not follow the last one, or has another number of pixels.
    pub(crate) fn push(&mut self, block: BlockSum) {
        let SampleRange { first, .. } = block.samples;
        let len = block.samples.len();
        assert!(len.is_power_of_two() && first.is_multiple_of(len), "{} is no aligned block", block.samples);
        let mut next = block;
        while let Some(last) = self.0.last() {
            assert_eq!((last.samples.end, last.sums.len()), (next.samples.first, next.sums.len()), "blocks in order");
            let Some(samples) = last.samples.joined(&next.samples) else { break };
            let BlockSum { mut sums, .. } = self.0.pop().expect("the last block");
            add(&mut sums, &next.sums);
            next = BlockSum { samples, sums };
        }
        self.0.push(next);
    }

    /// Adds the next block, whose mean radiances a picture has. A power of two divides without rounding, so the sums
    /// are those that the kernel has divided, except for sums below 2^-102, which may have lost digits.
    ///
    /// # Panics
    /// As [`SampleSums::push`].
    pub(crate) fn push_mean(&mut self, samples: SampleRange, radiance: &[[f32; 4]]) {
        let n = samples.len() as f32;
        let sums = radiance.par_iter().map(|&[r, g, b, _]| [r * n, g * n, b * n]).collect();
        self.push(BlockSum { samples, sums });
    }

    /// Returns the means of all samples as the kernel computes them: the sums are added from the last block to the
    /// first one, and multiplied by the reciprocal of their number. The fourth component is 1.
    pub fn mean(&self) -> Vec<[f32; 4]> {
        self.clone().into_mean()
    }

    /// Returns what [`SampleSums::mean`] does.
    pub fn into_mean(mut self) -> Vec<[f32; 4]> {
        let reciprocal = 1.0 / self.samples().len() as f32;
        let Some(BlockSum { mut sums, .. }) = self.0.pop() else { return Vec::new() };
        self.0.iter().rev().for_each(|block| add(&mut sums, &block.sums));
        sums.into_par_iter().map(|[r, g, b]| [r * reciprocal, g * reciprocal, b * reciprocal, 1.0]).collect()
    }
}

/// Returns the variance of the mean of several ranges of samples. Each range is given by its number of samples and the
/// variance of its mean. The estimate has no bias, but is not that of all samples drawn at once.
pub fn variance_of_joined(ranges: impl Iterator<Item = (u32, f32)>) -> f32 {
    let (mut n_all, mut sum) = (0.0, 0.0);
    for (n, variance) in ranges {
        n_all += f64::from(n);
        sum += f64::from(n).powi(2) * f64::from(variance);
    }
    (sum / (n_all * n_all)) as f32
}

fn add(sums: &mut [[f32; 3]], others: &[[f32; 3]]) {
    sums.as_flattened_mut().par_iter_mut().zip(others.as_flattened()).for_each(|(sum, other)| *sum += other);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(word: &str) -> SampleRange {
        word.parse().unwrap()
    }

    fn blocks(word: &str) -> Vec<String> {
        range(word).blocks().map(|block| block.to_string()).collect()
    }

    #[test]
    fn words() {
        assert_eq!(range("16-64"), SampleRange { first: 16, end: 64 });
        assert_eq!(range("0-65536").len(), SampleRange::MOST);
        for word in ["", "16", "0-0", "32-16", "0-65537", "-16-32", "0-16-32", "a-b"] {
            assert!(word.parse::<SampleRange>().is_err(), "{word}");
        }
        assert!(["0-16", "16-48", "96-100", "0-100"].into_iter().all(|word| range(word).is_part_of(100)));
        assert!(!["0-8", "8-16", "96-99", "96-112"].into_iter().any(|word| range(word).is_part_of(100)));
    }

    #[test]
    fn blocks_are_aligned() {
        assert_eq!(blocks("0-64"), ["0-64"]);
        assert_eq!(blocks("0-48"), ["0-32", "32-48"]);
        assert_eq!(blocks("48-96"), ["48-64", "64-96"]);
        assert_eq!(blocks("16-112"), ["16-32", "32-64", "64-96", "96-112"]);
        let blocks: Vec<_> = SampleRange { first: 5, end: 11 }.blocks().map(|block| block.to_string()).collect();
        assert_eq!(blocks, ["5-6", "6-8", "8-10", "10-11"]);
        assert_eq!(SampleRange::whole(0).blocks().count(), 0);
    }

    /// Whatever parts the blocks come in, the sums are those of the tree over all samples.
    #[test]
    fn joined_sums_are_those_of_one_tree() {
        // The sum of these numbers depends on the order in which they are added.
        let sample = |ix: u32| (f64::from(ix) * 0.618_033_988_7).fract() as f32 + 1e-3 * ix as f32;
        fn tree(samples: SampleRange, sample: &impl Fn(u32) -> f32) -> f32 {
            let SampleRange { first, end } = samples;
            match samples.len() {
                1 => sample(first),
                len => {
                    tree(SampleRange { first, end: first + len / 2 }, sample)
                        + tree(SampleRange { first: first + len / 2, end }, sample)
                }
            }
        }
        let joined = |words: &[&str]| {
            let mut sums = SampleSums::default();
            for block in words.iter().flat_map(|word| range(word).blocks()) {
                sums.push(BlockSum { samples: block, sums: vec![[tree(block, &sample), 0.0, 1.0]] });
            }
            sums
        };
        let expected = [tree(range("0-64"), &sample), tree(range("64-96"), &sample), tree(range("96-112"), &sample)];
        for words in [&["0-112"][..], &["0-16", "16-112"], &["0-48", "48-96", "96-112"], &["0-64", "64-80", "80-112"]] {
            let sums = joined(words);
            let found: Vec<_> = sums.blocks().iter().map(|block| block.sums[0][0]).collect();
            assert_eq!(found, expected, "{words:?}");
            let [a, b, c] = expected;
            assert_eq!(sums.mean()[0][0], (c + b + a) * (1.0 / 112.0));
            assert_eq!(sums.samples(), range("0-112"));
        }
        let one_by_one = (0..112).map(sample).sum::<f32>();
        assert_ne!(one_by_one, expected[2] + expected[1] + expected[0]);
    }

    /// Blocks that follow each other are joined only if they make up an aligned block.
    #[test]
    fn unaligned_neighbours_stay_apart() {
        let mut sums = SampleSums::default();
        for block in range("16-48").blocks() {
            sums.push(BlockSum { samples: block, sums: vec![[1.0; 3]] });
        }
        let blocks: Vec<_> = sums.blocks().iter().map(|block| block.samples.to_string()).collect();
        assert_eq!(blocks, ["16-32", "32-48"]);
    }

    /// Two halves of equal variance have half of it together. A single range keeps its own.
    #[test]
    fn variances_of_ranges_add_up() {
        assert_eq!(variance_of_joined([(16, 0.5), (16, 0.5)].into_iter()), 0.25);
        assert_eq!(variance_of_joined([(48, 0.3)].into_iter()), 0.3);
        assert_eq!(variance_of_joined([(48, 1.0), (16, 9.0)].into_iter()), (9.0 + 9.0) / 16.0);
    }

    #[test]
    #[should_panic(expected = "blocks in order")]
    fn a_gap_is_noticed() {
        let mut sums = SampleSums::default();
        sums.push(BlockSum { samples: range("0-16"), sums: vec![[0.0; 3]] });
        sums.push(BlockSum { samples: range("32-64"), sums: vec![[0.0; 3]] });
    }
}

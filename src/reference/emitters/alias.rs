//! Alias tables: sample one of many entries, each with its own probability. Twin of `emitters/alias.glsl`, which names
//! the source.

/// The largest float below 1.
pub const ALMOST_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// The entry that is sampled, and what is left of the random number: uniform in [0, 1), independent of the entry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AliasSample {
    pub ix: u32,
    pub rest: f32,
}

/// Samples one of `n` entries. `entry` returns an entry's threshold and alias. `u` is in [0, 1), and `more`, also in
/// [0, 1), continues it below the 24 bits that a float has.
pub fn sample_alias(n: u32, entry: impl Fn(u32) -> (f32, u32), u: f32, more: f32) -> AliasSample {
    let scaled = u * n as f32;
    let ix = (scaled as u32).min(n - 1);
    let rest = (scaled - ix as f32 + more * n as f32 * (1.0 / 16_777_216.0)).min(ALMOST_ONE);
    let (threshold, alias_ix) = entry(ix);
    if rest < threshold {
        return AliasSample { ix, rest: (rest / threshold).min(ALMOST_ONE) };
    }
    AliasSample { ix: alias_ix, rest: ((rest - threshold) / (1.0 - threshold)).min(ALMOST_ONE) }
}

//! Alias tables, by which a device samples one of many entries in constant time (Vose: A Linear Algorithm for
//! Generating Random Numbers with a Given Distribution, IEEE TSE 1991). The lookup is in `reference::emitters::alias`.

/// An entry of an alias table.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct AliasEntry {
    /// The share of the entry's samples that stay with it, 0 to 1.
    pub threshold: f32,
    /// The entry that gets the other samples.
    pub alias_ix: u32,
}

impl AliasEntry {
    /// The threshold and the alias.
    pub fn parts(self) -> (f32, u32) {
        (self.threshold, self.alias_ix)
    }
}

/// Returns the table of entries with these weights, which are finite and not negative. Without a weight above 0, all
/// entries are alike.
pub fn alias_table(weights: &[f64]) -> Vec<AliasEntry> {
    let n = weights.len();
    let own = |ix: usize| AliasEntry { threshold: 1.0, alias_ix: ix as u32 };
    let mut table: Vec<AliasEntry> = (0..n).map(own).collect();
    let sum: f64 = weights.iter().sum();
    if !(sum > 0.0) {
        return table;
    }
    let mut left: Vec<f64> = weights.iter().map(|weight| weight / sum * n as f64).collect();
    let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..n).partition(|&ix| left[ix] < 1.0);
    while let Some(&giver) = large.last()
        && let Some(taker) = small.pop()
    {
        table[taker] = AliasEntry { threshold: left[taker] as f32, alias_ix: giver as u32 };
        // The giver loses what the rounded threshold leaves, so that the probabilities are exact.
        left[giver] -= 1.0 - f64::from(table[taker].threshold);
        if left[giver] < 1.0 {
            large.pop();
            small.push(giver);
        }
    }
    // Rounding is all that what is left lacks, except for an entry without weight, which must not be sampled.
    for ix in small.into_iter().filter(|&ix| weights[ix] == 0.0) {
        let heaviest = (0..n).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).expect("some weight is above 0");
        table[ix] = AliasEntry { threshold: 0.0, alias_ix: heaviest as u32 };
    }
    table
}

/// Returns the probabilities with which the entries of a table are sampled.
pub fn probabilities(table: &[AliasEntry]) -> Vec<f64> {
    let mut sums: Vec<f64> = table.iter().map(|entry| f64::from(entry.threshold)).collect();
    for entry in table {
        sums[entry.alias_ix as usize] += 1.0 - f64::from(entry.threshold);
    }
    sums.into_iter().map(|sum| sum / table.len() as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the largest difference between the probabilities of a table and the shares of the weights.
    fn error_of(table: &[AliasEntry], weights: &[f64]) -> f64 {
        let sum: f64 = weights.iter().sum();
        let errors = probabilities(table).into_iter().zip(weights).map(|(found, weight)| (found - weight / sum).abs());
        errors.fold(0.0, f64::max)
    }

    fn weights(n: usize) -> Vec<f64> {
        (0..n).map(|i| if i % 7 == 3 { 0.0 } else { f64::from((i * i % 101) as u32).powi(3) + 0.25 }).collect()
    }

    #[test]
    fn probabilities_are_those_of_the_weights() {
        for n in [1, 2, 3, 100, 10_000] {
            let weights = weights(n);
            let table = alias_table(&weights);
            assert!(error_of(&table, &weights) < 1e-5 / n as f64, "{n}: {}", error_of(&table, &weights));
            let found = probabilities(&table);
            assert!(found.iter().zip(&weights).all(|(found, weight)| (*found == 0.0) == (*weight == 0.0)), "{n}");
        }
        assert_eq!(probabilities(&alias_table(&[0.0, 0.0])), [0.5, 0.5]);
        assert!(alias_table(&[]).is_empty());
    }

    #[test]
    fn a_wrong_alias_is_found() {
        let weights = weights(100);
        let mut table = alias_table(&weights);
        let ix = table.iter().position(|entry| entry.threshold < 0.9).unwrap();
        table[ix].alias_ix = (table[ix].alias_ix + 1) % 100;
        assert!(error_of(&table, &weights) > 1e-4);
    }
}

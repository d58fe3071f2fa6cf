//! Checks that parts belong to one picture, and that each sample of each pixel is in exactly one of them.

use std::collections::BTreeMap;

use super::{MergeError, Part};
use crate::frame::{Channel, Crop, SampleRange, Samples};

/// The parts that have the same pixels, in the order of their samples. There is at least one.
pub type Tile = Vec<Part>;

/// Returns the tiles that the parts make up.
///
/// # Errors
/// Parts are of different pictures, overlap, or leave a gap.
pub fn tiles(parts: Vec<Part>) -> Result<Vec<Tile>, MergeError> {
    let first = parts.first().ok_or_else(|| MergeError::Missing("there is no part".to_owned()))?;
    for other in &parts {
        let mut difference = first.record.whole.difference(&other.record.whole);
        if difference.is_none() && layers(first) != layers(other) {
            let names = |part| layers(part).into_iter().map(|(name, _)| name).collect::<Vec<_>>().join(", ");
            difference = Some(format!("the layers are `{}` and `{}`", names(first), names(other)));
        }
        if let Some(difference) = difference {
            return Err(MergeError::Other { path: first.path.clone(), other: other.path.clone(), difference });
        }
    }
    let whole = &first.record.whole;
    let (size, samples) = ((whole.width, whole.height), SampleRange::whole(whole.n_samples));
    let mut tiles: BTreeMap<[u32; 4], Tile> = BTreeMap::new();
    for part in parts {
        let Crop { x0, y0, x1, y1 } = part.record.crop;
        tiles.entry([y0, x0, y1, x1]).or_default().push(part);
    }
    let mut tiles: Vec<_> = tiles.into_values().collect();
    tiles.iter_mut().for_each(|tile| tile.sort_by_key(|part| part.record.samples));
    check_overlaps(&tiles)?;
    let missing: Vec<_> = uncovered(&tiles, size)
        .into_iter()
        .map(|crop| format!("the pixels of --crop {crop}"))
        .chain(tiles.iter().flat_map(|tile| missing_samples(tile, samples)))
        .collect();
    if missing.is_empty() {
        return Ok(tiles);
    }
    let files: Vec<_> = tiles.iter().flatten().map(|part| part.path.display().to_string()).collect();
    let message = format!("the parts have gaps: {} (the parts are {})", listed(&missing, "; "), listed(&files, ", "));
    Err(MergeError::Missing(message))
}

/// The most gaps, and the most files with parts, that an error names.
const MOST_NAMED: usize = 8;

/// Returns the first names of a list, and how many there are beside them.
fn listed(names: &[String], separator: &str) -> String {
    let named = names[..names.len().min(MOST_NAMED)].join(separator);
    match names.len().saturating_sub(MOST_NAMED) {
        0 => named,
        n => format!("{named} and {n} more"),
    }
}

/// Returns the names of a part's channels beside colour, and whether each has whole numbers, in the order of the file,
/// which is that of the names.
fn layers(part: &Part) -> Vec<(&str, bool)> {
    let layer = |channel: &'_ Channel| matches!(channel.samples, Samples::Uint(_));
    part.channels.iter().map(|channel| (channel.name.as_str(), layer(channel))).collect()
}

/// Refuses two parts that have the same sample of a pixel, or some of their pixels in common. The tiles are in the
/// order of their first rows.
fn check_overlaps(tiles: &[Tile]) -> Result<(), MergeError> {
    let overlap =
        |a: &Part, b: &Part, common| MergeError::Overlap { path: a.path.clone(), other: b.path.clone(), common };
    for (tile_ix, tile) in tiles.iter().enumerate() {
        for pair in tile.windows(2) {
            let [a, b] = [&pair[0], &pair[1]].map(|part| part.record.samples);
            if let Some(samples) = common_samples(a, b) {
                let common = format!("--samples {samples} of --crop {}", pair[0].record.crop);
                return Err(overlap(&pair[0], &pair[1], common));
            }
        }
        let crop = tile[0].record.crop;
        for other in tiles[tile_ix + 1..].iter().take_while(|other| other[0].record.crop.y0 < crop.y1) {
            if let Some(common) = common_pixels(crop, other[0].record.crop) {
                return Err(overlap(&tile[0], &other[0], format!("the pixels of --crop {common}")));
            }
        }
    }
    Ok(())
}

fn common_samples(a: SampleRange, b: SampleRange) -> Option<SampleRange> {
    let common = SampleRange { first: a.first.max(b.first), end: a.end.min(b.end) };
    (!common.is_empty()).then_some(common)
}

fn common_pixels(a: Crop, b: Crop) -> Option<Crop> {
    let common = Crop { x0: a.x0.max(b.x0), y0: a.y0.max(b.y0), x1: a.x1.min(b.x1), y1: a.y1.min(b.y1) };
    (common.x0 < common.x1 && common.y0 < common.y1).then_some(common)
}

/// Returns rectangles of pixels that no tile has. The tiles do not overlap. Their edges cut the picture into cells;
/// cells without a tile that follow each other in a row are one rectangle.
fn uncovered(tiles: &[Tile], (width, height): (u32, u32)) -> Vec<Crop> {
    let crops: Vec<_> = tiles.iter().map(|tile| tile[0].record.crop).collect();
    let n_covered: u64 = crops.iter().map(|crop| u64::from(crop.width()) * u64::from(crop.height())).sum();
    if n_covered == u64::from(width) * u64::from(height) {
        return Vec::new();
    }
    let cuts = |ends: &dyn Fn(&Crop) -> [u32; 2], size: u32| {
        let mut cuts: Vec<_> = crops.iter().flat_map(ends).chain([0, size]).collect();
        cuts.sort_unstable();
        cuts.dedup();
        cuts
    };
    let (columns, rows) = (cuts(&|crop| [crop.x0, crop.x1], width), cuts(&|crop| [crop.y0, crop.y1], height));
    let mut gaps: Vec<Crop> = Vec::new();
    for row in rows.windows(2) {
        let in_row: Vec<_> = crops.iter().filter(|crop| crop.y0 <= row[0] && row[0] < crop.y1).collect();
        for column in columns.windows(2) {
            if in_row.iter().any(|crop| crop.x0 <= column[0] && column[0] < crop.x1) {
                continue;
            }
            match gaps.last_mut() {
                Some(last) if last.y0 == row[0] && last.x1 == column[0] => last.x1 = column[1],
                _ => gaps.push(Crop { x0: column[0], y0: row[0], x1: column[1], y1: row[1] }),
            }
        }
    }
    gaps
}

/// Returns the samples that a tile lacks, with its pixels.
fn missing_samples(tile: &Tile, samples: SampleRange) -> Vec<String> {
    let ends = tile.iter().map(|part| part.record.samples.end);
    let firsts = tile.iter().map(|part| part.record.samples.first);
    let gaps = std::iter::once(samples.first).chain(ends).zip(firsts.chain([samples.end]));
    gaps.filter(|(end, first)| end < first)
        .map(|(first, end)| format!("--samples {} of --crop {}", SampleRange { first, end }, tile[0].record.crop))
        .collect()
}

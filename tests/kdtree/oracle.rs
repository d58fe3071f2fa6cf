//! A plain exact builder: at every cell it sorts all ends on all axes and sweeps them (O(n log^2 n)), with clipped
//! triangles, in f64. Only the tree's cost is kept.

use kdray::{kdtree::BuildOptions, layout::Triangle};

type Point = [f64; 3];
/// Min, max.
type Box3 = [Point; 2];

/// A triangle's corners, and the bounds of its part in the cell.
type Part = ([Point; 3], Box3);

/// SAH cost of the greedy tree.
pub fn sah_cost(triangles: &[Triangle], options: &BuildOptions) -> f64 {
    let corners = |t: &Triangle| [t.v0, t.v1, t.v2].map(|v| v.as_dvec3().to_array());
    let parts: Vec<Part> = triangles.iter().map(|t| (corners(t), bounds(&corners(t)))).collect();
    let cell = bounds(&parts.iter().flat_map(|part| part.1).collect::<Vec<_>>());
    cost(&parts, &cell, options, options.depth_limit())
}

fn bounds(points: &[Point]) -> Box3 {
    let fold = |from: f64, pick: fn(f64, f64) -> f64| {
        [0, 1, 2].map(|axis| points.iter().fold(from, |best, point| pick(best, point[axis])))
    };
    [fold(f64::INFINITY, f64::min), fold(f64::NEG_INFINITY, f64::max)]
}

fn half_area([min, max]: &Box3) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|axis| max[axis] - min[axis]);
    x * y + y * z + z * x
}

fn split_cell(cell: &Box3, axis: usize, position: f64) -> [Box3; 2] {
    let [mut below, mut above] = [*cell; 2];
    below[1][axis] = position;
    above[0][axis] = position;
    [below, above]
}

fn cost(parts: &[Part], cell: &Box3, options: &BuildOptions, levels: u32) -> f64 {
    let (step, test) = (f64::from(options.traversal_cost), f64::from(options.intersection_cost));
    let leaf = test * parts.len() as f64;
    let Some((weight, axis, position, planar_below)) = best_plane(parts, cell, options).filter(|_| levels > 0) else {
        return leaf;
    };
    if step + test * weight >= leaf {
        return leaf;
    }
    let cells = split_cell(cell, axis, position);
    let sides = [0, 1].map(|side| -> Vec<Part> {
        parts.iter().filter_map(|part| part_in(part, &cells, side, (axis, position, planar_below))).collect()
    });
    let child =
        |side: usize| half_area(&cells[side]) / half_area(cell) * cost(&sides[side], &cells[side], options, levels - 1);
    step + child(0) + child(1)
}

/// Weight, axis, position, and whether triangles in the plane go below.
fn best_plane(parts: &[Part], cell: &Box3, options: &BuildOptions) -> Option<(f64, usize, f64, bool)> {
    let mut best: Option<(f64, usize, f64, bool)> = None;
    for axis in 0..3 {
        // End, planar, begin: the order in which they count at one position.
        let mut events: Vec<(f64, usize)> = Vec::new();
        for (_, [min, max]) in parts {
            if min[axis] == max[axis] {
                events.push((min[axis], 1));
            } else {
                events.extend([(min[axis], 2), (max[axis], 0)]);
            }
        }
        events.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
        let (mut n_below, mut n_above) = (0, parts.len());
        for in_plane in events.chunk_by(|a, b| a.0 == b.0) {
            let position = in_plane[0].0;
            let [n_ends, n_planar, n_begins] = [0, 1, 2].map(|kind| in_plane.iter().filter(|e| e.1 == kind).count());
            n_above -= n_ends + n_planar;
            if position > cell[0][axis] && position < cell[1][axis] {
                let areas = split_cell(cell, axis, position).map(|child| half_area(&child) / half_area(cell));
                for (below, above, planar_below) in [(n_planar, 0, true), (0, n_planar, false)] {
                    let n = [n_below + below, n_above + above];
                    let bonus = if n.contains(&0) { f64::from(options.empty_bonus) } else { 0.0 };
                    let weight = (1.0 - bonus) * (areas[0] * n[0] as f64 + areas[1] * n[1] as f64);
                    if best.is_none_or(|best| weight < best.0) {
                        best = Some((weight, axis, position, planar_below));
                    }
                }
            }
            n_below += n_begins + n_planar;
        }
    }
    best
}

/// The part of a triangle on one side (0 below, 1 above) of a plane, none where it has none there.
fn part_in(
    part: &Part,
    cells: &[Box3; 2],
    side: usize,
    (axis, position, planar_below): (usize, f64, bool),
) -> Option<Part> {
    let (corners, [min, max]) = part;
    let planar = min[axis] == position && max[axis] == position;
    let sides = [(planar && planar_below) || min[axis] < position, (planar && !planar_below) || max[axis] > position];
    if !sides[side] {
        return None;
    }
    if !sides[1 - side] {
        return Some(*part);
    }
    let mut polygon = corners.to_vec();
    let [cell_min, cell_max] = cells[side];
    for (face, (from, to)) in cell_min.into_iter().zip(cell_max).enumerate() {
        polygon = clip(&polygon, face, |x| x - from);
        polygon = clip(&polygon, face, |x| to - x);
    }
    let clipped = bounds(&polygon);
    (clipped[0][axis] < clipped[1][axis]).then_some((*corners, clipped))
}

/// What of a polygon has a height of 0 or more over a plane that is square to an axis.
fn clip(polygon: &[Point], axis: usize, height: impl Fn(f64) -> f64) -> Vec<Point> {
    let mut kept = Vec::new();
    for (ix, a) in polygon.iter().enumerate() {
        let b = &polygon[(ix + 1) % polygon.len()];
        let (height_a, height_b) = (height(a[axis]), height(b[axis]));
        if height_a >= 0.0 {
            kept.push(*a);
        }
        if (height_a > 0.0 && height_b < 0.0) || (height_a < 0.0 && height_b > 0.0) {
            let t = height_a / (height_a - height_b);
            let mut point = [0, 1, 2].map(|k| a[k] + t * (b[k] - a[k]));
            // Exactly in the plane, as ends of other triangles are.
            point[axis] = a[axis] - height_a * (if height(1.0) > height(0.0) { 1.0 } else { -1.0 });
            kept.push(point);
        }
    }
    kept
}

//! A plain exact builder of kd-trees, which returns only the tree's cost. In every cell it sorts the ends of all
//! triangles on all axes and sweeps them (O(n log^2 n)). Triangles are clipped to cells and have the same margins as
//! in kdray. It computes in f64.

use kdray::{accel::kdtree::BuildOptions, layout::Triangle};

type Point = [f64; 3];
/// Minimum and maximum of an axis-aligned box.
type Box3 = [Point; 2];

/// A triangle's corners, and the bounds of its piece in the cell.
type Piece = ([Point; 3], Box3);

/// Returns the SAH cost of the greedy tree.
pub fn sah_cost(triangles: &[Triangle], options: &BuildOptions) -> f64 {
    let corners = |t: &Triangle| [t.v0, t.v1, t.v2].map(|v| v.as_dvec3().to_array());
    let points: Vec<Point> = triangles.iter().flat_map(corners).collect();
    let margin = points.as_flattened().iter().fold(0.0, |m: f64, x| m.max(x.abs())) * 2f64.powi(-17);
    let pieces: Vec<Piece> = triangles.iter().map(|t| (corners(t), grown(bounds(&corners(t)), margin))).collect();
    cost(&pieces, &grown(bounds(&points), margin), options, margin, options.depth_limit())
}

fn grown([min, max]: Box3, margin: f64) -> Box3 {
    [min.map(|x| x - margin), max.map(|x| x + margin)]
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

fn cost(pieces: &[Piece], cell: &Box3, options: &BuildOptions, margin: f64, levels: u32) -> f64 {
    let (step, test) = (f64::from(options.traversal_cost), f64::from(options.intersection_cost));
    let leaf = test * pieces.len() as f64;
    let Some((weight, axis, position)) = best_plane(pieces, cell, options).filter(|_| levels > 0) else {
        return leaf;
    };
    if step + test * weight >= leaf {
        return leaf;
    }
    let cells = split_cell(cell, axis, position);
    let sides = [0, 1].map(|side| -> Vec<Piece> {
        pieces.iter().filter_map(|piece| piece_in(piece, &cells, side, (axis, position), margin)).collect()
    });
    let child = |side: usize| {
        half_area(&cells[side]) / half_area(cell) * cost(&sides[side], &cells[side], options, margin, levels - 1)
    };
    step + child(0) + child(1)
}

/// Returns the weight, the axis and the position of the best split plane.
fn best_plane(pieces: &[Piece], cell: &Box3, options: &BuildOptions) -> Option<(f64, usize, f64)> {
    let mut best: Option<(f64, usize, f64)> = None;
    for axis in 0..3 {
        // At one position, ends come before begins.
        let mut events: Vec<(f64, bool)> =
            pieces.iter().flat_map(|(_, [min, max])| [(min[axis], true), (max[axis], false)]).collect();
        events.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
        let (mut n_below, mut n_above) = (0, pieces.len());
        for in_plane in events.chunk_by(|a, b| a.0 == b.0) {
            let position = in_plane[0].0;
            let n_begins = in_plane.iter().filter(|event| event.1).count();
            n_above -= in_plane.len() - n_begins;
            if position > cell[0][axis] && position < cell[1][axis] {
                let areas = split_cell(cell, axis, position).map(|child| half_area(&child) / half_area(cell));
                let bonus = if n_below == 0 || n_above == 0 { f64::from(options.empty_bonus) } else { 0.0 };
                let weight = (1.0 - bonus) * (areas[0] * n_below as f64 + areas[1] * n_above as f64);
                if best.is_none_or(|best| weight < best.0) {
                    best = Some((weight, axis, position));
                }
            }
            n_below += n_begins;
        }
    }
    best
}

/// Returns the piece of a triangle on one side (0 below, 1 above) of a plane, or `None` if there is none.
fn piece_in(
    piece: &Piece,
    cells: &[Box3; 2],
    side: usize,
    (axis, position): (usize, f64),
    margin: f64,
) -> Option<Piece> {
    let (corners, piece_box @ [min, max]) = piece;
    let sides = [min[axis] < position, max[axis] > position];
    if !sides[side] {
        return None;
    }
    if !sides[1 - side] {
        return Some(*piece);
    }
    let mut polygon = corners.to_vec();
    let [near_min, near_max] = grown(cells[side], margin);
    for (face, (from, to)) in near_min.into_iter().zip(near_max).enumerate() {
        polygon = clip(&polygon, face, |x| x - from);
        polygon = clip(&polygon, face, |x| to - x);
    }
    if polygon.is_empty() {
        return None;
    }
    let clipped = grown(bounds(&polygon), margin);
    let limits = [cells[side], *piece_box];
    let within = |pick: fn(f64, f64) -> f64, end: usize| {
        [0, 1, 2].map(|k| limits.iter().fold(clipped[end][k], |x, limit| pick(x, limit[end][k])))
    };
    Some((*corners, [within(f64::max, 0), within(f64::min, 1)]))
}

/// Returns the piece of a polygon with a height of at least 0 over a plane perpendicular to an axis.
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
            // The point is exactly in the plane, as the ends of other triangles are.
            point[axis] = a[axis] - height_a * (if height(1.0) > height(0.0) { 1.0 } else { -1.0 });
            kept.push(point);
        }
    }
    kept
}

//! Vertex indices of the visibility pass. A pixel gets its triangle's index from the triangle's first vertex, the
//! provoking vertex. So each triangle needs a first vertex of its own. The other two may be vertices of other
//! triangles at the same points. With vertices shared like this, a device transforms about one vertex per triangle
//! instead of three.

use glam::Vec3;
use hashbrown::HashMap;

use crate::layout::Triangle;

/// The greatest vertex index that every device supports (the least `maxDrawIndexedIndexValue` that Vulkan allows).
const MAX_INDEX: usize = (1 << 24) - 1;

/// Returns three vertex indices for each triangle. A vertex has the index `3 * triangle + corner`. The first of the
/// three is a vertex of the triangle itself. The other two are vertices of any triangles at the points of its next
/// corners, so the triangle keeps its winding. The result is empty if a device may not support the greatest index.
pub fn vertex_indices(triangles: &[Triangle]) -> Vec<u32> {
    if !has_indices(triangles.len()) {
        return Vec::new();
    }
    let (points, n_points) = points_of(triangles);
    // For each point, the index of a corner there, if possible of one that is a triangle's first.
    let mut vertex_at = vec![u32::MAX; n_points];
    let mut first_corners = Vec::with_capacity(triangles.len());
    for (triangle_ix, corners) in (0..).zip(&points) {
        let first = (0..3).find(|&corner| vertex_at[corners[corner] as usize] == u32::MAX).unwrap_or(0);
        vertex_at[corners[first] as usize] = vertex(triangle_ix, first);
        first_corners.push(first);
    }
    for (triangle_ix, corners) in (0..).zip(&points) {
        for (corner, &point) in corners.iter().enumerate() {
            let at_point = &mut vertex_at[point as usize];
            if *at_point == u32::MAX {
                *at_point = vertex(triangle_ix, corner);
            }
        }
    }
    let indices_of = |(triangle_ix, (corners, &first)): (u32, (&[u32; 3], &usize))| {
        let at = |corner: usize| vertex_at[corners[corner % 3] as usize];
        [vertex(triangle_ix, first), at(first + 1), at(first + 2)]
    };
    (0..).zip(points.iter().zip(&first_corners)).flat_map(indices_of).collect()
}

/// Whether every device can draw this many triangles by indices.
pub fn has_indices(n_triangles: usize) -> bool {
    3 * n_triangles <= MAX_INDEX
}

/// Returns the index of a triangle's corner.
fn vertex(triangle_ix: u32, corner: usize) -> u32 {
    3 * triangle_ix + corner as u32
}

/// Numbers the distinct points of all corners. Returns the number of each corner's point, and the number of distinct
/// points. Points are the same if they have the same bits.
fn points_of(triangles: &[Triangle]) -> (Vec<[u32; 3]>, usize) {
    let mut numbers = HashMap::with_capacity(triangles.len());
    let mut number_of = |p: Vec3| {
        let next = numbers.len() as u32;
        *numbers.entry(p.to_array().map(f32::to_bits)).or_insert(next)
    };
    let points = triangles.iter().map(|t| [t.v0, t.v1, t.v2].map(&mut number_of)).collect();
    (points, numbers.len())
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use glam::vec3;

    use super::*;

    fn corner(triangles: &[Triangle], vertex: u32) -> Vec3 {
        let t = &triangles[vertex as usize / 3];
        [t.v0, t.v1, t.v2][vertex as usize % 3]
    }

    /// Makes a square of n x n cells, two triangles each.
    fn grid(n: usize) -> Vec<Triangle> {
        let at = |x: usize, y: usize| vec3(x as f32, y as f32, 0.0);
        let triangle = |v0, v1, v2| Triangle { v0, v1, v2, ..Triangle::default() };
        let cell = |i: usize| {
            let (x, y) = (i % n, i / n);
            let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
            [triangle(a, b, c), triangle(a, c, d)]
        };
        (0..n * n).flat_map(cell).collect()
    }

    #[test]
    fn the_same_points_the_same_way_round_beginning_with_a_corner_of_their_own() {
        let mut triangles = grid(7);
        triangles.push(Triangle::default()); // without area
        triangles.push(triangles[3]);
        triangles[5].v1.x = -0.0;
        let indices = vertex_indices(&triangles);
        assert_eq!(indices.len(), 3 * triangles.len());
        for (triangle_ix, indices) in indices.chunks(3).enumerate() {
            let t = &triangles[triangle_ix];
            assert_eq!(indices[0] as usize / 3, triangle_ix);
            let first = indices[0] as usize % 3;
            for (i, &index) in indices.iter().enumerate() {
                let expected = [t.v0, t.v1, t.v2][(first + i) % 3];
                assert_eq!(
                    corner(&triangles, index).to_array().map(f32::to_bits),
                    expected.to_array().map(f32::to_bits)
                );
            }
        }
    }

    #[test]
    fn there_are_hardly_more_vertices_than_triangles() {
        let triangles = grid(30);
        let distinct: HashSet<u32> = vertex_indices(&triangles).into_iter().collect();
        assert!(distinct.len() < triangles.len() + 20, "{} of {} triangles", distinct.len(), triangles.len());
    }
}

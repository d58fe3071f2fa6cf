//! Shading normals for meshes without normals. The normal at a face's corner is the angle-weighted average of the
//! normals of the faces that meet there. Only faces count whose normals differ from the face's own normal by at most
//! the crease angle.
//!
//! The weights follow Thürmer and Wüthrich, "Computing Vertex Normals from Polygonal Facets" (JGT 1998).

use glam::{DVec3, Vec3};
use hashbrown::HashMap;
use rayon::prelude::*;

/// Largest number of faces around a point that are compared in pairs. A point where more faces meet is called a hub,
/// for example the middle of a fan. Comparing all its pairs would take quadratic time, so a hub's normal is the
/// average of all its faces, whatever their angles.
const MAX_PAIRED_FACES: usize = 256;
/// Number of positions whose map takes about 400 KB, at 20 bytes each.
const WELDED_TOGETHER: usize = 1 << 14;
/// Greatest number of bits of a part's index.
const MAX_PART_BITS: u32 = 12;
/// Deviation (1 - cosine; 0.08 degrees) below which a normal counts as the normal of the face's plane.
const FLAT_TOLERANCE: f32 = 1e-6;
/// Margin of the cosine of half the crease angle. With a margin of m, the cosine between two normals that keep it
/// exceeds that of the crease angle by 2 m^2 or more: 2e-6, more than dot products of unit vectors are rounded by.
const COSINE_MARGIN: f32 = 1e-3;

/// Angle between two faces, in degrees, beyond which their common edge is sharp.
pub(crate) const DEFAULT_CREASE: f32 = 40.0;

/// Options of a mesh's shading.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shading {
    /// If false, every face is flat, even where the file has normals.
    pub smooth: bool,
    /// Angle between two faces without normals, in degrees, beyond which their common edge is sharp.
    pub crease: f32,
}

impl Default for Shading {
    fn default() -> Self {
        Self { smooth: true, crease: DEFAULT_CREASE }
    }
}

/// A face's share in the averages at its corners: its normal, and its angles as weights.
#[derive(Clone, Copy, Default)]
struct Facet {
    /// Unit normal, or zero where the face has no area or is not smooth.
    normal: Vec3,
    /// Angles at its corners, radians.
    angles: [f32; 3],
}

/// Returns unit normals at the three corners of each face, or zeros where the normal of the face's plane is as good.
///
/// Points at the same place count as one, whatever their indices. A face whose `smooth` is false stays flat, and its
/// neighbours' normals ignore it. `crease` is in degrees.
pub(crate) fn crease_normals(positions: &[Vec3], faces: &[[u32; 3]], smooth: &[bool], crease: f32) -> Vec<[Vec3; 3]> {
    let facet = |(face, smooth): (&[u32; 3], &bool)| {
        if *smooth { facet(face.map(|ix| positions[ix as usize].as_dvec3())) } else { Facet::default() }
    };
    let facets = || -> Vec<Facet> { faces.par_iter().zip(smooth).map(facet).collect() };
    let (point_of, facets) = rayon::join(|| weld(positions), facets);
    let corners = faces.as_flattened().iter();
    let around = Groups::new(positions.len(), corners.map(|ix| point_of[*ix as usize] as usize));
    let corner_normals = CornerNormals::new(&around, &facets, crease);
    let normals_of = |(face, facet): (&[u32; 3], &Facet)| {
        if facet.normal == Vec3::ZERO {
            return [Vec3::ZERO; 3];
        }
        let normals = face.map(|ix| corner_normals.at(point_of[ix as usize], facet.normal));
        let is_flat = normals.iter().all(|n| n.dot(facet.normal) > 1.0 - FLAT_TOLERANCE);
        if is_flat { [Vec3::ZERO; 3] } else { normals }
    };
    faces.par_iter().zip(&facets).map(normals_of).collect()
}

/// Returns the shading normals of a mesh whose file has none: those of [`crease_normals`], or zeros for flat shading.
pub(crate) fn smooth_normals(positions: &[Vec3], faces: &[[u32; 3]], shading: Shading) -> Vec<[Vec3; 3]> {
    match shading.smooth {
        true => crease_normals(positions, faces, &vec![true; faces.len()], shading.crease),
        false => vec![[Vec3::ZERO; 3]; faces.len()],
    }
}

/// The data from which the normals at the corners of faces are computed.
struct CornerNormals<'a> {
    /// The corners that meet at each point. Corner k of face f has the number 3 f + k.
    around: &'a Groups,
    facets: &'a [Facet],
    min_cosine: f32,
    /// For each point the average that all its faces have in common, or `None` if the crease angle parts them.
    common: Vec<Option<Vec3>>,
}

impl<'a> CornerNormals<'a> {
    fn new(around: &'a Groups, facets: &'a [Facet], crease: f32) -> Self {
        let min_cosine = crease.to_radians().cos();
        let mut normals = Self { around, facets, min_cosine, common: Vec::new() };
        // If all normals are within half the crease angle of their average, each pair is within the crease angle.
        let half_cosine = (crease.to_radians() / 2.0).cos() + COSINE_MARGIN;
        let common = |point: u32| {
            let corners = around.of(point);
            let average = normals.average(point, |_| true);
            let is_near = |corner: &u32| {
                let facet = &facets[*corner as usize / 3];
                facet.normal == Vec3::ZERO || facet.normal.dot(average) >= half_cosine
            };
            // A hub's normal is the average of all its faces.
            let is_common = corners.len() > MAX_PAIRED_FACES || corners.iter().all(is_near);
            is_common.then_some(average)
        };
        normals.common = (0..around.first.len() as u32 - 1).into_par_iter().map(common).collect();
        normals
    }

    /// Returns the normal at a point of a face with normal `own`. It is `own` if the average differs by more than the
    /// crease angle.
    fn at(&self, point: u32, own: Vec3) -> Vec3 {
        let near = |n: Vec3| n.dot(own) >= self.min_cosine;
        let normal = self.common[point as usize].unwrap_or_else(|| self.average(point, near));
        if near(normal) { normal } else { own }
    }

    /// Returns the average of the normals around a point that the predicate `counts` accepts: a unit vector, or zero
    /// if they cancel out.
    fn average(&self, point: u32, counts: impl Fn(Vec3) -> bool) -> Vec3 {
        let corners = self.around.of(point).iter();
        let weighted = corners.map(|corner| {
            let facet = &self.facets[*corner as usize / 3];
            if counts(facet.normal) { facet.normal * facet.angles[*corner as usize % 3] } else { Vec3::ZERO }
        });
        weighted.sum::<Vec3>().normalize_or_zero()
    }
}

/// Returns for each position the index of the first position at the same place.
///
/// Positions are first sorted into parts by their places, so that the map of a part fits into a processor's cache.
fn weld(positions: &[Vec3]) -> Vec<u32> {
    let n_bits = positions.len().div_ceil(WELDED_TOGETHER).next_power_of_two().ilog2().min(MAX_PART_BITS);
    if n_bits == 0 {
        let mut first_at = HashMap::with_capacity(positions.len());
        let first = |(ix, p): (usize, &Vec3)| *first_at.entry(place(*p)).or_insert(ix as u32);
        return positions.iter().enumerate().map(first).collect();
    }
    let part_of: Vec<u16> = positions.par_iter().map(|p| part_of(place(*p), n_bits)).collect();
    let sorted = Groups::new(1 << n_bits, part_of.iter().map(|part| usize::from(*part)));
    let welded = |part: u32| {
        let of_part = sorted.of(part);
        let mut first_at = HashMap::with_capacity(of_part.len());
        let first = |ix: &u32| *first_at.entry(place(positions[*ix as usize])).or_insert(*ix);
        of_part.iter().map(first).collect::<Vec<u32>>()
    };
    let parts: Vec<Vec<u32>> = (0..1 << n_bits).into_par_iter().map(welded).collect();
    let mut first_of = vec![0; positions.len()];
    sorted.members.iter().zip(parts.iter().flatten()).for_each(|(ix, first)| first_of[*ix as usize] = *first);
    first_of
}

/// Returns what is equal for positions at the same place, and for no others.
fn place(p: Vec3) -> [u32; 3] {
    // Adding 0 turns -0 into 0.
    (p + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// Returns the part of a place: bits of a product, after Fibonacci hashing (Knuth, *The Art of Computer Programming*,
/// volume 3, section 6.4).
fn part_of([x, y, z]: [u32; 3], n_bits: u32) -> u16 {
    const RATIO: u64 = 0x9e37_79b9_7f4a_7c15;
    let xy = (u64::from(x) << 32 | u64::from(y)).wrapping_mul(RATIO);
    let mixed = ((xy ^ xy >> 29) + u64::from(z)).wrapping_mul(RATIO);
    (mixed >> (64 - n_bits)) as u16
}

/// Returns the normal and the angles of a face. They are computed in f64, in which the cross product of edges of
/// 1e-20 is not zero.
fn facet(corners: [DVec3; 3]) -> Facet {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
    let angle = |at: DVec3, p: DVec3, q: DVec3| (p - at).angle_between(q - at) as f32;
    // The angles of a face without area may be NaN.
    let angles = if normal == Vec3::ZERO { [0.0; 3] } else { [angle(a, b, c), angle(b, c, a), angle(c, a, b)] };
    Facet { normal, angles }
}

/// Indices in groups, ascending in each.
struct Groups {
    /// The members of group `ix` are `members[first[ix]..first[ix + 1]]`.
    first: Vec<u32>,
    members: Vec<u32>,
}

impl Groups {
    /// Sorts indices by the groups that `group_of` states for them.
    fn new(n_groups: usize, group_of: impl ExactSizeIterator<Item = usize> + Clone) -> Self {
        let mut first = vec![0; n_groups + 1];
        group_of.clone().for_each(|group| first[group + 1] += 1);
        (0..n_groups).for_each(|ix| first[ix + 1] += first[ix]);
        let (mut next, mut members) = (first.clone(), vec![0; group_of.len()]);
        for (ix, group) in group_of.enumerate() {
            members[next[group] as usize] = ix as u32;
            next[group] += 1;
        }
        Self { first, members }
    }

    fn of(&self, group: u32) -> &[u32] {
        &self.members[self.first[group as usize] as usize..self.first[group as usize + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the normals as their definition states them, corner by corner.
    fn plain_normals(positions: &[Vec3], faces: &[[u32; 3]], smooth: &[bool], crease: f32) -> Vec<[Vec3; 3]> {
        let at = |ix: u32| positions[ix as usize];
        let facets: Vec<Facet> = (faces.iter().zip(smooth))
            .map(|(face, smooth)| if *smooth { facet(face.map(|ix| at(ix).as_dvec3())) } else { Facet::default() })
            .collect();
        let normal = |point: Vec3, own: Vec3| {
            let near = |n: Vec3| n.dot(own) >= crease.to_radians().cos();
            let mut sum = Vec3::ZERO;
            for (face, facet) in faces.iter().zip(&facets).filter(|(_, facet)| near(facet.normal)) {
                for (_, angle) in face.iter().zip(facet.angles).filter(|(ix, _)| at(**ix) == point) {
                    sum += facet.normal * angle;
                }
            }
            let normal = sum.normalize_or_zero();
            if near(normal) { normal } else { own }
        };
        let normals = |(face, facet): (&[u32; 3], &Facet)| {
            let normals = face.map(|ix| normal(at(ix), facet.normal));
            let is_flat = normals.iter().all(|n| n.dot(facet.normal) > 1.0 - FLAT_TOLERANCE);
            if is_flat || facet.normal == Vec3::ZERO { [Vec3::ZERO; 3] } else { normals }
        };
        faces.iter().zip(&facets).map(normals).collect()
    }

    /// Positions are many enough to be sorted into parts. Most of them have others at the same place, and some of these
    /// have zeros of the other sign.
    #[test]
    fn many_positions_are_welded_as_few_are() {
        let coordinate = |ix: u32| match ix % 64 {
            0 => 0.0,
            1 => -0.0,
            2 => 3.0e8,
            3 => -2.25e-9,
            n => n as f32 / 3.0,
        };
        let mixed = |ix: u32, shift: u32| coordinate(ix.wrapping_mul(2_654_435_761) >> shift);
        for n in [0, 1, 16_384, 16_385, 100_000] {
            let positions: Vec<Vec3> = (0..n).map(|ix| Vec3::new(mixed(ix, 8), mixed(ix, 16), mixed(ix, 25))).collect();
            let of_place = |p: &Vec3| p.to_array().map(|x| if x == 0.0 { 0 } else { x.to_bits() });
            let mut first_at = HashMap::new();
            let first = |(ix, p): (u32, &Vec3)| *first_at.entry(of_place(p)).or_insert(ix);
            let expected: Vec<u32> = (0..n).zip(&positions).map(first).collect();
            assert!(n < 100_000 || first_at.len() < 90_000, "{} places", first_at.len());
            assert_eq!(weld(&positions), expected, "{n}");
        }
    }

    #[test]
    fn normals_are_those_of_the_definition_bit_for_bit() {
        // A rough height field, whose points some faces have by another index, with faces without area.
        let n = 12;
        let height = |ix: u32| (ix.wrapping_mul(2_654_435_761) >> 16) as f32 / 65_536.0;
        for roughness in [0.0, 0.1, 0.6, 3.0] {
            let mut positions: Vec<Vec3> =
                (0..n * n).map(|ix| Vec3::new((ix % n) as f32, roughness * height(ix), (ix / n) as f32)).collect();
            positions.extend_from_within(..);
            let corner = |x: u32, y: u32| y * n + x + if (x + y).is_multiple_of(3) { n * n } else { 0 };
            let mut faces = Vec::new();
            for (x, y) in (0..n - 1).flat_map(|y| (0..n - 1).map(move |x| (x, y))) {
                faces.push([corner(x, y), corner(x, y + 1), corner(x + 1, y)]);
                faces.push([y * n + x + 1, corner(x, y + 1), corner(x + 1, y + 1)]);
            }
            faces.push([3, 3, 4]);
            let smooth: Vec<bool> = (0..faces.len()).map(|ix| ix % 17 != 5).collect();
            for crease in [0.0, 10.0, 40.0, 90.0, 180.0] {
                let computed = crease_normals(&positions, &faces, &smooth, crease);
                assert_eq!(computed, plain_normals(&positions, &faces, &smooth, crease), "{roughness}, {crease}");
            }
        }
    }
}

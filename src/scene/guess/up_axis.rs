//! The axis that points up in a bare mesh file, as far as its content tells.
//!
//! OBJ and PLY files state no axis. What decides is a comment of a program whose axis is known, or else the
//! coordinates of a map, or a ground: a large flat surface below everything else. In doubt it is +y.

use glam::DVec3;
use rayon::prelude::*;

use crate::scene::{
    formats::mesh_file::MeshFormat,
    model::{Mesh, Up, mesh::bounds_of},
};

/// Bytes at the beginning of a file in which comments are looked for.
pub(crate) const HEAD_BYTES: usize = 4096;

/// Words in comments, in small letters, with the axis that they stand for. The first one that is found counts.
const STATED: [(&str, Up); 8] = [
    ("z-up", Up::Z),
    ("z up", Up::Z),
    ("up axis: z", Up::Z),
    ("up_axis z", Up::Z),
    ("y-up", Up::Y),
    ("y up", Up::Y),
    ("up axis: y", Up::Y),
    ("up_axis y", Up::Y),
];
/// Programs that write OBJ files with the axis of their own world, or turn it to +y unless the user states another one.
const OBJ_WRITERS: [(&str, Up); 8] = [
    ("openscad", Up::Z),
    ("freecad", Up::Z),
    ("ifcopenshell", Up::Z),
    ("blender", Up::Y),
    ("3ds max", Up::Y),
    ("maya", Up::Y),
    // The first line of files from Maya, which names no program.
    ("centimeters as units for non-parametric", Up::Y),
    ("sketchup", Up::Y),
];
/// The same for PLY files. Blender does not turn these unless the user says so.
const PLY_WRITERS: [(&str, Up); 1] = [("blender", Up::Z)];

/// A ground covers at least this share of the rectangle around the scene, as seen along the axis.
const GROUND_SHARE: f32 = 0.6;
/// A side that is no ground covers less than this.
const OTHER_SHARE: f32 = 0.2;
/// What is on the ground has a smaller rectangle, by this factor of the areas.
const CARRIED_SHARE: f32 = 0.9;
/// Thickness of a side of the bounding box, as a share of the box's longest edge.
const THICKNESS: f32 = 0.005;

/// Share of the rectangle around a mesh that is flat at the lowest z, if the mesh may stand on it.
const FLAT_SHARE: f32 = 0.2;
/// Least factor between the flat areas at the lowest z and at the lowest y of such a mesh.
const FLATTER: f32 = 1.5;

/// Least distance to the east and to the north from the origin of a country's map, metres. Half a million is usual.
const LEAST_ON_A_MAP: f64 = 1e5;
/// Greatest height of a place on Earth, metres, with some to spare.
const GREATEST_HEIGHT: f64 = 1e4;

/// An axis, and why it points up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Guess {
    pub up: Up,
    /// Begins a note to the user; `None` for what would be taken without a look at the file.
    pub why: Option<String>,
}

/// Returns the axis that points up in a mesh file. `origin` is the point of the file that is the origin of the mesh.
pub(crate) fn guess(format: MeshFormat, head: &[u8], (mesh, origin): (&Mesh, DVec3)) -> Guess {
    let usual = |up| Guess { up, why: None };
    let noted = |why: String| Guess { up: Up::Z, why: Some(format!("+z points up, {why}; --up y turns the picture")) };
    match format {
        MeshFormat::Stl => return usual(Up::Z),
        MeshFormat::Gltf => return usual(Up::Y),
        MeshFormat::Obj | MeshFormat::Ply => {}
    }
    match of_comments(format, head) {
        Some((word, Up::Z)) => noted(format!("as a comment of the file says (`{word}`)")),
        Some((_, Up::Y)) => usual(Up::Y),
        None if is_on_a_map(mesh, origin) => {
            noted("since x and y are as large as coordinates on a map, and z is not".to_owned())
        }
        None if has_ground_along_z(mesh) => {
            noted("since a large flat surface at the lowest z is below everything else".to_owned())
        }
        None if may_lie_on_side(mesh) => {
            Guess { up: Up::Y, why: Some("+y points up; --up z turns the picture if it lies on its side".to_owned()) }
        }
        None => usual(Up::Y),
    }
}

/// Returns the word of a comment that says which axis points up.
fn of_comments(format: MeshFormat, head: &[u8]) -> Option<(&'static str, Up)> {
    let head = String::from_utf8_lossy(&head[..head.len().min(HEAD_BYTES)]).to_lowercase();
    let start = if format == MeshFormat::Ply { "comment " } else { "#" };
    let comments: Vec<&str> = head.lines().filter_map(|line| line.trim_start().strip_prefix(start)).collect();
    let writers = if format == MeshFormat::Ply { &PLY_WRITERS[..] } else { &OBJ_WRITERS[..] };
    let is_said = |word: &str| comments.iter().any(|comment| comment.contains(word));
    STATED.iter().chain(writers).find(|(word, _)| is_said(word)).copied()
}

/// Returns whether a mesh has the coordinates of a map: metres to the east, metres to the north, and a height.
fn is_on_a_map(mesh: &Mesh, origin: DVec3) -> bool {
    let (min, max) = bounds_of(mesh.positions.par_iter().copied());
    let middle = origin + (min.as_dvec3() + max.as_dvec3()) / 2.0;
    middle.x.abs() >= LEAST_ON_A_MAP && middle.y.abs() >= LEAST_ON_A_MAP && middle.z.abs() <= GREATEST_HEIGHT
}

/// Returns whether a ground at the lowest z carries everything else, and nothing suggests another axis.
fn has_ground_along_z(mesh: &Mesh) -> bool {
    let corners = |face: &[u32; 3]| face.map(|ix| mesh.positions[ix as usize]);
    let (min, max) = bounds_of(mesh.faces.par_iter().flat_map_iter(corners));
    let size = max - min;
    let is_flat = size.z > 0.0 && size.z <= size.x && size.z <= size.y;
    if !is_flat {
        return false;
    }
    let near = THICKNESS * size.max_element();
    let is_lowest = |face: &[u32; 3]| corners(face).iter().all(|p| p.z - min.z <= near);
    // The area of the triangles at a side of the box, as a share of the side.
    let share = |axis: usize, is_at: &dyn Fn(f32) -> bool| {
        let at_side = mesh.faces.iter().map(corners).filter(|corners| corners.iter().all(|p| is_at(p[axis])));
        let area: f32 = at_side.map(|[a, b, c]| (b - a).cross(c - a)[axis].abs() / 2.0).sum();
        area / (size[(axis + 1) % 3] * size[(axis + 2) % 3])
    };
    let at_min = |axis: usize| share(axis, &|x| x - min[axis] <= near);
    let at_max = |axis: usize| share(axis, &|x| max[axis] - x <= near);
    let is_only_ground = at_min(2) >= GROUND_SHARE
        && [at_max(2), at_min(0), at_max(0), at_min(1), at_max(1)].iter().all(|share| *share < OTHER_SHARE);
    if !is_only_ground {
        return false;
    }
    let carried = bounds_of(mesh.faces.par_iter().filter(|face| !is_lowest(face)).flat_map_iter(corners));
    let carried = carried.1 - carried.0;
    carried.x * carried.y <= CARRIED_SHARE * size.x * size.y
}

/// Returns whether a mesh looks as if it could stand on its lowest z: it is flat there, more than at its lowest y. A
/// bookcase whose back is at the lowest z is like this, too, so it is no reason to turn the picture.
fn may_lie_on_side(mesh: &Mesh) -> bool {
    let corners = |face: &[u32; 3]| face.map(|ix| mesh.positions[ix as usize]);
    let (min, max) = bounds_of(mesh.faces.par_iter().flat_map_iter(corners));
    let near = THICKNESS * (max - min).max_element();
    // The area that faces down an axis at its least coordinate.
    let area = |axis: usize| -> f32 {
        let at_side = mesh.faces.iter().map(corners).filter(|face| face.iter().all(|p| p[axis] - min[axis] <= near));
        at_side.map(|[a, b, c]| (-(b - a).cross(c - a)[axis]).max(0.0) / 2.0).sum()
    };
    let size = max - min;
    size.z > near && area(2) >= FLAT_SHARE * size.x * size.y && area(2) >= FLATTER * area(1)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// A square of edge 2 in the plane w = 0, and on it a pyramid; (u, v, w) are the places of x, y, z.
    fn on_ground(half: f32, [u, v, w]: [usize; 3]) -> Mesh {
        let mut mesh = Mesh::default();
        for [x, y, z] in [
            [-1.0, -1.0, 0.0],
            [1.0, -1.0, 0.0],
            [1.0, 1.0, 0.0],
            [-1.0, 1.0, 0.0],
            [-half, -half, 0.1],
            [half, -half, 0.1],
            [half, half, 0.1],
            [0.0, 0.0, 0.8],
        ] {
            let mut p = Vec3::ZERO;
            (p[u], p[v], p[w]) = (x, y, z);
            mesh.positions.push(p);
        }
        mesh.faces = vec![[0, 1, 2], [0, 2, 3], [4, 5, 7], [5, 6, 7], [6, 4, 7]];
        mesh
    }

    #[test]
    fn a_ground_tells_the_axis() {
        assert!(has_ground_along_z(&on_ground(0.5, [0, 1, 2])));
        // What is as wide as the surface below it is not on a ground.
        assert!(!has_ground_along_z(&on_ground(1.0, [0, 1, 2])));
        for axes in [[0, 2, 1], [1, 2, 0]] {
            assert!(!has_ground_along_z(&on_ground(0.5, axes)), "{axes:?}");
        }
        // A ceiling.
        let mut turned = on_ground(0.5, [0, 1, 2]);
        turned.positions.iter_mut().for_each(|p| p.z = -p.z);
        assert!(!has_ground_along_z(&turned));
        // A wall beside the ground may be the ground itself.
        let mut corner = on_ground(0.5, [0, 1, 2]);
        corner.positions.extend([Vec3::new(-1.0, -1.0, 1.0), Vec3::new(1.0, -1.0, 1.0)]);
        corner.faces.extend([[0, 1, 9], [0, 9, 8]]);
        assert!(!has_ground_along_z(&corner));
        assert!(!has_ground_along_z(&Mesh::default()));
    }

    #[test]
    fn a_flat_back_is_worth_a_note() {
        // A wedge that is flat at the lowest z, and at the lowest y an edge.
        let mesh = |turn: fn(Vec3) -> Vec3| {
            let points = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0], [-1.0, 2.0, 0.0], [0.0, 1.0, 1.0]];
            let faces = vec![[0, 3, 2], [0, 2, 1], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
            Mesh { positions: points.map(Vec3::from_array).map(turn).to_vec(), faces, ..Mesh::default() }
        };
        assert!(may_lie_on_side(&mesh(|p| p)));
        assert!(!may_lie_on_side(&mesh(|p| Vec3::new(p.x, p.z, -p.y))));
        assert!(!may_lie_on_side(&mesh(|p| -p)) && !may_lie_on_side(&Mesh::default()));
        let note = guess(MeshFormat::Obj, b"", (&mesh(|p| p), DVec3::ZERO)).why.unwrap();
        assert!(note.contains("--up z"), "{note}");
        assert_eq!(guess(MeshFormat::Obj, b"# Blender", (&mesh(|p| p), DVec3::ZERO)), Guess { up: Up::Y, why: None });
    }

    #[test]
    fn coordinates_of_a_map_tell_the_axis() {
        let mesh = on_ground(1.0, [0, 1, 2]);
        let at = |x, y, z| guess(MeshFormat::Obj, b"", (&mesh, DVec3::new(x, y, z))).up;
        assert_eq!(at(512_345.0, 5_412_345.0, 431.0), Up::Z);
        // A height points up along +y.
        assert_eq!(at(512_345.0, 431.0, -5_412_345.0), Up::Y);
        assert_eq!([at(0.0, 0.0, 0.0), at(5e5, 5e5, 5e5)], [Up::Y; 2]);
    }

    #[test]
    fn comments_tell_the_axis() {
        let of = |format, text: &str| of_comments(format, text.as_bytes()).map(|(_, up)| up);
        for (format, text, up) in [
            (MeshFormat::Obj, "# Blender 3.6\nv 0 0 0\n", Some(Up::Y)),
            (MeshFormat::Obj, "\n#OpenSCAD obj exporter\n", Some(Up::Z)),
            (MeshFormat::Obj, "# Maya, Z-up\n", Some(Up::Z)),
            (MeshFormat::Obj, "o blender\nmtllib freecad.mtl\n# a model\n", None),
            (MeshFormat::Ply, "ply\nformat ascii 1.0\ncomment Created by Blender 2.79\n", Some(Up::Z)),
            (MeshFormat::Ply, "ply\ncomment VCGLIB generated\n", None),
            (MeshFormat::Obj, "", None),
        ] {
            assert_eq!(of(format, text), up, "{text}");
        }
        let late = format!("# {}\n# openscad\n", "x".repeat(HEAD_BYTES));
        assert_eq!(of(MeshFormat::Obj, &late), None);
    }
}

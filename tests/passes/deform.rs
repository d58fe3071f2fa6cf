//! Deformation of meshes by morph targets and joints: the device's vertices, triangles and tangents against the twin's,
//! the twin against the definition in double precision, and rows against those of worlds.

use std::sync::Arc;

use glam::{DMat3, DMat4, DQuat, DVec3, Vec3, Vec4};
use kdray::{
    buffers::DeformTarget,
    gpu::{Access, Buffer, BufferUse, Context},
    layout::{CornerSurface, DeformedVertex, FLAT_NORMAL, Triangle, normal::decode_exactly},
    passes::deform::Deform,
    reference::deform::{deform_triangles, deform_vertices},
    scene::{
        LoadOptions, Mesh, Scene,
        deformation::{Deformation, Influence, JointMatrix, MorphDelta, Pose},
    },
    world::FlatScene,
};

use crate::support::{assert_silent, device, random::Random};

/// The group size of the kernels.
const GROUP: usize = 128;
/// The largest distance between a direction and that of its code. Each coordinate is off by at most half a step of
/// 1 / 32767, and the first one of a tangent by one step more, whose lowest bit is the side. A step moves the direction
/// by at most sqrt(6) steps.
const CODE_ERROR: f64 = 2.0 * 2.4495 / 32767.0;
/// Rows and words before and behind those of the mesh, which must stay as they are.
const BEFORE: usize = 3;
const BEHIND: usize = 2;

/// A triangle, and the codes of the tangents at its corners.
type Row = (Triangle, [u32; 3]);

/// What a random mesh has.
#[derive(Clone, Copy)]
struct Kind {
    n_joints: usize,
    n_targets: usize,
    n_influences: usize,
    has_tangents: bool,
    /// Whether some weights of joints are negative.
    is_negative: bool,
}

const SKINNED: Kind = Kind { n_joints: 7, n_targets: 0, n_influences: 4, has_tangents: false, is_negative: false };
const MORPHED: Kind = Kind { n_joints: 0, n_targets: 5, n_influences: 0, has_tangents: true, is_negative: false };
const BOTH: Kind = Kind { n_joints: 3, n_targets: 4, n_influences: 8, has_tangents: true, is_negative: true };

/// Returns weights whose sum is 1.
fn influences(random: &mut Random, kind: Kind) -> Vec<Influence> {
    let low = if kind.is_negative && random.below(3) == 0 { -0.2 } else { 0.0 };
    let weights: Vec<f64> = (0..kind.n_influences).map(|_| f64::from(random.between(low, 1.0))).collect();
    let sum: f64 = weights.iter().sum();
    let influence = |weight: &f64| {
        let joint = random.below(kind.n_joints) as u32;
        if sum > 0.1 { Influence { joint, weight: (weight / sum) as f32 } } else { Influence { joint, weight: 0.0 } }
    };
    let mut found: Vec<Influence> = weights.iter().map(influence).collect();
    if sum <= 0.1 {
        found[0].weight = 1.0;
    }
    found
}

fn deformation(random: &mut Random, n: usize, kind: Kind) -> Deformation {
    let mut made = Deformation { n_influences: kind.n_influences, ..Deformation::default() };
    for ix in 0..n {
        made.positions.push(random.in_box(Vec3::new(-1.0, 0.0, 2.0), Vec3::new(1.0, 3.0, 2.5)));
        // Some vertices have no normal.
        let normal = if ix % 17 == 5 { Vec3::ZERO } else { random.direction() };
        made.normals.push(normal);
        if kind.has_tangents {
            let side = if random.below(2) == 0 { 1.0 } else { -1.0 };
            made.tangents.push(if ix % 13 == 4 { Vec4::ZERO } else { random.direction().extend(side) });
        }
        if kind.n_targets > 0 {
            made.first_deltas.push(made.deltas.len() as u32);
        }
        for target in (0..kind.n_targets as u32).filter(|target| !(ix + *target as usize).is_multiple_of(3)) {
            let [position, normal, tangent] = [0.3, 0.5, 0.5].map(|length| length * random.direction());
            made.deltas.push(MorphDelta { target, position, normal, tangent });
        }
        if kind.n_influences > 0 {
            made.influences.extend(influences(random, kind));
        }
    }
    if kind.n_targets > 0 {
        made.first_deltas.push(made.deltas.len() as u32);
    }
    made
}

/// Returns joints that turn, scale, mirror and shear, and weights of which one is 0.
fn pose(random: &mut Random, kind: Kind) -> Pose {
    let joint = |ix: usize| {
        let mirrored = if ix % 3 == 2 { -1.0 } else { 1.0 };
        let scale = DVec3::new(mirrored * 0.7, 1.0, f64::from(random.between(0.5, 2.0)));
        let rotation = DQuat::from_axis_angle(random.direction().as_dvec3().normalize(), random.unit().into());
        let translation = random.in_box(Vec3::NEG_ONE, Vec3::ONE).as_dvec3() + DVec3::new(1000.0, 0.0, 0.0);
        let mut matrix = DMat4::from_scale_rotation_translation(scale, rotation, translation);
        matrix.x_axis.y += 0.2;
        JointMatrix::new(matrix, DVec3::new(1000.0, 0.0, 0.0))
    };
    let joints = (0..kind.n_joints).map(joint).collect();
    let weights = (0..kind.n_targets).map(|ix| if ix == 1 { 0.0 } else { random.between(-0.5, 1.2) }).collect();
    Pose { weights, joints }
}

/// Returns some faces of n vertices.
fn faces(random: &mut Random, n: usize, n_faces: usize) -> Vec<[u32; 3]> {
    (0..if n == 0 { 0 } else { n_faces }).map(|_| [0; 3].map(|_: u32| random.below(n) as u32)).collect()
}

/// What the device makes of a pose.
struct Found {
    vertices: Vec<DeformedVertex>,
    triangles: Vec<Triangle>,
    corners: Vec<[CornerSurface; 3]>,
}

fn run(context: &Arc<Context>, deformation: &Deformation, faces: &[[u32; 3]], poses: &[Pose]) -> Found {
    let n_rows = BEFORE + faces.len() + BEHIND;
    let old = Triangle { n0: 7, n1: 8, n2: 9, ..Triangle::default() };
    let triangles = Buffer::with(context, "triangles", &vec![old; n_rows], BufferUse::Texels).unwrap();
    // Two words come before the corners.
    let words = Buffer::<u32>::with(context, "words", &vec![77; 2 + 6 * n_rows], BufferUse::Texels).unwrap();
    let target = DeformTarget { triangles: triangles.any(), first_row: BEFORE as u32, corners: Some((words.any(), 2)) };
    let deform = Deform::new(context).unwrap();
    let mesh = deform.mesh((deformation, faces), target).unwrap();
    context
        .run("deform", |commands| {
            for pose in poses {
                deform.record(commands, &mesh, pose);
                commands.barrier(Access::ComputeWrite, Access::AnyUse);
            }
        })
        .unwrap();
    let (triangles, words) = (triangles.download().unwrap(), words.download().unwrap());
    let corners: &[[CornerSurface; 3]] = bytemuck::cast_slice(&words[2..]);
    let is_old = |row: &usize| *row < BEFORE || *row >= BEFORE + faces.len();
    for row in (0..n_rows).filter(is_old) {
        assert_eq!(triangles[row], old, "row {row}");
        assert_eq!(corners[row], [CornerSurface { tangent: 77, colour: 77 }; 3], "row {row}");
    }
    assert_eq!(words[..2], [77; 2]);
    let rows = BEFORE..BEFORE + faces.len();
    Found {
        vertices: mesh.buffers.deformed.download().unwrap(),
        triangles: triangles[rows.clone()].to_vec(),
        corners: corners[rows].to_vec(),
    }
}

/// Returns what of the triangles and corners is not the twin's.
fn difference(found: &Found, twin: &[Row], has_tangents: bool) -> Option<String> {
    if found.triangles.len() != twin.len() {
        return Some("the number of triangles".to_owned());
    }
    for (ix, (triangle, tangents)) in twin.iter().enumerate() {
        let Triangle { v0, n0, v1, n1, v2, n2 } = found.triangles[ix];
        let is_same = |a: Vec3, b: Vec3| a.to_array().map(f32::to_bits) == b.to_array().map(f32::to_bits);
        if !(is_same(v0, triangle.v0) && is_same(v1, triangle.v1) && is_same(v2, triangle.v2)) {
            return Some(format!("positions of triangle {ix}: {v0} {v1} {v2}, not {triangle:?}"));
        }
        if [n0, n1, n2] != [triangle.n0, triangle.n1, triangle.n2] {
            return Some(format!("normals of triangle {ix}"));
        }
        let expected = |corner: usize| if has_tangents { tangents[corner] } else { 77 };
        let is_right = |corner: usize| {
            let CornerSurface { tangent, colour } = found.corners[ix][corner];
            tangent == expected(corner) && colour == 77
        };
        if !(0..3).all(is_right) {
            return Some(format!("tangents of triangle {ix}"));
        }
    }
    None
}

#[test]
fn meshes_are_those_of_the_twin() {
    let context = device();
    let mut random = Random(1);
    for (kind, name) in [(SKINNED, "skinned"), (MORPHED, "morphed"), (BOTH, "both")] {
        for n in [0, 1, GROUP - 1, GROUP, GROUP + 1, 1000] {
            let deformation = deformation(&mut random, n, kind);
            let faces = faces(&mut random, n, n + 1);
            let poses = [pose(&mut random, kind), pose(&mut random, kind)];
            let found = run(&context, &deformation, &faces, &poses);
            let vertices = deform_vertices(&deformation, &poses[1]);
            let twin = deform_triangles(&faces, &vertices);
            assert_eq!(difference(&found, &twin, kind.has_tangents), None, "{name}, {n} vertices");
            assert_eq!(found.vertices.len(), n);
        }
    }
    assert_silent(&context);
}

/// A row of workgroups has 1024 of them.
#[test]
fn large_meshes_have_several_rows_of_workgroups() {
    let context = device();
    let mut random = Random(2);
    let kind = Kind { n_influences: 1, ..SKINNED };
    let n = 1024 * GROUP + 3;
    let deformation = deformation(&mut random, n, kind);
    let faces: Vec<[u32; 3]> = (0..n as u32).map(|ix| [ix, 0, n as u32 - 1]).collect();
    let pose = pose(&mut random, kind);
    let found = run(&context, &deformation, &faces, std::slice::from_ref(&pose));
    let twin = deform_triangles(&faces, &deform_vertices(&deformation, &pose));
    assert_eq!(difference(&found, &twin, false), None);
    assert_silent(&context);
}

#[test]
fn wrong_triangles_are_noticed() {
    let context = device();
    let mut random = Random(3);
    let deformation = deformation(&mut random, 200, BOTH);
    let (faces, pose) = (faces(&mut random, 200, 300), pose(&mut random, BOTH));
    let found = run(&context, &deformation, &faces, std::slice::from_ref(&pose));
    let right = deform_triangles(&faces, &deform_vertices(&deformation, &pose));
    assert_eq!(difference(&found, &right, true), None);
    let plants: [fn(&mut Row); 4] = [
        |it| it.0.v1.y = it.0.v1.y.next_up(),
        |it| it.0.n2 ^= 1,
        |it| it.1[0] ^= 1,
        |it| std::mem::swap(&mut it.0.v0, &mut it.0.v2),
    ];
    for (ix, plant) in plants.into_iter().enumerate() {
        let mut planted = right.clone();
        let is_whole = |(triangle, tangents): &Row| {
            triangle.v0 != triangle.v2 && triangle.n2 != FLAT_NORMAL && tangents[0] != FLAT_NORMAL
        };
        plant(planted.iter_mut().filter(|it| is_whole(it)).last().unwrap());
        assert!(difference(&found, &planted, true).is_some(), "plant {ix}");
    }
    let changes: [fn(&mut Deformation, &mut Pose); 4] = [
        |_, pose| pose.weights[2] += 1e-3,
        |_, pose| pose.joints[1].translation.x += 1e-4,
        |it, _| it.deltas[40].target = 2,
        |it, _| it.influences.swap(0, 801),
    ];
    for (ix, change) in changes.into_iter().enumerate() {
        let (mut changed, mut pose) = (deformation.clone(), pose.clone());
        change(&mut changed, &mut pose);
        let twin = deform_triangles(&faces, &deform_vertices(&changed, &pose));
        assert!(difference(&found, &twin, true).is_some(), "change {ix}");
    }
    assert_silent(&context);
}

/// Returns position, normal and tangent of a vertex by the definition, in double precision.
fn by_definition(deformation: &Deformation, ix: usize, pose: &Pose) -> [DVec3; 3] {
    let [mut p, mut n] = [deformation.positions[ix], deformation.normals[ix]].map(Vec3::as_dvec3);
    let mut t = deformation.tangents.get(ix).copied().unwrap_or_default().truncate().as_dvec3();
    for delta in deformation.deltas_of(ix) {
        let weight = f64::from(pose.weights[delta.target as usize]);
        p += weight * delta.position.as_dvec3();
        n += weight * delta.normal.as_dvec3();
        t += weight * delta.tangent.as_dvec3();
    }
    if deformation.n_influences == 0 {
        return [p, n.normalize_or_zero(), t.normalize_or_zero()];
    }
    let mut matrix = DMat4::ZERO;
    for it in deformation.influences_of(ix) {
        let JointMatrix { axes: [x, y, z], translation } = &pose.joints[it.joint as usize];
        let [x, y, z, w] = [x.extend(0.0), y.extend(0.0), z.extend(0.0), translation.extend(1.0)].map(Vec4::as_dvec4);
        matrix += f64::from(it.weight) * DMat4::from_cols(x, y, z, w);
    }
    let linear = DMat3::from_mat4(matrix);
    let normal = linear.inverse().transpose() * n;
    [linear * p + matrix.w_axis.truncate(), normal.normalize_or_zero(), (linear * t).normalize_or_zero()]
}

#[test]
fn the_twin_follows_the_definition() {
    let mut random = Random(4);
    for kind in [SKINNED, MORPHED, BOTH] {
        let deformation = deformation(&mut random, 2000, kind);
        let pose = pose(&mut random, kind);
        let mut n_far = 0;
        for ix in 0..2000 {
            let found = deformation.vertex(ix, &pose);
            let [p, n, t] = by_definition(&deformation, ix, &pose);
            // Some sixty roundings of numbers up to 8.
            assert!((found.position.as_dvec3() - p).length() < 60.0 * 8.0 * 6e-8, "{ix}: {} {p}", found.position);
            // Blended transforms may nearly flatten, which magnifies roundings in normals.
            let tangent = if found.tangent == FLAT_NORMAL { FLAT_NORMAL } else { found.tangent & !1 };
            let away = |code: u32, v: DVec3| (decode_exactly(code).as_dvec3() - v).length() > CODE_ERROR;
            n_far += usize::from(away(found.normal, n) || away(tangent, t));
            assert_eq!(found.tangent == FLAT_NORMAL, t == DVec3::ZERO);
            assert_eq!(deformation.position(ix, &pose), found.position);
        }
        assert!(n_far <= 4, "{n_far} directions");
        let mut wrong = deformation.clone();
        wrong.positions[7].x += 1e-3;
        let [p, ..] = by_definition(&deformation, 7, &pose);
        assert!((wrong.vertex(7, &pose).position.as_dvec3() - p).length() > 60.0 * 8.0 * 6e-8);
    }
}

/// The bitangent is the cross product of normal and tangent times w. A reflection reflects all three.
#[test]
fn reflections_keep_the_side_of_the_bitangent() {
    let one = |scale: DVec3| {
        let mesh = Deformation {
            positions: vec![Vec3::ONE],
            normals: vec![Vec3::Z],
            tangents: vec![Vec4::new(1.0, 0.0, 0.0, 1.0)],
            n_influences: 1,
            influences: vec![Influence { joint: 0, weight: 1.0 }],
            ..Deformation::default()
        };
        let joints = vec![JointMatrix::new(DMat4::from_scale(scale), DVec3::ZERO)];
        let vertex = mesh.vertex(0, &Pose { joints, ..Pose::default() });
        let side = if vertex.tangent & 1 == 1 { 1.0 } else { -1.0 };
        side * decode_exactly(vertex.normal).cross(decode_exactly(vertex.tangent & !1))
    };
    for scale in [DVec3::ONE, DVec3::new(-1.0, 1.0, 1.0), DVec3::new(1e-30, -1e-30, 1e-30), DVec3::splat(-1e25)] {
        let away = one(scale) - Vec3::Y * scale.y.signum() as f32;
        assert!(f64::from(away.length()) < CODE_ERROR, "{scale}");
    }
}

/// Of colours, a world has corners.
#[test]
fn rows_are_those_of_worlds() {
    let context = device();
    let mut random = Random(5);
    let deformation = deformation(&mut random, 300, BOTH);
    let (faces, pose) = (faces(&mut random, 300, 400), pose(&mut random, BOTH));
    let mut mesh = Mesh { slots: vec![0; faces.len()], faces, ..Mesh::default() };
    mesh.colours = vec![[Vec4::splat(0.5); 3]; mesh.faces.len()];
    deformation.deform(&pose, &mut mesh);
    let scene = Scene::of_mesh(mesh.clone(), &LoadOptions::default()).unwrap();
    let world = FlatScene::with_instances(&scene).unwrap();
    let range = world.instances.as_ref().unwrap().ranges[0];
    let rows = range.first_row as usize..(range.first_row + range.n_triangles) as usize;
    let of_world: Vec<_> = world.triangles[rows.clone()]
        .iter()
        .zip(&world.textures.corners[rows])
        .map(|(triangle, corners)| (*triangle, corners.map(|corner| corner.tangent)))
        .collect();
    let found = run(&context, &deformation, &mesh.faces, std::slice::from_ref(&pose));
    assert_eq!(difference(&found, &of_world, true), None);
    let twin = deform_triangles(&mesh.faces, &deform_vertices(&deformation, &pose));
    assert_eq!(twin, of_world);
    assert_silent(&context);
}

#[test]
fn appended_meshes_keep_their_vertices() {
    let mut random = Random(6);
    let (few, many) = (Kind { n_influences: 2, n_targets: 0, ..BOTH }, Kind { has_tangents: false, ..BOTH });
    let parts = [deformation(&mut random, 40, few), deformation(&mut random, 50, many), Deformation::default()];
    let pose = pose(&mut random, BOTH);
    let mut whole = Deformation::default();
    parts.iter().for_each(|part| whole.append(part.clone()));
    let vertices = |it: &Deformation| -> Vec<_> { (0..it.positions.len()).map(|ix| it.vertex(ix, &pose)).collect() };
    assert_eq!(vertices(&whole), parts.iter().flat_map(vertices).collect::<Vec<_>>());
    assert_eq!((whole.n_influences, whole.first_deltas.len()), (8, 91));
}

#[test]
#[should_panic(expected = "the influences of all vertices")]
fn vertices_without_influences_are_refused() {
    let mut deformation = deformation(&mut Random(5), 4, SKINNED);
    deformation.influences.pop();
    run(&device(), &deformation, &[[0, 1, 2]], &[]);
}

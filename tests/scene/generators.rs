//! Tests of generated meshes: closed bodies are closed and face outwards, and normals are those of the exact surface.

use std::collections::HashMap;

use glam::{Vec2, Vec3};
use kdray::scene::{
    generate::{Generator, TriangleBudget},
    mesh::Mesh,
};

/// Closed bodies and their numbers of triangles.
const CLOSED: [(&str, usize); 15] = [
    ("generator = 'box'\nsize = [1, 2, 3]", 12),
    ("generator = 'sphere'\nradius = 2\nsegments = 3\nrings = 1", 6),
    ("generator = 'sphere'\nradius = 2\nsegments = 33\nrings = 16", 1056),
    ("generator = 'sphere'\nradius = 2\ntriangles = 6", 6),
    ("generator = 'sphere'\nradius = 2\ntriangles = 8", 8),
    ("generator = 'sphere'\nradius = 2\ntriangles = 9998", 9998),
    ("generator = 'geodesic'\nradius = 2\nfrequency = 1", 20),
    ("generator = 'geodesic'\nradius = 2\nfrequency = 7", 980),
    ("generator = 'superellipsoid'\nsize = [1, 2, 3]\nexponents = [0.3, 0.3]\ntriangles = 5002", 5002),
    ("generator = 'superellipsoid'\nsize = [1, 2, 3]\nexponents = [1.6, 0.5]\nsegments = 40\nrings = 21", 1680),
    ("generator = 'torus_knot'\np = 1\nq = 1\nradius = 1\nswing = 0.001\ntube = 0.2\nsegments = 3\nsides = 3", 18),
    ("generator = 'torus_knot'\np = 2\nq = 3\nradius = 1\nswing = 0.4\ntube = 0.2\nsegments = 150\nsides = 12", 3600),
    (
        "generator = 'torus_knot'\np = 2\nq = 5\nradius = 1\nswing = 0.5\ntube = 0.1\nsegments = 301\n\
         triangles = 7654\nripples = [9, 2]\nripple_depth = 0.1",
        7654,
    ),
    // A goblet: the profile runs up its inside, over the rim and down to a sharp edge at the foot.
    (
        "generator = 'lathe'\nsegments = 24\nsteps = 5\n\
         profile = [[0, 0.2], [0.4, 0.5], [0.5, 1], [0.6, 1], [0.5, 0.4],\n\
         [0.3, 0], [0.3, 0], [0, 0]]",
        24 * (2 * 25),
    ),
    // A cylinder.
    (
        "generator = 'lathe'\nsegments = 24\nprofile = [[0, 1], [1, 1], [1, 1], [1, 0], [1, 0], [0, 0]]",
        24 * (1 + 2 + 1),
    ),
];

fn build(toml: &str) -> Mesh {
    toml::from_str::<Generator>(toml)
        .unwrap_or_else(|e| panic!("{e}\n{toml}"))
        .build(&TriangleBudget::default())
        .unwrap_or_else(|e| panic!("{e}\n{toml}"))
}

fn corners(mesh: &Mesh, face: [u32; 3]) -> [Vec3; 3] {
    face.map(|ix| mesh.positions[ix as usize])
}

/// Returns the number of directed edges without exactly one partner in the opposite direction. Ends of edges are
/// compared bit for bit.
fn n_open_edges(mesh: &Mesh) -> usize {
    let mut edges: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
    let bits = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
    for face in &mesh.faces {
        let corners = corners(mesh, *face).map(bits);
        for ix in 0..3 {
            *edges.entry([corners[ix], corners[(ix + 1) % 3]]).or_default() += 1;
        }
    }
    let paired = |[a, b]: [[u32; 3]; 2]| edges[&[a, b]] == 1 && edges.get(&[b, a]) == Some(&1);
    edges.keys().filter(|edge| !paired(**edge)).count()
}

/// Returns the volume of a closed mesh. It is positive if the faces are counter-clockwise seen from outside.
fn volume(mesh: &Mesh) -> f32 {
    mesh.faces.iter().map(|face| corners(mesh, *face)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

fn facet_normal(mesh: &Mesh, face: [u32; 3]) -> Vec3 {
    let [a, b, c] = corners(mesh, face);
    (b - a).cross(c - a)
}

#[test]
fn closed_bodies_are_closed_and_exact() {
    for (toml, n_triangles) in CLOSED {
        let mesh = build(toml);
        assert_eq!(mesh.faces.len(), n_triangles, "{toml}");
        assert_eq!((mesh.normals.len(), mesh.slots.len()), (n_triangles, n_triangles), "{toml}");
        assert_eq!(n_open_edges(&mesh), 0, "{toml}");
        assert!(volume(&mesh) > 0.0, "{toml}: inside out");
        assert!(mesh.faces.iter().all(|face| facet_normal(&mesh, *face).length() > 0.0), "{toml}: no area");
    }
}

#[test]
fn the_closedness_check_can_fail() {
    let sphere = build(CLOSED[2].0);
    let mut hole = sphere.clone();
    hole.faces.pop();
    assert_eq!(n_open_edges(&hole), 3);
    let mut turned = sphere.clone();
    turned.faces[100].swap(0, 1);
    assert_ne!(n_open_edges(&turned), 0);
    let mut cracked = sphere.clone();
    let corner = cracked.push_position(sphere.positions[7].map(f32::next_up));
    cracked.faces.iter_mut().flatten().find(|ix| **ix == 7).map(|ix| *ix = corner).unwrap();
    assert_ne!(n_open_edges(&cracked), 0);
}

#[test]
fn shading_normals_are_the_surfaces_own() {
    for (toml, n_triangles) in CLOSED {
        let mesh = build(toml);
        for (face, normals) in mesh.faces.iter().zip(&mesh.normals).filter(|(_, n)| **n != [Vec3::ZERO; 3]) {
            let facet = facet_normal(&mesh, *face).normalize();
            for normal in normals {
                assert!((normal.length() - 1.0).abs() < 1e-5, "{toml}");
                // In coarse bodies, the surface under one triangle may bend by up to a right angle.
                assert!(n_triangles < 100 || normal.dot(facet) > 0.2, "{toml}: {normal} at a face towards {facet}");
            }
        }
    }
}

#[test]
fn a_spheres_normals_are_radial() {
    // The lathe's profile is a spline through points of a circle, so it is only close to a circle.
    let circle: Vec<String> = (0..=24)
        .map(|ix| match (ix as f64 * std::f64::consts::PI / 24.0).sin_cos() {
            _ if ix == 0 => "[0.0, 2.0]".to_owned(),
            _ if ix == 24 => "[0.0, -2.0]".to_owned(),
            (sin, cos) => format!("[{:.9}, {:.9}]", 2.0 * sin, 2.0 * cos),
        })
        .collect();
    let lathe = format!("generator = 'lathe'\nsegments = 48\nsteps = 2\nprofile = [{}]", circle.join(", "));
    let ellipsoid = "generator = 'superellipsoid'\nsize = [4, 4, 4]\nexponents = [1, 1]\ntriangles = 2000";
    for (toml, tolerance) in
        [(CLOSED[2].0, 1e-6), (CLOSED[5].0, 1e-6), (CLOSED[7].0, 1e-6), (ellipsoid, 1e-6), (&lathe, 3e-3)]
    {
        let mesh = build(toml);
        for (face, normals) in mesh.faces.iter().zip(&mesh.normals) {
            for (corner, normal) in corners(&mesh, *face).into_iter().zip(normals) {
                assert!((corner - 2.0 * *normal).length() < 2.0 * tolerance, "{toml}: {normal} at {corner}");
            }
        }
    }
}

#[test]
fn a_knots_normals_point_from_the_middle_of_the_tube() {
    let mesh = build(CLOSED[11].0);
    // The mean of a ring's twelve points is the ring's middle.
    let middles: Vec<Vec3> = mesh.positions.chunks(12).map(|ring| ring.iter().sum::<Vec3>() / 12.0).collect();
    for (face, normals) in mesh.faces.iter().zip(&mesh.normals) {
        for (ix, normal) in face.iter().zip(normals) {
            let radial = (mesh.positions[*ix as usize] - middles[*ix as usize / 12]).normalize();
            assert!((radial - *normal).length() < 1e-4, "{normal} instead of {radial}");
        }
    }
}

#[test]
fn rooms_face_inwards_and_planes_up() {
    let room = build("generator = 'room'\nsize = [1, 2, 3]");
    assert_eq!((room.faces.len(), n_open_edges(&room)), (12, 0));
    assert!((volume(&room) + 6.0).abs() < 1e-5);
    assert_eq!(room.slots, [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]);
    // The left wall faces right.
    assert!(facet_normal(&room, room.faces[0]).x > 0.0);
    let flat = ["generator = 'plane'\nsize = [2, 3]\nfields = [3, 2]", "generator = 'disc'\nradius = 1\nsegments = 97"];
    for (toml, n_triangles) in flat.into_iter().zip([12, 97]) {
        let mesh = build(toml);
        assert_eq!(mesh.faces.len(), n_triangles);
        assert!(mesh.faces.iter().all(|face| facet_normal(&mesh, *face).normalize().y > 0.999), "{toml}");
    }
}

/// Returns all corners of a generated mesh with their texture coordinates.
fn corners_with_uvs(text: &str) -> Vec<(Vec3, Vec2)> {
    let generator: Generator = toml::from_str(text).unwrap();
    let mesh = generator.build(&TriangleBudget::default()).unwrap();
    assert_eq!(mesh.uvs[0].len(), mesh.faces.len(), "{text}");
    let corners = mesh.faces.as_flattened().iter().map(|ix| mesh.positions[*ix as usize]);
    corners.zip(mesh.uvs[0].as_flattened().iter().copied()).collect()
}

#[test]
fn texture_coordinates_are_the_documented_ones() {
    let heading = |u: f32| Vec3::new((u * std::f32::consts::TAU).sin(), 0.0, (u * std::f32::consts::TAU).cos());
    let sphere = |uv: Vec2| {
        let (sin, cos) = (uv.y * std::f32::consts::PI).sin_cos();
        2.0 * (sin * heading(uv.x) + cos * Vec3::Y)
    };
    let cylinder = |uv: Vec2| heading(uv.x) + (1.0 - 2.0 * uv.y) * Vec3::Y;
    let plane = |uv: Vec2| Vec3::new(3.0 * (uv.x - 0.5), 0.0, 5.0 * (uv.y - 0.5));
    let disc = |uv: Vec2| Vec3::new(4.0 * (uv.x - 0.5), 0.0, 4.0 * (uv.y - 0.5));
    let front = |uv: Vec2| Vec3::new(uv.x - 0.5, 1.0 - 2.0 * uv.y, 1.5);
    let inside_back = |uv: Vec2| Vec3::new(uv.x - 0.5, 1.0 - 2.0 * uv.y, -1.5);
    let cases: [(&str, &dyn Fn(Vec2) -> Vec3); 9] = [
        ("generator = 'sphere'\nradius = 2\nsegments = 33\nrings = 16", &sphere),
        ("generator = 'sphere'\nradius = 2\ntriangles = 998", &sphere),
        ("generator = 'geodesic'\nradius = 2\nfrequency = 1", &sphere),
        ("generator = 'geodesic'\nradius = 2\nfrequency = 7", &sphere),
        ("generator = 'lathe'\nsegments = 24\nprofile = [[1, 1], [1, -1]]", &cylinder),
        ("generator = 'plane'\nsize = [3, 5]\nfields = [2, 3]", &plane),
        ("generator = 'disc'\nradius = 2\nsegments = 7", &disc),
        ("generator = 'box'\nsize = [1, 2, 3]\nsides = ['front']", &front),
        // Seen from inside, the back wall of a room is before the eye, and +x on the right.
        ("generator = 'room'\nsize = [1, 2, 3]\nsides = ['back']", &inside_back),
    ];
    for (text, point) in cases {
        for (corner, uv) in corners_with_uvs(text) {
            assert!(point(uv).distance(corner) < 1e-5, "{text}: {uv} is {} and not {corner}", point(uv));
        }
    }
    // A sharp edge is at its share of the profile's spans: the second of three.
    let lathe = "generator = 'lathe'\nsegments = 9\nprofile = [[0, 1], [1, 1], [1, 1], [1, 0], [1, 0], [0, 0]]";
    for (corner, uv) in corners_with_uvs(lathe) {
        let v = if corner.y == 1.0 { [0.0, 1.0 / 3.0] } else { [2.0 / 3.0, 1.0] };
        let on_axis = corner.x == 0.0 && corner.z == 0.0;
        let expected = if on_axis == (corner.y == 1.0) { v[0] } else { v[1] };
        assert!((uv.y - expected).abs() < 1e-6, "{corner} {uv}");
    }
}

#[test]
fn images_are_not_mirrored_and_cover_closed_surfaces_once() {
    for (text, _) in CLOSED {
        let generator: Generator = toml::from_str(text).unwrap();
        let mesh = generator.build(&TriangleBudget::default()).unwrap();
        let mut covered = 0.0;
        for [a, b, c] in &mesh.uvs[0] {
            // Counter-clockwise with v upwards, as the triangle is from outside.
            let doubled = -(*b - *a).perp_dot(*c - *a);
            assert!(doubled > -1e-6, "{text}: {a} {b} {c}");
            covered += f64::from(doubled) / 2.0;
        }
        if text.contains("torus_knot") {
            assert!((covered - 1.0).abs() < 1e-4, "{text}: {covered}");
        }
    }
}

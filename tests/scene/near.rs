//! What a chosen camera frames: all of a scene, but for a few small things that are far away from the rest.

use glam::{Vec2, Vec3};
use kdray::scene::Scene;

use super::materials::load_scene;

/// An OBJ file that grows.
#[derive(Default)]
struct Obj {
    text: String,
    n_points: usize,
}

impl Obj {
    fn face(&mut self, points: &[Vec3]) {
        points.iter().for_each(|p| self.text += &format!("v {} {} {}\n", p.x, p.y, p.z));
        let corners = (1..=points.len()).map(|ix| (self.n_points + ix).to_string());
        self.text += &format!("f {}\n", corners.collect::<Vec<_>>().join(" "));
        self.n_points += points.len();
    }

    /// Adds a square that faces up.
    fn square(&mut self, centre: Vec3, half: f32) {
        let corner = |(x, z): (f32, f32)| centre + half * Vec3::new(x, 0.0, z);
        self.face(&[(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(corner));
    }

    /// Adds a body of `n` * `n` squares, spread over a cube.
    fn body(&mut self, centre: Vec3, half: f32, n: usize) {
        for ix in 0..n * n {
            let at = Vec3::new((ix % n) as f32, (ix / n) as f32 * 0.7, (ix * 7 % n) as f32) / n as f32;
            self.square(centre + half * (2.0 * at - 1.0), half / n as f32);
        }
    }
}

/// Returns the scene and the warnings.
fn load(obj: &Obj) -> (Scene, Vec<String>) {
    let (scene, warnings) = load_scene(&[("m.obj", obj.text.as_bytes())]);
    (scene.unwrap(), warnings)
}

/// Returns where a point is in the picture, -1 to 1 from edge to edge.
fn in_picture(scene: &Scene, point: Vec3) -> Vec2 {
    let [right, up, forward] = {
        let forward = (scene.camera.target - scene.camera.eye).normalize();
        let right = forward.cross(scene.camera.up).normalize();
        [right, right.cross(forward), forward]
    };
    let from_eye = point - scene.camera.eye;
    let half_height = scene.camera.height_at(from_eye.dot(forward)) / 2.0;
    Vec2::new(from_eye.dot(right) * 0.75, from_eye.dot(up)) / half_height
}

/// The model fills the picture as it does without the speck.
#[test]
fn specks_far_away_are_not_in_the_picture() {
    let mut alone = Obj::default();
    alone.body(Vec3::ZERO, 1.0, 10);
    let (alone, warnings) = load(&alone);
    assert_eq!(warnings, Vec::<String>::new());
    for (far, half) in [(Vec3::new(1e3, 0.0, 0.0), 0.01), (Vec3::new(0.0, 0.0, -1e5), 0.05), (Vec3::splat(70.0), 0.05)]
    {
        let mut obj = Obj::default();
        obj.body(Vec3::ZERO, 1.0, 10);
        obj.square(far, half);
        let (scene, warnings) = load(&obj);
        assert!(scene.camera.eye.distance(alone.camera.eye) < 1e-3, "{far}: {:?}", scene.camera);
        assert!(warnings.len() == 1 && warnings[0].contains("2 of 202 triangles are so far away"), "{warnings:?}");
    }
    // The box around both is a thousand times as long as that around the nearer one.
    let mut obj = Obj::default();
    obj.body(Vec3::ZERO, 1.0, 10);
    obj.square(Vec3::new(700.0, 0.0, 0.0), 0.01);
    obj.square(Vec3::new(-1e6, 0.0, 0.0), 0.01);
    let (scene, warnings) = load(&obj);
    assert!(scene.camera.eye.distance(alone.camera.eye) < 1e-3, "{:?}", scene.camera);
    assert!(warnings.len() == 1 && warnings[0].contains("4 of 204 triangles"), "{warnings:?}");
}

/// A triangle without area that reaches far is invisible, so nothing is left out that the user could miss.
#[test]
fn triangles_without_area_are_passed_over_in_silence() {
    let mut obj = Obj::default();
    obj.body(Vec3::ZERO, 1.0, 10);
    obj.face(&[Vec3::ZERO, Vec3::X, 2e3 * Vec3::X]);
    let (scene, warnings) = load(&obj);
    assert!(scene.camera.eye.length() < 10.0 && warnings.is_empty(), "{:?} {warnings:?}", scene.camera);
}

#[test]
fn scenes_of_large_and_small_things_are_framed_as_a_whole() {
    let up = |y: f32| Vec3::new(0.0, y, 0.0);
    let house_on_a_terrain = |obj: &mut Obj| {
        obj.square(Vec3::ZERO, 5000.0);
        obj.body(up(5.0), 5.0, 10);
    };
    let two_equal_things = |obj: &mut Obj| {
        obj.body(Vec3::ZERO, 1.0, 6);
        obj.body(Vec3::new(500.0, 0.0, 0.0), 1.0, 6);
    };
    let aeroplane_over_an_airfield = |obj: &mut Obj| {
        obj.square(Vec3::ZERO, 500.0);
        obj.body(up(3000.0), 8.0, 3);
    };
    let small_thing_of_many_triangles = |obj: &mut Obj| {
        obj.body(Vec3::ZERO, 1.0, 4);
        obj.body(Vec3::new(300.0, 0.0, 0.0), 0.02, 12);
    };
    let moon = |obj: &mut Obj| {
        obj.body(Vec3::ZERO, 1.0, 10);
        obj.body(Vec3::new(60.0, 0.0, 0.0), 0.27, 4);
    };
    for (name, build, points) in [
        ("terrain", &house_on_a_terrain as &dyn Fn(&mut Obj), [Vec3::new(5000.0, 0.0, 5000.0), up(5.0)]),
        ("two things", &two_equal_things, [Vec3::ZERO, Vec3::new(500.0, 0.0, 0.0)]),
        ("aeroplane", &aeroplane_over_an_airfield, [Vec3::ZERO, up(3000.0)]),
        ("small thing", &small_thing_of_many_triangles, [Vec3::ZERO, Vec3::new(300.0, 0.0, 0.0)]),
        ("moon", &moon, [Vec3::ZERO, Vec3::new(60.0, 0.0, 0.0)]),
    ] {
        let mut obj = Obj::default();
        build(&mut obj);
        let (scene, warnings) = load(&obj);
        assert_eq!(warnings, Vec::<String>::new(), "{name}");
        for point in points {
            let at = in_picture(&scene, point);
            assert!(at.abs().max_element() < 0.96, "{name}: {point} is at {at}");
        }
    }
}

/// A room is seen from inside, whatever is far away from it.
#[test]
fn rooms_with_specks_far_away_are_rooms() {
    let room = "[[mesh]]\ngenerator = 'room'\nsize = [6, 3, 9]\n";
    let speck = "v 900 0 0\nv 900.01 0 0\nv 900 0.01 0\nf 1 2 3\n";
    let toml = format!("{room}[[mesh]]\nfile = 'a.obj'\n");
    let (scene, warnings) = load_scene(&[("a.toml", toml.as_bytes()), ("a.obj", speck.as_bytes())]);
    let eye = scene.unwrap().camera.eye;
    assert!(eye.abs().cmple(Vec3::new(3.0, 1.5, 4.5)).all(), "{eye}");
    assert!(warnings.len() == 2 && warnings[0].contains("is shown as a room"), "{warnings:?}");
    assert!(warnings[1].contains("1 of 13 triangles"), "{warnings:?}");
}

//! Tests of the cameras and lights that scenes without their own get.

use std::fs;

use glam::{DVec3, Vec2, Vec3};
use kdray::{
    frame::Integrator,
    scene::{
        Camera, Ground, Light, LightChoice, LoadOptions, Look, Projection, Scene, Sky, SkyChoice, Up, scene_file_of,
    },
};

/// Writes files to one folder and loads the first one.
fn load(files: &[(&str, &str)], options: &LoadOptions) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        fs::write(folder.path().join(name), content).unwrap();
    }
    Scene::load_with(&folder.path().join(files[0].0), options).unwrap()
}

fn load_toml(text: &str) -> Scene {
    load(&[("a.toml", text)], &LoadOptions::default())
}

/// Returns the OBJ text of a box.
fn box_obj(min: Vec3, size: Vec3) -> String {
    let corner = |ix: usize| min + size * Vec3::new((ix & 1) as f32, (ix >> 1 & 1) as f32, (ix >> 2) as f32);
    let corners = (0..8).map(corner).map(|p| format!("v {} {} {}\n", p.x, p.y, p.z)).collect::<String>();
    corners + "f 1 5 7 3\nf 6 2 4 8\nf 1 2 6 5\nf 7 8 4 3\nf 2 1 3 4\nf 5 6 8 7\n"
}

/// Returns the coordinates in the picture, from -1 to 1, of the corners of a scene's bounding box.
fn corners_in_picture(scene: &Scene, aspect: f32) -> Vec<Vec2> {
    let (min, max) = scene.bounds();
    let Camera { eye, target, up, .. } = scene.camera;
    let forward = (target - eye).normalize();
    let right = forward.cross(up).normalize();
    let corner = |n: u32| {
        let side = |axis: usize| if n >> axis & 1 == 0 { min[axis] } else { max[axis] };
        let from_eye = Vec3::new(side(0), side(1), side(2)) - eye;
        let depth = from_eye.dot(forward);
        assert!(depth > 0.0, "a corner is behind the camera");
        let half_height = scene.camera.height_at(depth) / 2.0;
        Vec2::new(from_eye.dot(right) / (half_height * aspect), from_eye.dot(right.cross(forward)) / half_height)
    };
    (0..8).map(corner).collect()
}

/// Returns the area of the convex hull of points.
fn hull_area(points: &[Vec2]) -> f32 {
    // By the support function: the hull is cut by half planes in many directions.
    let n = 720;
    let direction = |ix: usize| Vec2::from_angle(ix as f32 / n as f32 * std::f32::consts::TAU);
    let farthest = |d: Vec2| *points.iter().max_by(|a, b| a.dot(d).total_cmp(&b.dot(d))).unwrap();
    let edge = |ix: usize| farthest(direction(ix)).perp_dot(farthest(direction(ix + 1)));
    (0..n).map(edge).sum::<f32>() / 2.0
}

#[test]
fn boxes_of_all_shapes_fill_pictures_of_all_shapes() {
    let sizes = [
        [1.0, 1.0, 1.0],
        [1.0, 2.0, 1.0],
        [478.0, 2.0, 2.0],
        [2.0, 2.0, 478.0],
        [100.0, 0.0, 100.0],
        [100.0, 2.0, 60.0],
        [0.01, 3.0, 4.0],
        [3.0, 4.0, 0.01],
    ];
    for size in sizes.map(Vec3::from_array) {
        for aspect in [4.0 / 3.0, 0.4, 3.0] {
            for (scale, offset) in [(1.0, Vec3::ZERO), (1e-4, Vec3::ZERO), (1e4, Vec3::new(2e4, 0.0, -1e4))] {
                let obj = box_obj(offset, size * scale);
                let options = LoadOptions { aspect: Some(aspect), ..LoadOptions::default() };
                let scene = load(&[("a.obj", &obj)], &options);
                let corners = corners_in_picture(&scene, aspect);
                let most = corners.iter().map(|p| p.abs()).reduce(Vec2::max).unwrap();
                let what = format!("{size} x {scale}, aspect {aspect}: {:?}", scene.camera);
                assert!(most.max_element() <= 0.955, "{what}: a corner is at {most}");
                assert!(most.max_element() >= 0.94, "{what}: the corners reach only {most}");
                let share = hull_area(&corners) / 4.0;
                assert!(share > 0.1, "{what}: the box covers {share} of the picture");
            }
        }
    }
}

/// An octahedron has no corner of its bounding box. Its own corners fill the picture, and are in its middle.
#[test]
fn the_scene_fills_the_picture_not_its_bounding_box() {
    let corners = "v 2 0 0\nv -2 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 3\nv 0 0 -3\nv 90 90 90\n";
    let faces = "f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";
    let obj = format!("{corners}{faces}");
    let toml = "[[mesh]]\nfile = 'a.obj'\n\
                transform = { scale = [1, 2, 1], rotate = [10, 20, 30], translate = [5, -9, 2] }\n";
    let turned = [("a.toml", toml), ("a.obj", &obj)];
    for files in [&[("a.obj", obj.as_str())][..], &turned] {
        for aspect in [4.0 / 3.0, 0.4] {
            let scene = load(files, &LoadOptions { aspect: Some(aspect), ..LoadOptions::default() });
            let Camera { eye, target, up, .. } = scene.camera;
            let forward = (target - eye).normalize();
            let right = forward.cross(up).normalize();
            let transform = &scene.instances[0].transform;
            let points = scene.meshes[0].positions[..6].iter().map(|p| transform.point(*p) - eye);
            let seen: Vec<Vec2> = points
                .map(|p| {
                    Vec2::new(p.dot(right) / aspect, p.dot(right.cross(forward)))
                        / scene.camera.height_at(p.dot(forward))
                        * 2.0
                })
                .collect();
            let (least, most) =
                seen.iter().fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(a, b), p| (a.min(*p), b.max(*p)));
            // The narrower of both extents is not quite in the middle, since the eye is farther away than it asks for.
            let full = if most.x > most.y.max(-least.y) { 0 } else { 1 };
            assert!((least[full] + most[full]).abs() < 1e-3 && (most[full] - 0.95).abs() < 1e-3, "{least} {most}");
            assert!(least.min_element() > -0.951 && most.max_element() < 0.951, "{least} {most}");
        }
    }
}

#[test]
fn a_small_scene_far_from_the_origin_fills_the_picture() {
    let obj = box_obj(Vec3::new(5e5, 0.0, 2e5), Vec3::splat(10.0));
    let scene = load(&[("a.obj", &obj)], &LoadOptions::default());
    let most = corners_in_picture(&scene, 4.0 / 3.0).into_iter().map(|p| p.abs()).reduce(Vec2::max).unwrap();
    assert!((0.9..1.0).contains(&most.max_element()), "{most}: {:?}", scene.camera);
}

#[test]
fn a_picture_is_framed_for_the_scenes_size_if_no_other_is_stated() {
    let mesh = box_obj(Vec3::ZERO, Vec3::new(5.0, 1.0, 1.0));
    let toml = "[render]\nwidth = 300\nheight = 900\n[[mesh]]\nfile = 'a.obj'\n";
    let scene = load(&[("a.toml", toml), ("a.obj", &mesh)], &LoadOptions::default());
    let most = corners_in_picture(&scene, 1.0 / 3.0).into_iter().map(|p| p.abs()).reduce(Vec2::max).unwrap();
    assert!((0.94..0.955).contains(&most.x), "{most}");
}

#[test]
fn a_scene_file_with_nothing_but_a_mesh_looks_like_the_bare_mesh() {
    let mesh = box_obj(Vec3::ZERO, Vec3::new(3.0, 1.0, 2.0));
    let files = |toml: &str| {
        load(&[("a.toml", &format!("{toml}\n[[mesh]]\nfile = 'a.obj'\n")), ("a.obj", &mesh)], &LoadOptions::default())
    };
    let bare = load(&[("a.obj", &mesh)], &LoadOptions::default());
    assert_eq!(bare.lights.len(), 2);
    assert!(bare.ambient.min_element() > 0.0 && bare.background.min_element() > 0.0);
    let scene = files("");
    assert_eq!((scene.camera, scene.lights), (bare.camera, bare.lights.clone()));
    assert_eq!((scene.ambient, scene.ground, scene.background), (bare.ambient, bare.ground, bare.background));
    // More light comes from the sky than from the ground, and a wall has its own colour.
    let Some(Ground { ambient: below, up: Up::Y }) = bare.ground else { panic!("{:?}", bare.ground) };
    assert!((bare.ambient - below).min_element() > 0.05, "{} {below}", bare.ambient);
    assert!((bare.ambient + below).abs_diff_eq(Vec3::splat(0.4), 1e-6));
    // What the file states stays as it is.
    let scene = files("background = [0, 0, 0.5]");
    assert_eq!((scene.lights, scene.background), (bare.lights.clone(), Vec3::new(0.0, 0.0, 0.5)));
    let scene = files("ambient = [0, 0, 0]");
    assert!(scene.lights.is_empty());
    assert_eq!((scene.ambient, scene.ground, scene.background), (Vec3::ZERO, None, Vec3::ZERO));
    let light = "kind = 'directional'\ndirection = [0, -1, 0]\nirradiance = [1, 1, 1]";
    let scene = files(&format!("[[light]]\n{light}"));
    assert_eq!((scene.lights.len(), scene.ambient, scene.background), (1, Vec3::ZERO, Vec3::ZERO));
    assert_eq!(scene.camera, bare.camera);
    let camera = "[camera]\neye = [0, 0, 9]\ntarget = [0, 0, 0]";
    let scene = files(camera);
    assert_eq!(scene.camera.eye, Vec3::new(0.0, 0.0, 9.0));
    assert_eq!(scene.lights.len(), 2);
}

#[test]
fn the_main_light_comes_over_the_viewers_left_shoulder() {
    for eye in [[0.0, 0.0, 9.0], [9.0, 1.0, 0.0], [-5.0, -3.0, -5.0]] {
        let disc = "[[mesh]]\ngenerator = 'disc'\nradius = 1\nsegments = 8\n";
        let scene = load_toml(&format!("[camera]\neye = {eye:?}\ntarget = [0, 0, 0]\n{disc}"));
        let forward = (scene.camera.target - scene.camera.eye).normalize();
        let right = forward.cross(Vec3::Y).normalize();
        let lights = scene.lights.iter().map(|light| match *light {
            Light::Directional { towards, irradiance } => (towards, irradiance.x),
            _ => panic!("{light:?}"),
        });
        let [(key, much), (fill, little)] = lights.collect::<Vec<_>>()[..] else { panic!("{:?}", scene.lights) };
        assert!(much > 2.0 * little && little > 0.0);
        assert!(key.dot(right) < -0.3 && fill.dot(right) > 0.3, "{key} and {fill}");
        assert!(key.y > 0.5 && fill.y > 0.2, "{key} and {fill}");
    }
}

/// Returns whether a scene's camera is in its bounding box.
fn is_inside(scene: &Scene) -> bool {
    let (min, max) = scene.bounds();
    scene.camera.eye.clamp(min, max) == scene.camera.eye
}

#[test]
fn rooms_are_seen_and_lit_from_inside() {
    let room = "[[mesh]]\ngenerator = 'room'\nsize = [6, 3, 9]\n";
    // The column hides the middle, and bodies hide what is behind them.
    let column = "[[mesh]]\ngenerator = 'box'\nsize = [0.5, 3, 0.5]\n";
    let mirrored = format!("{room}transform = {{ scale = [-1, 1, 1], translate = [100, 2, 0] }}\n");
    let turned = format!("{room}transform = {{ rotate = [0, 90, 0] }}\n");
    for text in [room, &format!("{room}{column}"), &mirrored, &turned] {
        let scene = load_toml(text);
        assert!(is_inside(&scene), "{text}: {:?}", scene.camera);
        let (min, max) = scene.bounds();
        // The view goes along the room.
        let (view, size) = ((scene.camera.target - scene.camera.eye).abs(), max - min);
        let (along, across) = if size.x > size.z { (view.x, view.z) } else { (view.z, view.x) };
        assert!(along > across, "{text}: {:?}", scene.camera);
        // Light from outside would not come in.
        assert!(scene.lights.iter().all(|light| matches!(light, Light::Point { .. })), "{:?}", scene.lights);
    }
    // Walls, a floor and a ceiling with thickness, and a table.
    let slabs = [
        ([6.0, 0.1, 9.0], [0.0, -1.5, 0.0]),
        ([6.0, 0.1, 9.0], [0.0, 1.5, 0.0]),
        ([0.1, 3.0, 9.0], [-3.0, 0.0, 0.0]),
        ([0.1, 3.0, 9.0], [3.0, 0.0, 0.0]),
        ([6.0, 3.0, 0.1], [0.0, 0.0, -4.5]),
        ([6.0, 3.0, 0.1], [0.0, 0.0, 4.5]),
        ([1.5, 0.1, 1.0], [1.0, -0.7, 0.5]),
    ];
    let slab =
        |(size, at)| format!("[[mesh]]\ngenerator = 'box'\nsize = {size:?}\ntransform = {{ translate = {at:?} }}\n");
    let built: String = slabs.into_iter().map(slab).collect();
    assert!(is_inside(&load_toml(&built)), "{:?}", load_toml(&built).camera);
    let half = Vec3::new(3.0, 1.5, 4.5);
    for (open, axis) in [("front", Vec3::Z), ("right", Vec3::X), ("back", Vec3::NEG_Z), ("left", Vec3::NEG_X)] {
        let sides: Vec<_> =
            ["left", "right", "bottom", "top", "back", "front"].into_iter().filter(|side| *side != open).collect();
        let scene = load_toml(&format!("{room}sides = {sides:?}\n"));
        let beyond = scene.camera.eye.dot(axis) - (half * axis).abs().max_element();
        assert!(beyond > 0.0, "{open}: the eye is not before the open side: {:?}", scene.camera);
        assert!(corners_in_picture(&scene, 4.0 / 3.0).iter().all(|p| p.abs().max_element() < 0.955), "{open}");
        assert!(scene.lights.iter().all(|light| matches!(light, Light::Point { .. })), "{:?}", scene.lights);
    }
}

#[test]
fn bodies_are_seen_from_outside() {
    let bodies = [
        "generator = 'box'\nsize = [6, 3, 9]\n",
        "generator = 'geodesic'\nradius = 1\nfrequency = 8\n",
        "generator = 'plane'\nsize = [8, 8]\n",
    ];
    for body in bodies {
        let scene = load_toml(&format!("[[mesh]]\n{body}"));
        assert!(!is_inside(&scene), "{body}: {:?}", scene.camera);
        assert!(scene.lights.iter().all(|light| matches!(light, Light::Directional { .. })), "{:?}", scene.lights);
    }
    // A sphere whose faces are reversed by mistake.
    let sphere = load_toml(&format!("[[mesh]]\n{}", bodies[1]));
    let mesh = &sphere.meshes[0];
    let points = mesh.positions.iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let faces = mesh.faces.iter().map(|[a, b, c]| format!("f {} {} {}\n", c + 1, b + 1, a + 1));
    let obj: String = points.chain(faces).collect();
    let scene = load(&[("a.obj", &obj)], &LoadOptions::default());
    assert!(!is_inside(&scene), "{:?}", scene.camera);
}

fn with_look(look: Look) -> LoadOptions {
    LoadOptions { look, ..LoadOptions::default() }
}

#[test]
fn the_users_up_turns_the_picture_and_its_lights() {
    let size = Vec3::new(2.0, 3.0, 1.0);
    let turned = Vec3::new(size.x, size.z, size.y);
    let [y, z] = [Up::Y, Up::Z].map(|up| with_look(Look { up: Some(up), ..Look::default() }));
    // A box whose y and z are exchanged is seen with z up as the box itself is seen with y up.
    let centred = |size: Vec3| box_obj(-size / 2.0, size);
    let before = load(&[("a.obj", &centred(size))], &y);
    let after = load(&[("a.obj", &centred(turned))], &z);
    let to_z = |v: Vec3| Vec3::new(v.x, -v.z, v.y);
    assert!(to_z(before.camera.eye).distance(after.camera.eye) < 1e-4, "{:?} {:?}", before.camera, after.camera);
    assert_eq!(after.camera.up, Vec3::Z);
    for lights in before.lights.iter().zip(&after.lights) {
        let (Light::Directional { towards: a, .. }, Light::Directional { towards: b, .. }) = lights else {
            panic!("{lights:?}")
        };
        assert!(to_z(*a).distance(*b) < 1e-4, "{a} {b}");
    }
    assert_eq!(load(&[("a.obj", &centred(size))], &LoadOptions::default()).camera, before.camera);
    // The picture of a scene's own camera is turned, too.
    let toml = "[camera]\neye = [0, -9, 2]\ntarget = [0, 0, 0]\n[[mesh]]\nfile = 'a.obj'\n";
    let files = [("a.toml", toml), ("a.obj", &centred(size))];
    assert_eq!(load(&files, &z).camera.up, Vec3::Z);
}

#[test]
fn stl_files_have_z_up_and_others_y() {
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 1\nendloop\nendfacet\n";
    let stl = format!("solid a\n{facet}endsolid a\n");
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 1\n3 0 1 2\n";
    let auto = LoadOptions::default();
    assert_eq!(load(&[("a.stl", &stl)], &auto).camera.up, Vec3::Z);
    assert_eq!(load(&[("a.ply", ply)], &auto).camera.up, Vec3::Y);
    let y = with_look(Look { up: Some(Up::Y), ..Look::default() });
    assert_eq!(load(&[("a.stl", &stl)], &y).camera.up, Vec3::Y);
    // A comment tells the axis, unless the user states another one.
    let blenders = ply.replace("element vertex", "comment Created by Blender 3.6\nelement vertex");
    assert_eq!(load(&[("a.ply", &blenders)], &auto).camera.up, Vec3::Z);
    assert_eq!(load(&[("a.ply", &blenders)], &y).camera.up, Vec3::Y);
    let in_scene = [("a.toml", "[[mesh]]\nfile = 'a.stl'\n"), ("a.stl", &stl)];
    assert_eq!(load(&in_scene, &auto).camera.up, Vec3::Y);
}

#[test]
fn the_users_look_replaces_the_scenes() {
    let toml = "ambient = [0.1, 0.1, 0.1]\nbackground = [0, 0, 1]\n[camera]\neye = [0, 0, 9]\ntarget = [0, 0, 0]\n\
                vertical_fov = 20\n[render]\nmetered = true\n[[light]]\nkind = 'point'\nposition = [1, 9, 1]\n\
                intensity = [9, 9, 9]\n[[mesh]]\ngenerator = 'box'\nsize = [2, 2, 2]\n\
                transform = { translate = [0, 1, 0] }\n";
    let files = [("a.toml", toml)];
    let scene = |look: Look| load(&files, &with_look(look));
    let same = load(&files, &LoadOptions::default());
    assert_eq!(scene(Look::default()), same);
    let (eye, target) = (Some(DVec3::new(5.0, 4.0, 3.0)), Some(DVec3::new(0.0, 0.5, 0.0)));
    let Camera { eye: moved, target: middle, .. } = scene(Look { eye, ..Look::default() }).camera;
    assert_eq!((moved, middle), (eye.unwrap().as_vec3(), Vec3::Y));
    let camera = scene(Look { target, ..Look::default() }).camera;
    assert_eq!((camera.eye, camera.target), (same.camera.eye, target.unwrap().as_vec3()));
    let wide = scene(Look { vertical_fov_degrees: Some(70.0), ..Look::default() }).camera;
    assert_eq!(wide.projection, Projection::Perspective { vertical_fov_degrees: 70.0 });
    let lit = scene(Look { light: Some(LightChoice::Along(Vec3::new(0.0, -2.0, 0.0))), ..Look::default() });
    let [Light::Directional { towards, .. }] = lit.lights[..] else { panic!("{:?}", lit.lights) };
    assert_eq!((towards, lit.ambient, lit.defaults.is_metered), (Vec3::Y, same.ambient, false));
    let dark = scene(Look { light: Some(LightChoice::None), background: Some(Vec3::ONE), ..Look::default() });
    assert!(dark.lights.is_empty() && dark.ambient == same.ambient && dark.background == Vec3::ONE);
    // A picture that no camera could show.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    fs::write(&path, toml).unwrap();
    for look in [
        Look { eye: Some(DVec3::Y), ..Look::default() },
        Look { eye: Some(DVec3::splat(2e9)), ..Look::default() },
        Look { up: Some(Up::Z), ..Look::default() },
        Look { vertical_fov_degrees: Some(180.0), ..Look::default() },
    ] {
        let error = Scene::load_with(&path, &with_look(look.clone())).unwrap_err().to_string();
        assert!(error.contains("a.toml"), "{look:?}: {error}");
    }
}

/// A sky replaces all light of a scene. Its sun is over the viewer's left shoulder, whichever axis points up.
#[test]
fn the_users_sky_replaces_all_light() {
    let toml = "ambient = { sky = [1, 1, 1], ground = [1, 1, 1] }\nbackground = [0, 0, 1]\n[render]\nmetered = true\n\
                [[light]]\nkind = 'point'\nposition = [1, 9, 1]\nintensity = [9, 9, 9]\n\
                [[mesh]]\ngenerator = 'box'\nsize = [2, 2, 2]\n";
    let choice = SkyChoice { elevation: 40.0, azimuth: None, turbidity: 4.0 };
    let with_sky = |choice| with_look(Look { sky: Some(choice), ..Look::default() });
    let obj = box_obj(Vec3::splat(-1.0), Vec3::splat(2.0));
    for files in [[("a.toml", toml)], [("a.obj", obj.as_str())]] {
        let scene = load(&files, &with_sky(choice));
        let sky = scene.sky.expect("a sky");
        assert_eq!((sky.up, sky.turbidity, sky.strength, sky.has_sun), (Up::Y, 4.0, 1.0, true));
        assert!(scene.lights.is_empty() && scene.ambient == Vec3::ZERO && scene.ground.is_none());
        assert_eq!((scene.background, scene.defaults.is_metered), (Vec3::ZERO, false));
        assert_eq!(scene.defaults.for_integrator(None).integrator, Integrator::Path);
        let right = (scene.camera.target - scene.camera.eye).cross(scene.camera.up);
        let behind = scene.camera.eye - scene.camera.target;
        assert!(sky.towards_sun.dot(right) < 0.0 && sky.towards_sun.dot(behind) > 0.0, "{sky:?}");
        assert!((sky.towards_sun.y.asin().to_degrees() - 40.0).abs() < 1e-3);
        let east = load(&files, &with_sky(SkyChoice { azimuth: Some(90.0), ..choice })).sky.unwrap().towards_sun;
        assert!(east.x > 0.7 && east.z.abs() < 1e-6, "{east}");
    }
    let (y, mut turned) = (load(&[("a.obj", &obj)], &with_sky(choice)), with_sky(choice));
    turned.look.up = Some(Up::Z);
    let z = load(&[("a.obj", &obj)], &turned).sky.unwrap();
    let Vec3 { x, y, z: depth } = y.sky.unwrap().towards_sun;
    assert!(z.up == Up::Z && z.towards_sun.distance(Vec3::new(x, -depth, y)) < 1e-4, "{z:?}");
}

/// A bare mesh stands on a ground, which no scene file and no interior gets. A scene file that is made of the mesh has
/// it.
#[test]
fn a_mesh_under_the_users_sky_stands_on_a_ground() {
    let sky = Some(SkyChoice { elevation: 40.0, azimuth: None, turbidity: 4.0 });
    let gold = vec!["gold".parse().unwrap()];
    let (min, size) = (Vec3::new(3.0, -2.0, 1.0), Vec3::new(2.0, 3.0, 4.0));
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("a.obj"), box_obj(min, size)).unwrap();
    for (up, axis) in [(Up::Y, 1), (Up::Z, 2)] {
        let look = Look { sky, up: Some(up), ..Look::default() };
        let bare = Scene::load_with(&path("a.obj"), &with_look(Look { sky: None, ..look.clone() })).unwrap();
        let scene = Scene::load_with(&path("a.obj"), &with_look(look.clone())).unwrap();
        assert_eq!((scene.camera, scene.instances.len()), (bare.camera, 2));
        let (least, greatest) = scene.bounds();
        let gap = min[axis] - least[axis];
        assert!(gap > 0.0 && gap < 1e-3 && greatest[axis] == (min + size)[axis], "{least} {greatest}");
        let middle = min + size / 2.0;
        for other in (0..3).filter(|other| *other != axis) {
            let radius = 10.0 * size.length();
            assert!((greatest[other] - middle[other] - radius).abs() < 0.01 * radius, "{least} {greatest}");
        }
        let flat = kdray::world::FlatScene::new(&scene).unwrap();
        let ground = flat.triangles.last().unwrap();
        let normal = (ground.v1 - ground.v0).cross(ground.v2 - ground.v0).normalize();
        assert!(normal.dot(up.vector()) > 0.9999, "{normal}");
        for look in [look.clone(), Look { materials: gold.clone(), ..look }] {
            let before = Scene::load_with(&path("a.obj"), &with_look(look.clone())).unwrap();
            let text = scene_file_of(&path("a.obj"), &path("b.toml"), &with_look(look)).unwrap();
            fs::write(path("b.toml"), &text).unwrap();
            let after = Scene::load(&path("b.toml")).unwrap();
            let [before, after] = [before, after].map(|scene| kdray::world::FlatScene::new(&scene).unwrap());
            assert_eq!(before.triangles, after.triangles, "{text}");
            let material =
                |flat: &kdray::world::FlatScene| flat.materials[*flat.triangle_materials.last().unwrap() as usize];
            assert_eq!(material(&before), material(&after), "{text}");
            assert_eq!(material(&before).kd, Vec3::splat(0.2));
        }
    }
    let toml = "[[mesh]]\nfile = 'a.obj'\n";
    fs::write(path("c.toml"), toml).unwrap();
    let look = || with_look(Look { sky, ..Look::default() });
    assert_eq!(Scene::load_with(&path("c.toml"), &look()).unwrap().instances.len(), 1);
    // A room: a box whose faces are turned inwards.
    let room = box_obj(min, size).replace("f 1 5 7 3", "f 3 7 5 1").replace("f 6 2 4 8", "f 8 4 2 6");
    let room = room.replace("f 1 2 6 5", "f 5 6 2 1").replace("f 7 8 4 3", "f 3 4 8 7");
    let room = room.replace("f 2 1 3 4", "f 4 3 1 2").replace("f 5 6 8 7", "f 7 8 6 5");
    assert_eq!(load(&[("interior_of_room.obj", &room)], &look()).instances.len(), 1);
}

/// `--light` takes the place of the sun; the sky stays.
#[test]
fn the_users_light_replaces_the_sun() {
    let toml = "sky = { elevation = 30 }\n[[mesh]]\ngenerator = 'box'\nsize = [2, 2, 2]\n";
    let look = Look { light: Some(LightChoice::None), ..Look::default() };
    let sky = load(&[("a.toml", toml)], &with_look(look)).sky.unwrap();
    assert_eq!(sky, Sky { has_sun: false, ..Sky::new([30.0, 0.0], Up::Y).unwrap() });
}

#[test]
fn a_field_of_view_keeps_a_bare_mesh_in_the_picture() {
    let look = Look { vertical_fov_degrees: Some(10.0), ..Look::default() };
    let scene = load(&[("a.obj", &box_obj(Vec3::ZERO, Vec3::ONE))], &with_look(look));
    let most = corners_in_picture(&scene, 4.0 / 3.0).into_iter().map(|p| p.abs()).reduce(Vec2::max).unwrap();
    assert!((0.94..0.955).contains(&most.max_element()), "{most}");
}

#[test]
fn converted_files_keep_the_look_and_the_samples() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("a.obj"), box_obj(Vec3::ZERO, Vec3::ONE)).unwrap();
    let toml = "[[light]]\nkind = 'directional'\ndirection = [0, -1, 0]\nirradiance = [1, 1, 1]\n\
                [render]\nmetered = true\n[[mesh]]\nfile = 'a.obj'\n";
    fs::write(path("b.toml"), toml).unwrap();
    let along = Some(LightChoice::Along(Vec3::new(1.0, -2.0, -0.3)));
    for (input, samples) in [("a.obj", 4), ("b.toml", 1)] {
        for light in [None, Some(LightChoice::None), along] {
            let (eye, background) = (Some(DVec3::new(3.0, 4.0, 5.0)), Some(Vec3::new(0.1, 0.2, 0.3)));
            let options = with_look(Look { eye, light, background, up: Some(Up::Z), ..Look::default() });
            let text = scene_file_of(&path(input), &path("c.toml"), &options).unwrap();
            fs::write(path("c.toml"), &text).unwrap();
            let (before, after) =
                (Scene::load_with(&path(input), &options).unwrap(), Scene::load(&path("c.toml")).unwrap());
            assert_eq!((before.camera, &before.lights), (after.camera, &after.lights), "{text}");
            assert_eq!((before.ambient, before.ground), (after.ambient, after.ground), "{text}");
            assert_eq!(before.background, after.background, "{text}");
            assert_eq!(before.defaults, after.defaults, "{text}");
            assert_eq!(after.defaults.samples, samples, "{text}");
        }
        let choice = SkyChoice { elevation: 33.3, azimuth: None, turbidity: 2.7 };
        let options = with_look(Look { sky: Some(choice), ..Look::default() });
        let text = scene_file_of(&path(input), &path("c.toml"), &options).unwrap();
        fs::write(path("c.toml"), &text).unwrap();
        let (before, after) =
            (Scene::load_with(&path(input), &options).unwrap(), Scene::load(&path("c.toml")).unwrap());
        assert!(before.sky.is_some() && before.sky == after.sky, "{text}");
        assert_eq!((&before.lights, before.background), (&after.lights, after.background), "{text}");
    }
}

/// Metals and glass need something to mirror. What is diffuse, rough or lit by its file keeps the plain background.
#[test]
fn bare_files_with_metals_or_glass_get_a_studio() {
    let obj = box_obj(Vec3::ZERO, Vec3::ONE).replacen("f 1", "mtllib m.mtl\nusemtl a\nf 1", 1);
    let studio = |mtl: &str, look: Look| {
        let mtl = format!("newmtl a\n{mtl}\n");
        load(&[("a.obj", &obj), ("m.mtl", &mtl)], &LoadOptions { look, ..LoadOptions::default() }).studio
    };
    for mtl in ["Pm 1\nPr 0.1", "illum 3\nKs 0.9 0.9 0.9", "illum 7\nKs 1 1 1\nTf 1 1 1"] {
        let to_viewer = studio(mtl, Look::default()).unwrap_or_else(|| panic!("{mtl}"));
        assert!(to_viewer.is_normalized() && to_viewer.y.abs() < 1e-6 && to_viewer.z > 0.0, "{to_viewer}");
        assert_eq!(
            studio(
                mtl,
                Look { sky: Some(SkyChoice { elevation: 30.0, azimuth: None, turbidity: 3.0 }), ..Look::default() }
            ),
            None
        );
    }
    let of_z = studio("Pm 1\nPr 0.1", Look { up: Some(Up::Z), ..Look::default() }).unwrap();
    assert!(of_z.z.abs() < 1e-6 && of_z.y < 0.0, "{of_z}");
    for mtl in ["Kd 0.5 0.5 0.5", "Pm 1\nPr 0.9", "Pm 0\nPr 0.1", "illum 2\nKs 1 1 1", "illum 5\nKs 0.2 0.2 0.2"] {
        assert_eq!(studio(mtl, Look::default()), None, "{mtl}");
    }
    let toml = "[materials]\na = { metallic = 1, roughness = 0.1 }\n\
                [[mesh]]\ngenerator = 'box'\nsize = [1, 1, 1]\nmaterials = ['a']\n";
    assert!(load_toml(toml).studio.is_some());
    assert_eq!(load_toml(&format!("ambient = [1, 1, 1]\n{toml}")).studio, None);
    assert_eq!(load_toml(&format!("ambient = [1, 1, 1]\nstudio = [0, 0, 2]\n{toml}")).studio, Some(Vec3::Z));
    // A scene file of such a file has the same studio.
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.obj"), &obj).unwrap();
    fs::write(folder.path().join("m.mtl"), "newmtl a\nPm 1\nPr 0.1\n").unwrap();
    let (input, output) = (folder.path().join("a.obj"), folder.path().join("b.toml"));
    fs::write(&output, scene_file_of(&input, &output, &LoadOptions::default()).unwrap()).unwrap();
    assert_eq!(Scene::load(&output).unwrap().studio, Scene::load(&input).unwrap().studio);
}
